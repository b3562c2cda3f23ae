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

// Differences of a row of a table: x of the whole columns of a box, y of the column after them, z of
// its first column.
struct Row {
    uvec2 whole;
    uvec2 more;
    uvec2 less;
};

Row table_row(usampler2DArray tables, ivec2 first, int last, int layer, Sums sums) {
    uvec2 left = pick(texelFetch(tables, ivec3(first, layer), 0), sums.component);
    uvec2 left_next = pick(texelFetch(tables, ivec3(first.x + 1, first.y, layer), 0), sums.component);
    uvec2 right = pick(texelFetch(tables, ivec3(last, first.y, layer), 0), sums.component);
    uvec2 right_next = pick(texelFetch(tables, ivec3(last + 1, first.y, layer), 0), sums.component);
    return Row(right - left, right_next - right, left_next - left);
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

// Sums of two groups of a layer over a box; low and high in texels, 0 to side.
vec2 box_sums(usampler2DArray tables, int layer, Sums sums, vec2 low, vec2 high, float side) {
    vec2 first = min(floor(low), side - 1.0);
    vec2 last = min(floor(high), side - 1.0);
    vec2 before = low - first;
    vec2 beyond = high - last;
    ivec2 from = ivec2(first);
    ivec2 to = ivec2(last);
    Row top = table_row(tables, from, to.x, layer, sums);
    Row top_next = table_row(tables, ivec2(from.x, from.y + 1), to.x, layer, sums);
    Row bottom = table_row(tables, ivec2(from.x, to.y), to.x, layer, sums);
    Row bottom_next = table_row(tables, ivec2(from.x, to.y + 1), to.x, layer, sums);
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

#endif
