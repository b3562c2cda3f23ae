// Shadow mapping (Williams 1978) of the light's centre, compared in the receiver's plane.
//
// A texel holds the depth at its centre, the receiver is elsewhere in it: comparing the two darkens
// every slanted surface, and a bias that prevents it detaches shadows. The receiver's plane has a
// known depth at the texel's centre (light_view_plane), and that is what the texel is compared
// with: no bias, at any slope.
#ifndef ANTUMBRA_HARD_GLSL
#define ANTUMBRA_HARD_GLSL

#include "common/light_view.glsl"

float fetch_map_depth(ivec2 texel, uint view); // defined by the entry file

// What rasterisation may be off by. Vertices snap to 1/256 texel, which shifts a plane's depth by up
// to that part of its slope; four times that covers interpolation over the largest triangle. Depths
// themselves are rounded to 2^-24. Larger values detach shadows, smaller ones leave dark specks.
const float SNAP_TEXELS = 1.0 / 64.0;
const float ROUNDING = 1.0 / 1048576.0;

// 1 where the light's centre is seen, else 0. q: from the light to the point, metres; n: unit normal
// of the receiver's plane, on the light's side.
float hard_visibility(LightView view, uint index, vec3 q, vec3 n, vec2 map, float size_texels) {
    ivec2 texel = ivec2(clamp(map * size_texels, 0.0, size_texels - 1.0));
    float stored = fetch_map_depth(texel, index);
    vec3 plane = light_view_plane(view, q, n, (vec2(texel) + 0.5) / size_texels);
    float slack = (abs(plane.y) + abs(plane.z)) / size_texels * SNAP_TEXELS + abs(plane.x) * ROUNDING;
    return stored > plane.x + slack ? 0.0 : 1.0;
}

#endif
