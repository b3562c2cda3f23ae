#version 460
// The next level of the pyramid: 2x2 texels of the one before.

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0) uniform usampler2D finer;
layout(set = 0, binding = 1, rgba32ui) uniform writeonly uimage2D level;

void main() {
    ivec2 place = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(place, imageSize(level)))) {
        return;
    }
    ivec2 at = 2 * place;
    imageStore(level, place,
        texelFetch(finer, at, 0) | texelFetch(finer, at + ivec2(1, 0), 0)
            | texelFetch(finer, at + ivec2(0, 1), 0) | texelFetch(finer, at + ivec2(1, 1), 0));
}
