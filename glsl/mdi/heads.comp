#version 460
// Where the list of each texel begins, and how long it is. Lists that there is no room for are
// empty: which ones follows from the counts alone. Their texels are left with the masks.

#include "mdi/params.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std140) uniform MdiBlock {
    MdiParams params;
};
layout(set = 0, binding = 1) uniform usampler2DArray counts;
layout(set = 0, binding = 2) uniform usampler2D sums;
layout(set = 0, binding = 3, rg32ui) uniform writeonly uimage2DArray heads;

layout(set = 0, binding = 4, r32ui) uniform uimage2D tally;

const uint NO_LIST = 0xFFFFFFFFu;

shared uint before[gl_WorkGroupSize.x]; // parts of the sum of all rows before this group's
shared uint rows[gl_WorkGroupSize.x];   // of this group

void main() {
    ivec3 size = textureSize(counts, 0);
    int row = int(gl_GlobalInvocationID.x);
    int view = int(gl_GlobalInvocationID.y);
    int lane = int(gl_LocalInvocationID.x);
    int first = view * size.y + row - lane;
    uint part = 0u;
    for (int i = lane; i < first; i += int(gl_WorkGroupSize.x)) {
        part += texelFetch(sums, ivec2(i % size.y, i / size.y), 0).x;
    }
    before[lane] = part;
    rows[lane] = row < size.y ? texelFetch(sums, ivec2(row, view), 0).x : 0u;
    barrier();
    uint begin = 0u;
    for (int i = 0; i < int(gl_WorkGroupSize.x); ++i) {
        begin += before[i] + (i < lane ? rows[i] : 0u);
    }
    uint listed = 0u;
    for (int x = 0; x < size.x && row < size.y; ++x) {
        uint count = texelFetch(counts, ivec3(x, row, view), 0).x;
        bool fits = begin + count <= params.counts.z;
        uvec2 head = fits ? uvec2(begin, count) : uvec2(NO_LIST, 0u);
        imageStore(heads, ivec3(x, row, view), uvec4(head, 0u, 0u));
        begin += count;
        listed = fits ? begin : listed;
    }
    if (row < size.y) {
        imageAtomicMax(tally, ivec2(0, 0), listed);
        imageAtomicMax(tally, ivec2(1, 0), begin);
    }
}
