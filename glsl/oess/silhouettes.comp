#version 460
// Visibility of a line light from occluding edges of the mesh, instead of those of pixels (the future work
// of Reimann and Dreier).
//
// A receiver and the line span a plane, in which a direction to a place of the line meets a number of
// surfaces on its way. Along the line this number changes only where the plane cuts an edge that is a
// silhouette from the receiver: by the faces that are more on one side of it than on the other. So the
// changes at the edges of the receiver's tile give the number everywhere but for a constant, and the line
// is seen where it is 0. The constant is known where the line's centre is seen; else a ray to where the
// least surfaces are tells whether these are none.
//
// Points of the plane have homogeneous coordinates: with L + t E the line and d a point from the receiver,
// d = w (L + t E). w is 1 on the line, and u = w t. Whether an edge is cut is a matter of the sides of the plane
// that its ends are on (turns.glsl).

#include "common/light.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "dbuffer/entries.glsl"
#include "dbuffer/params.glsl"
#include "dbuffer/through.glsl"
#include "oess/params.glsl"
#include "oess/profile.glsl"
#include "oess/turns.glsl"
#include "silhouettes/sides.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std140) uniform View {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform Block {
    DbufferParams params;
};
layout(set = 0, binding = 2, std140) uniform LineBlock {
    vec4 start; // xyz: the line's first point, scene space; w: its length, metres
    vec4 axis;  // xyz: unit vector along the line; w: cells of its profile, 0 for an even light
    vec4 profile[MAX_PROFILE]; // oess/params.glsl
} line;
layout(set = 0, binding = 3) uniform sampler2D view_depth;
layout(set = 0, binding = 4) uniform usampler2D ids;
layout(set = 0, binding = 5) uniform sampler2D triangles;
layout(set = 0, binding = 6) uniform sampler2D hierarchy;
layout(set = 0, binding = 7) uniform usampler2D edges;
layout(set = 0, binding = 8) uniform sampler2D points;
layout(set = 0, binding = 9) uniform usampler2D numbers;
// Storage images: software drivers read them faster than textures.
layout(set = 0, binding = 10, rgba32f) uniform readonly image2D ends;
layout(set = 0, binding = 11, r32ui) uniform readonly uimage2D pool;
layout(set = 0, binding = 12, rgba32f) uniform readonly image2D chunk_boxes;
layout(set = 0, binding = 13) uniform usampler2D lists;
layout(set = 0, binding = 14) uniform sampler2D hard;
layout(set = 0, binding = 15, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 16, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 17) uniform usampler2D list;
layout(set = 0, binding = 18, std140) uniform ThroughBlock {
    Through through;
};

layout(set = 0, binding = 19, rgba32f) uniform readonly image2D turns;

#include "dbuffer/ray.glsl"

// Cells of the line above the receiver's plane. One edge within a cell lies exactly where it is, and so do two; of
// more, what they have in common counts.
const uint CELLS = 32u;

// What positions are rounded by, as a part of the largest coordinate that they are made from.
const float POSITION_ROUNDING = 1.0 / 2097152.0;

// Rays that a receiver may send to tell how many surfaces there are: a count that rounding has taken an edge
// from is not the last word.
const uint MOST_RAYS = 3u;

// Part of the line within which an edge may hide the centre or not by rounding.
const float NEAR = 1.0 / 4096.0;

// Part of a cell that is too narrow to tell by whether a place of it has fewer surfaces: edges that lie on each other,
// as those of a triangle without area do, may part by rounding.
const float NARROW = float(CELLS) * NEAR;

// Square of the sine of the angle at the line's axis within which a receiver sees the line as a point.
const float ON_AXIS = 1.0e-10;

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

vec4 fetch_node_texel(ivec2 place) {
    return texelFetch(hierarchy, place, 0);
}

// Scenes with holes in their triangles do not come here.
vec4 fetch_material_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_uv_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_texture_texel(ivec2 place) {
    return vec4(0.0);
}

uvec4 fetch_edge_texel(ivec2 place) {
    return texelFetch(edges, place, 0);
}

vec4 fetch_point_texel(ivec2 place) {
    return texelFetch(points, place, 0);
}

uint fetch_pool_texel(ivec2 place) {
    return imageLoad(pool, place).x;
}

uvec4 fetch_list_texel(ivec2 place) {
    return texelFetch(lists, place, 0);
}

float profile_cells() {
    return line.axis.w;
}

vec4 fetch_profile(uint cell) {
    return line.profile[cell];
}

