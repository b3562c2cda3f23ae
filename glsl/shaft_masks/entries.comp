#version 460
#extension GL_EXT_control_flow_attributes : require
// Entries for the masks of each tile, from its candidates: a workgroup each. Tiles that turn out to be lit or dark
// as a whole are settled here, the others listed.
//
// Triangles that are between all surfaces and the light's plane and show one side to all surfaces are counted
// by their edges. Seen from a surface each goes round its samples once, so that a sample's number of
// such triangles before it is the sum over edges on one side of it, and an edge where two such triangles
// go on into each other counts up and down: nothing. That is decided for each triangle by itself, so
// open, folded and many-sided edges need no rule of their own, and any triangle may be left to the
// others, which are drawn one by one. Silhouette edges in this sense: Laine and others 2005, "Soft Shadow
// Volumes for Ray Tracing".
//
// Where none of these edges meets the shaft, the number is the same for every surface and every sample: of any one
// segment it tells whether the tile is dark. So is a tile with another triangle between all of it and all of the light.

#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "shaft_masks/estimates.glsl"
#include "shaft_masks/lists.glsl"
#include "shaft_masks/sides.glsl"

layout(local_size_x = 8) in; // one vector: a lane without a candidate costs as much as one with

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 3, rgba32f) uniform readonly image2D triangles;
layout(set = 0, binding = 4, rgba32ui) uniform readonly uimage2D neighbours;
layout(set = 0, binding = 5, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 6) uniform usampler2D list;
layout(set = 0, binding = 7, rgba32f) uniform readonly image2D shafts;
layout(set = 0, binding = 8, rgba32ui) uniform readonly uimage2D pool;
layout(set = 0, binding = 9, rgba32ui) uniform uimage2D lists;
layout(set = 0, binding = 10, std430) buffer Used {
    uint chunks_used;
    uint edges_used;
    uint triangles_used;
};
layout(set = 0, binding = 11, r32ui) uniform writeonly uimage2D edge_pool;
layout(set = 0, binding = 12, r32ui) uniform writeonly uimage2D triangle_pool;
layout(set = 0, binding = 13, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 14, r32f) uniform readonly image2D view_depth;
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
// Those that masks are made of.
layout(set = 0, binding = 22, std430) buffer OpenArguments {
    TileArguments open_tiles;
};
layout(set = 0, binding = 2, r32ui) uniform writeonly uimage2D open_list;
// The same, plain ones from the begin of a list of their own and others from its end.
layout(set = 0, binding = 23, std430) buffer PlainArguments {
    TileArguments plain;
};
layout(set = 0, binding = 24, std430) buffer OtherArguments {
    TileArguments others_than_plain;
};
layout(set = 0, binding = 25, r32ui) uniform writeonly uimage2D sorted_list;

#define SUN_TANGENT_SQUARE (view.light.axis_x.w * view.light.axis_x.w)

#include "shaft_masks/masks.glsl"

// Triangles that are looked at as ones that may cover all of the light.
const uint MOST_COVERS = 8u;

const uint NO_NEIGHBOUR = 0xffffffffu;
const uint MOST_EDGES = MOST_COUNT;

shared uint staged[MOST_EDGES];
shared uint edge_count;
shared uint meeting_edges; // that meet the shaft
shared uint count_sum;
shared uint whole_count;
shared uint other_count;
shared uint first_triangle;
shared uint first_edge;
shared int rounds; // that counted triangles go round one segment
// Counted triangles of a chunk, times two, plus one for those seen from behind. Chunks take turns, so that a lane
// may begin the next one while others are at this one.
shared uint counted[2u][CHUNK];
shared uint counted_count[3u];
shared uint covers[MOST_COVERS];
shared uint cover_count;
shared uint seen_corners[MOST_COVERS]; // of the surfaces' box, that see some of the light past it

vec4 fetch_triangle_texel(uint texel) {
    return imageLoad(triangles, triangle_texel_place(texel));
}

vec4 fetch_node_texel(ivec2 place) {
    return vec4(0.0); // none is needed here
}

