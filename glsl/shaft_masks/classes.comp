#version 460
#extension GL_EXT_control_flow_attributes : require
// What kind of tile each is, by its entries, which are those of its group that matter to it: an invocation each. Tiles
// that are lit or dark as a whole are settled here, the others listed by what their masks are made of.
//
// Where no counted edge meets the shaft, the number of triangles is the same for every surface and every sample: of any
// one segment it tells whether the tile is dark. So is a tile with another triangle between all of it and all of the
// light.

#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "shaft_masks/covers.glsl"
#include "shaft_masks/edges.glsl"
#include "shaft_masks/estimates.glsl"
#include "shaft_masks/params.glsl"

layout(local_size_x = PARTS_A_GROUP) in;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 2, rgba32f) uniform readonly image2D triangles;
layout(set = 0, binding = 3, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 4) uniform usampler2D list;
layout(set = 0, binding = 5, rgba32f) uniform readonly image2D shafts;
layout(set = 0, binding = 6, r32ui) uniform writeonly uimage2D edge_pool;
layout(set = 0, binding = 7, rgba32ui) uniform writeonly uimage2D lists;
layout(set = 0, binding = 8, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 9, r32f) uniform readonly image2D view_depth;
layout(set = 0, binding = 10, r32ui) uniform writeonly uimage2D estimates;
layout(set = 0, binding = 11, std430) buffer TaskArguments {
    TileArguments further;
};
// Tile, number of the first triangle.
layout(set = 0, binding = 12, rgba32ui) uniform writeonly uimage2D tasks;
layout(set = 0, binding = 13, std430) buffer PartialArguments {
    TileArguments partial;
};
layout(set = 0, binding = 14, r32ui) uniform writeonly uimage2D partial_list;
// Those that masks are made of.
layout(set = 0, binding = 15, std430) buffer OpenArguments {
    TileArguments open_tiles;
};
layout(set = 0, binding = 16, r32ui) uniform writeonly uimage2D open_list;
// Those whose masks are made in pieces, and these pieces.
layout(set = 0, binding = 17, std430) buffer PiecesArguments {
    TileArguments pieces;
    TileArguments blocks_of_pieces;
};
layout(set = 0, binding = 18, r32ui) uniform writeonly uimage2D pieces_list;
// The others, plain ones from the begin of their list and the rest from its end.
layout(set = 0, binding = 19, std430) buffer PlainArguments {
    TileArguments plain;
};
layout(set = 0, binding = 20, std430) buffer OtherArguments {
    TileArguments others_than_plain;
};
layout(set = 0, binding = 21, r32ui) uniform writeonly uimage2D sorted_list;
layout(set = 0, binding = 22, r32ui) uniform writeonly uimage2D triangle_pool;
// Of groups: which part leads that of each part (not as a storage image, of which some devices take 16), how many there
// are, and what lists and entries they have.
layout(set = 0, binding = 23) uniform usampler2D leaders;
layout(set = 0, binding = 24, std140) uniform GroupArguments {
    TileArguments groups;
};
layout(set = 0, binding = 25, rgba32ui) uniform readonly uimage2D group_lists;
layout(set = 0, binding = 26, r32ui) uniform readonly uimage2D group_edges;
layout(set = 0, binding = 27, r32ui) uniform readonly uimage2D group_triangles;

#define SUN_TANGENT_SQUARE (view.light.axis_x.w * view.light.axis_x.w)

#include "shaft_masks/masks.glsl"

vec4 fetch_triangle_texel(uint texel) {
    return imageLoad(triangles, triangle_texel_place(texel));
}

vec4 fetch_shaft_texel(ivec2 place) {
    return imageLoad(shafts, place);
}

// Nothing is fetched from these here.
vec4 fetch_node_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_material_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_uv_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_footprint(ivec2 place) {
    return vec4(0.0);
}

// What an edge from a to b adds to the number of triangles between a receiver and the middle of the light.
int edge_rounds(Axes axes, Projection projection, uint code, vec3 from, vec3 to) {
    vec2 a = project(projection, along_axes(axes, from));
    vec2 b = project(projection, along_axes(axes, to));
    Side side = side_between(a, b);
    bool before = side.low.y <= 0.0 && 0.0 < side.high && side.low.x - side.low.y * side.slope < 0.0;
    bool ends = (a.y < b.y) == (((code & EDGE_TURNED) != 0u) == projection.turned);
    int step = (code & EDGE_DOUBLE) != 0u ? 2 : 1;
    return before ? (ends ? -step : step) : 0;
}

// Triangles drawn one by one of a tile with more of which walks of its pixels (pixels.comp) take less time, for these see
// far fewer. In finer meshes walks take longer.
uint most_drawn() {
    return clamp(params.counts.z / 512u, 512u, 4096u);
}

