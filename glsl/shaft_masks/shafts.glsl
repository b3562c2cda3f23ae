// The shaft of a tile, or of one of its parts: the hull of two boxes, around its surfaces and around the light, along the
// axes of the light. Surfaces that are turned away from the light see none of it whatever is listed, and are left out.
#ifndef ANTUMBRA_SHAFT_MASKS_SHAFTS_GLSL
#define ANTUMBRA_SHAFT_MASKS_SHAFTS_GLSL

#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "shaft_masks/shaft.glsl"

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 2, r32f) uniform readonly image2D view_depth;
layout(set = 0, binding = 3, r32ui) uniform readonly uimage2D ids;
layout(set = 0, binding = 4, rgba32f) uniform readonly image2D triangles;
layout(set = 0, binding = 5, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 6) uniform usampler2D list;
layout(set = 0, binding = 7, rgba32f) uniform writeonly image2D shafts;
layout(constant_id = 2) const uint MOST_PARTS = 2u; // that a tile is worked on in

layout(set = 0, binding = 8, std430) buffer PartArguments {
    TileArguments parts;
};
layout(set = 0, binding = 9, r32ui) uniform writeonly uimage2D part_list;
layout(set = 0, binding = 10, rgba32f) uniform readonly image2D tile_bounds;

#include "shaft_masks/hull.glsl"

vec4 fetch_triangle_texel(uint texel) {
    return imageLoad(triangles, triangle_texel_place(texel));
}

// Nothing is fetched from these here.
vec4 fetch_node_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_shaft_texel(ivec2 place) {
    return vec4(0.0);
}

// Least gap in the depths of a tile that is worked on in two parts, as a part of all of its depth.
const float LEAST_GAP = 0.3;
// Normals whose coordinates differ by less are one.
const float SAME_NORMAL = 1.0e-6;

// The geometric normal of a surface on the side that is seen. id: of its triangle, plus one.
vec3 fetch_normal(uint id, vec3 ray) {
    vec3 n = fetch_geometric_normal(max(id, 1u) - 1u);
    return dot(n, ray) > 0.0 ? -n : n;
}

// Whether a pixel's point lies within its triangle, or there is nothing.
bool is_within_triangle(uvec2 pixel) {
    vec3 p = view.camera.eye.xyz + imageLoad(view_depth, ivec2(pixel)).x * pixel_ray(view.camera, pixel);
    return way_into_triangle(p, imageLoad(ids, ivec2(pixel)).x) == vec3(0.0);
}

// Whether all of the light is below a surface's own plane, which then hides all samples: nothing else matters to it.
// Masks are made of such pixels all the same; other techniques, which leave tiles whole, may want more of them.
bool is_turned_away(Light light, vec3 p, vec3 n) {
    vec3 to_light = light_offset(light, p);
    float reach = LIGHT_SHAPE == LIGHT_SPHERE ? light.axis_x.w
        : dot(abs(vec2(dot(n, light.axis_x.xyz), dot(n, light.axis_y.xyz))), light_half_size(light).xy);
    return MOST_PARTS > 1u && dot(n, to_light) < -reach - SLACK * length(to_light);
}

// Axes of a box that fits flat surfaces: along the normal of the surface at a pixel, and along the view.
mat3 surface_frame(uvec2 pixel, vec3 ray) {
    uint id = imageLoad(ids, ivec2(pixel)).x;
    vec3 z = fetch_geometric_normal(max(id, 1u) - 1u);
    vec3 along = cross(z, ray);
    float square = dot(along, along);
    vec3 other = abs(z.x) < 0.7 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0);
    vec3 x = square > 0.0 ? along * inversesqrt(square) : normalize(cross(z, other));
    return mat3(x, cross(z, x), z);
}

// How far rounding may move a point of a triangle along its ray, metres: view depth is a quotient of two
// distances from the triangle's plane, small ones where it is seen at a grazing angle.
float depth_rounding_m(uvec2 pixel, float farthest) {
    uint id = imageLoad(ids, ivec2(pixel)).x;
    vec3 from_eye = fetch_triangle_texel(4u * (max(id, 1u) - 1u)).xyz - view.camera.eye.xyz;
    vec3 n = fetch_geometric_normal(max(id, 1u) - 1u);
    float far_m = farthest * length(vec2(view.camera.pixel_right.w * length(view.camera.pixel_right.xyz),
        view.camera.pixel_down.w * length(view.camera.pixel_down.xyz)) + 1.0);
    float away = abs(dot(n, from_eye));
    float part = SLACK * (length(from_eye) + 2.0 * far_m);
    return part < away ? far_m * part / away : far_m;
}

// Whether a tile shows one triangle, or nothing, and the points at its corners lie within the triangle: then so do all,
// between those at the corners.
bool corners_tell(uvec2 tile, TileBounds bounds) {
    bool within = bounds.one_triangle;
    for (uint i = 0u; i < 4u; ++i) {
        uvec2 corner = (TILE_SIZE - 1u) * uvec2(i & 1u, i >> 1);
        within = within && is_within_triangle(min(tile * TILE_SIZE + corner, params.counts.xy - 1u));
    }
    return within;
}

TileBounds fetch_bounds(uvec2 tile) {
    ivec2 place = ivec2(tile.x * TILE_TEXELS, tile.y);
    return tile_bounds_of(imageLoad(tile_bounds, place), imageLoad(tile_bounds, place + ivec2(1, 0)),
        imageLoad(tile_bounds, place + ivec2(2, 0)));
}

