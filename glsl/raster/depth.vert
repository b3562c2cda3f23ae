#version 460

layout(location = 0) in vec3 position; // scene space, metres

layout(push_constant) uniform Push {
    mat4 clip_from_scene;
} push;

void main() {
    gl_Position = push.clip_from_scene * vec4(position, 1.0);
}
