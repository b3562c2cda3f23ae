#version 460
// Groups of tiles beside each other, or of parts of tiles, which are to be listed: what is between a group and the light
// is found once, and each of its tiles takes from that what is between itself and the light. An invocation for each cell
// of tiles of one kind: with the first tile of a cell go those that widen the box around its surfaces least.

#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "shaft_masks/estimates.glsl"
#include "shaft_masks/lists.glsl"
#include "shaft_masks/sides.glsl"

layout(local_size_x = PARTS_A_GROUP) in;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 2, rgba32f) uniform readonly image2D part_shafts;
layout(set = 0, binding = 3, r32ui) uniform readonly uimage2D estimates;
// Of the group that a part leads, at the part's place.
layout(set = 0, binding = 4, rgba32f) uniform writeonly image2D shafts;
// Of each part that which leads its group.
layout(set = 0, binding = 5, r32ui) uniform writeonly uimage2D leaders;
layout(set = 0, binding = 6, std430) buffer GroupArguments {
    TileArguments groups;
};
layout(set = 0, binding = 7, r32ui) uniform writeonly uimage2D group_list;

layout(constant_id = 2) const uint MOST_PARTS = 2u; // that a tile is worked on in

#include "shaft_masks/hull.glsl"

// Nothing is fetched from these here.
vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0);
}

vec4 fetch_node_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_shaft_texel(ivec2 place) {
    return imageLoad(part_shafts, place);
}

// A box around surfaces of several tiles may be as many times as wide as the widest of theirs.
const float MOST_WIDER = 3.0;

// The box of surfaces along the axes of a frame, from a base.
void box_along(Surfaces surfaces, vec3 base, mat3 frame, out vec3 low, out vec3 high) {
    vec3 middle = (surfaces.center - base) * frame;
    vec3 reach = vec3(surfaces_extent(surfaces, frame[0]), surfaces_extent(surfaces, frame[1]),
        surfaces_extent(surfaces, frame[2]));
    low = middle - reach;
    high = middle + reach;
}

// The directions of three axes across each other; others where one of them has no length.
mat3 directions(vec3 axes[3]) {
    mat3 frame;
    bool known = true;
    for (uint i = 0u; i < 3u; ++i) {
        vec3 size = abs(axes[i]);
        float scale = max(size.x, max(size.y, size.z));
        known = known && scale > 0.0;
        frame[i] = normalize(axes[i] / (scale > 0.0 ? scale : 1.0));
    }
    return known ? frame : mat3(1.0);
}

