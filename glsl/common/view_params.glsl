// Camera and light: the uniform block that passes of one light share.
#ifndef ANTUMBRA_COMMON_VIEW_PARAMS_GLSL
#define ANTUMBRA_COMMON_VIEW_PARAMS_GLSL

#include "common/camera.glsl"
#include "common/light.glsl"

struct ViewParams {
    Camera camera;
    Light light;
};

#endif
