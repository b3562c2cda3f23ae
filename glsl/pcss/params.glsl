// The uniform block of `pcf` and `pcss`.
#ifndef ANTUMBRA_PCSS_PARAMS_GLSL
#define ANTUMBRA_PCSS_PARAMS_GLSL

#include "common/light_view.glsl"

struct PcssParams {
    uvec4 counts;  // views, map size in texels, width and height of the picture in pixels
    vec4 search;   // x: distance of the nearest blocker that is looked for, metres along the view;
                   // y: radius in texels of a filter of fixed size, 0 for one that follows the light
    LightView views[MAX_LIGHT_VIEWS];
    vec4 axes[MAX_LIGHT_VIEWS]; // halves of the light in each view, metres: x axis in xy, y axis in zw
};

#endif
