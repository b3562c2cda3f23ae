// Which samples of the light a receiver sees: bits in rows, set where a triangle blocks.
//
// Samples lie on a plane (of a sun: its directions on the plane at distance 1), in rows. Triangles wholly
// between receiver and plane are projected onto it: an edge then parts each row that it crosses at one
// column. Others are the AND of three half-planes, and of a fourth where their own plane passes between
// samples, behind which they do not block. Blockers are ORed: what overlaps counts once. Related:
// Eisemann and Decoret 2007, "Visibility Sampling on GPU and Applications"; Schwarz and Stamminger 2007,
// "Bitmask Soft Shadows".
#ifndef ANTUMBRA_SHAFT_MASKS_MASKS_GLSL
#define ANTUMBRA_SHAFT_MASKS_MASKS_GLSL

#include "common/holes.glsl"
#include "common/light.glsl"
#include "shaft_masks/shaft.glsl"
#include "shaft_masks/words.glsl"

// 1 where triangles of the scene may have holes.
layout(constant_id = 3) const uint MASKED = 0u;
// 1 for tiles with no triangles but whole ones, whose surfaces have all of the light above them: a pipeline of its own,
// because a driver without branches goes through what it does for others.
layout(constant_id = 2) const uint PLAIN = 0u;
// 1 for a sun of at most 5.7 degrees, where the square of the tangent of half of that is at most 0.0025.
layout(constant_id = 8) const uint SMALL_SUN = 0u;

// The light as a receiver sees it: its samples are center + u x + v y, from the receiver.
struct LightFrom {
    vec3 center;
    vec3 x;
    vec3 y;
};

LightFrom light_from(Light light, vec3 p) {
    vec3 center = light_offset(light, p);
    if (LIGHT_SHAPE == LIGHT_POINT) {
        return LightFrom(center, vec3(0.0), vec3(0.0));
    } else if (LIGHT_SHAPE == LIGHT_LINE) {
        return LightFrom(center, light.axis_x.xyz * light.axis_x.w, vec3(0.0));
    } else if (LIGHT_SHAPE != LIGHT_SPHERE) {
        vec3 axis_x = light.axis_x.xyz * light.axis_x.w;
        vec3 axis_y = light.axis_y.xyz * light.axis_y.w;
        if (LIGHT_SHAPE != LIGHT_RECT) {
            turn_axes(axis_x, axis_y);
        }
        return LightFrom(center, axis_x, axis_y);
    }
    // The disk bounded by the sphere's outline.
    float square = max(dot(center, center), 1.0e-37);
    float rest = max(1.0 - light.axis_x.w * light.axis_x.w / square, 0.0);
    vec3 along = center * inversesqrt(square);
    vec3 near = abs(dot(along, light.axis_x.xyz)) < NEAR_AXIS ? light.axis_x.xyz : light.axis_y.xyz;
    vec3 x = normalize(near - along * dot(near, along));
    vec3 y = cross(along, x);
    turn_axes(x, y);
    float outline = light.axis_x.w * sqrt(rest);
    return LightFrom(center * rest, outline * x, outline * y);
}

// How far along the second axis rows rise for one unit along the first.
float row_rise() {
    return LIGHT_SHAPE == LIGHT_RECT ? 1.0 / float(ROWS * params.pattern.x) : 0.0;
}

// The light in coordinates in which rows are level.
LightFrom rows_from(Light light, vec3 p) {
    LightFrom straight = light_from(light, p);
    return LightFrom(straight.center, straight.x + row_rise() * straight.y, straight.y);
}

struct MaskReceiver {
    vec3 position; // scene space, metres
    uint id;       // of its triangle, plus one; 0 for none
    bool in_part;  // whether its tile's part is the one at work
};

// The rows of a block of samples: params.rows, columns from the block's first one on.
vec4 light_rows[ROWS];
// Four times y and z, z plus 1.5.
vec2 light_quads[ROWS];

// Of a line, whose rows lie one after the other: the block's first sample, and the bits of a row's number of samples.
int line_first;
int line_bits;

void fetch_light_rows(uint block) {
    uint across = params.pattern.x;
    line_bits = findMSB(COLUMNS * across);
    line_first = int((block / across * ROWS << line_bits) + block % across * COLUMNS);
    for (uint r = 0u; r < ROWS; ++r) {
        light_rows[r] = params.rows[block / across * ROWS + r];
        light_rows[r].z -= float(block % across * COLUMNS);
        light_quads[r] = 4.0 * light_rows[r].yz + vec2(0.0, 1.5);
    }
}

