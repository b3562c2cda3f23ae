#version 460
// The part of a light that surfaces see where nothing blocks it: what is above their own horizon. 1 where
// nothing was hit.

#include "common/light_above.glsl"
#include "common/octahedral.glsl"
#include "common/view_params.glsl"

layout(constant_id = 0) const uint LIGHT_SHAPE = 1u;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1) uniform sampler2D view_depth;
layout(set = 0, binding = 2) uniform usampler2D geometric_normal;

layout(location = 0) out float visibility;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float depth = texelFetch(view_depth, pixel, 0).x;
    vec3 n = unpack_unit(texelFetch(geometric_normal, pixel, 0).x);
    vec3 p = view.camera.eye.xyz + depth * pixel_ray(view.camera, uvec2(pixel));
    visibility = depth > 0.0 ? light_above(view.light, LIGHT_SHAPE, p, n) : 1.0;
}
