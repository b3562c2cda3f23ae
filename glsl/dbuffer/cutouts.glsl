// The light samples that triangles with holes hide. They have no silhouettes: where they end is in
// their textures.
#ifndef ANTUMBRA_DBUFFER_CUTOUTS_GLSL
#define ANTUMBRA_DBUFFER_CUTOUTS_GLSL

#include "common/materials.glsl"
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

// Sets the samples that the triangle hides to 1.
void add_cutout(CoverageReceiver r, uint triangle, inout vec4 cut_out[FOURS]) {
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
    uint material = material_number(plane.w);
    for (uint i = 0u; i < FOURS; ++i) {
        vec4 at_a = at_samples(bc, i);
        vec4 at_b = at_samples(ca, i);
        vec4 at_c = at_samples(ab, i);
        vec4 least = min(min(at_a, at_b), min(at_c, at_samples(before, i)));
        least = mix(least, vec4(-1.0), greaterThan(cut_out[i], vec4(0.0)));
        for (uint j = 0u; j < 4u; ++j) {
            if (least[j] >= 0.0) {
                vec3 weights = vec3(at_a[j], at_b[j], at_c[j]);
                float sum = weights.x + weights.y + weights.z;
                weights = sum != 0.0 ? weights / sum : vec3(1.0, 0.0, 0.0);
                cut_out[i][j] = is_hole(material, fetch_uv(triangle, weights)) ? 0.0 : 1.0;
            }
        }
    }
}

#endif
