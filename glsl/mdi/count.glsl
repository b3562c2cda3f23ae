// What `count.comp` and `count_large.comp` do with a texel.
#ifndef ANTUMBRA_MDI_COUNT_GLSL
#define ANTUMBRA_MDI_COUNT_GLSL

#include "mdi/coverage.glsl"

layout(set = 0, binding = 5, r32ui) uniform uimage2DArray counts;
layout(set = 0, binding = 6, r32ui) uniform uimage2DArray boundaries;

void cover_texel(ivec2 texel, float z, float nearest, float farthest) {
    imageAtomicAdd(counts, ivec3(texel, push.view), 1u);
    // A slanted surface is in every bucket that it passes within the texel, so that no ray finds a
    // gap between it and the next texel's. What is in bucket k blocks boundaries k and k + 1, or the
    // nearest one alone.
    uvec4 options = params.options;
    vec4 places = params.places[push.view];
    int first = bucket_of(options, place_of(places, depth_s(nearest)));
    int last = bucket_of(options, place_of(places, depth_s(farthest)));
    last = options.y != 0u ? last : min(last + 1, int(options.x) - 1);
    for (int word = first >> 5; word <= last >> 5; ++word) {
        uint from = uint(max(first - 32 * word, 0));
        uint to = uint(min(last - 32 * word, 31));
        uint bits = (0xFFFFFFFFu << from) & (0xFFFFFFFFu >> (31u - to));
        imageAtomicOr(boundaries, ivec3(texel, push.view * words_of(options) + uint(word)), bits);
    }
}

#endif
