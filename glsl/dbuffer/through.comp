#version 460
// Whether a surface cuts through the light itself. Seen from a receiver it ends in the light's own plane
// then, where it has no edge: silhouettes do not tell what it hides.

#include "common/hierarchy.glsl"
#include "common/light.glsl"
#include "common/triangles.glsl"
#include "common/view_params.glsl"
#include "dbuffer/through.glsl"

layout(local_size_x = 1) in;

layout(constant_id = 0) const uint LIGHT_SHAPE = 1u;

layout(set = 0, binding = 0, std140) uniform View {
    ViewParams view;
};
layout(set = 0, binding = 1) uniform sampler2D triangles;
layout(set = 0, binding = 2) uniform sampler2D hierarchy;
layout(set = 0, binding = 3, std430) writeonly buffer Result {
    Through through;
};

layout(push_constant) uniform Push {
    uint nodes;
} push;

// What is nearer to the light's plane than this part of the light's size does not cut it: a lamp's own
// mesh lies there.
const float TOUCHING = 1.0e-4;

// A software driver may end loops after 65,535 turns.
const uint MOST_STEPS = 32768u;

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

vec4 fetch_node_texel(ivec2 place) {
    return texelFetch(hierarchy, place, 0);
}

float distance_to_segment(vec3 a, vec3 b) {
    vec3 along = b - a;
    float t = clamp(-dot(a, along) / max(dot(along, along), 1.0e-38), 0.0, 1.0);
    return length(a + t * along);
}

// Corners from the light's centre.
bool cuts_ball(vec3 a, vec3 b, vec3 c, float radius) {
    vec3 n = cross(b - a, c - a);
    float height = dot(n, a);
    vec3 sides = vec3(dot(n, cross(a, b)), dot(n, cross(b, c)), dot(n, cross(c, a)));
    bool over = all(greaterThanEqual(sides, vec3(0.0)));
    float least = over
        ? abs(height) / max(length(n), 1.0e-38)
        : min(distance_to_segment(a, b), min(distance_to_segment(b, c), distance_to_segment(c, a)));
    return least < radius * (1.0 - TOUCHING);
}

// Where an edge passes the light's plane, in units of the light.
bool passes(vec3 a, vec3 b, out vec2 at) {
    at = mix(a.xy, b.xy, a.z / (a.z - b.z));
    return (a.z > 0.0) != (b.z > 0.0);
}

bool cuts_flat(vec3 a, vec3 b, vec3 c) {
    vec3 heights = vec3(a.z, b.z, c.z);
    float low = min(heights.x, min(heights.y, heights.z));
    float high = max(heights.x, max(heights.y, heights.z));
    if (low > -TOUCHING || high < TOUCHING) {
        return false;
    }
    vec2 ab;
    vec2 bc;
    vec2 ca;
    bool on_ab = passes(a, b, ab);
    bool on_bc = passes(b, c, bc);
    passes(c, a, ca);
    vec2 from = on_ab ? ab : bc;
    vec2 to = on_ab && on_bc ? bc : ca;
    if (LIGHT_SHAPE != LIGHT_RECT) {
        return distance_to_segment(vec3(from, 0.0), vec3(to, 0.0)) < 1.0;
    }
    vec2 along = to - from;
    along = mix(along, vec2(1.0e-20), lessThan(abs(along), vec2(1.0e-20)));
    vec2 one = (-1.0 - from) / along;
    vec2 other = (1.0 - from) / along;
    vec2 first = min(one, other);
    vec2 last = max(one, other);
    return max(max(first.x, first.y), 0.0) < min(min(last.x, last.y), 1.0);
}

// Whether a line, from -1 to 1 along x, passes through a triangle.
bool cuts_line(vec3 a, vec3 b, vec3 c) {
    vec3 sides = vec3(b.y * c.z - b.z * c.y, c.y * a.z - c.z * a.y, a.y * b.z - a.z * b.y);
    bool inside = all(greaterThanEqual(sides, vec3(0.0))) || all(lessThanEqual(sides, vec3(0.0)));
    float sum = sides.x + sides.y + sides.z;
    float at = dot(sides, vec3(a.x, b.x, c.x)) / sum;
    return inside && sum != 0.0 && abs(at) < 1.0 - TOUCHING;
}

void main() {
    vec3 center = view.light.center.xyz;
    vec3 x = view.light.axis_x.xyz;
    vec3 y = view.light.axis_y.xyz;
    vec3 z = view.light.direction.xyz;
    vec2 size = max(vec2(view.light.axis_x.w, view.light.axis_y.w), 1.0e-30);
    float least = min(size.x, size.y);
    vec3 reach = LIGHT_SHAPE == LIGHT_SPHERE ? vec3(size.x)
        : abs(x) * size.x + (LIGHT_SHAPE == LIGHT_LINE ? vec3(0.0) : abs(y) * size.y);
    bool cut = false;
    uint node = 0u;
    uint steps = 0u;
    while (node < push.nodes && !cut) {
        vec4 low = fetch_node_low(node);
        uint next = node + 1u;
        if (low.w < 0.0) {
            vec3 high = fetch_node_high(node).xyz;
            bool apart = any(greaterThan(low.xyz - center, reach)) || any(lessThan(high - center, -reach));
            next = apart ? uint(-low.w) : next;
        } else {
            uint triangle = uint(low.w);
            vec3 corners[3];
            for (uint i = 0u; i < 3u; ++i) {
                vec3 q = fetch_corner(triangle, i).position - center;
                corners[i] = LIGHT_SHAPE == LIGHT_SPHERE
                    ? q
                    : vec3(dot(q, x) / size.x, dot(q, y) / size.y, dot(q, z) / least);
            }
            if (LIGHT_SHAPE == LIGHT_SPHERE) {
                cut = cuts_ball(corners[0], corners[1], corners[2], size.x);
            } else if (LIGHT_SHAPE == LIGHT_LINE) {
                cut = cuts_line(corners[0], corners[1], corners[2]);
            } else {
                cut = cuts_flat(corners[0], corners[1], corners[2]);
            }
        }
        node = next;
        steps += 1u;
        // So many triangles at a light are as good as one that cuts it.
        cut = cut || steps == MOST_STEPS;
    }
    through.cut = uvec4(cut ? 1u : 0u);
}
