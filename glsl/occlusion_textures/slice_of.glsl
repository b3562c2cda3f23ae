// The fine slice that a depth lies in.
#ifndef ANTUMBRA_OCCLUSION_TEXTURES_SLICE_OF_GLSL
#define ANTUMBRA_OCCLUSION_TEXTURES_SLICE_OF_GLSL

// range: nearest and farthest plane in metres, part of the planes' distribution that is uniform in
// 1/z, number of slices. -1 beyond the last plane, where nothing can block a receiver; what is
// nearer than the first is in the first slice.
float slice_of(float z, vec4 range) {
    float linear = (z - range.x) / (range.y - range.x);
    float inverse = linear * range.y / max(z, 0.5 * range.x);
    float place = range.z > 0.0 ? mix(linear, inverse, range.z) : linear;
    return z > range.y ? -1.0 : clamp(floor(place * range.w), 0.0, range.w - 1.0);
}

#endif
