#version 460
// Soft Shadow Occlusion Camera (Mo, Popescu, Wyman): the part of the light that silhouette edges near
// a receiver's place in the light's image leave free.
//
// The paper's displacement d = (w - delta) / 2 of the receiver's place has d / w = 1 - t, the hidden
// part of the light's diameter. Here t comes from the plane through receiver and edge, which is the
// same for an edge parallel to the light and exact for inclined ones; d still says where to look for
// further edges.

#include "common/combine.glsl"
#include "common/light_above.glsl"
#include "common/octahedral.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "silhouettes/edges.glsl"
#include "ssoc/params.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(constant_id = 0) const uint LIGHT_SHAPE = 0u;
layout(constant_id = 1) const uint LOOKUPS = 4u;
// 0: by how edges lie to each other; 1: product; 2: least; 3: AND for all; 4: OR for all.
layout(constant_id = 2) const uint COMBINE = 0u;
// 1: 3 t^2 - 2 t^3 instead of the disk's area.
layout(constant_id = 3) const uint CUBIC = 0u;
layout(constant_id = 4) const float SNAP_TEXELS = 4.0 / 256.0;

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

const float DEPTH_ROUNDING = 1.0 / 1048576.0;
// What heights over the receiver's plane are rounded by, as a part of the coordinates.
const float PLANE_ROUNDING = 4.0e-6;
// What the stored normal is rounded by, as an angle.
const float NORMAL_ROUNDING = 1.0e-4;

uvec4 fetch_edge_texel(ivec2 at) {
    return texelFetch(edges, at, 0);
}

vec4 fetch_point_texel(ivec2 at) {
    return texelFetch(points, at, 0);
}

vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0);
}

struct Place {
    vec3 p;      // receiver, scene space, metres
    vec3 n;      // its unit normal
    vec2 at;     // in the view's units
    float depth; // along the view direction, inverse in a perspective view
    vec3 plane;  // stored depth of the receiver's plane, and its change across the map
    vec2 map;    // its place in the map
    uint view;
};

// An edge as one receiver sees it.
struct Seen {
    uint number;   // one more than the edge's; 0 for none
    vec2 nearest;  // point of the edge nearest to the receiver's place, in the view's units
    vec2 outward;  // unit vector away from the blocker
    float delta;   // distance of the receiver's place from the edge's line, positive outside
    float width;   // half width of the penumbra there
    float depth;   // of the nearest point, inverse in a perspective view
    float seen;    // part of the light beyond the edge
};

Seen no_edge() {
    return Seen(0u, vec2(0.0), vec2(0.0), 0.0, 0.0, 0.0, 1.0);
}

uint edge_at(Place here, LightView light_view, vec2 at, bool inner) {
    vec2 map = (at - vec2(light_view.right.w, light_view.up.w)) * light_view.scale.xy;
    if (any(notEqual(map, clamp(map, 0.0, 1.0)))) {
        return 0u;
    }
    float size = float(params.counts.y);
    ivec2 texel = ivec2(min(map * size, size - 1.0));
    texel.x += inner ? int(params.counts.y) : 0;
    return texelFetch(map_edges, ivec3(texel, int(here.view)), 0).x;
}

vec3 in_view(LightView light_view, vec3 q) {
    return vec3(dot(q, light_view.right.xyz), dot(q, light_view.up.xyz), dot(q, light_view.forward.xyz));
}

float face_side(bool perspective, vec3 a, vec3 b, vec3 face) {
    return perspective ? dot(cross(a, b), face) : cross(b - a, face - a).z;
}

float part_of_disk(float t) {
    return CUBIC != 0u ? t * t * (3.0 - 2.0 * t) : disk_above(2.0 * t - 1.0);
}

