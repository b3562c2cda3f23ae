#version 460
#extension GL_EXT_control_flow_attributes : require
// Masks of the listed tiles, or of tasks on the rest of long lists: a workgroup each, and of each block of samples.
// Four pixels an invocation, so that each fetch of an edge or a triangle serves four.

#include "common/camera.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "shaft_masks/params.glsl"

layout(local_size_x = 8, local_size_y = 2) in;

// 1 where tiles are listed from the end of their image on.
layout(constant_id = 5) const uint FROM_END = 0u;
// 1 where masks are made in pieces, which words in memory bring together. Others go straight to visibility: a driver
// without branches goes through stores that are not made.
layout(constant_id = 7) const uint WORDS = 0u;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 2, r32f) uniform readonly image2D view_depth;
layout(set = 0, binding = 3, r32ui) uniform readonly uimage2D ids;
layout(set = 0, binding = 4, rgba32f) uniform readonly image2D triangles;
layout(set = 0, binding = 5, rgba32f) uniform readonly image2D materials;
layout(set = 0, binding = 6, rgba32f) uniform readonly image2D uvs;
layout(set = 0, binding = 7, rgba8) uniform readonly image2D footprints;
layout(set = 0, binding = 8, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 9) uniform usampler2D list;
layout(set = 0, binding = 10, rgba32f) uniform readonly image2D shafts;
layout(set = 0, binding = 11, r32ui) uniform readonly uimage2D edge_pool;
layout(set = 0, binding = 12, rgba32ui) uniform readonly uimage2D lists;
layout(set = 0, binding = 13, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 14, rgba32ui) uniform readonly uimage2D tasks;
layout(set = 0, binding = 15, r32ui) uniform uimage2D words;
layout(set = 0, binding = 16, r32ui) uniform readonly uimage2D triangle_pool;
layout(set = 0, binding = 17, r32ui) uniform uimage2D estimates;

// Receivers whose numbers of triangles have no room in digits: of an invocation each its task.
layout(set = 0, binding = 18, std430) buffer SpilledArguments {
    TileArguments spilled;
};
layout(set = 0, binding = 19, r32ui) uniform uimage2D spilled_tasks;
// 1 where these are worked on, an invocation each.
layout(constant_id = 6) const uint SPILLED = 0u;
const uint INVOCATIONS = 16u;

layout(push_constant) uniform Push {
    uint further; // 1 for the rest of long lists
} push;

#define SUN_TANGENT_SQUARE (view.light.axis_x.w * view.light.axis_x.w)

#include "shaft_masks/estimates.glsl"
#include "shaft_masks/lists.glsl"
#include "shaft_masks/masks.glsl"

vec4 fetch_triangle_texel(uint texel) {
    return imageLoad(triangles, triangle_texel_place(texel));
}

// No node is looked at here.
vec4 fetch_node_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_shaft_texel(ivec2 place) {
    return imageLoad(shafts, place);
}

vec4 fetch_material_texel(ivec2 place) {
    return imageLoad(materials, place);
}

vec4 fetch_uv_texel(ivec2 place) {
    return imageLoad(uvs, place);
}

vec4 fetch_footprint(ivec2 place) {
    return imageLoad(footprints, place);
}

// A receiver, and what its own plane hides.
MaskReceiver fetch_receiver(uvec2 pixel, vec2 depths, out uvec2 blocked) {
    uvec2 within = min(pixel, params.counts.xy - 1u);
    float depth = imageLoad(view_depth, ivec2(within)).x;
    vec3 ray = pixel_ray(view.camera, within);
    MaskReceiver receiver;
    receiver.in_part = is_in_part(depths, depth);
    receiver.id = depth > 0.0 ? imageLoad(ids, ivec2(within)).x : 0u;
    receiver.position = view.camera.eye.xyz + depth * ray;
    receiver.position += way_into_triangle(receiver.position, receiver.id);
    blocked = uvec2(0u);
    if (PLAIN == 0u) {
        vec3 normal = fetch_geometric_normal(max(receiver.id, 1u) - 1u);
        normal = dot(normal, ray) > 0.0 ? -normal : normal;
        blocked = own_mask(rows_from(view.light, receiver.position), normal);
    }
    return receiver;
}

