// Visible parts of a segment of a line light, from the maps of its two ends (Reimann and Dreier,
// "Occluding Edges Soft Shadows"). See outreach.comp for the coordinates of a row.
//
// Places t on the segment are 0 at the end in question and 1 at the other. Each end is seen or not, by
// the exact test of `hard`. An end that is seen lights the segment up to where its occluding edge
// hides it. An end that is not is hidden by a surface of its own map, and light may come from beyond
// that surface's border.
#ifndef ANTUMBRA_OESS_GLSL
#define ANTUMBRA_OESS_GLSL

#include "hard/hard.glsl"
#include "oess/params.glsl"

// Defined by the entry file: texels of an outreach map in the order of textureGather, and of a map.
uvec4 gather_outreach(vec2 place, uint layer, bool backward);
uint fetch_outreach(ivec2 texel, uint layer, bool backward);
float fetch_map_depth(ivec2 texel, uint layer);
uint fetch_map_id(ivec2 texel, uint layer);
uint map_texels(); // across a map

// 1: an edge is where its triangle ends in the receiver's plane through the light; 0: at the border
// of a texel.
layout(constant_id = 2) const uint EXACT_EDGES = 1u;
// 1: light may come between the blockers nearest to both ends, where both are seen.
layout(constant_id = 4) const uint GAPS = 1u;
// Steps along the hull from the edge of the surface that the map holds to that of the receiver.
layout(constant_id = 3) const uint WALK = 2u;

// 1: outreach maps hold two occluding edges a texel, of which none need be the right one.
layout(constant_id = 5) const uint CANDIDATES = 0u;
// 1: a receiver that an end's map does not show is in its penumbra all the same, as published.
layout(constant_id = 6) const uint BY_PLACE = 0u;

// A segment's end as a receiver sees it.
struct End {
    vec3 position; // scene space, metres
    vec3 along;    // unit vector towards the other end
    float length_m;
    float texels;  // shift to the other end's map for stored depth 1
    uint layer;    // of its map
    uint outreach; // layer of the outreach map
    bool backward;
    bool facing;   // whether the end is above the receiver's plane
    bool seen;
    vec2 place;    // of the receiver in the map, texels
    vec3 plane;    // stored depth of the receiver's plane at texel floor(place - 0.5), and its change
                   // from one texel to the next across and down
};

// How an edge is known.
const uint EDGE_NONE = 0u;
const uint EDGE_TEXEL = 1u;
const uint EDGE_EXACT = 2u;
const uint EDGE_MISSED = 3u; // by texels: the triangle there does not reach the receiver's plane

struct Edge {
    float place;
    uint kind;
};

// Where a segment is hidden: between two of its places, both 1 if nowhere.
struct Blocker {
    Edge near;
    Edge far;
};

const Edge NOWHERE = Edge(1.0, EDGE_NONE);

