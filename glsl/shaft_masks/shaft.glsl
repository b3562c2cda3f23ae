// The shaft of a tile: a convex body that holds every segment from the tile's surfaces to the light, as
// half-spaces dot(plane.xyz, x) <= plane.w (Haines and Wallace 1991, "Shaft Culling for Efficient
// Ray-Traced Radiosity"), and the box around it.
#ifndef ANTUMBRA_SHAFT_MASKS_SHAFT_GLSL
#define ANTUMBRA_SHAFT_MASKS_SHAFT_GLSL

#include "common/camera.glsl"
#include "common/hierarchy.glsl"
#include "common/light.glsl"
#include "shaft_masks/params.glsl"

// Four sides, two ends, and the surfaces' own plane where they have one.
const uint SHAFT_PLANES = 7u;
// Texels of a tile's shaft, side by side: planes, box, box of its surfaces, space between, normals.
const uint SHAFT_TEXELS = SHAFT_PLANES + 10u;

// Rounding of positions, as a part of the largest coordinate: a few units of the last place. What is
// nearer to a surface than that does not block its light.
const float POSITION_ROUNDING = 1.0 / 2097152.0;

struct Shaft {
    vec4 planes[SHAFT_PLANES];
    vec4 low;  // xyz: of the box; w: 1 where all of the light is above all surfaces' planes, -1 where none of it is
    vec4 high; // xyz: of the box; w: of a group with several members which of its cell they are, as bits of an integer
};

vec4 fetch_shaft_texel(ivec2 place); // defined by the entry file

// A tile across a gap in depth is worked on in two parts: one in front of the gap and one behind, each as a tile
// of its own. The second part's number is greater by the number of all tiles.
uvec2 part_of_entry(uint entry, uvec2 tiles) {
    return uvec2(entry % tiles.x, entry / tiles.x);
}

uvec2 tile_of_part(uvec2 part, uvec2 tiles) {
    return uvec2(part.x, part.y % tiles.y);
}

// View depths of a part's pixels, in metres: from x on, before y. The first part has those without surface.
vec2 fetch_part_depths(uvec2 part) {
    ivec2 place = ivec2(part.x * SHAFT_TEXELS + SHAFT_PLANES + 3u, part.y);
    return vec2(fetch_shaft_texel(place).w, fetch_shaft_texel(place + ivec2(1, 0)).w);
}

bool is_in_part(vec2 depths, float depth) {
    return depth >= depths.x && depth < depths.y;
}

// One of the surfaces.
vec3 fetch_some_surface(uvec2 part) {
    ivec2 place = ivec2(part.x * SHAFT_TEXELS + SHAFT_PLANES, part.y);
    return vec3(fetch_shaft_texel(place + ivec2(5, 0)).w, fetch_shaft_texel(place + ivec2(8, 0)).w,
        fetch_shaft_texel(place + ivec2(9, 0)).w);
}

Shaft fetch_shaft(uvec2 part) {
    ivec2 place = ivec2(part.x * SHAFT_TEXELS, part.y);
    Shaft shaft;
    for (uint i = 0u; i < SHAFT_PLANES; ++i) {
        shaft.planes[i] = fetch_shaft_texel(place + ivec2(i, 0));
    }
    shaft.low = fetch_shaft_texel(place + ivec2(SHAFT_PLANES, 0));
    shaft.high = fetch_shaft_texel(place + ivec2(SHAFT_PLANES + 1u, 0));
    return shaft;
}

// Where a box lies to a shaft.
const uint BOX_OUTSIDE = 0u;
const uint BOX_MEETS = 1u;
const uint BOX_INSIDE = 2u;

// Rounding of the sums below, as a part of their terms: every triangle of a box that is outside is
// outside by shaft_meets_triangle, and every one of a box that is inside meets the shaft by it.
const float BOX_ROUNDING = 1.0e-6;

// The lesser of two numbers: as the comparison that it is. min looks out for what is no number, at three times the cost.
float lesser(float a, float b) {
    return a < b ? a : b;
}

float least_of(vec3 v) {
    return lesser(v.x, lesser(v.y, v.z));
}