// Adding 1.5 * 2^23 leaves a float's integer part in its lowest bits.
const float TO_INTEGER = 12582912.0;
const int TO_INTEGER_BITS = 0x4b400000;

// Four times the number of a row's samples that lie before a place, 0 to 32: rounded from above 4 n - 2, so that
// the sample at a whole column plus 0.5 is the next one's neighbour.
uint whole_quads(float quad) {
    // Floats of one sign are in the order of their bits.
    precise float shifted = quad + TO_INTEGER;
    return uint(clamp(floatBitsToInt(shifted), TO_INTEGER_BITS, TO_INTEGER_BITS + 33)) & 60u;
}

uint quads_before(uint r, float place) {
    vec2 row = light_quads[r];
    if (LIGHT_SHAPE == LIGHT_SUN && SMALL_SUN != 0u) {
        // The root's series to its second power: near the sun the rest is less than rounding. The factor is at least 5/6
        // everywhere, so that what is far out stays out.
        float more = (light_rows[r].w - 1.0) + place * place * SUN_TANGENT_SQUARE;
        return whole_quads(row.x * (place * (1.0 + more * (0.375 * more - 0.5))) + row.y);
    } else if (LIGHT_SHAPE == LIGHT_SUN) {
        return whole_quads(row.x * (place * inversesqrt(light_rows[r].w + place * place * SUN_TANGENT_SQUARE)) + row.y);
    }
    return whole_quads(row.x * place + row.y);
}

// Number of a row's samples that lie before the place, 0 to 8.
uint columns_before(uint r, float place) {
    return quads_before(r, place) >> 2;
}

// Axes that points are taken along before they are projected, from a base. They are the same for all receivers, so that
// this is done once for several; only those of a sphere turn with the receiver.
struct Axes {
    vec3 base;
    vec3 x;
    vec3 y;
    vec3 z; // across the plane of the samples
};

// in_rows: for coordinates in which rows are level and, of a rectangle, four times a column wide; else those of the light.
Axes axes_from(vec3 base, bool in_rows) {
    LightFrom light = light_from(view.light, base);
    vec3 x = light.x / max(dot(light.x, light.x), 1.0e-37);
    vec3 y = light.y / max(dot(light.y, light.y), 1.0e-37) - (in_rows ? row_rise() : 0.0) * x;
    float columns = in_rows && LIGHT_SHAPE == LIGHT_RECT ? 4.0 * params.rows[0].y : 1.0;
    return Axes(base, columns * x, y, cross(light.x, light.y));
}

// A point along the axes; of a sphere's, which turn with the receiver, only from the base.
vec3 along_axes(Axes axes, vec3 p) {
    precise vec3 offset = p - axes.base;
    if (LIGHT_SHAPE == LIGHT_SPHERE) {
        return offset;
    }
    precise vec3 along = vec3(dot(offset, axes.x), dot(offset, axes.y), dot(offset, axes.z));
    return along;
}

// What projects points onto the plane of the samples, as coordinates on the light.
struct Projection {
    vec3 from; // the receiver, along the axes
    Axes own;  // of a sphere
    vec2 middle;
    float height; // of the plane over the receiver, along the third axis
    bool turned;  // for the receiver y is clockwise of x
};

Projection projection_from(Axes axes, vec3 position) {
    Projection projection;
    projection.from = along_axes(axes, position);
    projection.own = LIGHT_SHAPE == LIGHT_SPHERE ? axes_from(position, true) : axes;
    vec3 center = light_offset(view.light, position);
    if (LIGHT_SHAPE == LIGHT_SPHERE) {
        center = light_from(view.light, position).center;
    }
    float height = dot(projection.own.z, center);
    projection.middle = vec2(dot(projection.own.x, center), dot(projection.own.y, center));
    projection.height = abs(height) < 1.0e-37 ? 1.0e-37 : height;
    projection.turned = height > 0.0;
    return projection;
}

// point: along the axes.
vec2 project(Projection projection, vec3 point) {
    precise vec3 offset = point - projection.from;
    if (LIGHT_SHAPE == LIGHT_SPHERE) {
        precise vec3 along = vec3(dot(offset, projection.own.x), dot(offset, projection.own.y),
            dot(offset, projection.own.z));
        offset = along;
    }
    precise float scale = projection.height / offset.z;
    precise vec2 result = offset.xy * scale - projection.middle;
    return result;
}

