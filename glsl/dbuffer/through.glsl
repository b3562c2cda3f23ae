// What through.comp found.
#ifndef ANTUMBRA_DBUFFER_THROUGH_GLSL
#define ANTUMBRA_DBUFFER_THROUGH_GLSL

struct Through {
    uvec4 cut; // x: 1 where a surface cuts through the light
};

#endif
