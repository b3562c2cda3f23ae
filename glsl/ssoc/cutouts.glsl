// Where alpha cuts holes into triangles the outline is in no list of edges, and the light past a solid
// edge may be behind a leaf. There the shadow map decides alone, filtered over what the light covers of
// it at the blockers' mean depth (Fernando 2005).
#ifndef ANTUMBRA_SSOC_CUTOUTS_GLSL
#define ANTUMBRA_SSOC_CUTOUTS_GLSL

#include "common/taps.glsl"
#include "ssoc/cells.glsl"

const uint CUTOUT_SEARCH = 16u;
const uint CUTOUT_TAPS = 64u;

uint fetch_map_id(ivec3 texel); // defined by the entry file: triangle's number plus one, 0 for none

bool is_cut_out(Place here, vec2 map) {
    uint id = fetch_map_id(texel_of(here, map, params.counts.y));
    return id != 0u && material_is_masked(fetch_triangle_texel(4u * id - 1u).w);
}

// The part of the light that is seen, or less than 0 where no triangle with holes is in front of the
// receiver within the light's reach. turn: of the taps, 0 to 1.
float past_cutouts(Place here, LightView light_view, float turn) {
    float nearest = light_view.forward.w > 0.0 ? 1.0 / params.search.x : params.search.x;
    float sum = 0.0;
    float count = 0.0;
    bool found = false;
    for (uint i = 0u; i <= CUTOUT_SEARCH; ++i) {
        vec2 at = i < CUTOUT_SEARCH
            ? passage(here, light_view, disk_tap(i, CUTOUT_SEARCH, turn), nearest)
            : here.at;
        vec2 map = map_of(light_view, at);
        if (in_map(map) && blocked_at(here, map)) {
            sum += shown_depth(here, light_view, map);
            count += 1.0;
            found = found || is_cut_out(here, map);
        }
    }
    if (!found) {
        return -1.0;
    }
    float seen = 0.0;
    float all = 0.0;
    for (uint i = 0u; i < CUTOUT_TAPS; ++i) {
        vec2 tap = disk_tap(i, CUTOUT_TAPS, turn);
        vec2 map = map_of(light_view, passage(here, light_view, tap, sum / count));
        float power = FALLOFF != 0u ? 1.0 - dot(tap, tap) : 1.0;
        seen += in_map(map) && blocked_at(here, map) ? 0.0 : power;
        all += power;
    }
    return seen / all;
}

#endif
