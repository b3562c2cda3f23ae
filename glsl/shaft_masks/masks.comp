#version 460
// Masks of the listed tiles, of tasks on the rest of long lists, or of runs of nodes that lists do not
// know: a workgroup each, four pixels an invocation, so that each fetch of a triangle serves four.

#include "common/camera.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "shaft_masks/params.glsl"

layout(local_size_x = 8, local_size_y = 2) in;

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
layout(set = 0, binding = 12) uniform usampler2D pool;
layout(set = 0, binding = 13) uniform usampler2D lists;
layout(set = 0, binding = 14, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 15) uniform usampler2D tasks;
layout(set = 0, binding = 16, r32ui) uniform uimage2D words;

const uint STEP_TILES = 0u;
const uint STEP_FURTHER = 1u;
const uint STEP_WALK = 2u;

layout(push_constant) uniform Push {
    uint step;      // one of the above
    uint first_run; // of nodes, of this dispatch
    uint run;       // nodes of a run
} push;

#define SUN_TANGENT_SQUARE (view.light.axis_x.w * view.light.axis_x.w)

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

MaskReceiver fetch_receiver(uvec2 pixel, out uint blocked[ROWS]) {
    uvec2 within = min(pixel, params.counts.xy - 1u);
    float depth = texelFetch(view_depth, ivec2(within), 0).x;
    vec3 ray = pixel_ray(view.camera, within);
    MaskReceiver receiver;
    receiver.position = view.camera.eye.xyz + depth * ray;
    receiver.id = depth > 0.0 ? texelFetch(ids, ivec2(within), 0).x : 0u;
    receiver.light = light_from(view.light, receiver.position);
    vec3 extent = max(abs(receiver.position), LIGHT_SHAPE == LIGHT_SUN ? vec3(0.0) : abs(view.light.center.xyz));
    receiver.rounding_m = POSITION_ROUNDING * max(extent.x, max(extent.y, extent.z));
    vec3 normal = fetch_geometric_normal(max(receiver.id, 1u) - 1u);
    normal = dot(normal, ray) > 0.0 ? -normal : normal;
    start_mask(receiver, normal, blocked);
    return receiver;
}

void store(uint tile, uvec2 pixel, MaskReceiver receiver, uint blocked[ROWS], bool in_parts) {
    if (!in_parts) {
        // Stores beyond the picture's border are dropped.
        float seen = receiver.id == 0u ? 1.0 : mask_visibility(blocked);
        imageStore(visibility, ivec2(pixel), vec4(seen));
        return;
    }
    for (uint word = 0u; word < WORDS; ++word) {
        uint bits = 0u;
        for (uint i = 0u; i < ROWS_IN_WORD; ++i) {
            bits |= (blocked[word * ROWS_IN_WORD + i] & ALL_COLUMNS) << (i * COLUMNS);
        }
        ivec2 place = word_place(tile, pixel % TILE_SIZE, word);
        if (push.step != STEP_TILES) {
            imageAtomicOr(words, place, receiver.id == 0u ? 0u : bits);
        } else {
            imageStore(words, place, uvec4(receiver.id == 0u ? 0u : bits));
        }
    }
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uvec4 task = push.step == STEP_FURTHER ? texelFetch(tasks, task_place(index), 0)
        : texelFetch(list, tile_entry_place(index, tiles), 0);
    uvec2 tile = tile_of_entry(task.x, tiles);
    uvec4 stored = texelFetch(lists, ivec2(tile), 0);
    if (stored.w == TILE_SETTLED) {
        return;
    }
    uvec2 pixel = tile * TILE_SIZE + gl_LocalInvocationID.xy;
    uvec2 step = uvec2(0u, 2u);
    uint blocked_0[ROWS];
    uint blocked_1[ROWS];
    uint blocked_2[ROWS];
    uint blocked_3[ROWS];
    MaskReceiver receiver_0 = fetch_receiver(pixel, blocked_0);
    MaskReceiver receiver_1 = fetch_receiver(pixel + step, blocked_1);
    MaskReceiver receiver_2 = fetch_receiver(pixel + 2u * step, blocked_2);
    MaskReceiver receiver_3 = fetch_receiver(pixel + 3u * step, blocked_3);

    bool in_parts = stored.y > TASK_ENTRIES || stored.z < params.counts.z;
    TriangleList found = TriangleList(stored.x, min(stored.y, TASK_ENTRIES), 0u);
    uint node = 0u;
    uint end = 0u;
    Shaft shaft;
    if (push.step == STEP_FURTHER) {
        found = TriangleList(task.y, min(stored.y - task.z, TASK_ENTRIES), 0u);
    } else if (push.step == STEP_WALK) {
        // A walk can begin at any node: what is known of those above is only that they may be met.
        found.count = 0u;
        uint first = (push.first_run + gl_WorkGroupID.z) * push.run;
        node = max(first, stored.z);
        end = min(first + push.run, params.counts.z);
        shaft = fetch_shaft(tile);
    }
    uint slot = 0u;
    while (found.count > 0u || node < end) {
        bool listed = found.count > 0u;
        uint triangle = 0u;
        bool meets = listed;
        if (listed) {
            if (slot == CHUNK) {
                found.chunk = texelFetch(pool, chunk_entry_place(found.chunk, CHUNK), 0).x;
                slot = 0u;
            }
            triangle = texelFetch(pool, chunk_entry_place(found.chunk, slot), 0).x;
            slot += 1u;
            found.count -= 1u;
        } else {
            vec4 low = fetch_node_low(node);
            if (low.w >= 0.0) {
                triangle = uint(low.w);
                meets = true;
                node += 1u;
            } else {
                node = shaft_meets_box(shaft, low.xyz, fetch_node_high(node)) ? node + 1u : uint(-low.w);
            }
        }
        if (meets) {
            Blocker blocker = fetch_blocker(triangle);
            if (listed || shaft_meets_triangle(shaft, blocker.a, blocker.b, blocker.c)) {
                add_blocker(receiver_0, blocker, blocked_0);
                add_blocker(receiver_1, blocker, blocked_1);
                add_blocker(receiver_2, blocker, blocked_2);
                add_blocker(receiver_3, blocker, blocked_3);
            }
        }
    }
    store(task.x, pixel, receiver_0, blocked_0, in_parts);
    store(task.x, pixel + step, receiver_1, blocked_1, in_parts);
    store(task.x, pixel + 2u * step, receiver_2, blocked_2, in_parts);
    store(task.x, pixel + 3u * step, receiver_3, blocked_3, in_parts);
}