// Stores the shaft of the first of these parts with the others that go with it; returns the parts that are left.
uint add_group(uvec2 cell, uint level, uvec2 tiles, uint members) {
    uint first = uint(findLSB(members));
    uvec2 leader = part_of_member(cell, first, level, tiles);
    uint leading = leader.y * tiles.x + leader.x;
    Surfaces surfaces = fetch_surfaces(leader, view.light);
    Shaft shaft = fetch_shaft(leader);
    vec3 some = fetch_some_surface(leader);
    vec3 base = surfaces.center;
    mat3 frame = light_frame(view.light, base);
    mat3 box_frame = directions(surfaces.axes);
    vec3 origin = LIGHT_SHAPE == LIGHT_SUN ? view.camera.eye.xyz : view.light.center.xyz;
    vec3 half_size = light_half_size(view.light);
    vec3 light_reach = abs(frame[0]) * half_size.x + abs(frame[1]) * half_size.y + abs(frame[2]) * half_size.z;

    vec3 low;
    vec3 high;
    vec3 own_low;
    vec3 own_high;
    box_along(surfaces, origin, frame, low, high);
    box_along(surfaces, base, box_frame, own_low, own_high);
    float widest = surfaces.radius_m;
    float slack = surfaces.margin_m;
    vec3 normal_low = surfaces.normal_low;
    vec3 normal_high = surfaces.normal_high;
    vec4 below = shaft.planes[6];
    bool one_plane = true;
    bool above = shaft.low.w > 0.0;
    uint left = members & ~(1u << first);
    imageStore(leaders, ivec2(leader), uvec4(leading));
    for (uint member = first + 1u; member < CELL.x * CELL.y; ++member) {
        if ((members >> member & 1u) != 0u) {
            uvec2 part = part_of_member(cell, member, level, tiles);
            Surfaces others = fetch_surfaces(part, view.light);
            vec3 others_low;
            vec3 others_high;
            box_along(others, base, box_frame, others_low, others_high);
            others_low = min(others_low, own_low);
            others_high = max(others_high, own_high);
            float wide = max(widest, others.radius_m);
            if (0.5 * length(others_high - others_low) <= MOST_WIDER * wide) {
                Shaft more = fetch_shaft(part);
                own_low = others_low;
                own_high = others_high;
                box_along(others, origin, frame, others_low, others_high);
                low = min(low, others_low);
                high = max(high, others_high);
                widest = wide;
                slack = max(slack, others.margin_m);
                normal_low = min(normal_low, others.normal_low);
                normal_high = max(normal_high, others.normal_high);
                one_plane = one_plane && all(equal(more.planes[6].xyz, below.xyz));
                below.w = max(below.w, more.planes[6].w);
                shaft.low.xyz = min(shaft.low.xyz, more.low.xyz);
                shaft.high.xyz = max(shaft.high.xyz, more.high.xyz);
                above = above && more.low.w > 0.0;
                left &= ~(1u << member);
                imageStore(leaders, ivec2(part), uvec4(leading));
            }
        }
    }
    ivec2 place = ivec2(leader.x * SHAFT_TEXELS, leader.y);
    if ((members & ~left) == 1u << first) {
        for (uint texel = 0u; texel < SHAFT_TEXELS; ++texel) {
            imageStore(shafts, place + ivec2(texel, 0), fetch_shaft_texel(place + ivec2(texel, 0)));
        }
    } else {
        vec2 sphere = store_surfaces(place + ivec2(SHAFT_PLANES + 2u, 0), view.light, base, some, box_frame,
            own_low - slack, own_high + slack, slack, vec2(0.0, FAR));
        vec4 planes[SHAFT_PLANES];
        set_hull(planes, view.light, frame, origin, low - slack, high + slack, sphere, slack);
        // Of half-spaces with one normal the widest holds them all.
        bool turned = dot(box_frame[2], normal_low + normal_high) < 0.0;
        planes[6] = one_plane ? below
            : plane_below(view.light, light_reach, base, turned ? -box_frame[2] : box_frame[2],
                turned ? -own_high.z : own_low.z, slack);
        store_planes(place, planes, vec4(shaft.low.xyz, above ? 1.0 : 0.0),
            vec4(shaft.high.xyz, float(members & ~left)));
        store_normals(place, normal_low, normal_high, some);
    }
    uint slot = atomicAdd(groups.count, 1u);
    atomicMax(groups.groups_x, slot / PARTS_A_GROUP + 1u);
    imageStore(group_list, tile_entry_place(slot, tiles), uvec4(leading));
    return left;
}

void main() {
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uvec2 cells = (tiles + CELL - 1u) / CELL;
    uint index = gl_GlobalInvocationID.x;
    if (index >= cells.x * cells.y * MOST_PARTS) {
        return;
    }
    uvec2 cell = uvec2(index % cells.x, index / cells.x % cells.y);
    uint level = index / (cells.x * cells.y);
    uint members = 0u;
    for (uint member = 0u; member < CELL.x * CELL.y; ++member) {
        uvec2 part = part_of_member(cell, member, level, tiles);
        bool within = part.x < tiles.x && part.y < (level + 1u) * tiles.y;
        uint known = within ? imageLoad(estimates, estimate_place(part, ESTIMATE_LEVEL)).x : 0u;
        members |= known == LEVEL_OPEN ? 1u << member : 0u;
    }
    while (members != 0u) {
        members = add_group(cell, level, tiles, members);
    }
}
