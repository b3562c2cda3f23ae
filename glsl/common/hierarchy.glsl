// A bounding volume hierarchy over the scene's triangles in an RGBA32F image, three texels a node: least
// and largest corner of its box; a cone that holds the normals of its triangles and their neighbours. Nodes follow each other as a walk meets them: w of the first texel is
// a leaf's triangle, or -1 times the node to go on with where an inner node's box is missed; where it
// is met, the next node is the one to go on with. So no stack is needed, and a walk can be left and
// taken up again at any node. w of the second texel is how far neighbours reach out of the box, in metres along any
// axis; the third holds the cone's axis and the sine of half its angle, or 2 where there is none: where the angle
// is 180 degrees or more, or where a triangle has holes or no two-sided neighbour of like winding at an edge.
#ifndef ANTUMBRA_COMMON_HIERARCHY_GLSL
#define ANTUMBRA_COMMON_HIERARCHY_GLSL

#include "common/triangles.glsl"

const uint NODE_TEXELS = 3u;

vec4 fetch_node_texel(ivec2 place); // defined by the entry file

vec4 fetch_node_low(uint node) {
    return fetch_node_texel(triangle_texel_place(NODE_TEXELS * node));
}

vec4 fetch_node_high(uint node) {
    return fetch_node_texel(triangle_texel_place(NODE_TEXELS * node + 1u));
}

vec4 fetch_node_cone(uint node) {
    return fetch_node_texel(triangle_texel_place(NODE_TEXELS * node + 2u));
}

#endif