// A projected edge from its lower to its upper end, so that it is the same line for both its triangles.
struct Side {
    vec2 low;
    float high;
    float slope;
};

Side side_between(vec2 a, vec2 b) {
    precise float slope = (b.x - a.x) / (b.y - a.y);
    return Side(a.y < b.y ? a : b, a.y < b.y ? b.y : a.y, slope);
}

// Four times the number of a row's samples before the edge; of no meaning in rows that it does not cross.
uint quads_before_side(uint r, Side side) {
    precise float place = (light_rows[r].x - side.low.y) * side.slope + side.low.x;
    return LIGHT_SHAPE == LIGHT_RECT ? whole_quads(place + light_quads[r].y) : quads_before(r, place);
}

uint columns_before_side(uint r, Side side) {
    return quads_before_side(r, side) >> 2;
}

// All bits where a side crosses a row, none where not. From the signs of differences, which are exact: a driver may
// take much longer over what two comparisons have in common.
int crossing(vec4 row, Side side) {
    precise float from_low = row.x - side.low.y;
    precise float from_high = row.x - side.high;
    return (~floatBitsToInt(from_low) & floatBitsToInt(from_high)) >> 31;
}

// Numbers of triangles before samples: a word of eight digits for each row. Below nothing there is some room for
// rounding, and above it for 13 triangles. Sums of edges may leave that range on their way; where their end does,
// digits spill into each other. Then their sum is not that of the numbers, which is kept beside them.
const uint NO_DIGITS = 0x22222222u;
const uint ONE_DIGIT = 0x11111111u;

struct Edge {
    Side side;
    bool ends; // triangles end there, and do not begin
};

Edge project_edge(Projection projection, vec3 from, vec3 to, uint code) {
    vec2 a = project(projection, from);
    vec2 b = project(projection, to);
    // Corners of a triangle that is seen from its front go round counter-clockwise, and its inside is on
    // the left of edges that go up.
    bool ends = (a.y < b.y) == (((code & EDGE_TURNED) != 0u) == projection.turned);
    return Edge(side_between(a, b), ends);
}

// Counts on from an edge. sum: a quarter of it for all samples, in all rows, beside the digits.
void count_edge(Projection projection, vec3 from, vec3 to, uint code, inout uint digits[ROWS], inout int sum) {
    Edge edge = project_edge(projection, from, to, code);
    int weight = (code & EDGE_DOUBLE) != 0u ? 2 : 1;
    weight = edge.ends ? -weight : weight;
    uint step = ONE_DIGIT * uint(weight);
    int quads = 0;
    for (uint r = 0u; r < ROWS; ++r) {
        uint before = quads_before_side(r, edge.side);
        int rest = crossing(light_rows[r], edge.side) & (int(before) - 32);
        digits[r] += step << (before & 31u) & uint(rest >> 31);
        quads += rest;
    }
    sum -= weight * quads;
}

// The samples with another number than none; 0 with fits false where digits spilled.
uvec2 counted_mask(uint digits[ROWS], int sum, out bool fits) {
    uvec2 blocked = uvec2(0u);
    uint total = 0u;
    for (uint r = 0u; r < ROWS; ++r) {
        uint pairs = (digits[r] & 0x0f0f0f0fu) + (digits[r] >> 4 & 0x0f0f0f0fu);
        total += pairs * 0x01010101u >> 24;
        uint off = digits[r] ^ NO_DIGITS;
        off |= off >> 2;
        off = (off | off >> 1) & ONE_DIGIT;
        off = (off | off >> 3) & 0x03030303u;
        off = (off | off >> 6) & 0x000f000fu;
        blocked[r / 4u] |= ((off | off >> 12) & 0xffu) << (8u * (r % 4u));
    }
    fits = 4 * (int(total) - int(2u * COLUMNS * ROWS)) == sum;
    return fits ? blocked : uvec2(0u);
}

// The same with half a word for each sample, four words a row: for as many triangles as a list may hold.
const uint NO_HALVES = 0x00080008u;
const uint ONE_HALF = 0x00010001u;
const uint HALVES = COLUMNS / 2u;

