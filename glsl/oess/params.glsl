// The uniform block of `oess`, and what an outreach map holds.
#ifndef ANTUMBRA_OESS_PARAMS_GLSL
#define ANTUMBRA_OESS_PARAMS_GLSL

#include "common/light_view.glsl"

const uint MAX_SECTORS = 4u;
const uint MAX_POINTS = 9u;
const uint MAX_PROFILE = 8u;

struct OessParams {
    vec4 start;   // xyz: the line's first point, scene space; w: length of a segment, metres
    vec4 axis;    // xyz: unit vector along the line; w: cells of its profile, 0 for an even light
    uvec4 counts; // sectors, points of the line, texels across and down a map
    vec4 shift[MAX_SECTORS]; // x: texels that a point moves from one end's map to the next's, for
                             // stored depth 1
    vec4 profile[MAX_PROFILE]; // of each cell: brightness at its start and its rise over the cell, in
                               // means of the line; then the integrals of brightness and of
                               // brightness times place, 0 to 1, before it
    LightView views[MAX_SECTORS * MAX_POINTS]; // sector * points + point
};

// An outreach map's texel: the column plus one of the occluding edge of the surface seen there, 0 for
// none, and above it the column plus one of the last texel of the same surface's run.
const uint EDGE_BITS = 16u;

uint edge_of(uint texel) {
    return texel & 0xffffu;
}

uint run_of(uint texel) {
    return texel >> EDGE_BITS;
}

// What is open at a pixel. x: packUnorm2x16 of where that part of the line begins and ends, 0 for none;
// y: row of the maps around its surface, and above it the sector.
const uint ROW_BITS = 16u;

#endif
