#version 460
// Walks the hierarchy with each tile's shaft. A tile whose shaft meets no triangle is lit, one with a
// triangle between all of it and all of the light is dark; both are settled here. The others get a list
// of the triangles that their shafts meet.

#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "shaft_masks/lists.glsl"
#include "shaft_masks/shaft.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 2) uniform sampler2D tile_bounds;
layout(set = 0, binding = 3) uniform sampler2D triangles;
layout(set = 0, binding = 4) uniform sampler2D hierarchy;
layout(set = 0, binding = 5, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 6) uniform usampler2D list;
layout(set = 0, binding = 7) uniform sampler2D shafts;
layout(set = 0, binding = 8, std430) buffer PenumbraArguments {
    TileArguments penumbra;
};
layout(set = 0, binding = 9, r32ui) uniform writeonly uimage2D penumbra_list;
layout(set = 0, binding = 10, std430) buffer Pool {
    uint chunks_used;
};
layout(set = 0, binding = 11, r32ui) uniform writeonly uimage2D pool;
layout(set = 0, binding = 12, rgba32ui) uniform writeonly uimage2D lists;
layout(set = 0, binding = 13, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 14) uniform sampler2D view_depth;
layout(set = 0, binding = 15, std430) buffer TaskArguments {
    TileArguments further;
};
// Tile, chunk and number of the first entry.
layout(set = 0, binding = 16, rgba32ui) uniform writeonly uimage2D tasks;
layout(set = 0, binding = 17, std430) buffer PartialArguments {
    TileArguments partial;
};
layout(set = 0, binding = 18, r32ui) uniform writeonly uimage2D partial_list;

// A software driver may end loops after 65,535 turns of all lanes of a vector together: a walk ends
// itself before, and the passes on lists take it up where it ended.
const uint MOST_STEPS = 24576u;
// Pairs of corners that one walk looks at, of up to 16 lanes of a vector one after the other.
const uint MOST_LOOKS = 2048u;

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

vec4 fetch_node_texel(ivec2 place) {
    return texelFetch(hierarchy, place, 0);
}

vec4 fetch_shaft_texel(ivec2 place) {
    return texelFetch(shafts, place, 0);
}

// Corner 0 to 7 of a box around the light; of a sun a direction.
vec3 light_corner(Light light, mat3 frame, uint corner) {
    vec3 side = vec3(uvec3(corner, corner >> 1, corner >> 2) & 1u) * 2.0 - 1.0;
    return light.center.xyz + frame * (side * light_half_size(light));
}

// Whether p sees the end l (of a sun: the direction) through the triangle, with a margin.
bool sees_through(vec3 p, vec3 l, vec3 a, vec3 b, vec3 c, vec3 normal, float margin_m) {
    vec3 to = LIGHT_SHAPE == LIGHT_SUN ? l : l - p;
    float height = dot(normal, a - p);
    float fall = dot(normal, to);
    float turn = height > 0.0 ? 1.0 : -1.0;
    bool between = abs(height) > margin_m && turn * fall > 0.0
        && (LIGHT_SHAPE == LIGHT_SUN || turn * fall > abs(height));
    vec3 edges = vec3(dot(cross(a - p, b - p), to), dot(cross(b - p, c - p), to),
        dot(cross(c - p, a - p), to));
    vec3 margins = margin_m * length(to) * vec3(length(a - p) + length(b - p),
        length(b - p) + length(c - p), length(c - p) + length(a - p));
    return between && all(greaterThan(turn * edges, margins));
}

