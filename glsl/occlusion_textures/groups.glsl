// Occlusion textures: runs of fine slices that are filtered together.
#ifndef ANTUMBRA_OCCLUSION_TEXTURES_GROUPS_GLSL
#define ANTUMBRA_OCCLUSION_TEXTURES_GROUPS_GLSL

#include "occlusion_textures/params.glsl"

const uint MAX_GROUPS = 128u;

struct SliceGroups {
    uvec4 count;              // groups that hold something; fine slices that do; most fine slices
                              // from a group's first to its last
    vec4 planes[MAX_GROUPS];  // x: depth of the plane that the group's texture lies in, metres;
                              // y: its lower plane; z: depth over which it fades in below, metres;
                              // w: 1 over the divisor of image coordinates at x
    uvec4 masks[MAX_GROUPS];  // fine slices of the group
    uvec4 spans[MAX_GROUPS];  // its first and last fine slice
};

#endif