// Where a triangle hides a segment from a point, in the plane of both: eq. (1) of the paper without
// its angles. x runs along the light from the end, r away from it; the line from (x_f, r_f) through
// (x, r) meets the light at (x r_f - x_f r) / (r_f - r). first: the nearest to the end, else the
// farthest.
Edge triangle_edge(End end, Receiver receiver, uint triangle, bool first) {
    vec3 to_point = receiver.position - end.position;
    float x_f = dot(to_point, end.along);
    vec3 across = to_point - x_f * end.along;
    float r_f = length(across);
    vec3 outward = across / max(r_f, 1.0e-30);
    vec3 side = cross(end.along, outward);
    vec3 corners[3];
    for (uint i = 0u; i < 3u; ++i) {
        vec3 q = fetch_corner(triangle, i).position - end.position;
        corners[i] = vec3(dot(q, end.along), dot(q, outward), dot(q, side));
    }
    // The plane cuts the triangle between two points, p nearer to the light's axis.
    vec2 p = vec2(0.0);
    vec2 q = vec2(0.0);
    uint cuts = 0u;
    for (uint i = 0u; i < 3u; ++i) {
        vec3 a = corners[i];
        vec3 b = corners[(i + 1u) % 3u];
        bool crosses = (a.z > 0.0) != (b.z > 0.0);
        vec2 at = mix(a.xy, b.xy, crosses ? a.z / (a.z - b.z) : 0.0);
        p = crosses && cuts == 0u ? at : p;
        q = crosses ? at : q;
        cuts += crosses ? 1u : 0u;
    }
    if (cuts == 0u) {
        return Edge(0.0, EDGE_MISSED);
    }
    vec2 lower = p.y < q.y ? p : q;
    vec2 upper = p.y < q.y ? q : p;
    float deepest = r_f * (1.0 - 1.0e-5);
    if (upper.y <= 0.0 || lower.y >= deepest) {
        // Beyond the light, or behind the receiver: there it hides all that is farther along the light.
        return Edge(1.0e30, first || upper.y <= 0.0 ? EDGE_NONE : EDGE_EXACT);
    }
    // Of what goes on beyond the light's axis, the part up to there counts.
    lower = lower.y < 0.0 ? mix(lower, upper, lower.y / (lower.y - upper.y)) : lower;
    float t = (lower.x * r_f - x_f * lower.y) / ((r_f - lower.y) * end.length_m);
    float other = (upper.x * r_f - x_f * upper.y) / (max(r_f - upper.y, 1.0e-30) * end.length_m);
    if (upper.y > deepest) {
        // It goes on behind the receiver, and hides all of the light on one side.
        float x = mix(lower.x, upper.x, (r_f - lower.y) / (upper.y - lower.y));
        other = x > x_f ? 1.0e30 : -1.0e30;
    }
    if (first && max(t, other) < 0.0) {
        return Edge(1.0, EDGE_NONE);
    }
    return Edge(first ? min(t, other) : max(t, other), EDGE_EXACT);
}

// Whether a triangle is too narrow for the map, or cut by alpha: its texels say more than its corners.
bool is_fine(End end, Receiver receiver, uint triangle, float texel_m) {
    vec3 a = fetch_corner(triangle, 0u).position;
    vec3 b = fetch_corner(triangle, 1u).position;
    vec3 c = fetch_corner(triangle, 2u).position;
    vec3 to_end = end.position - a;
    vec3 ab = b - a;
    vec3 bc = c - b;
    vec3 ca = a - c;
    float longest = max(dot(ab, ab), max(dot(bc, bc), dot(ca, ca)));
    float width = abs(dot(cross(ab, ca), to_end)) * inversesqrt(dot(to_end, to_end) * longest);
    bool masked = MASKED != 0u && material_is_masked(fetch_triangle_texel(4u * triangle + 3u).w);
    return masked || width < 4.0 * texel_m * length(to_end);
}

// The receiver's own plane in one row of a map: shift at the receiver's column and change per column.
struct Row {
    int index;
    float s;
    float slope;
    float slack; // what rasterisation may be off by: see hard.glsl
};

Row receiver_row(End end, uint row) {
    vec2 first = floor(end.place - 0.5);
    vec2 part = end.place - 0.5 - first;
    vec3 plane = end.plane * end.texels;
    float s = plane.x + plane.y * part.x + plane.z * float(row);
    float slack = (abs(plane.y) + abs(plane.z)) * SNAP_TEXELS + abs(s) * 4.0 * DEPTH_ROUNDING;
    return Row(int(first.y) + int(row), s, plane.y, slack);
}

// The place t of what a map's texel shows, 1e30 where that is not in front of the receiver's plane.
float texel_place(End end, Row row, int column, float half_texel) {
    float sign = end.backward ? -1.0 : 1.0;
    float s = end.texels * fetch_map_depth(ivec2(column, row.index), end.layer);
    float offset = float(column) + 0.5 - end.place.x;
    float rise = s - row.s;
    bool in_front = rise > row.slope * offset + row.slack && rise > row.slack;
    return in_front ? (sign * offset + half_texel) / rise : 1.0e30;
}

