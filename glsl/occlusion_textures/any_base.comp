#version 460
// The slices that are marked anywhere in 4x4 texels: the first level of a pyramid.

layout(local_size_x = 8, local_size_y = 8) in;

layout(constant_id = 0) const int WORDS = 4; // that the image has; others read as 0, 0, 1

layout(set = 0, binding = 0) uniform usampler2D bits;
layout(set = 0, binding = 1, rgba32ui) uniform writeonly uimage2D level;

void main() {
    ivec2 place = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(place, imageSize(level)))) {
        return;
    }
    uvec4 found = uvec4(0u);
    for (int i = 0; i < 16; ++i) {
        found |= texelFetch(bits, 4 * place + ivec2(i & 3, i >> 2), 0);
    }
    bvec4 there = lessThan(ivec4(0, 1, 2, 3), ivec4(WORDS));
    imageStore(level, place, mix(uvec4(0u), found, there));
}
