#version 460
// Walks the hierarchy with the shaft of each tile, or part of one. A tile whose shaft meets no triangle is lit, one
// whose surfaces are all turned away from the light is dark: both are settled here. The others get a list of
// candidates: the triangles whose boxes the shaft meets, but for those that lie in it together with their neighbours
// and show one side to all of the tile, whose edges all cancel. Of a short list each triangle is looked at here: where
// none of them hides anything the tile is lit, too.

#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "shaft_masks/estimates.glsl"
#include "shaft_masks/lists.glsl"
#include "shaft_masks/sides.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 2) uniform sampler2D hierarchy;
layout(set = 0, binding = 3, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 4) uniform usampler2D list;
layout(set = 0, binding = 5) uniform sampler2D shafts;
layout(set = 0, binding = 6, std430) buffer PenumbraArguments {
    TileArguments penumbra;
};
layout(set = 0, binding = 7, r32ui) uniform writeonly uimage2D penumbra_list;
layout(set = 0, binding = 8, std430) buffer Pool {
    uint chunks_used;
};
layout(set = 0, binding = 9, r32ui) uniform writeonly uimage2D pool;
layout(set = 0, binding = 10, rgba32ui) uniform writeonly uimage2D lists;
layout(set = 0, binding = 11, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 12) uniform sampler2D view_depth;
layout(set = 0, binding = 13, r32ui) uniform writeonly uimage2D estimates;
layout(set = 0, binding = 14) uniform sampler2D triangles;

// A software driver may end loops after 65,535 turns of all lanes of a vector together: a walk ends
// itself before, and its tile is walked anew in pieces.
const uint MOST_STEPS = 49152u;

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

vec4 fetch_node_texel(ivec2 place) {
    return texelFetch(hierarchy, place, 0);
}

vec4 fetch_shaft_texel(ivec2 place) {
    return texelFetch(shafts, place, 0);
}

// Whether all edges within a node cancel: its triangles and their neighbours all meet the shaft and show
// one side to all surfaces.
bool cancels(Surfaces surfaces, vec3 low, vec4 high, vec4 cone) {
    vec3 middle = 0.5 * low + 0.5 * high.xyz;
    vec3 half_size = 0.5 * high.xyz - 0.5 * low + high.w;
    return cone.w < 1.0 && is_between(surfaces, middle, length(half_size) + surfaces.margin_m)
        && box_side(surfaces, middle, half_size, cone.xyz, cone.w) != SIDE_UNSURE;
}

// Longest list whose triangles are looked at one by one. Invocations of a vector wait for the one with most of them.
const uint SHORT_LIST = 8u;

// Whether any triangle of a short list may hide some of the light.
bool any_hides(Surfaces surfaces, Shaft shaft, vec3 some, uint short_list[SHORT_LIST], uint count) {
    mat3 frame = light_frame(view.light, some);
    bool any = false;
    for (uint i = 0u; i < count && !any; ++i) {
        uint triangle = short_list[i];
        vec3 a = fetch_triangle_texel(4u * triangle).xyz;
        vec3 b = fetch_triangle_texel(4u * triangle + 1u).xyz;
        vec3 c = fetch_triangle_texel(4u * triangle + 2u).xyz;
        vec3 normal = fetch_triangle_texel(4u * triangle + 3u).xyz;
        uint side = triangle_side(surfaces, a, normal);
        uint side_of_light = light_side(surfaces, view.light, frame, a, normal);
        any = shaft_meets_triangle(shaft, a, b, c)
            && !hides_nothing(surfaces, side, side_of_light, a, b, c);
    }
    return any;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
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
    uint first = 0u;
    uint count = 0u;
    bool complete = true;
    uint chunk = 0u;
    uint slot = CHUNK;
    bool any_inside = false;
    uint short_list[SHORT_LIST];
    bool dark = shaft.low.w < 0.0;
    uint node = dark ? nodes : 0u;
    uint steps = 0u;
    while (node < nodes) {
        steps += 1u;
        vec4 low = fetch_node_low(node);
        vec4 high = fetch_node_high(node);
        vec4 cone = fetch_node_cone(node);
        bool leaf = low.w >= 0.0;
        uint side = shaft_side_of_box(shaft, low.xyz, high.xyz);
        bool inside = side == BOX_INSIDE && cancels(surfaces, low.xyz, high, cone);
        any_inside = any_inside || inside;
        bool enter = side != BOX_OUTSIDE && !inside;
        uint next = leaf || enter ? node + 1u : uint(-low.w);
        if (leaf && enter) {
            if (slot == CHUNK) {
                uint fresh = atomicAdd(chunks_used, 1u);
                if (fresh >= params.counts.w) {
                    complete = false;
                    next = nodes;
                } else if (count == 0u) {
                    first = fresh;
                } else {
                    imageStore(pool, chunk_entry_place(chunk, CHUNK), uvec4(fresh));
                }
                chunk = fresh;
                slot = 0u;
            }
            if (complete) {
                imageStore(pool, chunk_entry_place(chunk, slot), uvec4(uint(low.w)));
                if (count < SHORT_LIST) {
                    short_list[count] = uint(low.w);
                }
                slot += 1u;
                count += 1u;
            }
        }
        node = next;
        if (steps == MOST_STEPS && node < nodes) {
            complete = false;
            node = nodes;
        }
    }

    vec2 depths = fetch_part_depths(part);
    bool lit = complete && !any_inside && count <= SHORT_LIST && shaft.low.w > 0.0;
    lit = lit && !any_hides(surfaces, shaft, fetch_some_surface(part), short_list, count);
    if (lit || dark) {
        imageStore(estimates, estimate_place(part, ESTIMATE_LEVEL), uvec4(dark ? LEVEL_DARK : LEVEL_LIT));
        for (uint i = 0u; i < TILE_SIZE * TILE_SIZE; ++i) {
            // Stores beyond the picture's border are dropped.
            uvec2 pixel = tile_of_part(part, tiles) * TILE_SIZE + uvec2(i % TILE_SIZE, i / TILE_SIZE);
            float depth = texelFetch(view_depth, ivec2(min(pixel, size - 1u)), 0).x;
            if (is_in_part(depths, depth)) {
                imageStore(visibility, ivec2(pixel), vec4(dark && depth > 0.0 ? 0.0 : 1.0));
            }
        }
    } else {
        uint at = atomicAdd(penumbra.count, 1u);
        atomicMax(penumbra.groups_x, min(at + 1u, TILE_ROW));
        atomicMax(penumbra.groups_y, at / TILE_ROW + 1u);
        imageStore(penumbra_list, tile_entry_place(at, tiles), uvec4(entry));
        imageStore(lists, list_place(part), uvec4(first, count, complete ? nodes : 0u, TILE_OPEN));
    }
}
