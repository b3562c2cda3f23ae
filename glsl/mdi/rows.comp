#version 460
// Sums of the counts of each row.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform usampler2DArray counts;
layout(set = 0, binding = 1, r32ui) uniform writeonly uimage2D sums; // x: row, y: view

void main() {
    ivec3 size = textureSize(counts, 0);
    int row = int(gl_GlobalInvocationID.x);
    int view = int(gl_GlobalInvocationID.y);
    if (row >= size.y) {
        return;
    }
    uint sum = 0u;
    for (int x = 0; x < size.x; ++x) {
        sum += texelFetch(counts, ivec3(x, row, view), 0).x;
    }
    imageStore(sums, ivec2(row, view), uvec4(sum));
}
