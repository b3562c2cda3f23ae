// The published D-buffer: parameters and texels.
//
// A texel of an image of the umbra's or penumbra's surface holds two numbers, 0 and 0 where there is
// none. Distances: how far the surface is from the light's centre, and the silhouette as a part of that
// with the number of its blocker. Edges: one more than the edge's number, and that of its blocker; a
// silhouette face, which has no one edge, is NO_EDGE.
#ifndef ANTUMBRA_DBUFFER_BUFFER_GLSL
#define ANTUMBRA_DBUFFER_BUFFER_GLSL

#include "common/light_view.glsl"

struct BufferParams {
    uvec4 counts; // views, width of an image in texels, width and height of the picture in pixels
    vec4 center;  // of the light, metres, of a sun 0; w: radius, metres, of a sun tangent of half its angle
    vec4 axis_x;  // unit vector; w: distance of the farthest receiver from the centre, metres, of a sun its
                  // depth along the direction
    vec4 axis_y;  // unit vector; w: the depth at which stored depth begins, likewise
    vec4 axis_z;  // unit vector that the light emits along
    LightView views[MAX_LIGHT_VIEWS];
};

const uint NO_EDGE = 0xffffffffu;

// Of the stored parts of distances.
const float MOST_PART = 65535.0;

#endif
