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

const float FAR = 1.0e38;
// Room for rounding, as a part of the coordinates that go into a plane.
const float SLACK = 1.0e-6;
// Least gap in the depths of a tile that is worked on in two parts, as a part of all of its depth.
const float LEAST_GAP = 0.3;
// Normals whose coordinates differ by less are one.
const float SAME_NORMAL = 1.0e-6;

// The side of the hull of two boxes towards +a in the plane of a and z. light: half its size along a
// and z; near: least z of the surfaces, reach: their largest a and z. Returns the outward normal along a
// and z and the offset.
vec3 hull_side(vec2 light_half, float reach_a, float near_z, float far_z) {
    if (LIGHT_SHAPE == LIGHT_SUN) {
        float slope = light_half.x;
        return vec3(1.0, -slope, reach_a - slope * near_z);
    }
    float rise = 0.5 * (near_z + far_z);
    float run = reach_a - light_half.x;
    // The corners that the edge runs between are both at the far or at the near side along z.
    float side = (rise < 0.0) == (run < 0.0) ? -1.0 : 1.0;
    rise = (side < 0.0 ? near_z : far_z) - side * light_half.y;
    vec2 normal = rise < 0.0 ? vec2(-rise, run) : vec2(rise, -run);
    float scale = max(abs(normal.x), abs(normal.y));
    normal = scale > 0.0 ? normal / scale : vec2(1.0, 0.0);
    float light = normal.x * light_half.x + abs(normal.y) * light_half.y;
    float surfaces = normal.x * reach_a + max(normal.y * near_z, normal.y * far_z);
    return vec3(normal, max(light, surfaces));
}

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

