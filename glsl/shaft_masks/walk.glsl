// A walk down the hierarchy with the shaft of a tile.
#ifndef ANTUMBRA_SHAFT_MASKS_WALK_GLSL
#define ANTUMBRA_SHAFT_MASKS_WALK_GLSL

#include "shaft_masks/sides.glsl"

// Whether all edges within a node cancel: its triangles and their neighbours all meet the shaft and show
// one side to all surfaces.
bool cancels(Surfaces surfaces, vec3 low, vec4 high, vec4 cone) {
    vec3 middle = 0.5 * low + 0.5 * high.xyz;
    vec3 half_size = 0.5 * high.xyz - 0.5 * low + high.w;
    return cone.w < 1.0 && is_between(surfaces, middle, length(half_size) + surfaces.margin_m)
        && box_side(surfaces, middle, half_size, cone.xyz, cone.w) != SIDE_UNSURE;
}

// What a walk does at a node.
struct Step {
    uint next;     // node to go on with
    uint triangle;
    bool is_met;   // the node is a triangle's, whose box the shaft meets
    bool cancels;  // its edges cancel and it is left out
};

Step step_at(Shaft shaft, Surfaces surfaces, uint node) {
    vec4 low = fetch_node_low(node);
    vec4 high = fetch_node_high(node);
    vec4 cone = fetch_node_cone(node);
    bool leaf = low.w >= 0.0;
    uint side = shaft_side_of_box(shaft, low.xyz, high.xyz);
    bool out_of_it = side == BOX_INSIDE && cancels(surfaces, low.xyz, high, cone);
    bool enter = side != BOX_OUTSIDE && !out_of_it;
    return Step(leaf || enter ? node + 1u : uint(-low.w), uint(max(low.w, 0.0)), leaf && enter, out_of_it);
}

// The same without a look at whether edges cancel: what lies within the shaft is gone into.
Step short_step_at(Shaft shaft, uint node) {
    vec4 low = fetch_node_low(node);
    bool leaf = low.w >= 0.0;
    bool enter = shaft_meets_box(shaft, low.xyz, fetch_node_high(node).xyz);
    return Step(leaf || enter ? node + 1u : uint(-low.w), uint(max(low.w, 0.0)), leaf && enter, false);
}

// Longest list whose triangles are looked at one by one. Invocations of a vector wait for the one with most of them.
const uint SHORT_LIST = 8u;

// Whether any triangle of a short list may hide some of the light.
bool any_hides(Light light, Surfaces surfaces, Shaft shaft, vec3 some, uint short_list[SHORT_LIST], uint count) {
    mat3 frame = light_frame(light, some);
    bool any = false;
    for (uint i = 0u; i < count && !any; ++i) {
        uint triangle = short_list[i];
        vec3 a = fetch_triangle_texel(4u * triangle).xyz;
        vec3 b = fetch_triangle_texel(4u * triangle + 1u).xyz;
        vec3 c = fetch_triangle_texel(4u * triangle + 2u).xyz;
        vec3 normal = fetch_triangle_texel(4u * triangle + 3u).xyz;
        uint side = triangle_side(surfaces, a, normal);
        uint side_of_light = light_side(surfaces, light, frame, a, normal);
        any = shaft_meets_triangle(shaft, a, b, c)
            && !hides_nothing(surfaces, side, side_of_light, a, b, c);
    }
    return any;
}

#endif
