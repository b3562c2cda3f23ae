#version 460
// Marks the slice that a surface lies in.

layout(push_constant) uniform Push {
    mat4 clip_from_scene;
    vec4 depth;
    vec4 range;
    uint first_slice;
    uint material;
} push;

layout(location = 0) in float depth_m;

#include "occlusion_textures/marks.glsl"

void main() {
    write_slice(depth_m, push.range, push.first_slice);
}
