#version 460
// The edge of a band, where it is an outline, and of several the nearest but for the one in the first
// layer of the map.

#include "ssoc/bands.glsl"

layout(set = 0, binding = 5) uniform usampler2D first_layer;

layout(location = 0) out uint edge;

void main() {
    if (is_no_outline() || texelFetch(first_layer, ivec2(gl_FragCoord.xy), 0).x == entry.x) {
        discard;
    }
    edge = entry.x;
}
