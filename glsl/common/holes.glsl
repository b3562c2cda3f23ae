// Holes that alpha cuts into masked materials.
//
// Alpha lies between those of four texels. Footprints, one for each place of the four within a texture and beyond its
// borders, hold them together: a look is one fetch. Those of a texture as a material repeats it begin a row of an image
// for all of them and run on through as many as they need.
#ifndef ANTUMBRA_COMMON_HOLES_GLSL
#define ANTUMBRA_COMMON_HOLES_GLSL

#include "common/materials.glsl"

// Defined by the entry file; place in the image. Alphas at (0, 0), (1, 0), (0, 1) and (1, 1).
vec4 fetch_footprint(ivec2 place);

// What looks at all places of a material have in common.
struct Holes {
    uint start;  // first footprint
    vec2 size;   // of the texture, texels
    vec2 cells;  // footprints across and down,
    vec2 turns;  // and one part of so many
    vec2 least;  // numbers of footprints are first made to lie between these,
    vec2 most;
    vec2 first;  // and counted from here
    float alpha; // the material's own
    float cutoff;
};

Holes fetch_holes(uint material) {
    vec4 texture_place = fetch_texture(material);
    vec4 finish = fetch_finish(material);
    float mode_v = floor(texture_place.w / 3.0);
    vec2 modes = vec2(texture_place.w - 3.0 * mode_v, mode_v);
    bvec2 mirrored = equal(modes, vec2(1.0));
    bvec2 clamped = equal(modes, vec2(2.0));
    Holes holes;
    holes.start = uint(finish.w) * TRIANGLE_IMAGE_WIDTH;
    holes.size = texture_place.yz;
    // Before a clamped border there is one more; mirrored, a texture only repeats after two.
    holes.cells = holes.size * mix(vec2(1.0), vec2(2.0), mirrored) + vec2(clamped);
    holes.turns = 1.0 / holes.cells;
    holes.first = -vec2(clamped);
    holes.least = mix(vec2(-3.0e38), vec2(-1.0), clamped);
    holes.most = mix(vec2(3.0e38), holes.size - 1.0, clamped);
    holes.alpha = fetch_base_color(material).a;
    holes.cutoff = finish.z;
    return holes;
}

// Whether there is a hole at uv: alpha is linear between texel centres.
bool is_hole_at(Holes holes, vec2 uv) {
    vec2 place = uv * holes.size - 0.5;
    vec2 corner = floor(place);
    vec2 part = clamp(place - corner, 0.0, 1.0);
    vec2 cell = clamp(corner, holes.least, holes.most) - holes.first;
    // Half a footprint further no number is near a whole number of turns: the quotient's rounding decides nothing.
    vec2 before = holes.cells * floor((cell + 0.5) * holes.turns);
    cell = clamp(cell - before, vec2(0.0), holes.cells - 1.0);
    uint footprint = holes.start + uint(cell.y) * uint(holes.cells.x) + uint(cell.x);
    vec4 alphas = fetch_footprint(triangle_texel_place(footprint));
    vec2 sides = mix(alphas.xz, alphas.yw, part.x);
    return holes.alpha * mix(sides.x, sides.y, part.y) < holes.cutoff;
}

bool is_hole(uint material, vec2 uv) {
    return is_hole_at(fetch_holes(material), uv);
}

#endif
