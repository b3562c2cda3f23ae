#version 460
// Entries for the masks of each tile, from its candidates: a workgroup each. A tile with a triangle between
// all of it and all of the light is dark and settled here.
//
// Triangles that are between all surfaces and the light's plane and show one side to all surfaces are counted
// by their edges. Seen from a surface each goes round its samples once, so that a sample's number of
// such triangles before it is the sum over edges on one side of it, and an edge where two such triangles
// go on into each other counts up and down: nothing. That is decided for each triangle by itself, so
// open, folded and many-sided edges need no rule of their own, and any triangle may be left to the
// others, which are drawn one by one. Silhouette edges in this sense: Laine and others 2005, "Soft Shadow
// Volumes for Ray Tracing".

#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "shaft_masks/estimates.glsl"
#include "shaft_masks/lists.glsl"
#include "shaft_masks/sides.glsl"

layout(local_size_x = 32) in;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 2) uniform sampler2D tile_bounds;
layout(set = 0, binding = 3) uniform sampler2D triangles;
layout(set = 0, binding = 4) uniform usampler2D neighbours;
layout(set = 0, binding = 5, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 6) uniform usampler2D list;
layout(set = 0, binding = 7) uniform sampler2D shafts;
layout(set = 0, binding = 8) uniform usampler2D pool;
layout(set = 0, binding = 9, rgba32ui) uniform uimage2D lists;
layout(set = 0, binding = 10, std430) buffer Used {
    uint chunks_used;
    uint edges_used;
    uint triangles_used;
};
layout(set = 0, binding = 11, r32ui) uniform writeonly uimage2D edge_pool;
layout(set = 0, binding = 12, r32ui) uniform writeonly uimage2D triangle_pool;
layout(set = 0, binding = 13, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 14) uniform sampler2D view_depth;
layout(set = 0, binding = 15, std430) buffer TaskArguments {
    TileArguments further;
};
// Tile, number of the first triangle.
layout(set = 0, binding = 16, rgba32ui) uniform writeonly uimage2D tasks;
layout(set = 0, binding = 17, std430) buffer PartialArguments {
    TileArguments partial;
};
layout(set = 0, binding = 18, r32ui) uniform writeonly uimage2D partial_list;
// Those whose masks are made in pieces.
layout(set = 0, binding = 19, std430) buffer PiecesArguments {
    TileArguments pieces;
};
layout(set = 0, binding = 20, r32ui) uniform writeonly uimage2D pieces_list;
layout(set = 0, binding = 21, r32ui) uniform writeonly uimage2D estimates;

// Pairs of corners that an invocation looks at to find a dark tile.
const uint MOST_LOOKS = 256u;

const uint NO_NEIGHBOUR = 0xffffffffu;
const uint MOST_EDGES = MOST_COUNT;

shared uint staged[MOST_EDGES];
shared uint edge_count;
shared uint count_sum;
shared uint whole_count;
shared uint other_count;
shared uint first_triangle;
shared uint first_edge;
shared uint is_dark;

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

vec4 fetch_node_texel(ivec2 place) {
    return vec4(0.0); // none is needed here
}

vec4 fetch_shaft_texel(ivec2 place) {
    return texelFetch(shafts, place, 0);
}

struct Triangle {
    vec3 corners[3];
    vec4 plane;
};

Triangle fetch_triangle(uint triangle) {
    return Triangle(vec3[3](fetch_triangle_texel(4u * triangle).xyz, fetch_triangle_texel(4u * triangle + 1u).xyz,
        fetch_triangle_texel(4u * triangle + 2u).xyz), fetch_triangle_texel(4u * triangle + 3u));
}

bool meets(Shaft shaft, Triangle t) {
    return shaft_meets_triangle(shaft, t.corners[0], t.corners[1], t.corners[2]);
}

bool is_whole(Surfaces surfaces, Triangle t) {
    return !material_is_masked(t.plane.w)
        && triangle_is_between(surfaces, t.corners[0], t.corners[1], t.corners[2]);
}

// The side of a triangle that is counted by its edges, SIDE_UNSURE of others. Depends on nothing but the
// triangle, so that its neighbours know it.
uint counted_side(Surfaces surfaces, Triangle t) {
    return is_whole(surfaces, t) ? triangle_side(surfaces, t.corners[0], t.plane.xyz) : SIDE_UNSURE;
}

// Corner 0 to 7 of a box around the light; of a sun a direction.
vec3 light_corner(Light light, mat3 frame, uint corner) {
    vec3 side = vec3(uvec3(corner, corner >> 1, corner >> 2) & 1u) * 2.0 - 1.0;
    return light.center.xyz + frame * (side * light_half_size(light));
}

