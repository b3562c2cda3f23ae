// A ray from a receiver to a point of the light, down the scene's hierarchy.
#ifndef ANTUMBRA_DBUFFER_RAY_GLSL
#define ANTUMBRA_DBUFFER_RAY_GLSL

#include "common/hierarchy.glsl"
#include "common/holes.glsl"
#include "common/triangles.glsl"

// 1 where triangles of the scene may have holes.
layout(constant_id = 2) const uint MASKED = 0u;

// What a ray looks at: triangles without holes, those with holes, or all.
const uint SOLID = 1u;
const uint CUTOUT = 2u;

// Steps of all walks of a receiver together. A software driver may end loops after 65,535 turns of all of an
// invocation's loops, those of the lanes beside it among them: walks end themselves before, with what they
// know.
const uint MOST_STEPS = 24576u;

const uint NO_TRIANGLE = 0xffffffffu;

// Whether a triangle is between p and p + to (of a sun: anywhere along to), and no hole is there. Shared
// edges belong to both triangles, so no ray passes between them. Nearer than rounding_m it is the
// receiver's own, or one with it.
bool ray_meets_triangle(vec3 p, vec3 to, bool sun, uint triangle, float rounding_m, uint kinds) {
    vec4 plane = fetch_triangle_texel(4u * triangle + 3u);
    bool masked = material_is_masked(plane.w);
    if ((kinds & (masked ? CUTOUT : SOLID)) == 0u) {
        return false;
    }
    vec3 a = fetch_corner(triangle, 0u).position - p;
    vec3 b = fetch_corner(triangle, 1u).position - p;
    vec3 c = fetch_corner(triangle, 2u).position - p;
    float height = dot(plane.xyz, a);
    float climb = dot(plane.xyz, to);
    bool ahead = abs(height) > rounding_m && (height > 0.0) == (climb > 0.0)
        && (sun || abs(climb) > abs(height));
    precise float u = dot(to, cross(c, b));
    precise float v = dot(to, cross(a, c));
    precise float w = dot(to, cross(b, a));
    bool inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    bool meets = ahead && inside;
    if (MASKED != 0u && masked && meets) {
        float sum = u + v + w;
        vec3 weights = sum != 0.0 ? vec3(u, v, w) / sum : vec3(1.0, 0.0, 0.0);
        meets = !is_hole(material_number(plane.w), fetch_uv(triangle, weights));
    }
    return meets;
}

// steps: of walks so far; at MOST_STEPS nothing more is looked at.
bool ray_is_blocked(vec3 p, vec3 to, bool sun, uint nodes, float rounding_m, uint kinds, inout uint steps) {
    // A direction along an axis meets boxes by where it is, not by a quotient of nothing.
    vec3 safe = mix(to, vec3(1.0e-30), equal(to, vec3(0.0)));
    vec3 inverse = 1.0 / safe;
    float most = sun ? 3.0e38 : 1.0;
    bool blocked = false;
    uint node = 0u;
    while (node < nodes && steps < MOST_STEPS) {
        // Boxes until one holds a triangle: vector units test triangles for all of their lanes or for none.
        uint triangle = NO_TRIANGLE;
        while (node < nodes && steps < MOST_STEPS && triangle == NO_TRIANGLE) {
            steps += 1u;
            vec4 low = fetch_node_low(node);
            // Boxes wider by the rounding: those of level triangles are flat.
            vec3 near = (low.xyz - rounding_m - p) * inverse;
            vec3 far = (fetch_node_high(node).xyz + rounding_m - p) * inverse;
            vec3 first = min(near, far);
            vec3 last = max(near, far);
            float enter = max(first.x, max(first.y, max(first.z, 0.0)));
            float leave = min(last.x, min(last.y, min(last.z, most)));
            bool is_leaf = low.w >= 0.0;
            bool is_met = enter <= leave;
            triangle = is_leaf && is_met ? uint(low.w) : NO_TRIANGLE;
            node = is_leaf || is_met ? node + 1u : uint(-low.w);
        }
        if (triangle != NO_TRIANGLE) {
            steps += 1u;
            blocked = ray_meets_triangle(p, to, sun, triangle, rounding_m, kinds);
            node = blocked ? nodes : node;
        }
    }
    return blocked;
}

#endif
