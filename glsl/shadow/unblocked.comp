#version 460
// The part of a light that surfaces in the listed tiles see where nothing blocks it: what is above
// their own horizon.

#include "common/light_above.glsl"
#include "common/octahedral.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(constant_id = 0) const uint LIGHT_SHAPE = 1u;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1) uniform sampler2D view_depth;
layout(set = 0, binding = 2) uniform usampler2D geometric_normal;
layout(set = 0, binding = 3, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 4) uniform usampler2D list;
layout(set = 0, binding = 5, r32f) uniform writeonly image2D visibility;

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 size = uvec2(imageSize(visibility));
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 pixel = tile_of_entry(entry, tiles) * TILE_SIZE + gl_LocalInvocationID.xy;
    if (any(greaterThanEqual(pixel, size))) {
        return;
    }
    float depth = texelFetch(view_depth, ivec2(pixel), 0).x;
    vec3 n = unpack_unit(texelFetch(geometric_normal, ivec2(pixel), 0).x);
    vec3 p = view.camera.eye.xyz + depth * pixel_ray(view.camera, pixel);
    float above = depth > 0.0 ? light_above(view.light, LIGHT_SHAPE, p, n) : 1.0;
    imageStore(visibility, ivec2(pixel), vec4(above));
}
