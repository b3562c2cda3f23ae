// Masks in memory: words of whole rows, of the pixels of a tile one after the other.
#ifndef ANTUMBRA_SHAFT_MASKS_WORDS_GLSL
#define ANTUMBRA_SHAFT_MASKS_WORDS_GLSL

#include "common/tiles.glsl"
#include "common/triangles.glsl"

layout(constant_id = 1) const uint ROWS = 8u;
layout(constant_id = 2) const uint COLUMNS = 8u;

const uint ROWS_IN_WORD = 32u / COLUMNS;
const uint WORDS = ROWS / ROWS_IN_WORD;
const uint ALL_COLUMNS = 0xffffffffu >> (32u - COLUMNS);

ivec2 word_place(uint tile, uvec2 within, uint word) {
    uint pixel = tile * TILE_SIZE * TILE_SIZE + within.y * TILE_SIZE + within.x;
    return triangle_texel_place(pixel * WORDS + word);
}

#endif
