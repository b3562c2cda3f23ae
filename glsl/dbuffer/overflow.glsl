// What is done where the lists of all tiles ask for more chunks than the pool has.
//
// Chunks go to whoever comes first, so that lists that find none would be others each time. Instead all lists are
// made again, of the tiles that ask for the fewest chunks, as many as fit. The other tiles have the most edges, and
// those are the ones whose receivers send rays anyway where there are too many: so the pool only lowers that limit. Of
// tiles that ask for equally many, the first ones of the picture fit.
#ifndef ANTUMBRA_DBUFFER_OVERFLOW_GLSL
#define ANTUMBRA_DBUFFER_OVERFLOW_GLSL

#include "common/tiles.glsl"

// Invocations of a workgroup of demand.comp.
const uint DEMAND_LANES = 64u;

// Arguments of dispatches: of none where the pool has room for all.
struct Overflow {
    uvec4 demand;
    uvec4 fit;
};

// The list of tiles that fit, and arguments of the dispatches over it.
struct Fitting {
    TileArguments tiles; // of cutouts.comp
    uvec4 lists;         // of lists.comp
};

#endif
