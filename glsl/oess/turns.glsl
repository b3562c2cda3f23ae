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

#endif
