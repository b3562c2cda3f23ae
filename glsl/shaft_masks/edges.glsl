// Which edges of counted triangles matter to a tile, or to a group of tiles.
#ifndef ANTUMBRA_SHAFT_MASKS_EDGES_GLSL
#define ANTUMBRA_SHAFT_MASKS_EDGES_GLSL

#include "shaft_masks/sides.glsl"

// Whether light_from chooses the same axis of a sphere for all surfaces, with a margin.
bool rows_have_one_axis(Light light, Surfaces surfaces) {
    float along = abs(dot(surfaces.z, light.axis_x.xyz));
    return abs(along - NEAR_AXIS) > surfaces.tilt + 1.0e-5;
}

// An edge that is beyond the samples on the side that edges count towards, or beyond the ends of all rows, seen from
// every surface, is left out.
// one_axis: rows lie along the same axis of a sphere for all surfaces.
bool edge_is_beyond(Shaft shaft, bool one_axis, vec3 a, vec3 b, out bool meets) {
    float beyond = -1.0;
    float outside = -1.0;
    // The rows of a sphere's disk turn a little from pixel to pixel, and by a right angle where they lie along another
    // axis; those of a rectangle rise: what is below it may cross them before their first sample.
    uint last = LIGHT_SHAPE == LIGHT_SPHERE ? (one_axis ? 1u : 0u) : LIGHT_SHAPE == LIGHT_RECT ? 3u : 4u;
    for (uint i = 0u; i < SHAFT_PLANES; ++i) {
        vec4 plane = shaft.planes[i];
        float both = lesser(dot(plane.xyz, a) - plane.w, dot(plane.xyz, b) - plane.w);
        outside = both > outside ? both : outside;
        beyond = both > beyond && i != 1u && i < last ? both : beyond;
    }
    meets = outside <= 0.0;
    return beyond > 0.0;
}

#endif
