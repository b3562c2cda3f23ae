// Lists of the triangles that meet a tile's shaft: chunks of a pool, linked, so that a list may have
// any length. Where the pool is used up, a list says from which node on it does not know.
#ifndef ANTUMBRA_SHAFT_MASKS_LISTS_GLSL
#define ANTUMBRA_SHAFT_MASKS_LISTS_GLSL

#include "common/triangles.glsl"

// Entries of a chunk; the one after them is the number of the list's next chunk.
const uint CHUNK = 31u;

struct TriangleList {
    uint chunk;  // the first
    uint count;  // of entries
    uint resume; // node from which on triangles are missing
};

ivec2 chunk_entry_place(uint chunk, uint entry) {
    return triangle_texel_place(chunk * (CHUNK + 1u) + entry);
}

#endif