// Whether the triangle is between all of the tile and all of the light: sides of edges are bilinear in
// the two ends of a segment, so corners decide.
bool covers(uvec2 tile, TileBounds bounds, mat3 frame, vec3 a, vec3 b, vec3 c, vec4 plane, inout uint looks) {
    vec3 p = tile_corner(view.camera, tile, bounds, 0u);
    vec3 extent = max(abs(a), max(abs(p), LIGHT_SHAPE == LIGHT_SUN ? vec3(0.0) : abs(view.light.center.xyz)));
    float margin_m = POSITION_ROUNDING * max(extent.x, max(extent.y, extent.z));
    bool all_through = !material_is_masked(plane.w) && looks + 64u <= MOST_LOOKS
        && sees_through(p, view.light.center.xyz, a, b, c, plane.xyz, margin_m);
    for (uint i = 0u; i < 64u && all_through; ++i) {
        p = tile_corner(view.camera, tile, bounds, i & 7u);
        vec3 l = light_corner(view.light, frame, i >> 3);
        looks += 1u;
        all_through = sees_through(p, l, a, b, c, plane.xyz, margin_m);
    }
    return all_through;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 size = params.counts.xy;
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 tile = tile_of_entry(entry, tiles);
    ivec2 place = ivec2(tile.x * TILE_TEXELS, tile.y);
    TileBounds bounds = tile_bounds_of(texelFetch(tile_bounds, place, 0),
        texelFetch(tile_bounds, place + ivec2(1, 0), 0), texelFetch(tile_bounds, place + ivec2(2, 0), 0));
    Shaft shaft = fetch_shaft(tile);
    mat3 frame = light_frame(view.light, tile_corner(view.camera, tile, bounds, 0u));

    uint nodes = params.counts.z;
    TriangleList found = TriangleList(0u, 0u, nodes);
    uint chunk = 0u;
    uint slot = CHUNK;
    bool dark = false;
    uint node = 0u;
    uint steps = 0u;
    uint looks = 0u;
    while (node < nodes) {
        steps += 1u;
        vec4 low = fetch_node_low(node);
        uint next = node + 1u;
        if (low.w >= 0.0) {
            uint triangle = uint(low.w);
            vec3 a = fetch_triangle_texel(4u * triangle).xyz;
            vec3 b = fetch_triangle_texel(4u * triangle + 1u).xyz;
            vec3 c = fetch_triangle_texel(4u * triangle + 2u).xyz;
            if (shaft_meets_triangle(shaft, a, b, c)) {
                vec4 plane = fetch_triangle_texel(4u * triangle + 3u);
                dark = covers(tile, bounds, frame, a, b, c, plane, looks);
                if (slot == CHUNK) {
                    uint fresh = atomicAdd(chunks_used, 1u);
                    if (fresh >= params.counts.w) {
                        found.resume = node;
                        next = nodes;
                    } else if (found.count == 0u) {
                        found.chunk = fresh;
                    } else {
                        imageStore(pool, chunk_entry_place(chunk, CHUNK), uvec4(fresh));
                        if (found.count % TASK_ENTRIES == 0u) {
                            uint task = atomicAdd(further.count, 1u);
                            atomicMax(further.groups_x, min(task + 1u, TILE_ROW));
                            atomicMax(further.groups_y, task / TILE_ROW + 1u);
                            imageStore(tasks, task_place(task), uvec4(entry, fresh, found.count, 0u));
                        }
                    }
                    chunk = fresh;
                    slot = 0u;
                }
                if (found.resume == nodes) {
                    imageStore(pool, chunk_entry_place(chunk, slot), uvec4(triangle));
                    slot += 1u;
                    found.count += 1u;
                }
                next = dark ? nodes : next;
            }
        } else if (!shaft_meets_box(shaft, low.xyz, fetch_node_high(node))) {
            next = uint(-low.w);
        }
        node = next;
        if (steps == MOST_STEPS && node < nodes) {
            found.resume = min(found.resume, node);
            node = nodes;
        }
    }

    bool lit = found.count == 0u && found.resume == nodes && shaft.low.w > 0.0;
    if (lit || dark) {
        for (uint i = 0u; i < TILE_SIZE * TILE_SIZE; ++i) {
            uvec2 pixel = tile * TILE_SIZE + uvec2(i % TILE_SIZE, i / TILE_SIZE);
            bool hit = shaft.high.w > 0.0 || texelFetch(view_depth, ivec2(min(pixel, size - 1u)), 0).x > 0.0;
            // Stores beyond the picture's border are dropped.
            imageStore(visibility, ivec2(pixel), vec4(dark && hit ? 0.0 : 1.0));
        }
    } else {
        uint at = atomicAdd(penumbra.count, 1u);
        atomicMax(penumbra.groups_x, min(at + 1u, TILE_ROW));
        atomicMax(penumbra.groups_y, at / TILE_ROW + 1u);
        imageStore(penumbra_list, tile_entry_place(at, tiles), uvec4(entry));
        if (found.resume < nodes) {
            at = atomicAdd(partial.count, 1u);
            atomicMax(partial.groups_x, min(at + 1u, TILE_ROW));
            atomicMax(partial.groups_y, at / TILE_ROW + 1u);
            imageStore(partial_list, tile_entry_place(at, tiles), uvec4(entry));
        }
    }
    uint state = lit || dark ? TILE_SETTLED : TILE_OPEN;
    imageStore(lists, ivec2(tile), uvec4(found.chunk, found.count, found.resume, state));
}
