#version 460
// Visibility of a line light at every pixel, and how much of what is seen counts for its two ends.

#include "common/materials.glsl"
#include "common/octahedral.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "oess/oess.glsl"
#include "oess/profile.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform OessBlock {
    OessParams params;
};
layout(set = 0, binding = 2) uniform sampler2D view_depth;
layout(set = 0, binding = 3) uniform usampler2D geometric_normal;
layout(set = 0, binding = 4) uniform usampler2D ids;
layout(set = 0, binding = 5) uniform sampler2DArray map_depth;
layout(set = 0, binding = 6) uniform usampler2DArray map_ids;
layout(set = 0, binding = 7) uniform usampler2DArray outreach_forward;
layout(set = 0, binding = 8) uniform usampler2DArray outreach_backward;
layout(set = 0, binding = 9) uniform sampler2D triangles;
layout(set = 0, binding = 10) uniform sampler2D materials;
layout(set = 0, binding = 11) uniform sampler2D uvs;
layout(set = 0, binding = 12) uniform sampler2D footprints;
layout(set = 0, binding = 13, r32f) uniform image2D visibility;
layout(set = 0, binding = 14, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 15) uniform usampler2D list;
layout(set = 0, binding = 16, rg32f) uniform image2D influences;
layout(set = 0, binding = 17, rg32ui) uniform uimage2D open_parts; // see params.glsl

layout(push_constant) uniform Push {
    uint stage;
    uint stride; // segments from one end that is looked at to the next
} push;

// All there is. Or first what the line's ends say, and what they leave open; then that.
const uint STAGE_ONLY = 0u;
const uint STAGE_FIRST = 1u;
const uint STAGE_SECOND = 2u;

vec4 gather_map_depths(vec2 place, uint layer) {
    return textureGather(map_depth, vec3(place, float(layer)));
}

uvec4 gather_map_ids(vec2 place, uint layer) {
    return textureGather(map_ids, vec3(place, float(layer)));
}

uvec4 gather_outreach(vec2 place, uint layer, bool backward) {
    vec3 at = vec3(place, float(layer));
    return backward ? textureGather(outreach_backward, at) : textureGather(outreach_forward, at);
}

uint fetch_outreach(ivec2 texel, uint layer, bool backward) {
    ivec3 at = ivec3(texel, int(layer));
    return backward ? texelFetch(outreach_backward, at, 0).x : texelFetch(outreach_forward, at, 0).x;
}

float fetch_map_depth(ivec2 texel, uint layer) {
    return texelFetch(map_depth, ivec3(texel, int(layer)), 0).x;
}

uint fetch_map_id(ivec2 texel, uint layer) {
    return texelFetch(map_ids, ivec3(texel, int(layer)), 0).x;
}

float profile_cells() {
    return params.axis.w;
}

vec4 fetch_profile(uint cell) {
    return params.profile[cell];
}

