#version 460
// Visibility through occlusion textures by averages of squares: N-buffers (Decoret 2005), whose
// levels hold squares of 2^level texels from every texel on, or mipmaps.

#include "occlusion_textures/visibility.glsl"

layout(constant_id = 2) const uint MIPMAPS = 0u;
layout(constant_id = 9) const uint LOGARITHMIC = 0u; // levels of N-buffers weighed by log2 of size
layout(constant_id = 10) const uint LEVELS = 1u;     // of N-buffers, one after the other in layers
layout(constant_id = 11) const uint GROUPS = 1u;     // layers of a level

layout(set = 0, binding = 5) uniform sampler2DArray averages;

// A square is at least a texel wide.
vec2 filter_halves(vec2 halves) {
    return max(halves, vec2(0.5));
}

float texture_side() {
    return float(textureSize(averages, 0).x);
}

vec2 level_at(uint group, uint level, vec2 middle) {
    vec2 start = middle - 0.5 * float(1u << level);
    vec2 place = (start + 0.5) / texture_side();
    return textureLod(averages, vec3(place, float(level * GROUPS + group)), 0.0).xy;
}

// Mean over a square of size texels around a point.
vec2 square(uint group, vec2 middle, float size) {
    fetched += MIPMAPS != 0u ? 1.0 : 2.0;
    float exponent = log2(max(size, 1.0));
    if (MIPMAPS != 0u) {
        return textureLod(averages, vec3(middle / texture_side(), float(group)), exponent).xy;
    }
    uint level = min(uint(exponent), LEVELS - 2u);
    float base = float(1u << level);
    float part = LOGARITHMIC != 0u ? exponent - float(level) : size / base - 1.0;
    return mix(level_at(group, level, middle), level_at(group, level + 1u, middle),
        clamp(part, 0.0, 1.0));
}

// A longish kernel takes several squares.
bool is_empty(vec2 low, vec2 high) {
    return false;
}

bool may_block(uint group, Kernel kernel) {
    return holds_anything(group, kernel);
}

vec2 blocked(uint group, Kernel kernel) {
    vec2 size = kernel.high - kernel.low;
    vec2 middle = 0.5 * (kernel.high + kernel.low);
    float shorter = min(size.x, size.y);
    float longer = max(size.x, size.y);
    uint count = uint(clamp(floor(longer / shorter + 0.5), 1.0, 4.0));
    vec2 along = size.x > size.y ? vec2(1.0, 0.0) : vec2(0.0, 1.0);
    float apart = longer / float(count);
    vec2 sum = vec2(0.0);
    for (uint i = 0u; i < count; ++i) {
        vec2 place = middle + along * (apart * (float(i) - 0.5 * float(count - 1u)));
        sum += square(group, place, sqrt(apart * shorter));
    }
    return sum / float(count);
}

float blocked_before(uint group, Kernel kernel) {
    return blocked(group - 1u, kernel).y;
}
