// Which of the 32 slices of a pass a fragment lies in: one channel each, blended by maximum.
#include "occlusion_textures/slice_of.glsl"

layout(location = 0) out vec4 slices_0;
layout(location = 1) out vec4 slices_1;
layout(location = 2) out vec4 slices_2;
layout(location = 3) out vec4 slices_3;
layout(location = 4) out vec4 slices_4;
layout(location = 5) out vec4 slices_5;
layout(location = 6) out vec4 slices_6;
layout(location = 7) out vec4 slices_7;

vec4 channels(float slice, float first) {
    return vec4(equal(vec4(slice - first), vec4(0.0, 1.0, 2.0, 3.0)));
}

void write_slice(float z, vec4 range, uint first_slice) {
    float place = slice_of(z, range);
    float slice = place < 0.0 ? -1.0 : place - float(first_slice);
    slices_0 = channels(slice, 0.0);
    slices_1 = channels(slice, 4.0);
    slices_2 = channels(slice, 8.0);
    slices_3 = channels(slice, 12.0);
    slices_4 = channels(slice, 16.0);
    slices_5 = channels(slice, 20.0);
    slices_6 = channels(slice, 24.0);
    slices_7 = channels(slice, 28.0);
}
