#version 460
// Chooses the tiles whose lists fit into the pool, those that ask for the fewest chunks first: one workgroup.
//
// Tiles in the order of their keys are the same however they are listed, so the last one that fits is looked
// for, eight bits of its key at a time: sums of chunks over the tiles whose keys begin as its does, by the next
// eight bits.

#include "common/tiles.glsl"
#include "dbuffer/overflow.glsl"
#include "dbuffer/params.glsl"

const uint LANES = 128u;
const uint BINS = 256u;

// A key is the number of chunks before that of the tile. More chunks than the largest number here are edges enough for
// rays in any case.
const uint TILE_BITS = 20u;
const uint MOST_KEY_CHUNKS = (1u << (32u - TILE_BITS)) - 1u;

layout(local_size_x = LANES) in;

layout(set = 0, binding = 0, std140) uniform Block {
    DbufferParams params;
};
layout(set = 0, binding = 1, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 2) uniform usampler2D list;
layout(set = 0, binding = 3) uniform usampler2D demands;
layout(set = 0, binding = 4, std430) writeonly buffer Pool {
    uint chunks_used;
};
layout(set = 0, binding = 5, std430) writeonly buffer FittingArguments {
    Fitting fitting;
};
layout(set = 0, binding = 6, r32ui) uniform writeonly uimage2D fitting_list;

shared uint sums[BINS];
shared uint limit; // key of the first tile that does not fit
shared uint chunks; // of tiles with lesser keys
shared uint count;

struct Tile {
    uint number;
    uint demand;
    uint key;
};

Tile fetch_tile(uint index, uvec2 tiles) {
    ivec2 place = tile_entry_place(index, tiles);
    Tile tile;
    tile.number = texelFetch(list, place, 0).x;
    tile.demand = texelFetch(demands, place, 0).x;
    tile.key = min(tile.demand, MOST_KEY_CHUNKS) << TILE_BITS | tile.number;
    return tile;
}

void main() {
    uint lane = gl_LocalInvocationID.x;
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    if (lane == 0u) {
        limit = 0u;
        chunks = 0u;
        count = 0u;
    }
    for (uint level = 0u; level < 4u; ++level) {
        uint shift = 24u - 8u * level;
        for (uint bin = lane; bin < BINS; bin += LANES) {
            sums[bin] = 0u;
        }
        barrier();
        for (uint index = lane; index < arguments.count; index += LANES) {
            Tile tile = fetch_tile(index, tiles);
            // The limit has no bits here yet: what is left of a key that begins as it does is the next eight.
            uint bin = (tile.key ^ limit) >> shift;
            if (bin < BINS) {
                atomicAdd(sums[bin], tile.demand);
            }
        }
        barrier();
        if (lane == 0u) {
            uint bin = 0u;
            while (bin < BINS - 1u && chunks + sums[bin] <= params.counts.w) {
                chunks += sums[bin];
                bin += 1u;
            }
            limit |= bin << shift;
        }
        barrier();
    }
    for (uint index = lane; index < arguments.count; index += LANES) {
        Tile tile = fetch_tile(index, tiles);
        if (tile.demand > 0u && tile.key < limit) {
            uint at = atomicAdd(count, 1u);
            imageStore(fitting_list, tile_entry_place(at, tiles), uvec4(tile.number));
        }
    }
    barrier();
    if (lane == 0u) {
        chunks_used = 0u;
        fitting.tiles = TileArguments((count + 63u) / 64u, 1u, 1u, count);
        fitting.lists = uvec4(params.sizes.x, (count + 31u) / 32u, 1u, 0u);
    }
}
