#version 460
// Writes the numbers of silhouette edges to their places in the list, in the order of edges.

#include "common/triangles.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly buffer Masks {
    uint masks[];
};
layout(set = 0, binding = 1, std430) readonly buffer Offsets {
    uint offsets[];
};
layout(set = 0, binding = 2, r32ui) uniform writeonly uimage2D list;

layout(push_constant) uniform Push {
    uint runs;
} push;

vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0);
}

void main() {
    uint run = gl_GlobalInvocationID.x;
    if (run >= push.runs) {
        return;
    }
    uint mask = masks[run];
    uint at = offsets[run];
    while (mask != 0u) {
        uint edge = 32u * run + uint(findLSB(mask));
        imageStore(list, triangle_texel_place(at), uvec4(edge));
        mask &= mask - 1u;
        at += 1u;
    }
}
