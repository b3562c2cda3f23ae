// The light's disk in cells of equal area: what each cell shows is decided by the edge nearest to it.
//
// The edge nearest to the receiver's own place gives the first answer, exact where its line is the
// only one. Then for each cell the place is looked at where a ray to the cell's middle passes the
// edge's depth: the shadow map tells on which side of the outline that is, the distortion map of that
// side which edge is nearest. Where that is another edge, the cell's part of the first answer is
// exchanged for what this edge leaves of the cell. Edges never have to be joined beyond their own
// cell, so nothing depends on how they lie to each other elsewhere, and edges that are not found
// cost no more than the cells they cross.
#ifndef ANTUMBRA_SSOC_CELLS_GLSL
#define ANTUMBRA_SSOC_CELLS_GLSL

#include "common/combine.glsl"
#include "ssoc/edge.glsl"

// Cells on the inner ring.
const uint INNER = LOOKUPS > 8u ? (LOOKUPS - 1u) / 3u : LOOKUPS - 1u;

// From where to where of the disk's area, 0 to 1, the ring of a cell reaches.
vec2 cell_ring(uint cell) {
    float first = cell == 0u ? 0.0 : cell > INNER ? float(1u + INNER) : 1.0;
    float last = cell == 0u ? 1.0 : cell > INNER ? float(LOOKUPS) : float(1u + INNER);
    return vec2(first, last) / float(LOOKUPS);
}

// Part of the light's power that a cell has.
float cell_power(uint cell) {
    vec2 ring = cell_ring(cell);
    return (FALLOFF != 0u ? 2.0 - ring.x - ring.y : 1.0) / float(LOOKUPS);
}

// Middle of a cell in the unit disk: the first in its centre, the others on a ring, or on two rings
// where there are more than eight.
vec2 cell_middle(uint cell) {
    bool outer = cell > INNER;
    float count = float(outer ? LOOKUPS - 1u - INNER : INNER);
    vec2 ring = cell_ring(cell);
    float part = 0.5 * (ring.x + ring.y);
    if (FALLOFF != 0u) {
        // The mean by power.
        float squares = dot(ring, ring) + ring.x * ring.y;
        part = (part - squares / 3.0) / max(1.0 - part, 1.0e-6);
    }
    float turn = 6.2831853 * (float(cell - 1u) + (outer ? 0.5 : 0.0)) / max(count, 1.0);
    return cell == 0u ? vec2(0.0) : sqrt(part) * vec2(cos(turn), sin(turn));
}

// What an edge leaves of a cell.
float cell_past(vec3 chord, vec2 middle) {
    return disk_above(clamp((chord.x + dot(chord.yz, middle)) * sqrt(float(LOOKUPS)), -1.0, 1.0));
}

// Where the ray to a point of the light is at a depth, in the view's units.
vec2 passage(Place here, LightView light_view, vec2 middle, float depth) {
    bool perspective = light_view.forward.w > 0.0;
    vec3 from = vec3(here.at, 1.0) / (perspective ? here.depth : 1.0);
    from.z = perspective ? from.z : here.depth;
    vec3 way = in_view(light_view, here.light.center + middle.x * here.light.x + middle.y * here.light.y);
    float part = ((perspective ? 1.0 / depth : depth) - from.z) / min(way.z, -1.0e-30);
    vec3 at = from + max(part, 0.0) * way;
    return perspective ? at.xy * depth : at.xy;
}

// How far a depth is before the receiver, in the unit in which rays are straight in the map.
float rise_of(Place here, LightView light_view, float depth) {
    return light_view.forward.w > 0.0 ? depth - here.depth : here.depth - depth;
}

// Depth of what a place of the map shows, as in Place.
float shown_depth(Place here, LightView light_view, vec2 map) {
    float stored = map_depth_at(here, map);
    return light_view.forward.w > 0.0
        ? stored / light_view.scale.z
        : (stored - light_view.scale.w) / light_view.scale.z;
}

// Whether what is in front of the receiver's plane at a place of the map blocks the ray to the
// cell's middle, which is at the depth `passed` there. If it is nearer to the receiver than that,
// the ray was at its depth before; a wall that the receiver stands at is no longer there.
bool still_blocked(Place here, LightView light_view, vec2 middle, vec2 map, float passed) {
    const float SAME = 0.5;
    float depth = shown_depth(here, light_view, map);
    float rise = rise_of(here, light_view, depth);
    if (rise >= SAME * rise_of(here, light_view, passed)) {
        return true;
    }
    map = map_of(light_view, passage(here, light_view, middle, depth));
    return rise_of(here, light_view, shown_depth(here, light_view, map)) >= SAME * rise;
}

