// What is between a tile's surfaces and the light.
//
// The walk down the hierarchy lists candidates of a group of tiles: chunks of a pool, linked, so that a list may have any
// length. Where the pool is used up all lists are made again, each with the same room (overflow.comp).
// Entries are made from candidates and lie side by side; of a group's entries each tile takes its own for the masks.
//
// A long list is worked on in tasks of a fixed number of triangles. The first one is its tile's; the
// others OR what they find to the tile's masks in memory. Of a tile with no list, or one with too many
// triangles, each pixel walks down the hierarchy anew (pixels.comp). That spreads the work, and a software
// driver may end loops that go on for long.
#ifndef ANTUMBRA_SHAFT_MASKS_LISTS_GLSL
#define ANTUMBRA_SHAFT_MASKS_LISTS_GLSL

#include "common/triangles.glsl"

// Candidates of a chunk, four a texel; the texel after them is the number of the list's next chunk.
const uint CHUNK = 32u;

layout(constant_id = 4) const uint TASK_ENTRIES = 512u;

// Texels of a group, or of a tile, in the image of lists, side by side: of a group the first chunk of candidates and their
// number; node to walk from (beyond the last one if the list is whole, else 0); of a tile its state. Entries as below.
// Of a group what its edges count in sum and the number of triangles that may cover all of the light; the first of these.
const uint LIST_TEXELS = 6u;
const uint TILE_OPEN = 0u;
const uint TILE_SETTLED = 1u;
const uint TILE_WALKED = 2u; // open, but its list is so long that walks of its pixels take less time

// Entries of a tile. Triangles lie in one run of their pool, whole ones from its begin, others from
// its end.
struct Entries {
    uint first_edge;
    uint edges;
    uint first;  // of the run
    uint room;   // of the run
    uint whole;  // triangles between all surfaces and the light's plane
    uint others; // triangles that are not, or have holes
    uint slot;   // of its words
};

Entries entries_of(uvec4 first, uvec4 second) {
    return Entries(first.x, first.y, first.z, first.w, second.x, second.y, second.z);
}

ivec2 list_place(uvec2 part) {
    return ivec2(part.x * LIST_TEXELS, part.y);
}

// Tiles of an image that holds two lists of them, one from its begin on and one from its end.
ivec2 place_from_end(uint index, uvec2 tiles) {
    uint last = 2u * tiles.x * tiles.y - 1u;
    return ivec2((last - index) % tiles.x, (last - index) / tiles.x);
}

ivec2 task_place(uint task) {
    return triangle_texel_place(task);
}

// The texel with a candidate, or for CHUNK with the next chunk.
ivec2 chunk_place(uint chunk, uint candidate) {
    return triangle_texel_place(chunk * (CHUNK / 4u + 1u) + candidate / 4u);
}

// An edge in its pool: a triangle, the corner that it begins at, and which way it counts.
const uint EDGE_CORNER_BITS = 2u;
const uint EDGE_DOUBLE = 0x40000000u;
const uint EDGE_TURNED = 0x80000000u;

// Most that edges of a group may count in sum.
const uint MOST_COUNT = 2048u;

// Tiles of a cell across and down: those of a group are within one.
const uvec2 CELL = uvec2(2u, 2u);

// A tile of a cell, or a part of one.
uvec2 part_of_member(uvec2 cell, uint member, uint level, uvec2 tiles) {
    uvec2 tile = cell * CELL + uvec2(member % CELL.x, member / CELL.x);
    return uvec2(tile.x, tile.y + level * tiles.y);
}

// Triangles of a tile that are looked at as ones that may cover all of the light: two texels.
const uint MOST_COVERS = 8u;

#endif
