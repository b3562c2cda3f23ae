// Visibilities of several blockers of one light, combined: a light sample is seen if each lets it
// through.
#ifndef ANTUMBRA_COMMON_COMBINE_GLSL
#define ANTUMBRA_COMMON_COMBINE_GLSL

// along: cosine between the directions in which the two edges face, 0 where that is unknown. 1: the
// smaller part lies within the larger; -1: they lie at opposite ends; 0: independent.
float visibility_and(float a, float b, float along) {
    float product = a * b;
    float aligned = along > 0.0 ? min(a, b) : max(a + b - 1.0, 0.0);
    float weight = abs(along) * sqrt(abs(along));
    return mix(product, aligned, weight);
}

#endif
