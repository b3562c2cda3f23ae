#version 460
// Entries of each group of tiles, from its candidates: a workgroup each. Its tiles take theirs from them in classes.comp,
// where that and all else that is told of a tile once takes an invocation: a driver without branches goes through all of
// a shader for each workgroup.
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
#include "shaft_masks/covers.glsl"
#include "shaft_masks/edges.glsl"

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
    uint triangles_used;
};
layout(set = 0, binding = 11, r32ui) uniform writeonly uimage2D edge_pool;
layout(set = 0, binding = 12, r32ui) uniform writeonly uimage2D triangle_pool;

const uint NO_NEIGHBOUR = 0xffffffffu;

shared uint count_sum;
shared uint first_triangle;
// Of a chunk, in bits 0 to 7 its edges, from 8 on its whole triangles, from 16 on others, from 24 on covers: one atomic
// addition gives each its place. Chunks take turns, so that a lane may begin the next one while others are at this one.
shared uint found[3u];
shared uint covers[MOST_COVERS];

const uint ONE_WHOLE = 0x100u;
const uint ONE_OTHER = 0x10000u;
const uint ONE_COVER = 0x1000000u;

vec4 fetch_triangle_texel(uint texel) {
    return imageLoad(triangles, triangle_texel_place(texel));
}

vec4 fetch_node_texel(ivec2 place) {
    return vec4(0.0); // none is needed here
}

