#version 460
// What part of each texel each group blocks (or adds to what nearer ones block), and what part it and all groups nearer to the light
// block together.

#include "occlusion_textures/groups.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(constant_id = 1) const int FINER = 1;   // texels of the bits across
layout(constant_id = 3) const uint ADDED = 1u; // of a group only what no nearer one blocks

layout(set = 0, binding = 0) uniform usampler2D bits;
layout(set = 0, binding = 1, std140) uniform GroupBlock {
    SliceGroups groups;
};
layout(set = 0, binding = 2, rgba16f) uniform writeonly image2DArray averages;

void main() {
    ivec3 place = ivec3(gl_GlobalInvocationID);
    uint group = gl_GlobalInvocationID.z;
    if (any(greaterThanEqual(place.xy, imageSize(averages).xy)) || group >= groups.count.x) {
        return;
    }
    uvec4 before = uvec4(0u);
    for (uint i = 0u; i < group; ++i) {
        before |= groups.masks[i];
    }
    uvec4 own = groups.masks[group];
    vec2 sum = vec2(0.0);
    for (int sub = 0; sub < FINER * FINER; ++sub) {
        ivec2 at = FINER * place.xy + ivec2(sub % FINER, sub / FINER);
        uvec4 found = texelFetch(bits, at, 0);
        bool hidden = ADDED != 0u && (found & before) != uvec4(0u);
        sum += vec2((found & own) != uvec4(0u) && !hidden, (found & (before | own)) != uvec4(0u));
    }
    imageStore(averages, place, vec4(sum / float(FINER * FINER), 0.0, 0.0));
}
