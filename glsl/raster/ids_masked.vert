#version 460
// As ids.vert, with what the holes of a triangle depend on.

layout(location = 0) in vec3 position; // scene space, metres
layout(location = 1) in uint triangle;
layout(location = 2) in vec2 uv;

layout(location = 0) flat out uint triangle_plus_one;
layout(location = 1) out vec2 surface_uv;

layout(push_constant) uniform Push {
    mat4 clip_from_scene;
    uint material;
} push;

void main() {
    triangle_plus_one = triangle + 1u;
    surface_uv = uv;
    gl_Position = push.clip_from_scene * vec4(position, 1.0);
}
