#version 460
// 32 channels of marks become the bits of one word.

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0) uniform sampler2DArray marks;
layout(set = 0, binding = 1, r32ui) uniform writeonly uimage2D word;

void main() {
    ivec2 place = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(place, imageSize(word)))) {
        return;
    }
    uint bits = 0u;
    for (int layer = 0; layer < 8; ++layer) {
        uvec4 set = uvec4(greaterThan(texelFetch(marks, ivec3(place, layer), 0), vec4(0.5)));
        bits |= (set.x | set.y << 1 | set.z << 2 | set.w << 3) << (4 * layer);
    }
    imageStore(word, place, uvec4(bits));
}
