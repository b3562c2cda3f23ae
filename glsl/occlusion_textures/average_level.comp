#version 460
// The next level of N-buffers: squares of twice the size from four of the level before, outside of
// which is nothing; or of mipmaps.

#include "occlusion_textures/groups.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(constant_id = 0) const uint MIPMAPS = 0u;

layout(set = 0, binding = 0) uniform sampler2DArray finer;
layout(set = 0, binding = 1, std140) uniform GroupBlock {
    SliceGroups groups;
};
layout(set = 0, binding = 2, rgba16f) uniform writeonly image2DArray level;

layout(push_constant) uniform Push {
    int apart; // texels between squares of the level before
} push;

vec4 square(ivec3 place) {
    bool inside = all(lessThan(place.xy, textureSize(finer, 0).xy));
    return inside ? texelFetch(finer, place, 0) : vec4(0.0);
}

void main() {
    ivec3 place = ivec3(gl_GlobalInvocationID);
    if (any(greaterThanEqual(place.xy, imageSize(level).xy)) || gl_GlobalInvocationID.z >= groups.count.x) {
        return;
    }
    ivec3 from = MIPMAPS != 0u ? ivec3(2 * place.xy, place.z) : place;
    int apart = MIPMAPS != 0u ? 1 : push.apart;
    imageStore(level, place, 0.25 * (square(from) + square(from + ivec3(apart, 0, 0))
        + square(from + ivec3(0, apart, 0)) + square(from + ivec3(apart, apart, 0))));
}
