#version 460
// Visibility of a light's centre at every pixel.

#include "common/camera.glsl"
#include "common/materials.glsl"
#include "common/octahedral.glsl"
#include "common/tiles.glsl"
#include "hard/hard.glsl"
#include "hard/params.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std140) uniform HardBlock {
    HardParams params;
};
layout(set = 0, binding = 1) uniform sampler2D view_depth;
layout(set = 0, binding = 2) uniform usampler2D geometric_normal;
layout(set = 0, binding = 3) uniform sampler2DArray map_depth;
layout(set = 0, binding = 4) uniform usampler2DArray map_ids;
layout(set = 0, binding = 5) uniform sampler2D triangles;
layout(set = 0, binding = 6) uniform usampler2D ids;
layout(set = 0, binding = 7, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 8, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 9) uniform usampler2D list;
layout(set = 0, binding = 10) uniform sampler2D materials;
layout(set = 0, binding = 11) uniform sampler2D uvs;
layout(set = 0, binding = 12) uniform sampler2D footprints;

vec4 gather_map_depths(vec2 place, uint view) {
    return textureGather(map_depth, vec3(place, float(view)));
}

uvec4 gather_map_ids(vec2 place, uint view) {
    return textureGather(map_ids, vec3(place, float(view)));
}

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

vec4 fetch_material_texel(ivec2 place) {
    return texelFetch(materials, place, 0);
}

vec4 fetch_uv_texel(ivec2 place) {
    return texelFetch(uvs, place, 0);
}

vec4 fetch_footprint(ivec2 place) {
    return texelFetch(footprints, place, 0);
}

float pixel_visibility(uvec2 pixel) {
    float depth = texelFetch(view_depth, ivec2(pixel), 0).x;
    vec3 n = unpack_unit(texelFetch(geometric_normal, ivec2(pixel), 0).x);
    vec3 p = params.camera.eye.xyz + depth * pixel_ray(params.camera, pixel);
    bool hit = depth > 0.0;
    uint id = texelFetch(ids, ivec2(pixel), 0).x;
    p += way_into_triangle(p, hit ? id : 0u);
    // Asking the pixel too changes nothing, but for a branch on a uniform alone Mesa 22.3's software driver makes a
    // copy of the shader at every dispatch, and keeps it as long as the pipeline.
    bool sun = hit && params.light.w == 0.0;
    vec3 to_light = sun ? params.light.xyz : params.light.xyz - p;
    vec3 q = sun ? p : -to_light;
    // On or below the receiver's tangent plane the light's centre is hidden.
    bool facing = dot(n, to_light) > 0.0;
    float visibility = hit && !facing ? 0.0 : 1.0;
    // Where no view looks, nothing that could block stands.
    bool undecided = hit && facing && params.counts.x > 0u;
    if (undecided) {
        // Most lights have one view. Only the others pay for an index that differs between pixels.
        uint found = 0u;
        LightView view = params.views[0];
        vec3 at = light_view_project(view, q);
        while (found + 1u < params.counts.x && any(notEqual(at.xy, clamp(at.xy, 0.0, 1.0)))) {
            found += 1u;
            view = params.views[found];
            at = light_view_project(view, q);
        }
        if (all(equal(at.xy, clamp(at.xy, 0.0, 1.0)))) {
            Receiver receiver = Receiver(p, n, to_light, sun, id);
            visibility = hard_visibility(receiver, view, found, at.xy, float(params.counts.y));
        }
    }
    return visibility;
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 size = params.counts.zw;
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 pixel = tile_of_entry(entry, tiles) * TILE_SIZE + gl_LocalInvocationID.xy;
    if (any(greaterThanEqual(pixel, size))) {
        return;
    }
    imageStore(visibility, ivec2(pixel), vec4(pixel_visibility(pixel)));
}
