#version 460
// Bounds of the surfaces in each tile. One invocation a tile: no barriers, and all do the same work.

#include "common/octahedral.glsl"
#include "common/tiles.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform sampler2D view_depth;
layout(set = 0, binding = 1) uniform usampler2D geometric_normal;
layout(set = 0, binding = 2, rgba32f) uniform writeonly image2D tile_bounds;
layout(set = 0, binding = 3) uniform usampler2D ids;

void main() {
    uvec2 size = uvec2(textureSize(view_depth, 0));
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uint index = gl_GlobalInvocationID.x;
    if (index >= tiles.x * tiles.y) {
        return;
    }
    uvec2 tile = tile_of_entry(index, tiles);
    float nearest = 1.0e38;
    float farthest = 0.0;
    float least = 1.0e38;
    vec3 low = vec3(2.0);
    vec3 high = vec3(-2.0);
    uint least_id = ~0u;
    uint most_id = 0u;
    for (uint i = 0u; i < TILE_SIZE * TILE_SIZE; ++i) {
        // Beyond the picture's border its last pixels count again.
        uvec2 pixel = min(tile * TILE_SIZE + uvec2(i % TILE_SIZE, i / TILE_SIZE), size - 1u);
        float depth = texelFetch(view_depth, ivec2(pixel), 0).x;
        vec3 n = unpack_unit(texelFetch(geometric_normal, ivec2(pixel), 0).x);
        uint id = texelFetch(ids, ivec2(pixel), 0).x;
        bool hit = depth > 0.0;
        least_id = min(least_id, id);
        most_id = max(most_id, id);
        least = min(least, depth);
        nearest = min(nearest, hit ? depth : 1.0e38);
        farthest = max(farthest, depth);
        low = min(low, hit ? n : vec3(2.0));
        high = max(high, hit ? n : vec3(-2.0));
    }
    ivec2 place = ivec2(tile.x * TILE_TEXELS, tile.y);
    imageStore(tile_bounds, place, vec4(nearest, farthest, least > 0.0 ? 1.0 : 0.0, 0.0));
    imageStore(tile_bounds, place + ivec2(1, 0), vec4(low, least_id == most_id ? 1.0 : 0.0));
    imageStore(tile_bounds, place + ivec2(2, 0), vec4(high, 0.0));
}
