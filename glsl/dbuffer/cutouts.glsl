// The light samples that triangles with holes hide. They have no silhouettes: where they end is in
// their textures.
#ifndef ANTUMBRA_DBUFFER_CUTOUTS_GLSL
#define ANTUMBRA_DBUFFER_CUTOUTS_GLSL

#include "common/holes.glsl"
#include "dbuffer/coverage.glsl"

// Line on the light, at places (u, v): where its value u x + v y + z is positive, a plane through the
// receiver has the light on its front.
vec3 line_on_light(CoverageReceiver r, vec3 normal) {
    return vec3(dot(normal, r.axis_u), dot(normal, r.axis_v), dot(normal, r.center));
}

float most_on_light(vec3 line) {
    return line.z + abs(line.x) + abs(line.y);
}

vec4 at_samples(vec3 line, uint i) {
    return line.x * params.samples[2u * i] + line.y * params.samples[2u * i + 1u] + line.z;
}

// Four bits where numbers are at least 0.
uint bits_of(vec4 numbers) {
    uvec4 is_set = uvec4(greaterThanEqual(numbers, vec4(0.0)));
    return is_set.x | is_set.y << 1 | is_set.z << 2 | is_set.w << 3;
}

// Whether a triangle has holes and may hide any of the light.
bool cutout_may_matter(CoverageReceiver r, uint triangle) {
    Reach ab = larger(reach_of(r, fetch_corner(triangle, 0u).position - r.p),
        reach_of(r, fetch_corner(triangle, 1u).position - r.p));
    Reach most = larger(ab, reach_of(r, fetch_corner(triangle, 2u).position - r.p));
    return may_matter(most) && material_is_masked(fetch_triangle_texel(4u * triangle + 3u).w);
}

// Takes the samples that the triangle hides out of those still seen: a bit for each, 32 in a word.
void add_cutout(CoverageReceiver r, uint triangle, inout uvec2 seen) {
    vec3 a = fetch_corner(triangle, 0u).position - r.p;
    vec3 b = fetch_corner(triangle, 1u).position - r.p;
    vec3 c = fetch_corner(triangle, 2u).position - r.p;
    vec4 plane = fetch_triangle_texel(4u * triangle + 3u);
    float height = dot(plane.xyz, a);
    float turn = height > 0.0 ? 1.0 : -1.0;
    vec3 bc = line_on_light(r, turn * cross(b, c));
    vec3 ca = line_on_light(r, turn * cross(c, a));
    vec3 ab = line_on_light(r, turn * cross(a, b));
    // Before the light, not behind it.
    vec3 before = line_on_light(r, turn * plane.xyz);
    before.z -= LIGHT_SHAPE == LIGHT_SUN ? 0.0 : abs(height);
    float most = min(min(most_on_light(bc), most_on_light(ca)), min(most_on_light(ab), most_on_light(before)));
    if (most < 0.0 || abs(height) <= r.rounding_m) {
        return;
    }
    uvec2 within = uvec2(0u);
    for (uint i = 0u; i < FOURS; ++i) {
        vec4 least = min(min(at_samples(bc, i), at_samples(ca, i)), min(at_samples(ab, i), at_samples(before, i)));
        uint bits = bits_of(least);
        within.x |= i < 8u ? bits << (4u * i & 31u) : 0u;
        within.y |= i < 8u ? 0u : bits << (4u * i & 31u);
    }
    within &= seen;
    if ((within.x | within.y) == 0u) {
        return;
    }
    uint material = material_number(plane.w);
    Holes holes = fetch_holes(material);
    vec4 uv_ab = fetch_uv_texel(triangle_texel_place(2u * triangle));
    vec2 uv_c = fetch_uv_texel(triangle_texel_place(2u * triangle + 1u)).xy;
    while ((within.x | within.y) != 0u) {
        uint sample_index = within.x != 0u ? uint(findLSB(within.x)) : 32u + uint(findLSB(within.y));
        uint fours = sample_index / 4u;
        vec3 place = vec3(params.samples[2u * fours][sample_index % 4u],
            params.samples[2u * fours + 1u][sample_index % 4u], 1.0);
        vec3 weights = vec3(dot(bc, place), dot(ca, place), dot(ab, place));
        float sum = weights.x + weights.y + weights.z;
        weights = sum != 0.0 ? weights / sum : vec3(1.0, 0.0, 0.0);
        uvec2 bit = sample_index < 32u ? uvec2(1u << sample_index, 0u) : uvec2(0u, 1u << (sample_index - 32u));
        vec2 uv = weights.x * uv_ab.xy + weights.y * uv_ab.zw + weights.z * uv_c;
        bool hole = is_hole_at(holes, uv);
        seen &= hole ? uvec2(0xffffffffu) : ~bit;
        within &= ~bit;
    }
}

#endif
