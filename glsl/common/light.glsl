// An area light, as AreaLight of the library has it.
#ifndef ANTUMBRA_COMMON_LIGHT_GLSL
#define ANTUMBRA_COMMON_LIGHT_GLSL

// Lengths in metres, scene space.
struct Light {
    vec4 center;    // xyz: centre, of a sun the unit vector towards it; w: 1, of a sun 0
    vec4 axis_x;    // xyz: unit vector; w: half the width or length, or the radius; of a sun the
                    // tangent of half its angle
    vec4 axis_y;    // xyz: unit vector; w: half the height of a rectangle, else axis_x.w
    vec4 direction; // xyz: unit vector that it emits along; w: sine of half a sun's angle
    vec4 intensity; // rgb: candela along its axis, of a sun lux; w: 1/m of its range, 0 for no limit
    vec4 cone;      // cosines at which a spot begins to fade and ends; 2 and -1 for none
};

// Values of LIGHT_SHAPE, a specialization constant of every shader that includes the files on
// lights: only the code for one shape is there.
const uint LIGHT_POINT = 0u;
const uint LIGHT_DISK = 1u;
const uint LIGHT_RECT = 2u;
const uint LIGHT_SPHERE = 3u;
const uint LIGHT_LINE = 4u;
const uint LIGHT_SUN = 5u;

// From p to the light's centre in metres, or the unit vector towards a sun.
vec3 light_offset(Light light, vec3 p) {
    return light.center.w > 0.0 ? light.center.xyz - p : light.center.xyz;
}

#endif
