#version 460
#extension GL_EXT_control_flow_attributes : require
// Masks of the tiles whose triangles are on no list: a walk down the hierarchy for each pixel, with the pyramid of what
// it sees of the light, which is much narrower than its tile's shaft. Of a fine mesh a tile shows thousands of triangles,
// which are all within that shaft, while few are before any one of its pixels. Walks that are not at their end after so
// many steps go on in runs of nodes, all at once: a walk can begin at any node, of those above it is only not known
// whether they are met.

#include "common/camera.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "shaft_masks/params.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

// 1 for the rest of walks.
layout(constant_id = 1) const uint REST = 0u;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 2, r32f) uniform readonly image2D view_depth;
layout(set = 0, binding = 3, r32ui) uniform readonly uimage2D ids;
layout(set = 0, binding = 4, rgba32f) uniform readonly image2D triangles;
layout(set = 0, binding = 5, rgba32f) uniform readonly image2D hierarchy;
layout(set = 0, binding = 6, rgba32f) uniform readonly image2D materials;
layout(set = 0, binding = 7, rgba32f) uniform readonly image2D uvs;
layout(set = 0, binding = 8, rgba8) uniform readonly image2D footprints;
layout(set = 0, binding = 9, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 10) uniform usampler2D list;
layout(set = 0, binding = 11, rgba32f) uniform readonly image2D shafts;
layout(set = 0, binding = 12, rgba32ui) uniform readonly uimage2D lists;
layout(set = 0, binding = 13, r32ui) uniform uimage2D words;
layout(set = 0, binding = 14, std430) buffer WalkArguments {
    TileArguments walks;
};
// Tile, node to go on with.
layout(set = 0, binding = 15, rgba32ui) uniform uimage2D walk_list;

layout(push_constant) uniform Push {
    uint first_run; // of nodes, of this dispatch
    uint run;       // nodes of a run
} push;

#define SUN_TANGENT_SQUARE (view.light.axis_x.w * view.light.axis_x.w)

#include "shaft_masks/lists.glsl"
#include "shaft_masks/masks.glsl"

// A software driver may end loops after 65,535 turns of all lanes of a vector together.
const uint MOST_STEPS = 7680u;

// Steps that a triangle counts as: each hole is a turn of a loop.
const uint TRIANGLE_STEPS = MASKED != 0u ? 1u + ROWS * COLUMNS : 1u;

const uint NO_TRIANGLE = 0xffffffffu;

// Of the pixels' walks; nodes at the end.
shared uint first_left;

vec4 fetch_triangle_texel(uint texel) {
    return imageLoad(triangles, triangle_texel_place(texel));
}

vec4 fetch_node_texel(ivec2 place) {
    return imageLoad(hierarchy, place);
}

vec4 fetch_shaft_texel(ivec2 place) {
    return imageLoad(shafts, place);
}

vec4 fetch_material_texel(ivec2 place) {
    return imageLoad(materials, place);
}

vec4 fetch_uv_texel(ivec2 place) {
    return imageLoad(uvs, place);
}

vec4 fetch_footprint(ivec2 place) {
    return imageLoad(footprints, place);
}

// What holds every segment from a point to the light, around the point: half-spaces dot(n, x) <= 0 and a box.
struct Pyramid {
    vec3 planes[5]; // four sides, and below the receiver's own plane; of length 1 at most
    vec3 low;
    vec3 high;
};

vec3 any_across(vec3 v) {
    vec3 size = abs(v);
    vec3 axis = size.x <= size.y && size.x <= size.z ? vec3(1.0, 0.0, 0.0)
        : size.y <= size.z ? vec3(0.0, 1.0, 0.0) : vec3(0.0, 0.0, 1.0);
    return cross(v, axis);
}

vec3 side_plane(vec3 to_edge, vec3 along, float turn) {
    return turn * cross(to_edge, along) * inversesqrt(max(dot(to_edge, to_edge) * dot(along, along), 1.0e-37));
}

Pyramid pyramid_to(LightFrom light, vec3 normal) {
    // Rows of samples rise by less than the distance of two.
    vec3 x = light.x;
    vec3 y = (1.0 + 2.0 * row_rise()) * light.y;
    // Sides of a line, and of a point, are where they would be if it had some width.
    vec3 along_x = dot(x, x) > 0.0 ? x : any_across(light.center);
    vec3 along_y = dot(y, y) > 0.0 ? y : cross(light.center, along_x);
    float turn = dot(light.center, cross(along_y, along_x)) >= 0.0 ? 1.0 : -1.0;
    Pyramid pyramid;
    pyramid.planes[0] = side_plane(light.center + x, along_y, turn);
    pyramid.planes[1] = side_plane(light.center - x, along_y, -turn);
    pyramid.planes[2] = side_plane(light.center + y, along_x, -turn);
    pyramid.planes[3] = side_plane(light.center - y, along_x, turn);
    pyramid.planes[4] = -normal;
    vec3 reach = abs(x) + abs(y);
    float far = LIGHT_SHAPE == LIGHT_SUN ? 3.0e38 : 1.0;
    vec3 low = light.center - reach;
    vec3 high = light.center + reach;
    pyramid.low = LIGHT_SHAPE == LIGHT_SUN ? mix(vec3(0.0), vec3(-far), lessThan(low, vec3(0.0))) : min(low, 0.0);
    pyramid.high = LIGHT_SHAPE == LIGHT_SUN ? mix(vec3(0.0), vec3(far), greaterThan(high, vec3(0.0))) : max(high, 0.0);
    return pyramid;
}

