// What fragments of bands are given.
#ifndef ANTUMBRA_SSOC_BANDS_GLSL
#define ANTUMBRA_SSOC_BANDS_GLSL

#include "common/triangles.glsl"
#include "ssoc/params.glsl"

layout(set = 0, binding = 0, std140) uniform Block {
    SsocParams params;
};
layout(set = 0, binding = 4) uniform sampler2D map_depth;
layout(set = 0, binding = 5) uniform usampler2D map_ids;
layout(set = 0, binding = 6) uniform sampler2D triangles;

layout(push_constant) uniform Push {
    vec4 center; // of the light, metres; of a sun the origin
    uint view;
} push;

layout(location = 0) in vec2 place;
layout(location = 1) flat in vec4 ends;
layout(location = 2) flat in vec4 depths;
layout(location = 3) flat in uint entry;

// How far a surface beside an edge may be off it and still be joined to it, in texels of the map.
const float CRACK_TEXELS = 0.02;
// How far apart in depth both may be seen to be, in texels.
const float NEAR_TEXELS = 16.0;

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

// Whether the edge is no outline there. What is just outside of it tells: something nearer, which the edge
// is behind, or a surface that goes on from the edge, as where rounding has left cracks in a mesh, where a
// corner of one triangle is amid another's side, or where a body stands on a floor.
bool is_no_outline() {
    LightView view = params.views[push.view];
    bool perspective = view.forward.w > 0.0;
    vec2 along = ends.zw - ends.xy;
    float t = dot(place - ends.xy, along) / max(dot(along, along), 1.0e-38);
    t = clamp(t, 0.0, 1.0);
    float depth = mix(depths.x, depths.y, t);
    float size_texels = float(params.counts.y);
    float texel = max(abs(1.0 / view.scale.x), abs(1.0 / view.scale.y)) / size_texels;
    vec2 map = map_of(view, mix(ends.xy, ends.zw, t) + 1.5 * texel * depths.zw);
    vec2 at = clamp(floor(map * size_texels), 0.0, size_texels - 1.0);
    float seen = texelFetch(map_depth, ivec2(at), 0).x;
    float own = perspective ? view.scale.z * depth : view.scale.z * depth + view.scale.w;
    float slack = perspective ? 1.0e-4 * own : 1.0e-5;
    if (seen > own + slack) {
        return true;
    }
    float near = NEAR_TEXELS * texel * (perspective ? own : abs(view.scale.z));
    uint id = texelFetch(map_ids, ivec2(at), 0).x;
    if (id == 0u || seen < own - near) {
        return false;
    }
    vec2 middle = mix(ends.xy, ends.zw, t);
    vec3 q = perspective ? vec3(middle, 1.0) / depth : vec3(middle, depth);
    vec3 edge_point = push.center.xyz + q.x * view.right.xyz + q.y * view.up.xyz + q.z * view.forward.xyz;
    vec3 corner = fetch_corner(id - 1u, 0u).position;
    float apart = dot(fetch_geometric_normal(id - 1u), edge_point - corner);
    return abs(apart) <= CRACK_TEXELS * texel * (perspective ? q.z : 1.0);
}

#endif
