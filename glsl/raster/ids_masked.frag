#version 460
// As ids.frag, but for holes that alpha cuts.
#include "common/holes.glsl"


layout(set = 0, binding = 0) uniform sampler2D materials;
layout(set = 0, binding = 1) uniform sampler2D footprints;

layout(push_constant) uniform Push {
    mat4 clip_from_scene;
    uint material;
} push;

layout(location = 0) flat in uint triangle_plus_one;
layout(location = 1) in vec2 surface_uv;

layout(location = 0) out uint id;

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
    id = triangle_plus_one;
}
