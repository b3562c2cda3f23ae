// What is known of the error of each tile or part of one: four texels of an R32_UINT image.
#ifndef ANTUMBRA_SHAFT_MASKS_ESTIMATES_GLSL
#define ANTUMBRA_SHAFT_MASKS_ESTIMATES_GLSL

const uint ESTIMATE_TEXELS = 4u;
// Changes between neighbouring samples, of all pixels, and from CHANGED_PIXEL on the number of pixels that have some.
const uint ESTIMATE_CHANGES = 0u;
const uint ESTIMATE_BOUND = 1u; // largest bound of a pixel, the bits of a float; 0 before it is made
const uint ESTIMATE_LEVEL = 2u; // n: masks of 64 * 4^(n - 1) samples; 0: not worked on; else as below
const uint ESTIMATE_WORK = 3u;  // entries for each block of samples

const uint LEVEL_LIT = 0x100u;
const uint LEVEL_DARK = 0x101u;
const uint LEVEL_OPEN = 0x102u; // not known yet

const uint CHANGED_PIXEL = 1u << 20u;

ivec2 estimate_place(uvec2 part, uint texel) {
    return ivec2(part.x * ESTIMATE_TEXELS + texel, part.y);
}

uint changed_pixel(uint changes) {
    return changes > 0u ? CHANGED_PIXEL + changes : 0u;
}

#endif