// Surfaces of shaft_masks/sides.glsl. low, high: of the box in its frame, from its base. some: one of them. Returns how
// far from a sphere's centre towards them what is nearer to it hides nothing, and how far directions to them differ.
vec2 store_surfaces(ivec2 place, Light light, vec3 base, vec3 some, mat3 frame, vec3 low, vec3 high, float slack,
    vec2 depths) {
    vec3 center = base + frame * (0.5 * low + 0.5 * high);
    vec3 half_size = 0.5 * high - 0.5 * low;
    float radius = length(half_size);
    vec3 z = LIGHT_SHAPE == LIGHT_SUN ? light.center.xyz : light.direction.xyz;
    float tilt = 0.0;
    float least = LIGHT_SHAPE == LIGHT_SUN ? dot(abs(z * frame), half_size) + slack : slack;
    float most = FAR;
    float end = -FAR;
    if (LIGHT_SHAPE == LIGHT_SPHERE) {
        vec3 from = center - light.center.xyz;
        float away = length(from);
        float nearest = away - radius;
        bool outside = nearest > light.axis_x.w;
        z = outside ? from / away : z;
        // The samples' disk is across the line to the surface, radius^2 / distance from the centre.
        tilt = outside ? 2.0 * radius / away : 0.0;
        float square = light.axis_x.w * light.axis_x.w;
        least = outside ? square / nearest + slack : FAR;
        end = outside ? square / (away + radius) - slack : -FAR;
    }
    if (LIGHT_SHAPE == LIGHT_POINT || LIGHT_SHAPE == LIGHT_LINE) {
        least = FAR; // their samples span no plane
    } else if (LIGHT_SHAPE != LIGHT_SUN) {
        most = dot(center - light.center.xyz, z) - dot(abs(z * frame), half_size) - slack;
    }
    // Of no size: the samples span no plane either.
    if (min(light.axis_x.w, light.axis_y.w) < 1.0e-30) {
        least = FAR;
    }
    imageStore(shafts, place, vec4(center, slack));
    imageStore(shafts, place + ivec2(1, 0), vec4(frame[0] * half_size.x, depths.x));
    imageStore(shafts, place + ivec2(2, 0), vec4(frame[1] * half_size.y, depths.y));
    imageStore(shafts, place + ivec2(3, 0), vec4(frame[2] * half_size.z, some.x));
    imageStore(shafts, place + ivec2(4, 0), vec4(z, tilt));
    imageStore(shafts, place + ivec2(5, 0), vec4(least, most, radius, end));
    return vec2(end, tilt);
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
    vec3 right = hull_side(half_size.xz, high.x, low.z, high.z);
    vec3 left = hull_side(half_size.xz, -low.x, low.z, high.z);
    vec3 up = hull_side(half_size.yz, high.y, low.z, high.z);
    vec3 down = hull_side(half_size.yz, -low.y, low.z, high.z);
    planes[0] = vec4(right.x * frame[0] + right.y * frame[2], right.z);
    planes[1] = vec4(left.y * frame[2] - left.x * frame[0], left.z);
    planes[2] = vec4(up.x * frame[1] + up.y * frame[2], up.z);
    planes[3] = vec4(down.y * frame[2] - down.x * frame[1], down.z);
    float near_z = LIGHT_SHAPE == LIGHT_SUN ? low.z : min(low.z, -half_size.z);
    if (LIGHT_SHAPE == LIGHT_SPHERE) {
        // Of the hull at most as far from the centre as this is what is nearer to it than its samples.
        float aside = max(half_size.x, max(max(-low.x, high.x), max(-low.y, high.y)));
        near_z = max(near_z, min(low.z, sphere.x - 4.0 * sphere.y * aside));
    }
    planes[4] = vec4(-frame[2], -near_z);
    planes[5] = vec4(frame[2], max(high.z, half_size.z));
    if (LIGHT_SHAPE == LIGHT_SUN) {
        planes[5] = vec4(vec3(0.0), FAR);
    }
    for (uint i = 0u; i < 6u; ++i) {
        planes[i].w += dot(planes[i].xyz, origin) + slack;
    }
    // Where all surfaces lie in one plane, what does not rise above it blocks nothing.
    float rounding = POSITION_ROUNDING * extent_m;
    bool flat_tile = all(lessThan(normal_high - normal_low, vec3(SAME_NORMAL)))
        && plane_high - plane_low <= 4.0 * rounding;
    planes[6] = vec4(vec3(0.0), FAR);
    if (flat_tile) {
        planes[6] = vec4(-normal, -plane_high - rounding);
    } else {
        // Else what is below the lowest of them, where all of the light is above that.
        bool turned = dot(box_frame[2], pixel_ray(view.camera, at)) > 0.0;
        vec3 up = turned ? -box_frame[2] : box_frame[2];
        float lowest = turned ? -own_high.z : own_low.z;
        vec3 to_light = light_offset(light, base);
        bool is_above = dot(up, to_light) - dot(abs(up), light_reach)
            > (LIGHT_SHAPE == LIGHT_SUN ? SLACK : lowest + slack);
        planes[6] = is_above ? vec4(-up, slack - lowest - dot(up, base)) : planes[6];
    }

    if (LIGHT_SHAPE == LIGHT_SUN) {
        // A box around a cone without end has sides at most where no direction leads.
        vec3 reach = abs(frame[0]) * half_size.x + abs(frame[1]) * half_size.y;
        box_low = mix(box_low - between_m, vec3(-FAR), lessThan(frame[2] - reach, vec3(SLACK)));
        box_high = mix(box_high + between_m, vec3(FAR), greaterThan(frame[2] + reach, vec3(-SLACK)));
    } else {
        box_low = min(box_low - between_m, light.center.xyz - light_reach);
        box_high = max(box_high + between_m, light.center.xyz + light_reach);
    }
    imageStore(shafts, place + ivec2(SHAFT_PLANES + 8u, 0), vec4(normal_low, some.y));
    imageStore(shafts, place + ivec2(SHAFT_PLANES + 9u, 0), vec4(normal_high, some.z));
    for (uint i = 0u; i < SHAFT_PLANES; ++i) {
        imageStore(shafts, place + ivec2(i, 0), planes[i]);
    }
    vec4 first = vec4(box_low - slack, !any ? -1.0 : above ? 1.0 : 0.0);
    vec4 last = vec4(box_high + slack, 0.0);
    imageStore(shafts, place + ivec2(SHAFT_PLANES, 0), first);
    imageStore(shafts, place + ivec2(SHAFT_PLANES + 1u, 0), last);
    uint slot = atomicAdd(parts.count, 1u);
    atomicMax(parts.groups_x, slot / PARTS_A_GROUP + 1u);
    imageStore(part_list, tile_entry_place(slot, tiles), uvec4(part.y * tiles.x + part.x));
}

#endif
