#version 460
// Where each silhouette edge is an outline, in each view: a bit for each place along it.
//
// What is just outside of the edge tells: something nearer, which the edge is behind, or a surface that
// goes on from the edge, as where rounding has left cracks in a mesh, where a corner of one triangle is
// amid another's side, or where a body stands on a floor, is no outline.

#include "ssoc/params.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std140) uniform Block {
    SsocParams params;
};
layout(set = 0, binding = 1) uniform usampler2D list;
layout(set = 0, binding = 2) uniform usampler2D edges;
layout(set = 0, binding = 3) uniform sampler2D points;
layout(set = 0, binding = 4) uniform sampler2DArray map_depth;
layout(set = 0, binding = 5) uniform usampler2DArray map_ids;
layout(set = 0, binding = 6) uniform sampler2D triangles;
layout(set = 0, binding = 7, std140) uniform Arguments {
    uvec4 arguments[2]; // of the list of silhouettes
};
layout(set = 0, binding = 8, rgba32ui) uniform writeonly uimage2DArray outlines;

layout(push_constant) uniform Push {
    vec4 center; // of the light, metres; of a sun the origin
} push;

#include "ssoc/outline.glsl"

// How far a surface beside an edge may be off it and still be joined to it, in texels of the map.
const float CRACK_TEXELS = 0.02;
// How far apart in depth both may be seen to be, in texels.
const float NEAR_TEXELS = 16.0;

uvec4 fetch_edge_texel(ivec2 at) {
    return texelFetch(edges, at, 0);
}

vec4 fetch_point_texel(ivec2 at) {
    return texelFetch(points, at, 0);
}

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

bool is_no_outline(LightView view, uint layer, Outline outline, float t) {
    bool perspective = view.forward.w > 0.0;
    float depth = mix(outline.depths.x, outline.depths.y, t);
    float size_texels = float(params.counts.y);
    float texel = map_texel(view);
    vec2 middle = mix(outline.from, outline.to, t);
    vec2 map = map_of(view, middle + 1.5 * texel * outline.outward);
    ivec3 at = ivec3(clamp(floor(map * size_texels), 0.0, size_texels - 1.0), int(layer));
    float seen = texelFetch(map_depth, at, 0).x;
    float own = perspective ? view.scale.z * depth : view.scale.z * depth + view.scale.w;
    float slack = perspective ? 1.0e-4 * own : 1.0e-5;
    if (seen > own + slack) {
        return true;
    }
    float near = NEAR_TEXELS * texel * (perspective ? own : abs(view.scale.z));
    uint id = texelFetch(map_ids, at, 0).x;
    if (id == 0u || seen < own - near) {
        return false;
    }
    vec3 q = perspective ? vec3(middle, 1.0) / depth : vec3(middle, depth);
    vec3 edge_point = push.center.xyz + q.x * view.right.xyz + q.y * view.up.xyz + q.z * view.forward.xyz;
    vec3 corner = fetch_corner(id - 1u, 0u).position;
    float apart = dot(fetch_geometric_normal(id - 1u), edge_point - corner);
    return abs(apart) <= CRACK_TEXELS * texel * (perspective ? q.z : 1.0);
}

void main() {
    uint index = gl_WorkGroupID.y * SILHOUETTES_ROW + gl_GlobalInvocationID.x;
    if (index >= arguments[1].x) {
        return;
    }
    uint number = texelFetch(list, triangle_texel_place(index), 0).x;
    for (uint layer = 0u; layer < params.counts.x; ++layer) {
        LightView view = params.views[layer];
        Outline outline = outline_of(view, push.center.xyz, number);
        uint count = outline.shown ? outline_places(view, outline) : 0u;
        uint words[4] = uint[](0u, 0u, 0u, 0u);
        for (uint place = 0u; place < count; ++place) {
            bool no = is_no_outline(view, layer, outline, (float(place) + 0.5) / float(count));
            words[place / 32u] |= no ? 0u : 1u << (place & 31u);
        }
        imageStore(
            outlines,
            ivec3(triangle_texel_place(index), int(layer)),
            uvec4(words[0], words[1], words[2], words[3])
        );
    }
}
