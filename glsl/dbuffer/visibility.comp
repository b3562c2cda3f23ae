#version 460
// Visibility of the listed tiles.

#include "common/light_above.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "dbuffer/entries.glsl"
#include "dbuffer/params.glsl"
#include "dbuffer/through.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std140) uniform View {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform Block {
    DbufferParams params;
};
layout(set = 0, binding = 2) uniform sampler2D view_depth;
layout(set = 0, binding = 3) uniform usampler2D ids;
layout(set = 0, binding = 4) uniform sampler2D triangles;
layout(set = 0, binding = 5) uniform sampler2D hierarchy;
layout(set = 0, binding = 6) uniform sampler2D materials;
layout(set = 0, binding = 7) uniform sampler2D uvs;
layout(set = 0, binding = 8) uniform sampler2D footprints;
layout(set = 0, binding = 9) uniform usampler2D edges;
layout(set = 0, binding = 10) uniform sampler2D points;
layout(set = 0, binding = 11) uniform usampler2D numbers;
layout(set = 0, binding = 12) uniform usampler2D pool;
layout(set = 0, binding = 13) uniform usampler2D lists;
layout(set = 0, binding = 14) uniform sampler2D hard;
layout(set = 0, binding = 15, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 16, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 17) uniform usampler2D list;
layout(set = 0, binding = 18, std140) uniform ThroughBlock {
    Through through;
};
layout(set = 0, binding = 19) uniform sampler2D ends;
layout(set = 0, binding = 20) uniform sampler2D chunk_boxes;

#include "dbuffer/coverage.glsl"
#include "dbuffer/cutouts.glsl"
#include "dbuffer/ray.glsl"

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

vec4 fetch_node_texel(ivec2 place) {
    return texelFetch(hierarchy, place, 0);
}

vec4 fetch_material_texel(ivec2 place) {
    return texelFetch(materials, place, 0);
}

vec4 fetch_uv_texel(ivec2 place) {
    return texelFetch(uvs, place, 0);
}

vec4 fetch_footprint(ivec2 place) {
    return texelFetch(footprints, place, 0);
}

uvec4 fetch_edge_texel(ivec2 place) {
    return texelFetch(edges, place, 0);
}

vec4 fetch_point_texel(ivec2 place) {
    return texelFetch(points, place, 0);
}

uint fetch_pool_texel(ivec2 place) {
    return texelFetch(pool, place, 0).x;
}

uvec4 fetch_list_texel(ivec2 place) {
    return texelFetch(lists, place, 0);
}

// What positions are rounded by, as a part of the largest coordinate that they are made from, the camera's
// among them: a few units of the last place.
const float POSITION_ROUNDING = 1.0 / 2097152.0;

// Layers along the light in which the estimate below holds on to the edges' own number.
const float FEW = 0.02;

// Rays that a receiver may send to tell how many layers there are, and samples that may be off by rounding.
const uint MOST_RAYS = 4u;

const uint FEW_SAMPLES = 2u;

// Most triangles with holes of a tile that receivers look at: where there are more, they send rays.
const uint MOST_CUTOUTS = 1024u;

// 1 where a sample is above the receiver's plane.
vec4 above_plane(vec3 horizon, uint i) {
    vec4 height = horizon.x * params.samples[2u * i] + horizon.y * params.samples[2u * i + 1u] + horizon.z;
    return vec4(greaterThan(height, vec4(0.0)));
}

// Goes on to the next chunk whose box may matter; false at the end of the list. What the list does not know is a
// chunk without a box.
bool next_chunk(CoverageReceiver r, inout Entries entries) {
    bool found = false;
    while (!found && has_entries(entries)) {
        bool listed = begin_chunk(entries);
        vec3 low = texelFetch(chunk_boxes, triangle_texel_place(2u * entries.chunk), 0).xyz;
        vec3 high = texelFetch(chunk_boxes, triangle_texel_place(2u * entries.chunk + 1u), 0).xyz;
        found = !listed || box_may_matter(r, low, high);
        if (!found) {
            skip_chunk(entries);
        }
    }
    return found;
}

