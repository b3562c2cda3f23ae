// Up to four edges around the receiver's place, their visibilities joined two by two (Mo, Popescu,
// Wyman, section 3.3).
//
// The paper's displacement d = (w - delta) / 2 of the receiver's place has d / w = 1 - t, the hidden
// part of the light's diameter. Here t comes from the plane through receiver and edge, which is the
// same for an edge parallel to the light and exact for inclined ones; d still says where to look for
// further edges.
#ifndef ANTUMBRA_SSOC_PUBLISHED_GLSL
#define ANTUMBRA_SSOC_PUBLISHED_GLSL

#include "common/combine.glsl"
#include "ssoc/edge.glsl"

bool same_line(Seen a, Seen b, float texel) {
    return a.number == b.number
        || (dot(a.outward, b.outward) > 0.95
            && abs(dot(a.outward, b.nearest - a.nearest)) < 1.5 * texel + 0.05 * a.width);
}

float combined(Seen a, Seen b, float seen) {
    float second = seen_past(b);
    float along = dot(a.outward, b.outward);
    vec2 apart = b.nearest - a.nearest;
    bool either = dot(apart, a.outward) <= 0.0 && dot(apart, b.outward) >= 0.0;
    if (COMBINE == COMBINE_PRODUCT) {
        return seen * second;
    } else if (COMBINE == COMBINE_MIN) {
        return min(seen, second);
    } else if (COMBINE == COMBINE_AND) {
        return visibility_and(seen, second, along);
    } else if (COMBINE == COMBINE_OR) {
        return 1.0 - visibility_and(1.0 - seen, 1.0 - second, along);
    }
    bool one_blocker = abs(a.depth - b.depth) < 0.3 * max(abs(a.depth), abs(b.depth));
    return either && one_blocker
        ? 1.0 - visibility_and(1.0 - seen, 1.0 - second, along)
        : visibility_and(seen, second, along);
}

float soft_published(Place here, LightView light_view) {
    uint entry = edge_at(here, here.map, here.hidden);
    // Far from any edge the map alone decides.
    Seen first = look_at(here, light_view, entry, here.at);
    if (first.number == 0u) {
        return here.hidden ? 0.0 : 1.0;
    }
    float texel = band_texel(light_view);
    float seen = seen_past(first);
    float delta = clamp(first.delta, -first.width, first.width);
    float displaced = 0.5 * (first.width - delta);
    vec2 across = first.outward;
    vec2 tangent = vec2(-across.y, across.x);
    // The warped point, the other side of a narrow blocker, the other map here, around both ends of
    // the edge: at each the edges of both maps.
    vec2 places[6] = vec2[](
        here.at,
        here.at + displaced * across,
        here.at - (first.width + delta) * across,
        here.at,
        first.nearest + first.width * tangent,
        first.nearest - first.width * tangent
    );
    Seen used[4];
    uint count = 0u;
    for (uint i = 1u; i < min(LOOKUPS, 6u); ++i) {
        vec2 map = map_of(light_view, places[i]);
        for (uint side = 0u; side < 2u && count < 4u && in_map(map); ++side) {
            uint next = edge_at(here, map, side == 1u);
            Seen other = look_at(here, light_view, next, here.at);
            bool again = other.number == 0u || same_line(first, other, texel);
            for (uint j = 0u; j < count; ++j) {
                again = again || same_line(used[j], other, texel);
            }
            if (!again) {
                seen = combined(first, other, seen);
                used[count] = other;
                count += 1u;
            }
        }
    }
    return clamp(seen, 0.0, 1.0);
}

#endif
