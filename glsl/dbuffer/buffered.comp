#version 460
// Visibility from the D-buffer (Jakobsen et al. 2004, section 4): the umbra's surface where the light's
// centre is hidden, the penumbra's where it is seen.
//
// Published are three distances along the ray from the light's centre, from which t, the part of the
// light's diameter that is seen, follows by similar triangles (equation 3, with the denominators and
// branches that it must have). That is right for an edge parallel to the light. A texel may hold the
// edge instead: its image on the light, as seen from the receiver, gives t for every edge, and which way it
// faces, so that several edges can be joined.

#include "common/combine.glsl"
#include "common/light_above.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "dbuffer/buffer.glsl"
#include "dbuffer/params.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std140) uniform View {
    ViewParams view;
};
// Only for coverage.glsl, whose samples are not used.
layout(set = 0, binding = 1, std140) uniform Block {
    DbufferParams params;
};
layout(set = 0, binding = 2, std140) uniform Buffer {
    BufferParams dbuffer;
};
layout(set = 0, binding = 3) uniform sampler2D view_depth;
layout(set = 0, binding = 4) uniform usampler2D ids;
layout(set = 0, binding = 5) uniform sampler2D triangles;
layout(set = 0, binding = 6) uniform usampler2D edges;
layout(set = 0, binding = 7) uniform sampler2D points;
layout(set = 0, binding = 8) uniform sampler2D hard;
layout(set = 0, binding = 9) uniform usampler2DArray umbra0;
layout(set = 0, binding = 10) uniform usampler2DArray umbra1;
layout(set = 0, binding = 11) uniform usampler2DArray umbra2;
layout(set = 0, binding = 12) uniform usampler2DArray umbra3;
layout(set = 0, binding = 13) uniform usampler2DArray penumbra0;
layout(set = 0, binding = 14) uniform usampler2DArray penumbra1;
layout(set = 0, binding = 15) uniform usampler2DArray penumbra2;
layout(set = 0, binding = 16) uniform usampler2DArray penumbra3;
layout(set = 0, binding = 17, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 18, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 19) uniform usampler2D list;

layout(push_constant) uniform Push {
    uint edges;   // 1: texels hold edges, 0: distances
    uint layers;
    uint darkest; // 1: of each blocker the first, of these the darkest; 0: all joined
    uint curve;   // 0: exact area, 1: 3 t^2 - 2 t^3, 2: the square root of t
} push;

#include "dbuffer/coverage.glsl"

const float POSITION_ROUNDING = 1.0 / 2097152.0;

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

uvec4 fetch_edge_texel(ivec2 place) {
    return texelFetch(edges, place, 0);
}

vec4 fetch_point_texel(ivec2 place) {
    return texelFetch(points, place, 0);
}

uvec2 fetch_surface(uint layer, bool umbra, ivec3 place) {
    if (umbra) {
        return layer == 0u ? texelFetch(umbra0, place, 0).xy
            : layer == 1u ? texelFetch(umbra1, place, 0).xy
            : layer == 2u ? texelFetch(umbra2, place, 0).xy : texelFetch(umbra3, place, 0).xy;
    }
    return layer == 0u ? texelFetch(penumbra0, place, 0).xy
        : layer == 1u ? texelFetch(penumbra1, place, 0).xy
        : layer == 2u ? texelFetch(penumbra2, place, 0).xy : texelFetch(penumbra3, place, 0).xy;
}

float curve_of(float t) {
    t = clamp(t, 0.0, 1.0);
    return push.curve == 0u ? disk_above(2.0 * t - 1.0)
        : push.curve == 1u ? t * t * (3.0 - 2.0 * t) : sqrt(t);
}

struct Crossing {
    bool between;  // the edge is between the receiver and the light
    float t;       // part of the diameter that is seen past it
    vec2 nearest;  // point of the edge's image on the unit disk nearest to its centre
    vec2 open;     // unit vector across the edge, towards what is seen
    uint blocker;
    bool is_weak;  // hides nothing beside another edge of the blocker
};

// As published. distance: of the receiver from the light's centre, of a sun the depth from where stored
// depth begins.
Crossing crossing_at_distances(uvec2 stored, bool umbra, float distance) {
    float surface = uintBitsToFloat(stored.x);
    float silhouette = surface * float(stored.y >> 16) / MOST_PART;
    Crossing found = Crossing(distance > silhouette, 0.0, vec2(0.0), vec2(0.0), stored.y & 0xffffu, false);
    float part = LIGHT_SHAPE == LIGHT_SUN
        ? (distance - surface) / (2.0 * (distance - silhouette))
        : silhouette * (distance - surface) / (2.0 * surface * (distance - silhouette));
    found.t = umbra ? part : 1.0 - part;
    return found;
}

