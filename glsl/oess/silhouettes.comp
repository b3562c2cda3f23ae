#version 460
// Visibility of a line light from occluding edges of the mesh, instead of those of pixels (the future work
// of Reimann and Dreier).
//
// A receiver and the line span a plane, in which a direction to a place of the line meets a number of
// surfaces on its way. Along the line this number changes only where the plane cuts an edge that is a
// silhouette from the receiver: by the faces that are more on one side of it than on the other. So the
// changes at the edges of the receiver's tile give the number everywhere but for a constant, and the line
// is seen where it is 0. The constant is known where the line's centre is seen; else a ray to where the
// least surfaces are tells whether these are none.
//
// Points of the plane have homogeneous coordinates: with L + t E the line and d a point from the receiver,
// d = w (L + t E). w is 1 on the line, and u = w t. Whether an edge is cut is a matter of the sides of the plane
// that its ends are on (turns.glsl).

#include "common/light.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "dbuffer/entries.glsl"
#include "dbuffer/params.glsl"
#include "dbuffer/through.glsl"
#include "oess/params.glsl"
#include "oess/profile.glsl"
#include "oess/turns.glsl"
#include "silhouettes/sides.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

// 1 for a light that varies along its length. (2 is in dbuffer/ray.glsl.)
layout(constant_id = 3) const uint PROFILE = 0u;

