// What silhouettes hide of a light, seen from one receiver.
//
// Seen from a receiver, each point s of the light has a number of surfaces before it. Along the light
// this number changes only where it crosses the image of an edge whose faces are, all or more of them
// than not, on one side of it: by that many. So the number at s is the number at one point of the light
// plus the changes at the edges on the way there (Laine, Aila, Assarsson, Lehtinen, Akenine-Moeller 2005,
// "Soft Shadow Volumes for Ray Tracing"), and its integral over the light is a sum over edges of areas
// that a chord and two rays from the centre bound (Assarsson and Akenine-Moeller 2003, "A Geometry-based
// Soft Shadow Volume Algorithm using Graphics Hardware").
//
// The light is a part of a plane. With its axes and d a point from the receiver, (u, v, w) = M d are
// homogeneous coordinates: the light is u^2 + v^2 <= w^2 (of a rectangle |u|, |v| <= w), its own plane w =
// 1. All is decided there by signs of determinants, in the same order for every face and edge that
// shares a point, so that rounding cannot open a closed outline.
#ifndef ANTUMBRA_DBUFFER_COVERAGE_GLSL
#define ANTUMBRA_DBUFFER_COVERAGE_GLSL

#include "common/light_above.glsl"
#include "dbuffer/params.glsl"
#include "silhouettes/sides.glsl"

layout(constant_id = 0) const uint LIGHT_SHAPE = 0u;
// Light samples, in fours.
layout(constant_id = 1) const uint FOURS = 8u;

const float PI = 3.14159265358979;

struct CoverageReceiver {
    vec3 p;           // scene space, metres
    vec3 n;           // unit normal, towards the light
    float rounding_m; // what heights are rounded by
    vec3 center;      // of the light's plane, from p; of a sun a direction
    vec3 axis_u;      // half axes of the light
    vec3 axis_v;
    vec3 row_u;       // rows of M
    vec3 row_v;
    vec3 row_w;
    float turn;       // sign of det M
    vec2 from;        // the point of the light that changes are counted from
};

struct Coverage {
    vec4 layers[FOURS]; // at each sample, those at `from` taken off: see all_layers
    vec2 integral;      // mean over the light of even and odd layers, for `from` = 0
    vec2 most;          // the largest change at one edge of either kind
    float lighter;      // the largest part of the light that one edge has fewer layers on
    float fewer;        // by so many
    vec2 beyond;        // a point of that part
};

// Edges of sheets have an odd number of faces more on one side, those of bodies an even one. The layers of the
// former are stored a second time in these parts of one, which as float both of up to 2048 layers have room for.
const float ODD_PARTS = 4096.0;

vec4 all_layers(vec4 stored) {
    return round(stored);
}

CoverageReceiver coverage_receiver(Light light, vec3 p, vec3 n, float rounding_m) {
    vec3 offset = light_offset(light, p);
    vec3 u = light.axis_x.xyz;
    vec3 v = light.axis_y.xyz;
    vec3 z = -light.direction.xyz;
    vec2 size = vec2(light.axis_x.w, LIGHT_SHAPE == LIGHT_RECT ? light.axis_y.w : light.axis_x.w);
    float rest = 1.0;
    if (LIGHT_SHAPE == LIGHT_SPHERE) {
        // The disk bounded by the sphere's outline.
        float square = max(dot(offset, offset), 1.0e-37);
        rest = max(1.0 - size.x * size.x / square, 1.0e-6);
        z = offset * inversesqrt(square);
        vec3 near = abs(dot(z, u)) < 0.9 ? u : v;
        u = normalize(near - z * dot(near, z));
        v = cross(z, u);
        size *= sqrt(rest);
    }
    size = max(size, 1.0e-30);
    CoverageReceiver r;
    r.p = p;
    r.n = n;
    r.rounding_m = rounding_m;
    r.center = offset * rest;
    r.axis_u = u * size.x;
    r.axis_v = v * size.y;
    bool sun = LIGHT_SHAPE == LIGHT_SUN;
    r.row_w = sun ? z : z / max(dot(r.center, z), 1.0e-30);
    r.row_u = (u - (sun ? 0.0 : dot(r.center, u)) * r.row_w) / size.x;
    r.row_v = (v - (sun ? 0.0 : dot(r.center, v)) * r.row_w) / size.y;
    r.turn = dot(cross(u, v), z) < 0.0 ? -1.0 : 1.0;
    r.from = vec2(0.0);
    return r;
}

// From the receiver to a place on the light.
vec3 to_light_place(CoverageReceiver r, vec2 place) {
    return r.center + place.x * r.axis_u + place.y * r.axis_v;
}

