// Masks in memory: of each pixel of a tile, one after the other, two words for each block of samples.
#ifndef ANTUMBRA_SHAFT_MASKS_WORDS_GLSL
#define ANTUMBRA_SHAFT_MASKS_WORDS_GLSL

#include "common/tiles.glsl"
#include "common/triangles.glsl"

// Samples are worked on in blocks of 8 rows of 8: row r is byte r.
const uint ROWS = 8u;
const uint COLUMNS = 8u;

// slot: of the tile among those that words are made of at once.
ivec2 word_place(uint slot, uvec2 within, uint blocks, uint word) {
    uint pixel = slot * TILE_SIZE * TILE_SIZE + within.y * TILE_SIZE + within.x;
    return triangle_texel_place(pixel * 2u * blocks + word);
}

// Pairs of neighbouring samples, in a row or a column of a block, of which one is hidden and one is not.
// in_line: rows lie one after the other, and not beside each other.
uint changes_in(uvec2 mask, bool in_line) {
    uvec2 rows = (mask ^ mask >> 1) & 0x7f7f7f7fu;
    uvec2 columns = (mask ^ mask >> 8) & 0x00ffffffu;
    uint between = (mask.x >> 24 ^ mask.y) & 0xffu;
    int beside = bitCount(columns.x) + bitCount(columns.y) + bitCount(between);
    return uint(bitCount(rows.x) + bitCount(rows.y) + (in_line ? 0 : beside));
}

#endif
