#version 460
// Sorts each texel's list, the nearest first: the order in which depths came is not reproducible.

#include "mdi/params.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0) uniform usampler2DArray heads;
layout(set = 0, binding = 1, r32ui) uniform uimage2D lists;

void main() {
    ivec3 place = ivec3(gl_GlobalInvocationID);
    if (any(greaterThanEqual(place, textureSize(heads, 0)))) {
        return;
    }
    uvec2 head = texelFetch(heads, place, 0).xy;
    for (uint i = 1u; i < head.y; ++i) {
        uint moved = imageLoad(lists, list_place(head.x + i)).x;
        uint to = i;
        while (to > 0u) {
            uint other = imageLoad(lists, list_place(head.x + to - 1u)).x;
            if (uintBitsToFloat(other) <= uintBitsToFloat(moved)) {
                break;
            }
            imageStore(lists, list_place(head.x + to), uvec4(other));
            --to;
        }
        if (to < i) {
            imageStore(lists, list_place(head.x + to), uvec4(moved));
        }
    }
}
