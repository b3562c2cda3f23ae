// The views of `occlusion-textures`, their slices, and the kernel that a light is seen through.
#ifndef ANTUMBRA_OCCLUSION_TEXTURES_PARAMS_GLSL
#define ANTUMBRA_OCCLUSION_TEXTURES_PARAMS_GLSL

// Views of a light that looks all round.
const uint MAX_OCCLUSION_VIEWS = 6u;

// Fine slices that the scene is cut into, and words that hold a bit for each.
const uint MAX_FINE_SLICES = 128u;
const uint FINE_WORDS = 4u;

// A view has its centre of projection behind the light's centre. v = (x, y, z) is the offset in
// metres from the light's centre (of a sun: from the origin of scene space) along right, up and
// forward. The image has the same coordinates for all slices:
//     u = (x, y) / (z + behind), orthographic u = (x, y); map = (u - corner) * scale.
struct OcclusionView {
    vec4 right;   // xyz: unit vector; w: corner.x
    vec4 up;      // xyz: unit vector; w: corner.y
    vec4 forward; // xyz: unit vector; w: metres from the centre of projection to the light's centre
    vec4 scale;   // x, y: scale; z: 1 perspective, 0 orthographic; w: largest |x| / z of receivers
                  // that take this view
    vec4 range;   // x: nearest, y: farthest plane, metres; z: part of the planes' distribution that
                  // is uniform in 1/z
    vec4 half_x;  // halves of the light along right, up and forward, metres; of a sun tangents
    vec4 half_y;  // the same of its other axis
    vec4 border;  // xy: lowest, zw: highest map coordinates that are known: 0, 1; far out on sides
                  // beyond which there is nothing
};

// 1 over what image coordinates are divided by at depth z.
float occlusion_inverse(OcclusionView view, float z) {
    return view.scale.z > 0.0 ? 1.0 / (z + view.forward.w) : 1.0;
}

// 0 to 1 through the depth range: the distribution of slice planes.
float slice_place(OcclusionView view, float z) {
    float near = view.range.x;
    float far = view.range.y;
    float linear = (z - near) / (far - near);
    if (view.range.z <= 0.0) {
        return linear;
    }
    float inverse = linear * far / max(z, 0.5 * near); // (1/near - 1/z) / (1/near - 1/far)
    return mix(linear, inverse, view.range.z);
}

#endif
