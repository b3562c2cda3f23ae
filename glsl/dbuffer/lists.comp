#version 460
// Lists, for each tile, the silhouettes of a block that its shaft meets and that are silhouettes from one of its
// surfaces: those that may hide a part of the light from it.

#include "common/tiles.glsl"
#include "dbuffer/lists.glsl"
#include "dbuffer/params.glsl"
#include "silhouettes/edges.glsl"
#include "shaft_masks/shaft.glsl"

const uint LANES = 32u;

layout(local_size_x = LANES) in;

layout(set = 0, binding = 0, std140) uniform Block {
    DbufferParams params;
};
layout(set = 0, binding = 1, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 2) uniform usampler2D list;
layout(set = 0, binding = 3) uniform sampler2D shafts;
layout(set = 0, binding = 4, std140) uniform Silhouettes {
    SilhouetteArguments silhouettes;
};
layout(set = 0, binding = 5) uniform sampler2D ends;
layout(set = 0, binding = 6) uniform sampler2D boxes;
layout(set = 0, binding = 7) uniform sampler2D large_boxes;
layout(set = 0, binding = 8) uniform sampler2D block_boxes;
layout(set = 0, binding = 9, std430) buffer Pool {
    uint chunks_used;
};
layout(set = 0, binding = 10, r32ui) uniform writeonly uimage2D pool;
layout(set = 0, binding = 11, rgba32ui) uniform writeonly uimage2D lists;
layout(set = 0, binding = 12, rgba32f) uniform writeonly image2D chunk_boxes;
layout(set = 0, binding = 13) uniform usampler2D numbers;
layout(set = 0, binding = 14) uniform usampler2D edges;
layout(set = 0, binding = 15) uniform sampler2D points;

vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0); // none is needed here
}

vec4 fetch_node_texel(ivec2 place) {
    return vec4(0.0); // nor any node
}

vec4 fetch_shaft_texel(ivec2 place) {
    return texelFetch(shafts, place, 0);
}

uvec4 fetch_edge_texel(ivec2 place) {
    return texelFetch(edges, place, 0);
}

vec4 fetch_point_texel(ivec2 place) {
    return texelFetch(points, place, 0);
}

// What signs of heights over a face may be wrong by, as a part of the product of the lengths that they are made
// from: of a sliver the height itself is a small part of that, and its sign may be rounding's alone.
const float ROUNDING = 1.0e-6;

// A box around the tile's surfaces: shaft_masks/shafts.comp.
struct SurfaceBox {
    vec3 center;
    mat3 half_axes;
    float reach_m; // from the centre, at most
};

SurfaceBox fetch_surface_box(uvec2 tile) {
    ivec2 place = ivec2(tile.x * SHAFT_TEXELS + SHAFT_PLANES + 2u, tile.y);
    SurfaceBox box;
    box.center = fetch_shaft_texel(place).xyz;
    box.reach_m = 0.0;
    for (int i = 0; i < 3; ++i) {
        box.half_axes[i] = fetch_shaft_texel(place + ivec2(i + 1, 0)).xyz;
        box.reach_m += length(box.half_axes[i]);
    }
    return box;
}

// 1 or -1 where all of the box is on that side of a face, else 0.
float side_of_box(SurfaceBox box, vec3 a, vec3 along, uint corner) {
    vec3 across = fetch_point(corner).xyz - a;
    vec3 n = cross(along, across);
    vec3 from = box.center - a;
    vec3 reach = abs(n * box.half_axes);
    float extent = reach.x + reach.y + reach.z;
    float slack = ROUNDING * length(along) * length(across) * (length(from) + box.reach_m);
    float height = dot(n, from);
    return height > extent + slack ? 1.0 : (height < -extent - slack ? -1.0 : 0.0);
}

// Whether an edge may be a silhouette from a surface of the tile: not if one of its two faces is always on the
// other side of the plane through the edge.
bool may_be_silhouette(SurfaceBox box, uint entry, vec3 a, vec3 b) {
    uvec4 edge = fetch_edge(texelFetch(numbers, triangle_texel_place(entry), 0).x);
    bool two = edge.w < MORE_FACES;
    float first = side_of_box(box, a, b - a, edge.z);
    float second = side_of_box(box, a, b - a, two ? edge.w : edge.z);
    return first * second > -0.5;
}

bool meets(Shaft shaft, sampler2D from, uint box) {
    vec3 low = texelFetch(from, triangle_texel_place(2u * box), 0).xyz;
    vec3 high = texelFetch(from, triangle_texel_place(2u * box + 1u), 0).xyz;
    return shaft_meets_box(shaft, low, high);
}

