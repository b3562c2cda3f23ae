#version 460
// Whether lists of candidates ask for more chunks than the pool has. Chunks go to whoever comes first, so that tiles
// without a list would be others each time: then all lists are made again, each with the same room.

#include "common/tiles.glsl"
#include "shaft_masks/params.glsl"

layout(local_size_x = 1) in;

layout(set = 0, binding = 0, std140) uniform ShaftBlock {
    ShaftParams params;
};
layout(set = 0, binding = 1, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 2, std430) buffer Pool {
    uint chunks_used;
};
// Arguments of a dispatch, of none where the pool has room for all.
layout(set = 0, binding = 3, std430) writeonly buffer AgainArguments {
    uvec4 again;
};

void main() {
    bool over = chunks_used > params.counts.w;
    again = uvec4(over ? (arguments.count + PARTS_A_GROUP - 1u) / PARTS_A_GROUP : 0u, 1u, 1u, 0u);
    chunks_used = over ? 0u : chunks_used;
}
