#version 460
// Visibility of the tiles that were worked on in several tasks.

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
layout(set = 0, binding = 2) uniform usampler2D tasks;
layout(set = 0, binding = 3) uniform usampler2D lists;
layout(set = 0, binding = 4) uniform usampler2D words;
layout(set = 0, binding = 5, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 6) uniform usampler2D partial_list;

layout(push_constant) uniform Push {
    uint is_partial; // 1 for the tiles whose lists do not know all
} push;

vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0); // none is needed here
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count || gl_WorkGroupID.z > 0u) {
        return;
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uvec4 task = push.is_partial != 0u ? texelFetch(partial_list, tile_entry_place(index, tiles), 0)
        : texelFetch(tasks, task_place(index), 0);
    uvec2 tile = tile_of_entry(task.x, tiles);
    // One task of the tile is enough.
    bool is_first = push.is_partial != 0u || task.z == TASK_ENTRIES;
    if (!is_first || texelFetch(lists, ivec2(tile), 0).w == TILE_SETTLED) {
        return;
    }
    int hidden = 0;
    for (uint word = 0u; word < WORDS; ++word) {
        ivec2 place = word_place(task.x, gl_LocalInvocationID.xy, word);
        hidden += bitCount(texelFetch(words, place, 0).x);
    }
    uvec2 pixel = tile * TILE_SIZE + gl_LocalInvocationID.xy;
    float samples = float(ROWS * COLUMNS);
    imageStore(visibility, ivec2(pixel), vec4((samples - float(hidden)) / samples));
}