struct LineReceiver {
    vec3 p;           // scene space, metres
    vec3 n;           // unit normal, towards the camera
    float rounding_m; // what heights are rounded by
    vec3 from;        // L, from p
    vec3 along;       // E
    vec2 across;      // across_line
    vec2 range;       // of the line, above the receiver's plane
    vec3 row_u;       // of the coordinates above
    vec3 row_w;
    vec3 row_h;       // unit vector
};

LineReceiver line_receiver(vec3 p, vec3 n, float rounding_m) {
    LineReceiver r;
    r.p = p;
    r.n = n;
    r.rounding_m = rounding_m;
    r.from = line.start.xyz - p;
    r.along = line.axis.xyz * line.start.w;
    r.across = across_line(view.light, p);
    float height_from = dot(n, r.from);
    float height_to = height_from + dot(n, r.along);
    float crossing = height_from / (height_from - height_to);
    r.range = vec2(height_from > 0.0 ? 0.0 : (height_to > 0.0 ? crossing : 1.0),
        height_to > 0.0 ? 1.0 : (height_from > 0.0 ? crossing : 0.0));
    vec3 across = cross(r.along, r.from);
    float square = max(dot(across, across), 1.0e-37);
    r.row_u = cross(r.from, across) / square;
    r.row_w = cross(across, r.along) / square;
    r.row_h = across * inversesqrt(square);
    return r;
}

// Where the receiver's plane cuts an edge that it cuts, as a part of what is looked at of the line; -1 if nowhere
// that matters. a, b: ends from the receiver; sides: side_of_line of both.
float edge_place(LineReceiver r, vec3 a, vec3 b, vec2 sides) {
    vec3 x = mix(a, b, sides.x / (sides.x - sides.y));
    float w = dot(r.row_w, x);
    float t = dot(r.row_u, x) / max(w, 1.0e-30);
    float place = (t - r.range.x) / (r.range.y - r.range.x);
    bool before = w > r.rounding_m * length(r.row_w) && w < 1.0 && dot(r.n, x) > r.rounding_m;
    return before && place > 0.0 && place < 1.0 ? place : -1.0;
}

// Whether the plane may cut anything in a box where it matters: the largest of each function over it.
bool box_may_matter(LineReceiver r, vec3 low, vec3 high) {
    vec3 middle = 0.5 * (low + high) - r.p;
    vec3 half_size = 0.5 * (high - low) + r.rounding_m;
    vec3 after = r.row_u - r.range.x * r.row_w;
    vec3 before = r.range.y * r.row_w - r.row_u;
    vec3 w = abs(r.row_w);
    return abs(dot(r.row_h, middle)) <= dot(abs(r.row_h), half_size)
        && dot(r.row_w, middle) + dot(w, half_size) > 0.0
        && dot(r.row_w, middle) - dot(w, half_size) < 1.0
        && dot(after, middle) + dot(abs(after), half_size) > 0.0
        && dot(before, middle) + dot(abs(before), half_size) > 0.0
        && dot(r.n, middle) + dot(abs(r.n), half_size) > 0.0;
}

// What a tile's edges change. Of each cell: by how much the number of surfaces rises over it; the same times
// its place in the cell, summed up; the largest change of one edge; all changes, of either sign.
vec4 cells[CELLS];
// Places in the cell of its first and last edge.
vec2 extents[CELLS];
// Changes before the line's centre, x without and y with what is within rounding of it.
vec2 before_center;
uint found_edges;

// a, b: its ends, scene space.
void add_edge(LineReceiver r, uint number, vec3 a, vec3 b, float place, bool rises, float center) {
    float faces = faces_on_one_side(r.p, 1.0, fetch_edge(number), a, b);
    // Along the line one comes to the positive side of the plane through receiver and edge, if the edge rises.
    float change = rises ? faces : -faces;
    float at = place * float(CELLS);
    uint i = min(uint(at), CELLS - 1u);
    float within = at - float(i);
    vec4 cell = cells[i];
    cells[i] = vec4(cell.xy + change * vec2(1.0, within), max(cell.z, abs(change)), cell.w + abs(change));
    vec2 extent = extents[i];
    extents[i] = change != 0.0 ? vec2(min(extent.x, within), max(extent.y, within)) : extent;
    before_center += change * vec2(lessThan(vec2(place), center + vec2(-NEAR, NEAR)));
    found_edges += 1u;
}