// Whether any of an edge is above the receiver's tangent plane, where the light that counts is: a
// floor's own border hides nothing from the floor.
bool over_receiver(Place here, vec3 first, vec3 second) {
    vec3 a = first - here.p;
    vec3 b = second - here.p;
    vec3 largest = max(abs(here.p), max(abs(first), abs(second)));
    float slack = PLANE_ROUNDING * (largest.x + largest.y + largest.z);
    return dot(here.n, a) > slack + NORMAL_ROUNDING * length(a)
        || dot(here.n, b) > slack + NORMAL_ROUNDING * length(b);
}

// What an edge does to the receiver; none where it is not in front of it.
Seen look_at(Place here, LightView light_view, uint number) {
    Seen found = no_edge();
    if (number == 0u) {
        return found;
    }
    bool perspective = light_view.forward.w > 0.0;
    vec3 origin = perspective ? view.light.center.xyz : vec3(0.0);
    uvec4 edge = fetch_edge(number - 1u);
    vec3 first = fetch_point(edge.x).xyz;
    vec3 second = fetch_point(edge.y).xyz;
    vec3 a = in_view(light_view, first - origin);
    vec3 b = in_view(light_view, second - origin);
    float faces = face_side(perspective, a, b, in_view(light_view, fetch_point(edge.z).xyz - origin));
    if (edge.w < MORE_FACES) {
        vec3 face = in_view(light_view, fetch_point(edge.w).xyz - origin);
        float other = face_side(perspective, a, b, face);
        faces = abs(other) > abs(faces) ? other : faces;
    }
    if (perspective) {
        float near = params.reach.z;
        if (max(a.z, b.z) <= near) {
            return found;
        }
        a = a.z < near ? mix(b, a, (b.z - near) / (b.z - a.z)) : a;
        b = b.z < near ? mix(a, b, (a.z - near) / (a.z - b.z)) : b;
    }
    vec2 from = perspective ? a.xy / a.z : a.xy;
    vec2 to = perspective ? b.xy / b.z : b.xy;
    vec2 depths = perspective ? 1.0 / vec2(a.z, b.z) : vec2(a.z, b.z);
    vec2 along = to - from;
    float size = length(along);
    float t = clamp(dot(here.at - from, along) / max(size * size, 1.0e-38), 0.0, 1.0);
    found.nearest = mix(from, to, t);
    found.depth = mix(depths.x, depths.y, t);
    vec2 unit = size > 0.0 ? along / size : vec2(1.0, 0.0);
    found.outward = vec2(-unit.y, unit.x) * (faces > 0.0 ? -1.0 : 1.0);
    found.delta = dot(here.at - found.nearest, found.outward);
    found.width = penumbra_half_width(params.reach.x, perspective, found.depth, here.depth, found.nearest);
    float apart = perspective ? found.depth - here.depth : here.depth - found.depth;
    if (apart <= 1.0e-5 * abs(here.depth) || !over_receiver(here, first, second)) {
        return found;
    }
    found.number = number;
    // The plane through receiver and edge, its normal away from the blocker.
    float handed = dot(cross(light_view.right.xyz, light_view.up.xyz), light_view.forward.xyz);
    vec3 normal = cross(first - here.p, second - here.p) * (faces * handed > 0.0 ? 1.0 : -1.0);
    float length_m2 = length(normal);
    if (length_m2 > 0.0) {
        normal /= length_m2;
        if (LIGHT_SHAPE == LIGHT_POINT || found.width <= 0.0) {
            found.seen = found.delta > 0.0 ? 1.0 : 0.0;
        } else if (CUBIC != 0u) {
            float part = clamp(0.5 + 0.5 * found.delta / found.width, 0.0, 1.0);
            found.seen = part_of_disk(part);
        } else {
            found.seen = light_above(view.light, LIGHT_SHAPE, here.p, normal);
        }
    }
    return found;
}

bool same_line(Seen a, Seen b, float texel) {
    return a.number == b.number
        || (dot(a.outward, b.outward) > 0.95
            && abs(dot(a.outward, b.nearest - a.nearest)) < 1.5 * texel + 0.05 * a.width);
}

