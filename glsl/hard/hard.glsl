// Shadow mapping (Williams 1978) of the light's centre, decided by the triangles that the map saw.
//
// A texel holds the depth and the triangle at its centre, the receiver is elsewhere in it. Comparing
// depths there darkens every slanted surface, and a bias that prevents it detaches shadows. Instead
// the ray from the receiver to the light is tested against the triangles of the four nearest texels:
// exact wherever triangles are wider than a texel, so that shadow edges are straight and in their
// place, and surfaces do not shadow themselves. Narrower triangles may hide between texel centres;
// for them depths decide, compared with the depth that the receiver's plane has at the texel's
// centre, less what a mesh that fine may bend by in the width of a texel.
#ifndef ANTUMBRA_HARD_GLSL
#define ANTUMBRA_HARD_GLSL

#include "common/holes.glsl"
#include "common/light_view.glsl"
#include "common/triangles.glsl"

// Defined by the entry file: textureGather from a view's map.
vec4 gather_map_depths(vec2 place, uint view);
uvec4 gather_map_ids(vec2 place, uint view); // triangle numbers plus one, 0 for none

// What rasterisation may be off by. Vertices snap to the device's sub-texel grid (256 or 16 steps),
// which shifts a plane's depth by up to one step of its slope; four steps cover interpolation over
// the largest triangle. Depths themselves are rounded to 2^-24. Larger values detach shadows, smaller
// ones leave dark specks.
layout(constant_id = 0) const float SNAP_TEXELS = 4.0 / 256.0;
const float DEPTH_ROUNDING = 1.0 / 1048576.0;

// 1 where triangles of the scene may have holes.
layout(constant_id = 1) const uint MASKED = 0u;

// Rounding of positions, as a part of the largest coordinate: a few units of the last place. A
// triangle nearer to the receiver than that is the receiver's own, or one with it.
const float POSITION_ROUNDING = 1.0 / 2097152.0;

// Width in texels below which a triangle may lie between the centres of all texels around a point of
// it: the diagonal of a texel.
const float NARROW_TEXELS = 1.5;

struct Receiver {
    vec3 position; // scene space, metres
    vec3 normal;   // unit, on the light's side
    vec3 to_light; // to the light's centre in metres, or the unit vector towards a sun
    bool sun;
    uint id;       // its triangle's number plus one; only saves time
};

const uint MISSED = 0u;
const uint MISSED_NARROW = 1u;
const uint BLOCKED = 2u;

// Whether a triangle is between the receiver and the light. Shared edges belong to both triangles,
// so no ray passes between them. texel_m: width of a texel in metres at distance 1 (of a sun: at any
// distance); extent_m: largest coordinate in play.
uint test_triangle(Receiver receiver, uint triangle, float texel_m, float extent_m) {
    vec3 a = fetch_corner(triangle, 0u).position - receiver.position;
    vec3 b = fetch_corner(triangle, 1u).position - receiver.position;
    vec3 c = fetch_corner(triangle, 2u).position - receiver.position;
    vec4 plane = fetch_triangle_texel(4u * triangle + 3u);
    vec3 normal = plane.xyz;
    float height = dot(normal, a); // of the triangle's plane over the receiver
    float climb = dot(normal, receiver.to_light);
    bool ahead = abs(height) > POSITION_ROUNDING * extent_m
        && (height > 0.0) == (climb > 0.0)
        && (receiver.sun || abs(climb) > abs(height));
    precise float u = dot(receiver.to_light, cross(c, b));
    precise float v = dot(receiver.to_light, cross(a, c));
    precise float w = dot(receiver.to_light, cross(b, a));
    bool inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    if (MASKED != 0u && material_is_masked(plane.w) && ahead && inside) {
        // A ray in the plane of the triangle has no one place in it.
        float area = u + v + w;
        vec3 weights = area != 0.0 ? vec3(u, v, w) / area : vec3(1.0, 0.0, 0.0);
        inside = !is_hole(material_number(plane.w), fetch_uv(triangle, weights));
    }
    // Width of the triangle as the light sees it: twice its area over its longest edge.
    vec3 ab = b - a;
    vec3 bc = c - b;
    vec3 ca = a - c;
    float longest = max(dot(ab, ab), max(dot(bc, bc), dot(ca, ca)));
    float width = abs(dot(cross(ab, ca), receiver.to_light))
        * inversesqrt(dot(receiver.to_light, receiver.to_light) * longest);
    float distance_m = receiver.sun ? 1.0 : length(receiver.to_light - a);
    bool narrow = width < NARROW_TEXELS * texel_m * distance_m;
    return !ahead ? MISSED : inside ? BLOCKED : narrow ? MISSED_NARROW : MISSED;
}

