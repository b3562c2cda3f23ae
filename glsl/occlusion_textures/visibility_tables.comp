#version 460
// Visibility through occlusion textures by their summed-area tables.

#include "occlusion_textures/visibility.glsl"
#include "occlusion_textures/sat.glsl"

layout(constant_id = 2) const uint PACKED = 1u; // both sums of a group in one word

layout(set = 0, binding = 5) uniform usampler2DArray tables;

uvec4 gather_table(uint layer, vec2 i) {
    float side = float(textureSize(tables, 0).x);
    return textureGather(tables, vec3((i + 1.0) / side, float(layer)));
}

float texture_side() {
    return float(textureSize(tables, 0).x - 1);
}

// Sums over the part of a kernel that is in the image; outside is nothing.
vec2 sums_over(uint layer, Kernel kernel) {
    float side = texture_side();
    vec2 size = (kernel.high - kernel.low) * DETAIL;
    vec2 sums = box_sums(layer, clamp(kernel.low, 0.0, side), clamp(kernel.high, 0.0, side), side,
        PACKED != 0u);
    // What is all blocked must not let rounding through.
    fetched += 4.0;
    return clamp(sums * (1.0 + 4.0e-6) / (size.x * size.y), 0.0, 1.0);
}

vec2 blocked(uint group, Kernel kernel) {
    if (PACKED != 0u) {
        return sums_over(group, kernel);
    }
    if (COMBINE == COMBINE_CUMULATIVE) {
        float all_nearer = sums_over(group, kernel).x;
        float before = group > 0u ? sums_over(group - 1u, kernel).x : 0.0;
        return vec2(max(all_nearer - before, 0.0), all_nearer);
    }
    float own = sums_over(2u * group, kernel).x;
    return vec2(own, COMBINE >= COMBINE_CUMULATIVE ? sums_over(2u * group + 1u, kernel).x : own);
}

float blocked_before(uint group, Kernel kernel) {
    return PACKED != 0u ? sums_over(group - 1u, kernel).y : sums_over(2u * group - 1u, kernel).x;
}
