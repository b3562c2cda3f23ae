#version 460
// Percentage-closer filtering (Reeves et al. 1987) and percentage-closer soft shadows (Fernando
// 2005): how much of a neighbourhood in the shadow map lets light through. The neighbourhood is what
// the light, at its real size, covers of the map as seen from the receiver through the blockers'
// mean depth. Depths are compared with the receiver's plane at each texel, without a bias.

#include "common/combine.glsl"
#include "common/light_above.glsl"
#include "common/octahedral.glsl"
#include "common/taps.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "pcss/params.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(constant_id = 0) const uint LIGHT_SHAPE = 1u;
layout(constant_id = 1) const uint TAPS = 32u;          // of the filter
layout(constant_id = 2) const uint SEARCH_TAPS = 16u;   // of the search for blockers; 0: fixed filter
layout(constant_id = 3) const float SNAP_TEXELS = 4.0 / 256.0;
layout(constant_id = 4) const uint ROTATED = 1u;        // turn the taps from pixel to pixel

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform PcssBlock {
    PcssParams params;
};
layout(set = 0, binding = 2) uniform sampler2D view_depth;
layout(set = 0, binding = 3) uniform usampler2D geometric_normal;
layout(set = 0, binding = 4) uniform sampler2DArray map_depth;
layout(set = 0, binding = 5, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 6, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 7) uniform usampler2D list;

const float DEPTH_ROUNDING = 1.0 / 1048576.0;

// Tap index of count in the light's own coordinates, -1 to 1: evenly over its area.
vec2 tap_place(uint index, uint count, float turn) {
    float part = (float(index) + 0.5) / float(count);
    if (LIGHT_SHAPE == LIGHT_LINE) {
        return vec2(2.0 * fract(part + turn) - 1.0, 0.0);
    } else if (LIGHT_SHAPE == LIGHT_RECT) {
        // The additive recurrence of the plastic number (Roberts 2018) fills a square.
        return 2.0 * fract(vec2(0.7548776662, 0.5698402910) * float(index) + turn) - 1.0;
    }
    return disk_tap(index, count, turn);
}

struct Neighbourhood {
    vec2 map;     // the receiver's place
    uint index;   // of the view
    vec3 plane;   // depth of the receiver's plane there, and its change across the map
    float texels; // of the map, across
};

// Depth stored at a tap, and whether it is in front of the receiver's plane there.
bool blocked_at(Neighbourhood at, vec2 offset, out float stored) {
    vec2 texel = clamp(floor((at.map + offset) * at.texels), 0.0, at.texels - 1.0);
    stored = texelFetch(map_depth, ivec3(ivec2(texel), int(at.index)), 0).x;
    vec2 apart = (texel + 0.5) / at.texels - at.map;
    float expected = at.plane.x + dot(at.plane.yz, apart);
    float slack = (abs(at.plane.y) + abs(at.plane.z)) / at.texels * SNAP_TEXELS
        + abs(at.plane.x) * DEPTH_ROUNDING;
    return stored > expected + slack;
}

// Distance from the light along the view direction, of a stored depth.
float distance_of(LightView light_view, float stored) {
    return light_view.forward.w > 0.0
        ? light_view.scale.z / stored
        : (stored - light_view.scale.w) / light_view.scale.z;
}

// How far the light's half axes reach in the map, as seen from a receiver at distance z through a
// hole at distance h.
mat2 footprint(LightView light_view, vec4 axes, float h, float z) {
    float width = light_view.forward.w > 0.0 ? max(1.0 / h - 1.0 / z, 0.0) : max(z - h, 0.0);
    mat2 halves = mat2(axes.xy * light_view.scale.xy, axes.zw * light_view.scale.xy);
    return halves * width;
}

float filtered(Neighbourhood at, LightView light_view, vec4 axes, float z, float turn) {
    mat2 area = mat2(params.search.y / at.texels);
    if (SEARCH_TAPS > 0u) {
        float nearest = params.search.x;
        mat2 search = footprint(light_view, axes, nearest, z);
        float sum = 0.0;
        float count = 0.0;
        for (uint i = 0u; i < SEARCH_TAPS; ++i) {
            float stored;
            bool blocked = blocked_at(at, search * tap_place(i, SEARCH_TAPS, turn), stored);
            sum += blocked ? distance_of(light_view, stored) : 0.0;
            count += blocked ? 1.0 : 0.0;
        }
        if (count == 0.0) {
            return 1.0;
        }
        area = footprint(light_view, axes, sum / count, z);
    }
    float seen = 0.0;
    for (uint i = 0u; i < TAPS; ++i) {
        float stored;
        seen += blocked_at(at, area * tap_place(i, TAPS, turn), stored) ? 0.0 : 1.0;
    }
    return seen / float(TAPS);
}

float pixel_visibility(uvec2 pixel) {
    float depth = texelFetch(view_depth, ivec2(pixel), 0).x;
    vec3 n = unpack_unit(texelFetch(geometric_normal, ivec2(pixel), 0).x);
    vec3 p = view.camera.eye.xyz + depth * pixel_ray(view.camera, pixel);
    bool hit = depth > 0.0;
    float above = light_above(view.light, LIGHT_SHAPE, p, n);
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
            float texels = float(params.counts.y);
            Neighbourhood place = Neighbourhood(at.xy, found, plane, texels);
            float turn = ROTATED != 0u ? gradient_noise(pixel) : 0.0;
            float z = dot(q, light_view.forward.xyz);
            float seen = filtered(place, light_view, params.axes[found], z, turn);
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
