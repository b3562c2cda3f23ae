// The uniform block of the passes of `ssoc`.
#ifndef ANTUMBRA_SSOC_PARAMS_GLSL
#define ANTUMBRA_SSOC_PARAMS_GLSL

#include "common/light_view.glsl"

struct SsocParams {
    uvec4 counts; // views, width of a shadow map in texels, width and height of the picture in pixels
    uvec4 bands;  // width of each distortion map in texels
    // Distance from the light's centre to its farthest point, metres, of a sun at distance 1;
    // distance of the farthest receiver, metres, of a sun depth along its direction; the nearest
    // depth at which an edge is drawn, metres; width of the edge's band in texels at least.
    vec4 reach;
    vec4 search; // depth along the view direction before which nothing blocks, metres
    LightView views[MAX_LIGHT_VIEWS];
};

// Texels of the distortion maps: one more than the edge's number, 0 for none, and whether its faces
// are to the left of the way from its first end to its second.
const uint EDGE_NUMBER = 0x7fffffffu;
const uint FACES_LEFT = 0x80000000u;

// Map coordinates of a place in a view's own units.
vec2 map_of(LightView view, vec2 at) {
    return (at - vec2(view.right.w, view.up.w)) * view.scale.xy;
}

// Half width of the penumbra that an edge throws on a receiver, in a view's own units: tangents of
// angles, of a sun metres. Depths are inverse in a perspective view. at: place in the view.
float penumbra_half_width(float reach, bool perspective, float edge, float receiver, vec2 at) {
    float width = perspective ? edge - receiver : receiver - edge;
    // Off axis a length across the ray is stretched in the image.
    return max(reach * width, 0.0) * (perspective ? sqrt(1.0 + dot(at, at)) : 1.0);
}

bool clip_to(inout vec3 a, inout vec3 b, float height_a, float height_b) {
    float part = height_a / (height_a - height_b);
    if (height_a < 0.0 && height_b > 0.0) {
        a = mix(a, b, part);
    } else if (height_a > 0.0 && height_b < 0.0) {
        b = mix(a, b, part);
    }
    return max(height_a, height_b) > 0.0;
}

// Leaves of an edge what is before the light and within half a map's width around a perspective
// view's map; false where nothing is. Farther out places in the image grow without bound.
bool clip_edge(LightView view, float near, inout vec3 a, inout vec3 b) {
    if (view.forward.w <= 0.0) {
        return true;
    }
    // Seen end on, an edge bounds nothing, and which way it faces is rounding.
    vec3 line = cross(a, b);
    if (dot(line, line) <= 1.0e-12 * dot(b - a, b - a) * max(dot(a, a), dot(b, b))) {
        return false;
    }
    vec2 corner = vec2(view.right.w, view.up.w);
    vec2 other = corner + 1.0 / view.scale.xy;
    vec2 middle = 0.5 * (corner + other);
    vec2 half_size = abs(other - corner);
    bool left = clip_to(a, b, a.z - near, b.z - near);
    for (uint i = 0u; i < 4u; ++i) {
        uint axis = i & 1u;
        float sign = i < 2u ? 1.0 : -1.0;
        float rim = half_size[axis] + sign * middle[axis];
        left = left && clip_to(a, b, rim * a.z - sign * a[axis], rim * b.z - sign * b[axis]);
    }
    return left;
}

#endif