// All of a tile's edges. Vector units walk through branches that none of their lanes takes: so each lane looks
// for the next chunk and in it for the next edge that matters to it in loops of its own, and only then do all
// go through the rest. (A loop that tests its condition at its end loses the values of lanes that leave it early
// on Mesa 22.3.)
void add_edges(uint tile, uint tiles, CoverageReceiver r, inout Coverage found) {
    for (uint block = 0u; block < blocks_of(tile, tiles, params.sizes.x); ++block) {
        Entries entries = list_entries(block, tile, tiles);
        bool in_chunk = false;
        while (in_chunk || has_entries(entries)) {
            if (!in_chunk) {
                in_chunk = next_chunk(r, entries);
            }
            bool matters = false;
            uint entry = 0u;
            while (in_chunk && !matters) {
                entry = next_entry(entries, in_chunk);
                vec3 a = texelFetch(ends, triangle_texel_place(2u * entry), 0).xyz;
                vec3 b = texelFetch(ends, triangle_texel_place(2u * entry + 1u), 0).xyz;
                matters = edge_may_matter(r, a - r.p, b - r.p);
            }
            if (matters) {
                add_edge(r, texelFetch(numbers, triangle_texel_place(entry), 0).x, found);
            }
        }
    }
}

// Triangles with holes that it would look at, or nodes in which they may be.
uint cutouts_of(uint tile, uint tiles) {
    uvec4 stored = texelFetch(lists, list_place(params.sizes.x, tile, tiles), 0);
    return stored.y + stored.w - stored.z;
}

// All of a tile's triangles with holes, in loops like edges.
void add_cutouts(uint tile, uint tiles, CoverageReceiver r, inout uvec2 seen) {
    Entries entries = list_entries(params.sizes.x, tile, tiles);
    bool in_chunk = false;
    while ((in_chunk || has_entries(entries)) && (seen.x | seen.y) != 0u) {
        if (!in_chunk) {
            in_chunk = next_chunk(r, entries);
        }
        bool matters = false;
        uint triangle = 0u;
        while (in_chunk && !matters) {
            bool listed = entries.rest > 0u;
            uint entry = next_entry(entries, in_chunk);
            // What the list does not know are nodes.
            float leaf = listed ? float(entry) : fetch_node_low(entry).w;
            triangle = uint(max(leaf, 0.0));
            matters = leaf >= 0.0 && cutout_may_matter(r, triangle);
        }
        if (matters) {
            add_cutout(r, triangle, seen);
        }
    }
}

// How many of some samples of the light, a bit for each, rays do not reach. Where steps run out, those
// reached so far count for all.
float hidden_samples(CoverageReceiver r, uvec2 wanted, uint kinds, uint steps) {
    float all = float(bitCount(wanted.x) + bitCount(wanted.y));
    float done = 0.0;
    float hidden = 0.0;
    for (uint i = 0u; i < 4u * FOURS; ++i) {
        uint word = i < 32u ? wanted.x : wanted.y;
        if ((word >> (i & 31u) & 1u) != 0u && steps < MOST_STEPS) {
            vec2 place = vec2(params.samples[2u * (i / 4u)][i % 4u], params.samples[2u * (i / 4u) + 1u][i % 4u]);
            bool sun = LIGHT_SHAPE == LIGHT_SUN;
            vec3 to = to_light_place(r, place);
            bool blocked = ray_is_blocked(r.p, to, sun, params.counts.z, r.rounding_m, kinds, steps);
            bool known = blocked || steps < MOST_STEPS;
            done += known ? 1.0 : 0.0;
            hidden += blocked ? 1.0 : 0.0;
        }
    }
    return done > 0.0 ? hidden / done * all : 0.0;
}

// The part of the light that rays to its samples reach, of what is above the receiver's plane.
float traced(CoverageReceiver r, vec3 horizon, bool whole) {
    uvec2 wanted = uvec2(0u);
    for (uint i = 0u; i < FOURS; ++i) {
        uint bits = bits_of((whole ? vec4(1.0) : above_plane(horizon, i)) - 0.5);
        wanted.x |= i < 8u ? bits << (4u * i & 31u) : 0u;
        wanted.y |= i < 8u ? 0u : bits << (4u * i & 31u);
    }
    float weight = float(bitCount(wanted.x) + bitCount(wanted.y));
    float hidden = hidden_samples(r, wanted, SOLID | CUTOUT, 0u);
    return weight > 0.0 ? 1.0 - hidden / weight : 1.0;
}