vec4 fetch_shaft_texel(ivec2 place) {
    return imageLoad(shafts, place);
}

// Nothing is fetched from these here.
vec4 fetch_material_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_uv_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_footprint(ivec2 place) {
    return vec4(0.0);
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

// Whether p sees all of a box around the light through the triangle, with a margin. half_size: of the box, in its
// frame; of a sun the box holds directions.
bool sees_through(vec3 p, Light light, mat3 frame, vec3 half_size, Triangle t, float margin_m) {
    vec3 a = t.corners[0] - p;
    vec3 b = t.corners[1] - p;
    vec3 c = t.corners[2] - p;
    vec3 to = light_offset(light, p);
    float height = dot(t.plane.xyz, a);
    float turn = height > 0.0 ? 1.0 : -1.0;
    float fall = turn * dot(t.plane.xyz, to) - dot(abs(t.plane.xyz * frame), half_size);
    bool between = abs(height) > margin_m && fall > (LIGHT_SHAPE == LIGHT_SUN ? 0.0 : abs(height));
    vec3 ab = cross(a, b);
    vec3 bc = cross(b, c);
    vec3 ca = cross(c, a);
    vec3 edges = turn * vec3(dot(ab, to), dot(bc, to), dot(ca, to));
    edges -= vec3(dot(abs(ab * frame), half_size), dot(abs(bc * frame), half_size), dot(abs(ca * frame), half_size));
    // Sums of coordinates, which lengths are at most.
    vec3 lengths = vec3(dot(abs(a), vec3(1.0)), dot(abs(b), vec3(1.0)), dot(abs(c), vec3(1.0)));
    vec3 margins = margin_m * (dot(abs(to), vec3(1.0)) + dot(half_size, vec3(1.0))) * (lengths + lengths.yzx);
    return between && all(greaterThan(edges, margins));
}

float cover_margin_m(Surfaces surfaces, Triangle t) {
    vec3 extent = max(abs(t.corners[0]),
        max(abs(surfaces.center), LIGHT_SHAPE == LIGHT_SUN ? vec3(0.0) : abs(view.light.center.xyz)));
    return POSITION_ROUNDING * max(extent.x, max(extent.y, extent.z));
}

// Corner 0 to 7 of the box around the surfaces.
vec3 surfaces_corner(Surfaces surfaces, uint corner) {
    vec3 side = vec3(uvec3(corner, corner >> 1, corner >> 2) & 1u) * 2.0 - 1.0;
    return surfaces.center + side.x * surfaces.axes[0] + side.y * surfaces.axes[1] + side.z * surfaces.axes[2];
}

// Whether light_from chooses the same axis of a sphere for all surfaces, with a margin.
bool rows_have_one_axis(Light light, Surfaces surfaces) {
    float along = abs(dot(surfaces.z, light.axis_x.xyz));
    return abs(along - NEAR_AXIS) > surfaces.tilt + 1.0e-5;
}

// What an invocation knows of the edges that it staged: kept to itself until all are, because what is shared is dear.
struct Staged {
    uint count_sum;
    bool meets; // any meets the shaft
};

// Stages an edge: one that is beyond the samples on the side that edges count towards, or beyond the ends of
// all rows, seen from every surface, is left out.
// one_axis: rows lie along the same axis of a sphere for all surfaces.
void stage_edge(inout Staged known, Shaft shaft, bool one_axis, vec3 a, vec3 b, uint code) {
    bool beyond = false;
    bool outside = false;
    // The rows of a sphere's disk turn a little from pixel to pixel, and by a right angle where they lie along another
    // axis; those of a rectangle rise: what is below it may cross them before their first sample.
    uint last = LIGHT_SHAPE == LIGHT_SPHERE ? (one_axis ? 1u : 0u) : LIGHT_SHAPE == LIGHT_RECT ? 3u : 4u;
    for (uint i = 0u; i < SHAFT_PLANES; ++i) {
        vec4 plane = shaft.planes[i];
        bool both = dot(plane.xyz, a) > plane.w && dot(plane.xyz, b) > plane.w;
        outside = outside || both;
        beyond = beyond || (both && i != 1u && i < last);
    }
    if (!beyond) {
        uint at = atomicAdd(edge_count, 1u);
        known.count_sum += (code & EDGE_DOUBLE) != 0u ? 2u : 1u;
        known.meets = known.meets || !outside;
        if (at < MOST_EDGES) {
            staged[at] = code;
        }
    }
}

// The edge of a counted triangle that begins at a corner.
void add_edge(inout Staged known, Shaft shaft, Surfaces surfaces, uint triangle, uint corner, uint side) {
    uint beside = imageLoad(neighbours, triangle_texel_place(triangle))[corner];
    vec3 a = fetch_triangle_texel(4u * triangle + corner).xyz;
    vec3 b = fetch_triangle_texel(4u * triangle + (corner == 2u ? 0u : corner + 1u)).xyz;
    bool alone = beside == NO_NEIGHBOUR;
    uint other = alone ? triangle : beside >> 1;
    Triangle neighbour = fetch_triangle(other);
    uint other_side = alone || !meets(shaft, neighbour) ? SIDE_UNSURE : counted_side(surfaces, neighbour);
    bool alike = (beside & 1u) == 0u;
    bool both = other_side != SIDE_UNSURE;
    bool goes_on = both && (other_side == side) == alike;
    // Both sides of a fold count the same way: the first of the two adds it.
    bool fold = both && !goes_on;
    if (!goes_on && !(fold && other < triangle)) {
        uint code = triangle << EDGE_CORNER_BITS | corner | (fold ? EDGE_DOUBLE : 0u);
        code |= side == SIDE_BACK ? EDGE_TURNED : 0u;
        stage_edge(known, shaft, rows_have_one_axis(view.light, surfaces), a, b, code);
    }
}

// What a staged edge adds to the number of triangles between a receiver and the middle of the light.
int edge_rounds(Projection projection, uint code) {
    uint triangle = (code & ~(EDGE_DOUBLE | EDGE_TURNED)) >> EDGE_CORNER_BITS;
    uint corner = code & ((1u << EDGE_CORNER_BITS) - 1u);
    vec2 a = project(projection, fetch_triangle_texel(4u * triangle + corner).xyz);
    vec2 b = project(projection, fetch_triangle_texel(4u * triangle + (corner == 2u ? 0u : corner + 1u)).xyz);
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

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    index = spread_entry(index, arguments.count);
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
        meeting_edges = 0u;
        count_sum = 0u;
        whole_count = 0u;
        other_count = 0u;
        rounds = 0;
        counted_count[0] = 0u;
        cover_count = 0u;
        first_triangle = atomicAdd(triangles_used, candidates.y);
    }
    seen_corners[lane] = 0u;
    barrier();

    Shaft shaft = fetch_shaft(part);
    Surfaces surfaces = fetch_surfaces(part, view.light);
    vec3 some = fetch_some_surface(part);
    mat3 frame = light_frame(view.light, some);
    uint last = first_triangle + candidates.y - 1u;
    uint chunk = candidates.x;
    uint turn = 0u;
    uint begin = 0u;
    Staged known = Staged(0u, false);
    // Loops look at their end whether they go on: a driver without branches does one more turn of others, for nothing.
    do {
        uint end = min(CHUNK, candidates.y - begin);
        uint i = lane;
        do {
            bool is_listed = i < end;
            uint triangle = is_listed ? imageLoad(pool, chunk_place(chunk, i))[i % 4u] : 0u;
            Triangle t = fetch_triangle(triangle);
            if (is_listed && meets(shaft, t)) {
                bool between = is_whole(surfaces, t);
                uint side = triangle_side(surfaces, t.corners[0], t.plane.xyz);
                uint side_of_light = light_side(surfaces, view.light, frame, t.corners[0], t.plane.xyz);
                bool hides = !hides_nothing(surfaces, side, side_of_light,
                    t.corners[0], t.corners[1], t.corners[2]);
                if (between && side != SIDE_UNSURE) {
                    uint at = atomicAdd(counted_count[turn % 3u], 1u);
                    counted[turn % 2u][at] = triangle << 1 | (side == SIDE_BACK ? 1u : 0u);
                } else if (hides && between) {
                    uint at = first_triangle + atomicAdd(whole_count, 1u);
                    imageStore(triangle_pool, triangle_texel_place(at), uvec4(triangle));
                } else if (hides) {
                    uint at = last - atomicAdd(other_count, 1u);
                    imageStore(triangle_pool, triangle_texel_place(at), uvec4(triangle));
                }
                float margin_m = cover_margin_m(surfaces, t);
                if (!material_is_masked(t.plane.w) && sees_through(some, view.light, frame, vec3(0.0), t, margin_m)) {
                    uint cover = atomicAdd(cover_count, 1u);
                    if (cover < MOST_COVERS) {
                        covers[cover] = triangle;
                    }
                }
            }
            i += gl_WorkGroupSize.x;
        } while (i < end);
        if (lane == 0u) {
            counted_count[(turn + 1u) % 3u] = 0u;
        }
        barrier();
        uint corners = 3u * counted_count[turn % 3u];
        i = lane;
        do {
            uint code = counted[turn % 2u][min(i / 3u, CHUNK - 1u)];
            if (i < corners) {
                add_edge(known, shaft, surfaces, code >> 1, i % 3u, (code & 1u) != 0u ? SIDE_BACK : SIDE_FRONT);
            }
            i += gl_WorkGroupSize.x;
        } while (i < corners);
        chunk = imageLoad(pool, chunk_place(chunk, CHUNK)).x;
        turn += 1u;
        begin += CHUNK;
    } while (begin < candidates.y);
    atomicAdd(count_sum, known.count_sum);
    if (known.meets) {
        meeting_edges = 1u;
    }
    barrier();

    // A list that ends early is not used: an edge between a triangle in the list and one that found no room in it
    // counts for neither.
    bool complete = candidates.z == params.counts.z && count_sum <= MOST_COUNT;
    bool same = complete && meeting_edges == 0u;
    Projection projection = projection_from(MaskReceiver(some, 0u, true), 0.0);
    for (uint i = lane; i < edge_count && same; i += gl_WorkGroupSize.x) {
        atomicAdd(rounds, edge_rounds(projection, staged[i]));
    }
    // Whether a triangle is between all surfaces and all of the light: sides of its edges are bilinear in the two ends
    // of a segment, so corners decide.
    uint corners = 8u * min(cover_count, MOST_COVERS);
    vec3 light_half = light_half_size(view.light);
    for (uint i = lane; i < corners; i += gl_WorkGroupSize.x) {
        Triangle t = fetch_triangle(covers[i / 8u]);
        vec3 p = surfaces_corner(surfaces, i & 7u);
        if (!sees_through(p, view.light, frame, light_half, t, cover_margin_m(surfaces, t))) {
            seen_corners[i / 8u] = 1u;
        }
    }
    barrier();
    bool dark = same && rounds != 0;
    for (uint i = 0u; i < min(cover_count, MOST_COVERS); ++i) {
        dark = dark || seen_corners[i] == 0u;
    }
    uint edges = same ? 0u : edge_count;
    bool lit = complete && !dark && edges + whole_count + other_count == 0u && shaft.low.w > 0.0;
    bool settled = dark || lit;
    // Without room for its edges a tile is looked at as if nothing was known of it. All have the same room, so that it
    // is not by their order which of them have some.
    bool fits = complete && edges <= params.pattern.z / arguments.count;
    if (lane == 0u) {
        first_edge = atomicAdd(edges_used, fits && !settled ? edges : 0u);
    }
    barrier();
    for (uint i = lane; i < edges && fits && !settled; i += gl_WorkGroupSize.x) {
        imageStore(edge_pool, triangle_texel_place(first_edge + i), uvec4(staged[i]));
    }
    uint whole = fits ? whole_count : 0u;
    uint others = fits ? other_count : 0u;
    uint resume = fits ? params.counts.z : 0u;
    bool is_walked = whole + others > most_drawn();
    vec2 depths = fetch_part_depths(part);
    for (uint i = lane; i < TILE_SIZE * TILE_SIZE && dark; i += gl_WorkGroupSize.x) { // all is lit at the beginning
        // Stores beyond the picture's border are dropped.
        uvec2 pixel = tile * TILE_SIZE + uvec2(i % TILE_SIZE, i / TILE_SIZE);
        float depth = imageLoad(view_depth, ivec2(min(pixel, size - 1u))).x;
        if (is_in_part(depths, depth) && depth > 0.0) {
            imageStore(visibility, ivec2(pixel), vec4(0.0));
        }
    }
    for (uint i = (lane + 1u) * TASK_ENTRIES; i < whole + others && !settled && !is_walked; i += gl_WorkGroupSize.x * TASK_ENTRIES) {
        uint task = atomicAdd(further.count, 1u);
        atomicMax(further.groups_x, min(task + 1u, TILE_ROW));
        atomicMax(further.groups_y, task / TILE_ROW + 1u);
        imageStore(tasks, task_place(task), uvec4(entry, i, 0u, 0u));
    }
    if (lane == 0u) {
        ivec2 at = list_place(part);
        imageStore(lists, at, uvec4(candidates.xy, resume, settled ? TILE_SETTLED : is_walked ? TILE_WALKED : TILE_OPEN));
        imageStore(lists, at + ivec2(1, 0), uvec4(first_edge, fits ? edges : 0u, first_triangle, candidates.y));
        imageStore(lists, at + ivec2(2, 0), uvec4(whole, others, tile.y * tiles.x + tile.x, 0u));
        uint work = (fits ? edges : 0u) + whole + others + (params.counts.z - resume);
        uint level = dark ? LEVEL_DARK : lit ? LEVEL_LIT : params.pattern.w;
        imageStore(estimates, estimate_place(part, ESTIMATE_WORK), uvec4(work));
        imageStore(estimates, estimate_place(part, ESTIMATE_LEVEL), uvec4(level));
        bool partly = resume < params.counts.z || is_walked;
        if (!settled) {
            uint slot = atomicAdd(open_tiles.count, 1u);
            atomicMax(open_tiles.groups_x, min(slot + 1u, TILE_ROW));
            atomicMax(open_tiles.groups_y, slot / TILE_ROW + 1u);
            imageStore(open_list, tile_entry_place(slot, tiles), uvec4(entry));
        }
        bool is_plain = fits && others == 0u && whole <= TASK_ENTRIES && count_sum <= MOST_PLAIN && shaft.low.w > 0.0;
        if (!settled && is_plain) {
            uint slot = atomicAdd(plain.count, 1u);
            atomicMax(plain.groups_x, min(slot + 1u, TILE_ROW));
            atomicMax(plain.groups_y, slot / TILE_ROW + 1u);
            imageStore(sorted_list, tile_entry_place(slot, tiles), uvec4(entry));
        }
        if (!settled && !is_plain) {
            uint slot = atomicAdd(others_than_plain.count, 1u);
            atomicMax(others_than_plain.groups_x, min(slot + 1u, TILE_ROW));
            atomicMax(others_than_plain.groups_y, slot / TILE_ROW + 1u);
            imageStore(sorted_list, place_from_end(slot, tiles), uvec4(entry));
        }
        if (!settled && (params.pattern.y > 1u || whole + others > TASK_ENTRIES || partly)) {
            uint slot = atomicAdd(pieces.count, 1u);
            atomicMax(pieces.groups_x, min(slot + 1u, TILE_ROW));
            atomicMax(pieces.groups_y, slot / TILE_ROW + 1u);
            imageStore(pieces_list, tile_entry_place(slot, tiles), uvec4(entry));
        }
        if (!settled && partly) {
            uint slot = atomicAdd(partial.count, 1u);
            atomicMax(partial.groups_x, min(slot + 1u, TILE_ROW));
            atomicMax(partial.groups_y, slot / TILE_ROW + 1u);
            imageStore(partial_list, tile_entry_place(slot, tiles), uvec4(entry));
        }
    }
}