// low, high: of a box, from the point. rounding_m: of positions.
bool meets_box(Pyramid pyramid, vec3 low, vec3 high, float rounding_m) {
    vec3 middle = 0.5 * low + 0.5 * high;
    vec3 half_size = 0.5 * high - 0.5 * low;
    bool meets = all(lessThanEqual(low, pyramid.high + rounding_m))
        && all(greaterThanEqual(high, pyramid.low - rounding_m));
    vec3 size = abs(middle) + half_size;
    float slack = 2.0 * rounding_m + BOX_ROUNDING * (size.x + size.y + size.z);
    for (uint i = 0u; i < 5u; ++i) {
        vec3 plane = pyramid.planes[i];
        meets = meets && dot(plane, middle) - dot(abs(plane), half_size) <= slack;
    }
    return meets;
}

// The samples that a triangle hides from a receiver, but for those in already.
uvec2 blocked_by(MaskReceiver receiver, LightFrom light, uint block, Blocker blocker, uvec2 already) {
    Hidden hidden = hidden_by(receiver, light, blocker);
    if (MASKED != 0u && material_is_masked(blocker.plane.w)) {
        Hidden nothing = Hidden(uvec2(0u), hidden.weights);
        Hidden four[4] = Hidden[4](hidden, nothing, nothing, nothing);
        uvec2 blocked[4] = uvec2[4](already, uvec2(0u), uvec2(0u), uvec2(0u));
        cut_holes(blocker, block, blocked, four);
        hidden = four[0];
    }
    return hidden.within;
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    index = spread_entry(index, arguments.count);
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uvec2 listed = REST != 0u ? imageLoad(walk_list, task_place(index)).xy
        : uvec2(texelFetch(list, tile_entry_place(index, tiles), 0).x, 0u);
    uint entry = listed.x;
    uvec2 part = part_of_entry(entry, tiles);
    uvec2 pixel = tile_of_part(part, tiles) * TILE_SIZE + gl_LocalInvocationID.xy;
    uint block = gl_WorkGroupID.z % params.pattern.y;
    uint first = REST != 0u ? (push.first_run + gl_WorkGroupID.z / params.pattern.y) * push.run : 0u;
    uint nodes = REST != 0u ? min(first + push.run, params.counts.z) : params.counts.z;
    first = REST != 0u ? max(first, listed.y) : 0u;
    if (gl_LocalInvocationIndex == 0u) {
        first_left = nodes;
    }
    barrier();
    fetch_light_rows(block);

    uvec2 within = min(pixel, params.counts.xy - 1u);
    float depth = imageLoad(view_depth, ivec2(within)).x;
    vec3 ray = pixel_ray(view.camera, within);
    bool in_part = is_in_part(fetch_part_depths(part), depth) && all(equal(within, pixel));
    MaskReceiver receiver;
    receiver.in_part = in_part;
    receiver.id = depth > 0.0 ? imageLoad(ids, ivec2(within)).x : 0u;
    receiver.position = view.camera.eye.xyz + depth * ray;
    receiver.position += way_into_triangle(receiver.position, receiver.id);
    vec3 normal = fetch_geometric_normal(max(receiver.id, 1u) - 1u);
    normal = dot(normal, ray) > 0.0 ? -normal : normal;
    LightFrom light = rows_from(view.light, receiver.position);
    uvec2 blocked = own_mask(light, normal);
    Pyramid pyramid = pyramid_to(light_from(view.light, receiver.position), normal);
    vec3 extent = max(abs(receiver.position), LIGHT_SHAPE == LIGHT_SUN ? vec3(0.0) : abs(view.light.center.xyz));
    float rounding_m = 4.0 * POSITION_ROUNDING * max(extent.x, max(extent.y, extent.z));

    // What hides all of the light ends the walk, but not where other blocks of samples go by this one's end.
    bool may_end = REST != 0u || params.pattern.y == 1u || block > 0u;
    bool is_dark = may_end && all(equal(blocked, uvec2(0xffffffffu)));
    uint node = receiver.id == 0u || !in_part || is_dark ? nodes : first;
    uint steps = 0u;
    while (node < nodes && steps < MOST_STEPS) {
        // Boxes until one holds a triangle: vector units look at triangles for all of their lanes or for none.
        uint triangle = NO_TRIANGLE;
        while (node < nodes && steps < MOST_STEPS && triangle == NO_TRIANGLE) {
            steps += 1u;
            vec4 low = fetch_node_low(node);
            vec3 high = fetch_node_high(node).xyz;
            bool leaf = low.w >= 0.0;
            bool meets = meets_box(pyramid, low.xyz - receiver.position, high - receiver.position, rounding_m);
            triangle = leaf && meets ? uint(low.w) : NO_TRIANGLE;
            node = leaf || meets ? node + 1u : uint(-low.w);
        }
        steps += TRIANGLE_STEPS;
        if (triangle != NO_TRIANGLE) {
            blocked |= blocked_by(receiver, light, block, fetch_blocker(triangle), blocked);
            bool ends = may_end && all(equal(blocked, uvec2(0xffffffffu)));
            node = ends ? nodes : node;
        }
    }
    if (in_part) {
        uint slot = imageLoad(lists, list_place(part) + ivec2(2, 0)).z;
        for (uint word = 0u; word < 2u; ++word) {
            ivec2 at = word_place(slot, pixel % TILE_SIZE, params.pattern.y, 2u * block + word);
            imageAtomicOr(words, at, receiver.id == 0u ? 0u : blocked[word]);
        }
    }
    atomicMin(first_left, node);
    barrier();
    if (REST == 0u && gl_LocalInvocationIndex == 0u && block == 0u && first_left < nodes) {
        uint walk = atomicAdd(walks.count, 1u);
        atomicMax(walks.groups_x, min(walk + 1u, TILE_ROW));
        atomicMax(walks.groups_y, walk / TILE_ROW + 1u);
        imageStore(walk_list, task_place(walk), uvec4(entry, first_left, 0u, 0u));
    }
}
