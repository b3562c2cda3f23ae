// What `count.comp` and `count_large.comp` do with a texel.
#ifndef ANTUMBRA_MDI_COUNT_GLSL
#define ANTUMBRA_MDI_COUNT_GLSL

#include "mdi/coverage.glsl"

layout(set = 0, binding = 5, r32ui) uniform uimage2DArray counts;
layout(set = 0, binding = 6, r32ui) uniform uimage2DArray masks;

void cover_texel(ivec2 texel, float z, float nearest, float farthest) {
    vec4 buckets = params.buckets[push.view];
    imageAtomicAdd(counts, ivec3(texel, push.view), 1u);
    // A slanted surface is in every bucket that it passes within the texel, so that no ray finds a
    // gap between it and the next texel's.
    int first = bucket_of(bucket_place(buckets, nearest));
    int last = bucket_of(bucket_place(buckets, farthest));
    for (int word = first >> 5; word <= last >> 5; ++word) {
        uint from = uint(max(first - 32 * word, 0));
        uint to = uint(min(last - 32 * word, 31));
        uint bits = (0xFFFFFFFFu << from) & (0xFFFFFFFFu >> (31u - to));
        imageAtomicOr(masks, ivec3(texel, push.view * WORDS + uint(word)), bits);
    }
}

#endif
