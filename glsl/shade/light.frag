#version 460
// Light reflected by a surface from one light, times its visibility; added to what is there.

#include "common/light_above.glsl"
#include "common/light_irradiance.glsl"
#include "common/octahedral.glsl"
#include "common/view_params.glsl"
#include "shade/specular.glsl"

layout(constant_id = 0) const uint LIGHT_SHAPE = 0u;
// 0 where no surface of the scene shines.
layout(constant_id = 1) const uint SHINY = 1u;
// What hides the light: the image's visibility, what of HORIZON_SHAPE is below the surface, or nothing.
layout(constant_id = 2) const uint SHADOW = 0u;
layout(constant_id = 3) const uint HORIZON_SHAPE = 0u;
const uint MASK = 0u;
const uint NO_SHADOW = 2u;

layout(set = 0, binding = 0, std140) uniform LightBlock {
    ViewParams view;
};
layout(set = 0, binding = 1) uniform sampler2D view_depth;
layout(set = 0, binding = 2) uniform usampler2D geometric_normal;
layout(set = 0, binding = 3) uniform usampler2D shading_normal;
layout(set = 0, binding = 4) uniform sampler2D albedo;
layout(set = 0, binding = 5) uniform sampler2D finish;
layout(set = 0, binding = 6) uniform sampler2D visibility;

layout(location = 0) out vec4 radiance;

const float INVERSE_PI = 0.3183098861837907;
// Reflectance of all but metals, glTF's choice.
const float DIELECTRIC = 0.04;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float depth = texelFetch(view_depth, pixel, 0).x;
    vec3 ray = pixel_ray(view.camera, uvec2(pixel));
    vec3 p = view.camera.eye.xyz + depth * ray;
    vec3 n = unpack_unit(texelFetch(shading_normal, pixel, 0).x);
    vec3 color = texelFetch(albedo, pixel, 0).rgb;
    vec2 surface = SHINY != 0u ? texelFetch(finish, pixel, 0).xy : vec2(1.0, 0.0);

    // Visibility counts what is below the surface's plane as hidden, and irradiance leaves it out:
    // once is enough.
    float seen = 1.0;
    if (SHADOW != NO_SHADOW) {
        vec3 g = unpack_unit(texelFetch(geometric_normal, pixel, 0).x);
        float above = light_above(view.light, LIGHT_SHAPE, p, g);
        if (SHADOW == MASK) {
            seen = texelFetch(visibility, pixel, 0).x;
        } else {
            seen = HORIZON_SHAPE == LIGHT_SHAPE ? above : light_above(view.light, HORIZON_SHAPE, p, g);
        }
        if (LIGHT_SHAPE != LIGHT_POINT) {
            seen = min(seen / max(above, 1.0e-3), 1.0);
        }
    }
    float diffuse = light_irradiance(view.light, LIGHT_SHAPE, p, n) * (1.0 - surface.y) * INVERSE_PI;
    vec3 reflected = color * diffuse;
    vec3 offset = light_offset(view.light, p);
    if (SHINY != 0u) {
        vec3 f0 = mix(vec3(DIELECTRIC), color, surface.y);
        reflected += specular(view.light, LIGHT_SHAPE, offset, n, -normalize(ray), surface.x, f0);
    }
    float lit = seen * light_falloff(view.light, offset);
    radiance = vec4(depth > 0.0 ? reflected * lit * view.light.intensity.rgb : vec3(0.0), 0.0);
}
