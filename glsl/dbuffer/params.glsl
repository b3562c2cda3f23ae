// The uniform block of the passes of `dbuffer`.
#ifndef ANTUMBRA_DBUFFER_PARAMS_GLSL
#define ANTUMBRA_DBUFFER_PARAMS_GLSL

const uint MOST_SAMPLE_TEXELS = 32u;

struct DbufferParams {
    uvec4 counts; // width and height of the picture in pixels, nodes, chunks of the pool of lists
    // Places on the light, -1 to 1 along both of its axes: four first places, then their four second ones.
    vec4 samples[MOST_SAMPLE_TEXELS];
    uvec4 sizes;  // blocks of silhouettes; lists of a tile: those, and one more for triangles with holes;
                  // most edges of a tile: receivers of tiles with more send rays
};

#endif
