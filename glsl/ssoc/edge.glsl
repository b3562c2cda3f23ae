// A silhouette edge as one receiver sees it, and the maps around the receiver's place.
#ifndef ANTUMBRA_SSOC_EDGE_GLSL
#define ANTUMBRA_SSOC_EDGE_GLSL

#include "common/light_above.glsl"
#include "common/view_params.glsl"
#include "hard/hard.glsl"
#include "silhouettes/edges.glsl"
#include "ssoc/params.glsl"

// What heights over the receiver's plane are rounded by, as a part of the coordinates.
const float PLANE_ROUNDING = 4.0e-6;
// What the stored normal is rounded by, as an angle.
const float NORMAL_ROUNDING = 1.0e-4;

// Defined by the entry file.
uint fetch_map_edge(ivec3 texel);
uint fetch_second_edge(ivec3 texel); // of those that another edge was before
float fetch_map_depth(ivec3 texel);

// The light as the disk that a receiver sees of it: offsets from the receiver to its centre and from
// there to its rim, metres, of a sun at distance 1.
struct LightDisk {
    vec3 center;
    vec3 x;
    vec3 y;
};

struct Place {
    vec3 p;      // receiver, scene space, metres
    vec3 n;      // its unit normal
    vec2 at;     // in the view's units
    float depth; // along the view direction, inverse in a perspective view
    vec3 plane;  // stored depth of the receiver's plane, and its change across the map
    vec2 map;    // its place in the map
    uint view;
    bool hidden; // the light's centre
    LightDisk light;
};

struct Seen {
    uint number;   // one more than the edge's; 0 for none
    vec2 nearest;  // point of the edge nearest to the place asked for, in the view's units
    vec2 outward;  // unit vector away from the blocker
    float delta;   // distance of that place from the edge's line, positive outside
    float width;   // half width of the penumbra there
    float depth;   // of the nearest point, inverse in a perspective view
    vec3 chord;    // the light's point s of the unit disk is seen past the edge's line where
                   // chord.x + dot(chord.yz, s) > 0; yz is a unit vector
};

// The disk that a receiver sees of a light, so that chord.x is the ratio of light_above.
LightDisk light_disk(Light light, uint shape, vec3 p, vec3 right) {
    vec3 offset = light_offset(light, p);
    float radius = light.axis_x.w;
    if (shape == LIGHT_SPHERE) {
        float distance_m = max(length(offset), 1.0e-37);
        float sine = min(radius / distance_m, 1.0);
        float cosine2 = max(1.0 - sine * sine, 0.0);
        vec3 to = offset / distance_m;
        vec3 x = normalize(right - dot(right, to) * to);
        float outline = radius * sqrt(cosine2);
        return LightDisk(offset * cosine2, outline * x, outline * cross(to, x));
    }
    return LightDisk(offset, radius * light.axis_x.xyz, radius * light.axis_y.xyz);
}

// Where a plane through the receiver cuts the disk.
vec3 light_chord(LightDisk light, vec3 normal) {
    vec2 slope = vec2(dot(normal, light.x), dot(normal, light.y));
    float reach = length(slope);
    float height = dot(normal, light.center);
    return vec3(light_ratio(height, reach), reach > 0.0 ? slope / reach : vec2(1.0, 0.0));
}

// Width of a texel of the distortion maps, in the view's units.
float band_texel(LightView light_view) {
    return max(abs(1.0 / light_view.scale.x), abs(1.0 / light_view.scale.y)) / float(params.bands.x);
}

ivec3 texel_of(Place here, vec2 map, uint texels) {
    float size = float(texels);
    return ivec3(clamp(floor(map * size), 0.0, size - 1.0), int(here.view));
}

bool in_map(vec2 map) {
    return all(equal(map, clamp(map, 0.0, 1.0)));
}

// One more than the number of the edge, with the side of its faces in the highest bit.
uint edge_at(Place here, vec2 map, bool inner) {
    ivec3 texel = texel_of(here, map, params.bands.x);
    texel.z = 2 * texel.z + (inner ? 1 : 0);
    return fetch_map_edge(texel);
}

uint second_edge_at(Place here, vec2 map, bool inner) {
    ivec3 texel = texel_of(here, map, params.bands.x);
    texel.z = 2 * texel.z + (inner ? 1 : 0);
    return fetch_second_edge(texel);
}