uint map_texels() {
    return params.counts.z;
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

// A point of the line as the receiver sees it, from the map of one sector.
End end_of(uint point, uint sector, Receiver receiver) {
    End end;
    end.position = params.start.xyz + params.axis.xyz * (params.start.w * float(point));
    end.along = params.axis.xyz;
    float stride = float(push.stride);
    end.length_m = params.start.w * stride;
    end.texels = params.shift[sector].x * stride;
    end.layer = sector * params.counts.y + point;
    end.outreach = (sector * (params.counts.y - 1u) + point) / push.stride;
    end.backward = false;
    receiver.to_light = end.position - receiver.position;
    end.facing = dot(receiver.normal, receiver.to_light) > 0.0;
    LightView view = params.views[end.layer];
    vec2 size_texels = vec2(params.counts.zw);
    vec3 map = light_view_project(view, -receiver.to_light);
    end.place = map.xy * size_texels;
    end.seen = false;
    if (end.facing) {
        end.seen = hard_visibility(receiver, view, end.layer, map.xy, size_texels.x) > 0.5;
    }
    vec2 corner = (floor(end.place - 0.5) + 0.5) / size_texels;
    end.plane = light_view_plane(view, -receiver.to_light, receiver.normal, corner);
    end.plane.yz /= size_texels;
    return end;
}

// The sector that a point lies in, counts.x for none.
uint sector_of(vec3 p) {
    uint sector = 0u;
    bool found = false;
    while (sector < params.counts.x && !found) {
        LightView view = params.views[sector * params.counts.y];
        vec3 map = light_view_project(view, p - params.start.xyz);
        found = map.y == clamp(map.y, 0.0, 1.0) && map.z > 0.0;
        sector += found ? 0u : 1u;
    }
    return sector;
}

// Adds the part of the line between two of its places, 0 to 1: its light, and what of that counts for the
// first and the last end (section 3.4, figure 6).
void add_part(inout vec3 sum, float from, float to) {
    vec2 light = light_before(max(to, from)) - light_before(from);
    sum += vec3(light.x, light.x - light.y, light.y);
}

// The light of a range of the line that reaches a receiver, as add_part adds it. In the first stage without
// what is open, which is returned.
vec3 light_between(vec2 range, uint sector, Receiver receiver, inout uvec2 open) {
    vec2 size_texels = vec2(params.counts.zw);
    LightView first = params.views[sector * params.counts.y];
    vec2 texel_m = abs(1.0 / first.scale.xy) / size_texels;
    float widest_m = max(texel_m.x, texel_m.y);
    uint spans = (params.counts.y - 1u) / push.stride;
    uint begin = uint(clamp(floor(range.x * float(spans)), 0.0, float(spans)));
    uint end = uint(clamp(ceil(range.y * float(spans)), 0.0, float(spans)));
    vec3 sum = vec3(0.0);
    End from;
    for (uint span = begin; span < end; ++span) {
        if (span == begin) {
            from = end_of(span * push.stride, sector, receiver);
        }
        End to = end_of((span + 1u) * push.stride, sector, receiver);
        End back = to;
        back.backward = true;
        back.along = -back.along;
        back.outreach = from.outreach;
        Parts parts = visible_parts(from, back, receiver, size_texels, widest_m);
        vec2 parts_of_line[3] = vec2[3](parts.first, parts.last, parts.middle);
        uint count = 3u;
        vec2 wanted = vec2(max(parts.open.x, range.x), min(parts.open.y, range.y));
        if (push.stage == STAGE_FIRST && wanted.y > wanted.x) {
            open.x = packUnorm2x16(wanted);
            open.y = uint(max(from.place.y, 0.0)) | sector << ROW_BITS;
            count = 2u;
        }
        for (uint i = 0u; i < count; ++i) {
            vec2 part = (parts_of_line[i] + float(span)) / float(spans);
            add_part(sum, max(part.x, range.x), min(part.y, range.y));
        }
        from = to;
    }
    return sum;
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 size = uvec2(textureSize(view_depth, 0));
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 pixel = tile_of_entry(entry, tiles) * TILE_SIZE + gl_LocalInvocationID.xy;
    if (any(greaterThanEqual(pixel, size))) {
        return;
    }
    float depth = texelFetch(view_depth, ivec2(pixel), 0).x;
    vec3 n = unpack_unit(texelFetch(geometric_normal, ivec2(pixel), 0).x);
    vec3 p = view.camera.eye.xyz + depth * pixel_ray(view.camera, pixel);
    uint id = texelFetch(ids, ivec2(pixel), 0).x;
    Receiver receiver = Receiver(p, n, vec3(0.0), false, id);

    // Visible part; what of it counts for the line's first end and for its last.
    vec2 whole = light_before(1.0);
    vec3 sum = vec3(1.0, 1.0 - whole.y, whole.y);
    uvec2 open = uvec2(0u);
    vec2 range = vec2(0.0, 1.0); // of the line, that is looked at
    if (push.stage == STAGE_SECOND) {
        open = imageLoad(open_parts, ivec2(pixel)).xy;
        if (open.x == 0u) {
            return;
        }
        range = unpackUnorm2x16(open.x);
    }
    uint sector = depth > 0.0 ? sector_of(p) : params.counts.x;
    if (depth > 0.0) {
        // The part of the line above the receiver's plane.
        uint segments = params.counts.y - 1u;
        vec3 last = params.start.xyz + params.axis.xyz * (params.start.w * float(segments));
        float height_from = dot(n, params.start.xyz - p);
        float height_to = dot(n, last - p);
        float crossing = height_from / (height_from - height_to);
        vec2 above = vec2(height_from > 0.0 ? 0.0 : height_to > 0.0 ? crossing : 1.0,
            height_to > 0.0 ? 1.0 : height_from > 0.0 ? crossing : 0.0);
        range = vec2(max(range.x, above.x), min(range.y, above.y));
        sum = vec3(0.0);
        if (push.stage == STAGE_SECOND) {
            sum = vec3(imageLoad(visibility, ivec2(pixel)).x, imageLoad(influences, ivec2(pixel)).xy);
        }
        if (sector == params.counts.x) {
            add_part(sum, range.x, range.y);
        } else {
            sum += light_between(range, sector, receiver, open);
        }
    }
    imageStore(visibility, ivec2(pixel), vec4(clamp(sum.x, 0.0, 1.0)));
    imageStore(influences, ivec2(pixel), vec4(sum.yz, 0.0, 0.0));
    if (push.stage == STAGE_FIRST) {
        imageStore(open_parts, ivec2(pixel), uvec4(open, 0u, 0u));
    }
}
