#version 460
// As fill.comp, for large triangles: an invocation for each row of the view.

#include "mdi/fill.glsl"

layout(set = 0, binding = 8, std140) uniform Arguments {
    LargeArguments large;
};
layout(set = 0, binding = 9) uniform usampler2D large_list;

void main() {
    int row = int(gl_GlobalInvocationID.x);
    for (uint i = gl_WorkGroupID.y; i < large.count; i += LARGE_GROUPS) {
        cover_large(texelFetch(large_list, list_place(i), 0).x, row);
    }
}
