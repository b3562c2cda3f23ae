#version 460
// The occluding edge of every texel of an end's map: what first hides the light, seen from the
// surface there, as one goes along the light from this end.
//
// In a row let x be the column and s the shift to the next end's map, both in texels. s is
// proportional to 1 / depth, so that the row's plane is mapped projectively, and a point at (x_e, s_e)
// lies on the line from the receiver (x, s) to the part t = (x_e - x) / (s_e - s) of the light. The
// first one on the way is a point that this end sees: it lies on the border of a triangle that is
// free. So the occluding edge is the point of the map's row with the smallest t, and 1 / t is a
// slope: the edge is where the tangent from (x, s) touches the upper hull of the row beyond it. From
// the row's far end on, each texel's tangent is also the next edge of the hull (Andrew 1979), which
// makes it one pass of linear time whatever the width of penumbrae.
//
// Edges with t > 1 hide nothing, and neither do those after them: the hull is cut there.

#include "oess/params.glsl"

layout(local_size_x = 32) in;

layout(set = 0, binding = 0) uniform sampler2D map_depth;
layout(set = 0, binding = 1, r32ui) uniform uimage2D outreach;
layout(set = 0, binding = 2, r32ui) uniform writeonly uimage2D steps;
layout(set = 0, binding = 3) uniform usampler2D rows; // 0 for those that nobody asks for

layout(push_constant) uniform Push {
    float shift;  // texels for stored depth 1
    int backward; // 0: from the line's start towards its end; 1: from the end
    int sector;
} push;

void main() {
    ivec2 size = textureSize(map_depth, 0);
    int row = int(gl_GlobalInvocationID.x);
    if (row >= size.y) {
        return;
    }
    if (texelFetch(rows, ivec2(row, push.sector), 0).x == 0u) {
        imageStore(steps, ivec2(row, 0), uvec4(0u));
        return;
    }
    int sign = push.backward != 0 ? -1 : 1;
    // Columns counted from where the scan begins: place 0 is the last one.
    int begin = push.backward != 0 ? 0 : size.x - 1;
    float ahead_s = 0.0; // of the texel before
    uint ahead_edge = 0u;
    uint ahead_run = 0u;
    uint count = 0u;
    for (int i = 0; i < size.x; ++i) {
        int column = begin - sign * i;
        float s = push.shift * texelFetch(map_depth, ivec2(column, row), 0).x;
        // Walk the hull of what lies beyond as long as its slope grows.
        uint edge = 0u;
        if (i > 0) {
            float rise = ahead_s - s;
            float slope = rise;
            edge = uint(column + sign) + 1u;
            uint next = ahead_edge;
            while (next != 0u) {
                float next_s = push.shift * texelFetch(map_depth, ivec2(int(next) - 1, row), 0).x;
                float away = float(abs(int(next) - 1 - column));
                float next_slope = (next_s - s) / away;
                count += 1u;
                if (next_slope < slope) {
                    break;
                }
                slope = next_slope;
                edge = next;
                next = edge_of(imageLoad(outreach, ivec2(int(next) - 1, row)).x);
            }
            edge = slope >= 1.0 ? edge : 0u;
        }
        // Surfaces end where the shift falls by more than a texel.
        bool ends = i == 0 || s - ahead_s > 1.0;
        uint run = ends ? uint(column) + 1u : ahead_run;
        imageStore(outreach, ivec2(column, row), uvec4(edge | run << EDGE_BITS));
        ahead_s = s;
        ahead_edge = edge;
        ahead_run = run;
        count += 1u;
    }
    imageStore(steps, ivec2(row, 0), uvec4(count));
}
