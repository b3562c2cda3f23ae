// Uniform block of the passes of shaft-masks.
#ifndef ANTUMBRA_SHAFT_MASKS_PARAMS_GLSL
#define ANTUMBRA_SHAFT_MASKS_PARAMS_GLSL

layout(constant_id = 0) const uint LIGHT_SHAPE = 0u;

// Samples of the light lie in rows along its first axis: of a round light turned by an eighth of a circle and a half,
// of a rectangle along lines that rise by nearly one row from end to end. Edges of things built along the
// light's own axes then cross rows and columns one by one, not all of one at once.
const float ROW_COSINE = 0.92387953251;
const float ROW_SINE = 0.38268343236;
const uint MOST_ROWS = 32u;
const uint MOST_BLOCKS = 16u; // of 8 rows of 8

// Invocations of a workgroup where each takes a tile, a part of one, or a group of them.
const uint PARTS_A_GROUP = 64u;

struct ShaftParams {
    uvec4 counts;  // width and height of the picture in pixels, nodes, chunks of the pool of candidates
    // Blocks of samples along an axis, all blocks, edges that their pool has room for, level: 64 * 4^(level - 1) samples.
    uvec4 pattern;
    // Of each row its place along the second axis, -1 to 1. Where x is the place along the first one,
    // -1 to 1, samples stand at the whole columns plus 0.5 of y x + z, of a sun of
    // y x / sqrt(w + (tangent of half its angle * x)^2) + z.
    vec4 rows[MOST_ROWS];
    // Of each row the strip of the light that its cells fill: least and most place along the second axis, narrowest and
    // widest half chord.
    vec4 strips[MOST_ROWS];
};

#endif