float map_depth_at(Place here, vec2 map) {
    return fetch_map_depth(texel_of(here, map, params.counts.y));
}

// Whether a place of the map shows something in front of the receiver's plane. Where the light's
// centre is below that plane, what the map shows there is below it too.
bool blocked_at(Place here, vec2 map) {
    float size = float(params.counts.y);
    ivec3 texel = texel_of(here, map, params.counts.y);
    vec2 apart = (vec2(texel.xy) + 0.5) / size - here.map;
    float expected = here.plane.x + dot(here.plane.yz, apart);
    float slack = (abs(here.plane.y) + abs(here.plane.z)) / size * SNAP_TEXELS
        + abs(here.plane.x) * DEPTH_ROUNDING;
    return dot(here.n, here.light.center) > 0.0 && fetch_map_depth(texel) > expected + slack;
}

vec3 in_view(LightView light_view, vec3 q) {
    return vec3(dot(q, light_view.right.xyz), dot(q, light_view.up.xyz), dot(q, light_view.forward.xyz));
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

// What an edge does to the receiver, as looked at from a place in the view's units; none where the
// edge is not in front of the receiver.
Seen look_at(Place here, LightView light_view, uint entry, vec2 from_place) {
    Seen found = Seen(0u, vec2(0.0), vec2(0.0), 0.0, 0.0, 0.0, vec3(1.0, 1.0, 0.0));
    uint number = entry & EDGE_NUMBER;
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
    float side = (entry & FACES_LEFT) != 0u ? -1.0 : 1.0;
    if (!clip_edge(light_view, params.reach.z, a, b)) {
        return found;
    }
    vec2 from = perspective ? a.xy / a.z : a.xy;
    vec2 to = perspective ? b.xy / b.z : b.xy;
    vec2 depths = perspective ? 1.0 / vec2(a.z, b.z) : vec2(a.z, b.z);
    vec2 along = to - from;
    float size = length(along);
    float t = clamp(dot(from_place - from, along) / max(size * size, 1.0e-38), 0.0, 1.0);
    found.nearest = mix(from, to, t);
    found.depth = mix(depths.x, depths.y, t);
    vec2 unit = size > 0.0 ? along / size : vec2(1.0, 0.0);
    found.outward = vec2(-unit.y, unit.x) * side;
    found.delta = dot(from_place - found.nearest, found.outward);
    found.width = penumbra_half_width(params.reach.x, perspective, found.depth, here.depth, found.nearest);
    float apart = perspective ? found.depth - here.depth : here.depth - found.depth;
    // Farther away than its penumbra reaches, the line of an edge says nothing, for it may have ended
    // on the way.
    if (apart <= 1.0e-5 * abs(here.depth)
        || distance(from_place, found.nearest) > found.width
        || !over_receiver(here, first, second)) {
        return found;
    }
    found.number = number;
    // The plane through receiver and edge, its normal away from the blocker.
    float handed = dot(cross(light_view.right.xyz, light_view.up.xyz), light_view.forward.xyz);
    vec3 normal = cross(first - here.p, second - here.p) * (side * handed > 0.0 ? -1.0 : 1.0);
    float length_m2 = length(normal);
    found.chord = length_m2 > 0.0
        ? light_chord(here.light, normal / length_m2)
        : vec3(found.delta > 0.0 ? 1.0 : -1.0, 1.0, 0.0);
    return found;
}

// The part of the light's power beyond the chord at -offset from its centre, as disk_above.
float power_above(float offset) {
    if (FALLOFF == 0u) {
        return disk_above(offset);
    }
    // Brightness 1 - s^2: 1/2 + (x (5 - 2 x^2) sqrt(1 - x^2) / 3 + asin x) / pi, within 1e-6.
    float t = 0.5 + 0.5 * offset;
    float m = max(min(t, 1.0 - t), 0.0);
    float part = m * m * sqrt(m) * (5.4312306 - m * (5.80473339 - m * (1.0640972 + m * 0.26827567)));
    return t > 0.5 ? 1.0 - part : part;
}

// The part of the light seen past the edge's line.
float seen_past(Seen edge) {
    float t = 0.5 + 0.5 * edge.chord.x;
    return CUBIC != 0u ? t * t * (3.0 - 2.0 * t) : power_above(edge.chord.x);
}

#endif
