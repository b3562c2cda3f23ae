#version 460
// Which edges are silhouettes, seen from a light's centre or from some point of the light. A bit for
// each edge: invocations take runs of 32 edges, so that the places of silhouettes in their list need
// no atomics.
//
// With n_i the normal of the plane through the edge and the opposite corner of face i, a point s of
// the light sees a silhouette where all n_i.(s - v) have one sign: all faces are on the same side of
// the plane through edge and s. A face whose plane misses the light has the same sign for all of it,
// so an edge is no silhouette from anywhere exactly if two faces have opposite signs throughout. No
// winding and no face normal goes into this; open edges always count, and edges within a flat surface
// never.
//
// Of three faces and more, two on one side and one on the other are no outline: something is on both sides.
// But the number of surfaces before s changes there all the same, and those who count surfaces need the edge.

#include "common/view_params.glsl"
#include "silhouettes/edges.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std140) uniform View {
    ViewParams view;
};
layout(set = 0, binding = 1) uniform usampler2D edges;
layout(set = 0, binding = 2) uniform sampler2D points;
layout(set = 0, binding = 3, std430) writeonly buffer Masks {
    uint masks[];
};

layout(push_constant) uniform Push {
    uint edge_count;
} push;

layout(constant_id = 0) const uint LIGHT_SHAPE = 0u;
// 1: from some point of the light; 0: from its centre.
layout(constant_id = 1) const uint WHOLE_LIGHT = 0u;
// 1: edges at which the number of surfaces before the light changes; 0: outlines.
layout(constant_id = 2) const uint ALL_CHANGES = 0u;

// What signs may be wrong by, as a part of the product of lengths. Within it a face counts as seen
// from both sides: an edge too many changes nothing, one too few opens a gap.
const float ROUNDING = 1.0e-6;

uvec4 fetch_edge_texel(ivec2 place) {
    return texelFetch(edges, place, 0);
}

vec4 fetch_point_texel(ivec2 place) {
    return texelFetch(points, place, 0);
}

vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0);
}

// Half the light's extent along n, times the length of n; of a sun at distance 1.
float half_extent(vec3 n) {
    float x = view.light.axis_x.w;
    float y = view.light.axis_y.w;
    if (LIGHT_SHAPE == LIGHT_SPHERE) {
        return x * length(n);
    } else if (LIGHT_SHAPE == LIGHT_DISK || LIGHT_SHAPE == LIGHT_SUN) {
        return x * length(cross(n, view.light.direction.xyz));
    } else if (LIGHT_SHAPE == LIGHT_RECT) {
        return x * abs(dot(n, view.light.axis_x.xyz)) + y * abs(dot(n, view.light.axis_y.xyz));
    } else if (LIGHT_SHAPE == LIGHT_LINE) {
        return x * abs(dot(n, view.light.axis_x.xyz));
    }
    return 0.0;
}

// 1 or -1 where all of the light is on that side of a face, else 0.
float side(uint corner, vec3 from, vec3 along, vec3 to_light) {
    vec3 across = fetch_point(corner).xyz - from;
    vec3 n = cross(across, along);
    float slack = ROUNDING * length(across) * length(along) * length(to_light);
    float extent = slack + (WHOLE_LIGHT != 0u ? half_extent(n) : 0.0);
    float height = dot(n, to_light);
    return height > extent ? 1.0 : height < -extent ? -1.0 : 0.0;
}

// Whether two faces lie in one plane, on either side of their edge.
bool is_flat(uvec4 edge, vec3 from, vec3 along) {
    vec3 a = cross(fetch_point(edge.z).xyz - from, along);
    vec3 b = cross(fetch_point(edge.w).xyz - from, along);
    return dot(a, b) < 0.0 && length(cross(a, b)) <= ROUNDING * length(a) * length(b);
}

bool is_silhouette(uint index) {
    uvec4 edge = fetch_edge(index);
    if (edge.w == NO_POINT) {
        return true;
    }
    vec3 from = fetch_point(edge.x).xyz;
    vec3 along = fetch_point(edge.y).xyz - from;
    vec3 to_light = light_offset(view.light, from);
    float first = side(edge.z, from, along, to_light);
    float low = first;
    float high = first;
    float balance = first;
    bool decided = first != 0.0;
    if ((edge.w & MORE_FACES) == 0u) {
        float second = side(edge.w, from, along, to_light);
        low = min(low, second);
        high = max(high, second);
        balance += second;
        decided = decided && second != 0.0;
        if (first == 0.0 && second == 0.0 && is_flat(edge, from, along)) {
            return false;
        }
    } else {
        uint place = edge.w & ~MORE_FACES;
        uvec4 more;
        do {
            more = fetch_edge(place);
            for (uint i = 0u; i < more.w >> 1; ++i) {
                float other = side(more[i], from, along, to_light);
                low = min(low, other);
                high = max(high, other);
                balance += other;
                decided = decided && other != 0.0;
            }
            place += 1u;
        } while ((more.w & 1u) != 0u);
    }
    return ALL_CHANGES != 0u ? !decided || balance != 0.0 : low * high > -0.5;
}

void main() {
    uint run = gl_GlobalInvocationID.x;
    uint first = 32u * run;
    if (first >= push.edge_count) {
        return;
    }
    uint count = min(32u, push.edge_count - first);
    uint mask = 0u;
    for (uint i = 0u; i < count; ++i) {
        mask |= is_silhouette(first + i) ? 1u << i : 0u;
    }
    masks[run] = mask;
}
