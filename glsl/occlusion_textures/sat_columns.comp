#version 460
// Sums down the columns: the second half of summed-area tables.

#include "occlusion_textures/groups.glsl"
#include "occlusion_textures/tables.glsl"

layout(local_size_x = 64) in;

layout(constant_id = 0) const uint PACKED = 1u; // two sums in a component
layout(constant_id = 1) const uint LAYERS = 1u; // of a set of tables

layout(set = 0, binding = 0, std140) uniform GroupBlock {
    SliceGroups groups;
};
layout(set = 0, binding = 1, rgba32ui) uniform uimage2DArray tables;

void main() {
    int side = imageSize(tables).x;
    int column = int(gl_GlobalInvocationID.x);
    uint table = gl_GlobalInvocationID.y;
    uint each = PACKED != 0u ? GROUPS_A_PACKED_TEXEL : GROUPS_A_TEXEL;
    if (column >= side || table % LAYERS * each >= groups.count.x) {
        return;
    }
    uvec4 sum = uvec4(0u);
    imageStore(tables, ivec3(column, 0, int(table)), sum);
    for (int y = 1; y < side; ++y) {
        ivec3 place = ivec3(column, y, int(table));
        sum += imageLoad(tables, place);
        imageStore(tables, place, sum);
    }
}
