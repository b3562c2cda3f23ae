#version 460
// Finds the fine slices that hold anything, and joins neighbours until there are as many groups as
// were asked for: none is spent on empty space, and none spans more than it must. What is done for each
// group is dispatched for those that there are.

#include "occlusion_textures/groups.glsl"

layout(local_size_x = 1) in;

layout(constant_id = 0) const uint THIN_FIX = 0u; // a group's texture also fills the next one
layout(constant_id = 1) const uint MIDDLE = 0u;   // textures lie in the middle of groups, not below

layout(set = 0, binding = 0) uniform usampler2D top;
layout(set = 0, binding = 1, std140) uniform PlaneBlock {
    vec4 planes[MAX_FINE_SLICES / 4u + 1u]; // depths of the planes between fine slices
};
layout(set = 0, binding = 2, std140) writeonly buffer GroupBlock {
    SliceGroups groups;
};
layout(set = 0, binding = 3, r32ui) uniform writeonly uimage2D report; // 5x1: `Slices::counts`

layout(set = 0, binding = 4, std430) writeonly buffer SumBlock {
    uint dispatches[9]; // workgroups of cells.comp, sat_rows.comp, sat_columns.comp
};

layout(push_constant) uniform Push {
    uint fine;
    uint most;
    float behind;
    float perspective;
    uint cells_x; // `Sums`
    uint cells_y;
    uint rows;
    uint columns;
    uint groups_a_batch;
    uint groups_a_layer;
    uint sets;
} push;

void write_dispatch(uint first, uint x, uint y, uint z) {
    dispatches[first] = x;
    dispatches[first + 1u] = y;
    dispatches[first + 2u] = z;
}

bool filled(uvec4 bits, uint slice) {
    return (bits[slice >> 5] >> (slice & 31u) & 1u) != 0u;
}

float plane(uint index) {
    return planes[index >> 2][index & 3u];
}

void main() {
    uvec4 bits = texelFetch(top, ivec2(0), 0);
    uvec4 counts = uvec4(bitCount(bits));
    uint occupied = counts.x + counts.y + counts.z + counts.w;
    // The smallest span that needs no more groups than there may be.
    uint span = 0u;
    uint needed = push.most + 1u;
    while (needed > push.most) {
        span += 1u;
        needed = 0u;
        uint end = 0u;
        for (uint slice = 0u; slice < push.fine; ++slice) {
            if (filled(bits, slice) && slice >= end) {
                needed += 1u;
                end = slice + span;
            }
        }
    }
    uint count = 0u;
    uint slice = 0u;
    uvec4 before = uvec4(0u);
    while (slice < push.fine) {
        if (!filled(bits, slice)) {
            slice += 1u;
            continue;
        }
        uvec4 mask = uvec4(0u);
        uint last = slice;
        for (uint i = slice; i < min(slice + span, push.fine); ++i) {
            if (filled(bits, i)) {
                mask[i >> 5] |= 1u << (i & 31u);
                last = i;
            }
        }
        float upper = plane(slice);
        float lower = plane(last + 1u);
        float lies = MIDDLE != 0u ? 0.5 * (upper + lower) : lower;
        float inverse = push.perspective > 0.0 ? 1.0 / (lies + push.behind) : 1.0;
        groups.planes[count] = vec4(lies, lower, lower - plane(last), inverse);
        groups.masks[count] = THIN_FIX != 0u ? mask | before : mask;
        groups.spans[count] = uvec4(slice, last, 0u, 0u);
        before = mask;
        count += 1u;
        slice = slice + span;
    }
    groups.count = uvec4(count, occupied, span, 0u);
    imageStore(report, ivec2(0, 0), uvec4(count));
    imageStore(report, ivec2(1, 0), uvec4(occupied));
    imageStore(report, ivec2(2, 0), uvec4(push.fine - occupied));
    imageStore(report, ivec2(3, 0), uvec4(span));
    // Of other filters than tables nothing is written.
    uint layers = push.sets > 0u ? (count + push.groups_a_layer - 1u) / push.groups_a_layer : 0u;
    uint batches = push.sets > 0u ? (count + push.groups_a_batch - 1u) / push.groups_a_batch : 0u;
    write_dispatch(0u, push.cells_x, push.cells_y, batches);
    write_dispatch(3u, push.rows, layers, push.sets);
    write_dispatch(6u, push.columns, layers, push.sets);
    imageStore(report, ivec2(4, 0), uvec4(layers * push.sets));
}