// What has to be 0 or more of a box that meets the shaft, and of one inside it. Numbers are kept rather than what
// comparisons say of them: the sign of a difference is exact, and a driver may take much longer over two comparisons.
vec2 shaft_room_of_box(Shaft shaft, vec3 low, vec3 high) {
    vec3 middle = 0.5 * low + 0.5 * high;
    vec3 half_size = 0.5 * high - 0.5 * low;
    float meets = lesser(least_of(shaft.high.xyz - low), least_of(high - shaft.low.xyz));
    float inside = lesser(least_of(low - shaft.low.xyz), least_of(shaft.high.xyz - high));
    for (uint i = 0u; i < SHAFT_PLANES; ++i) {
        vec4 plane = shaft.planes[i];
        vec3 size = abs(plane.xyz);
        float height = dot(plane.xyz, middle) - plane.w;
        float extent = dot(size, half_size);
        float slack = BOX_ROUNDING * (dot(size, abs(middle)) + extent + abs(plane.w));
        meets = lesser(slack - (height - extent), meets);
        inside = lesser(-slack - (height + extent), inside);
    }
    return vec2(meets, inside);
}

uint shaft_side_of_box(Shaft shaft, vec3 low, vec3 high) {
    vec2 room = shaft_room_of_box(shaft, low, high);
    return room.x < 0.0 ? BOX_OUTSIDE : room.y < 0.0 ? BOX_MEETS : BOX_INSIDE;
}

bool shaft_meets_box(Shaft shaft, vec3 low, vec3 high) {
    return shaft_room_of_box(shaft, low, high).x >= 0.0;
}

bool shaft_meets_triangle(Shaft shaft, vec3 a, vec3 b, vec3 c) {
    vec3 low = min(a, min(b, c));
    vec3 high = max(a, max(b, c));
    float meets = lesser(least_of(shaft.high.xyz - low), least_of(high - shaft.low.xyz));
    for (uint i = 0u; i < SHAFT_PLANES; ++i) {
        vec4 plane = shaft.planes[i];
        float least = least_of(vec3(dot(plane.xyz, a), dot(plane.xyz, b), dot(plane.xyz, c)));
        meets = lesser(plane.w - least, meets);
    }
    return meets >= 0.0;
}

// Rows of a sphere's samples lie along its first axis as long as that is not nearer to the line of sight: as a cosine.
const float NEAR_AXIS = 0.9;

// The axes of a round light that its rows of samples lie along.
void turn_axes(inout vec3 x, inout vec3 y) {
    vec3 old = x;
    x = ROW_COSINE * old + ROW_SINE * y;
    y = ROW_COSINE * y - ROW_SINE * old;
}

// Axes in which the light is held by a box: x and y along its own where it is flat, z towards the
// surfaces, of a sun towards it. p: a surface.
mat3 light_frame(Light light, vec3 p) {
    vec3 z = LIGHT_SHAPE == LIGHT_SUN ? light.center.xyz : light.direction.xyz;
    if (LIGHT_SHAPE == LIGHT_SPHERE) {
        vec3 from = p - light.center.xyz;
        float square = dot(from, from);
        z = square > 0.0 ? from * inversesqrt(square) : z;
        vec3 near = abs(dot(z, light.axis_x.xyz)) < NEAR_AXIS ? light.axis_x.xyz : light.axis_y.xyz;
        vec3 x = normalize(near - z * dot(near, z));
        return mat3(x, cross(z, x), z);
    }
    vec3 x = light.axis_x.xyz;
    vec3 y = light.axis_y.xyz;
    if (LIGHT_SHAPE == LIGHT_DISK || LIGHT_SHAPE == LIGHT_SUN) {
        turn_axes(x, y);
    }
    return mat3(x, y, z);
}

// Half the size of the light along the axes of its frame, metres; of a sun at distance 1.
vec3 light_half_size(Light light) {
    if (LIGHT_SHAPE == LIGHT_SPHERE) {
        return vec3(light.axis_x.w);
    } else if (LIGHT_SHAPE == LIGHT_LINE) {
        return vec3(light.axis_x.w, 0.0, 0.0);
    }
    return vec3(light.axis_x.w, light.axis_y.w, 0.0);
}

#endif
