// A ray from a receiver to a point of the light, down the scene's hierarchy. Triangles with holes are
// not looked at.
#ifndef ANTUMBRA_DBUFFER_RAY_GLSL
#define ANTUMBRA_DBUFFER_RAY_GLSL

#include "common/hierarchy.glsl"
#include "common/triangles.glsl"

// Whether a triangle is between p and p + to (of a sun: anywhere along to). Shared edges belong to both
// triangles, so no ray passes between them. Nearer than rounding_m it is the receiver's own, or one with
// it.
bool ray_meets_triangle(vec3 p, vec3 to, bool sun, uint triangle, float rounding_m) {
    vec3 a = fetch_corner(triangle, 0u).position - p;
    vec3 b = fetch_corner(triangle, 1u).position - p;
    vec3 c = fetch_corner(triangle, 2u).position - p;
    vec4 plane = fetch_triangle_texel(4u * triangle + 3u);
    float height = dot(plane.xyz, a);
    float climb = dot(plane.xyz, to);
    bool ahead = abs(height) > rounding_m && (height > 0.0) == (climb > 0.0)
        && (sun || abs(climb) > abs(height));
    precise float u = dot(to, cross(c, b));
    precise float v = dot(to, cross(a, c));
    precise float w = dot(to, cross(b, a));
    bool inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    return ahead && inside && !material_is_masked(plane.w);
}

bool ray_is_blocked(vec3 p, vec3 to, bool sun, uint nodes, float rounding_m) {
    // A direction along an axis meets boxes by where it is, not by a quotient of nothing.
    vec3 safe = mix(to, vec3(1.0e-30), equal(to, vec3(0.0)));
    vec3 inverse = 1.0 / safe;
    float most = sun ? 3.0e38 : 1.0;
    bool blocked = false;
    uint node = 0u;
    while (node < nodes) {
        vec4 low = fetch_node_low(node);
        uint next = node + 1u;
        if (low.w >= 0.0) {
            blocked = ray_meets_triangle(p, to, sun, uint(low.w), rounding_m);
            next = blocked ? nodes : next;
        } else {
            // Boxes wider by the rounding: those of level triangles are flat.
            vec3 near = (low.xyz - rounding_m - p) * inverse;
            vec3 far = (fetch_node_high(node).xyz + rounding_m - p) * inverse;
            vec3 first = min(near, far);
            vec3 last = max(near, far);
            float enter = max(first.x, max(first.y, max(first.z, 0.0)));
            float leave = min(last.x, min(last.y, min(last.z, most)));
            next = enter <= leave ? next : uint(-low.w);
        }
        node = next;
    }
    return blocked;
}

#endif
