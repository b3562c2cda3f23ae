// Materials and textures, in images like those of the triangles.
//
// Material, four texels: base colour and alpha, linear; of its texture the first row, width, height
// and wrap modes (u + 3 v; 0 repeat, 1 mirror, 2 clamp), width 0 for none; roughness, metallic,
// alpha cutoff; emissive colour.
// Texture coordinates, two texels a triangle: of corners 0 and 1, of corner 2.
// Texels of all textures: each texture begins a row and runs on through as many as it needs.
#ifndef ANTUMBRA_COMMON_MATERIALS_GLSL
#define ANTUMBRA_COMMON_MATERIALS_GLSL

#include "common/triangles.glsl"

const uint MATERIAL_TEXELS = 4u;

// Defined by the entry file; places in the images.
vec4 fetch_material_texel(ivec2 place);
vec4 fetch_uv_texel(ivec2 place);
vec4 fetch_texture_texel(ivec2 place);

vec4 fetch_base_color(uint material) {
    return fetch_material_texel(triangle_texel_place(MATERIAL_TEXELS * material));
}

vec4 fetch_texture(uint material) {
    return fetch_material_texel(triangle_texel_place(MATERIAL_TEXELS * material + 1u));
}

// x: roughness, y: metallic, z: alpha cutoff.
vec4 fetch_finish(uint material) {
    return fetch_material_texel(triangle_texel_place(MATERIAL_TEXELS * material + 2u));
}

vec3 fetch_emissive(uint material) {
    return fetch_material_texel(triangle_texel_place(MATERIAL_TEXELS * material + 3u)).rgb;
}

// Texture coordinates where corners 0, 1 and 2 of a triangle have these weights.
vec2 fetch_uv(uint triangle, vec3 weights) {
    vec4 ab = fetch_uv_texel(triangle_texel_place(2u * triangle));
    vec2 c = fetch_uv_texel(triangle_texel_place(2u * triangle + 1u)).xy;
    return weights.x * ab.xy + weights.y * ab.zw + weights.z * c;
}

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

// Whether alpha cuts a hole into a masked material at uv.
bool is_hole(uint material, vec2 uv) {
    float alpha = fetch_base_color(material).a * texture_color(fetch_texture(material), uv).a;
    return alpha < fetch_finish(material).z;
}

#endif
