// What `fill.comp` and `fill_large.comp` do with a texel.
#ifndef ANTUMBRA_MDI_FILL_GLSL
#define ANTUMBRA_MDI_FILL_GLSL

#include "mdi/coverage.glsl"

layout(set = 0, binding = 5, r32ui) uniform uimage2DArray counts;
layout(set = 0, binding = 6) uniform usampler2DArray heads;
layout(set = 0, binding = 7, r32ui) uniform writeonly uimage2D lists;

void cover_texel(ivec2 texel, float z, float nearest, float farthest) {
    uvec2 head = texelFetch(heads, ivec3(texel, push.view), 0).xy;
    if (head.y > 0u) {
        uint slot = imageAtomicAdd(counts, ivec3(texel, push.view), 0xFFFFFFFFu) - 1u;
        imageStore(lists, list_place(head.x + slot), uvec4(floatBitsToUint(z)));
    }
}

#endif