void count_edge_in_halves(Projection projection, vec3 from, vec3 to, uint code, inout uint halves[HALVES * ROWS]) {
    Edge edge = project_edge(projection, from, to, code);
    uint step = (code & EDGE_DOUBLE) != 0u ? 2u * ONE_HALF : ONE_HALF;
    step = edge.ends ? 0u - step : step;
    for (uint r = 0u; r < ROWS; ++r) {
        uint before = columns_before_side(r, edge.side);
        uint crossed = step & uint(crossing(light_rows[r], edge.side));
        for (uint i = 0u; i < HALVES; ++i) {
            halves[HALVES * r + i] += before <= 2u * i ? crossed : before == 2u * i + 1u ? crossed << 16 : 0u;
        }
    }
}

uvec2 counted_mask_of_halves(uint halves[HALVES * ROWS]) {
    uvec2 blocked = uvec2(0u);
    for (uint r = 0u; r < ROWS; ++r) {
        for (uint i = 0u; i < HALVES; ++i) {
            uint off = halves[HALVES * r + i] ^ NO_HALVES;
            uint pair = ((off & 0xffffu) != 0u ? 1u : 0u) | (off >> 16 != 0u ? 2u : 0u);
            blocked[r / 4u] |= pair << (8u * (r % 4u) + 2u * i);
        }
    }
    return blocked;
}

// Sets the bits of the samples that a triangle hides which is between the receiver and their plane.
void add_whole(Projection projection, vec3 corner_a, vec3 corner_b, vec3 corner_c, inout uvec2 blocked) {
    vec2 a = project(projection, corner_a);
    vec2 b = project(projection, corner_b);
    vec2 c = project(projection, corner_c);
    // From the lowest to the highest.
    vec2 low = a.y < b.y ? a : b;
    vec2 high = a.y < b.y ? b : a;
    vec2 first = low.y < c.y ? low : c;
    vec2 rest = low.y < c.y ? c : low;
    vec2 middle = rest.y < high.y ? rest : high;
    vec2 last = rest.y < high.y ? high : rest;
    Side whole = side_between(first, last);
    Side lower = side_between(first, middle);
    Side upper = side_between(middle, last);
    for (uint r = 0u; r < ROWS; ++r) {
        vec4 row = light_rows[r];
        bool below = row.x < middle.y;
        Side other = Side(below ? lower.low : upper.low, 0.0, below ? lower.slope : upper.slope);
        uint within = 0xffu << columns_before_side(r, whole) ^ 0xffu << columns_before_side(r, other);
        blocked[r / 4u] |= (within & 0xffu & uint(crossing(row, whole))) << (8u * (r % 4u));
    }
}

// Line on the light: samples with x u + y v + z >= 0 are within.
vec3 line_of_plane(LightFrom light, vec3 normal) {
    return vec3(dot(normal, light.x), dot(normal, light.y), dot(normal, light.center));
}

// The most that a line is positive by, anywhere on the light.
float line_most(vec3 line) {
    return line.z + abs(line.x) + abs(line.y);
}

float line_least(vec3 line) {
    return line.z - abs(line.x) - abs(line.y);
}

// The samples of a line from the place on.
uvec2 line_mask_from(float place) {
    vec4 row = params.rows[0];
    float most = 8.0 * row.y; // four times the number of all samples
    precise float shifted = clamp(4.0 * (row.y * place + row.z) + 1.5, 0.0, most + 1.5) + TO_INTEGER;
    int before = int((floatBitsToUint(shifted) & 0xffffu) >> 2) - line_first;
    int rows = before >> line_bits;
    int bit = clamp(int(COLUMNS) * rows + min(before - (rows << line_bits), int(COLUMNS)), 0, int(COLUMNS * ROWS));
    uint low = ~0u << (bit & 31);
    return uvec2(bit < 32 ? low : 0u, bit < 32 ? ~0u : bit < 64 ? low : 0u);
}

// Where a line on the light crosses the row at y: at slope y + at. The samples before that are within where before is
// set, else the others.
struct Crossing {
    float slope;
    float at;
    bool before;
};

Crossing crossing_of_line(vec3 line) {
    // A line along the rows crosses them far out: there only its side counts.
    float least = 1.0e-8 * (abs(line.y) + abs(line.z)) + 1.0e-37;
    float across = abs(line.x) < least ? (line.x < 0.0 ? -least : least) : line.x;
    float inverse = -1.0 / across;
    return Crossing(line.y * inverse, line.z * inverse, across < 0.0);
}

