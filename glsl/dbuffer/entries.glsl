// Walks through a tile's lists.
#ifndef ANTUMBRA_DBUFFER_ENTRIES_GLSL
#define ANTUMBRA_DBUFFER_ENTRIES_GLSL

#include "dbuffer/lists.glsl"

uint fetch_pool_texel(ivec2 place);  // defined by the entry file
uvec4 fetch_list_texel(ivec2 place); // defined by the entry file

// Places of a list, one after the other: those in chunks first, then all that the list does not know.
struct Entries {
    uint chunk;
    uint slot;
    uint rest;
    uint missing;
    uint end;
};

Entries list_entries(uint block, uint tile, uint tiles) {
    uvec4 stored = fetch_list_texel(list_place(block, tile, tiles));
    return Entries(stored.x, 0u, stored.y, stored.z, stored.w);
}

bool has_entries(Entries entries) {
    return entries.rest > 0u || entries.missing < entries.end;
}

// At the beginning of a chunk, after a whole one: the next one. Whether it is one, or the rest that the list does
// not know.
bool begin_chunk(inout Entries entries) {
    bool listed = entries.rest > 0u;
    if (listed && entries.slot == CHUNK) {
        entries.chunk = fetch_pool_texel(chunk_entry_place(entries.chunk, CHUNK));
        entries.slot = 0u;
    }
    return listed;
}

void skip_chunk(inout Entries entries) {
    entries.rest -= min(entries.rest, CHUNK);
    entries.slot = CHUNK;
}

// The next place in the chunk, and whether there are more in it.
uint next_entry(inout Entries entries, out bool has_more) {
    bool listed = entries.rest > 0u;
    uint entry = listed
        ? fetch_pool_texel(chunk_entry_place(entries.chunk, entries.slot))
        : entries.missing;
    entries.slot += 1u;
    entries.rest -= listed ? 1u : 0u;
    entries.missing += listed ? 0u : 1u;
    has_more = listed ? entries.slot < CHUNK && entries.rest > 0u : entries.missing < entries.end;
    return entry;
}

// How many blocks of silhouettes a tile has lists of. Asking for the tile changes nothing, but for a loop that ends by a
// uniform alone Mesa 22.3's software driver may make a copy of the shader each time it is used, and keep it as long as
// the pipeline.
uint blocks_of(uint tile, uint tiles, uint blocks) {
    return tile < tiles ? blocks : 0u;
}

// Edges that a receiver of the tile would look at.
uint edges_of(uint tile, uint tiles, uint blocks) {
    uint count = 0u;
    for (uint block = 0u; block < blocks_of(tile, tiles, blocks); ++block) {
        uvec4 stored = fetch_list_texel(list_place(block, tile, tiles));
        count += stored.y + stored.w - stored.z;
    }
    return count;
}

#endif
