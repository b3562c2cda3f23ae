#version 460
// The scene as seen from a view's centre of projection.

layout(location = 0) in vec3 position; // scene space, metres

layout(push_constant) uniform Push {
    mat4 clip_from_scene;
    vec4 depth;      // metres along the view: dot(depth.xyz, position) + depth.w
    vec4 range;      // nearest, farthest plane, part uniform in 1/z, slices
    uint first_slice;
    uint material;
} push;

layout(location = 0) out float depth_m;

void main() {
    depth_m = dot(push.depth.xyz, position) + push.depth.w;
    gl_Position = push.clip_from_scene * vec4(position, 1.0);
}
