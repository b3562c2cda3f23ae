#version 460
// Settles the tiles that see nothing, or from whose surfaces no part of the light is above the plane,
// and lists the others.

#include "common/tiles.glsl"
#include "common/view_params.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1) uniform sampler2D tile_bounds;
layout(set = 0, binding = 2, std430) buffer Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 3, r32ui) uniform writeonly uimage2D list;
layout(set = 0, binding = 4, r32f) uniform writeonly image2D visibility;

layout(push_constant) uniform Push {
    uvec2 size;    // of the picture, pixels
    float reach_m; // from the light's centre to its farthest point (of a sun: at distance 1)
} push;

// Room for rounding, as a part of the distance to the light.
const float SLACK = 1.0e-4;

void main() {
    uvec2 tiles = (push.size + TILE_SIZE - 1u) / TILE_SIZE;
    uint index = gl_GlobalInvocationID.x;
    if (index >= tiles.x * tiles.y) {
        return;
    }
    uvec2 tile = tile_of_entry(index, tiles);
    ivec2 place = ivec2(tile.x * TILE_TEXELS, tile.y);
    TileBounds bounds = tile_bounds_of(texelFetch(tile_bounds, place, 0),
        texelFetch(tile_bounds, place + ivec2(1, 0), 0), texelFetch(tile_bounds, place + ivec2(2, 0), 0));

    bool empty = bounds.farthest == 0.0;
    bool turned_away = bounds.all_hit;
    for (uint corner = 0u; corner < 8u; ++corner) {
        vec3 to_light = light_offset(view.light, tile_corner(view.camera, tile, bounds, corner));
        float most = most_along(bounds.normal_low, bounds.normal_high, to_light) + push.reach_m;
        turned_away = turned_away && most < -SLACK * length(to_light);
    }
    if (empty || turned_away) {
        uint pixels = empty ? 0u : TILE_SIZE * TILE_SIZE; // all is lit at the beginning
        for (uint i = 0u; i < pixels; ++i) {
            // Stores beyond the picture's border are dropped.
            uvec2 pixel = tile * TILE_SIZE + uvec2(i % TILE_SIZE, i / TILE_SIZE);
            imageStore(visibility, ivec2(pixel), vec4(0.0));
        }
    } else {
        uint slot = atomicAdd(arguments.count, 1u);
        atomicMax(arguments.groups_x, min(slot + 1u, TILE_ROW));
        atomicMax(arguments.groups_y, slot / TILE_ROW + 1u);
        imageStore(list, tile_entry_place(slot, tiles), uvec4(index));
    }
}
