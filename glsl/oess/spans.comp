#version 460
// Copies the turns around the line that silhouettes take up to where a tile's lists have them, one after the other:
// most entries do not matter to a receiver, and tell so by these.

#include "common/tiles.glsl"
#include "dbuffer/entries.glsl"
#include "dbuffer/params.glsl"
#include "oess/turns.glsl"

// A workgroup a tile, an invocation a texel of a chunk.
layout(local_size_x = 8) in;

layout(set = 0, binding = 0, std140) uniform Block {
    DbufferParams params;
};
layout(set = 0, binding = 1, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 2) uniform usampler2D list;
layout(set = 0, binding = 3) uniform usampler2D pool;
layout(set = 0, binding = 4) uniform usampler2D lists;
layout(set = 0, binding = 5, rgba32ui) uniform uimage2D spans;

vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0);
}

uint fetch_pool_texel(ivec2 place) {
    return texelFetch(pool, place, 0).x;
}

uvec4 fetch_list_texel(ivec2 place) {
    return texelFetch(lists, place, 0);
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uint tile = texelFetch(list, tile_entry_place(spread_entry(index, arguments.count), tiles), 0).x;
    uint slot = SPANS * gl_LocalInvocationID.x;
    for (uint block = 0u; block < blocks_of(tile, tiles.x * tiles.y, params.sizes.x); ++block) {
        Entries entries = list_entries(block, tile, tiles.x * tiles.y);
        uint rest = entries.rest;
        uint chunk = entries.chunk;
        while (rest > 0u) {
            uint next = fetch_pool_texel(chunk_entry_place(chunk, CHUNK));
            uint held = min(rest, CHUNK);
            uvec4 found;
            for (uint i = 0u; i < SPANS; ++i) {
                uint entry = slot + i < held ? fetch_pool_texel(chunk_entry_place(chunk, slot + i)) : 0u;
                uvec4 four = imageLoad(spans, span_place(params.counts.w, entry / SPANS));
                found[i] = four[entry % SPANS];
            }
            // Of the last chunk there is no next one, and nobody asks.
            bool last = gl_LocalInvocationID.x == SPAN_TEXELS - 1u;
            found.w = last ? next : found.w;
            imageStore(spans, span_place(chunk, gl_LocalInvocationID.x), found);
            rest -= held;
            chunk = next;
        }
    }
}
