#version 460
// Sums down the columns: the second half of summed-area tables.


layout(local_size_x = 64) in;

layout(constant_id = 0) const uint LAYERS = 1u; // of a set of tables

layout(set = 0, binding = 0, rgba32ui) uniform uimage2DArray tables;

void main() {
    int side = imageSize(tables).x;
    int column = int(gl_GlobalInvocationID.x);
    uint table = gl_GlobalInvocationID.z * LAYERS + gl_GlobalInvocationID.y;
    if (column >= side) {
        return;
    }
    uvec4 sum = uvec4(0u);
    imageStore(tables, ivec3(column, 0, int(table)), sum);
    for (int y = 1; y < side; ++y) {
        ivec3 place = ivec3(column, y, int(table));
        sum += imageLoad(tables, place);
        imageStore(tables, place, sum);
    }
}
