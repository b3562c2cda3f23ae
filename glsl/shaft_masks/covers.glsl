// Triangles that cover all of a light for all surfaces of a tile.
#ifndef ANTUMBRA_SHAFT_MASKS_COVERS_GLSL
#define ANTUMBRA_SHAFT_MASKS_COVERS_GLSL

#include "shaft_masks/lists.glsl"
#include "shaft_masks/sides.glsl"

struct Triangle {
    vec3 corners[3];
    vec4 plane;
};

Triangle fetch_triangle(uint triangle) {
    return Triangle(vec3[3](fetch_triangle_texel(4u * triangle).xyz, fetch_triangle_texel(4u * triangle + 1u).xyz,
        fetch_triangle_texel(4u * triangle + 2u).xyz), fetch_triangle_texel(4u * triangle + 3u));
}

// Whether p sees all of a box around the light through the triangle, with a margin. half_size: of the box, in its
// frame; of a sun the box holds directions.
bool sees_through(vec3 p, Light light, mat3 frame, vec3 half_size, Triangle t, float margin_m) {
    vec3 a = t.corners[0] - p;
    vec3 b = t.corners[1] - p;
    vec3 c = t.corners[2] - p;
    vec3 to = light_offset(light, p);
    float height = dot(t.plane.xyz, a);
    float turn = height > 0.0 ? 1.0 : -1.0;
    float fall = turn * dot(t.plane.xyz, to) - dot(abs(t.plane.xyz * frame), half_size);
    bool between = abs(height) > margin_m && fall > (LIGHT_SHAPE == LIGHT_SUN ? 0.0 : abs(height));
    vec3 ab = cross(a, b);
    vec3 bc = cross(b, c);
    vec3 ca = cross(c, a);
    vec3 edges = turn * vec3(dot(ab, to), dot(bc, to), dot(ca, to));
    edges -= vec3(dot(abs(ab * frame), half_size), dot(abs(bc * frame), half_size), dot(abs(ca * frame), half_size));
    // Sums of coordinates, which lengths are at most.
    vec3 lengths = vec3(dot(abs(a), vec3(1.0)), dot(abs(b), vec3(1.0)), dot(abs(c), vec3(1.0)));
    vec3 margins = margin_m * (dot(abs(to), vec3(1.0)) + dot(half_size, vec3(1.0))) * (lengths + lengths.yzx);
    return between && all(greaterThan(edges, margins));
}

float cover_margin_m(Surfaces surfaces, Light light, Triangle t) {
    vec3 extent = max(abs(t.corners[0]),
        max(abs(surfaces.center), LIGHT_SHAPE == LIGHT_SUN ? vec3(0.0) : abs(light.center.xyz)));
    return POSITION_ROUNDING * max(extent.x, max(extent.y, extent.z));
}

// Corner 0 to 7 of the box around the surfaces.
vec3 surfaces_corner(Surfaces surfaces, uint corner) {
    vec3 side = vec3(uvec3(corner, corner >> 1, corner >> 2) & 1u) * 2.0 - 1.0;
    return surfaces.center + side.x * surfaces.axes[0] + side.y * surfaces.axes[1] + side.z * surfaces.axes[2];
}

#endif