Crossing crossing_at_edge(CoverageReceiver r, uvec2 stored, bool umbra) {
    Crossing found = Crossing(true, 0.5, vec2(0.0), vec2(0.0), stored.y, false);
    if (stored.x == NO_EDGE) {
        return found;
    }
    uvec4 edge = fetch_edge(stored.x - 1u);
    vec3 world_a = fetch_point(edge.x).xyz;
    vec3 world_b = fetch_point(edge.y).xyz;
    vec3 a = world_a - r.p;
    vec3 b = world_b - r.p;
    vec3 on_a = on_light(r, a);
    vec3 on_b = on_light(r, b);
    vec2 range = vec2(0.0, 1.0);
    cut(dot(r.n, a) - r.rounding_m, dot(r.n, b) - r.rounding_m, range);
    float least = r.rounding_m * length(r.row_w);
    cut(on_a.z - least, on_b.z - least, range);
    if (LIGHT_SHAPE != LIGHT_SUN) {
        cut(1.0 - on_a.z, 1.0 - on_b.z, range);
    }
    found.between = range.x < range.y;
    if (!found.between) {
        return found;
    }
    vec3 end_a = mix(on_a, on_b, range.x);
    vec3 end_b = mix(on_a, on_b, range.y);
    vec2 from = end_a.xy / end_a.z;
    vec2 along = end_b.xy / end_b.z - from;
    float square = dot(along, along);
    float part = square > 0.0 ? clamp(-dot(from, along) / square, 0.0, 1.0) : 0.0;
    found.nearest = from + part * along;
    // Seen from here the edge is no outline; or its volume is closed around its end, where the light's centre is
    // free, for receivers off a corner.
    bool at_end = !umbra && (part <= 0.0 || part >= 1.0);
    found.is_weak = at_end || faces_on_one_side(r.p, r.turn, edge, world_a, world_b) == 0.0;
    float off = length(found.nearest);
    vec2 way = off > 0.0 ? found.nearest / off : vec2(-along.y, along.x) * inversesqrt(max(square, 1.0e-30));
    found.open = umbra ? way : -way;
    found.t = umbra ? 0.5 - 0.5 * off : 0.5 + 0.5 * off;
    return found;
}

// Joins what is seen past one more edge, the nearest surface of a blocker first. Light passes either of two
// edges of one blocker, as at a convex corner or a strip, unless each lies on the other's open side, as at a
// reflex corner; it passes all blockers.
float joined(float seen, Crossing one, float past, Crossing other) {
    float along = dot(one.open, other.open);
    vec2 apart = other.nearest - one.nearest;
    bool reflex = dot(apart, one.open) > 0.0 && dot(apart, other.open) < 0.0;
    return one.blocker == other.blocker && !reflex
        ? 1.0 - visibility_and(1.0 - seen, 1.0 - past, along)
        : visibility_and(seen, past, along);
}

// Whether two edges of a blocker that leaves the light's centre free bound a strip: the other one's umbra
// crosses the ray.
bool is_strip(Crossing one, Crossing other) {
    vec2 apart = other.nearest - one.nearest;
    return one.blocker == other.blocker && dot(apart, one.open) < 0.0 && dot(apart, other.open) > 0.0;
}

// Edges of a blocker that face nearly the same way are on one side of it: the first of them tells what is
// seen past that side.
const float ONE_SIDE = 0.7;

bool is_same_side(Crossing one, Crossing other) {
    return one.blocker == other.blocker && dot(one.open, other.open) > ONE_SIDE;
}

