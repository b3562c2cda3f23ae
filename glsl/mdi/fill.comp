#version 460
// Writes the depths of each texel to its list, in any order.

#include "mdi/fill.glsl"

void main() {
    uint triangle;
    if (invocation_triangle(triangle)) {
        cover_small(triangle);
    }
}
