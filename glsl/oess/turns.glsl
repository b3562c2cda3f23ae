// Coordinates across a line light: in them all of the line is one point, and each of its planes is a straight line
// through it.
#ifndef ANTUMBRA_OESS_TURNS_GLSL
#define ANTUMBRA_OESS_TURNS_GLSL

#include "common/light.glsl"

// Metres from the line, in the two directions across it. Of one point always the same, bit by bit.
vec2 across_line(Light light, vec3 p) {
    precise vec3 from = p - light.center.xyz;
    precise vec3 other = cross(light.axis_x.xyz, light.axis_y.xyz);
    precise float x = dot(from, light.axis_y.xyz);
    precise float y = dot(from, other);
    return vec2(x, y);
}

// On which side of the plane through the line and a receiver a point is: the sign; the size is the distance from
// that plane times the receiver's from the line. All edges of a point agree: no outline opens by rounding.
float side_of_line(vec2 receiver, vec2 point) {
    precise float first = receiver.y * point.x;
    precise float second = receiver.x * point.y;
    return first - second;
}

// Steps of a turn around the line.
const uint TURN_STEPS = 65536u;

// Steps by which the turn of a point may be rounded, and more.
const uint TURN_SLACK = 1u;

// How far around the line a point is, 0 to TURN_STEPS: grows with the angle, though not evenly. Not a number for the
// line itself.
float turn_of(vec2 point) {
    vec2 size = abs(point);
    float part = point.y / (size.x + size.y);
    float turn = point.x < 0.0 ? 2.0 - part : (point.y < 0.0 ? 4.0 + part : part);
    return turn * (0.25 * float(TURN_STEPS));
}

// The turn within which an edge may be cut by half a plane that begins at the line: its first step, and above it how
// many follow. All of them where the edge comes close to the line.
uint span_of(vec2 first, vec2 second) {
    float from = turn_of(first);
    float to = turn_of(second);
    bool known = from >= 0.0 && to >= 0.0;
    uint steps = uint(known ? to : 0.0) - uint(known ? from : 0.0) & TURN_STEPS - 1u;
    uint back = TURN_STEPS - steps & TURN_STEPS - 1u;
    uint start = uint(known ? (steps < back ? from : to) : 0.0) - TURN_SLACK & TURN_STEPS - 1u;
    uint width = min(steps, back) + 2u * TURN_SLACK;
    return known && width < TURN_STEPS / 2u - 4u * TURN_SLACK ? start | width << 16u : 0xffffu << 16u;
}

// Which of four spans hold a turn, in steps: a bit for each.
uint in_spans(uvec4 spans, uint turn) {
    uvec4 from = turn - spans & TURN_STEPS - 1u;
    uvec4 held = uvec4(lessThanEqual(from, spans >> 16u));
    return held.x | held.y << 1u | held.z << 2u | held.w << 3u;
}

// Spans are kept four a texel: those of the lists' entries in SPAN_TEXELS for each chunk of the pool, the last of which
// ends with the number of the list's next chunk; after all chunks those of the silhouettes.
const uint SPANS = 4u;
const uint SPAN_TEXELS = 8u;

ivec2 span_place(uint chunk, uint texel) {
    return triangle_texel_place(chunk * SPAN_TEXELS + texel);
}

#endif
