#version 460
#extension GL_EXT_control_flow_attributes : require
// How far a pixel's visibility can be off: the part of the light's cells that are undecided.
//
// Each sample stands for a cell of the light, and all cells are as large. A cell that the border of no
// blocker crosses is seen or hidden as a whole, as its sample is; of any other one nothing is known but
// that its part is between none and all. So the visibility is off by the number of cells that are
// crossed, over that of all cells, at most.
//
// Borders are those that the masks are made of: edges where a mesh ends or folds as the tile sees it,
// sides of the triangles drawn one by one, and the surface's own plane. Cells are bounded from outside:
// those of round lights by the widest and the narrowest chord of their row.

#include "common/camera.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "shaft_masks/params.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 2, r32f) uniform readonly image2D view_depth;
layout(set = 0, binding = 3, r32ui) uniform readonly uimage2D ids;
layout(set = 0, binding = 4, rgba32f) uniform readonly image2D triangles;
layout(set = 0, binding = 5, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 6) uniform usampler2D list;
layout(set = 0, binding = 7, rgba32f) uniform readonly image2D shafts;
layout(set = 0, binding = 8, r32ui) uniform readonly uimage2D edge_pool;
layout(set = 0, binding = 9, r32ui) uniform readonly uimage2D triangle_pool;
layout(set = 0, binding = 10, rgba32ui) uniform readonly uimage2D lists;
layout(set = 0, binding = 11, r32f) uniform writeonly image2D error_bound;
layout(set = 0, binding = 12, r32ui) uniform uimage2D estimates;

#define SUN_TANGENT_SQUARE (view.light.axis_x.w * view.light.axis_x.w)

#include "shaft_masks/estimates.glsl"
#include "shaft_masks/lists.glsl"
#include "shaft_masks/masks.glsl"

vec4 fetch_triangle_texel(uint texel) {
    return imageLoad(triangles, triangle_texel_place(texel));
}

vec4 fetch_shaft_texel(ivec2 place) {
    return imageLoad(shafts, place);
}

// Nothing is fetched from these here.
vec4 fetch_node_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_material_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_uv_texel(ivec2 place) {
    return vec4(0.0);
}

vec4 fetch_footprint(ivec2 place) {
    return vec4(0.0);
}

// Room for rounding, in columns.
const float COLUMN_SLACK = 1.0e-3;
const float FAR_OUT = 1.0e30;

// Strips of the rows of the block at work, and its first column.
vec4 strips[ROWS];
float first_column;

// Column of a place where the light is so wide, -1 to 1.
float column_at(float place, float half_width) {
    float half_columns = 0.5 * float(params.pattern.x * COLUMNS);
    float part = place / max(half_width, 1.0e-30);
    if (LIGHT_SHAPE == LIGHT_SUN) {
        // Equal parts of the row are equal solid angles.
        float y_square = max(1.0 - half_width * half_width, 0.0);
        part *= sqrt((1.0 + SUN_TANGENT_SQUARE) / (1.0 + SUN_TANGENT_SQUARE * (place * place + y_square)));
    }
    return half_columns * part + half_columns - first_column;
}

// The least and the most column of any place from low to high in a row's strip.
vec2 columns_of(uint r, float low, float high) {
    if (LIGHT_SHAPE == LIGHT_LINE) {
        return clamp(light_rows[r].y * vec2(low, high) + light_rows[r].z, -1.0, float(COLUMNS) + 1.0)
            + vec2(-COLUMN_SLACK, COLUMN_SLACK);
    }
    float narrow = strips[r].z;
    float wide = strips[r].w;
    float middle = 0.5 * float(params.pattern.x * COLUMNS) / light_rows[r].y;
    if (LIGHT_SHAPE == LIGHT_SUN) {
        // That of the samples: y = columns / 2 sqrt(w + tangent^2 middle^2) / middle.
        float square = middle * middle;
        middle = sqrt(square * light_rows[r].w / max(1.0 - square * SUN_TANGENT_SQUARE, 1.0e-30));
        middle = clamp(middle, narrow, wide);
    }
    narrow = min(narrow, middle);
    wide = max(wide, middle);
    float least = column_at(low, low < 0.0 ? narrow : wide);
    float most = column_at(high, high < 0.0 ? wide : narrow);
    // Samples of a sun lie on straight rows, its cells between circles around the poles of its second axis.
    float slack = COLUMN_SLACK
        + (LIGHT_SHAPE == LIGHT_SUN ? 0.5 * float(params.pattern.x * COLUMNS) * SUN_TANGENT_SQUARE : 0.0);
    return clamp(vec2(least - slack, most + slack), -1.0, float(COLUMNS) + 1.0);
}