float combined(Seen a, Seen b, float seen) {
    float along = dot(a.outward, b.outward);
    vec2 apart = b.nearest - a.nearest;
    bool either = dot(apart, a.outward) <= 0.0 && dot(apart, b.outward) >= 0.0;
    if (COMBINE == 1u) {
        return seen * b.seen;
    } else if (COMBINE == 2u) {
        return min(seen, b.seen);
    } else if (COMBINE == 3u) {
        return visibility_and(seen, b.seen, along);
    } else if (COMBINE == 4u) {
        return 1.0 - visibility_and(1.0 - seen, 1.0 - b.seen, along);
    }
    bool one_blocker = abs(a.depth - b.depth) < 0.3 * max(abs(a.depth), abs(b.depth));
    return either && one_blocker
        ? 1.0 - visibility_and(1.0 - seen, 1.0 - b.seen, along)
        : visibility_and(seen, b.seen, along);
}

bool blocked_at(Place here, LightView light_view) {
    float size = float(params.counts.y);
    vec2 texel = clamp(floor(here.map * size), 0.0, size - 1.0);
    float stored = texelFetch(map_depth, ivec3(ivec2(texel), int(here.view)), 0).x;
    vec2 apart = (texel + 0.5) / size - here.map;
    float expected = here.plane.x + dot(here.plane.yz, apart);
    float slack = (abs(here.plane.y) + abs(here.plane.z)) / size * SNAP_TEXELS
        + abs(here.plane.x) * DEPTH_ROUNDING;
    return stored > expected + slack;
}

float soft(Place here, LightView light_view) {
    bool blocked = blocked_at(here, light_view);
    float hard = blocked ? 0.0 : 1.0;
    uint number = edge_at(here, light_view, here.at, blocked);
    // Far from any edge the map alone decides.
    if (number == 0u) {
        return hard;
    }
    float size = float(params.counts.y);
    float texel = max(abs(1.0 / light_view.scale.x), abs(1.0 / light_view.scale.y)) / size;
    Seen first = look_at(here, light_view, number);
    if (first.number == 0u) {
        return hard;
    }
    float seen = first.seen;
    float delta = clamp(first.delta, -first.width, first.width);
    float displaced = 0.5 * (first.width - delta);
    vec2 across = first.outward;
    vec2 tangent = vec2(-across.y, across.x);
    // The warped point, the other side of a narrow blocker, the other map here, around both ends of
    // the edge: at each the edges of both maps.
    vec2 places[6] = vec2[](
        here.at,
        here.at + displaced * across,
        here.at - (first.width + delta) * across,
        here.at,
        first.nearest + first.width * tangent,
        first.nearest - first.width * tangent
    );
    Seen used[4];
    uint count = 0u;
    for (uint i = 1u; i < LOOKUPS; ++i) {
        for (uint side = 0u; side < 2u && count < 4u; ++side) {
            uint next = edge_at(here, light_view, places[i], side == 1u);
            Seen other = look_at(here, light_view, next);
            bool again = other.number == 0u || same_line(first, other, texel);
            for (uint j = 0u; j < count; ++j) {
                again = again || same_line(used[j], other, texel);
            }
            if (!again) {
                seen = combined(first, other, seen);
                used[count] = other;
                count += 1u;
            }
        }
    }
    // Something else than this edge's blocker hides the light's centre: with no edge of it near, all
    // of the light.
    if (blocked && first.delta > 1.5 * texel && count == 0u) {
        seen = 0.0;
    }
    return clamp(seen, 0.0, 1.0);
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
            vec2 in_units = at.xy / light_view.scale.xy + vec2(light_view.right.w, light_view.up.w);
            float z = dot(q, light_view.forward.xyz);
            float stored = light_view.forward.w > 0.0 ? 1.0 / z : z;
            Place here = Place(p, n, in_units, stored, plane, at.xy, found);
            result = visibility_and(soft(here, light_view), above, 0.0);
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