// Samples of the light with the same number of layers before them.
struct Level {
    float layers;
    uint samples;
    vec2 place; // the first of them
    vec2 last;
};

// The fewest layers that are at least as many as asked for.
Level next_level(Coverage found, bool whole, vec3 horizon, float least) {
    Level level = Level(1.0e9, 0u, vec2(0.0), vec2(0.0));
    for (uint i = 0u; i < FOURS; ++i) {
        vec4 all = all_layers(found.layers[i]);
        vec4 layers = whole ? all : mix(vec4(1.0e9), all, above_plane(horizon, i));
        for (uint j = 0u; j < 4u; ++j) {
            float here = layers[j] >= least ? layers[j] : 1.0e9;
            bool fewer = here < level.layers;
            vec2 place = vec2(params.samples[2u * i][j], params.samples[2u * i + 1u][j]);
            level.place = fewer ? place : level.place;
            level.last = here < 1.0e9 && here <= level.layers ? place : level.last;
            level.samples = fewer ? 1u : level.samples + (here < 1.0e9 && here == level.layers ? 1u : 0u);
            level.layers = min(level.layers, here);
        }
    }
    return level;
}

float pixel_visibility(uvec2 pixel, uint tile, uint tiles) {
    float depth = texelFetch(view_depth, ivec2(pixel), 0).x;
    uint id = texelFetch(ids, ivec2(pixel), 0).x;
    vec3 ray = pixel_ray(view.camera, pixel);
    vec3 p = view.camera.eye.xyz + depth * ray;
    p += way_into_triangle(p, id);
    vec3 n = fetch_geometric_normal(max(id, 1u) - 1u);
    n = dot(n, ray) > 0.0 ? -n : n;
    bool sun = LIGHT_SHAPE == LIGHT_SUN;
    float above = id == 0u ? 0.0 : light_above(view.light, LIGHT_SHAPE, p, n);
    bool behind = (LIGHT_SHAPE == LIGHT_DISK || LIGHT_SHAPE == LIGHT_RECT)
        && dot(light_offset(view.light, p), view.light.direction.xyz) >= 0.0;
    if (above <= 0.0 || behind) {
        return id == 0u ? 1.0 : (above <= 0.0 ? 0.0 : texelFetch(hard, ivec2(pixel), 0).x);
    }
    vec3 extent = max(max(abs(p), abs(view.camera.eye.xyz)), sun ? vec3(0.0) : abs(view.light.center.xyz));
    float rounding_m = POSITION_ROUNDING * max(extent.x, max(extent.y, extent.z));
    CoverageReceiver r = coverage_receiver(view.light, p, n, rounding_m);
    vec3 horizon = vec3(dot(n, r.axis_u), dot(n, r.axis_v), dot(n, r.center));
    bool whole = above >= 1.0;
    if (edges_of(tile, tiles, params.sizes.x) > params.sizes.z || (LIGHT_SHAPE != LIGHT_SUN && through.cut.x != 0u)) {
        return above * traced(r, horizon, whole);
    }
    bool center_above = horizon.z > 0.0;
    if (!center_above) {
        // The highest point of the light.
        vec2 up = horizon.xy / max(length(horizon.xy), 1.0e-37);
        r.from = LIGHT_SHAPE == LIGHT_RECT ? sign(up) : up;
    }

    Coverage found;
    for (uint i = 0u; i < FOURS; ++i) {
        found.layers[i] = vec4(0.0);
    }
    found.integral = vec2(0.0);
    found.most = vec2(0.0);
    found.lighter = 0.0;
    found.fewer = 0.0;
    found.beyond = vec2(0.0);
    add_edges(tile, tiles, r, found);

    Level level = next_level(found, whole, horizon, -1.0e9);
    float fewest = level.layers;
    vec2 target = level.place;
    if (fewest > 0.0) {
        // The fewest layers lie between samples.
        fewest = 0.0;
        target = r.from;
    }
    bool center_seen = center_above && texelFetch(hard, ivec2(pixel), 0).x > 0.0;
    // Where the centre is seen and nothing has fewer layers, there are none before the centre. Else a ray
    // to where there are fewest tells whether that is none. If it is not, a part of the light between
    // the samples may have fewer still, or rounding has taken a layer too many off one sample.
    bool known = center_seen && fewest == 0.0;
    bool again = whole && fewest == 0.0 && found.lighter > 0.0;
    // A ray that passes an edge within rounding may be blocked where its edges say that it is not.
    bool once_more = level.samples > FEW_SAMPLES && fewest == level.layers;
    uint steps = 0u;
    for (uint i = 0u; i < MOST_RAYS && !known; ++i) {
        known = !ray_is_blocked(p, to_light_place(r, target), sun, params.counts.z, rounding_m, SOLID, steps);
        if (!known && center_seen) {
            fewest = 0.0;
            known = true;
        } else if (!known && once_more) {
            once_more = false;
            target = level.last;
        } else if (!known && level.samples <= FEW_SAMPLES && level.layers <= 0.0) {
            level = next_level(found, whole, horizon, level.layers + 0.5);
            fewest = level.layers;
            target = level.place;
            again = false;
            i = level.samples > 0u ? i : MOST_RAYS;
        } else if (!known && again) {
            again = false;
            fewest = -found.fewer;
            target = found.beyond;
            level.samples = FEW_SAMPLES + 1u;
        } else {
            i = MOST_RAYS;
        }
    }
    if (!known) {
        return 0.0;
    }

    // Visible are the samples without layers. Where all blockers have the same number of layers and none
    // is behind another, the part of the light that they hide is proportional to the mean number, which
    // is known exactly: so the samples' own mean of it, in the proportion that they show, is replaced by
    // the exact one (a control variate). Bodies have an even number of layers and sheets an odd one: each
    // kind has a proportion of its own.
    float weight = 0.0;
    float hidden = 0.0;
    uvec2 seen = uvec2(0u);
    vec2 mean = vec2(0.0); // of even and odd layers
    vec3 square = vec3(0.0); // of both, and their product
    vec2 both = vec2(0.0); // of each and what is hidden
    for (uint i = 0u; i < FOURS; ++i) {
        vec4 all = all_layers(found.layers[i]);
        vec4 odd = (found.layers[i] - all) * ODD_PARTS;
        vec4 even = all - odd;
        vec4 is_hidden = vec4(greaterThan(all - fewest, vec4(0.5)));
        vec4 counts = whole ? vec4(1.0) : above_plane(horizon, i);
        weight += dot(counts, vec4(1.0));
        hidden += dot(is_hidden, counts);
        uint bits = bits_of(counts - is_hidden - 0.5);
        seen.x |= i < 8u ? bits << (4u * i & 31u) : 0u;
        seen.y |= i < 8u ? 0u : bits << (4u * i & 31u);
        mean += vec2(dot(even, counts), dot(odd, counts));
        square += vec3(dot(even * even, counts), dot(odd * odd, counts), dot(even * odd, counts));
        both += vec2(dot(even, is_hidden), dot(odd, is_hidden));
    }
    float cut_away = 0.0;
    if (MASKED != 0u) {
        if (cutouts_of(tile, tiles) > MOST_CUTOUTS) {
            cut_away = hidden_samples(r, seen, CUTOUT, steps);
        } else {
            int before = bitCount(seen.x) + bitCount(seen.y);
            add_cutouts(tile, tiles, r, seen);
            cut_away = float(before - bitCount(seen.x) - bitCount(seen.y));
        }
    }
    if (!whole) {
        return above * (weight > 0.0 ? 1.0 - (hidden + cut_away) / weight : 1.0);
    }
    hidden /= weight;
    mean /= weight;
    square = square / weight - vec3(mean * mean, mean.x * mean.y) + vec3(FEW, FEW, 0.0);
    both = both / weight - mean * hidden + FEW / max(found.most, vec2(1.0));
    float spread = max(square.x * square.y - square.z * square.z, FEW * FEW);
    vec2 proportion = (square.yx * both - square.z * both.yx) / spread;
    return clamp(1.0 - hidden - cut_away / weight - dot(proportion, found.integral - mean), 0.0, 1.0);
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 size = params.counts.xy;
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(spread_entry(index, arguments.count), tiles), 0).x;
    uvec2 pixel = tile_of_entry(entry, tiles) * TILE_SIZE + gl_LocalInvocationID.xy;
    if (any(greaterThanEqual(pixel, size))) {
        return;
    }
    imageStore(visibility, ivec2(pixel), vec4(pixel_visibility(pixel, entry, tiles.x * tiles.y)));
}
