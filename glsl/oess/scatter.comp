#version 460
// The published step 3: every occluding edge writes itself to the texels of the penumbra that begins at
// it. Where several do, the nearest one stays, whatever the order.

#include "oess/row.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0) uniform sampler2D map_depth;
layout(set = 0, binding = 1) uniform usampler2D edges;
layout(set = 0, binding = 2, r32ui) uniform uimage2D outreach;
layout(set = 0, binding = 3, r32ui) uniform uimage2D steps;

float fetch_row_depth(ivec2 texel) {
    return texelFetch(map_depth, texel, 0).x;
}

void main() {
    ivec2 size = textureSize(map_depth, 0);
    ivec2 place = ivec2(gl_GlobalInvocationID.xy); // u, row
    if (any(greaterThanEqual(place, size))) {
        return;
    }
    ivec2 texel = ivec2(row_column(place.x, size.x), place.y);
    if (texelFetch(edges, texel, 0).x == 0u) {
        return;
    }
    float c = corresponding(place.x, place.y, size.x);
    uint count = 0u;
    for (int u = place.x - 1; u >= 0; --u) {
        count += 1u;
        if (corresponding(u, place.y, size.x) < c) {
            break;
        }
        imageAtomicMax(outreach, ivec2(row_column(u, size.x), place.y), uint(size.x - place.x));
    }
    imageAtomicAdd(steps, ivec2(place.y, 0), count);
}
