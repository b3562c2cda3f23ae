// Lists of the triangles that meet a tile's shaft: chunks of a pool, linked, so that a list may have
// any length. Where the pool is used up, or a walk long, a list says from which node on it does not
// know.
//
// A long list is worked on in tasks of a fixed number of chunks. The first one is its tile's; the
// others OR what they find to the tile's masks in memory. What a list does not know is found again
// in the hierarchy, by tasks of a fixed number of nodes. That spreads the work, and a software
// driver may end loops that go on for long.
#ifndef ANTUMBRA_SHAFT_MASKS_LISTS_GLSL
#define ANTUMBRA_SHAFT_MASKS_LISTS_GLSL

#include "common/triangles.glsl"

// Entries of a chunk; the one after them is the number of the list's next chunk.
const uint CHUNK = 31u;

layout(constant_id = 4) const uint TASK_CHUNKS = 16u;
const uint TASK_ENTRIES = TASK_CHUNKS * CHUNK;

struct TriangleList {
    uint chunk;  // the first
    uint count;  // of entries
    uint resume; // node from which on triangles are missing
};

// What a list is for, in its last channel.
const uint TILE_OPEN = 0u;
const uint TILE_SETTLED = 1u;

ivec2 task_place(uint task) {
    return triangle_texel_place(task);
}

ivec2 chunk_entry_place(uint chunk, uint entry) {
    return triangle_texel_place(chunk * (CHUNK + 1u) + entry);
}

#endif