vec4 fetch_shaft_texel(ivec2 place) {
    return imageLoad(shafts, place);
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

// An edge of a counted triangle.
struct Edge {
    uint code;
    bool is_kept;
};

// The edge of a counted triangle that begins at a corner. beside: its neighbour there.
Edge edge_of(Shaft shaft, Surfaces surfaces, bool one_axis, uint triangle, uint corner, uint beside, vec3 a, vec3 b, uint side) {
    bool alone = beside == NO_NEIGHBOUR;
    uint other = alone ? triangle : beside >> 1;
    Triangle neighbour = fetch_triangle(other);
    uint other_side = alone || !meets(shaft, neighbour) ? SIDE_UNSURE : counted_side(surfaces, neighbour);
    bool alike = (beside & 1u) == 0u;
    bool both = other_side != SIDE_UNSURE;
    bool goes_on = both && (other_side == side) == alike;
    // Both sides of a fold count the same way: the first of the two adds it.
    bool fold = both && !goes_on;
    Edge edge;
    edge.code = triangle << EDGE_CORNER_BITS | corner | (fold ? EDGE_DOUBLE : 0u) | (side == SIDE_BACK ? EDGE_TURNED : 0u);
    bool meets_shaft; // is asked for each tile
    bool beyond = edge_is_beyond(shaft, one_axis, a, b, meets_shaft);
    edge.is_kept = !goes_on && !(fold && other < triangle) && !beyond;
    return edge;
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    index = spread_entry(index, arguments.count);
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uint lane = gl_LocalInvocationIndex;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 part = part_of_entry(entry, tiles);
    // Only this workgroup writes them, and no texel that another invocation reads.
    uvec4 candidates = imageLoad(lists, list_place(part));
    if (lane == 0u) {
        count_sum = 0u;
        found[0] = 0u;
        first_triangle = atomicAdd(triangles_used, candidates.y);
    }
    barrier();

    Shaft shaft = fetch_shaft(part);
    Surfaces surfaces = fetch_surfaces(part, view.light);
    vec3 some = fetch_some_surface(part);
    mat3 frame = light_frame(view.light, some);
    bool one_axis = rows_have_one_axis(view.light, surfaces);
    uint first = first_triangle;
    uint last = first + candidates.y - 1u;
    uint chunk = candidates.x;
    uint turn = 0u;
    uint begin = 0u;
    // All groups have the same room, so that it is not by their order which of them have some.
    uint room = params.pattern.z / arguments.count;
    uvec4 counts = uvec4(0u); // edges, whole triangles, others, and covers of the chunks before
    uint own_sum = 0u;
    // Loops look at their end whether they go on: a driver without branches does one more turn of others, for nothing.
    do {
        uint end = min(CHUNK, candidates.y - begin);
        uint i = lane;
        do {
            bool is_listed = i < end;
            uint triangle = is_listed ? imageLoad(pool, chunk_place(chunk, i))[i % 4u] : 0u;
            Triangle t = fetch_triangle(triangle);
            is_listed = is_listed && meets(shaft, t);
            bool between = is_whole(surfaces, t);
            uint side = triangle_side(surfaces, t.corners[0], t.plane.xyz);
            uint side_of_light = light_side(surfaces, view.light, frame, t.corners[0], t.plane.xyz);
            bool is_counted = between && side != SIDE_UNSURE;
            bool is_drawn = is_listed && !is_counted
                && !hides_nothing(surfaces, side, side_of_light, t.corners[0], t.corners[1], t.corners[2]);
            is_counted = is_listed && is_counted;
            float margin_m = cover_margin_m(surfaces, view.light, t);
            bool covers_some = is_listed && !material_is_masked(t.plane.w)
                && sees_through(some, view.light, frame, vec3(0.0), t, margin_m);
            uvec3 beside = imageLoad(neighbours, triangle_texel_place(triangle)).xyz;
            Edge edges[3];
            uint own = is_drawn ? (between ? ONE_WHOLE : ONE_OTHER) : 0u;
            own += covers_some ? ONE_COVER : 0u;
            for (uint corner = 0u; corner < 3u; ++corner) {
                edges[corner] = edge_of(shaft, surfaces, one_axis, triangle, corner, beside[corner],
                    t.corners[corner], t.corners[(corner + 1u) % 3u], side);
                edges[corner].is_kept = edges[corner].is_kept && is_counted;
                own += edges[corner].is_kept ? 1u : 0u;
            }
            if (own != 0u) {
                uint before = atomicAdd(found[turn % 3u], own);
                uint at = counts.x + (before & 0xffu);
                for (uint corner = 0u; corner < 3u; ++corner) {
                    bool is_kept = edges[corner].is_kept;
                    if (is_kept && at < room) {
                        imageStore(edge_pool, triangle_texel_place(index * room + at), uvec4(edges[corner].code));
                    }
                    at += is_kept ? 1u : 0u;
                    own_sum += is_kept ? ((edges[corner].code & EDGE_DOUBLE) != 0u ? 2u : 1u) : 0u;
                }
                uint whole = first + counts.y + (before >> 8 & 0xffu);
                uint other = last - counts.z - (before >> 16 & 0xffu);
                if (is_drawn) {
                    imageStore(triangle_pool, triangle_texel_place(between ? whole : other), uvec4(triangle));
                }
                uint cover = counts.w + (before >> 24);
                if (covers_some && cover < MOST_COVERS) {
                    covers[cover] = triangle;
                }
            }
            i += gl_WorkGroupSize.x;
        } while (i < end);
        if (lane == 0u) {
            found[(turn + 1u) % 3u] = 0u;
        }
        barrier();
        counts += uvec4(found[turn % 3u]) >> uvec4(0u, 8u, 16u, 24u) & 0xffu;
        chunk = imageLoad(pool, chunk_place(chunk, CHUNK)).x;
        turn += 1u;
        begin += CHUNK;
    } while (begin < candidates.y);
    atomicAdd(count_sum, own_sum);
    barrier();

    // A texel an invocation, from the second on: those after them stay empty.
    uvec4 texel = uvec4(index * room, counts.x, first, candidates.y);
    texel = lane == 1u ? uvec4(counts.yz, 0u, 0u) : texel;
    texel = lane == 2u ? uvec4(count_sum, counts.w, 0u, 0u) : texel;
    uint cover = lane == 4u ? 4u : 0u;
    uvec4 covering = uvec4(covers[cover], covers[cover + 1u], covers[cover + 2u], covers[cover + 3u]);
    texel = lane > 2u ? covering : texel;
    if (lane < 5u) {
        imageStore(lists, list_place(part) + ivec2(1u + lane, 0), texel);
    }
}
