#version 460
// What is there without any light: a constant ambient term on surfaces, a flat background elsewhere.

#include "common/triangles.glsl"

layout(set = 0, binding = 0) uniform usampler2D ids;
layout(set = 0, binding = 1) uniform sampler2D triangles;
layout(set = 0, binding = 2) uniform sampler2D materials;

layout(push_constant) uniform Push {
    vec4 ambient;    // rgb: radiance of a white surface
    vec4 background; // rgb: radiance
} push;

layout(location = 0) out vec4 radiance; // alpha: 1 on a surface

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

void main() {
    uint id = texelFetch(ids, ivec2(gl_FragCoord.xy), 0).x;
    if (id == 0u) {
        radiance = vec4(push.background.rgb, 0.0);
        return;
    }
    uint material = fetch_material(id - 1u);
    ivec2 place = ivec2(material % TRIANGLE_IMAGE_WIDTH, material / TRIANGLE_IMAGE_WIDTH);
    radiance = vec4(push.ambient.rgb * texelFetch(materials, place, 0).rgb, 1.0);
}