void main() {
    // Blocks one after the other, tile by tile: those at the end may be empty.
    uint block = gl_WorkGroupID.x;
    uint groups = (arguments.count + LANES - 1u) / LANES;
    if (gl_WorkGroupID.y >= groups) {
        return;
    }
    uint index = spread_entry(gl_WorkGroupID.y, groups) * LANES + gl_LocalInvocationID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uint tile = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    Shaft shaft = fetch_shaft(tile_of_entry(tile, tiles));
    SurfaceBox box = fetch_surface_box(tile_of_entry(tile, tiles));

    uint at = block * BLOCK;
    uint end = max(min(at + BLOCK, silhouettes.count), at);
    uint first_chunk = 0u;
    uint count = 0u;
    uint chunk = 0u;
    uint slot = CHUNK;
    vec3 low = vec3(1.0e38);
    vec3 high = vec3(-1.0e38);
    // A loop for each kind of work: vector units walk through branches that none of their lanes takes. Boxes of
    // many edges, then of few, then these few, then those that meet the shaft.
    if (at < end && !meets(shaft, block_boxes, block)) {
        at = end;
    }
    while (at < end) {
        bool within = at % LARGE_GROUP != 0u;
        while (at < end && !within) {
            within = meets(shaft, large_boxes, at / LARGE_GROUP);
            at += within ? 0u : LARGE_GROUP;
        }
        uint large_end = min(end, (at / LARGE_GROUP + 1u) * LARGE_GROUP);
        bool in_group = false;
        while (at < large_end && !in_group) {
            in_group = meets(shaft, boxes, at / GROUP);
            at += in_group ? 0u : GROUP;
        }
        uint first = at;
        uint wanted = 0u;
        uint stop = in_group ? min(large_end, at + GROUP) : at;
        while (at < stop) {
            vec3 a = texelFetch(ends, triangle_texel_place(2u * at), 0).xyz;
            vec3 b = texelFetch(ends, triangle_texel_place(2u * at + 1u), 0).xyz;
            wanted |= shaft_meets_triangle(shaft, a, b, b) ? 1u << (at - first) : 0u;
            at += 1u;
        }
        uint listed = 0u;
        vec3 group_low = vec3(1.0e38);
        vec3 group_high = vec3(-1.0e38);
        while (wanted != 0u) {
            uint bit = uint(findLSB(wanted));
            wanted &= wanted - 1u;
            vec3 a = texelFetch(ends, triangle_texel_place(2u * (first + bit)), 0).xyz;
            vec3 b = texelFetch(ends, triangle_texel_place(2u * (first + bit) + 1u), 0).xyz;
            if (may_be_silhouette(box, first + bit, a, b)) {
                listed |= 1u << bit;
                group_low = min(group_low, min(a, b));
                group_high = max(group_high, max(a, b));
            }
        }
        // Into the list's last chunk until it is full, and what is left into a fresh one. Chunks that share a group both
        // have all of it in their boxes.
        while (listed != 0u) {
            if (slot == CHUNK) {
                if (count > 0u) {
                    imageStore(chunk_boxes, triangle_texel_place(2u * chunk), vec4(low, 0.0));
                    imageStore(chunk_boxes, triangle_texel_place(2u * chunk + 1u), vec4(high, 0.0));
                }
                low = vec3(1.0e38);
                high = vec3(-1.0e38);
                // What finds no room goes into a chunk that nobody reads, and is counted: overflow.glsl.
                uint fresh = min(atomicAdd(chunks_used, 1u), params.counts.w);
                if (count == 0u) {
                    first_chunk = fresh;
                } else {
                    imageStore(pool, chunk_entry_place(chunk, CHUNK), uvec4(fresh));
                }
                chunk = fresh;
                slot = 0u;
            }
            low = min(low, group_low);
            high = max(high, group_high);
            while (listed != 0u && slot < CHUNK) {
                imageStore(pool, chunk_entry_place(chunk, slot), uvec4(first + uint(findLSB(listed))));
                listed &= listed - 1u;
                slot += 1u;
                count += 1u;
            }
        }
    }
    if (count > 0u) {
        imageStore(chunk_boxes, triangle_texel_place(2u * chunk), vec4(low, 0.0));
        imageStore(chunk_boxes, triangle_texel_place(2u * chunk + 1u), vec4(high, 0.0));
    }
    imageStore(lists, list_place(block, tile, tiles.x * tiles.y), uvec4(first_chunk, count, end, end));
}