// Whether p sees the end l (of a sun: the direction) through the triangle, with a margin.
bool sees_through(vec3 p, vec3 l, Triangle t, float margin_m) {
    vec3 a = t.corners[0] - p;
    vec3 b = t.corners[1] - p;
    vec3 c = t.corners[2] - p;
    vec3 to = LIGHT_SHAPE == LIGHT_SUN ? l : l - p;
    float height = dot(t.plane.xyz, a);
    float fall = dot(t.plane.xyz, to);
    float turn = height > 0.0 ? 1.0 : -1.0;
    bool between = abs(height) > margin_m && turn * fall > 0.0
        && (LIGHT_SHAPE == LIGHT_SUN || turn * fall > abs(height));
    vec3 edges = vec3(dot(cross(a, b), to), dot(cross(b, c), to), dot(cross(c, a), to));
    vec3 lengths = vec3(length(a), length(b), length(c));
    vec3 margins = margin_m * length(to) * (lengths + lengths.yzx);
    return between && all(greaterThan(turn * edges, margins));
}

// Whether the triangle is between all of the tile and all of the light: sides of edges are bilinear in
// the two ends of a segment, so corners decide.
bool covers(uvec2 tile, TileBounds bounds, mat3 frame, Triangle t, inout uint looks) {
    vec3 p = tile_corner(view.camera, tile, bounds, 0u);
    vec3 extent = max(abs(t.corners[0]), max(abs(p), LIGHT_SHAPE == LIGHT_SUN ? vec3(0.0) : abs(view.light.center.xyz)));
    float margin_m = POSITION_ROUNDING * max(extent.x, max(extent.y, extent.z));
    bool all_through = !material_is_masked(t.plane.w) && looks + 64u <= MOST_LOOKS
        && sees_through(p, view.light.center.xyz, t, margin_m);
    for (uint i = 0u; i < 64u && all_through; ++i) {
        p = tile_corner(view.camera, tile, bounds, i & 7u);
        looks += 1u;
        all_through = sees_through(p, light_corner(view.light, frame, i >> 3), t, margin_m);
    }
    return all_through;
}

// Whether an edge is beyond the samples on the side that edges count towards, or beyond the ends of
// all rows, seen from every surface.
bool is_beyond(Shaft shaft, vec3 a, vec3 b) {
    bool beyond = false;
    // The rows of a sphere's disk turn a little from pixel to pixel, and those of a rectangle rise: what is below it
    // may cross them before their first sample.
    uint last = LIGHT_SHAPE == LIGHT_SPHERE ? 1u : LIGHT_SHAPE == LIGHT_RECT ? 3u : 4u;
    for (uint i = 0u; i < last; ++i) {
        vec4 plane = shaft.planes[i];
        beyond = beyond || (i != 1u && dot(plane.xyz, a) > plane.w && dot(plane.xyz, b) > plane.w);
    }
    return beyond;
}

void stage_edge(uint triangle, uint corner, uint side, bool twice) {
    uint at = atomicAdd(edge_count, 1u);
    atomicAdd(count_sum, twice ? 2u : 1u);
    if (at < MOST_EDGES) {
        staged[at] = triangle << EDGE_CORNER_BITS | corner | (twice ? EDGE_DOUBLE : 0u)
            | (side == SIDE_BACK ? EDGE_TURNED : 0u);
    }
}

