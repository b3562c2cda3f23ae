// Edges of the scene and the faces that meet there: Adjacency of the renderer.
#ifndef ANTUMBRA_SILHOUETTES_EDGES_GLSL
#define ANTUMBRA_SILHOUETTES_EDGES_GLSL

#include "common/triangles.glsl"

const uint NO_POINT = 0xffffffffu;
const uint MORE_FACES = 0x80000000u;

// Silhouettes that one row of workgroups covers, of a dispatch over a list of them.
const uint SILHOUETTES_ROW = 64u * 32768u;

uvec4 fetch_edge_texel(ivec2 place); // defined by the entry file
vec4 fetch_point_texel(ivec2 place); // defined by the entry file

// Both ends, the corner opposite of the edge in its first face, and either NO_POINT, that of its
// second face, or MORE_FACES plus the texel of further ones.
uvec4 fetch_edge(uint edge) {
    return fetch_edge_texel(triangle_texel_place(edge));
}

// Scene space, metres; w: number of the connected part of the scene.
vec4 fetch_point(uint point) {
    return fetch_point_texel(triangle_texel_place(point));
}

#endif
