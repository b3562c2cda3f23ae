#version 460
// Walks the hierarchy with the shaft of each group of tiles, to the end, and lists its candidates: the triangles whose
// boxes the shaft meets, but for those that lie in it together with their neighbours and show one side to all of the
// group's surfaces, whose edges all cancel. Where there are many they are small, so that each tile of the group has its
// own: then each becomes a group by itself, which another dispatch lists.

#include "common/tiles.glsl"
#include "common/view_params.glsl"
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
layout(set = 0, binding = 5, rgba32f) uniform image2D shafts;
layout(set = 0, binding = 6, rgba32f) uniform readonly image2D triangles;
layout(set = 0, binding = 7, std430) buffer ListedArguments {
    TileArguments listed; // a workgroup each
};
layout(set = 0, binding = 8, r32ui) uniform writeonly uimage2D listed_groups;
layout(set = 0, binding = 9, std430) buffer Pool {
    uint chunks_used;
};
layout(set = 0, binding = 10, rgba32ui) uniform writeonly uimage2D pool;
layout(set = 0, binding = 11, rgba32ui) uniform writeonly uimage2D lists;
// Tiles that become groups.
layout(set = 0, binding = 12, std430) buffer SingleArguments {
    TileArguments singles; // an invocation each
};
layout(set = 0, binding = 13, r32ui) uniform writeonly uimage2D single_list;
layout(set = 0, binding = 14, r32ui) uniform writeonly uimage2D leaders;
layout(set = 0, binding = 15, rgba32f) uniform readonly image2D part_shafts;

// A software driver may end loops after 65,535 turns of all lanes of a vector together: a walk ends
// itself before, and the group's tiles are walked anew in pieces.
const uint MOST_STEPS = 49152u; // of two nodes each

vec4 fetch_triangle_texel(uint texel) {
    return imageLoad(triangles, triangle_texel_place(texel));
}

vec4 fetch_node_texel(ivec2 place) {
    return imageLoad(hierarchy, place);
}

vec4 fetch_shaft_texel(ivec2 place) {
    return imageLoad(shafts, place);
}

// 1 where all lists are made again, each with the same room: overflow.comp.
layout(constant_id = 1) const uint AGAIN = 0u;
// 1 where groups may be taken apart.
layout(constant_id = 2) const uint MAY_SPLIT = 0u;

// Fewest candidates that a group is taken apart for.
const uint MOST_SHARED = 512u;

// Where a group's list goes on.
struct List {
    uint first; // its first chunk
    uint chunk; // its last one
    uint count;
    bool complete;
};

// Puts a chunk into the list, of whose triangles so many count: all but in the last one.
void list_chunk(inout List list, uint triangles[CHUNK], uint count) {
    list.complete = AGAIN == 0u || list.count < CHUNK * (params.counts.w / arguments.count);
    uint fresh = list.complete ? atomicAdd(chunks_used, 1u) : 0u;
    list.complete = list.complete && fresh < params.counts.w;
    if (list.complete) {
        for (uint i = 0u; i < CHUNK; i += 4u) {
            uvec4 four = uvec4(triangles[i], triangles[i + 1u], triangles[i + 2u], triangles[i + 3u]);
            imageStore(pool, chunk_place(fresh, i), four);
        }
        if (list.count > 0u) {
            imageStore(pool, chunk_place(list.chunk, CHUNK), uvec4(fresh));
        }
        list.first = list.count == 0u ? fresh : list.first;
        list.count += count;
        list.chunk = fresh;
    }
}

void main() {
    uint index = spread_entry(gl_WorkGroupID.x, gl_NumWorkGroups.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 part = part_of_entry(entry, tiles);
    Shaft shaft = fetch_shaft(part);
    Surfaces surfaces = fetch_surfaces(part, view.light);

    uint nodes = params.counts.z;
    List found = List(0u, 0u, 0u, true);
    // Triangles wait here until there is a chunk of them. Invocations of a vector wait for each other then, so that the
    // fewer stops a walk makes the better.
    uint waiting[CHUNK];
    for (uint i = 0u; i < CHUNK; ++i) {
        waiting[i] = 0u;
    }
    uint count = 0u;
    uint node = 0u;
    uint steps = 0u;
    bool more = true;
    // Counts of all candidates, with room or without it, so that it is not by the order of groups which are taken apart.
    bool may_split = MAY_SPLIT != 0u && shaft.high.w > 0.0;
    bool splits = false;
    uint listed_count = 0u;
    while (more) {
        if (count == CHUNK) {
            list_chunk(found, waiting, count);
            listed_count += count;
            count = 0u;
            splits = may_split && listed_count >= MOST_SHARED;
        }
        while (node < nodes && count < CHUNK && steps < MOST_STEPS && !splits) {
            // Every other node is looked at less closely: where edges cancel below it, its children tell.
            Step before = short_step_at(shaft, node);
            bool goes_on = before.next < nodes && count < CHUNK - 1u;
            waiting[count] = before.triangle; // counts if the next line says so
            count += goes_on && before.is_met ? 1u : 0u;
            node = goes_on ? before.next : node;
            Step step = step_at(shaft, surfaces, node);
            node = step.next;
            waiting[count] = step.triangle;
            count += step.is_met ? 1u : 0u;
            steps += 1u;
        }
        bool may_go_on = node < nodes && steps < MOST_STEPS;
        found.complete = found.complete && (node >= nodes || may_go_on);
        more = may_go_on && !splits && (found.complete || may_split);
    }

    // A driver may end the loops above by itself, too.
    found.complete = found.complete && node >= nodes;
    if (count > 0u && found.complete) {
        list_chunk(found, waiting, count);
    }
    if (!splits) {
        uint resume = found.complete ? nodes : 0u;
        imageStore(lists, list_place(part), uvec4(found.first, found.count, resume, TILE_OPEN));
    }
    if (!splits && AGAIN == 0u) {
        uint at = atomicAdd(listed.count, 1u);
        atomicMax(listed.groups_x, min(at + 1u, TILE_ROW));
        atomicMax(listed.groups_y, at / TILE_ROW + 1u);
        imageStore(listed_groups, tile_entry_place(at, tiles), uvec4(entry));
    }
    // A texel of a member's shaft after the other.
    uint copies = splits ? CELL.x * CELL.y * SHAFT_TEXELS : 0u;
    uint copy = 0u;
    do {
        uint member = copy / SHAFT_TEXELS;
        uint texel = copy % SHAFT_TEXELS;
        if (copy < copies && (uint(shaft.high.w) >> member & 1u) != 0u) {
            uvec2 single = part_of_member(tile_of_part(part, tiles) / CELL, member, part.y / tiles.y, tiles);
            ivec2 place = ivec2(single.x * SHAFT_TEXELS + texel, single.y);
            imageStore(shafts, place, imageLoad(part_shafts, place));
            if (texel == 0u) {
                uint alone = single.y * tiles.x + single.x;
                uint at = atomicAdd(singles.count, 1u);
                atomicMax(singles.groups_x, at / PARTS_A_GROUP + 1u);
                imageStore(single_list, tile_entry_place(at, tiles), uvec4(alone));
                imageStore(leaders, ivec2(single), uvec4(alone));
            }
        }
        copy += 1u;
    } while (copy < copies);
}