// Largest coordinate in play, metres: what positions are rounded by.
float largest_coordinate(Receiver receiver) {
    vec3 light = receiver.sun ? vec3(0.0) : abs(receiver.position + receiver.to_light);
    vec3 magnitude = max(abs(receiver.position), light);
    return max(magnitude.x, max(magnitude.y, magnitude.z));
}

// The texels around a place, in the order of textureGather: (0, 1), (1, 1), (1, 0), (0, 0).
const vec4 GATHER_X = vec4(0.0, 1.0, 1.0, 0.0);
const vec4 GATHER_Y = vec4(1.0, 1.0, 0.0, 0.0);

// How far, in stored depth, a texel of a finely meshed surface may be before the plane of a receiver on
// that surface: meshes bend by up to half a radian from one triangle to the next, over the width of a
// texel. expected: stored depth of the plane; slope: its change over a texel; texel_m: as above.
float bend_slack(LightView view, float expected, vec2 slope, float texel_m) {
    const float BEND = 0.5;
    const float MOST_TEXELS = 4.0;
    // A texel's width as a difference of stored depths.
    float width = texel_m * (view.forward.w > 0.0 ? abs(expected) : abs(view.scale.z));
    return min(BEND * (width + dot(slope, slope) / max(width, 1.0e-30)), MOST_TEXELS * width);
}

// 1 where the light's centre is seen, else 0. map: the receiver's place in the map, 0 to 1.
float hard_visibility(Receiver receiver, LightView view, uint index, vec2 map, float size_texels) {
    vec2 place = map * size_texels - 0.5;
    vec2 first = floor(place);
    vec2 middle = (first + 1.0) / size_texels; // between the four, so that rounding cannot matter
    uvec4 ids = gather_map_ids(middle, index);
    uvec4 strange = ids * uvec4(notEqual(ids, uvec4(receiver.id)));
    bool all_strange = all(notEqual(strange, uvec4(0u)));
    float extent_m = largest_coordinate(receiver);
    float texel_m = max(abs(1.0 / view.scale.x), abs(1.0 / view.scale.y)) / size_texels;

    // Mostly there is nothing to test, and sometimes more than one triangle.
    uint result = MISSED;
    while (any(notEqual(strange, uvec4(0u)))) {
        uint id = max(max(strange.x, strange.y), max(strange.z, strange.w));
        strange *= uvec4(notEqual(strange, uvec4(id)));
        result = max(result, test_triangle(receiver, id - 1u, texel_m, extent_m));
        strange *= result == BLOCKED ? 0u : 1u;
    }

    // No stored triangle is hit, but a narrow one may hide between the texels. Where all four saw
    // something in front, so would the receiver's own place: an edge that leaves it free leaves one
    // of them free.
    float visibility = result == BLOCKED ? 0.0 : 1.0;
    bool undecided = result == MISSED_NARROW || (result == MISSED && all_strange);
    if (undecided) {
        vec3 q = receiver.sun ? receiver.position : -receiver.to_light;
        vec3 plane = light_view_plane(view, q, receiver.normal, (first + 0.5) / size_texels);
        vec2 slope = plane.yz / size_texels;
        vec4 expected = plane.x + slope.x * GATHER_X + slope.y * GATHER_Y;
        float slack = (abs(slope.x) + abs(slope.y)) * SNAP_TEXELS + abs(plane.x) * DEPTH_ROUNDING
            + bend_slack(view, plane.x, slope, texel_m);
        bvec4 in_front = greaterThan(gather_map_depths(middle, index), expected + slack);
        vec2 nearer = step(vec2(0.5), place - first);
        bool nearest_in_front = nearer.y > 0.5
            ? (nearer.x > 0.5 ? in_front.y : in_front.x)
            : (nearer.x > 0.5 ? in_front.z : in_front.w);
        bool hidden = all(in_front) || (result == MISSED_NARROW && nearest_in_front);
        visibility = hidden ? 0.0 : 1.0;
    }
    return visibility;
}

#endif
