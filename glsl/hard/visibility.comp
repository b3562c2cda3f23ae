#version 460
// Visibility of a light's centre at every pixel.

#include "common/camera.glsl"
#include "common/octahedral.glsl"
#include "hard/hard.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std140) uniform HardParams {
    Camera camera;
    vec4 light;   // xyz: centre, or the unit vector towards a sun; w: 1 or 0
    uvec4 counts; // views, map size in texels, width and height in pixels
    LightView views[MAX_LIGHT_VIEWS];
} params;
layout(set = 0, binding = 1) uniform sampler2D view_depth;
layout(set = 0, binding = 2) uniform usampler2D geometric_normal;
layout(set = 0, binding = 3) uniform sampler2DArray map;
layout(set = 0, binding = 4, r32f) uniform writeonly image2D visibility;

float fetch_map_depth(ivec2 texel, uint view) {
    return texelFetch(map, ivec3(texel, view), 0).x;
}

float pixel_visibility(uvec2 pixel) {
    float depth = texelFetch(view_depth, ivec2(pixel), 0).x;
    if (depth <= 0.0) {
        return 1.0;
    }
    vec3 n = unpack_unit(texelFetch(geometric_normal, ivec2(pixel), 0).x);
    vec3 p = params.camera.eye.xyz + depth * pixel_ray(params.camera, pixel);
    vec3 q = p - params.light.w * params.light.xyz;
    // On or below the receiver's tangent plane the light's centre is hidden.
    vec3 to_light = params.light.w > 0.0 ? -q : params.light.xyz;
    if (dot(n, to_light) <= 0.0) {
        return 0.0;
    }
    for (uint i = 0u; i < params.counts.x; ++i) {
        vec3 at = light_view_project(params.views[i], q);
        if (all(greaterThanEqual(at.xy, vec2(0.0))) && all(lessThanEqual(at.xy, vec2(1.0)))) {
            return hard_visibility(params.views[i], i, q, n, at.xy, float(params.counts.y));
        }
    }
    // No view looks there: nothing that could block stands there.
    return 1.0;
}

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, params.counts.zw))) {
        return;
    }
    imageStore(visibility, ivec2(pixel), vec4(pixel_visibility(pixel)));
}