// The shaft of a tile's pixels of these view depths. at: one of them, for the frames. across: pixels that are looked at
// in each row and column, all of them or the first and the last.
void store_shaft(Light light, uvec2 tile, uvec2 tiles, TileBounds bounds, vec2 depths, uvec2 at, bool behind, uint across) {
    uvec2 size = params.counts.xy;
    vec3 eye = view.camera.eye.xyz;
    vec3 base = eye + imageLoad(view_depth, ivec2(at)).x * pixel_ray(view.camera, at);
    mat3 frame = light_frame(light, base);
    mat3 box_frame = surface_frame(at, pixel_ray(view.camera, at));

    // Coordinates of a sun's frame are taken from the eye, of other lights from their centre.
    vec3 origin = LIGHT_SHAPE == LIGHT_SUN ? eye : light.center.xyz;
    vec3 half_size = light_half_size(light);
    vec3 light_reach = abs(frame[0]) * half_size.x + abs(frame[1]) * half_size.y
        + abs(frame[2]) * half_size.z;
    vec3 low = vec3(FAR);
    vec3 high = vec3(-FAR);
    vec3 own_low = vec3(FAR);
    vec3 own_high = vec3(-FAR);
    vec3 box_low = vec3(FAR);
    vec3 box_high = vec3(-FAR);
    vec3 normal_low = vec3(2.0);
    vec3 normal_high = vec3(-2.0);
    bool above = true;
    bool any = false;
    vec3 some = base;
    vec3 normal = vec3(0.0);
    float plane_low = FAR;
    float plane_high = -FAR;
    uint step = (TILE_SIZE - 1u) / (across - 1u);
    for (uint i = 0u; i < across * across; ++i) {
        uvec2 pixel = min(tile * TILE_SIZE + step * uvec2(i % across, i / across), size - 1u);
        float depth = imageLoad(view_depth, ivec2(pixel)).x;
        uint id = imageLoad(ids, ivec2(pixel)).x;
        if (depth > 0.0 && is_in_part(depths, depth)) {
            vec3 ray = pixel_ray(view.camera, pixel);
            vec3 p = eye + depth * ray;
            p += way_into_triangle(p, id);
            vec3 n = fetch_normal(id, ray);
            vec3 to_light = light_offset(light, p);
            above = above && dot(n, to_light) > dot(abs(n), light_reach) + SLACK * length(to_light);
            if (is_turned_away(light, p, n)) {
                continue;
            }
            some = any ? some : p;
            any = true;
            normal = normal == vec3(0.0) ? n : normal;
            normal_low = min(normal_low, n);
            normal_high = max(normal_high, n);
            plane_low = min(plane_low, dot(normal, p));
            plane_high = max(plane_high, dot(normal, p));
            box_low = min(box_low, p);
            box_high = max(box_high, p);
            vec3 q = (p - origin) * frame;
            low = min(low, q);
            high = max(high, q);
            vec3 own = (p - base) * box_frame;
            own_low = min(own_low, own);
            own_high = max(own_high, own);
        }
    }
    float between_m = bounds.one_triangle ? depth_rounding_m(at, bounds.farthest) : 0.0;
    vec3 extent = max(max(abs(box_low), abs(box_high)), abs(eye));
    if (LIGHT_SHAPE != LIGHT_SUN) {
        extent = max(extent, abs(light.center.xyz) + light_reach);
    }
    float extent_m = max(extent.x, max(extent.y, extent.z));
    float slack = SLACK * 4.0 * extent_m;
    low -= slack + between_m;
    high += slack + between_m;

    uvec2 part = uvec2(tile.x, tile.y + (behind ? tiles.y : 0u));
    ivec2 place = ivec2(part.x * SHAFT_TEXELS, part.y);
    vec3 own_slack = vec3(vec2(slack + between_m), slack); // depths are off along the rays, not across the surface
    vec2 sphere = store_surfaces(place + ivec2(SHAFT_PLANES + 2u, 0), light, base, some, box_frame,
        own_low - own_slack, own_high + own_slack, slack, depths);

    vec4 planes[SHAFT_PLANES];
    set_hull(planes, light, frame, origin, low, high, sphere, slack);
    // Where all surfaces lie in one plane, what does not rise above it blocks nothing.
    float rounding = POSITION_ROUNDING * extent_m;
    bool flat_tile = all(lessThan(normal_high - normal_low, vec3(SAME_NORMAL)))
        && plane_high - plane_low <= 4.0 * rounding;
    bool turned = dot(box_frame[2], pixel_ray(view.camera, at)) > 0.0;
    planes[6] = flat_tile ? vec4(-normal, -plane_high - rounding)
        : plane_below(light, light_reach, base, turned ? -box_frame[2] : box_frame[2],
            turned ? -own_high.z : own_low.z, slack);

    if (LIGHT_SHAPE == LIGHT_SUN) {
        // A box around a cone without end has sides at most where no direction leads.
        vec3 reach = abs(frame[0]) * half_size.x + abs(frame[1]) * half_size.y;
        box_low = mix(box_low - between_m, vec3(-FAR), lessThan(frame[2] - reach, vec3(SLACK)));
        box_high = mix(box_high + between_m, vec3(FAR), greaterThan(frame[2] + reach, vec3(-SLACK)));
    } else {
        box_low = min(box_low - between_m, light.center.xyz - light_reach);
        box_high = max(box_high + between_m, light.center.xyz + light_reach);
    }
    store_planes(place, planes, vec4(box_low - slack, !any ? -1.0 : above ? 1.0 : 0.0), vec4(box_high + slack, 0.0));
    store_normals(place, normal_low, normal_high, some);
    uint slot = atomicAdd(parts.count, 1u);
    atomicMax(parts.groups_x, slot / PARTS_A_GROUP + 1u);
    imageStore(part_list, tile_entry_place(slot, tiles), uvec4(part.y * tiles.x + part.x));
}

#endif