// Stores what a receiver sees; returns its part of its tile's ESTIMATE_CHANGES.
uint store(uint slot, uint block, uvec2 pixel, MaskReceiver receiver, uvec2 blocked, bool in_pieces) {
    if (!receiver.in_part) {
        return 0u;
    }
    blocked = receiver.id == 0u ? uvec2(0u) : blocked;
    if (!in_pieces) {
        // Stores beyond the picture's border are dropped.
        int hidden = bitCount(blocked.x) + bitCount(blocked.y);
        float samples = float(ROWS * COLUMNS);
        imageStore(visibility, ivec2(pixel), vec4((samples - float(hidden)) / samples));
        return all(lessThan(pixel, params.counts.xy)) ? changed_pixel(changes_in(blocked, LIGHT_SHAPE == LIGHT_LINE)) : 0u;
    }
    for (uint word = 0u; word < 2u && WORDS != 0u; ++word) {
        ivec2 place = word_place(slot, pixel % TILE_SIZE, params.pattern.y, 2u * block + word);
        if (push.further != 0u) {
            imageAtomicOr(words, place, blocked[word]);
        } else {
            imageStore(words, place, uvec4(blocked[word]));
        }
    }
    return 0u; // all of them are known later
}

vec3 fetch_edge_begin(uint code) {
    uint triangle = (code & ~(EDGE_DOUBLE | EDGE_TURNED)) >> EDGE_CORNER_BITS;
    return fetch_triangle_texel(4u * triangle + (code & ((1u << EDGE_CORNER_BITS) - 1u))).xyz;
}

vec3 fetch_edge_end(uint code) {
    uint triangle = (code & ~(EDGE_DOUBLE | EDGE_TURNED)) >> EDGE_CORNER_BITS;
    uint corner = code & ((1u << EDGE_CORNER_BITS) - 1u);
    return fetch_triangle_texel(4u * triangle + (corner == 2u ? 0u : corner + 1u)).xyz;
}

// One of a tile's triangles by its number among all that are drawn, after the whole ones.
Blocker fetch_other(Entries entries, uint number) {
    uint place = entries.first + entries.room - 1u - (number - entries.whole);
    return fetch_blocker(imageLoad(triangle_pool, triangle_texel_place(place)).x);
}

// Sets the bits of the samples that a triangle hides from four receivers.
void add_blocker(MaskReceiver receivers[4], LightFrom lights[4], uint block, Blocker blocker, inout uvec2 blocked[4]) {
    Hidden hidden[4];
    [[unroll]] for (uint i = 0u; i < 4u; ++i) {
        hidden[i] = hidden_by(receivers[i], lights[i], blocker);
    }
    if (MASKED != 0u && material_is_masked(blocker.plane.w)) {
        cut_holes(blocker, block, blocked, hidden);
    }
    [[unroll]] for (uint i = 0u; i < 4u; ++i) {
        blocked[i] |= hidden[i].within;
    }
}

// What counted triangles hide where digits have no room for their number.
uvec2 counted_again(vec3 position, uint first, uint edges) {
    Axes axes = axes_from(position, true);
    Projection projection = projection_from(axes, position);
    uint halves[HALVES * ROWS];
    for (uint i = 0u; i < HALVES * ROWS; ++i) {
        halves[i] = NO_HALVES;
    }
    for (uint i = 0u; i < edges; ++i) {
        uint code = imageLoad(edge_pool, triangle_texel_place(first + i)).x;
        vec3 a = along_axes(axes, fetch_edge_begin(code));
        vec3 b = along_axes(axes, fetch_edge_end(code));
        count_edge_in_halves(projection, a, b, code, halves);
    }
    return counted_mask_of_halves(halves);
}