// The cells of a row from the first to the last column, as its 8 bits.
uint cells_between(vec2 columns) {
    int first = clamp(int(floor(columns.x)), 0, 8);
    int last = clamp(int(floor(columns.y)) + 1, 0, 8);
    return columns.y < columns.x || last <= first ? 0u : (0xffu << first) & ~(0xffu << last) & 0xffu;
}

// The cells that a projected edge crosses.
uvec2 cells_of_edge(vec2 a, vec2 b) {
    Side side = side_between(a, b);
    float left = min(a.x, b.x);
    float right = max(a.x, b.x);
    uvec2 cells = uvec2(0u);
    for (uint r = 0u; r < ROWS; ++r) {
        float low = max(side.low.y, strips[r].x);
        float high = min(side.high, strips[r].y);
        bool level = !(side.high > side.low.y);
        float at_low = level ? left : clamp((low - side.low.y) * side.slope + side.low.x, left, right);
        float at_high = level ? right : clamp((high - side.low.y) * side.slope + side.low.x, left, right);
        vec2 columns = columns_of(r, min(at_low, at_high), max(at_low, at_high));
        uint row = low <= high ? cells_between(columns) : 0u;
        cells[r / 4u] |= row << (8u * (r % 4u));
    }
    return cells;
}

// The cells that a line crosses, and those that it leaves whole on its inner side.
void cells_of_line(vec3 line, out uvec2 crossed, out uvec2 within) {
    crossed = uvec2(0u);
    within = uvec2(0u);
    float size = abs(line.x) + abs(line.y) + abs(line.z);
    for (uint r = 0u; r < ROWS; ++r) {
        vec2 heights = line.y * strips[r].xy + line.z;
        // Where it goes along the row all of the row is crossed, or none.
        bool along = abs(line.x) <= 1.0e-7 * size;
        vec2 places = clamp(-heights / (along ? 1.0 : line.x), -FAR_OUT, FAR_OUT);
        vec2 columns = columns_of(r, min(places.x, places.y), max(places.x, places.y));
        uint row = cells_between(columns);
        // Those right of the crossed ones, or left.
        int after = clamp(int(floor(columns.y)) + 1, 0, 8);
        int before = clamp(int(floor(columns.x)), 0, 8);
        uint inner = line.x > 0.0 ? 0xffu << after : ~(0xffu << before);
        if (along) {
            float slack = 2.0e-7 * size;
            row = min(heights.x, heights.y) > slack || max(heights.x, heights.y) < -slack ? 0u : 0xffu;
            inner = min(heights.x, heights.y) > slack ? 0xffu : 0u;
        }
        crossed[r / 4u] |= row << (8u * (r % 4u));
        within[r / 4u] |= (inner & ~row & 0xffu) << (8u * (r % 4u));
    }
}

