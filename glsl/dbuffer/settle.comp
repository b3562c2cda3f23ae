#version 460
// Tiles that no silhouette, no triangle with holes and no surface's own plane stands before see all of the light or nothing of
// it: what sees its centre, unless a surface cuts through the light. The others are listed.

#include "common/tiles.glsl"
#include "dbuffer/lists.glsl"
#include "dbuffer/params.glsl"
#include "dbuffer/through.glsl"
#include "shaft_masks/shaft.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std140) uniform Block {
    DbufferParams params;
};
layout(set = 0, binding = 1, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 2) uniform usampler2D list;
layout(set = 0, binding = 3) uniform sampler2D shafts;
layout(set = 0, binding = 4) uniform usampler2D lists;
layout(set = 0, binding = 5) uniform sampler2D hard;
layout(set = 0, binding = 6, std430) buffer PenumbraArguments {
    TileArguments penumbra;
};
layout(set = 0, binding = 7, r32ui) uniform writeonly uimage2D penumbra_list;
layout(set = 0, binding = 8, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 9, std140) uniform ThroughBlock {
    Through through;
};

vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0);
}

vec4 fetch_node_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_shaft_texel(ivec2 place) {
    return texelFetch(shafts, place, 0);
}

void main() {
    uint index = spread_entry(gl_WorkGroupID.x, gl_NumWorkGroups.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 tile = tile_of_entry(entry, tiles);
    Shaft shaft = fetch_shaft(tile);
    bool settled = shaft.low.w > 0.0 && through.cut.x == 0u;
    for (uint block = 0u; block < params.sizes.y; ++block) {
        uvec4 found = texelFetch(lists, list_place(block, entry, tiles.x * tiles.y), 0);
        settled = settled && found.y == 0u && found.z == found.w;
    }
    if (settled) {
        for (uint i = 0u; i < TILE_SIZE * TILE_SIZE; ++i) {
            ivec2 pixel = ivec2(tile * TILE_SIZE + uvec2(i % TILE_SIZE, i / TILE_SIZE));
            ivec2 within = min(pixel, ivec2(params.counts.xy) - 1);
            // Stores beyond the picture's border are dropped.
            imageStore(visibility, pixel, vec4(texelFetch(hard, within, 0).x));
        }
    } else {
        uint at = atomicAdd(penumbra.count, 1u);
        atomicMax(penumbra.groups_x, min(at + 1u, TILE_ROW));
        atomicMax(penumbra.groups_y, at / TILE_ROW + 1u);
        imageStore(penumbra_list, tile_entry_place(at, tiles), uvec4(entry));
    }
}
