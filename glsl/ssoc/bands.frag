#version 460
// The edge of a band, where it is an outline.

#include "ssoc/bands.glsl"

layout(location = 0) out uint edge;

void main() {
    if (is_no_outline()) {
        discard;
    }
    edge = entry.x;
}
