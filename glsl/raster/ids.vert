#version 460
// Which triangle each pixel or texel sees. Every triangle has a first vertex of its own, and a flat output
// takes its value from there, so triangles are told apart in an indexed draw and without geometry
// shaders.

layout(location = 0) in vec3 position; // scene space, metres
layout(location = 1) in uint triangle;

layout(location = 0) flat out uint triangle_plus_one;

layout(push_constant) uniform Push {
    mat4 clip_from_scene;
} push;

void main() {
    triangle_plus_one = triangle + 1u;
    gl_Position = push.clip_from_scene * vec4(position, 1.0);
}