void list_spilled(uint entry, uint block) {
    uint at = atomicAdd(spilled.count, 1u);
    uint group = at / INVOCATIONS;
    atomicMax(spilled.groups_x, min(group + 1u, TILE_ROW));
    atomicMax(spilled.groups_y, group / TILE_ROW + 1u);
    uint task = (entry * MOST_BLOCKS + block) * INVOCATIONS + gl_LocalInvocationIndex;
    imageStore(spilled_tasks, task_place(at), uvec4(task));
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    uint own_task = 0u;
    if (SPILLED != 0u) {
        index = index * INVOCATIONS + gl_LocalInvocationIndex;
        if (index >= arguments.count) {
            return;
        }
        own_task = imageLoad(spilled_tasks, task_place(index)).x;
    } else {
        if (index >= arguments.count) {
            return;
        }
        index = spread_entry(index, arguments.count);
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uvec4 task = push.further != 0u ? imageLoad(tasks, task_place(index))
        : texelFetch(list, FROM_END != 0u ? place_from_end(index, tiles) : tile_entry_place(index, tiles), 0);
    uint entry = SPILLED != 0u ? own_task / (MOST_BLOCKS * INVOCATIONS) : task.x;
    uvec2 part = part_of_entry(entry, tiles);
    uvec2 tile = tile_of_part(part, tiles);
    vec2 depths = fetch_part_depths(part);
    ivec2 at = list_place(part);
    uvec4 stored = imageLoad(lists, at);
    if (stored.w == TILE_SETTLED) {
        return;
    }
    Entries entries = entries_of(imageLoad(lists, at + ivec2(1, 0)), imageLoad(lists, at + ivec2(2, 0)));
    uint block = SPILLED != 0u ? own_task / INVOCATIONS % MOST_BLOCKS : gl_WorkGroupID.z;
    uint invocation = SPILLED != 0u ? own_task % INVOCATIONS : gl_LocalInvocationIndex;
    fetch_light_rows(block);

    uvec2 pixels[4];
    MaskReceiver receivers[4];
    uvec2 blocked[4];
    [[unroll]] for (uint i = 0u; i < 4u; ++i) {
        pixels[i] = tile * TILE_SIZE + uvec2(invocation % TILE_SIZE, invocation / TILE_SIZE + 2u * i);
        receivers[i] = fetch_receiver(pixels[i], depths, blocked[i]);
    }
    bool in_pieces = params.pattern.y > 1u || entries.whole + entries.others > TASK_ENTRIES
        || stored.z < params.counts.z || stored.w == TILE_WALKED;
    in_pieces = WORDS != 0u && in_pieces;

    bool is_spilled = false;
    Axes axes = axes_from(receivers[0].position, true);
    Projection from[4];
    uint digits[4][ROWS];
    int sums[4];
    [[unroll]] for (uint i = 0u; i < 4u; ++i) {
        from[i] = projection_from(axes, receivers[i].position);
        sums[i] = 0;
        for (uint r = 0u; r < ROWS; ++r) {
            digits[i][r] = NO_DIGITS;
        }
    }
    bool is_walked = stored.w == TILE_WALKED;
    uint edges = push.further != 0u || is_walked ? 0u : entries.edges;
    uint at_edge = 0u;
    // Loops look at their end whether they go on: a driver without branches does one more turn of others, for
    // nothing.
    do {
        if (at_edge < edges && SPILLED == 0u) {
            uint code = imageLoad(edge_pool, triangle_texel_place(entries.first_edge + at_edge)).x;
            vec3 a = along_axes(axes, fetch_edge_begin(code));
            vec3 b = along_axes(axes, fetch_edge_end(code));
            [[unroll]] for (uint i = 0u; i < 4u; ++i) {
                count_edge(from[i], a, b, code, digits[i], sums[i]);
            }
        }
        at_edge += 1u;
    } while (at_edge < edges);
    [[unroll]] for (uint i = 0u; i < 4u && SPILLED == 0u; ++i) {
        bool fits;
        blocked[i] |= counted_mask(digits[i], sums[i], fits);
        is_spilled = is_spilled || !fits;
    }
    // One receiver after the other.
    for (uint at = 0u; at < 4u && SPILLED != 0u; ++at) {
        vec3 position = receivers[0].position;
        [[unroll]] for (uint i = 1u; i < 4u; ++i) {
            position = i == at ? receivers[i].position : position;
        }
        uvec2 mask = counted_again(position, entries.first_edge, edges);
        [[unroll]] for (uint i = 0u; i < 4u; ++i) {
            blocked[i] |= i == at ? mask : uvec2(0u);
        }
    }
    uint first = push.further != 0u ? task.y : 0u;
    uint end = is_walked ? 0u : min(first + TASK_ENTRIES, entries.whole);
    uint at_whole = first;
    do {
        if (at_whole < end) {
            uint triangle = imageLoad(triangle_pool, triangle_texel_place(entries.first + at_whole)).x;
            vec3 a = along_axes(axes, fetch_triangle_texel(4u * triangle).xyz);
            vec3 b = along_axes(axes, fetch_triangle_texel(4u * triangle + 1u).xyz);
            vec3 c = along_axes(axes, fetch_triangle_texel(4u * triangle + 2u).xyz);
            [[unroll]] for (uint i = 0u; i < 4u; ++i) {
                add_whole(from[i], a, b, c, blocked[i]);
            }
        }
        at_whole += 1u;
    } while (at_whole < end);
    if (PLAIN == 0u) {
        end = is_walked ? 0u : min(first + TASK_ENTRIES, entries.whole + entries.others);
        LightFrom lights[4];
        [[unroll]] for (uint i = 0u; i < 4u; ++i) {
            lights[i] = rows_from(view.light, receivers[i].position);
        }
        uint begin = max(first, entries.whole);
        // Masks of a line or a point take no longer than to find out whether there is anything in them.
        bool at_once = LIGHT_SHAPE == LIGHT_LINE || LIGHT_SHAPE == LIGHT_POINT;
        if (at_once) {
            do {
                if (begin < end) {
                    add_blocker(receivers, lights, block, fetch_other(entries, begin), blocked);
                }
                begin += 1u;
            } while (begin < end);
        } else {
            do {
                // Of a run of triangles those that may hide anything from any of the invocation's receivers, half of them
                // and less: to find that out takes a quarter of the time that it takes to find what.
                uint run = end > begin ? min(end - begin, 32u) : 0u;
                uint wanted = 0u;
                uint at_other = 0u;
                do {
                    Blocker blocker = fetch_other(entries, begin + at_other);
                    bool any_meets = false;
                    [[unroll]] for (uint i = 0u; i < 4u; ++i) {
                        any_meets = any_meets || outline_of(receivers[i], lights[i], blocker).meets;
                    }
                    wanted |= any_meets && at_other < run ? 1u << at_other : 0u;
                    at_other += 1u;
                } while (at_other < run);
                while (wanted != 0u) {
                    Blocker blocker = fetch_other(entries, begin + uint(findLSB(wanted)));
                    wanted &= wanted - 1u;
                    add_blocker(receivers, lights, block, blocker, blocked);
                }
                begin += 32u;
            } while (begin < end);
        }
    }
    if (SPILLED == 0u && is_spilled) {
        list_spilled(entry, block);
        return;
    }
    uint changes = 0u;
    [[unroll]] for (uint i = 0u; i < 4u; ++i) {
        changes += store(entries.slot, block, pixels[i], receivers[i], blocked[i], in_pieces);
    }
    if (changes > 0u) {
        imageAtomicAdd(estimates, estimate_place(part, ESTIMATE_CHANGES), changes);
    }
}
