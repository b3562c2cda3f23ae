#version 460
// Lists, for each tile, the silhouettes of a block that its shaft meets: those that may hide a part of
// the light from one of its surfaces.

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

vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0); // none is needed here
}

vec4 fetch_node_texel(ivec2 place) {
    return vec4(0.0); // nor any node
}

vec4 fetch_shaft_texel(ivec2 place) {
    return texelFetch(shafts, place, 0);
}

bool meets(Shaft shaft, sampler2D from, uint box) {
    vec3 low = texelFetch(from, triangle_texel_place(2u * box), 0).xyz;
    vec3 high = texelFetch(from, triangle_texel_place(2u * box + 1u), 0).xyz;
    return shaft_meets_box(shaft, low, high);
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    uint block = gl_WorkGroupID.y;
    if (index >= arguments.count) {
        return;
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uint tile = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    Shaft shaft = fetch_shaft(tile_of_entry(tile, tiles));

    uint at = block * BLOCK;
    uint end = max(min(at + BLOCK, silhouettes.count), at);
    uint first_chunk = 0u;
    uint count = 0u;
    uint resume = end;
    uint chunk = 0u;
    uint slot = CHUNK;
    vec3 low = vec3(1.0e38);
    vec3 high = vec3(-1.0e38);
    while (at < end) {
        uint step = 1u;
        if (at % BLOCK == 0u && !meets(shaft, block_boxes, at / BLOCK)) {
            step = BLOCK;
        } else if (at % LARGE_GROUP == 0u && !meets(shaft, large_boxes, at / LARGE_GROUP)) {
            step = LARGE_GROUP;
        } else if (at % GROUP == 0u && !meets(shaft, boxes, at / GROUP)) {
            step = GROUP;
        } else {
            vec3 a = texelFetch(ends, triangle_texel_place(2u * at), 0).xyz;
            vec3 b = texelFetch(ends, triangle_texel_place(2u * at + 1u), 0).xyz;
            if (shaft_meets_triangle(shaft, a, b, b)) {
                if (slot == CHUNK) {
                    if (count > 0u) {
                        imageStore(chunk_boxes, triangle_texel_place(2u * chunk), vec4(low, 0.0));
                        imageStore(chunk_boxes, triangle_texel_place(2u * chunk + 1u), vec4(high, 0.0));
                    }
                    low = vec3(1.0e38);
                    high = vec3(-1.0e38);
                    uint fresh = atomicAdd(chunks_used, 1u);
                    if (fresh >= params.counts.w) {
                        resume = at;
                        step = BLOCK;
                    } else if (count == 0u) {
                        first_chunk = fresh;
                    } else {
                        imageStore(pool, chunk_entry_place(chunk, CHUNK), uvec4(fresh));
                    }
                    chunk = fresh;
                    slot = 0u;
                }
                if (step == 1u) {
                    imageStore(pool, chunk_entry_place(chunk, slot), uvec4(at));
                    low = min(low, min(a, b));
                    high = max(high, max(a, b));
                    slot += 1u;
                    count += 1u;
                }
            }
        }
        at += step;
    }
    if (count > 0u && chunk < params.counts.w) {
        imageStore(chunk_boxes, triangle_texel_place(2u * chunk), vec4(low, 0.0));
        imageStore(chunk_boxes, triangle_texel_place(2u * chunk + 1u), vec4(high, 0.0));
    }
    imageStore(lists, list_place(block, tile, tiles.x * tiles.y), uvec4(first_chunk, count, resume, end));
}
