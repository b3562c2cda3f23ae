#version 460
// Visibility of the tiles whose masks were made in pieces.

#include "common/tiles.glsl"
#include "shaft_masks/estimates.glsl"
#include "shaft_masks/lists.glsl"
#include "shaft_masks/shaft.glsl"
#include "shaft_masks/words.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 1, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 2) uniform usampler2D list;
layout(set = 0, binding = 3, r32ui) uniform readonly uimage2D words;
layout(set = 0, binding = 4, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 5, r32f) uniform readonly image2D view_depth;
layout(set = 0, binding = 6, rgba32f) uniform readonly image2D shafts;
layout(set = 0, binding = 7, rgba32ui) uniform readonly uimage2D lists;
layout(set = 0, binding = 8, r32ui) uniform uimage2D estimates;

vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0); // none is needed here
}

vec4 fetch_node_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_shaft_texel(ivec2 place) {
    return imageLoad(shafts, place);
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 part = part_of_entry(entry, tiles);
    uvec2 tile = tile_of_part(part, tiles);
    uint blocks = params.pattern.y;
    uvec2 pixel = tile * TILE_SIZE + gl_LocalInvocationID.xy;
    float depth = imageLoad(view_depth, ivec2(min(pixel, params.counts.xy - 1u))).x;
    if (!is_in_part(fetch_part_depths(part), depth)) {
        return;
    }
    int hidden = 0;
    uint slot = imageLoad(lists, list_place(part) + ivec2(2, 0)).z;
    uint changes = 0u;
    for (uint block = 0u; block < blocks; ++block) {
        uvec2 mask = uvec2(imageLoad(words, word_place(slot, gl_LocalInvocationID.xy, blocks, 2u * block)).x,
            imageLoad(words, word_place(slot, gl_LocalInvocationID.xy, blocks, 2u * block + 1u)).x);
        hidden += bitCount(mask.x) + bitCount(mask.y);
        changes += changes_in(mask, params.rows[0].x == params.rows[1].x);
    }
    if (changes > 0u && all(lessThan(pixel, params.counts.xy))) {
        imageAtomicAdd(estimates, estimate_place(part, ESTIMATE_CHANGES), changed_pixel(changes));
    }
    float samples = float(ROWS * COLUMNS * blocks);
    imageStore(visibility, ivec2(pixel), vec4((samples - float(hidden)) / samples));
}
