#version 460
// Visibility of the tiles that were worked on in several tasks or blocks of samples.

#include "common/tiles.glsl"
#include "shaft_masks/lists.glsl"
#include "shaft_masks/params.glsl"
#include "shaft_masks/words.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 1, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 2) uniform usampler2D list;
layout(set = 0, binding = 3) uniform usampler2D lists;
layout(set = 0, binding = 4) uniform usampler2D words;
layout(set = 0, binding = 5, r32f) uniform writeonly image2D visibility;

vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0); // none is needed here
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count || gl_WorkGroupID.z > 0u) {
        return;
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 tile = tile_of_entry(entry, tiles);
    uvec4 stored = texelFetch(lists, list_place(tile), 0);
    uvec4 counts = texelFetch(lists, list_place(tile) + ivec2(2, 0), 0);
    uint blocks = params.pattern.y;
    bool in_parts = blocks > 1u || counts.x + counts.y > TASK_ENTRIES || stored.z < params.counts.z;
    if (!in_parts || stored.w == TILE_SETTLED) {
        return;
    }
    int hidden = 0;
    for (uint word = 0u; word < 2u * blocks; ++word) {
        ivec2 place = word_place(entry, gl_LocalInvocationID.xy, blocks, word);
        hidden += bitCount(texelFetch(words, place, 0).x);
    }
    uvec2 pixel = tile * TILE_SIZE + gl_LocalInvocationID.xy;
    float samples = float(ROWS * COLUMNS * blocks);
    imageStore(visibility, ivec2(pixel), vec4((samples - float(hidden)) / samples));
}
