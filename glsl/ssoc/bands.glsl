// What fragments of bands are given.
#ifndef ANTUMBRA_SSOC_BANDS_GLSL
#define ANTUMBRA_SSOC_BANDS_GLSL

#include "ssoc/places.glsl"

layout(location = 0) in float t;            // along the edge, 0 to 1 between its ends
layout(location = 1) flat in uvec4 places;  // along the edge: whether it is an outline there
layout(location = 2) flat in uvec2 entry;   // texel of the map; number of places

bool is_no_outline() {
    return !is_outline(places, entry.y, t);
}

#endif
