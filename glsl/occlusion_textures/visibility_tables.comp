#version 460
// Visibility through occlusion textures by their summed-area tables.

#include "occlusion_textures/visibility.glsl"
#include "occlusion_textures/sat.glsl"

layout(constant_id = 2) const uint PACKED = 1u; // two sums in a component
layout(constant_id = 3) const uint LAYERS = 1u; // of a set of tables: the second set of COMBINE_BOUNDED
                                                // holds what all groups up to one block

const float LEAST = 0.5; // half a texel: below it edges would show the texels

layout(set = 0, binding = 5) uniform usampler2DArray tables;

// A table is smooth within its texels, which alone blurs by the variance of a texel: the box takes the rest.
vec2 filter_halves(vec2 halves) {
    return max(sqrt(max(halves * halves - 0.25, 0.0)), LEAST);
}

float texture_side() {
    return float(textureSize(tables, 0).x - 1);
}

// Means of two groups of a layer over a kernel, of which the part outside of the image is empty.
// `by_difference`: only their difference is asked for.
vec2 means_over(uint table, uvec2 group, Kernel kernel, bool by_difference) {
    float side = texture_side();
    vec2 size = (kernel.high - kernel.low) * DETAIL;
    Sums sums = sums_of(group, PACKED != 0u);
    vec2 blocked_texels = box_sums(tables, int(table), sums, clamp(kernel.low, 0.0, side),
        clamp(kernel.high, 0.0, side), side, EARLY != 0u, by_difference, fetched);
    // What is all blocked must not let rounding through.
    return clamp(blocked_texels * (1.0 + 4.0e-6) / (size.x * size.y), 0.0, 1.0);
}

const uint EACH = PACKED != 0u ? GROUPS_A_PACKED_TEXEL : GROUPS_A_TEXEL;

float mean_over(uint set_layer, uint group, Kernel kernel) {
    return means_over(set_layer + group / EACH, uvec2(group % EACH), kernel, false).x;
}

bool is_empty(vec2 low, vec2 high) {
    if (COMBINE != COMBINE_CUMULATIVE) {
        return false;
    }
    // All groups up to the last.
    uint last = groups.count.x - 1u;
    fetched += 4.0;
    return box_is_empty(tables, int(last / EACH), sums_of(uvec2(last % EACH), PACKED != 0u), low, high,
        texture_side());
}

bool may_block(uint group, Kernel kernel) {
    // Tables themselves tell that as soon.
    return COMBINE == COMBINE_CUMULATIVE || holds_anything(group, kernel);
}

vec2 blocked(uint group, Kernel kernel) {
    if (COMBINE == COMBINE_CUMULATIVE) {
        // What it adds is the difference of what it and those before it block together.
        uint within = group % EACH;
        if (within > 0u) {
            vec2 means = means_over(group / EACH, uvec2(within - 1u, within), kernel, true);
            return vec2(max(means.y - means.x, 0.0), means.y);
        }
        float all = mean_over(0u, group, kernel);
        float before = all > 0.0 && group > 0u ? mean_over(0u, group - 1u, kernel) : 0.0;
        return vec2(max(all - before, 0.0), all);
    }
    float own = mean_over(0u, group, kernel);
    return vec2(own, COMBINE == COMBINE_BOUNDED ? mean_over(LAYERS, group, kernel) : own);
}

float blocked_before(uint group, Kernel kernel) {
    return mean_over(LAYERS, group - 1u, kernel);
}