// Whether something else hides the part of a cell that an edge leaves, as the bottom of a dent does
// past the dent's rim. What is much nearer to the receiver may be its own surface, and not where the ray
// is at that depth.
bool hidden_beside(Place here, LightView light_view, Seen near) {
    const float LEAST = 0.25;
    float texel = max(abs(1.0 / light_view.scale.x), abs(1.0 / light_view.scale.y)) / float(params.counts.y);
    vec2 map = map_of(light_view, near.nearest + 1.5 * texel * near.outward);
    return in_map(map)
        && blocked_at(here, map)
        && rise_of(here, light_view, shown_depth(here, light_view, map))
            >= LEAST * rise_of(here, light_view, near.depth);
}

// near: the nearest edge on the cell's own side; far: that of the other map, the other edge of a
// narrow blocker or gap if the way to it leads over the near one.
float cell_seen(bool blocked, Seen near, Seen far, vec2 middle) {
    float seen = cell_past(near.chord, middle);
    vec2 apart = far.nearest - near.nearest;
    float sign = blocked ? 1.0 : -1.0;
    bool beyond = sign * dot(apart, near.outward) >= 0.0 && sign * dot(apart, far.outward) <= 0.0;
    if (far.number == 0u || far.number == near.number || !beyond) {
        return seen;
    }
    float other = cell_past(far.chord, middle);
    float along = dot(near.chord.yz, far.chord.yz);
    if (blocked) {
        return visibility_and(seen, other, along);
    }
    bool one_blocker = abs(near.depth - far.depth) < 0.3 * max(abs(near.depth), abs(far.depth));
    return one_blocker ? 1.0 - visibility_and(1.0 - seen, 1.0 - other, along) : seen;
}

float soft_cells(Place here, LightView light_view) {
    float texel = band_texel(light_view);
    uint first = 0u;
    vec3 chord = vec3(1.0, 1.0, 0.0);
    float depth = 0.0;
    float result = 1.0;
    float change = 0.0;
    for (uint cell = 0u; cell < LOOKUPS; ++cell) {
        vec2 middle = cell_middle(cell);
        float passed = depth;
        float hard = 1.0;
        float seen = 1.0;
        // A second time where the edge found is not at the depth that was assumed.
        for (uint attempt = 0u; attempt < 2u; ++attempt) {
            vec2 at = cell == 0u ? here.at : passage(here, light_view, middle, passed);
            vec2 map = map_of(light_view, at);
            if (!in_map(map)) {
                seen = cell_past(chord, middle);
                break;
            }
            bool blocked = cell == 0u ? here.hidden : blocked_at(here, map);
            if (cell > 0u && blocked) {
                blocked = still_blocked(here, light_view, middle, map, passed);
            }
            uint near_entry = edge_at(here, map, blocked);
            uint far_entry = edge_at(here, map, !blocked);
            uint second_entry = LAYERS > 1u ? second_edge_at(here, map, blocked) : 0u;
            hard = blocked ? 0.0 : 1.0;
            // Without an outline near, it is as at the receiver's own place, or else as the first
            // edge has it.
            seen = blocked == here.hidden ? hard : cell_past(chord, middle);
            bool plain = (near_entry & EDGE_NUMBER) == first && far_entry == 0u && second_entry == 0u;
            if (cell > 0u && plain && (!blocked || cell_past(chord, middle) == 0.0)) {
                seen = cell_past(chord, middle);
                break;
            }
            Seen near = look_at(here, light_view, near_entry, at);
            Seen far = look_at(here, light_view, far_entry, at);
            // The second layer where the first one's edge is not in front of this receiver or out of reach.
            if (LAYERS > 1u && near.number == 0u) {
                near = look_at(here, light_view, second_entry, at);
            }
            if (LAYERS > 1u && far.number == 0u) {
                far = look_at(here, light_view, second_edge_at(here, map, !blocked), at);
            }
            if (cell == 0u) {
                Seen wide = near.number != 0u && (far.number == 0u || near.width > far.width) ? near : far;
                depth = wide.depth;
                if (wide.number == 0u) {
                    return hard;
                }
                first = near.number;
                chord = near.number != 0u ? near.chord : vec3(blocked ? -1.0 : 1.0, 1.0, 0.0);
                result = near.number != 0u ? seen_past(near) : hard;
            }
            if (near.number != 0u) {
                // The line of an edge that says the opposite of the map is not the outline here.
                bool other_side = blocked ? near.delta > 1.5 * texel : near.delta < -1.5 * texel;
                if (!other_side) {
                    seen = cell_seen(blocked, near, far, middle);
                    bool asked = blocked && (cell == 0u || seen > 0.0);
                    if (asked && hidden_beside(here, light_view, near)) {
                        seen = 0.0;
                        if (cell == 0u) {
                            // As without an edge.
                            first = EDGE_NUMBER;
                            chord = vec3(-1.0, 1.0, 0.0);
                            result = 0.0;
                        }
                    }
                }
            }
            if (cell == 0u || near.number == 0u) {
                break;
            }
            vec2 again = passage(here, light_view, middle, near.depth);
            if (distance(again, at) < 0.75 * texel) {
                break;
            }
            passed = near.depth;
        }
        change += cell_power(cell) * (seen - cell_past(chord, middle));
    }
    return clamp(result + change, 0.0, 1.0);
}

#endif
