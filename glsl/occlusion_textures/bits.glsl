// A bit for the slice that a depth lies in: 128 in four words.
#ifndef ANTUMBRA_OCCLUSION_TEXTURES_BITS_GLSL
#define ANTUMBRA_OCCLUSION_TEXTURES_BITS_GLSL

#include "occlusion_textures/slice_of.glsl"

uvec4 slice_bit(float z, vec4 range) {
    float slice = slice_of(z, range);
    uint index = uint(max(slice, 0.0));
    uint bit = slice < 0.0 ? 0u : 1u << (index & 31u);
    return mix(uvec4(0u), uvec4(bit), equal(uvec4(index >> 5), uvec4(0u, 1u, 2u, 3u)));
}

#endif
