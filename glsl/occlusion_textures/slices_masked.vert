#version 460
// As slices.vert, with what holes depend on.

layout(location = 0) in vec3 position; // scene space, metres
layout(location = 2) in vec2 uv;

layout(push_constant) uniform Push {
    mat4 clip_from_scene;
    vec4 depth;
    vec4 range;
    uint first_slice;
    uint material;
} push;

layout(location = 0) out float depth_m;
layout(location = 1) out vec2 surface_uv;

void main() {
    depth_m = dot(push.depth.xyz, position) + push.depth.w;
    surface_uv = uv;
    gl_Position = push.clip_from_scene * vec4(position, 1.0);
}