float pixel_visibility(uvec2 pixel) {
    float depth = texelFetch(view_depth, ivec2(pixel), 0).x;
    uint id = texelFetch(ids, ivec2(pixel), 0).x;
    if (id == 0u) {
        return 1.0;
    }
    vec3 ray = pixel_ray(view.camera, pixel);
    vec3 p = view.camera.eye.xyz + depth * ray;
    p += way_into_triangle(p, id);
    vec3 n = fetch_geometric_normal(id - 1u);
    n = dot(n, ray) > 0.0 ? -n : n;
    bool sun = LIGHT_SHAPE == LIGHT_SUN;
    float above = light_above(view.light, LIGHT_SHAPE, p, n);
    vec3 offset = light_offset(view.light, p);
    bool behind = LIGHT_SHAPE == LIGHT_DISK && dot(offset, view.light.direction.xyz) >= 0.0;
    // Below the receiver's plane the light's centre is no guide: what its own surface leaves is seen.
    if (above <= 0.0 || behind || dot(n, offset) <= 0.0) {
        return behind ? texelFetch(hard, ivec2(pixel), 0).x : above;
    }
    vec3 q = sun ? p : -offset;
    uint index = 0u;
    vec3 at = light_view_project(dbuffer.views[0], q);
    while (index + 1u < dbuffer.counts.x && any(notEqual(at.xy, clamp(at.xy, 0.0, 1.0)))) {
        index += 1u;
        at = light_view_project(dbuffer.views[index], q);
    }
    bool umbra = texelFetch(hard, ivec2(pixel), 0).x <= 0.0;
    float result = umbra ? 0.0 : 1.0;
    if (dbuffer.counts.x == 0u || any(notEqual(at.xy, clamp(at.xy, 0.0, 1.0)))) {
        return min(result, above);
    }
    vec3 extent = max(max(abs(p), abs(view.camera.eye.xyz)), sun ? vec3(0.0) : abs(view.light.center.xyz));
    float rounding_m = POSITION_ROUNDING * max(extent.x, max(extent.y, extent.z));
    CoverageReceiver r = coverage_receiver(view.light, p, n, rounding_m);
    float distance = sun ? dot(p, dbuffer.axis_z.xyz) - dbuffer.axis_y.w : length(offset);
    float size = float(dbuffer.counts.y);
    ivec3 place = ivec3(ivec2(min(at.xy * size, size - 1.0)), int(index));

    Crossing kept[8]; // of both kinds
    uint count = 0u;
    // What hides nothing beside others counts only where there are none, after all have been looked at.
    bool weak_last = push.edges != 0u && push.darkest == 0u;
    for (uint turn = 0u; turn < 2u * push.layers; ++turn) {
        bool weak = turn >= push.layers;
        uvec2 stored = fetch_surface(turn % push.layers, umbra, place);
        if (stored.x == 0u) {
            continue;
        }
        Crossing found = push.edges != 0u
            ? crossing_at_edge(r, stored, umbra)
            : crossing_at_distances(stored, umbra, distance);
        float seen = curve_of(found.t);
        bool known = false;
        bool side = false;
        for (uint i = 0u; i < count; ++i) {
            known = known || kept[i].blocker == found.blocker;
            side = side || is_same_side(kept[i], found);
        }
        bool again = push.darkest != 0u || weak ? known : push.edges != 0u && side;
        if (!found.between || again || (weak_last && found.is_weak) != weak) {
            continue;
        }
        if (count == 0u) {
            result = seen;
        } else if (push.darkest != 0u || push.edges == 0u) {
            result = min(result, seen);
        } else {
            result = joined(result, kept[count - 1u], seen, found);
        }
        kept[count] = found;
        count += 1u;
    }
    // Edges of whose surfaces the ray crosses those of the other kind: the far edge of a strip, and other
    // blockers that leave the light's centre free.
    uint own = count;
    bool others = push.darkest == 0u && push.edges != 0u && push.layers > 1u;
    for (uint layer = 0u; others && layer < push.layers && count > 0u; ++layer) {
        uvec2 stored = fetch_surface(layer, !umbra, place);
        if (stored.x == 0u || stored.x == NO_EDGE) {
            break;
        }
        Crossing found = crossing_at_edge(r, stored, !umbra);
        float seen = curve_of(found.t);
        bool matters = umbra ? found.blocker != kept[0].blocker : is_strip(kept[0], found);
        bool side = false;
        for (uint i = own; i < count; ++i) {
            side = side || is_same_side(kept[i], found);
        }
        if (found.between && matters && !side && !found.is_weak) {
            result = joined(result, kept[0], seen, found);
            kept[count] = found;
            count += 1u;
        }
    }
    return min(clamp(result, 0.0, 1.0), above);
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 size = params.counts.xy;
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 pixel = tile_of_entry(entry, tiles) * TILE_SIZE + gl_LocalInvocationID.xy;
    if (any(greaterThanEqual(pixel, size))) {
        return;
    }
    imageStore(visibility, ivec2(pixel), vec4(pixel_visibility(pixel)));
}
