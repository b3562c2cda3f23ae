// Places on a light, turned from pixel to pixel.
#ifndef ANTUMBRA_COMMON_TAPS_GLSL
#define ANTUMBRA_COMMON_TAPS_GLSL

const float GOLDEN_ANGLE = 2.39996323;

// Interleaved gradient noise (Jimenez 2014), 0 to 1.
float gradient_noise(uvec2 pixel) {
    return fract(52.9829189 * fract(dot(vec2(pixel), vec2(0.06711056, 0.00583715))));
}

// Tap index of count in the unit disk, evenly over its area. turn: 0 to 1.
vec2 disk_tap(uint index, uint count, float turn) {
    float part = (float(index) + 0.5) / float(count);
    float angle = GOLDEN_ANGLE * float(index) + 6.2831853 * turn;
    return sqrt(part) * vec2(cos(angle), sin(angle));
}

#endif
