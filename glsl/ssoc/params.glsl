// The uniform block of the passes of `ssoc`.
#ifndef ANTUMBRA_SSOC_PARAMS_GLSL
#define ANTUMBRA_SSOC_PARAMS_GLSL

#include "common/light_view.glsl"

struct SsocParams {
    uvec4 counts; // views, width of each map in texels, width and height of the picture in pixels
    // Distance from the light's centre to its farthest point, metres, of a sun at distance 1;
    // distance of the farthest receiver, metres, of a sun depth along its direction; the nearest
    // depth at which an edge is drawn, metres; width of the edge's band in texels at least.
    vec4 reach;
    LightView views[MAX_LIGHT_VIEWS];
};

// Half width of the penumbra that an edge throws on a receiver, in a view's own units: tangents of
// angles, of a sun metres. Depths are inverse in a perspective view. at: place in the view.
float penumbra_half_width(float reach, bool perspective, float edge, float receiver, vec2 at) {
    float width = perspective ? edge - receiver : receiver - edge;
    // Off axis a length across the ray is stretched in the image.
    return max(reach * width, 0.0) * (perspective ? 1.0 + dot(at, at) : 1.0);
}

#endif
