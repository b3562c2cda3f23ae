#version 460
// A short walk down the hierarchy with the shaft of each tile, or part of one. A tile whose shaft meets no triangle, or
// none that hides anything, is lit; one whose surfaces are all turned away from the light is dark. Both are settled
// here, the others listed: their walks are long, and invocations of a vector wait for the longest.

#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "shaft_masks/estimates.glsl"
#include "shaft_masks/lists.glsl"
#include "shaft_masks/walk.glsl"

layout(local_size_x = PARTS_A_GROUP) in;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 2, rgba32f) uniform readonly image2D hierarchy;
layout(set = 0, binding = 3, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 4) uniform usampler2D list;
layout(set = 0, binding = 5, rgba32f) uniform readonly image2D shafts;
layout(set = 0, binding = 6, rgba32f) uniform readonly image2D triangles;
layout(set = 0, binding = 7, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 8, r32f) uniform readonly image2D view_depth;
layout(set = 0, binding = 9, r32ui) uniform writeonly uimage2D estimates;
layout(set = 0, binding = 10, std430) buffer RestArguments {
    TileArguments rest;
};
layout(set = 0, binding = 11, r32ui) uniform writeonly uimage2D rest_list;

vec4 fetch_triangle_texel(uint texel) {
    return imageLoad(triangles, triangle_texel_place(texel));
}

vec4 fetch_node_texel(ivec2 place) {
    return imageLoad(hierarchy, place);
}

vec4 fetch_shaft_texel(ivec2 place) {
    return imageLoad(shafts, place);
}

// Steps of a walk that is short.
const uint MOST_STEPS = 32u;

void main() {
    uint index = spread_entry(gl_WorkGroupID.x, gl_NumWorkGroups.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 size = params.counts.xy;
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 part = part_of_entry(entry, tiles);
    Shaft shaft = fetch_shaft(part);
    Surfaces surfaces = fetch_surfaces(part, view.light);

    uint nodes = params.counts.z;
    uint short_list[SHORT_LIST];
    uint count = 0u;
    bool dark = shaft.low.w < 0.0;
    bool goes_on = !dark;
    uint node = 0u;
    uint steps = 0u;
    do {
        goes_on = goes_on && node < nodes;
        if (goes_on) {
            Step step = step_at(shaft, surfaces, node);
            if (step.is_met && count < SHORT_LIST) {
                short_list[count] = step.triangle;
            }
            count += step.is_met ? 1u : 0u;
            goes_on = !step.cancels && count <= SHORT_LIST;
            node = step.next;
        }
        steps += 1u;
    } while (goes_on && steps < MOST_STEPS);

    bool lit = !dark && node >= nodes && count <= SHORT_LIST && shaft.low.w > 0.0;
    lit = lit && !any_hides(view.light, surfaces, shaft, fetch_some_surface(part), short_list, count);
    uint level = dark ? LEVEL_DARK : lit ? LEVEL_LIT : LEVEL_OPEN;
    imageStore(estimates, estimate_place(part, ESTIMATE_LEVEL), uvec4(level));
    if (level == LEVEL_OPEN) {
        uint at = atomicAdd(rest.count, 1u);
        atomicMax(rest.groups_x, at / PARTS_A_GROUP + 1u);
        imageStore(rest_list, tile_entry_place(at, tiles), uvec4(entry));
    }
    vec2 depths = fetch_part_depths(part);
    uint pixels = dark ? TILE_SIZE * TILE_SIZE : 0u; // all is lit at the beginning
    for (uint i = 0u; i < pixels; ++i) {
        // Stores beyond the picture's border are dropped.
        uvec2 pixel = tile_of_part(part, tiles) * TILE_SIZE + uvec2(i % TILE_SIZE, i / TILE_SIZE);
        float depth = imageLoad(view_depth, ivec2(min(pixel, size - 1u))).x;
        if (is_in_part(depths, depth) && depth > 0.0) {
            imageStore(visibility, ivec2(pixel), vec4(0.0));
        }
    }
}
