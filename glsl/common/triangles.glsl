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

uint fetch_material(uint triangle) {
    return uint(fetch_triangle_texel(4u * triangle + 3u).w);
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
