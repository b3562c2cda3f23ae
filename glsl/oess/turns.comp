#version 460
// Where the ends of silhouettes lie around the line: the two coordinates across it. A receiver's plane through the
// line cuts an edge if its ends are on both sides, which these tell by themselves. And which turn around the line each
// takes up.

#include "common/view_params.glsl"
#include "dbuffer/lists.glsl"
#include "dbuffer/params.glsl"
#include "oess/turns.glsl"
#include "silhouettes/edges.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std140) uniform View {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform Arguments {
    SilhouetteArguments silhouettes;
};
layout(set = 0, binding = 2) uniform sampler2D ends;
layout(set = 0, binding = 3, rgba32f) uniform writeonly image2D turns;
layout(set = 0, binding = 4, rgba32ui) uniform writeonly uimage2D spans;
layout(set = 0, binding = 5, std140) uniform Block {
    DbufferParams params;
};

vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0);
}

uvec4 fetch_edge_texel(ivec2 place) {
    return uvec4(0u);
}

vec4 fetch_point_texel(ivec2 place) {
    return vec4(0.0);
}

void main() {
    // A texel of spans each.
    uint texel = gl_WorkGroupID.y * SILHOUETTES_ROW + gl_GlobalInvocationID.x;
    if (SPANS * texel >= silhouettes.count) {
        return;
    }
    uvec4 found = uvec4(0u);
    for (uint i = 0u; i < SPANS; ++i) {
        uint index = SPANS * texel + i;
        vec3 a = texelFetch(ends, triangle_texel_place(2u * index), 0).xyz;
        vec3 b = texelFetch(ends, triangle_texel_place(2u * index + 1u), 0).xyz;
        vec4 turn = vec4(across_line(view.light, a), across_line(view.light, b));
        // Stores beyond the last silhouette are to places that nobody reads, or dropped.
        imageStore(turns, triangle_texel_place(index), turn);
        found[i] = span_of(turn.xy, turn.zw);
    }
    imageStore(spans, span_place(params.counts.w, texel), found);
}
