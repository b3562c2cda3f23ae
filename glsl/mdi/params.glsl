// The views of `mdi` and their depth buckets.
#ifndef ANTUMBRA_MDI_PARAMS_GLSL
#define ANTUMBRA_MDI_PARAMS_GLSL

#include "common/light_view.glsl"

// Width of the image that holds all lists of depths.
const uint LIST_WIDTH = 4096u;

// Rays of a table.
const uint MAX_RAYS = 256u;

// Bits of the options.
const uint RANDOM_PLACES = 1u;
const uint PIXEL_FOOTPRINT = 2u;
const uint DITHERED_TEXELS = 4u;
const uint UNEVEN_LIGHT = 8u;
const uint ALL_BOUNDARIES = 16u;
const uint TESTED_SIDES = 32u;

struct MdiParams {
    uvec4 counts;  // views, texels across and down a view, depths that lists have room for, 0
    uvec4 options; // buckets, 1 where surfaces mark the nearest boundary and 0 both of a bucket, rays,
                   // RANDOM_PLACES | PIXEL_FOOTPRINT | DITHERED_TEXELS | UNEVEN_LIGHT |
                   // ALL_BOUNDARIES | TESTED_SIDES
    vec4 origin;   // xyz: what views are relative to: the light, of a sun the origin of scene space
    LightView views[MAX_LIGHT_VIEWS];
    vec4 places[MAX_LIGHT_VIEWS];  // place = (x + y s) / (z + w s): bucket k is from k to k + 1
    vec4 nearest[MAX_LIGHT_VIEWS]; // x: depth along the view that triangles are cut off at, metres
};

// Where a depth lies among the buckets. s: 1 / z for a depth z along a perspective view, metres; -z
// along a sun's.
float place_of(vec4 places, float s) {
    return (places.x + places.y * s) / (places.z + places.w * s);
}

// Inverse of `place_of`.
float s_of(vec4 places, float place) {
    return (places.x - places.z * place) / (places.w * place - places.y);
}

// The bucket of a place, or the boundary nearest to it where surfaces mark that. options: of MdiParams.
int bucket_of(uvec4 options, float place) {
    float at = options.y != 0u ? place + 0.5 : place;
    return int(clamp(floor(at), 0.0, float(options.x) - 1.0));
}

// Words of a texel's mask, each a layer of the image of boundaries.
uint words_of(uvec4 options) {
    return options.x / 32u;
}

ivec2 list_place(uint index) {
    return ivec2(index % LIST_WIDTH, index / LIST_WIDTH);
}

// Arguments of a dispatch over the large triangles of a view: rows in x, triangles in y.
struct LargeArguments {
    uint groups_x;
    uint groups_y;
    uint groups_z;
    uint count;
};

// Most workgroups in y; each takes every so many of the list.
const uint LARGE_GROUPS = 32768u;

#endif
