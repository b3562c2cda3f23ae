#version 460
// Lists, for each tile, the triangles with holes that its shaft meets.

#include "common/hierarchy.glsl"
#include "common/materials.glsl"
#include "common/tiles.glsl"
#include "dbuffer/lists.glsl"
#include "dbuffer/params.glsl"
#include "shaft_masks/shaft.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std140) uniform Block {
    DbufferParams params;
};
layout(set = 0, binding = 1, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 2) uniform usampler2D list;
layout(set = 0, binding = 3) uniform sampler2D shafts;
layout(set = 0, binding = 4) uniform sampler2D triangles;
layout(set = 0, binding = 5) uniform sampler2D hierarchy;
layout(set = 0, binding = 6, std430) buffer Pool {
    uint chunks_used;
};
layout(set = 0, binding = 7, r32ui) uniform writeonly uimage2D pool;
layout(set = 0, binding = 8, rgba32ui) uniform writeonly uimage2D lists;
layout(set = 0, binding = 9, rgba32f) uniform writeonly image2D chunk_boxes;

// A software driver may end loops after 65,535 turns of all lanes of a vector together: a walk ends
// itself before, and the visibility takes it up where it ended.
const uint MOST_STEPS = 24576u;

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

vec4 fetch_node_texel(ivec2 place) {
    return texelFetch(hierarchy, place, 0);
}

vec4 fetch_shaft_texel(ivec2 place) {
    return texelFetch(shafts, place, 0);
}

// No texture is looked at here.
vec4 fetch_material_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_uv_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_footprint(ivec2 place) {
    return vec4(0.0);
}

void main() {
    uint index = spread_entry(gl_WorkGroupID.x, gl_NumWorkGroups.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uint tile = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    Shaft shaft = fetch_shaft(tile_of_entry(tile, tiles));
    uint nodes = params.counts.z;
    uint first_chunk = 0u;
    uint count = 0u;
    uint resume = nodes;
    uint chunk = 0u;
    uint slot = CHUNK;
    vec3 low = vec3(1.0e38);
    vec3 high = vec3(-1.0e38);
    uint node = 0u;
    uint steps = 0u;
    while (node < resume) {
        steps += 1u;
        vec4 node_low = fetch_node_low(node);
        uint next = node + 1u;
        if (node_low.w < 0.0) {
            next = shaft_meets_box(shaft, node_low.xyz, fetch_node_high(node).xyz) ? next : uint(-node_low.w);
        } else if (material_is_masked(fetch_triangle_texel(4u * uint(node_low.w) + 3u).w)) {
            uint triangle = uint(node_low.w);
            vec3 a = fetch_triangle_texel(4u * triangle).xyz;
            vec3 b = fetch_triangle_texel(4u * triangle + 1u).xyz;
            vec3 c = fetch_triangle_texel(4u * triangle + 2u).xyz;
            if (shaft_meets_triangle(shaft, a, b, c)) {
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
                imageStore(pool, chunk_entry_place(chunk, slot), uvec4(triangle));
                low = min(low, min(a, min(b, c)));
                high = max(high, max(a, max(b, c)));
                slot += 1u;
                count += 1u;
            }
        }
        node = next;
        resume = steps == MOST_STEPS ? min(resume, node) : resume;
    }
    if (count > 0u) {
        imageStore(chunk_boxes, triangle_texel_place(2u * chunk), vec4(low, 0.0));
        imageStore(chunk_boxes, triangle_texel_place(2u * chunk + 1u), vec4(high, 0.0));
    }
    // After the lists of silhouettes.
    ivec2 place = list_place(params.sizes.x, tile, tiles.x * tiles.y);
    imageStore(lists, place, uvec4(first_chunk, count, resume, nodes));
}
