// Triangles of the scene in an RGBA32F image, four texels each: three corners with their shading
// normals, then the geometric normal with the material. An image is the fastest read-only form that
// every driver offers for millions of elements.
#ifndef ANTUMBRA_COMMON_TRIANGLES_GLSL
#define ANTUMBRA_COMMON_TRIANGLES_GLSL

// Width of the image in texels; equal to TRIANGLE_IMAGE_WIDTH of the renderer.
const uint TRIANGLE_IMAGE_WIDTH = 4096u;

vec4 fetch_triangle_texel(uint texel); // defined by the entry file

struct Corner {
    vec3 position; // scene space, metres
    float normal;  // see unpack_corner_normal
};

Corner fetch_corner(uint triangle, uint corner) {
    vec4 texel = fetch_triangle_texel(4u * triangle + corner);
    return Corner(texel.xyz, texel.w);
}

// Unit geometric normal, counter-clockwise side.
vec3 fetch_geometric_normal(uint triangle) {
    return fetch_triangle_texel(4u * triangle + 3u).xyz;
}

// What the fourth texel holds beside the normal: a material's number, or -1 less that number where
// the material cuts holes.
bool material_is_masked(float stored) {
    return stored < 0.0;
}

uint material_number(float stored) {
    return uint(stored < 0.0 ? -1.0 - stored : stored);
}

uint fetch_material(uint triangle) {
    return material_number(fetch_triangle_texel(4u * triangle + 3u).w);
}

// Barycentric coordinates of a point in a triangle's plane, each 0 to 1, from areas along the normal.
vec3 weights_in_triangle(vec3 p, vec3 a, vec3 b, vec3 c, vec3 normal) {
    float weight_b = dot(cross(p - a, c - a), normal);
    float weight_c = dot(cross(b - a, p - a), normal);
    float area = dot(cross(b - a, c - a), normal);
    vec2 weights = clamp(vec2(weight_b, weight_c) / max(area, 1.0e-38), 0.0, 1.0);
    return vec3(1.0 - weights.x - weights.y, weights);
}

vec3 triangle_weights(uint triangle, vec3 p) {
    vec3 a = fetch_corner(triangle, 0u).position;
    vec3 b = fetch_corner(triangle, 1u).position;
    vec3 c = fetch_corner(triangle, 2u).position;
    return weights_in_triangle(p, a, b, c, fetch_geometric_normal(triangle));
}

// The way from p to the nearest point of a triangle; none for a point over or under it.
//
// Which triangle a pixel shows is decided between corners that rasterisation has snapped to its grid. Beside an edge
// that may be the neighbour of the one that the pixel's ray meets, and what the ray meets of its plane is then outside
// of it. Where the surface is hollow such a point lies behind it, by many times what is rounding, and sees nothing of
// the light. The triangle's nearest point is on the surface, and off the ray by no more than the grid's step. id: one
// more than the triangle's number, or 0.
vec3 way_into_triangle(vec3 p, uint id) {
    uint triangle = max(id, 1u) - 1u;
    vec3 corners[3] = vec3[](fetch_corner(triangle, 0u).position - p, fetch_corner(triangle, 1u).position - p,
        fetch_corner(triangle, 2u).position - p);
    vec3 normal = fetch_geometric_normal(triangle);
    bool within = true;
    vec3 way = vec3(0.0);
    float least = 3.0e38;
    for (uint i = 0u; i < 3u; ++i) {
        vec3 a = corners[i];
        vec3 along = corners[i == 2u ? 0u : i + 1u] - a;
        vec3 inward = cross(normal, along);
        float outside = dot(inward, a);
        within = within && outside <= 0.0;
        float square = max(dot(along, along), 1.0e-37);
        float place = -dot(a, along);
        // Each edge with its first end. Corners are met exactly.
        vec3 to_edge = outside / square * inward + dot(normal, a) * normal;
        vec3 offset = place > 0.0 && place < square ? to_edge : a;
        float distance_square = dot(offset, offset);
        way = distance_square < least ? offset : way;
        least = min(least, distance_square);
    }
    return within || id == 0u ? vec3(0.0) : way;
}

ivec2 triangle_texel_place(uint texel) {
    return ivec2(texel % TRIANGLE_IMAGE_WIDTH, texel / TRIANGLE_IMAGE_WIDTH);
}

// Two 12-bit octahedral coordinates as one whole number: below 2^24 a float holds it exactly, which
// bits reinterpreted as a float would not survive everywhere.
vec2 unpack_corner_normal(float packed) {
    float high = floor(packed / 4096.0);
    float low = packed - 4096.0 * high;
    return vec2(low, high) / 2047.5 - 1.0;
}

#endif
