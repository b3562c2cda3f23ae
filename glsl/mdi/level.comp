#version 460
// The next level of the pyramid: boundaries that are blocked anywhere in 2x2 texels.

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0) uniform usampler2DArray finer;
layout(set = 0, binding = 1, r32ui) uniform writeonly uimage2DArray coarser;

void main() {
    ivec3 place = ivec3(gl_GlobalInvocationID);
    if (any(greaterThanEqual(place, imageSize(coarser)))) {
        return;
    }
    ivec2 last = textureSize(finer, 0).xy - 1;
    uint bits = 0u;
    for (int i = 0; i < 4; ++i) {
        ivec2 from = min(2 * place.xy + ivec2(i & 1, i >> 1), last);
        bits |= texelFetch(finer, ivec3(from, place.z), 0).x;
    }
    imageStore(coarser, place, uvec4(bits));
}
