// Colours of textures, in an image of the texels of all of them: each texture begins a row and runs on through as many as
// it needs.
#ifndef ANTUMBRA_COMMON_TEXTURES_GLSL
#define ANTUMBRA_COMMON_TEXTURES_GLSL

#include "common/materials.glsl"

vec4 fetch_texture_texel(ivec2 place); // defined by the entry file; place in the image

// The texel of 0 to size - 1 that stands at a whole number.
float wrap_texel(float index, float size, float mode) {
    float repeated = index - size * floor(index / size);
    float doubled = index - 2.0 * size * floor(index / (2.0 * size));
    float mirrored = min(doubled, 2.0 * size - 1.0 - doubled);
    float at = mode < 0.5 ? repeated : (mode < 1.5 ? mirrored : index);
    return clamp(at, 0.0, size - 1.0);
}

// Colour and alpha at uv, linear, bilinear between texel centres.
vec4 texture_color(vec4 texture_place, vec2 uv) {
    vec2 size = texture_place.yz;
    float mode_v = floor(texture_place.w / 3.0);
    float mode_u = texture_place.w - 3.0 * mode_v;
    vec2 place = uv * size - 0.5;
    vec2 first = floor(place);
    vec2 part = clamp(place - first, 0.0, 1.0);
    vec2 x = vec2(wrap_texel(first.x, size.x, mode_u), wrap_texel(first.x + 1.0, size.x, mode_u));
    vec2 y = vec2(wrap_texel(first.y, size.y, mode_v), wrap_texel(first.y + 1.0, size.y, mode_v));
    uint start = uint(texture_place.x) * TRIANGLE_IMAGE_WIDTH;
    uvec2 top = uint(y.x) * uint(size.x) + uvec2(x) + start;
    uvec2 bottom = uint(y.y) * uint(size.x) + uvec2(x) + start;
    vec4 upper = mix(fetch_texture_texel(triangle_texel_place(top.x)),
        fetch_texture_texel(triangle_texel_place(top.y)), part.x);
    vec4 lower = mix(fetch_texture_texel(triangle_texel_place(bottom.x)),
        fetch_texture_texel(triangle_texel_place(bottom.y)), part.x);
    return mix(upper, lower, part.y);
}

#endif