// Whether any of a tile's first covers is between all surfaces and all of the light: sides of its edges are bilinear in
// the two ends of a segment, so corners decide.
bool is_covered(Surfaces surfaces, mat3 frame, ivec2 at, uint count) {
    vec3 light_half = light_half_size(view.light);
    uint ends = 8u * min(count, MOST_COVERS);
    uint look = 0u;
    bool covered = false;
    while (look < ends && !covered) {
        uint cover = look / 8u;
        Triangle t = fetch_triangle(imageLoad(group_lists, at + ivec2(4u + cover / 4u, 0))[cover % 4u]);
        vec3 p = surfaces_corner(surfaces, look & 7u);
        bool hidden = sees_through(p, view.light, frame, light_half, t, cover_margin_m(surfaces, view.light, t));
        covered = hidden && (look & 7u) == 7u;
        look = hidden ? look + 1u : 8u * (cover + 1u);
    }
    return covered;
}

void main() {
    uint index = spread_entry(gl_WorkGroupID.x, gl_NumWorkGroups.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 size = params.counts.xy;
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 part = part_of_entry(entry, tiles);
    uvec2 tile = tile_of_part(part, tiles);
    uint leading = texelFetch(leaders, ivec2(part), 0).x;
    ivec2 at = list_place(part_of_entry(leading, tiles));
    uvec4 candidates = imageLoad(group_lists, at);
    uvec4 first = imageLoad(group_lists, at + ivec2(1, 0));
    uvec4 second = imageLoad(group_lists, at + ivec2(2, 0));
    uvec4 third = imageLoad(group_lists, at + ivec2(3, 0));
    uint nodes = params.counts.z;
    Shaft shaft = fetch_shaft(part);
    Surfaces surfaces = fetch_surfaces(part, view.light);
    vec3 some = fetch_some_surface(part);
    mat3 frame = light_frame(view.light, some);
    bool all_above = shaft.low.w > 0.0;

    // A list that ends early is not used: an edge between a triangle in the list and one that found no room in it
    // counts for neither. Without room for its edges a tile is looked at as if nothing was known of it.
    bool fits = candidates.z == nodes && third.x <= MOST_COUNT && first.y <= params.pattern.z / groups.count;
    // All tiles have the same room, so that it is not by their order which of them have some.
    uint edge_room = params.pattern.z / arguments.count;
    uint first_edge = index * edge_room;
    bool one_axis = rows_have_one_axis(view.light, surfaces);
    Axes axes = axes_from(some, false);
    Projection projection = projection_from(axes, some);
    uint edges = 0u;
    bool any_meets = false;
    int rounds = 0;
    uint group_end = fits ? first.y : 0u;
    uint i = 0u;
    do {
        uint code = imageLoad(group_edges, triangle_texel_place(first.x + i)).x;
        uint triangle = (code & ~(EDGE_DOUBLE | EDGE_TURNED)) >> EDGE_CORNER_BITS;
        uint corner = code & ((1u << EDGE_CORNER_BITS) - 1u);
        vec3 a = fetch_triangle_texel(4u * triangle + corner).xyz;
        vec3 b = fetch_triangle_texel(4u * triangle + (corner == 2u ? 0u : corner + 1u)).xyz;
        bool meets;
        if (i < group_end && !edge_is_beyond(shaft, one_axis, a, b, meets)) {
            if (edges < edge_room) {
                imageStore(edge_pool, triangle_texel_place(first_edge + edges), uvec4(code));
            }
            edges += 1u;
            any_meets = any_meets || meets;
            rounds += edge_rounds(axes, projection, code, a, b);
        }
        i += 1u;
    } while (i < group_end);
    fits = fits && edges <= edge_room;

    // Triangles that are drawn, in the same order: whole ones from the begin of the tile's room, others from its end.
    uint room = params.counts.w * CHUNK / arguments.count;
    uint first_triangle = index * room;
    uint whole = 0u;
    uint others = 0u;
    group_end = fits ? second.x + second.y : 0u;
    i = 0u;
    do {
        uint place = i < second.x ? first.z + i : first.z + first.w - 1u - (i - second.x);
        uint triangle = i < group_end ? imageLoad(group_triangles, triangle_texel_place(place)).x : 0u;
        Triangle t = fetch_triangle(triangle);
        if (i < group_end && shaft_meets_triangle(shaft, t.corners[0], t.corners[1], t.corners[2])) {
            if (whole + others < room) {
                uint at_triangle = first_triangle + (i < second.x ? whole : room - 1u - others);
                imageStore(triangle_pool, triangle_texel_place(at_triangle), uvec4(triangle));
            }
            whole += i < second.x ? 1u : 0u;
            others += i < second.x ? 0u : 1u;
        }
        i += 1u;
    } while (i < group_end);

    // Told of the segment to the middle of the light, which has to be one that counts: not below the surface's plane.
    bool same = fits && !any_meets && all_above;
    bool dark = (same && rounds != 0) || is_covered(surfaces, frame, at, third.y);
    edges = !fits || same ? 0u : edges;
    whole = fits ? whole : 0u;
    others = fits ? others : 0u;
    bool lit = fits && !dark && edges + whole + others == 0u && all_above;
    bool settled = dark || lit;
    uint resume = fits ? nodes : 0u;
    bool is_walked = whole + others > min(most_drawn(), room);
    vec2 depths = fetch_part_depths(part);
    for (uint i = 0u; i < TILE_SIZE * TILE_SIZE && dark; ++i) { // all is lit at the beginning
        // Stores beyond the picture's border are dropped.
        uvec2 pixel = tile * TILE_SIZE + uvec2(i % TILE_SIZE, i / TILE_SIZE);
        float depth = imageLoad(view_depth, ivec2(min(pixel, size - 1u))).x;
        if (is_in_part(depths, depth) && depth > 0.0) {
            imageStore(visibility, ivec2(pixel), vec4(0.0));
        }
    }
    for (uint i = TASK_ENTRIES; i < whole + others && !settled && !is_walked; i += TASK_ENTRIES) {
        uint task = atomicAdd(further.count, 1u);
        atomicMax(further.groups_x, min(task + 1u, TILE_ROW));
        atomicMax(further.groups_y, task / TILE_ROW + 1u);
        imageStore(tasks, task_place(task), uvec4(entry, i, 0u, 0u));
    }
    uint state = settled ? TILE_SETTLED : is_walked ? TILE_WALKED : TILE_OPEN;
    ivec2 own = list_place(part);
    imageStore(lists, own, uvec4(0u, 0u, resume, state));
    imageStore(lists, own + ivec2(1, 0), uvec4(first_edge, edges, first_triangle, room));
    imageStore(lists, own + ivec2(2, 0), uvec4(whole, others, tile.y * tiles.x + tile.x, 0u));
    uint work = edges + whole + others + (nodes - resume);
    uint level = dark ? LEVEL_DARK : lit ? LEVEL_LIT : params.pattern.w;
    imageStore(estimates, estimate_place(part, ESTIMATE_WORK), uvec4(work));
    imageStore(estimates, estimate_place(part, ESTIMATE_LEVEL), uvec4(level));
    bool partly = resume < nodes || is_walked;
    bool in_pieces = params.pattern.y > 1u || whole + others > TASK_ENTRIES || partly;
    bool is_plain = others == 0u && all_above;
    if (!settled) {
        uint slot = atomicAdd(open_tiles.count, 1u);
        atomicMax(open_tiles.groups_x, min(slot + 1u, TILE_ROW));
        atomicMax(open_tiles.groups_y, slot / TILE_ROW + 1u);
        imageStore(open_list, tile_entry_place(slot, tiles), uvec4(entry));
    }
    if (!settled && in_pieces) {
        uint slot = atomicAdd(pieces.count, 1u);
        atomicMax(pieces.groups_x, min(slot + 1u, TILE_ROW));
        atomicMax(blocks_of_pieces.groups_x, min(slot + 1u, TILE_ROW));
        atomicMax(pieces.groups_y, slot / TILE_ROW + 1u);
        atomicMax(blocks_of_pieces.groups_y, slot / TILE_ROW + 1u);
        imageStore(pieces_list, tile_entry_place(slot, tiles), uvec4(entry));
    }
    if (!settled && !in_pieces && is_plain) {
        uint slot = atomicAdd(plain.count, 1u);
        atomicMax(plain.groups_x, min(slot + 1u, TILE_ROW));
        atomicMax(plain.groups_y, slot / TILE_ROW + 1u);
        imageStore(sorted_list, tile_entry_place(slot, tiles), uvec4(entry));
    }
    if (!settled && !in_pieces && !is_plain) {
        uint slot = atomicAdd(others_than_plain.count, 1u);
        atomicMax(others_than_plain.groups_x, min(slot + 1u, TILE_ROW));
        atomicMax(others_than_plain.groups_y, slot / TILE_ROW + 1u);
        imageStore(sorted_list, place_from_end(slot, tiles), uvec4(entry));
    }
    if (!settled && partly) {
        uint slot = atomicAdd(partial.count, 1u);
        atomicMax(partial.groups_x, min(slot + 1u, TILE_ROW));
        atomicMax(partial.groups_y, slot / TILE_ROW + 1u);
        imageStore(partial_list, tile_entry_place(slot, tiles), uvec4(entry));
    }
}
