#version 460
// 32 channels of marks become the bits of one word; the words before it are there already.

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0) uniform sampler2DArray marks;
layout(constant_id = 0) const uint WORD = 0u;

layout(set = 0, binding = 1, rgba32ui) uniform uimage2D words;

void main() {
    ivec2 place = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(place, imageSize(words)))) {
        return;
    }
    uint bits = 0u;
    for (int layer = 0; layer < 8; ++layer) {
        uvec4 set = uvec4(greaterThan(texelFetch(marks, ivec3(place, layer), 0), vec4(0.5)));
        bits |= (set.x | set.y << 1 | set.z << 2 | set.w << 3) << (4 * layer);
    }
    uvec4 found = WORD == 0u ? uvec4(0u) : imageLoad(words, place);
    found[WORD] = bits;
    imageStore(words, place, found);
}
