// Materials and textures, in images like those of the triangles.
//
// Material, four texels: base colour and alpha, linear; of its texture the first row, width, height
// and wrap modes (u + 3 v; 0 repeat, 1 mirror, 2 clamp), width 0 for none; roughness, metallic,
// alpha cutoff, first row of its footprints; emissive colour.
// Texture coordinates, two texels a triangle: of corners 0 and 1, of corner 2.
#ifndef ANTUMBRA_COMMON_MATERIALS_GLSL
#define ANTUMBRA_COMMON_MATERIALS_GLSL

#include "common/triangles.glsl"

const uint MATERIAL_TEXELS = 4u;

// Defined by the entry file; places in the images.
vec4 fetch_material_texel(ivec2 place);
vec4 fetch_uv_texel(ivec2 place);

vec4 fetch_base_color(uint material) {
    return fetch_material_texel(triangle_texel_place(MATERIAL_TEXELS * material));
}

vec4 fetch_texture(uint material) {
    return fetch_material_texel(triangle_texel_place(MATERIAL_TEXELS * material + 1u));
}

// x: roughness, y: metallic, z: alpha cutoff, w: first row of its footprints (`common/holes.glsl`).
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

#endif