// Cuts the range of an edge where a linear function of it is positive.
void cut(float at_a, float at_b, inout vec2 range) {
    float t = at_a / (at_a - at_b);
    range.x = at_a <= 0.0 ? (at_b <= 0.0 ? 2.0 : max(range.x, t)) : range.x;
    range.y = at_b <= 0.0 ? (at_a <= 0.0 ? -1.0 : min(range.y, t)) : range.y;
}

vec3 on_light(CoverageReceiver r, vec3 d) {
    precise vec3 result = vec3(dot(d, r.row_u), dot(d, r.row_v), dot(d, r.row_w));
    return result;
}

// Where a line is within the light, from its foot point along it.
vec2 chord(vec2 foot, vec2 along) {
    if (LIGHT_SHAPE == LIGHT_RECT) {
        vec2 slope = mix(along, vec2(1.0e-20), lessThan(abs(along), vec2(1.0e-20)));
        vec2 one = (-1.0 - foot) / slope;
        vec2 other = (1.0 - foot) / slope;
        vec2 first = min(one, other);
        vec2 last = max(one, other);
        return vec2(max(first.x, first.y), min(last.x, last.y));
    }
    float square = 1.0 - dot(foot, foot);
    float reach = sqrt(max(square, 0.0));
    return square > 0.0 ? vec2(-reach, reach) : vec2(1.0, -1.0);
}

// Area of the square |u|, |v| <= 1 from its first axis round to a direction, modulo 4.
float square_sector(vec2 d) {
    if (abs(d.x) >= abs(d.y)) {
        float part = 0.5 * d.y / (d.x != 0.0 ? d.x : 1.0);
        return d.x >= 0.0 ? part : 2.0 + part;
    }
    float part = 0.5 * d.x / d.y;
    return d.y >= 0.0 ? 1.0 - part : 3.0 - part;
}

// The part of the light that a piece of a chord hides from its centre. off: distance of the chord from
// the centre; range: the piece, from the foot point of the centre.
float part_beyond(vec2 foot, vec2 along, float off, vec2 range) {
    float triangle = 0.5 * off * (range.y - range.x);
    if (LIGHT_SHAPE == LIGHT_RECT) {
        vec2 a = foot + range.x * along;
        vec2 b = foot + range.y * along;
        float area = square_sector(b) - square_sector(a);
        area = dot(foot, vec2(along.y, -along.x)) < 0.0 ? -area : area;
        // At most half of the light: less than nothing by more than rounding is a turn too little.
        area = area < -1.0 ? area + 4.0 : area;
        return max(area - triangle, 0.0) / 4.0;
    }
    float angle = atan(off * (range.y - range.x), off * off + range.x * range.y);
    return max(0.5 * angle - triangle, 0.0) / PI;
}

// Whether points on a common side of a bound of the light, of its plane, of the receiver's or of the light's own
// do not hide any of it: each is a linear function that is negative at all that is between them as well. The
// largest of each over the points: four bounds of the light's square; behind the light, above both planes.
struct Reach {
    vec4 within;
    vec3 before;
};

Reach reach_of(CoverageReceiver r, vec3 d) {
    vec3 on = on_light(r, d);
    float least = r.rounding_m * length(r.row_w);
    float behind = LIGHT_SHAPE == LIGHT_SUN ? 1.0 : 1.0 - on.z;
    return Reach(on.z + vec4(on.x, -on.x, on.y, -on.y), vec3(behind, on.z - least, dot(r.n, d) - r.rounding_m));
}

bool may_matter(Reach most) {
    return all(greaterThan(most.within, vec4(0.0))) && all(greaterThan(most.before, vec3(0.0)));
}

Reach larger(Reach one, Reach other) {
    return Reach(max(one.within, other.within), max(one.before, other.before));
}

// Whether anything in a box may hide any of the light: the largest of each function over it.
bool box_may_matter(CoverageReceiver r, vec3 low, vec3 high) {
    vec3 middle = 0.5 * (low + high) - r.p;
    vec3 half_size = 0.5 * (high - low) + r.rounding_m;
    vec3 u = abs(r.row_w + r.row_u);
    vec3 minus_u = abs(r.row_w - r.row_u);
    vec3 v = abs(r.row_w + r.row_v);
    vec3 minus_v = abs(r.row_w - r.row_v);
    float w = dot(abs(r.row_w), half_size);
    Reach most = reach_of(r, middle);
    most.within += vec4(dot(u, half_size), dot(minus_u, half_size), dot(v, half_size), dot(minus_v, half_size));
    most.before += vec3(LIGHT_SHAPE == LIGHT_SUN ? 0.0 : w, w, dot(abs(r.n), half_size));
    return may_matter(most);
}

