#version 460
// Soft Shadow Occlusion Camera (Mo, Popescu, Wyman): the part of the light that silhouette edges near
// a receiver's place in the light's image leave free.

#include "common/combine.glsl"
#include "common/materials.glsl"
#include "common/octahedral.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "hard/hard.glsl"
#include "ssoc/params.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

// 0 and 1: SNAP_TEXELS and MASKED of hard/hard.glsl.
layout(constant_id = 2) const uint LIGHT_SHAPE = 0u;
layout(constant_id = 3) const uint LOOKUPS = 13u;
// How several edges join: Combine of the library.
layout(constant_id = 4) const uint COMBINE = 0u;
const uint COMBINE_CELLS = 0u;
const uint COMBINE_PRODUCT = 2u;
const uint COMBINE_MIN = 3u;
const uint COMBINE_AND = 4u;
const uint COMBINE_OR = 5u;
// 1: 3 t^2 - 2 t^3 instead of the disk's area.
layout(constant_id = 5) const uint CUBIC = 0u;
// Edges a texel of the distortion maps.
layout(constant_id = 6) const uint LAYERS = 1u;
// 1: brightness falls from the middle of the disk to its rim, as 1 - s^2.
layout(constant_id = 7) const uint FALLOFF = 0u;

layout(set = 0, binding = 0, std140) uniform View {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform Block {
    SsocParams params;
};
layout(set = 0, binding = 2) uniform sampler2D view_depth;
layout(set = 0, binding = 3) uniform usampler2D geometric_normal;
layout(set = 0, binding = 4) uniform sampler2DArray map_depth;
layout(set = 0, binding = 5) uniform usampler2DArray map_edges;
layout(set = 0, binding = 6) uniform usampler2D edges;
layout(set = 0, binding = 7) uniform sampler2D points;
layout(set = 0, binding = 8, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 9, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 10) uniform usampler2D list;
layout(set = 0, binding = 11) uniform usampler2DArray map_ids;
layout(set = 0, binding = 12) uniform usampler2D ids;
layout(set = 0, binding = 13) uniform sampler2D triangles;
layout(set = 0, binding = 14) uniform sampler2D materials;
layout(set = 0, binding = 15) uniform sampler2D uvs;
layout(set = 0, binding = 16) uniform sampler2D footprints;
layout(set = 0, binding = 17) uniform usampler2DArray map_second;

#include "ssoc/cells.glsl"
#include "ssoc/cutouts.glsl"
#include "ssoc/published.glsl"

uvec4 fetch_edge_texel(ivec2 at) {
    return texelFetch(edges, at, 0);
}

vec4 fetch_point_texel(ivec2 at) {
    return texelFetch(points, at, 0);
}

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

vec4 fetch_material_texel(ivec2 at) {
    return texelFetch(materials, at, 0);
}

vec4 fetch_uv_texel(ivec2 at) {
    return texelFetch(uvs, at, 0);
}

vec4 fetch_footprint(ivec2 at) {
    return texelFetch(footprints, at, 0);
}

vec4 gather_map_depths(vec2 at, uint index) {
    return textureGather(map_depth, vec3(at, float(index)));
}

uvec4 gather_map_ids(vec2 at, uint index) {
    return textureGather(map_ids, vec3(at, float(index)));
}

uint fetch_map_edge(ivec3 texel) {
    return texelFetch(map_edges, texel, 0).x;
}

uint fetch_second_edge(ivec3 texel) {
    return texelFetch(map_second, texel, 0).x;
}

uint fetch_map_id(ivec3 texel) {
    return texelFetch(map_ids, texel, 0).x;
}

float fetch_map_depth(ivec3 texel) {
    return texelFetch(map_depth, texel, 0).x;
}

float pixel_visibility(uvec2 pixel) {
    float depth = texelFetch(view_depth, ivec2(pixel), 0).x;
    vec3 n = unpack_unit(texelFetch(geometric_normal, ivec2(pixel), 0).x);
    vec3 p = view.camera.eye.xyz + depth * pixel_ray(view.camera, pixel);
    bool hit = depth > 0.0;
    uint id = texelFetch(ids, ivec2(pixel), 0).x;
    p += way_into_triangle(p, hit ? id : 0u);
    float above = light_above(view.light, LIGHT_SHAPE, p, n);
    if (FALLOFF != 0u && LIGHT_SHAPE != LIGHT_POINT) {
        vec3 offset = light_offset(view.light, p);
        vec3 axis = abs(offset.x) < abs(offset.y) ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0);
        above = power_above(light_chord(light_disk(view.light, LIGHT_SHAPE, p, axis), n).x);
    }
    float result = hit ? above : 1.0;
    if (hit && above > 0.0 && params.counts.x > 0u) {
        vec3 q = view.light.center.w > 0.0 ? -light_offset(view.light, p) : p;
        uint found = 0u;
        LightView light_view = params.views[0];
        vec3 at = light_view_project(light_view, q);
        while (found + 1u < params.counts.x && any(notEqual(at.xy, clamp(at.xy, 0.0, 1.0)))) {
            found += 1u;
            light_view = params.views[found];
            at = light_view_project(light_view, q);
        }
        if (all(equal(at.xy, clamp(at.xy, 0.0, 1.0)))) {
            vec3 plane = light_view_plane(light_view, q, n, at.xy);
            vec2 in_units = at.xy / light_view.scale.xy + vec2(light_view.right.w, light_view.up.w);
            float z = dot(q, light_view.forward.xyz);
            float stored = light_view.forward.w > 0.0 ? 1.0 / z : z;
            // Whether the light's centre is hidden is exact: a texel of the wall that a floor ends at
            // says nothing about the floor before it. A centre below the receiver's plane counts as
            // free, for that part of the light is taken off in any case.
            vec3 to_light = light_offset(view.light, p);
            bool sun = view.light.center.w == 0.0;
            Receiver receiver = Receiver(p, n, to_light, sun, id);
            bool facing = dot(n, to_light) > 0.0;
            float texels_across = float(params.counts.y);
            bool hidden = facing
                && hard_visibility(receiver, light_view, found, at.xy, texels_across) == 0.0;
            LightDisk disk = light_disk(view.light, LIGHT_SHAPE, p, light_view.right.xyz);
            Place here = Place(p, n, in_units, stored, plane, at.xy, found, hidden, disk);
            float seen = hidden ? 0.0 : 1.0;
            if (LIGHT_SHAPE != LIGHT_POINT) {
                float turn = gradient_noise(pixel);
                float past = MASKED != 0u ? past_cutouts(here, light_view, turn) : -1.0;
                if (past >= 0.0) {
                    seen = past;
                } else {
                    seen = COMBINE == COMBINE_CELLS
                        ? soft_cells(here, light_view)
                        : soft_published(here, light_view);
                }
            }
            result = visibility_and(seen, above, 0.0);
        }
    }
    return result;
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
