// Masks in memory: of each pixel of a tile, one after the other, two words for each block of samples.
#ifndef ANTUMBRA_SHAFT_MASKS_WORDS_GLSL
#define ANTUMBRA_SHAFT_MASKS_WORDS_GLSL

#include "common/tiles.glsl"
#include "common/triangles.glsl"

// Samples are worked on in blocks of 8 rows of 8: row r is byte r.
const uint ROWS = 8u;
const uint COLUMNS = 8u;

ivec2 word_place(uint tile, uvec2 within, uint blocks, uint word) {
    uint pixel = tile * TILE_SIZE * TILE_SIZE + within.y * TILE_SIZE + within.x;
    return triangle_texel_place(pixel * 2u * blocks + word);
}

#endif
