// A map's row as the published steps see it: places u count from 0 at the side that receivers lie on,
// and the corresponding pixel of the other end's map is c = u - s, where s is the shift.
#ifndef ANTUMBRA_OESS_ROW_GLSL
#define ANTUMBRA_OESS_ROW_GLSL

layout(push_constant) uniform Push {
    vec4 here;    // this end, scene space
    vec4 there;   // the other one
    float shift;  // texels for stored depth 1
    int backward; // 0: from the line's start towards its end; 1: from the end
} push;

float fetch_row_depth(ivec2 texel); // defined by the entry file

int row_column(int u, int size) {
    return push.backward != 0 ? size - 1 - u : u;
}

float corresponding(int u, int row, int size) {
    return float(u) - push.shift * fetch_row_depth(ivec2(row_column(u, size), row));
}

#endif