layout(set = 0, binding = 0, std140) uniform View {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform Block {
    DbufferParams params;
};
layout(set = 0, binding = 2, std140) uniform LineBlock {
    vec4 start; // xyz: the line's first point, scene space; w: its length, metres
    vec4 axis;  // xyz: unit vector along the line; w: cells of its profile, 0 for an even light
    vec4 profile[MAX_PROFILE]; // oess/params.glsl
} line;
layout(set = 0, binding = 3) uniform sampler2D view_depth;
layout(set = 0, binding = 4) uniform usampler2D ids;
layout(set = 0, binding = 5) uniform sampler2D triangles;
layout(set = 0, binding = 6) uniform sampler2D hierarchy;
layout(set = 0, binding = 7) uniform usampler2D edges;
layout(set = 0, binding = 8) uniform sampler2D points;
layout(set = 0, binding = 9) uniform usampler2D numbers;
// Storage images: software drivers read them faster than textures.
layout(set = 0, binding = 10, rgba32f) uniform readonly image2D ends;
layout(set = 0, binding = 11, r32ui) uniform readonly uimage2D pool;
layout(set = 0, binding = 12, rgba32ui) uniform readonly uimage2D spans;
layout(set = 0, binding = 13) uniform usampler2D lists;
layout(set = 0, binding = 14) uniform sampler2D hard;
layout(set = 0, binding = 15, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 16, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 17) uniform usampler2D list;
layout(set = 0, binding = 18, std140) uniform ThroughBlock {
    Through through;
};

layout(set = 0, binding = 19, rgba32f) uniform readonly image2D turns;

#include "dbuffer/ray.glsl"

// Edges before a receiver's line that are kept at a time. Few receivers have as many; those go through their edges
// again for those further along the line.
const uint MOST_KEPT = 10u;

// Turns of loops after which a receiver looks at no further edge, but sends rays to what is left of the line. A software
// driver may end loops after 65,535 turns of a receiver and those beside it; steps of rays (MOST_STEPS) are counted
// apart.
const uint MOST_TURNS = 4096u;

// Turns that an edge takes: loops within, which software drivers go through once at least.
const uint EDGE_TURNS = 4u;

// Places of the line that rays go to where edges are not known.
const uint CELLS = 32u;

// What positions are rounded by, as a part of the largest coordinate that they are made from.
const float POSITION_ROUNDING = 1.0 / 2097152.0;

// Part of the line within which an edge may hide the centre or not by rounding, and that is too narrow to tell by
// whether it has fewer surfaces: edges that lie on each other, as those of a triangle without area do, may part so far.
const float NEAR = 1.0 / 4096.0;

// Square of the sine of the angle at the line's axis within which a receiver sees the line as a point.
const float ON_AXIS = 1.0e-10;

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

vec4 fetch_node_texel(ivec2 place) {
    return texelFetch(hierarchy, place, 0);
}

// Scenes with holes in their triangles do not come here.
vec4 fetch_material_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_uv_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_footprint(ivec2 place) {
    return vec4(0.0);
}

uvec4 fetch_edge_texel(ivec2 place) {
    return texelFetch(edges, place, 0);
}

vec4 fetch_point_texel(ivec2 place) {
    return texelFetch(points, place, 0);
}

uint fetch_pool_texel(ivec2 place) {
    return imageLoad(pool, place).x;
}

uvec4 fetch_list_texel(ivec2 place) {
    return texelFetch(lists, place, 0);
}

float profile_cells() {
    return PROFILE != 0u ? line.axis.w : 0.0;
}

vec4 fetch_profile(uint cell) {
    return line.profile[cell];
}

struct LineReceiver {
    vec3 p;           // scene space, metres
    vec3 n;           // unit normal, towards the camera
    float rounding_m; // what heights are rounded by
    vec3 from;        // L, from p
    vec3 along;       // E
    vec2 across;      // across_line
    vec2 range;       // of the line, above the receiver's plane
    vec3 row_u;       // of the coordinates above
    vec3 row_w;
};

LineReceiver line_receiver(vec3 p, vec3 n, float rounding_m) {
    LineReceiver r;
    r.p = p;
    r.n = n;
    r.rounding_m = rounding_m;
    r.from = line.start.xyz - p;
    r.along = line.axis.xyz * line.start.w;
    r.across = across_line(view.light, p);
    float height_from = dot(n, r.from);
    float height_to = height_from + dot(n, r.along);
    float crossing = height_from / (height_from - height_to);
    r.range = vec2(height_from > 0.0 ? 0.0 : (height_to > 0.0 ? crossing : 1.0),
        height_to > 0.0 ? 1.0 : (height_from > 0.0 ? crossing : 0.0));
    vec3 across = cross(r.along, r.from);
    float square = max(dot(across, across), 1.0e-37);
    r.row_u = cross(r.from, across) / square;
    r.row_w = cross(across, r.along) / square;
    return r;
}

// Where the receiver's plane cuts an edge that it cuts, as a part of what is looked at of the line; -1 if nowhere
// that matters. a, b: ends from the receiver; sides: side_of_line of both.
float edge_place(LineReceiver r, vec3 a, vec3 b, vec2 sides) {
    vec3 x = mix(a, b, sides.x / (sides.x - sides.y));
    float w = dot(r.row_w, x);
    float t = dot(r.row_u, x) / max(w, 1.0e-30);
    float place = (t - r.range.x) / (r.range.y - r.range.x);
    bool before = w > r.rounding_m * length(r.row_w) && w < 1.0 && dot(r.n, x) > r.rounding_m;
    return before && place > 0.0 && place < 1.0 ? place : -1.0;
}

// Edges in order: the place along the line in units of 2^-24, and below it by how much the number of surfaces rises
// there. Loops of known length alone ask for them, so that drivers may keep them in registers: memory that each lane
// reads at a place of its own is slow. (Hints to unroll are too much for SwiftShader's compiler.)
uint kept[MOST_KEPT];
uint found_edges;
uint turns_taken;
// Changes before the line's centre, x without and y with what is within rounding of it.
vec2 before_center;

const uint CHANGE_BITS = 8u;
const float PLACES = 16777216.0;
const uint END = 0xffffff00u; // of the line
const uint NO_EDGE = 0xffffffffu;

float place_of(uint edge) {
    return edge < END ? float(edge >> CHANGE_BITS) / PLACES : 1.0;
}

int change_of(uint edge) {
    return int(edge << 32u - CHANGE_BITS) >> 32u - CHANGE_BITS;
}

// Puts an edge in where it belongs; the last one goes.
void keep(uint edge) {
    uint before = 0u;
    for (uint i = 0u; i < MOST_KEPT; ++i) {
        uint here = kept[i];
        kept[i] = max(before, min(edge, here));
        before = here;
    }
}

// a, b: its ends, scene space. start: the first place that is looked at.
void add_edge(LineReceiver r, uint number, vec3 a, vec3 b, float place, bool rises, float center, uint start) {
    float faces = faces_on_one_side(r.p, 1.0, fetch_edge(number), a, b);
    // Along the line one comes to the positive side of the plane through receiver and edge, if the edge rises.
    float change = rises ? faces : -faces;
    before_center += change * vec2(lessThan(vec2(place), center + vec2(-NEAR, NEAR)));
    // No edge has as many faces as there is no room for.
    uint low = uint(int(clamp(change, -127.0, 127.0))) & (1u << CHANGE_BITS) - 1u;
    uint edge = uint(place * PLACES) << CHANGE_BITS | low;
    bool counts = change != 0.0 && edge >= start;
    keep(counts ? edge : NO_EDGE);
    found_edges += counts ? 1u : 0u;
}

// Entries of a list, up to four: those that are not done, a bit for each.
struct Four {
    uint first;  // place of the first in the pool, or its number
    bool listed; // whether they are in the pool
    uint left;
};

// The next entries of a list, or of what it does not know, and which of them may matter.
Four next_four(inout Entries entries, uint turn) {
    Four four;
    four.listed = entries.rest > 0u;
    uint texel = entries.slot / SPANS;
    uint passed = entries.missing % SPANS; // of a texel's silhouettes
    four.first = four.listed ? entries.chunk * (CHUNK + 1u) + entries.slot : entries.missing - passed;
    uint most = texel == SPAN_TEXELS - 1u ? SPANS - 1u : SPANS;
    uint count = four.listed ? min(entries.rest, most) : min(entries.end - four.first, SPANS);
    uint chunk = four.listed ? entries.chunk : params.counts.w;
    uvec4 found = imageLoad(spans, span_place(chunk, four.listed ? texel : entries.missing / SPANS));
    four.left = in_spans(found, turn) & (1u << count) - 1u;
    four.left &= four.listed ? 0xffffffffu : 0xffffffffu << passed;
    bool last = texel == SPAN_TEXELS - 1u;
    entries.chunk = last ? found.w : entries.chunk;
    entries.slot = last ? 0u : entries.slot + SPANS;
    entries.rest -= four.listed ? count : 0u;
    entries.missing += four.listed ? 0u : count - passed;
    return four;
}

// As add_edges in dbuffer/visibility.comp: lanes look for what matters to them in loops of their own.
void add_edges(uint tile, uint tiles, LineReceiver r, float center, uint start) {
    uint turn = uint(turn_of(r.across)) & TURN_STEPS - 1u;
    for (uint block = 0u; block < blocks_of(tile, tiles, params.sizes.x); ++block) {
        Entries entries = list_entries(block, tile, tiles);
        Four four = Four(0u, false, 0u);
        while ((four.left != 0u || has_entries(entries)) && turns_taken < MOST_TURNS) {
            while (four.left == 0u && has_entries(entries)) {
                four = next_four(entries, turn);
                turns_taken += 1u;
            }
            turns_taken += EDGE_TURNS;
            if (four.left != 0u) {
                uint at = four.first + uint(findLSB(four.left));
                four.left &= four.left - 1u;
                uint entry = four.listed ? imageLoad(pool, triangle_texel_place(at)).x : at;
                vec4 turns_of = imageLoad(turns, triangle_texel_place(entry));
                vec2 sides = vec2(side_of_line(r.across, turns_of.xy), side_of_line(r.across, turns_of.zw));
                if ((sides.x > 0.0) != (sides.y > 0.0)) {
                    vec3 a = imageLoad(ends, triangle_texel_place(2u * entry)).xyz;
                    vec3 b = imageLoad(ends, triangle_texel_place(2u * entry + 1u)).xyz;
                    float place = edge_place(r, a - r.p, b - r.p, sides);
                    if (place >= 0.0) {
                        uint number = texelFetch(numbers, triangle_texel_place(entry), 0).x;
                        add_edge(r, number, a, b, place, sides.y > 0.0, center, start);
                    }
                }
            }
        }
    }
}

// A part of the line: its begin, and the number of surfaces there; the end of what is known.
struct Part {
    float from;
    int number;
    uint end;
};

// A number of surfaces, and a place that has it: the middle of the widest part of the line with so many.
struct Level {
    int number;
    float place;
};

const int NONE = 0x7fffffff;

// The least number of surfaces of a part.
Level least_number(Part part) {
    Level found = Level(NONE, 0.5);
    float widest = 0.0;
    int number = part.number;
    float from = part.from;
    for (uint i = 0u; i <= MOST_KEPT; ++i) {
        uint edge = i < MOST_KEPT ? min(kept[i], part.end) : part.end;
        float to = place_of(edge);
        float room = to - from;
        bool better = room > NEAR && (number < found.number || (number == found.number && room > widest));
        found.place = better ? 0.5 * (from + to) : found.place;
        found.number = better ? number : found.number;
        widest = better ? room : widest;
        number += change_of(edge);
        from = to;
    }
    return found;
}

vec3 to_line(LineReceiver r, float place) {
    return r.from + mix(r.range.x, r.range.y, place) * r.along;
}

float light_in(LineReceiver r, float from, float to) {
    return light_before(mix(r.range.x, r.range.y, to)).x - light_before(mix(r.range.x, r.range.y, from)).x;
}

// The light after a place of the line that rays to the middles of cells reach.
float traced(LineReceiver r, float from, inout uint steps) {
    float width = 1.0 / float(CELLS);
    uint count = uint(ceil((1.0 - from) * float(CELLS)));
    float sum = 0.0;
    float done = 0.0;
    for (uint i = 0u; i < count && steps < MOST_STEPS; ++i) {
        float to = 1.0 - float(i) * width;
        float begin = max(to - width, from);
        bool blocked = ray_is_blocked(
            r.p, to_line(r, 0.5 * (begin + to)), false, params.counts.z, r.rounding_m, SOLID, steps);
        bool known = blocked || steps < MOST_STEPS;
        float light = known ? light_in(r, begin, to) : 0.0;
        done += light;
        sum += blocked ? 0.0 : light;
    }
    float all = count > 0u ? light_in(r, from, 1.0) : 0.0;
    return done > 0.0 ? sum / done * all : all;
}

// What is known of a receiver's line.
struct Sight {
    bool known; // whether it is seen where there are at most so many surfaces:
    int most;
    int hidden; // where there are so many it is not
    uint steps; // of rays so far
};

// Finds out where a part of the line is seen. center: how many surfaces the centre is behind, at least.
void look(LineReceiver r, Part part, int center, bool first, bool center_above, bool center_seen, inout Sight sight) {
    Level level = least_number(part);
    sight.most = first ? center : sight.most;
    // A centre that is seen behind more surfaces than are elsewhere is a contradiction that a ray decides.
    sight.known = sight.known || (first && center_seen && level.number >= center);
    // Nothing to find out where as few surfaces hide all, and where no edge is.
    bool settled = sight.known || level.number >= sight.hidden || (first && found_edges == 0u && center_above);
    if (!settled) {
        vec3 to = to_line(r, level.place);
        sight.known = !ray_is_blocked(r.p, to, false, params.counts.z, r.rounding_m, SOLID, sight.steps);
        sight.most = level.number;
        sight.hidden = sight.known ? sight.hidden : level.number;
    }
}

// The light of a part of the line that is seen. Goes on to the end of the part.
float light_of_part(LineReceiver r, inout Part part, Sight sight) {
    float sum = 0.0;
    float before = light_before(mix(r.range.x, r.range.y, part.from)).x;
    for (uint i = 0u; i <= MOST_KEPT; ++i) {
        uint edge = i < MOST_KEPT ? min(kept[i], part.end) : part.end;
        float after = light_before(mix(r.range.x, r.range.y, place_of(edge))).x;
        sum += sight.known && part.number <= sight.most ? after - before : 0.0;
        part.number += change_of(edge);
        before = after;
    }
    part.from = place_of(part.end);
    return sum;
}

float pixel_visibility(uvec2 pixel, uint tile, uint tiles) {
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
    vec3 extent = max(max(abs(p), abs(view.camera.eye.xyz)), abs(view.light.center.xyz));
    float rounding_m = POSITION_ROUNDING * max(extent.x, max(extent.y, extent.z));
    LineReceiver r = line_receiver(p, n, rounding_m);
    if (r.range.x >= r.range.y) {
        return 0.0;
    }
    float center = (0.5 - r.range.x) / (r.range.y - r.range.x);
    bool center_above = center > NEAR && center < 1.0 - NEAR;
    bool center_seen = center_above && texelFetch(hard, ivec2(pixel), 0).x > 0.0;
    vec3 across = cross(r.along, r.from);
    if (dot(across, across) <= ON_AXIS * dot(r.along, r.along) * dot(r.from, r.from)) {
        return center_seen ? light_in(r, 0.0, 1.0) : 0.0;
    }
    bool listed = edges_of(tile, tiles, params.sizes.x) <= params.sizes.z && through.cut.x == 0u;
    Part part = Part(0.0, 0, listed ? END : 0u);
    Sight sight = Sight(false, NONE, NONE, 0u);
    float sum = 0.0;
    uint start = 0u;
    bool more = listed;
    turns_taken = 0u;
    while (more) {
        for (uint i = 0u; i < MOST_KEPT; ++i) {
            kept[i] = NO_EDGE;
        }
        before_center = vec2(0.0);
        found_edges = 0u;
        add_edges(tile, tiles, r, center, start);
        bool done = turns_taken < MOST_TURNS;
        // Edges in the last place may be more than there was room for.
        bool crowded = found_edges > MOST_KEPT;
        part.end = !done ? start : (crowded ? kept[MOST_KEPT - 1u] & END : END);
        int center_number = int(min(before_center.x, before_center.y));
        look(r, part, center_number, start == 0u, center_above, center_seen, sight);
        sum += light_of_part(r, part, sight);
        more = crowded && part.end != start;
        start = part.end;
    }
    sum += traced(r, part.from, sight.steps);
    return clamp(sum, 0.0, 1.0);
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 size = params.counts.xy;
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(spread_entry(index, arguments.count), tiles), 0).x;
    uvec2 pixel = tile_of_entry(entry, tiles) * TILE_SIZE + gl_LocalInvocationID.xy;
    if (any(greaterThanEqual(pixel, size))) {
        return;
    }
    float result = pixel_visibility(pixel, entry, tiles.x * tiles.y);
    imageStore(visibility, ivec2(pixel), vec4(result));
}
