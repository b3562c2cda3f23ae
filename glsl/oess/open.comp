#version 460
// Lists the tiles whose pixels the line's two ends leave open, and marks the rows of the maps that those
// pixels ask for.

#include "common/tiles.glsl"
#include "oess/params.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 1) uniform usampler2D list;
layout(set = 0, binding = 2) uniform usampler2D open_parts;
layout(set = 0, binding = 3, std430) buffer OpenArguments {
    TileArguments open_arguments;
};
layout(set = 0, binding = 4, r32ui) uniform writeonly uimage2D open_list;
layout(set = 0, binding = 5, r32ui) uniform writeonly uimage2D rows;

// Rows marked before and after that around a surface: it lies between two, and each of the line's points
// has it in the same ones but for rounding.
const int ROWS_AROUND = 2;

void main() {
    uint index = spread_entry(gl_WorkGroupID.x, gl_NumWorkGroups.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 size = uvec2(textureSize(open_parts, 0));
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 corner = tile_of_entry(entry, tiles) * TILE_SIZE;
    bool found = false;
    for (uint i = 0u; i < TILE_SIZE * TILE_SIZE; ++i) {
        uvec2 pixel = corner + uvec2(i % TILE_SIZE, i / TILE_SIZE);
        if (any(greaterThanEqual(pixel, size))) {
            continue;
        }
        uvec2 open = texelFetch(open_parts, ivec2(pixel), 0).xy;
        if (open.x != 0u) {
            found = true;
            int row = int(open.y & ((1u << ROW_BITS) - 1u));
            for (int j = -ROWS_AROUND; j <= ROWS_AROUND; ++j) {
                int marked = clamp(row + j, 0, imageSize(rows).x - 1);
                imageStore(rows, ivec2(marked, int(open.y >> ROW_BITS)), uvec4(1u));
            }
        }
    }
    if (found) {
        uint slot = atomicAdd(open_arguments.count, 1u);
        atomicMax(open_arguments.groups_x, min(slot + 1u, TILE_ROW));
        atomicMax(open_arguments.groups_y, slot / TILE_ROW + 1u);
        imageStore(open_list, tile_entry_place(slot, tiles), uvec4(entry));
    }
}
