#version 460
// Sums along rows of what each group blocks, and of what it blocks together with all groups nearer
// to the light: the first half of their summed-area tables (Crow 1984). Whole numbers throughout,
// so sums of boxes are exact even where they wrap.

#include "occlusion_textures/groups.glsl"

layout(local_size_x = 64) in;

layout(constant_id = 0) const int WORDS = 1;
layout(constant_id = 1) const int FINER = 1;     // texels of the bits across a texel of the table
layout(constant_id = 2) const uint PACKED = 1u;  // both sums in one word

layout(set = 0, binding = 0) uniform usampler2DArray bits;
layout(set = 0, binding = 1, std140) uniform GroupBlock {
    SliceGroups groups;
};
layout(set = 0, binding = 2, r32ui) uniform writeonly uimage2DArray tables;

const uint BATCH = 4u;

void store(ivec2 place, uint group, uint own, uint all_nearer) {
    if (PACKED != 0u) {
        imageStore(tables, ivec3(place, int(group)), uvec4(own + (all_nearer << 16)));
    } else {
        imageStore(tables, ivec3(place, int(2u * group)), uvec4(own));
        imageStore(tables, ivec3(place, int(2u * group + 1u)), uvec4(all_nearer));
    }
}

void main() {
    int side = imageSize(tables).x - 1;
    int row = int(gl_GlobalInvocationID.x);
    uint first = gl_GlobalInvocationID.y * BATCH;
    if (row >= side || first >= groups.count.x) {
        return;
    }
    uvec4 masks[BATCH];
    uvec4 prefixes[BATCH];
    uvec4 prefix = uvec4(0u);
    for (uint group = 0u; group < first; ++group) {
        prefix |= groups.masks[group];
    }
    uint count = min(BATCH, groups.count.x - first);
    for (uint i = 0u; i < BATCH; ++i) {
        masks[i] = i < count ? groups.masks[first + i] : uvec4(0u);
        prefix |= masks[i];
        prefixes[i] = prefix;
    }
    uvec4 own = uvec4(0u);
    uvec4 nearer = uvec4(0u);
    for (uint i = 0u; i < count; ++i) {
        store(ivec2(0, row + 1), first + i, 0u, 0u);
    }
    for (int x = 0; x < side; ++x) {
        for (int sub = 0; sub < FINER * FINER; ++sub) {
            ivec2 place = FINER * ivec2(x, row) + ivec2(sub % FINER, sub / FINER);
            uvec4 hit_own = uvec4(0u);
            uvec4 hit_nearer = uvec4(0u);
            for (int word = 0; word < WORDS; ++word) {
                uint found = texelFetch(bits, ivec3(place, word), 0).x;
                hit_own |= found & uvec4(masks[0][word], masks[1][word], masks[2][word], masks[3][word]);
                hit_nearer |= found
                    & uvec4(prefixes[0][word], prefixes[1][word], prefixes[2][word], prefixes[3][word]);
            }
            own += uvec4(notEqual(hit_own, uvec4(0u)));
            nearer += uvec4(notEqual(hit_nearer, uvec4(0u)));
        }
        ivec2 place = ivec2(x + 1, row + 1);
        for (uint i = 0u; i < count; ++i) {
            store(place, first + i, own[i], nearer[i]);
        }
    }
}
