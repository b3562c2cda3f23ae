#version 460
// The surface's colour and finish, and what is there without any light: a constant ambient term and
// what surfaces give off themselves, a flat background elsewhere.

#include "common/camera.glsl"
#include "common/materials.glsl"
#include "common/textures.glsl"
#include "common/triangles.glsl"

// 0 where no material has a texture.
layout(constant_id = 0) const uint TEXTURED = 1u;

layout(set = 0, binding = 0) uniform usampler2D ids;
layout(set = 0, binding = 1) uniform sampler2D triangles;
layout(set = 0, binding = 2) uniform sampler2D materials;
layout(set = 0, binding = 3) uniform sampler2D uvs;
layout(set = 0, binding = 4) uniform sampler2D texels;
layout(set = 0, binding = 5) uniform sampler2D view_depth;

layout(push_constant) uniform Push {
    Camera camera;
    vec4 ambient;    // rgb: radiance of a white surface; w: number of triangles with a texture
    vec4 background; // rgb: radiance
} push;

layout(location = 0) out vec4 radiance; // alpha: 1 on a surface
layout(location = 1) out vec4 albedo;
layout(location = 2) out vec2 finish;   // roughness, metallic

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

vec4 fetch_material_texel(ivec2 place) {
    return texelFetch(materials, place, 0);
}

vec4 fetch_uv_texel(ivec2 place) {
    return texelFetch(uvs, place, 0);
}

vec4 fetch_texture_texel(ivec2 place) {
    return texelFetch(texels, place, 0);
}

// Colour of the texture that a triangle wears where the pixel sees it.
vec3 texture_at(uint triangle, vec4 texture_place, ivec2 pixel) {
    float depth = texelFetch(view_depth, pixel, 0).x;
    vec3 p = push.camera.eye.xyz + depth * pixel_ray(push.camera, uvec2(pixel));
    vec3 weights = triangle_weights(triangle, p);
    return texture_color(texture_place, fetch_uv(triangle, weights)).rgb;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uint id = texelFetch(ids, pixel, 0).x;
    radiance = vec4(push.background.rgb, 0.0);
    albedo = vec4(0.0);
    finish = vec2(1.0, 0.0);
    if (id == 0u) {
        return;
    }
    uint material = fetch_material(id - 1u);
    vec3 color = fetch_base_color(material).rgb;
    if (TEXTURED != 0u) {
        vec4 texture_place = fetch_texture(material);
        if (texture_place.y > 0.0 && float(id - 1u) < push.ambient.w) {
            color *= texture_at(id - 1u, texture_place, pixel);
        }
    }
    finish = fetch_finish(material).xy;
    radiance = vec4(push.ambient.rgb * color + fetch_emissive(material), 1.0);
    albedo = vec4(color, 1.0);
}
