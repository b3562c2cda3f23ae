#version 460
// Masks of the listed tiles, of tasks on the rest of long lists, or of runs of nodes that lists do not
// know: a workgroup each, and of each block of samples. Four pixels an invocation, so that each fetch of an
// edge or a triangle serves four.

#include "common/camera.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "shaft_masks/params.glsl"

layout(local_size_x = 8, local_size_y = 2) in;

// 1 for what lists do not know: a pipeline of its own, because it has code of its own.
layout(constant_id = 1) const uint WALK = 0u;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 2) uniform sampler2D view_depth;
layout(set = 0, binding = 3) uniform usampler2D ids;
layout(set = 0, binding = 4) uniform sampler2D triangles;
layout(set = 0, binding = 5) uniform sampler2D hierarchy;
layout(set = 0, binding = 6) uniform sampler2D materials;
layout(set = 0, binding = 7) uniform sampler2D uvs;
layout(set = 0, binding = 8) uniform sampler2D texels;
layout(set = 0, binding = 9, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 10) uniform usampler2D list;
layout(set = 0, binding = 11) uniform sampler2D shafts;
layout(set = 0, binding = 12) uniform usampler2D edge_pool;
layout(set = 0, binding = 13) uniform usampler2D lists;
layout(set = 0, binding = 14, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 15) uniform usampler2D tasks;
layout(set = 0, binding = 16, r32ui) uniform uimage2D words;
layout(set = 0, binding = 17) uniform usampler2D triangle_pool;
layout(set = 0, binding = 18, r32ui) uniform uimage2D estimates;

layout(push_constant) uniform Push {
    uint first_run; // of nodes, of this dispatch
    uint run;       // nodes of a run
    uint further;   // 1 for the rest of long lists
} push;

#define SUN_TANGENT_SQUARE (view.light.axis_x.w * view.light.axis_x.w)

#include "shaft_masks/estimates.glsl"
#include "shaft_masks/lists.glsl"
#include "shaft_masks/masks.glsl"

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

vec4 fetch_node_texel(ivec2 place) {
    return texelFetch(hierarchy, place, 0);
}

vec4 fetch_shaft_texel(ivec2 place) {
    return texelFetch(shafts, place, 0);
}

vec4 fetch_material_texel(ivec2 place) {
    return texelFetch(materials, place, 0);
}

vec4 fetch_uv_texel(ivec2 place) {
    return texelFetch(uvs, place, 0);
}

vec4 fetch_texture_texel(ivec2 place) {
    return texelFetch(texels, place, 0);
}

// A receiver, and what its own plane hides.
MaskReceiver fetch_receiver(uvec2 pixel, vec2 depths, out uvec2 blocked) {
    uvec2 within = min(pixel, params.counts.xy - 1u);
    float depth = texelFetch(view_depth, ivec2(within), 0).x;
    vec3 ray = pixel_ray(view.camera, within);
    MaskReceiver receiver;
    receiver.position = view.camera.eye.xyz + depth * ray;
    receiver.in_part = is_in_part(depths, depth);
    receiver.id = depth > 0.0 ? texelFetch(ids, ivec2(within), 0).x : 0u;
    vec3 normal = fetch_geometric_normal(max(receiver.id, 1u) - 1u);
    normal = dot(normal, ray) > 0.0 ? -normal : normal;
    blocked = own_mask(rows_from(view.light, receiver.position), normal);
    return receiver;
}