// As add_edges in dbuffer/visibility.comp: lanes look for what matters to them in loops of their own.
void add_edges(uint tile, uint tiles, LineReceiver r, float center) {
    for (uint block = 0u; block < params.sizes.x; ++block) {
        Entries entries = list_entries(block, tile, tiles);
        bool in_chunk = false;
        while (in_chunk || has_entries(entries)) {
            while (!in_chunk && has_entries(entries)) {
                bool listed = begin_chunk(entries);
                vec3 low = imageLoad(chunk_boxes, triangle_texel_place(2u * entries.chunk)).xyz;
                vec3 high = imageLoad(chunk_boxes, triangle_texel_place(2u * entries.chunk + 1u)).xyz;
                in_chunk = !listed || box_may_matter(r, low, high);
                if (!in_chunk) {
                    skip_chunk(entries);
                }
            }
            bool cut = false;
            uint entry = 0u;
            vec2 sides = vec2(0.0);
            while (in_chunk && !cut) {
                entry = next_entry(entries, in_chunk);
                vec4 turn = imageLoad(turns, triangle_texel_place(entry));
                sides = vec2(side_of_line(r.across, turn.xy), side_of_line(r.across, turn.zw));
                cut = (sides.x > 0.0) != (sides.y > 0.0);
            }
            if (cut) {
                vec3 a = imageLoad(ends, triangle_texel_place(2u * entry)).xyz;
                vec3 b = imageLoad(ends, triangle_texel_place(2u * entry + 1u)).xyz;
                float place = edge_place(r, a - r.p, b - r.p, sides);
                if (place >= 0.0) {
                    uint number = texelFetch(numbers, triangle_texel_place(entry), 0).x;
                    add_edge(r, number, a, b, place, sides.y > 0.0, center);
                }
            }
        }
    }
}

// The part of a cell that has at most so many surfaces before it; those at its start and changes in it.
float free_part(float most, float number, vec4 cell, vec2 extent) {
    bool free = number <= most;
    bool free_after = number + cell.x <= most;
    float moved = cell.y / (free == free_after ? max(cell.z, 1.0) : cell.x);
    // Two edges in a free cell hide what is between them. In one that is not they bound a gap, if what one
    // edge changes makes it free.
    bool gap = !free && !free_after && number - cell.z <= most && number + cell.x - cell.z <= most;
    // Of several edges that hide more and more, the first counts; of several that hide less and less the last.
    bool one_way = cell.w == abs(cell.x);
    float until = one_way ? extent.x : moved;
    float after = 1.0 - (one_way ? extent.y : moved);
    float part = free == free_after ? (free ? 1.0 + moved : (gap ? moved : 0.0)) : (free ? until : after);
    return clamp(part, 0.0, 1.0);
}

// The better of two places: first fewer surfaces, then more room. x: surfaces; y: the place; z: its room, in cells.
vec3 better_place(vec3 one, vec3 other, float least) {
    bool better = other.x >= least && other.z > NARROW
        && (other.x < one.x || (other.x == one.x && other.z > one.z));
    return better ? other : one;
}

// The least number of surfaces that is at least as large as asked for, and a place that has it.
vec2 least_number(float least, uint count) {
    vec3 found = vec3(count > 0u ? 1.0e9 : max(least, 0.0), 0.5, 0.0);
    float number = 0.0;
    for (uint i = 0u; i < count; ++i) {
        vec4 cell = cells[i];
        // Before its first edge, after its last one, and a gap between two edges.
        vec2 extent = extents[i];
        float after = number + cell.x;
        float gap = number == after ? cell.y / max(cell.z, 1.0) : 0.0;
        vec3 places = (float(i) + 0.5 * vec3(extent.x, extent.y + 1.0, extent.x + extent.y)) / float(CELLS);
        found = better_place(found, vec3(number, places.x, extent.x), least);
        found = better_place(found, vec3(after, places.y, 1.0 - extent.y), least);
        found = better_place(found, vec3(number - cell.z, places.z, gap), least);
        number = after;
    }
    return found.xy;
}

vec3 to_line(LineReceiver r, float place) {
    return r.from + mix(r.range.x, r.range.y, place) * r.along;
}

float light_in(LineReceiver r, float from, float to) {
    return light_before(mix(r.range.x, r.range.y, to)).x - light_before(mix(r.range.x, r.range.y, from)).x;
}