// Where what a texel shows begins to hide the segment (first), or ends to.
Edge edge_at(End end, Receiver receiver, Row row, int column, bool first, float texel_m) {
    bool missed = false;
    if (EXACT_EDGES != 0u) {
        uint id = fetch_map_id(ivec2(column, row.index), end.layer);
        if (id != 0u && !is_fine(end, receiver, id - 1u, texel_m)) {
            Edge exact = triangle_edge(end, receiver, id - 1u, first);
            missed = exact.kind == EDGE_MISSED;
            if (!missed) {
                return Edge(clamp(exact.place, 0.0, 1.0), exact.kind);
            }
        }
    }
    // A surface ends between its last texel and the next. A flat one goes on to there as it is. A round
    // one bends away, along the line to the receiver at most: there the shift falls by 1 / t a texel.
    float border = first ? -0.5 : 0.5;
    float place = texel_place(end, row, column, border);
    float t = texel_place(end, row, column, 0.0);
    if (first && t > 0.0 && t < 1.0e30) {
        int inner = clamp(column + (end.backward ? -1 : 1), 0, int(map_texels()) - 1);
        float s = end.texels * fetch_map_depth(ivec2(column, row.index), end.layer);
        float s_inner = end.texels * fetch_map_depth(ivec2(inner, row.index), end.layer);
        float bend = clamp((s_inner - s) * t, 0.0, 1.0);
        // (x - 1/2) / (rise - bend / 2t), where x = t rise.
        float rise = s - row.s;
        place = (t * rise - 0.5) / max(rise - 0.5 * bend / t, 1.0e-30);
        place = min(place, t);
    }
    return Edge(clamp(place, 0.0, 1.0), missed ? EDGE_MISSED : EDGE_TEXEL);
}

// What hides the segment first, in one row.
Blocker row_blocker(End end, Receiver receiver, Row row, uvec2 starts, float texel_m) {
    float best = 1.0e30;
    uint edge = 0u;
    for (uint i = 0u; i < 2u; ++i) {
        uint candidate = i == 0u ? starts.x : starts.y;
        if (candidate != 0u && candidate != edge) {
            float t = texel_place(end, row, int(candidate) - 1, 0.0);
            edge = t < best ? candidate : edge;
            best = min(best, t);
        }
    }
    uint texel = 0u;
    for (uint step = 0u; step <= WALK && edge != 0u; ++step) {
        texel = fetch_outreach(ivec2(int(edge) - 1, row.index), end.outreach, end.backward);
        uint next = edge_of(texel);
        float t = next != 0u && step < WALK ? texel_place(end, row, int(next) - 1, 0.0) : 1.0e30;
        if (t >= best) {
            break;
        }
        best = t;
        edge = next;
    }
    if (edge == 0u || best > 2.0) {
        return Blocker(NOWHERE, NOWHERE);
    }
    Edge near = edge_at(end, receiver, row, int(edge) - 1, true, texel_m);
    Edge far = edge_at(end, receiver, row, int(run_of(texel)) - 1, false, texel_m);
    return Blocker(near, far);
}

// Two rows' edges as one. Exact ones are of the receiver's own plane; others are of the rows' planes,
// between which the receiver lies. Where one row's triangle ends before the receiver's plane and the other
// row has nothing, so does the receiver's; if both do, it is another triangle that lies between them.
float joined(Edge above, Edge below, float part, bool first) {
    if (first && (above.kind == EDGE_NONE || below.kind == EDGE_NONE)) {
        above.place = above.kind == EDGE_MISSED ? 1.0 : above.place;
        below.place = below.kind == EDGE_MISSED ? 1.0 : below.place;
    }
    bool exact_above = above.kind == EDGE_EXACT;
    bool exact_below = below.kind == EDGE_EXACT;
    float a = exact_above == exact_below || exact_above ? above.place : below.place;
    float b = exact_above == exact_below || exact_below ? below.place : above.place;
    float exact = first ? min(a, b) : max(a, b);
    return exact_above || exact_below ? exact : mix(above.place, below.place, part);
}

