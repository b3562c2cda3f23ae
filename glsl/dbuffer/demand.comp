#version 460
// How many chunks the lists of each tile ask for. They may not have got them, so they know nothing from here on.

#include "common/tiles.glsl"
#include "dbuffer/lists.glsl"
#include "dbuffer/overflow.glsl"
#include "dbuffer/params.glsl"

layout(local_size_x = 64) in; // DEMAND_LANES

layout(set = 0, binding = 0, std140) uniform Block {
    DbufferParams params;
};
layout(set = 0, binding = 1, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 2) uniform usampler2D list;
layout(set = 0, binding = 3, rgba32ui) uniform uimage2D lists;
layout(set = 0, binding = 4, r32ui) uniform writeonly uimage2D demands;

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uint tile = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uint demand = 0u;
    // No loop that ends by a uniform alone: blocks_of in entries.glsl.
    uint count = tile < tiles.x * tiles.y ? params.sizes.y : 0u;
    for (uint block = 0u; block < count; ++block) {
        ivec2 place = list_place(block, tile, tiles.x * tiles.y);
        uvec4 found = imageLoad(lists, place);
        demand += (found.y + CHUNK - 1u) / CHUNK;
        // Triangles with holes come after the silhouettes. An empty list knows that there is nothing.
        uint begin = block < params.sizes.x ? block * BLOCK : 0u;
        imageStore(lists, place, found.y > 0u ? uvec4(0u, 0u, begin, found.w) : found);
    }
    imageStore(demands, tile_entry_place(index, tiles), uvec4(demand));
}
