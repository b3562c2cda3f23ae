// Tiles of 8x8 pixels, what their surfaces are bounded by, and lists of those that need work.
#ifndef ANTUMBRA_COMMON_TILES_GLSL
#define ANTUMBRA_COMMON_TILES_GLSL

#include "common/camera.glsl"

const uint TILE_SIZE = 8u;

// Workgroups in x of a dispatch over a list; the rest go on in y. Devices allow at least 65,535.
const uint TILE_ROW = 32768u;

// Texels of a tile in the image of bounds, side by side.
const uint TILE_TEXELS = 3u;

struct TileBounds {
    float nearest;    // view depth in metres of what was hit; farthest is 0 where nothing was
    float farthest;
    bool all_hit;     // no pixel of the tile missed
    bool one_triangle; // all pixels show one, or nothing
    vec3 normal_low;  // box around the geometric normals
    vec3 normal_high;
};

TileBounds tile_bounds_of(vec4 depths, vec4 low, vec4 high) {
    return TileBounds(depths.x, depths.y, depths.z > 0.0, low.w > 0.0, low.xyz, high.xyz);
}

// Arguments of an indirect dispatch over a list of tiles, and how many there are.
struct TileArguments {
    uint groups_x;
    uint groups_y;
    uint groups_z;
    uint count;
};

// Place of a list's entry in its image, which has one texel for each tile of the picture.
ivec2 tile_entry_place(uint index, uvec2 tiles) {
    return ivec2(index % tiles.x, index / tiles.x);
}

// The entry of a list that a workgroup takes, of so many: 16 workgroups in a row take entries from all over the list.
// Neighbours in a list are neighbours in the picture, and what they take differs a hundredfold: a driver that gives
// each core one part of the dispatch gives all of them the same share of work so, also where only the first workgroups
// have any.
uint spread_entry(uint index, uint count) {
    uint rows = count / 16u;
    return index < 16u * rows ? index % rows * 16u + index / rows : index;
}

uvec2 tile_of_entry(uint entry, uvec2 tiles) {
    return uvec2(entry % tiles.x, entry / tiles.x);
}

// Corner 0 to 7 of a hull that holds all surfaces of a tile; scene space.
vec3 tile_corner(Camera camera, uvec2 tile, TileBounds bounds, uint corner) {
    uvec2 pixel = tile * TILE_SIZE + (TILE_SIZE - 1u) * uvec2(corner & 1u, corner >> 1 & 1u);
    float depth = (corner & 4u) == 0u ? bounds.nearest : bounds.farthest;
    return camera.eye.xyz + depth * pixel_ray(camera, pixel);
}

// The largest dot product of a vector with any normal in the box.
float most_along(vec3 normal_low, vec3 normal_high, vec3 v) {
    vec3 most = max(normal_low * v, normal_high * v);
    return most.x + most.y + most.z;
}

#endif
