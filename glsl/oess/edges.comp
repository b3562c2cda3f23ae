#version 460
// Occluding edges among the texels of an end's map (Reimann and Dreier, section 3.2), and a map of what
// they reach that is still empty.

#include "common/triangles.glsl"
#include "oess/row.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0) uniform sampler2D map_depth;
layout(set = 0, binding = 1) uniform usampler2D map_ids;
layout(set = 0, binding = 2) uniform sampler2D triangles;
layout(set = 0, binding = 3, r32ui) uniform writeonly uimage2D edges;
layout(set = 0, binding = 4, r32ui) uniform writeonly uimage2D outreach;
layout(set = 0, binding = 5, r32ui) uniform writeonly uimage2D steps;

// 0: folds; 1: the published strategy 2, location of corresponding pixels; 2: strategy 1, tilt; 3: both
// strategies.
layout(constant_id = 0) const uint FIND = 0u;
const uint FIND_FOLD = 0u;
const uint FIND_LOCATION = 1u;
const uint FIND_TILT = 2u;

// A fall of the corresponding pixel by less is noise of depths.
const float LEAST_FALL = 1.0;

float fetch_row_depth(ivec2 texel) {
    return texelFetch(map_depth, texel, 0).x;
}

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

// Whether what a texel shows faces both ends: triangles block from both sides.
bool faces_other(ivec2 texel) {
    uint id = texelFetch(map_ids, texel, 0).x;
    if (id == 0u) {
        return true;
    }
    vec3 normal = fetch_geometric_normal(id - 1u);
    vec3 corner = fetch_corner(id - 1u, 0u).position;
    return (dot(normal, push.here.xyz - corner) > 0.0) == (dot(normal, push.there.xyz - corner) > 0.0);
}

void main() {
    ivec2 size = textureSize(map_depth, 0);
    ivec2 place = ivec2(gl_GlobalInvocationID.xy); // u, row
    if (any(greaterThanEqual(place, size))) {
        return;
    }
    ivec2 texel = ivec2(row_column(place.x, size.x), place.y);
    bool edge = false;
    if (place.x > 0) {
        float c = corresponding(place.x, place.y, size.x);
        bool falls = corresponding(place.x - 1, place.y, size.x) - c > LEAST_FALL;
        if (FIND == FIND_FOLD) {
            edge = falls;
        }
        // The printed test asks for the last texel of the receiver: what is meant is the least of
        // three.
        if (FIND != FIND_FOLD && FIND != FIND_TILT) {
            bool least = place.x + 1 >= size.x || c < corresponding(place.x + 1, place.y, size.x);
            edge = falls && least;
        }
        if (FIND >= FIND_TILT) {
            ivec2 before = ivec2(row_column(place.x - 1, size.x), place.y);
            edge = edge || (faces_other(texel) && !faces_other(before));
        }
    }
    imageStore(edges, texel, uvec4(edge ? 1u : 0u));
    imageStore(outreach, texel, uvec4(0u));
    if (place.x == 0) {
        imageStore(steps, ivec2(place.y, 0), uvec4(0u));
    }
}
