// The views of `mdi` and their depth buckets.
#ifndef ANTUMBRA_MDI_PARAMS_GLSL
#define ANTUMBRA_MDI_PARAMS_GLSL

#include "common/light_view.glsl"

// Width of the image that holds all lists of depths.
const uint LIST_WIDTH = 4096u;

// Rays of a table.
const uint MAX_RAYS = 256u;

struct MdiParams {
    uvec4 counts; // views, texels across and down a view, depths that lists have room for, triangles
    vec4 origin;  // xyz: what views are relative to: the light, of a sun the origin of scene space
    LightView views[MAX_LIGHT_VIEWS];
    // x: scaled depth where bucket 0 begins, y: buckets for 1 more of it, z: its inverse. Depth z is
    // scaled as metres, or as -1 / (z + w) where BUCKETS_RECIPROCAL is set.
    vec4 buckets[MAX_LIGHT_VIEWS];
    vec4 nearest[MAX_LIGHT_VIEWS]; // x: depth along the view that triangles are cut off at, metres
};

layout(constant_id = 20) const uint BUCKETS = 32u;
layout(constant_id = 21) const uint BUCKETS_RECIPROCAL = 0u;
layout(constant_id = 22) const uint MARK_NEAREST = 0u; // else both ends of a bucket
const uint WORDS = (BUCKETS + 31u) / 32u;

// Where a depth along a view, metres, lies among the buckets: bucket k from k to k + 1.
float bucket_place(vec4 buckets, float z) {
    float scaled = BUCKETS_RECIPROCAL != 0u ? -1.0 / (z + buckets.w) : z;
    return (scaled - buckets.x) * buckets.y;
}

// The bucket of a place, or the boundary nearest to it where MARK_NEAREST is set.
int bucket_of(float place) {
    float at = MARK_NEAREST != 0u ? place + 0.5 : place;
    return int(clamp(floor(at), 0.0, float(BUCKETS) - 1.0));
}

// Depth along a view of the boundary where bucket k begins, metres.
float boundary_depth(vec4 buckets, int k) {
    float scaled = float(k) * buckets.z + buckets.x;
    return BUCKETS_RECIPROCAL != 0u ? -1.0 / scaled - buckets.w : scaled;
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