// Where the segment is hidden first and last by the first blocker on the way from an end that is
// seen; both 1 if it is not.
vec2 first_hidden(End end, Receiver receiver, vec2 size_texels, float texel_m) {
    vec2 first = floor(end.place - 0.5);
    vec2 middle = (first + 1.0) / size_texels;
    uvec4 texels = gather_outreach(middle, end.outreach, end.backward);
    uvec4 edges = texels & 0xffffu;
    if (all(equal(edges, uvec4(0u)))) {
        return vec2(1.0);
    }
    float part = end.place.y - 0.5 - first.y;
    Blocker above = row_blocker(end, receiver, receiver_row(end, 0u), edges.wz, texel_m);
    Blocker below = row_blocker(end, receiver, receiver_row(end, 1u), edges.xy, texel_m);
    float near = joined(above.near, below.near, part, true);
    return vec2(near, max(joined(above.far, below.far, part, false), near));
}

// Where the surface that hides an end stops hiding the segment, in one row. starts: runs of the texels
// at the receiver's column, the nearer one first.
Edge row_border(End end, Receiver receiver, Row row, uvec2 starts, ivec2 columns, float texel_m) {
    bool near = texel_place(end, row, columns.x, 0.0) < 1.0e30;
    bool other = !near && texel_place(end, row, columns.y, 0.0) < 1.0e30;
    if (!near && !other) {
        return NOWHERE;
    }
    Edge border = edge_at(end, receiver, row, int(near ? starts.x : starts.y) - 1, false, texel_m);
    return border;
}

// Where light can begin beyond what hides an end; 1 if nowhere.
float first_free(End end, Receiver receiver, vec2 size_texels, float texel_m) {
    vec2 first = floor(end.place - 0.5);
    vec2 part = end.place - 0.5 - first;
    uvec4 texels = gather_outreach((first + 1.0) / size_texels, end.outreach, end.backward);
    uvec4 runs = texels >> EDGE_BITS;
    bool right = part.x > 0.5;
    ivec2 columns = int(first.x) + (right ? ivec2(1, 0) : ivec2(0, 1));
    Edge above = row_border(end, receiver, receiver_row(end, 0u), right ? runs.zw : runs.wz, columns,
        texel_m);
    Edge below = row_border(end, receiver, receiver_row(end, 1u), right ? runs.yx : runs.xy, columns,
        texel_m);
    // The blocker is smaller than a texel, or ends within one: it hides no more than the end.
    if (above.kind == EDGE_NONE && below.kind == EDGE_NONE) {
        return 0.0;
    }
    return above.kind == EDGE_NONE ? below.place
        : below.kind == EDGE_NONE ? above.place : joined(above, below, part.y, false);
}

// The nearest of a row's candidates; which: column of a map's edge, -1 for none.
float candidate_place(End end, Row row, uvec2 texels, out int which) {
    float best = 1.0e30;
    which = -1;
    for (uint i = 0u; i < 4u; ++i) {
        uint both = (i & 1u) == 0u ? texels.x : texels.y;
        int stored = int(i < 2u ? both & 0xffffu : both >> EDGE_BITS);
        int column = end.backward ? stored - 1 : int(map_texels()) - stored;
        float t = stored != 0 ? texel_place(end, row, column, 0.0) : 1.0e30;
        which = t < best ? column : which;
        best = min(best, t);
    }
    return best;
}

// Where the segment is hidden first, from candidates: 1 if there is none. Two rows' edges are as one
// only where their depths agree, else one is of another object.
float candidates_hidden(End end, vec2 size_texels) {
    vec2 first = floor(end.place - 0.5);
    uvec4 texels = gather_outreach((first + 1.0) / size_texels, end.outreach, end.backward);
    Row upper = receiver_row(end, 0u);
    Row lower = receiver_row(end, 1u);
    int column_above;
    int column_below;
    float above = candidate_place(end, upper, texels.wz, column_above);
    float below = candidate_place(end, lower, texels.xy, column_below);
    if (column_above < 0 || column_below < 0) {
        return clamp(min(above, below), 0.0, 1.0);
    }
    float depth_above = fetch_map_depth(ivec2(column_above, upper.index), end.layer);
    float depth_below = fetch_map_depth(ivec2(column_below, lower.index), end.layer);
    bool agree = abs(depth_above - depth_below) <= 0.05 * max(depth_above, depth_below);
    float mixed = mix(above, below, end.place.y - 0.5 - first.y);
    return clamp(agree ? mixed : min(above, below), 0.0, 1.0);
}

