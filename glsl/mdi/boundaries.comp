#version 460
// Bit k of a texel: something is in bucket k or k - 1, so that the boundary between them is blocked.
// Masks of nearest boundaries are taken as they are.

#include "mdi/params.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0) uniform usampler2DArray masks;
layout(set = 0, binding = 1, r32ui) uniform writeonly uimage2DArray boundaries;

void main() {
    ivec3 place = ivec3(gl_GlobalInvocationID);
    if (any(greaterThanEqual(place, textureSize(masks, 0)))) {
        return;
    }
    uint word = texelFetch(masks, place, 0).x;
    uint carry = place.z % int(WORDS) > 0
        ? texelFetch(masks, place - ivec3(0, 0, 1), 0).x >> 31
        : 0u;
    uint both = word | word << 1 | carry;
    imageStore(boundaries, place, uvec4(MARK_NEAREST != 0u ? word : both));
}
