// The texels whose centres a triangle covers as the light sees it, with the depths there: what
// `count.comp` and `fill.comp` share. One invocation looks at one triangle.
#ifndef ANTUMBRA_MDI_COVERAGE_GLSL
#define ANTUMBRA_MDI_COVERAGE_GLSL

#include "common/materials.glsl"
#include "mdi/params.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std140) uniform MdiBlock {
    MdiParams params;
};
layout(set = 0, binding = 1) uniform sampler2D triangles;
layout(set = 0, binding = 2) uniform sampler2D materials;
layout(set = 0, binding = 3) uniform sampler2D triangle_uvs;
layout(set = 0, binding = 4) uniform sampler2D texels;

layout(push_constant) uniform Push {
    uint view;
    uint groups_across;
} push;

// 1 where triangles of the scene may have holes.
layout(constant_id = 0) const uint MASKED = 0u;

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

vec4 fetch_material_texel(ivec2 place) {
    return texelFetch(materials, place, 0);
}

vec4 fetch_uv_texel(ivec2 place) {
    return texelFetch(triangle_uvs, place, 0);
}

vec4 fetch_texture_texel(ivec2 place) {
    return texelFetch(texels, place, 0);
}

// Defined by the entry file. nearest, farthest: depths along the view between which the triangle
// lies within the texel, metres; z: at its centre.
void cover_texel(ivec2 texel, float z, float nearest, float farthest);

// A corner in a view: texels across and down, and what is affine in them: 1 / z, of a sun z.
vec3 corner_in_view(LightView light_view, vec3 v, float size) {
    bool perspective = light_view.forward.w > 0.0;
    vec2 at = perspective ? v.xy / v.z : v.xy;
    at = (at - vec2(light_view.right.w, light_view.up.w)) * light_view.scale.xy * size;
    return vec3(at, perspective ? 1.0 / v.z : v.z);
}

float cross_2d(vec2 a, vec2 b) {
    return a.x * b.y - a.y * b.x;
}

// Corners relative to the texel `base`, which keeps products small.
void cover_triangle(uint triangle, LightView light_view, vec3 a, vec3 b, vec3 c, bool holes) {
    float size = float(params.counts.y);
    bool perspective = light_view.forward.w > 0.0;
    vec2 low = min(a.xy, min(b.xy, c.xy));
    vec2 high = max(a.xy, max(b.xy, c.xy));
    // Centres of texels lie at whole numbers and a half.
    ivec2 first = ivec2(clamp(ceil(low - 0.5), 0.0, size));
    ivec2 last = ivec2(clamp(floor(high - 0.5), -1.0, size - 1.0));
    float area = cross_2d(b.xy - a.xy, c.xy - a.xy);
    if (any(lessThan(last, first)) || area == 0.0) {
        return;
    }
    float turn = area > 0.0 ? 1.0 : -1.0;
    vec2 to_b = b.xy - a.xy;
    vec2 to_c = c.xy - a.xy;
    // The gradient of depth in texels.
    vec2 slope = vec2((b.z - a.z) * to_c.y - (c.z - a.z) * to_b.y,
        (c.z - a.z) * to_b.x - (b.z - a.z) * to_c.x) / area;
    float reach = 0.5 * (abs(slope.x) + abs(slope.y));
    float least = min(a.z, min(b.z, c.z));
    float most = max(a.z, max(b.z, c.z));
    for (int y = first.y; y <= last.y; ++y) {
        for (int x = first.x; x <= last.x; ++x) {
            vec2 p = vec2(x, y) + 0.5;
            precise float u = cross_2d(c.xy - b.xy, p - b.xy) * turn;
            precise float v = cross_2d(a.xy - c.xy, p - c.xy) * turn;
            precise float w = cross_2d(b.xy - a.xy, p - a.xy) * turn;
            if (u < 0.0 || v < 0.0 || w < 0.0) {
                continue;
            }
            float at = clamp(a.z + dot(slope, p - a.xy), least, most);
            if (MASKED != 0u && holes) {
                vec3 weights = vec3(u, v, w) / max(abs(area), 1.0e-38);
                if (perspective) {
                    // Weights in space from weights in the image.
                    weights *= vec3(a.z, b.z, c.z);
                    weights /= weights.x + weights.y + weights.z;
                }
                float stored = fetch_triangle_texel(4u * triangle + 3u).w;
                if (is_hole(material_number(stored), fetch_uv(triangle, weights))) {
                    continue;
                }
            }
            float from = clamp(at - reach, least, most);
            float to = clamp(at + reach, least, most);
            vec3 z = perspective ? vec3(1.0 / at, 1.0 / to, 1.0 / from) : vec3(at, from, to);
            cover_texel(ivec2(x, y), z.x, z.y, z.z);
        }
    }
}

void cover(uint triangle) {
    if (triangle >= params.counts.w) {
        return;
    }
    LightView light_view = params.views[push.view];
    float nearest = params.buckets[push.view].w;
    float size = float(params.counts.y);
    vec3 v[3];
    for (int i = 0; i < 3; ++i) {
        vec3 p = fetch_corner(triangle, uint(i)).position - params.origin.xyz;
        v[i] = vec3(dot(p, light_view.right.xyz), dot(p, light_view.up.xyz),
            dot(p, light_view.forward.xyz));
    }
    bool holes = MASKED != 0u
        && material_is_masked(fetch_triangle_texel(4u * triangle + 3u).w);
    bvec3 behind = lessThan(vec3(v[0].z, v[1].z, v[2].z), vec3(nearest));
    if (all(behind)) {
        return;
    }
    if (!any(behind)) {
        vec3 a = corner_in_view(light_view, v[0], size);
        vec3 b = corner_in_view(light_view, v[1], size);
        vec3 c = corner_in_view(light_view, v[2], size);
        cover_triangle(triangle, light_view, a, b, c, holes);
        return;
    }
    // Turn the corners so that the odd one out is the first, and cut.
    int odd = behind.x == behind.y ? 2 : behind.y == behind.z ? 0 : 1;
    bool odd_behind = behind[odd];
    vec3 a = v[odd];
    vec3 b = v[(odd + 1) % 3];
    vec3 c = v[(odd + 2) % 3];
    vec3 ab = mix(a, b, (nearest - a.z) / (b.z - a.z));
    vec3 ac = mix(a, c, (nearest - a.z) / (c.z - a.z));
    ab.z = nearest;
    ac.z = nearest;
    vec3 in_ab = corner_in_view(light_view, ab, size);
    vec3 in_ac = corner_in_view(light_view, ac, size);
    // Holes are not looked for in cut triangles: their corners have no texture coordinates.
    if (odd_behind) {
        vec3 in_b = corner_in_view(light_view, b, size);
        vec3 in_c = corner_in_view(light_view, c, size);
        cover_triangle(triangle, light_view, in_ab, in_b, in_c, false);
        cover_triangle(triangle, light_view, in_ab, in_c, in_ac, false);
    } else {
        vec3 in_a = corner_in_view(light_view, a, size);
        cover_triangle(triangle, light_view, in_a, in_ab, in_ac, false);
    }
}

uint triangle_of_invocation() {
    uint group = gl_WorkGroupID.y * push.groups_across + gl_WorkGroupID.x;
    return group * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
}

#endif