// The samples within the line.
uvec2 mask_of_line(vec3 line) {
    Crossing crossing = crossing_of_line(line);
    if (LIGHT_SHAPE == LIGHT_LINE) {
        return line_mask_from(crossing.at) ^ (crossing.before ? ~0u : 0u);
    }
    uint flip = crossing.before ? 0xffu : 0u;
    uvec2 within = uvec2(0u);
    for (uint r = 0u; r < ROWS; ++r) {
        precise float place = crossing.slope * light_rows[r].x + crossing.at;
        uint row = (0xffu << columns_before(r, place) ^ flip) & 0xffu;
        within[r / 4u] |= row << (8u * (r % 4u));
    }
    return within;
}

// The samples within all of the lines; the last one counts if so said. Of each row those between the last crossing that
// they are behind and the first one that they are before: two places are made to columns, and not one for each line.
const uint LINES = 4u;
const float FAR_ALONG = 1.0e6;

uvec2 mask_of_lines(vec3 lines[LINES], bool last_counts) {
    Crossing crossings[LINES];
    for (uint i = 0u; i < LINES; ++i) {
        crossings[i] = crossing_of_line(lines[i]);
    }
    // Slope and place of where a row's samples within a line begin and end: level and far out where they do not.
    vec4 ends[LINES];
    for (uint i = 0u; i < LINES; ++i) {
        bool counts = i < LINES - 1u || last_counts;
        vec2 line = vec2(crossings[i].slope, crossings[i].at);
        ends[i].xy = counts && !crossings[i].before ? line : vec2(0.0, -FAR_ALONG);
        ends[i].zw = counts && crossings[i].before ? line : vec2(0.0, FAR_ALONG);
    }
    uvec2 within = uvec2(0u);
    if (LIGHT_SHAPE == LIGHT_LINE) {
        // All rows are one.
        float first = -FAR_ALONG;
        float end = FAR_ALONG;
        for (uint i = 0u; i < LINES; ++i) {
            first = ends[i].y > first ? ends[i].y : first;
            end = ends[i].w < end ? ends[i].w : end;
        }
        return line_mask_from(first) & ~line_mask_from(end);
    }
    for (uint r = 0u; r < ROWS; ++r) {
        float first = -FAR_ALONG;
        float end = FAR_ALONG;
        for (uint i = 0u; i < LINES; ++i) {
            precise float low = ends[i].x * light_rows[r].x + ends[i].y;
            precise float high = ends[i].z * light_rows[r].x + ends[i].w;
            first = low > first ? low : first;
            end = high < end ? high : end;
        }
        uint row = 0xffu << columns_before(r, first) & ~(0xffu << columns_before(r, end)) & 0xffu;
        within[r / 4u] |= row << (8u * (r % 4u));
    }
    return within;
}

precise vec3 exact_cross(vec3 a, vec3 b) {
    precise vec3 left = a.yzx * b.zxy;
    precise vec3 right = a.zxy * b.yzx;
    precise vec3 result = left - right;
    return result;
}

struct Blocker {
    uint triangle;
    vec3 a;
    vec3 b;
    vec3 c;
    vec4 plane; // as stored: unit normal, material
};

Blocker fetch_blocker(uint triangle) {
    return Blocker(triangle, fetch_triangle_texel(4u * triangle).xyz,
        fetch_triangle_texel(4u * triangle + 1u).xyz, fetch_triangle_texel(4u * triangle + 2u).xyz,
        fetch_triangle_texel(4u * triangle + 3u));
}

// The samples that a triangle hides from a receiver, wherever it is, without regard to holes; and the lines on the light
// that its corners' weights, not scaled, vary along.
struct Hidden {
    uvec2 within;
    mat3 weights;
};

// A triangle as lines on the light, of its edges and its plane.
struct Outline {
    vec3 ab;
    vec3 bc;
    vec3 ca;
    vec3 beyond;
    bool meets; // whether it may hide any sample
};

Outline outline_of(MaskReceiver receiver, LightFrom light, Blocker blocker) {
    vec3 a = blocker.a - receiver.position;
    vec3 b = blocker.b - receiver.position;
    vec3 c = blocker.c - receiver.position;
    vec3 extent = max(abs(receiver.position), LIGHT_SHAPE == LIGHT_SUN ? vec3(0.0) : abs(view.light.center.xyz));
    float rounding_m = POSITION_ROUNDING * max(extent.x, max(extent.y, extent.z));
    float height = dot(blocker.plane.xyz, a);
    float turn = height > 0.0 ? 1.0 : -1.0;
    Outline outline;
    outline.ab = line_of_plane(light, turn * exact_cross(a, b));
    outline.bc = line_of_plane(light, turn * exact_cross(b, c));
    outline.ca = line_of_plane(light, turn * exact_cross(c, a));
    outline.beyond = line_of_plane(light, turn * blocker.plane.xyz);
    // What lies in the plane of the samples hides none of them, as what lies in the receiver does not hide it.
    outline.beyond.z -= LIGHT_SHAPE == LIGHT_SUN ? 0.0 : abs(height) + 4.0 * rounding_m;
    float most = lesser(lesser(line_most(outline.ab), line_most(outline.bc)),
        lesser(line_most(outline.ca), line_most(outline.beyond)));
    outline.meets = most >= 0.0 && abs(height) > rounding_m && receiver.id != blocker.triangle + 1u;
    return outline;
}

