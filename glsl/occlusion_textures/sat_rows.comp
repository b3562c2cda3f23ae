#version 460
// Sums along rows of what each group blocks (or adds to what nearer ones block), and of what it
// blocks together with all groups nearer to the light: the first half of their summed-area tables
// (Crow 1984). Whole numbers throughout, so sums of boxes are exact even where they wrap.
//
// What a group adds is what all up to it block less what all before it block, so that the second sums
// alone are enough where a word cannot hold both.

#include "occlusion_textures/groups.glsl"

layout(local_size_x = 64) in;

layout(constant_id = 0) const int WORDS = 1;
layout(constant_id = 1) const int FINER = 1;     // texels of the bits across a texel of the table
layout(constant_id = 2) const uint PACKED = 1u;  // both sums in one word
layout(constant_id = 3) const uint ADDED = 1u;   // of a group only what no nearer one blocks

layout(set = 0, binding = 0) uniform usampler2D bits;
layout(set = 0, binding = 1, std140) uniform GroupBlock {
    SliceGroups groups;
};
layout(set = 0, binding = 2, r32ui) uniform writeonly uimage2DArray tables;

const uint BATCH = 4u;

void store(ivec2 place, uint group, uint own, uint all_nearer) {
    if (PACKED != 0u) {
        imageStore(tables, ivec3(place, int(group)), uvec4(own + (all_nearer << 16)));
    } else if (ADDED != 0u) {
        imageStore(tables, ivec3(place, int(group)), uvec4(all_nearer));
    } else {
        imageStore(tables, ivec3(place, int(2u * group)), uvec4(own));
        imageStore(tables, ivec3(place, int(2u * group + 1u)), uvec4(all_nearer));
    }
}

// 1 for each mask that has a bit of what was found.
uvec4 hits(uvec4 found, uvec4 a, uvec4 b, uvec4 c, uvec4 d) {
    uvec4 both = found.x & uvec4(a.x, b.x, c.x, d.x);
    if (WORDS > 1) {
        both |= found.y & uvec4(a.y, b.y, c.y, d.y);
    }
    if (WORDS > 2) {
        both |= found.z & uvec4(a.z, b.z, c.z, d.z) | found.w & uvec4(a.w, b.w, c.w, d.w);
    }
    return uvec4(notEqual(both, uvec4(0u)));
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
    uvec4 before_first = prefix;
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
            uvec4 found = texelFetch(bits, place, 0);
            uvec4 all = hits(found, prefixes[0], prefixes[1], prefixes[2], prefixes[3]);
            nearer += all;
            if (ADDED != 0u) {
                uint before = uint((found & before_first) != uvec4(0u));
                own += all - uvec4(before, all.xyz);
            } else {
                own += hits(found, masks[0], masks[1], masks[2], masks[3]);
            }
        }
        ivec2 place = ivec2(x + 1, row + 1);
        for (uint i = 0u; i < count; ++i) {
            store(place, first + i, own[i], nearer[i]);
        }
    }
}
