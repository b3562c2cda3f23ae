// How triangles lie to all surfaces of a tile at once: whether they are between them and the light, and
// which of their sides the surfaces see.
#ifndef ANTUMBRA_SHAFT_MASKS_SIDES_GLSL
#define ANTUMBRA_SHAFT_MASKS_SIDES_GLSL

#include "common/tiles.glsl"
#include "shaft_masks/shaft.glsl"

// A tile's surfaces, and the space between them and the light.
struct Surfaces {
    vec3 center;    // of a box around them, scene space
    vec3 axes[3];   // half its edges
    float radius_m; // half its diagonal
    float margin_m; // room for rounding
    vec3 normal_low; // box around their normals, on the seen side
    vec3 normal_high;
    // Points a between, for every surface, are those with dot(a - origin, z) - tilt * |a - origin| > low and
    // dot(a - origin, z) + tilt * (|a - center| + radius) < high: z is across the light's plane, or, where
    // that plane turns with the surface, turns by an angle of at most tilt.
    vec3 origin;
    vec3 z;
    float tilt;
    float low;
    float high;
    float end; // with dot(a - origin, z) + tilt * |a - origin| less than this they are beyond the light
};

Surfaces fetch_surfaces(uvec2 part, Light light) {
    ivec2 place = ivec2(part.x * SHAFT_TEXELS + SHAFT_PLANES + 2u, part.y);
    vec4 center = fetch_shaft_texel(place);
    vec4 x = fetch_shaft_texel(place + ivec2(1, 0));
    vec4 y = fetch_shaft_texel(place + ivec2(2, 0));
    vec4 z = fetch_shaft_texel(place + ivec2(3, 0));
    vec4 across = fetch_shaft_texel(place + ivec2(4, 0));
    vec4 ends = fetch_shaft_texel(place + ivec2(5, 0));
    vec3 origin = LIGHT_SHAPE == LIGHT_SUN ? center.xyz : light.center.xyz;
    return Surfaces(center.xyz, vec3[3](x.xyz, y.xyz, z.xyz), ends.z, center.w,
        fetch_shaft_texel(place + ivec2(6, 0)).xyz, fetch_shaft_texel(place + ivec2(7, 0)).xyz, origin,
        across.xyz, across.w, ends.x, ends.y, ends.w);
}

// How far z turns a length, at most: only that of a sphere does at all, and roots are dear.
float most_turn(Surfaces surfaces, vec3 way, float more_m) {
    return LIGHT_SHAPE == LIGHT_SPHERE ? surfaces.tilt * (length(way) + more_m) : 0.0;
}

// Whether all points within radius_m of a are between.
bool is_between(Surfaces surfaces, vec3 a, float radius_m) {
    float height = dot(a - surfaces.origin, surfaces.z);
    float turn_light = most_turn(surfaces, a - surfaces.origin, radius_m) + radius_m;
    float turn = most_turn(surfaces, a - surfaces.center, radius_m + surfaces.radius_m) + radius_m;
    return height - turn_light > surfaces.low && height + turn < surfaces.high;
}

bool triangle_is_between(Surfaces surfaces, vec3 a, vec3 b, vec3 c) {
    return is_between(surfaces, a, 0.0) && is_between(surfaces, b, 0.0) && is_between(surfaces, c, 0.0);
}

// The most that a surface is off the box's centre along n.
float surfaces_extent(Surfaces surfaces, vec3 n) {
    return abs(dot(n, surfaces.axes[0])) + abs(dot(n, surfaces.axes[1])) + abs(dot(n, surfaces.axes[2]));
}

