// Means over boxes from summed-area tables of whole numbers. Differences come first and are exact,
// also where sums have wrapped; then the fractions of texels at the box's border are weighed.
#ifndef ANTUMBRA_OCCLUSION_TEXTURES_SAT_GLSL
#define ANTUMBRA_OCCLUSION_TEXTURES_SAT_GLSL

#include "occlusion_textures/tables.glsl"

// Where in a texel two groups' sums are.
struct Sums {
    uvec2 component;
    uvec2 shift;
    uint mask;
};

// Of two groups of a layer, by their numbers in it.
Sums sums_of(uvec2 group, bool packed_sums) {
    return packed_sums
        ? Sums((group & 1u) + (group >> 2) * 2u, (group >> 1 & 1u) * 16u, 0xffffu)
        : Sums(group, uvec2(0u), 0xffffffffu);
}

uvec2 pick(uvec4 texel, uvec2 component) {
    return uvec2(texel[component.x], texel[component.y]);
}

uvec2 table_sums(usampler2DArray tables, int x, int y, int layer, Sums sums) {
    return pick(texelFetch(tables, ivec3(x, y, layer), 0), sums.component);
}

// Differences of a row of a table: of the whole columns of a box, of the column after them, and of
// its first column.
struct Row {
    uvec2 whole;
    uvec2 more;
    uvec2 less;
};

// A row of the table from the sums at its ends, left of the first column and right of the last.
Row table_row(usampler2DArray tables, uvec2 left, uvec2 right, ivec3 first_last_y, int layer,
    Sums sums) {
    uvec2 left_next = table_sums(tables, first_last_y.x + 1, first_last_y.z, layer, sums);
    uvec2 right_before = table_sums(tables, first_last_y.y, first_last_y.z, layer, sums);
    return Row(right_before - left, right - right_before, left_next - left);
}

// The difference of two rows, with fractions of the columns at its ends. What fractions take away
// again leaves rounding behind, so the most that it can be off by is there too.
vec2 row_sum(Row a, Row b, vec2 fractions, Sums sums, out vec2 most) {
    vec2 whole = vec2((b.whole - a.whole) >> sums.shift & sums.mask);
    vec2 more = vec2((b.more - a.more) >> sums.shift & sums.mask);
    vec2 less = vec2((b.less - a.less) >> sums.shift & sums.mask);
    most = whole + more;
    return whole + more * fractions.y - less * fractions.x;
}

// Sums of two groups of a layer over a box; low and high in texels, 0 to side. If `early`, where
// nothing in the texels that the box touches counts, most of it is not looked at and both are 0: where
// both groups have nothing, and for `by_difference` also where they have the same.
vec2 box_sums(usampler2DArray tables, int layer, Sums sums, vec2 low, vec2 high, float side,
    bool early, bool by_difference, inout float fetched) {
    vec2 first = min(floor(low), side - 1.0);
    vec2 last = min(floor(high), side - 1.0);
    vec2 before = low - first;
    vec2 beyond = high - last;
    ivec2 from = ivec2(first);
    ivec2 to = ivec2(last);
    uvec2 top_left = table_sums(tables, from.x, from.y, layer, sums);
    uvec2 top_right = table_sums(tables, to.x + 1, from.y, layer, sums);
    uvec2 bottom_left = table_sums(tables, from.x, to.y + 1, layer, sums);
    uvec2 bottom_right = table_sums(tables, to.x + 1, to.y + 1, layer, sums);
    uvec2 outer = (bottom_right - bottom_left - top_right + top_left) >> sums.shift & sums.mask;
    fetched += 4.0;
    if (early && outer.x == outer.y && (by_difference || outer.y == 0u)) {
        return vec2(0.0);
    }
    fetched += 12.0;
    uvec2 left = table_sums(tables, from.x, from.y + 1, layer, sums);
    uvec2 right = table_sums(tables, to.x + 1, from.y + 1, layer, sums);
    Row top = table_row(tables, top_left, top_right, ivec3(from.x, to.x, from.y), layer, sums);
    Row top_next = table_row(tables, left, right, ivec3(from.x, to.x, from.y + 1), layer, sums);
    left = table_sums(tables, from.x, to.y, layer, sums);
    right = table_sums(tables, to.x + 1, to.y, layer, sums);
    Row bottom = table_row(tables, left, right, ivec3(from.x, to.x, to.y), layer, sums);
    Row bottom_next = table_row(tables, bottom_left, bottom_right, ivec3(from.x, to.x, to.y + 1),
        layer, sums);
    vec2 columns = vec2(before.x, beyond.x);
    vec2 most;
    vec2 most_more;
    vec2 most_less;
    vec2 sum = row_sum(top, bottom, columns, sums, most);
    vec2 more = row_sum(bottom, bottom_next, columns, sums, most_more);
    vec2 less = row_sum(top, top_next, columns, sums, most_less);
    sum += more * beyond.y - less * before.y;
    // Rounding must not darken what nothing blocks.
    most += most_more;
    return mix(vec2(0.0), sum, greaterThan(sum, 2.0e-6 * most));
}

// Whether a group's sum is 0 in all texels that a box touches.
bool box_is_empty(usampler2DArray tables, int layer, Sums sums, vec2 low, vec2 high, float side) {
    ivec2 from = ivec2(clamp(floor(low), vec2(0.0), vec2(side - 1.0)));
    ivec2 to = ivec2(clamp(floor(high), vec2(0.0), vec2(side - 1.0))) + 1;
    uvec2 sum = table_sums(tables, to.x, to.y, layer, sums) - table_sums(tables, from.x, to.y, layer, sums)
        - table_sums(tables, to.x, from.y, layer, sums) + table_sums(tables, from.x, from.y, layer, sums);
    return (sum.x >> sums.shift.x & sums.mask) == 0u;
}

#endif
