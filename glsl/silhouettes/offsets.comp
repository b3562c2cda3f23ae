#version 460
// Place of each run's first silhouette in the list: a prefix sum over the runs by one workgroup, and
// with the sum the arguments of the draw.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly buffer Masks {
    uint masks[];
};
layout(set = 0, binding = 1, std430) writeonly buffer Offsets {
    uint offsets[];
};
// VkDrawIndirectCommand, then the number of silhouettes, then VkDispatchIndirectCommand.
layout(set = 0, binding = 2, std430) writeonly buffer Arguments {
    uint arguments[8];
};

layout(push_constant) uniform Push {
    uint runs;
    uint vertices; // of each silhouette
} push;

shared uint sums[64];

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint share = (push.runs + 63u) / 64u;
    uint first = min(lane * share, push.runs);
    uint end = min(first + share, push.runs);
    uint sum = 0u;
    for (uint run = first; run < end; ++run) {
        sum += uint(bitCount(masks[run]));
    }
    sums[lane] = sum;
    barrier();
    uint at = 0u;
    for (uint before = 0u; before < lane; ++before) {
        at += sums[before];
    }
    for (uint run = first; run < end; ++run) {
        offsets[run] = at;
        at += uint(bitCount(masks[run]));
    }
    if (lane == 63u) {
        // One instance of many vertices: some drivers pay for each instance.
        arguments[0] = at * push.vertices;
        arguments[1] = 1u;
        arguments[2] = 0u;
        arguments[3] = 0u;
        arguments[4] = at;
        // 64 a workgroup, in rows of SILHOUETTES_ROW (silhouettes/edges.glsl).
        const uint GROUPS = 32768u;
        uint groups = (at + 63u) / 64u;
        arguments[5] = min(groups, GROUPS);
        arguments[6] = (groups + GROUPS - 1u) / GROUPS;
        arguments[7] = 1u;
    }
}