// Parts of a segment, places from its first end; empty ones end where they begin or before.
struct Parts {
    vec2 first;
    vec2 middle;
    vec2 last;
    vec2 open; // holds the middle part: blockers that neither end sees may hide some of it
};

// A middle part that is shorter is not worth a look at what its ends do not see.
const float LEAST_OPEN = 1.0 / 1024.0;

// The visible parts by the published rules of merging (section 3.4): each penumbra is one part from an
// end that is seen; a receiver in both that neither end sees has what they have in common.
Parts merged_parts(End from, End to, vec2 size_texels) {
    float reach_from = candidates_hidden(from, size_texels);
    float reach_to = candidates_hidden(to, size_texels);
    bool in_from = from.seen || (BY_PLACE != 0u && from.facing && reach_from < 1.0);
    bool in_to = to.seen || (BY_PLACE != 0u && to.facing && reach_to < 1.0);
    vec2 none = vec2(1.0);
    vec2 first = vec2(0.0, reach_from);
    vec2 last = vec2(1.0 - reach_to, 1.0);
    bool overlap = first.y >= last.x;
    if (from.seen && to.seen) {
        return overlap ? Parts(vec2(0.0, 1.0), none, none, none)
            : Parts(first, none, last, none);
    }
    bool common_part = in_from == in_to && reach_from < 1.0 && reach_to < 1.0;
    vec2 middle = common_part ? vec2(last.x, first.y) : none;
    return in_from != in_to ? (in_from ? Parts(first, none, none, none) : Parts(none, none, last, none))
        : Parts(none, middle, none, none);
}

// The visible parts of a segment. From an end that is seen, one part up to its first blocker, and
// perhaps one between that blocker and the one nearest to the other end.
Parts visible_parts(End from, End to, Receiver receiver, vec2 size_texels, float texel_m) {
    if (CANDIDATES != 0u) {
        return merged_parts(from, to, size_texels);
    }
    vec2 hidden_from = from.seen ? first_hidden(from, receiver, size_texels, texel_m) : vec2(0.0);
    vec2 hidden_to = to.seen ? first_hidden(to, receiver, size_texels, texel_m) : vec2(0.0);
    // What is below the receiver's plane is left out by the caller.
    if (!from.seen && from.facing) {
        hidden_from.y = first_free(from, receiver, size_texels, texel_m);
    }
    if (!to.seen && to.facing) {
        hidden_to.y = first_free(to, receiver, size_texels, texel_m);
    }
    vec2 first = vec2(0.0, hidden_from.x);
    vec2 last = vec2(1.0 - hidden_to.x, 1.0);
    vec2 middle = vec2(hidden_from.y, 1.0 - hidden_to.y);
    bool both = from.seen && to.seen;
    if (both && first.y >= last.x) {
        first = vec2(0.0, 1.0);
        last = vec2(1.0);
        middle = vec2(1.0);
    }
    // An end that is seen without a blocker, while the other one is hidden: its edge is narrower than
    // a texel, and the other end's blocker says where it is.
    first.y = from.seen && !to.seen && hidden_from.x >= 1.0 ? 1.0 - hidden_to.y : first.y;
    last.x = to.seen && !from.seen && hidden_to.x >= 1.0 ? hidden_from.y : last.x;
    middle = vec2(max(middle.x, first.y), min(middle.y, last.x));
    if (both && GAPS == 0u) {
        middle = vec2(1.0);
    }
    // The nearest blockers' far ends are only what one end sees of them: both are looked at anew.
    bool open = middle.y - middle.x > LEAST_OPEN;
    return Parts(first, middle, last, open ? vec2(first.y, last.x) : vec2(1.0));
}

#endif