// Whether a triangle is beyond the samples' plane, seen from every surface.
bool is_beyond_light(Surfaces surfaces, vec3 a, vec3 b, vec3 c) {
    vec3 from_a = a - surfaces.origin;
    vec3 from_b = b - surfaces.origin;
    vec3 from_c = c - surfaces.origin;
    vec3 heights = vec3(dot(from_a, surfaces.z), dot(from_b, surfaces.z), dot(from_c, surfaces.z))
        + vec3(most_turn(surfaces, from_a, 0.0), most_turn(surfaces, from_b, 0.0), most_turn(surfaces, from_c, 0.0));
    return max(heights.x, max(heights.y, heights.z)) < surfaces.end;
}

// Whether a triangle is below the planes of all surfaces, where it hides nothing that they do not.
bool is_below(Surfaces surfaces, vec3 a, vec3 b, vec3 c) {
    vec3 low = surfaces.normal_low;
    vec3 high = surfaces.normal_high;
    float most = max(most_along(low, high, a - surfaces.center),
        max(most_along(low, high, b - surfaces.center), most_along(low, high, c - surfaces.center)));
    for (uint i = 0u; i < 3u; ++i) {
        most += max(most_along(low, high, surfaces.axes[i]), most_along(low, high, -surfaces.axes[i]));
    }
    return most <= 0.0;
}

// Sides of a triangle.
const uint SIDE_UNSURE = 0u;
const uint SIDE_FRONT = 1u;
const uint SIDE_BACK = 2u;

uint side_of_height(float height, float most) {
    return height > most ? SIDE_FRONT : height < -most ? SIDE_BACK : SIDE_UNSURE;
}

// The side that all surfaces see.
uint triangle_side(Surfaces surfaces, vec3 a, vec3 normal) {
    vec3 size = abs(a);
    float margin = surfaces.margin_m + 4.0 * POSITION_ROUNDING * max(size.x, max(size.y, size.z));
    return side_of_height(dot(normal, surfaces.center - a), surfaces_extent(surfaces, normal) + margin);
}

// The side that all of the light is on. frame: light_frame of any surface.
uint light_side(Surfaces surfaces, Light light, mat3 frame, vec3 a, vec3 normal) {
    float reach = dot(abs(normal * frame), light_half_size(light));
    if (LIGHT_SHAPE == LIGHT_SUN) {
        return side_of_height(dot(normal, light.center.xyz), reach + 8.0 * POSITION_ROUNDING);
    }
    vec3 size = max(abs(a), max(abs(light.center.xyz), abs(surfaces.center)));
    float margin = 8.0 * POSITION_ROUNDING * max(size.x, max(size.y, size.z));
    return side_of_height(dot(normal, light.center.xyz - a), reach + margin);
}

// Whether a triangle hides nothing from any surface: all of them and all of the light are on one side of it, or it is
// below them, or beyond the light.
bool hides_nothing(Surfaces surfaces, uint side, uint side_of_light, vec3 a, vec3 b, vec3 c) {
    return (side != SIDE_UNSURE && side == side_of_light) || is_below(surfaces, a, b, c)
        || is_beyond_light(surfaces, a, b, c);
}

// The same for all triangles of a box with normals in a cone: its axis, the sine of half its angle. With twice the
// margin, so that rounding cannot make triangle_side less sure of one of them.
uint box_side(Surfaces surfaces, vec3 middle, vec3 half_size, vec3 axis, float sine) {
    vec3 size = abs(middle) + half_size;
    float margin = 2.0 * surfaces.margin_m + 8.0 * POSITION_ROUNDING * max(size.x, max(size.y, size.z));
    float cosine = sqrt(max(1.0 - sine * sine, 0.0));
    vec3 offset = surfaces.center - middle;
    float along = dot(axis, offset);
    float beside = length(offset - along * axis);
    // Of a normal in the cone |dot(n, v)| <= |dot(axis, v)| + sine |v|.
    float extent = surfaces_extent(surfaces, axis) + dot(abs(axis), half_size)
        + sine * (1.7321 * surfaces.radius_m + length(half_size));
    float height = max(abs(along) * cosine - beside * sine, 0.0);
    return side_of_height(along < 0.0 ? -height : height, extent + margin);
}

#endif
