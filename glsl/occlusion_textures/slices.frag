#version 460
// The slice that a surface lies in as a bit, joined with what is there by a logic operation.

layout(push_constant) uniform Push {
    mat4 clip_from_scene;
    vec4 depth;
    vec4 range;
    uint first_slice;
    uint material;
} push;

layout(location = 0) in float depth_m;

layout(location = 0) out uvec4 bits;

#include "occlusion_textures/bits.glsl"

void main() {
    bits = slice_bit(depth_m, push.range);
}
