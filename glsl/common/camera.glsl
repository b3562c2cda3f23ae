// The camera of a picture, as pixel steps. A ray has length 1 along the view direction, so that
// position = eye + view depth in metres * ray: exact at pixel centres and without a matrix inverse.
#ifndef ANTUMBRA_COMMON_CAMERA_GLSL
#define ANTUMBRA_COMMON_CAMERA_GLSL

struct Camera {
    vec4 eye;         // xyz: scene space, metres
    vec4 corner_ray;  // xyz: ray through the top left corner of pixel (0, 0); w: near plane, metres
    vec4 pixel_right; // xyz: from one pixel to the next on its right; w: half the width in pixels
    vec4 pixel_down;  // xyz: from one pixel to the next below; w: half the height in pixels
};

// Unit vector along the view direction.
vec3 view_forward(Camera camera) {
    return camera.corner_ray.xyz + camera.pixel_right.w * camera.pixel_right.xyz
        + camera.pixel_down.w * camera.pixel_down.xyz;
}

vec3 pixel_ray(Camera camera, uvec2 pixel) {
    vec2 centre = vec2(pixel) + 0.5;
    return camera.corner_ray.xyz + centre.x * camera.pixel_right.xyz
        + centre.y * camera.pixel_down.xyz;
}

#endif
