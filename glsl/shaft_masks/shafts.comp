#version 460
// The shafts of the listed tiles that show one triangle, which their corners tell of, and a list of the others: these take
// many times as long, and invocations of a vector wait for the longest. One invocation a tile, without barriers.

#include "shaft_masks/shafts.glsl"

layout(local_size_x = PARTS_A_GROUP) in;

layout(set = 0, binding = 11, std430) buffer RoughArguments {
    TileArguments rough;
};
layout(set = 0, binding = 12, r32ui) uniform writeonly uimage2D rough_list;

void main() {
    uint index = spread_entry(gl_WorkGroupID.x, gl_NumWorkGroups.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 tile = tile_of_entry(entry, tiles);
    TileBounds bounds = fetch_bounds(tile);
    if (corners_tell(tile, bounds)) {
        store_shaft(view.light, tile, tiles, bounds, vec2(0.0, FAR), tile * TILE_SIZE, false, 2u);
    } else {
        uint at = atomicAdd(rough.count, 1u);
        atomicMax(rough.groups_x, at / PARTS_A_GROUP + 1u);
        imageStore(rough_list, tile_entry_place(at, tiles), uvec4(entry));
    }
}
