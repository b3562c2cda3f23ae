// The uniform block of both passes of `hard`.
#ifndef ANTUMBRA_HARD_PARAMS_GLSL
#define ANTUMBRA_HARD_PARAMS_GLSL

#include "common/camera.glsl"
#include "common/light_view.glsl"

struct HardParams {
    Camera camera;
    vec4 light;   // xyz: centre, or the unit vector towards a sun; w: 1 or 0
    uvec4 counts; // views, map size in texels, width and height in pixels
    LightView views[MAX_LIGHT_VIEWS];
};

#endif
