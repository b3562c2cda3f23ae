// What holds all segments from surfaces to the light: planes around both, and what is told of the surfaces. For the
// surfaces of a tile's pixels (shafts.glsl) and those of several tiles (groups.comp).
#ifndef ANTUMBRA_SHAFT_MASKS_HULL_GLSL
#define ANTUMBRA_SHAFT_MASKS_HULL_GLSL

#include "shaft_masks/shaft.glsl"

const float FAR = 1.0e38;
// Room for rounding, as a part of the coordinates that go into a plane.
const float SLACK = 1.0e-6;
// The side of the hull of two boxes towards +a in the plane of a and z. light: half its size along a
// and z; near: least z of the surfaces, reach: their largest a and z. Returns the outward normal along a
// and z and the offset.
vec3 hull_side(vec2 light_half, float reach_a, float near_z, float far_z) {
    if (LIGHT_SHAPE == LIGHT_SUN) {
        float slope = light_half.x;
        return vec3(1.0, -slope, reach_a - slope * near_z);
    }
    float rise = 0.5 * (near_z + far_z);
    float run = reach_a - light_half.x;
    // The corners that the edge runs between are both at the far or at the near side along z.
    float side = (rise < 0.0) == (run < 0.0) ? -1.0 : 1.0;
    rise = (side < 0.0 ? near_z : far_z) - side * light_half.y;
    vec2 normal = rise < 0.0 ? vec2(-rise, run) : vec2(rise, -run);
    float scale = max(abs(normal.x), abs(normal.y));
    normal = scale > 0.0 ? normal / scale : vec2(1.0, 0.0);
    float light = normal.x * light_half.x + abs(normal.y) * light_half.y;
    float surfaces = normal.x * reach_a + max(normal.y * near_z, normal.y * far_z);
    return vec3(normal, max(light, surfaces));
}

// Sets the sides and ends of the hull. low, high: of the surfaces in the light's frame, from the origin; sphere: as
// store_surfaces returns it.
void set_hull(inout vec4 planes[SHAFT_PLANES], Light light, mat3 frame, vec3 origin, vec3 low, vec3 high, vec2 sphere,
    float slack) {
    vec3 half_size = light_half_size(light);
    vec3 right = hull_side(half_size.xz, high.x, low.z, high.z);
    vec3 left = hull_side(half_size.xz, -low.x, low.z, high.z);
    vec3 up = hull_side(half_size.yz, high.y, low.z, high.z);
    vec3 down = hull_side(half_size.yz, -low.y, low.z, high.z);
    planes[0] = vec4(right.x * frame[0] + right.y * frame[2], right.z);
    planes[1] = vec4(left.y * frame[2] - left.x * frame[0], left.z);
    planes[2] = vec4(up.x * frame[1] + up.y * frame[2], up.z);
    planes[3] = vec4(down.y * frame[2] - down.x * frame[1], down.z);
    float near_z = LIGHT_SHAPE == LIGHT_SUN ? low.z : min(low.z, -half_size.z);
    if (LIGHT_SHAPE == LIGHT_SPHERE) {
        // Of the hull at most as far from the centre as this is what is nearer to it than its samples.
        float aside = max(half_size.x, max(max(-low.x, high.x), max(-low.y, high.y)));
        near_z = max(near_z, min(low.z, sphere.x - 4.0 * sphere.y * aside));
    }
    planes[4] = vec4(-frame[2], -near_z);
    planes[5] = vec4(frame[2], max(high.z, half_size.z));
    if (LIGHT_SHAPE == LIGHT_SUN) {
        planes[5] = vec4(vec3(0.0), FAR);
    }
    for (uint i = 0u; i < 6u; ++i) {
        planes[i].w += dot(planes[i].xyz, origin) + slack;
    }
}

