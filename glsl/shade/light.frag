#version 460
// Light reflected by a Lambert surface from one light, times its visibility; added to what is there.

#include "common/camera.glsl"
#include "common/octahedral.glsl"
#include "common/triangles.glsl"

layout(set = 0, binding = 0) uniform usampler2D ids;
layout(set = 0, binding = 1) uniform sampler2D triangles;
layout(set = 0, binding = 2) uniform sampler2D materials;
layout(set = 0, binding = 3) uniform sampler2D view_depth;
layout(set = 0, binding = 4) uniform usampler2D shading_normal;
layout(set = 0, binding = 5) uniform sampler2D visibility;

layout(push_constant) uniform Push {
    vec3 eye;
    float inverse_range; // 1/m; 0 for no limit
    vec3 corner_ray;
    float cos_inner; // spot cone; 2 for none
    vec3 pixel_right;
    float cos_outer;
    vec3 pixel_down;
    float one_sided; // 1: emits like a Lambert surface along the direction; 0: the same all round
    vec3 light; // centre, or the unit vector towards a sun
    float positional; // 1 or 0
    vec3 direction; // unit vector that the light emits along
    float unused;
    vec3 intensity; // candela, or lux of a sun
    float unused_too;
} push;

layout(location = 0) out vec4 radiance;

const float INVERSE_PI = 0.3183098861837907;

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

// Irradiance in lux on a surface that faces the light, and the unit vector towards it.
vec3 irradiance_towards(vec3 p, out vec3 to_light) {
    if (push.positional == 0.0) {
        to_light = push.light;
        return push.intensity;
    }
    vec3 offset = push.light - p;
    float square = max(dot(offset, offset), 1.0e-12);
    to_light = offset * inversesqrt(square);
    float along = dot(-to_light, push.direction);
    float falloff = push.one_sided > 0.0 ? max(along, 0.0) : 1.0;
    if (push.cos_inner < 2.0) {
        float cone = clamp((along - push.cos_outer) / max(push.cos_inner - push.cos_outer, 1.0e-4), 0.0, 1.0);
        falloff *= cone * cone;
    }
    // KHR_lights_punctual: a smooth window that reaches 0 at the range.
    float reach = square * push.inverse_range * push.inverse_range;
    falloff *= clamp(1.0 - reach * reach, 0.0, 1.0);
    return push.intensity * (falloff / square);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uint id = texelFetch(ids, pixel, 0).x;
    radiance = vec4(0.0);
    if (id == 0u) {
        return;
    }
    float depth = texelFetch(view_depth, pixel, 0).x;
    Camera camera = Camera(vec4(push.eye, 0.0), vec4(push.corner_ray, 0.0),
        vec4(push.pixel_right, 0.0), vec4(push.pixel_down, 0.0));
    vec3 p = push.eye + depth * pixel_ray(camera, uvec2(pixel));
    vec3 n = unpack_unit(texelFetch(shading_normal, pixel, 0).x);
    vec3 to_light;
    vec3 irradiance = irradiance_towards(p, to_light) * max(dot(n, to_light), 0.0);
    uint material = fetch_material(id - 1u);
    ivec2 place = ivec2(material % TRIANGLE_IMAGE_WIDTH, material / TRIANGLE_IMAGE_WIDTH);
    vec3 albedo = texelFetch(materials, place, 0).rgb;
    float seen = texelFetch(visibility, pixel, 0).x;
    radiance = vec4(albedo * irradiance * (INVERSE_PI * seen), 0.0);
}
