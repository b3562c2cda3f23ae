#version 460
// Marks the slice that a surface lies in, but for holes where alpha cuts them.
#include "common/holes.glsl"


layout(set = 0, binding = 0) uniform sampler2D materials;
layout(set = 0, binding = 1) uniform sampler2D footprints;

layout(push_constant) uniform Push {
    mat4 clip_from_scene;
    vec4 depth;
    vec4 range;
    uint first_slice;
    uint material;
} push;

layout(location = 0) in float depth_m;
layout(location = 1) in vec2 surface_uv;

#include "occlusion_textures/marks.glsl"

vec4 fetch_material_texel(ivec2 place) {
    return texelFetch(materials, place, 0);
}

vec4 fetch_footprint(ivec2 place) {
    return texelFetch(footprints, place, 0);
}

void main() {
    if (is_hole(push.material, surface_uv)) {
        discard;
    }
    write_slice(depth_m, push.range, push.first_slice);
}
