#version 460
// Sums down the columns: the second half of summed-area tables.

#include "occlusion_textures/groups.glsl"

layout(local_size_x = 64) in;

layout(constant_id = 2) const uint LAYERS = 1u; // of the tables for a group

layout(set = 0, binding = 0, std140) uniform GroupBlock {
    SliceGroups groups;
};
layout(set = 0, binding = 1, r32ui) uniform uimage2DArray tables;

void main() {
    int side = imageSize(tables).x;
    int column = int(gl_GlobalInvocationID.x);
    uint layer = gl_GlobalInvocationID.y;
    uint layers = groups.count.x * LAYERS;
    if (column >= side || layer >= layers) {
        return;
    }
    // Where a word holds two sums, they add up as one number: what the lower one carries over,
    // differences of boxes take back.
    uint sum = 0u;
    imageStore(tables, ivec3(column, 0, int(layer)), uvec4(0u));
    for (int y = 1; y < side; ++y) {
        ivec3 place = ivec3(column, y, int(layer));
        sum += imageLoad(tables, place).x;
        imageStore(tables, place, uvec4(sum));
    }
}
