#version 460
// The edge nearest to each texel within its penumbra's reach; bands that overlap are resolved by the
// distance to the edge.

#include "ssoc/params.glsl"

layout(set = 0, binding = 0, std140) uniform Block {
    SsocParams params;
};
layout(set = 0, binding = 4) uniform sampler2D map_depth;

layout(push_constant) uniform Push {
    vec4 center;
    uint view;
} push;

layout(location = 0) in vec2 place;
layout(location = 1) flat in vec4 ends;
layout(location = 2) flat in vec4 depths;
layout(location = 3) flat in uvec2 number;

layout(location = 0) out uint edge;

void main() {
    LightView view = params.views[push.view];
    bool perspective = view.forward.w > 0.0;
    float size_texels = float(params.counts.y);
    float texel = max(abs(1.0 / view.scale.x), abs(1.0 / view.scale.y)) / size_texels;
    vec2 along = ends.zw - ends.xy;
    float t = dot(place - ends.xy, along) / max(dot(along, along), 1.0e-38);
    t = clamp(t, 0.0, 1.0);
    vec2 nearest = mix(ends.xy, ends.zw, t);
    float depth = mix(depths.x, depths.y, t);
    float far = perspective ? 1.0 / params.reach.y : params.reach.y;
    float width = penumbra_half_width(params.reach.x, perspective, depth, far, nearest);
    float apart = distance(place, nearest);
    bool own_half = (gl_FragCoord.x < size_texels) == (number.y == 0u);
    if (!own_half || apart > max(width, params.reach.w * texel)) {
        discard;
    }
    // An edge behind something else throws no penumbra of its own. What is just outside of it tells.
    vec2 beside = nearest + 1.5 * texel * depths.zw;
    vec2 map = (beside - vec2(view.right.w, view.up.w)) * view.scale.xy;
    vec2 at = clamp(floor(map * size_texels), 0.0, size_texels - 1.0);
    float seen = texelFetch(map_depth, ivec2(at), 0).x;
    float own = perspective ? view.scale.z * depth : view.scale.z * depth + view.scale.w;
    float slack = perspective ? 0.01 * own : 0.002;
    if (seen > own + slack) {
        discard;
    }
    edge = number.x;
    float unit = 8.0 * texel;
    gl_FragDepth = unit / (unit + apart);
}
