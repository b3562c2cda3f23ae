#version 460
// Writes the depths of each texel to its list, in any order.

#include "mdi/fill.glsl"

void main() {
    uint triangle = invocation_triangle();
    if (triangle < params.counts.w) {
        cover_small(triangle);
    }
}
