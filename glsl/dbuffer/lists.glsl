// Silhouettes in groups with boxes around them, and lists of those that tiles have to look at.
//
// The list of silhouettes is ordered as the mesh is, so that neighbours in it are mostly neighbours in
// space: 16 of them have a box, 16 such groups another, and so have 16 of these, a block. No tree is
// built. The ends of silhouette i are texels 2 i and 2 i + 1 of an image of their own, scene space: most that
// a receiver looks at do not matter to it, and tell so by them.
//
// A tile has a list for each block, of places in the list of silhouettes, and one of triangles with holes where the scene has any: chunks of a
// pool, linked, so that a list may have any length. A list says from which silhouette or node of the hierarchy on it
// does not know: from the first one if its tile found no room in the pool (overflow.glsl).
#ifndef ANTUMBRA_DBUFFER_LISTS_GLSL
#define ANTUMBRA_DBUFFER_LISTS_GLSL

#include "common/triangles.glsl"

const uint GROUP = 16u;
const uint LARGE_GROUP = 256u;
const uint BLOCK = 4096u;

// Each chunk has a box around what it lists: texels 2 i and 2 i + 1 of an image of their own for chunk i.

// Entries of a chunk; the one after them is the number of the list's next chunk.
const uint CHUNK = 31u;

ivec2 chunk_entry_place(uint chunk, uint entry) {
    return triangle_texel_place(chunk * (CHUNK + 1u) + entry);
}

// Place of a tile's list: first chunk, number of entries, what it does not know from
// on, and up to where.
ivec2 list_place(uint block, uint tile, uint tiles) {
    return triangle_texel_place(block * tiles + tile);
}

// What follows the arguments of the draw in the buffer of silhouettes.
struct SilhouetteArguments {
    uvec4 draw;
    uint count;
};

#endif