// Stores what a receiver sees; returns its part of its tile's ESTIMATE_CHANGES.
uint store(uint slot, uint block, uvec2 pixel, MaskReceiver receiver, uvec2 blocked, bool in_parts) {
    if (!receiver.in_part) {
        return 0u;
    }
    blocked = receiver.id == 0u ? uvec2(0u) : blocked;
    if (!in_parts) {
        // Stores beyond the picture's border are dropped.
        int hidden = bitCount(blocked.x) + bitCount(blocked.y);
        float samples = float(ROWS * COLUMNS);
        imageStore(visibility, ivec2(pixel), vec4((samples - float(hidden)) / samples));
        return all(lessThan(pixel, params.counts.xy)) ? changed_pixel(changes_in(blocked, LIGHT_SHAPE == LIGHT_LINE)) : 0u;
    }
    for (uint word = 0u; word < 2u; ++word) {
        ivec2 place = word_place(slot, pixel % TILE_SIZE, params.pattern.y, 2u * block + word);
        if (WALK != 0u || push.further != 0u) {
            imageAtomicOr(words, place, blocked[word]);
        } else {
            imageStore(words, place, uvec4(blocked[word]));
        }
    }
    return 0u; // all of them are known later
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uvec4 task = push.further != 0u ? texelFetch(tasks, task_place(index), 0)
        : texelFetch(list, tile_entry_place(index, tiles), 0);
    uvec2 part = part_of_entry(task.x, tiles);
    uvec2 tile = tile_of_part(part, tiles);
    vec2 depths = fetch_part_depths(part);
    ivec2 at = list_place(part);
    uvec4 stored = texelFetch(lists, at, 0);
    if (stored.w == TILE_SETTLED) {
        return;
    }
    Entries entries = entries_of(texelFetch(lists, at + ivec2(1, 0), 0), texelFetch(lists, at + ivec2(2, 0), 0));
    uint block = gl_WorkGroupID.z % params.pattern.y;
    fetch_light_rows(block);

    uvec2 pixel = tile * TILE_SIZE + gl_LocalInvocationID.xy;
    uvec2 step = uvec2(0u, 2u);
    uvec2 blocked_0;
    uvec2 blocked_1;
    uvec2 blocked_2;
    uvec2 blocked_3;
    MaskReceiver receiver_0 = fetch_receiver(pixel, depths, blocked_0);
    MaskReceiver receiver_1 = fetch_receiver(pixel + step, depths, blocked_1);
    MaskReceiver receiver_2 = fetch_receiver(pixel + 2u * step, depths, blocked_2);
    MaskReceiver receiver_3 = fetch_receiver(pixel + 3u * step, depths, blocked_3);
    bool in_parts = params.pattern.y > 1u || entries.whole + entries.others > TASK_ENTRIES
        || stored.z < params.counts.z;

    if (WALK == 0u) {
        Projection from_0 = projection_from(receiver_0, row_rise());
        Projection from_1 = projection_from(receiver_1, row_rise());
        Projection from_2 = projection_from(receiver_2, row_rise());
        Projection from_3 = projection_from(receiver_3, row_rise());
        uint counts_0[2u * ROWS];
        uint counts_1[2u * ROWS];
        uint counts_2[2u * ROWS];
        uint counts_3[2u * ROWS];
        for (uint i = 0u; i < 2u * ROWS; ++i) {
            counts_0[i] = NO_COUNT;
            counts_1[i] = NO_COUNT;
            counts_2[i] = NO_COUNT;
            counts_3[i] = NO_COUNT;
        }
        uint edges = push.further != 0u ? 0u : entries.edges;
        for (uint i = 0u; i < edges; ++i) {
            uint code = texelFetch(edge_pool, triangle_texel_place(entries.first_edge + i), 0).x;
            uint triangle = (code & ~(EDGE_DOUBLE | EDGE_TURNED)) >> EDGE_CORNER_BITS;
            uint corner = code & ((1u << EDGE_CORNER_BITS) - 1u);
            vec3 a = fetch_triangle_texel(4u * triangle + corner).xyz;
            vec3 b = fetch_triangle_texel(4u * triangle + (corner == 2u ? 0u : corner + 1u)).xyz;
            count_edge(from_0, a, b, code, counts_0);
            count_edge(from_1, a, b, code, counts_1);
            count_edge(from_2, a, b, code, counts_2);
            count_edge(from_3, a, b, code, counts_3);
        }
        blocked_0 |= counted_mask(counts_0);
        blocked_1 |= counted_mask(counts_1);
        blocked_2 |= counted_mask(counts_2);
        blocked_3 |= counted_mask(counts_3);
        uint first = push.further != 0u ? task.y : 0u;
        uint end = min(first + TASK_ENTRIES, entries.whole);
        for (uint i = first; i < end; ++i) {
            uint triangle = texelFetch(triangle_pool, triangle_texel_place(entries.first + i), 0).x;
            vec3 a = fetch_triangle_texel(4u * triangle).xyz;
            vec3 b = fetch_triangle_texel(4u * triangle + 1u).xyz;
            vec3 c = fetch_triangle_texel(4u * triangle + 2u).xyz;
            add_whole(from_0, a, b, c, blocked_0);
            add_whole(from_1, a, b, c, blocked_1);
            add_whole(from_2, a, b, c, blocked_2);
            add_whole(from_3, a, b, c, blocked_3);
        }
        end = min(first + TASK_ENTRIES, entries.whole + entries.others);
        LightFrom light_0 = rows_from(view.light, receiver_0.position);
        LightFrom light_1 = rows_from(view.light, receiver_1.position);
        LightFrom light_2 = rows_from(view.light, receiver_2.position);
        LightFrom light_3 = rows_from(view.light, receiver_3.position);
        for (uint i = max(first, entries.whole); i < end; ++i) {
            uint place = entries.first + entries.room - 1u - (i - entries.whole);
            Blocker blocker = fetch_blocker(texelFetch(triangle_pool, triangle_texel_place(place), 0).x);
            add_blocker(receiver_0, light_0, block, blocker, blocked_0);
            add_blocker(receiver_1, light_1, block, blocker, blocked_1);
            add_blocker(receiver_2, light_2, block, blocker, blocked_2);
            add_blocker(receiver_3, light_3, block, blocker, blocked_3);
        }
    } else {
        LightFrom light_0 = rows_from(view.light, receiver_0.position);
        LightFrom light_1 = rows_from(view.light, receiver_1.position);
        LightFrom light_2 = rows_from(view.light, receiver_2.position);
        LightFrom light_3 = rows_from(view.light, receiver_3.position);
        // A walk can begin at any node: what is known of those above is only that they may be met.
        uint first = (push.first_run + gl_WorkGroupID.z / params.pattern.y) * push.run;
        uint node = max(first, stored.z);
        uint end = min(first + push.run, params.counts.z);
        Shaft shaft = fetch_shaft(part);
        while (node < end) {
            vec4 low = fetch_node_low(node);
            bool leaf = low.w >= 0.0;
            bool meets = shaft_meets_box(shaft, low.xyz, fetch_node_high(node).xyz);
            node = leaf || meets ? node + 1u : uint(-low.w);
            if (leaf && meets) {
                Blocker blocker = fetch_blocker(uint(low.w));
                add_blocker(receiver_0, light_0, block, blocker, blocked_0);
                add_blocker(receiver_1, light_1, block, blocker, blocked_1);
                add_blocker(receiver_2, light_2, block, blocker, blocked_2);
                add_blocker(receiver_3, light_3, block, blocker, blocked_3);
            }
        }
    }
    uint changes = store(entries.slot, block, pixel, receiver_0, blocked_0, in_parts)
        + store(entries.slot, block, pixel + step, receiver_1, blocked_1, in_parts)
        + store(entries.slot, block, pixel + 2u * step, receiver_2, blocked_2, in_parts)
        + store(entries.slot, block, pixel + 3u * step, receiver_3, blocked_3, in_parts);
    if (changes > 0u) {
        imageAtomicAdd(estimates, estimate_place(part, ESTIMATE_CHANGES), changes);
    }
}
