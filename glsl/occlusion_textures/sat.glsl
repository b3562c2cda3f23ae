// Means over boxes from summed-area tables of whole numbers. Differences come first and are exact,
// also where sums have wrapped; then the fractions of texels at the box's border are weighed.
#ifndef ANTUMBRA_OCCLUSION_TEXTURES_SAT_GLSL
#define ANTUMBRA_OCCLUSION_TEXTURES_SAT_GLSL

// Entries (i.x, i.y), (i.x + 1, i.y), (i.x + 1, i.y + 1), (i.x, i.y + 1) of a table in w, z, y, x.
uvec4 gather_table(uint layer, vec2 i);

// Sum over a box of what the two halves of a table's words count; low and high in texels, 0 to side.
// PACKED_SUMS: x: lower half, y: upper half; else all of the word in x.
vec2 box_sums(uint layer, vec2 low, vec2 high, float side, bool packed_sums) {
    vec2 first = min(floor(low), side - 1.0);
    vec2 last = min(floor(high), side - 1.0);
    vec2 before = low - first;
    vec2 beyond = high - last;
    uvec4 a = gather_table(layer, first);
    uvec4 b = gather_table(layer, vec2(last.x, first.y));
    uvec4 c = gather_table(layer, vec2(first.x, last.y));
    uvec4 d = gather_table(layer, last);
    // Columns at first.x, first.x + 1, last.x, last.x + 1; rows first.y, + 1, last.y, + 1.
    uvec4 left = uvec4(a.w, a.x, c.w, c.x);
    uvec4 left_next = uvec4(a.z, a.y, c.z, c.y);
    uvec4 right = uvec4(b.w, b.x, d.w, d.x);
    uvec4 right_next = uvec4(b.z, b.y, d.z, d.y);
    uvec4 whole = right - left;
    uvec4 more = right_next - right;
    uvec4 less = left_next - left;
    uvec3 whole_box = uvec3(whole.z - whole.x, whole.w - whole.z, whole.y - whole.x);
    uvec3 more_box = uvec3(more.z - more.x, more.w - more.z, more.y - more.x);
    uvec3 less_box = uvec3(less.z - less.x, less.w - less.z, less.y - less.x);
    vec3 rows = vec3(1.0, beyond.y, -before.y);
    if (packed_sums) {
        vec3 low_sums = vec3(dot(vec3(whole_box & 0xffffu), rows), dot(vec3(more_box & 0xffffu), rows),
            dot(vec3(less_box & 0xffffu), rows));
        vec3 high_sums = vec3(dot(vec3(whole_box >> 16), rows), dot(vec3(more_box >> 16), rows),
            dot(vec3(less_box >> 16), rows));
        vec3 columns = vec3(1.0, beyond.x, -before.x);
        return vec2(dot(low_sums, columns), dot(high_sums, columns));
    }
    vec3 sums = vec3(dot(vec3(whole_box), rows), dot(vec3(more_box), rows), dot(vec3(less_box), rows));
    // Fractions that cancel leave rounding behind, which must not darken what nothing blocks.
    float sum = dot(sums, vec3(1.0, beyond.x, -before.x));
    float most = float(whole_box.x) + float(more_box.x) + float(less_box.x);
    return vec2(sum > 2.0e-6 * most ? sum : 0.0, 0.0);
}

#endif
