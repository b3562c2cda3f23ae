#version 460
// The edge of a band, where it is not behind something else.

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
layout(location = 3) flat in uint entry;

layout(location = 0) out uint edge;

void main() {
    LightView view = params.views[push.view];
    bool perspective = view.forward.w > 0.0;
    vec2 along = ends.zw - ends.xy;
    float t = dot(place - ends.xy, along) / max(dot(along, along), 1.0e-38);
    t = clamp(t, 0.0, 1.0);
    float depth = mix(depths.x, depths.y, t);
    // An edge behind something else throws no penumbra of its own. What is just outside of it tells.
    float size_texels = float(params.counts.y);
    float texel = max(abs(1.0 / view.scale.x), abs(1.0 / view.scale.y)) / size_texels;
    vec2 map = map_of(view, mix(ends.xy, ends.zw, t) + 1.5 * texel * depths.zw);
    vec2 at = clamp(floor(map * size_texels), 0.0, size_texels - 1.0);
    float seen = texelFetch(map_depth, ivec2(at), 0).x;
    float own = perspective ? view.scale.z * depth : view.scale.z * depth + view.scale.w;
    float slack = perspective ? 1.0e-4 * own : 1.0e-5;
    if (seen > own + slack) {
        discard;
    }
    edge = entry;
}