// The plane below which nothing hides any of the light: through the lowest of the surfaces, along up from the base, where
// all of the light is above it; else none. light_reach: half the size of a box around the light, in scene space.
vec4 plane_below(Light light, vec3 light_reach, vec3 base, vec3 up, float lowest, float slack) {
    vec3 to_light = light_offset(light, base);
    bool is_above = dot(up, to_light) - dot(abs(up), light_reach)
        > (LIGHT_SHAPE == LIGHT_SUN ? SLACK : lowest + slack);
    return is_above ? vec4(-up, slack - lowest - dot(up, base)) : vec4(vec3(0.0), FAR);
}

// Surfaces of shaft_masks/sides.glsl. low, high: of the box in its frame, from its base. some: one of them. Returns how
// far from a sphere's centre towards them what is nearer to it hides nothing, and how far directions to them differ.
vec2 store_surfaces(ivec2 place, Light light, vec3 base, vec3 some, mat3 frame, vec3 low, vec3 high, float slack,
    vec2 depths) {
    vec3 center = base + frame * (0.5 * low + 0.5 * high);
    vec3 half_size = 0.5 * high - 0.5 * low;
    float radius = length(half_size);
    vec3 z = LIGHT_SHAPE == LIGHT_SUN ? light.center.xyz : light.direction.xyz;
    float tilt = 0.0;
    float least = LIGHT_SHAPE == LIGHT_SUN ? dot(abs(z * frame), half_size) + slack : slack;
    float most = FAR;
    float end = -FAR;
    if (LIGHT_SHAPE == LIGHT_SPHERE) {
        vec3 from = center - light.center.xyz;
        float away = length(from);
        float nearest = away - radius;
        bool outside = nearest > light.axis_x.w;
        z = outside ? from / away : z;
        // The samples' disk is across the line to the surface, radius^2 / distance from the centre.
        tilt = outside ? 2.0 * radius / away : 0.0;
        float square = light.axis_x.w * light.axis_x.w;
        least = outside ? square / nearest + slack : FAR;
        end = outside ? square / (away + radius) - slack : -FAR;
    }
    if (LIGHT_SHAPE == LIGHT_POINT || LIGHT_SHAPE == LIGHT_LINE) {
        least = FAR; // their samples span no plane
    } else if (LIGHT_SHAPE != LIGHT_SUN) {
        most = dot(center - light.center.xyz, z) - dot(abs(z * frame), half_size) - slack;
    }
    // Of no size: the samples span no plane either.
    if (min(light.axis_x.w, light.axis_y.w) < 1.0e-30) {
        least = FAR;
    }
    imageStore(shafts, place, vec4(center, slack));
    imageStore(shafts, place + ivec2(1, 0), vec4(frame[0] * half_size.x, depths.x));
    imageStore(shafts, place + ivec2(2, 0), vec4(frame[1] * half_size.y, depths.y));
    imageStore(shafts, place + ivec2(3, 0), vec4(frame[2] * half_size.z, some.x));
    imageStore(shafts, place + ivec2(4, 0), vec4(z, tilt));
    imageStore(shafts, place + ivec2(5, 0), vec4(least, most, radius, end));
    return vec2(end, tilt);
}

// Planes and box of a shaft.
void store_planes(ivec2 place, vec4 planes[SHAFT_PLANES], vec4 low, vec4 high) {
    for (uint i = 0u; i < SHAFT_PLANES; ++i) {
        imageStore(shafts, place + ivec2(i, 0), planes[i]);
    }
    imageStore(shafts, place + ivec2(SHAFT_PLANES, 0), low);
    imageStore(shafts, place + ivec2(SHAFT_PLANES + 1u, 0), high);
}

// The box around normals, and of some surface what store_surfaces does not store.
void store_normals(ivec2 place, vec3 low, vec3 high, vec3 some) {
    imageStore(shafts, place + ivec2(SHAFT_PLANES + 8u, 0), vec4(low, some.y));
    imageStore(shafts, place + ivec2(SHAFT_PLANES + 9u, 0), vec4(high, some.z));
}

#endif
