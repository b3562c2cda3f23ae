// Which samples of the light a receiver sees: bits in rows, set where a triangle blocks.
//
// Samples lie on a plane (of a sun: its directions on the plane at distance 1), in rows. What an edge
// hides, as seen from the receiver, ends at a line on that plane, which parts each row at one column:
// a triangle is the AND of three such half-planes, and of a fourth where its own plane passes between
// samples, behind which it does not block. Blockers are ORed: what overlaps counts once. Related:
// Eisemann and Decoret 2007, "Visibility Sampling on GPU and Applications"; Schwarz and Stamminger 2007,
// "Bitmask Soft Shadows".
#ifndef ANTUMBRA_SHAFT_MASKS_MASKS_GLSL
#define ANTUMBRA_SHAFT_MASKS_MASKS_GLSL

#include "common/light.glsl"
#include "common/materials.glsl"
#include "shaft_masks/shaft.glsl"
#include "shaft_masks/words.glsl"

// 1 where triangles of the scene may have holes.
layout(constant_id = 3) const uint MASKED = 0u;

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
        return LightFrom(center, light.axis_x.xyz * light.axis_x.w, light.axis_y.xyz * light.axis_y.w);
    }
    // The disk bounded by the sphere's outline.
    float square = max(dot(center, center), 1.0e-37);
    float rest = max(1.0 - light.axis_x.w * light.axis_x.w / square, 0.0);
    vec3 along = center * inversesqrt(square);
    vec3 near = abs(dot(along, light.axis_x.xyz)) < 0.9 ? light.axis_x.xyz : light.axis_y.xyz;
    vec3 x = normalize(near - along * dot(near, along));
    float outline = light.axis_x.w * sqrt(rest);
    return LightFrom(center * rest, outline * x, outline * cross(along, x));
}

struct MaskReceiver {
    vec3 position; // scene space, metres
    uint id;       // of its triangle, plus one; 0 for none
    float rounding_m;
    LightFrom light;
};

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

// Adding 1.5 * 2^23 leaves a float's integer part in its lowest bits.
const float TO_INTEGER = 12582912.0;

uint columns_from(float column) {
    precise float shifted = clamp(column, 0.0, float(COLUMNS)) + TO_INTEGER;
    uint first = floatBitsToUint(shifted) & 63u;
    return COLUMNS == 32u && first == 32u ? 0u : 0xffffffffu << first;
}

// The column that the line parts a row at.
float line_column(vec4 row, float slope, float at) {
    precise float place = slope * row.x + at;
    if (LIGHT_SHAPE == LIGHT_SUN) {
        return row.y * (place * inversesqrt(row.w + place * place * SUN_TANGENT_SQUARE)) + row.z;
    }
    return row.y * place + row.z;
}

// ANDs what is within the line to the rows.
void and_line(vec3 line, inout uint rows[ROWS]) {
    // A line along the rows crosses them far out: there only its side counts.
    float least = 1.0e-8 * (abs(line.y) + abs(line.z)) + 1.0e-37;
    float across = abs(line.x) < least ? (line.x < 0.0 ? -least : least) : line.x;
    float inverse = -1.0 / across;
    float slope = line.y * inverse;
    float at = line.z * inverse;
    uint flip = across < 0.0 ? 0xffffffffu : 0u;
    for (uint r = 0u; r < ROWS; ++r) {
        rows[r] &= columns_from(line_column(params.rows[r], slope, at)) ^ flip;
    }
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

// Takes out the samples that are seen through holes. ab, bc, ca: the lines of the triangle's edges.
void cut_holes(Blocker blocker, vec3 ab, vec3 bc, vec3 ca, uint blocked[ROWS], inout uint rows[ROWS]) {
    uint material = material_number(blocker.plane.w);
    for (uint r = 0u; r < ROWS; ++r) {
        vec4 row = params.rows[r];
        // What others block already needs no look.
        uint rest = rows[r] & ALL_COLUMNS & ~blocked[r];
        while (rest != 0u) {
            uint column = uint(findLSB(rest));
            rest &= rest - 1u;
            float place = (float(column) + 0.5 - row.z) / max(row.y, 1.0e-37);
            if (LIGHT_SHAPE == LIGHT_SUN) {
                float scaled = place * place * SUN_TANGENT_SQUARE;
                place *= sqrt(row.w / max(1.0 - scaled, 1.0e-6));
            }
            vec3 at = vec3(place, row.x, 1.0);
            vec3 weights = vec3(dot(bc, at), dot(ca, at), dot(ab, at));
            float sum = weights.x + weights.y + weights.z;
            weights = sum != 0.0 ? weights / sum : vec3(1.0, 0.0, 0.0);
            if (is_hole(material, fetch_uv(blocker.triangle, weights))) {
                rows[r] &= ~(1u << column);
            }
        }
    }
}

// Sets the bits of the samples that the triangle hides from the receiver.
void add_blocker(MaskReceiver receiver, Blocker blocker, inout uint blocked[ROWS]) {
    vec3 a = blocker.a - receiver.position;
    vec3 b = blocker.b - receiver.position;
    vec3 c = blocker.c - receiver.position;
    float height = dot(blocker.plane.xyz, a);
    float turn = height > 0.0 ? 1.0 : -1.0;
    vec3 ab = line_of_plane(receiver.light, turn * exact_cross(a, b));
    vec3 bc = line_of_plane(receiver.light, turn * exact_cross(b, c));
    vec3 ca = line_of_plane(receiver.light, turn * exact_cross(c, a));
    vec3 beyond = line_of_plane(receiver.light, turn * blocker.plane.xyz);
    beyond.z -= LIGHT_SHAPE == LIGHT_SUN ? 0.0 : abs(height);
    float most = min(min(line_most(ab), line_most(bc)), min(line_most(ca), line_most(beyond)));
    bool meets = most >= 0.0 && abs(height) > receiver.rounding_m
        && receiver.id != blocker.triangle + 1u;
    if (meets) {
        uint rows[ROWS];
        for (uint r = 0u; r < ROWS; ++r) {
            rows[r] = 0xffffffffu;
        }
        and_line(ab, rows);
        and_line(bc, rows);
        and_line(ca, rows);
        if (line_least(beyond) < 0.0) {
            and_line(beyond, rows);
        }
        if (MASKED != 0u && material_is_masked(blocker.plane.w)) {
            cut_holes(blocker, ab, bc, ca, blocked, rows);
        }
        for (uint r = 0u; r < ROWS; ++r) {
            blocked[r] |= rows[r];
        }
    }
}

// What the receiver's own plane leaves of the light.
void start_mask(MaskReceiver receiver, vec3 normal, out uint blocked[ROWS]) {
    for (uint r = 0u; r < ROWS; ++r) {
        blocked[r] = 0xffffffffu;
    }
    vec3 above = line_of_plane(receiver.light, normal);
    if (line_most(above) > 0.0) {
        and_line(above, blocked);
        for (uint r = 0u; r < ROWS; ++r) {
            blocked[r] = line_least(above) > 0.0 ? 0u : ~blocked[r];
        }
    }
}

float mask_visibility(uint blocked[ROWS]) {
    int seen = 0;
    for (uint r = 0u; r < ROWS; ++r) {
        seen += bitCount(~blocked[r] & ALL_COLUMNS);
    }
    return float(seen) / float(ROWS * COLUMNS);
}

#endif
