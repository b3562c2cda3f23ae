#version 460
// Sums of the cells along rows: the first half of summed-area tables (Crow 1984). Whole numbers
// throughout, so sums of boxes are exact even where they wrap.

#include "occlusion_textures/tables.glsl"

layout(local_size_x = 64) in;

layout(constant_id = 0) const uint PACKED = 1u;      // two sums in a component
layout(constant_id = 1) const uint LAYERS = 1u;      // of a set of tables
layout(constant_id = 2) const uint CELL_LAYERS = 1u; // of a set of cells

layout(set = 0, binding = 0) uniform usampler2DArray cells;
layout(set = 0, binding = 1, rgba32ui) uniform writeonly uimage2DArray tables;

void main() {
    int side = imageSize(tables).x - 1;
    int row = int(gl_GlobalInvocationID.x);
    uint set = gl_GlobalInvocationID.z;
    uint table = set * LAYERS + gl_GlobalInvocationID.y;
    uint each = PACKED != 0u ? GROUPS_A_PACKED_TEXEL : GROUPS_A_TEXEL;
    uint first = gl_GlobalInvocationID.y * each;
    if (row >= side) {
        return;
    }
    int layer = int(set * CELL_LAYERS + first / GROUPS_A_CELL);
    uint component = first % GROUPS_A_CELL / 4u;
    uvec4 sum = uvec4(0u);
    imageStore(tables, ivec3(0, row + 1, int(table)), sum);
    for (int x = 0; x < side; ++x) {
        uvec4 cell = texelFetch(cells, ivec3(x, row, layer), 0);
        if (PACKED != 0u) {
            // What the lower sum of a component carries over, differences of boxes take back.
            uvec2 bytes = component == 0u ? cell.xy : cell.zw;
            sum += uvec4(bytes.x, bytes.x >> 8, bytes.y, bytes.y >> 8) & 0x00ff00ffu;
        } else {
            sum += (uvec4(cell[component]) >> uvec4(0u, 8u, 16u, 24u)) & 0xffu;
        }
        imageStore(tables, ivec3(x + 1, row + 1, int(table)), sum);
    }
}
