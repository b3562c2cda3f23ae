#version 460
// How many texels of the bits in each square of them each group blocks, or all groups up to it
// (NEARER): bytes, 16 groups a texel. All bits are looked at once here, and the tables' sums then go
// over a fraction of the texels.

#include "occlusion_textures/groups.glsl"
#include "occlusion_textures/tables.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(constant_id = 0) const int WORDS = 1;
layout(constant_id = 1) const int FINER = 1;        // texels of the bits across a texel here
layout(constant_id = 2) const uint NEARER = 1u;     // count what any group up to it blocks

layout(set = 0, binding = 0) uniform usampler2D bits;
layout(set = 0, binding = 1, std140) uniform GroupBlock {
    SliceGroups groups;
};
layout(set = 0, binding = 2, rgba32ui) uniform writeonly uimage2DArray cells;

const uint BATCH = 32u; // groups that an invocation counts
const uint FOURS = BATCH / 4u;

// The nearest fine slice with anything; far beyond all of them if there is none.
uint nearest_slice(uvec4 found) {
    uint nearest = found.x != 0u ? uint(findLSB(found.x)) : 0xffffu;
    if (WORDS > 1) {
        nearest = min(nearest, found.y != 0u ? uint(findLSB(found.y)) + 32u : 0xffffu);
    }
    if (WORDS > 2) {
        nearest = min(nearest, found.z != 0u ? uint(findLSB(found.z)) + 64u : 0xffffu);
        nearest = min(nearest, found.w != 0u ? uint(findLSB(found.w)) + 96u : 0xffffu);
    }
    return nearest;
}

// 1 for each of the four groups that has a bit of what was found.
uvec4 hits(uvec4 found, uint group) {
    uvec4 both = found.x
        & uvec4(groups.masks[group].x, groups.masks[group + 1u].x, groups.masks[group + 2u].x,
            groups.masks[group + 3u].x);
    if (WORDS > 1) {
        both |= found.y
            & uvec4(groups.masks[group].y, groups.masks[group + 1u].y, groups.masks[group + 2u].y,
                groups.masks[group + 3u].y);
    }
    if (WORDS > 2) {
        both |= found.z
            & uvec4(groups.masks[group].z, groups.masks[group + 1u].z, groups.masks[group + 2u].z,
                groups.masks[group + 3u].z);
        both |= found.w
            & uvec4(groups.masks[group].w, groups.masks[group + 1u].w, groups.masks[group + 2u].w,
                groups.masks[group + 3u].w);
    }
    return uvec4(notEqual(both, uvec4(0u)));
}

void main() {
    ivec2 place = ivec2(gl_GlobalInvocationID.xy);
    uint first = gl_GlobalInvocationID.z * BATCH;
    uint count = groups.count.x;
    if (any(greaterThanEqual(place, imageSize(cells).xy)) || first >= count) {
        return;
    }
    uvec4 ends[FOURS]; // one beyond the last fine slice of each group
    uvec4 counts[FOURS];
    for (uint i = 0u; i < FOURS; ++i) {
        uint group = first + 4u * i;
        uvec4 last = uvec4(groups.spans[group].y, groups.spans[group + 1u].y,
            groups.spans[group + 2u].y, groups.spans[group + 3u].y);
        bvec4 there = lessThan(group + uvec4(0u, 1u, 2u, 3u), uvec4(count));
        ends[i] = mix(uvec4(0u), last + 1u, there);
        counts[i] = uvec4(0u);
    }
    for (int sub = 0; sub < FINER * FINER; ++sub) {
        ivec2 at = FINER * place + ivec2(sub % FINER, sub / FINER);
        uvec4 found = texelFetch(bits, at, 0);
        uint nearest = nearest_slice(found);
        for (uint i = 0u; i < FOURS; ++i) {
            counts[i] += NEARER != 0u ? uvec4(lessThan(uvec4(nearest), ends[i]))
                                      : hits(found, first + 4u * i);
        }
    }
    for (uint half_batch = 0u; half_batch < 2u; ++half_batch) {
        uvec4 packed_counts = uvec4(0u);
        for (uint i = 0u; i < 4u; ++i) {
            uvec4 four = counts[4u * half_batch + i];
            packed_counts[i] = four.x | four.y << 8 | four.z << 16 | four.w << 24;
        }
        uint layer = first / GROUPS_A_CELL + half_batch;
        imageStore(cells, ivec3(place, int(layer)), packed_counts);
    }
}
