#version 460
// Boxes around silhouettes, 16 at a time, whose ends are put down on the way; or around 16 boxes.

#include "dbuffer/lists.glsl"
#include "silhouettes/edges.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std140) uniform Arguments {
    SilhouetteArguments silhouettes;
};
layout(set = 0, binding = 1) uniform usampler2D list;
layout(set = 0, binding = 2) uniform usampler2D edges;
layout(set = 0, binding = 3) uniform sampler2D points;
layout(set = 0, binding = 4) uniform sampler2D below;
layout(set = 0, binding = 5, rgba32f) uniform writeonly image2D boxes;
layout(set = 0, binding = 6, rgba32f) uniform writeonly image2D ends;

layout(push_constant) uniform Push {
    uint size; // silhouettes of a box of `below`; 0 where boxes are around silhouettes
} push;

uvec4 fetch_edge_texel(ivec2 place) {
    return texelFetch(edges, place, 0);
}

vec4 fetch_point_texel(ivec2 place) {
    return texelFetch(points, place, 0);
}

vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0);
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    uint size = max(push.size, 1u);
    uint count = (silhouettes.count + size - 1u) / size;
    uint first = index * GROUP;
    if (first >= count) {
        return;
    }
    vec3 low = vec3(1.0e38);
    vec3 high = vec3(-1.0e38);
    for (uint i = first; i < min(first + GROUP, count); ++i) {
        if (push.size == 0u) {
            uvec4 edge = fetch_edge(texelFetch(list, triangle_texel_place(i), 0).x);
            vec3 a = fetch_point(edge.x).xyz;
            vec3 b = fetch_point(edge.y).xyz;
            low = min(low, min(a, b));
            high = max(high, max(a, b));
            imageStore(ends, triangle_texel_place(2u * i), vec4(a, 0.0));
            imageStore(ends, triangle_texel_place(2u * i + 1u), vec4(b, 0.0));
        } else {
            low = min(low, texelFetch(below, triangle_texel_place(2u * i), 0).xyz);
            high = max(high, texelFetch(below, triangle_texel_place(2u * i + 1u), 0).xyz);
        }
    }
    imageStore(boxes, triangle_texel_place(2u * index), vec4(low, 0.0));
    imageStore(boxes, triangle_texel_place(2u * index + 1u), vec4(high, 0.0));
}
