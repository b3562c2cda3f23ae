#version 460
// One for each edge whose band covers a texel, whichever wins there.

#include "ssoc/bands.glsl"

layout(location = 0) out float one;

void main() {
    if (is_no_outline()) {
        discard;
    }
    one = 1.0;
}