Hidden hidden_by(MaskReceiver receiver, LightFrom light, Blocker blocker) {
    Outline outline = outline_of(receiver, light, blocker);
    uvec2 within = mask_of_lines(vec3[](outline.ab, outline.bc, outline.ca, outline.beyond),
        line_least(outline.beyond) < 0.0);
    return Hidden(outline.meets ? within : uvec2(0u), mat3(outline.bc, outline.ca, outline.ab));
}

// Takes out the samples that are seen through holes, of four receivers: each invocation looks at one sample after the
// other, whosoever it is, because a vector of them waits for the one that has the most. already: what others hide.
void cut_holes(Blocker blocker, uint block, uvec2 already[4], inout Hidden hidden[4]) {
    uint material = material_number(blocker.plane.w);
    Holes holes = fetch_holes(material);
    // Along the columns the coordinates of the corners, and ones.
    vec4 ab = fetch_uv_texel(triangle_texel_place(2u * blocker.triangle));
    vec2 c = fetch_uv_texel(triangle_texel_place(2u * blocker.triangle + 1u)).xy;
    vec3 us = vec3(ab.x, ab.z, c.x);
    vec3 vs = vec3(ab.y, ab.w, c.y);
    mat3 places[4];
    uvec2 rest[4];
    [[unroll]] for (uint i = 0u; i < 4u; ++i) {
        places[i] = mat3(hidden[i].weights * us, hidden[i].weights * vs, hidden[i].weights * vec3(1.0));
        rest[i] = hidden[i].within & ~already[i];
    }
    uint across = params.pattern.x;
    while (((rest[0].x | rest[0].y | rest[1].x | rest[1].y) | (rest[2].x | rest[2].y | rest[3].x | rest[3].y)) != 0u) {
        uint at = (rest[0].x | rest[0].y) != 0u ? 0u : (rest[1].x | rest[1].y) != 0u ? 1u
            : (rest[2].x | rest[2].y) != 0u ? 2u : 3u;
        uvec2 own = at == 0u ? rest[0] : at == 1u ? rest[1] : at == 2u ? rest[2] : rest[3];
        mat3 place = at == 0u ? places[0] : at == 1u ? places[1] : at == 2u ? places[2] : places[3];
        uint word = own.x != 0u ? 0u : 1u;
        uint bits = own.x != 0u ? own.x : own.y;
        uint bit = uint(findLSB(bits));
        uvec2 taken = own.x != 0u ? uvec2(1u << bit, 0u) : uvec2(0u, 1u << bit);
        vec4 row = params.rows[block / across * ROWS + 4u * word + bit / 8u];
        float column = float(block % across * COLUMNS + bit % 8u);
        float x = (column + 0.5 - row.z) / max(row.y, 1.0e-37);
        if (LIGHT_SHAPE == LIGHT_SUN) {
            x *= sqrt(row.w / max(1.0 - x * x * SUN_TANGENT_SQUARE, 1.0e-6));
        }
        vec3 uvw = vec3(x, row.x, 1.0) * place;
        vec2 uv = uvw.z != 0.0 ? uvw.xy / uvw.z : ab.xy;
        bool hole = is_hole_at(holes, uv);
        [[unroll]] for (uint i = 0u; i < 4u; ++i) {
            uvec2 mine = i == at ? taken : uvec2(0u);
            rest[i] &= ~mine;
            hidden[i].within &= hole ? ~mine : uvec2(0xffffffffu);
        }
    }
}

// What the receiver's own plane hides of the light.
uvec2 own_mask(LightFrom light, vec3 normal) {
    vec3 above = line_of_plane(light, normal);
    return line_most(above) <= 0.0 ? uvec2(0xffffffffu)
        : line_least(above) > 0.0 ? uvec2(0u) : ~mask_of_line(above);
}

#endif
