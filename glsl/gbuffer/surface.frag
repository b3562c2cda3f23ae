#version 460
// The surface at each pixel centre, from the triangle seen there: where the exact ray meets the
// triangle's plane, not what rasterisation made of snapped vertices and interpolated depth.

#include "common/camera.glsl"
#include "common/octahedral.glsl"
#include "common/triangles.glsl"

layout(set = 0, binding = 0) uniform usampler2D ids;
layout(set = 0, binding = 1) uniform sampler2D triangles;

layout(push_constant) uniform Push {
    Camera camera;
} push;

layout(location = 0) out float view_depth_m;   // 0 where nothing was hit
layout(location = 1) out uint geometric_normal; // octahedral, turned to the camera
layout(location = 2) out uint shading_normal;   // octahedral, on the same side

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

void main() {
    uvec2 pixel = uvec2(gl_FragCoord.xy);
    uint id = texelFetch(ids, ivec2(pixel), 0).x;
    view_depth_m = 0.0;
    geometric_normal = 0u;
    shading_normal = 0u;
    if (id == 0u) {
        return;
    }
    uint triangle = id - 1u;
    Corner a = fetch_corner(triangle, 0u);
    Corner b = fetch_corner(triangle, 1u);
    Corner c = fetch_corner(triangle, 2u);
    vec3 normal = fetch_geometric_normal(triangle);
    vec3 ray = pixel_ray(push.camera, pixel);
    vec3 forward = view_forward(push.camera);

    // A plane seen edge-on meets the ray anywhere; the triangle's own depth range does not.
    vec3 to_a = a.position - push.camera.eye.xyz;
    vec3 depths = vec3(
        dot(to_a, forward),
        dot(b.position - push.camera.eye.xyz, forward),
        dot(c.position - push.camera.eye.xyz, forward));
    float nearest = min(depths.x, min(depths.y, depths.z));
    float farthest = max(depths.x, max(depths.y, depths.z));
    float slope = dot(normal, ray);
    float depth = slope != 0.0 ? dot(normal, to_a) / slope : farthest;
    float near_plane = push.camera.corner_ray.w;
    depth = clamp(depth, max(nearest, near_plane), max(farthest, near_plane));

    vec3 p = push.camera.eye.xyz + depth * ray;
    vec3 weights = weights_in_triangle(p, a.position, b.position, c.position, normal);
    vec3 smooth_normal = weights.x * unit_from_octahedral(unpack_corner_normal(a.normal))
        + weights.y * unit_from_octahedral(unpack_corner_normal(b.normal))
        + weights.z * unit_from_octahedral(unpack_corner_normal(c.normal));
    if (dot(smooth_normal, smooth_normal) < 1.0e-12) {
        smooth_normal = normal;
    }
    if (slope > 0.0) {
        normal = -normal;
    }
    if (dot(smooth_normal, normal) < 0.0) {
        smooth_normal = -smooth_normal;
    }
    view_depth_m = depth;
    geometric_normal = pack_unit(normal);
    shading_normal = pack_unit(normalize(smooth_normal));
}