// The cells that the border of a triangle crosses, wherever it is.
uvec2 cells_of_blocker(MaskReceiver receiver, LightFrom light, Blocker blocker) {
    vec3 a = blocker.a - receiver.position;
    vec3 b = blocker.b - receiver.position;
    vec3 c = blocker.c - receiver.position;
    float height = dot(blocker.plane.xyz, a);
    float turn = height > 0.0 ? 1.0 : -1.0;
    vec3 lines[4];
    lines[0] = line_of_plane(light, turn * exact_cross(a, b));
    lines[1] = line_of_plane(light, turn * exact_cross(b, c));
    lines[2] = line_of_plane(light, turn * exact_cross(c, a));
    lines[3] = line_of_plane(light, turn * blocker.plane.xyz);
    lines[3].z -= LIGHT_SHAPE == LIGHT_SUN ? 0.0 : abs(height);
    uvec2 crossed = uvec2(0u);
    uvec2 touched = uvec2(0xffffffffu);
    for (uint i = 0u; i < 4u; ++i) {
        uvec2 on;
        uvec2 inner;
        cells_of_line(lines[i], on, inner);
        crossed |= on;
        touched &= on | inner;
    }
    // Holes may be anywhere.
    bool masked = material_is_masked(blocker.plane.w);
    return receiver.id == blocker.triangle + 1u ? uvec2(0u) : masked ? touched : crossed & touched;
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uvec2 part = part_of_entry(texelFetch(list, tile_entry_place(index, tiles), 0).x, tiles);
    ivec2 at = list_place(part);
    uvec4 stored = imageLoad(lists, at);
    Entries entries = entries_of(imageLoad(lists, at + ivec2(1, 0)), imageLoad(lists, at + ivec2(2, 0)));
    uvec2 pixel = tile_of_part(part, tiles) * TILE_SIZE + gl_LocalInvocationID.xy;
    uvec2 within = min(pixel, params.counts.xy - 1u);
    float depth = imageLoad(view_depth, ivec2(within)).x;
    // Tiles that were worked on again have a bound of their own.
    bool is_last = imageLoad(estimates, estimate_place(part, ESTIMATE_LEVEL)).x == params.pattern.w;
    if (!is_last || depth <= 0.0 || !is_in_part(fetch_part_depths(part), depth)) {
        return;
    }
    vec3 ray = pixel_ray(view.camera, within);
    uint id = imageLoad(ids, ivec2(within)).x;
    vec3 p = view.camera.eye.xyz + depth * ray;
    MaskReceiver receiver = MaskReceiver(p + way_into_triangle(p, id), id, true);
    LightFrom light = light_from(view.light, receiver.position);
    Axes axes = axes_from(receiver.position, false);
    Projection projection = projection_from(axes, receiver.position);
    vec3 normal = fetch_geometric_normal(max(id, 1u) - 1u);
    vec3 above = line_of_plane(light, normal);
    // Nothing is known of a tile whose list is not whole, nor of suns so wide that rows have no widest chord.
    bool known = stored.z >= params.counts.z && (LIGHT_SHAPE != LIGHT_SUN || SUN_TANGENT_SQUARE < 1.0);
    uint blocks = known ? params.pattern.y : 0u;
    int undecided = 0;
    for (uint block = 0u; block < blocks; ++block) {
        fetch_light_rows(block);
        first_column = float(block % params.pattern.x * COLUMNS);
        for (uint r = 0u; r < ROWS; ++r) {
            strips[r] = params.strips[block / params.pattern.x * ROWS + r];
        }
        uvec2 cells;
        uvec2 inner;
        cells_of_line(above, cells, inner);
        for (uint i = 0u; i < entries.edges; ++i) {
            uint code = imageLoad(edge_pool, triangle_texel_place(entries.first_edge + i)).x;
            uint triangle = (code & ~(EDGE_DOUBLE | EDGE_TURNED)) >> EDGE_CORNER_BITS;
            uint corner = code & ((1u << EDGE_CORNER_BITS) - 1u);
            vec3 a = fetch_triangle_texel(4u * triangle + corner).xyz;
            vec3 b = fetch_triangle_texel(4u * triangle + (corner == 2u ? 0u : corner + 1u)).xyz;
            cells |= cells_of_edge(project(projection, along_axes(axes, a)), project(projection, along_axes(axes, b)));
        }
        for (uint i = 0u; i < entries.whole; ++i) {
            uint triangle = imageLoad(triangle_pool, triangle_texel_place(entries.first + i)).x;
            vec2 a = project(projection, along_axes(axes, fetch_triangle_texel(4u * triangle).xyz));
            vec2 b = project(projection, along_axes(axes, fetch_triangle_texel(4u * triangle + 1u).xyz));
            vec2 c = project(projection, along_axes(axes, fetch_triangle_texel(4u * triangle + 2u).xyz));
            cells |= cells_of_edge(a, b) | cells_of_edge(b, c) | cells_of_edge(c, a);
        }
        for (uint i = 0u; i < entries.others; ++i) {
            uint place = entries.first + entries.room - 1u - i;
            Blocker blocker = fetch_blocker(imageLoad(triangle_pool, triangle_texel_place(place)).x);
            cells |= cells_of_blocker(receiver, light, blocker);
        }
        undecided += bitCount(cells.x) + bitCount(cells.y);
    }
    // A light of no size has no cells: its one point is seen or not.
    float cell_count = float(params.pattern.y * ROWS * COLUMNS);
    float bound = !known ? 1.0 : LIGHT_SHAPE == LIGHT_POINT ? 0.0 : float(undecided) / cell_count;
    imageStore(error_bound, ivec2(pixel), vec4(bound));
    if (all(lessThan(pixel, params.counts.xy))) {
        imageAtomicMax(estimates, estimate_place(part, ESTIMATE_BOUND), floatBitsToUint(bound));
    }
}