// Whether an edge may hide any of the light; ends from the receiver. Much less to do than add_edge.
bool edge_may_matter(CoverageReceiver r, vec3 a, vec3 b) {
    vec3 line = cross(on_light(r, a), on_light(r, b));
    float rim = LIGHT_SHAPE == LIGHT_RECT ? abs(line.x) + abs(line.y) : length(line.xy);
    return may_matter(larger(reach_of(r, a), reach_of(r, b))) && abs(line.z) <= rim;
}

void add_edge(CoverageReceiver r, uint number, inout Coverage found) {
    uvec4 edge = fetch_edge(number);
    vec3 world_a = fetch_point(edge.x).xyz;
    vec3 world_b = fetch_point(edge.y).xyz;
    vec3 a = world_a - r.p;
    vec3 b = world_b - r.p;
    vec3 on_a = on_light(r, a);
    vec3 on_b = on_light(r, b);
    // What is not above the receiver's plane, not before it or not before the light hides nothing.
    vec2 range = vec2(0.0, 1.0);
    cut(dot(r.n, a) - r.rounding_m, dot(r.n, b) - r.rounding_m, range);
    float least = r.rounding_m * length(r.row_w);
    cut(on_a.z - least, on_b.z - least, range);
    if (LIGHT_SHAPE != LIGHT_SUN) {
        cut(1.0 - on_a.z, 1.0 - on_b.z, range);
    }
    if (range.x >= range.y) {
        return;
    }
    vec3 line = cross(on_a, on_b);
    float slope = length(line.xy);
    if (!(slope > 0.0)) {
        return;
    }
    vec3 end_a = range.x > 0.0 ? mix(on_a, on_b, range.x) : on_a;
    vec3 end_b = range.y < 1.0 ? mix(on_a, on_b, range.y) : on_b;
    vec2 unit = line.xy / slope;
    float height = line.z / slope; // of the centre over the line
    vec2 foot = -height * unit;
    vec2 along = vec2(-unit.y, unit.x);
    vec2 within = chord(foot, along);
    if (within.x >= within.y) {
        return;
    }
    vec2 places = clamp(vec2(dot(end_a.xy, along) / end_a.z, dot(end_b.xy, along) / end_b.z), within.x, within.y);
    vec2 piece = vec2(min(places.x, places.y), max(places.x, places.y));
    if (piece.x >= piece.y) {
        return;
    }
    float faces = faces_on_one_side(r.p, r.turn, edge, world_a, world_b);
    if (faces == 0.0) {
        return;
    }
    bool over = line.z > 0.0;
    float part = part_beyond(foot, along, abs(height), piece);
    float change = over ? -faces : faces;
    bool odd = (uint(abs(faces)) & 1u) != 0u;
    vec2 kind = odd ? vec2(0.0, 1.0) : vec2(1.0, 0.0);
    found.integral += change * part * kind;
    found.most = max(found.most, abs(faces) * kind);
    if (change < 0.0 && part > found.lighter) {
        found.lighter = part;
        found.fewer = -change;
        vec2 middle = foot + 0.5 * (piece.x + piece.y) * along;
        vec2 way = dot(middle, middle) > 1.0e-12 ? normalize(middle) : (over ? -unit : unit);
        vec2 size = abs(way);
        float rim = LIGHT_SHAPE == LIGHT_RECT ? 1.0 / max(size.x, size.y) : 1.0;
        found.beyond = 0.5 * (length(middle) + rim) * way;
    }

    bool from_over = dot(line.xy, r.from) + line.z > 0.0;
    float count = (from_over ? -faces : faces) * (odd ? 1.0 + 1.0 / ODD_PARTS : 1.0);
    vec2 shifted_a = end_a.xy - r.from * end_a.z;
    vec2 shifted_b = end_b.xy - r.from * end_b.z;
    for (uint i = 0u; i < FOURS; ++i) {
        vec4 u = params.samples[2u * i];
        vec4 v = params.samples[2u * i + 1u];
        vec4 du = u - r.from.x;
        vec4 dv = v - r.from.y;
        precise vec4 side_a = shifted_a.x * dv - shifted_a.y * du;
        precise vec4 side_b = shifted_b.x * dv - shifted_b.y * du;
        vec4 side = line.x * u + line.y * v + line.z;
        // The way from `from` to the sample crosses the edge.
        bvec4 passes = notEqual(greaterThan(side_a, vec4(0.0)), greaterThan(side_b, vec4(0.0)));
        bvec4 other = notEqual(greaterThan(side, vec4(0.0)), bvec4(from_over));
        found.layers[i] += count * vec4(passes) * vec4(other);
    }
}

#endif
