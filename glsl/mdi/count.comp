#version 460
// How many depths each texel of a view has, and in which buckets.

#include "mdi/count.glsl"

layout(set = 0, binding = 7, std430) buffer Arguments {
    LargeArguments large;
};
layout(set = 0, binding = 8, r32ui) uniform writeonly uimage2D large_list;

void main() {
    uint triangle;
    if (invocation_triangle(triangle) && cover_small(triangle)) {
        uint index = atomicAdd(large.count, 1u);
        if (index < LARGE_GROUPS) {
            atomicAdd(large.groups_y, 1u);
        }
        imageStore(large_list, list_place(index), uvec4(triangle));
    }
}