void add_edges(Shaft shaft, Surfaces surfaces, uint triangle, Triangle t, uint side) {
    uvec4 beside = texelFetch(neighbours, triangle_texel_place(triangle), 0);
    for (uint corner = 0u; corner < 3u; ++corner) {
        bool open = beside[corner] == NO_NEIGHBOUR;
        uint other = open ? triangle : beside[corner] >> 1;
        Triangle neighbour = fetch_triangle(other);
        uint other_side = open || !meets(shaft, neighbour) ? SIDE_UNSURE : counted_side(surfaces, neighbour);
        bool alike = (beside[corner] & 1u) == 0u;
        bool counted = other_side != SIDE_UNSURE;
        bool goes_on = counted && (other_side == side) == alike;
        // Both sides of a fold count the same way: the first of the two adds it.
        bool fold = counted && !goes_on;
        bool adds = !goes_on && !(fold && other < triangle);
        if (adds && !is_beyond(shaft, t.corners[corner], t.corners[corner == 2u ? 0u : corner + 1u])) {
            stage_edge(triangle, corner, side, fold);
        }
    }
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    // The masks have a workgroup for each block of samples, this has one.
    if (index >= arguments.count || gl_WorkGroupID.z > 0u) {
        return;
    }
    uvec2 size = params.counts.xy;
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uint lane = gl_LocalInvocationIndex;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 part = part_of_entry(entry, tiles);
    uvec2 tile = tile_of_part(part, tiles);
    // Only this workgroup writes them, and no texel that another invocation reads.
    uvec4 candidates = imageLoad(lists, list_place(part));
    if (lane == 0u) {
        edge_count = 0u;
        count_sum = 0u;
        whole_count = 0u;
        other_count = 0u;
        is_dark = 0u;
        first_triangle = atomicAdd(triangles_used, candidates.y);
    }
    barrier();

    ivec2 place = ivec2(tile.x * TILE_TEXELS, tile.y);
    TileBounds bounds = tile_bounds_of(texelFetch(tile_bounds, place, 0),
        texelFetch(tile_bounds, place + ivec2(1, 0), 0), texelFetch(tile_bounds, place + ivec2(2, 0), 0));
    Shaft shaft = fetch_shaft(part);
    Surfaces surfaces = fetch_surfaces(part, view.light);
    mat3 frame = light_frame(view.light, tile_corner(view.camera, tile, bounds, 0u));
    uint last = first_triangle + candidates.y - 1u;
    uint looks = 0u;
    uint chunk = candidates.x;
    for (uint begin = 0u; begin < candidates.y; begin += CHUNK) {
        if (lane < min(CHUNK, candidates.y - begin)) {
            uint triangle = texelFetch(pool, chunk_entry_place(chunk, lane), 0).x;
            Triangle t = fetch_triangle(triangle);
            if (meets(shaft, t)) {
                uint side = counted_side(surfaces, t);
                if (covers(tile, bounds, frame, t, looks)) {
                    is_dark = 1u;
                }
                bool hides = !is_below(surfaces, t.corners[0], t.corners[1], t.corners[2])
                    && !is_beyond_light(surfaces, t.corners[0], t.corners[1], t.corners[2]);
                if (side != SIDE_UNSURE) {
                    add_edges(shaft, surfaces, triangle, t, side);
                } else if (hides && is_whole(surfaces, t)) {
                    uint at = first_triangle + atomicAdd(whole_count, 1u);
                    imageStore(triangle_pool, triangle_texel_place(at), uvec4(triangle));
                } else if (hides) {
                    uint at = last - atomicAdd(other_count, 1u);
                    imageStore(triangle_pool, triangle_texel_place(at), uvec4(triangle));
                }
            }
        }
        chunk = texelFetch(pool, chunk_entry_place(chunk, CHUNK), 0).x;
    }
    barrier();

    uint edges = edge_count;
    if (lane == 0u) {
        first_edge = atomicAdd(edges_used, count_sum <= MOST_COUNT ? edges : 0u);
    }
    barrier();
    // Without room for its edges a tile is looked at as if nothing was known of it. So is one whose list
    // ends early: an edge between a triangle in the list and one that found no room in it counts for neither.
    bool fits = candidates.z == params.counts.z && count_sum <= MOST_COUNT
        && first_edge + edges <= params.pattern.z;
    for (uint i = lane; i < edges && fits; i += gl_WorkGroupSize.x) {
        imageStore(edge_pool, triangle_texel_place(first_edge + i), uvec4(staged[i]));
    }
    uint whole = fits ? whole_count : 0u;
    uint others = fits ? other_count : 0u;
    uint resume = fits ? params.counts.z : 0u;
    bool dark = is_dark != 0u;
    vec2 depths = fetch_part_depths(part);
    bool partly = resume < params.counts.z && !dark;
    for (uint i = lane; i < TILE_SIZE * TILE_SIZE && dark; i += gl_WorkGroupSize.x) {
        // Stores beyond the picture's border are dropped.
        uvec2 pixel = tile * TILE_SIZE + uvec2(i % TILE_SIZE, i / TILE_SIZE);
        float depth = texelFetch(view_depth, ivec2(min(pixel, size - 1u)), 0).x;
        if (is_in_part(depths, depth)) {
            imageStore(visibility, ivec2(pixel), vec4(depth > 0.0 ? 0.0 : 1.0));
        }
    }
    for (uint i = (lane + 1u) * TASK_ENTRIES; i < whole + others && !dark; i += gl_WorkGroupSize.x * TASK_ENTRIES) {
        uint task = atomicAdd(further.count, 1u);
        atomicMax(further.groups_x, min(task + 1u, TILE_ROW));
        atomicMax(further.groups_y, task / TILE_ROW + 1u);
        imageStore(tasks, task_place(task), uvec4(entry, i, 0u, 0u));
    }
    if (lane == 0u) {
        ivec2 at = list_place(part);
        imageStore(lists, at, uvec4(candidates.xy, resume, dark ? TILE_SETTLED : TILE_OPEN));
        imageStore(lists, at + ivec2(1, 0), uvec4(first_edge, fits ? edges : 0u, first_triangle, candidates.y));
        imageStore(lists, at + ivec2(2, 0), uvec4(whole, others, tile.y * tiles.x + tile.x, 0u));
        uint work = (fits ? edges : 0u) + whole + others + (params.counts.z - resume);
        imageStore(estimates, estimate_place(part, ESTIMATE_WORK), uvec4(work));
        imageStore(estimates, estimate_place(part, ESTIMATE_LEVEL), uvec4(dark ? LEVEL_DARK : params.pattern.w));
        if (!dark && (params.pattern.y > 1u || whole + others > TASK_ENTRIES || partly)) {
            uint slot = atomicAdd(pieces.count, 1u);
            atomicMax(pieces.groups_x, min(slot + 1u, TILE_ROW));
            atomicMax(pieces.groups_y, slot / TILE_ROW + 1u);
            imageStore(pieces_list, tile_entry_place(slot, tiles), uvec4(entry));
        }
        if (partly) {
            uint slot = atomicAdd(partial.count, 1u);
            atomicMax(partial.groups_x, min(slot + 1u, TILE_ROW));
            atomicMax(partial.groups_y, slot / TILE_ROW + 1u);
            imageStore(partial_list, tile_entry_place(slot, tiles), uvec4(entry));
        }
    }
}