// Light that rays to the middles of cells reach.
float traced(LineReceiver r) {
    uint steps = 0u;
    float sum = 0.0;
    float done = 0.0;
    float all = light_in(r, 0.0, 1.0);
    for (uint i = 0u; i < CELLS && steps < MOST_STEPS; ++i) {
        float place = (float(i) + 0.5) / float(CELLS);
        bool blocked = ray_is_blocked(r.p, to_line(r, place), false, params.counts.z, r.rounding_m, SOLID, steps);
        bool known = blocked || steps < MOST_STEPS;
        float light = known ? light_in(r, float(i) / float(CELLS), float(i + 1u) / float(CELLS)) : 0.0;
        done += light;
        sum += blocked ? 0.0 : light;
    }
    return done > 0.0 ? sum / done * all : all;
}

float pixel_visibility(uvec2 pixel, uint tile, uint tiles) {
    float depth = texelFetch(view_depth, ivec2(pixel), 0).x;
    uint id = texelFetch(ids, ivec2(pixel), 0).x;
    if (id == 0u) {
        return 1.0;
    }
    vec3 ray = pixel_ray(view.camera, pixel);
    vec3 p = view.camera.eye.xyz + depth * ray;
    p += way_into_triangle(p, id);
    vec3 n = fetch_geometric_normal(id - 1u);
    n = dot(n, ray) > 0.0 ? -n : n;
    vec3 extent = max(max(abs(p), abs(view.camera.eye.xyz)), abs(view.light.center.xyz));
    float rounding_m = POSITION_ROUNDING * max(extent.x, max(extent.y, extent.z));
    LineReceiver r = line_receiver(p, n, rounding_m);
    if (r.range.x >= r.range.y) {
        return 0.0;
    }
    float center = (0.5 - r.range.x) / (r.range.y - r.range.x);
    bool center_above = center > NEAR && center < 1.0 - NEAR;
    bool center_seen = center_above && texelFetch(hard, ivec2(pixel), 0).x > 0.0;
    vec3 across = cross(r.along, r.from);
    if (dot(across, across) <= ON_AXIS * dot(r.along, r.along) * dot(r.from, r.from)) {
        return center_seen ? light_in(r, 0.0, 1.0) : 0.0;
    }
    if (edges_of(tile, tiles, params.sizes.x) > params.sizes.z || through.cut.x != 0u) {
        return traced(r);
    }

    for (uint i = 0u; i < CELLS; ++i) {
        cells[i] = vec4(0.0);
        extents[i] = vec2(1.0, 0.0);
    }
    before_center = vec2(0.0);
    found_edges = 0u;
    add_edges(tile, tiles, r, center);

    // Software drivers walk through branches that nobody takes, but not through loops.
    uint count = found_edges > 0u ? CELLS : 0u;
    float most = min(before_center.x, before_center.y);
    vec2 found = least_number(-1.0e9, count);
    // A centre that is seen behind more surfaces than are elsewhere is a contradiction that a ray decides.
    bool known = center_seen && found.x >= most;
    // One ray is enough where no place has fewer surfaces than the centre, which is hidden, and where no edge is.
    bool check = count == 0u
        || (center_above && !center_seen && found.x >= max(before_center.x, before_center.y));
    uint rays = known || (count == 0u && center_above) ? 0u : (check ? 1u : MOST_RAYS);
    uint steps = 0u;
    while (rays > 0u) {
        most = found.x;
        known = !ray_is_blocked(p, to_line(r, found.y), false, params.counts.z, rounding_m, SOLID, steps);
        found = least_number(most + 0.5, count);
        rays = known || found.x >= 1.0e9 ? 0u : rays - 1u;
    }
    if (!known) {
        return 0.0;
    }
    float sum = count > 0u ? 0.0 : light_in(r, 0.0, 1.0);
    float number = 0.0;
    for (uint i = 0u; i < count; ++i) {
        vec4 cell = cells[i];
        float part = free_part(most, number, cell, extents[i]);
        if (part > 0.0) {
            sum += part * light_in(r, float(i) / float(CELLS), float(i + 1u) / float(CELLS));
        }
        number += cell.x;
    }
    return clamp(sum, 0.0, 1.0);
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 size = params.counts.xy;
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(spread_entry(index, arguments.count), tiles), 0).x;
    uvec2 pixel = tile_of_entry(entry, tiles) * TILE_SIZE + gl_LocalInvocationID.xy;
    if (any(greaterThanEqual(pixel, size))) {
        return;
    }
    float result = pixel_visibility(pixel, entry, tiles.x * tiles.y);
    imageStore(visibility, ivec2(pixel), vec4(result));
}
