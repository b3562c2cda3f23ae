#version 460
// Whether the lists ask for more chunks than the pool has: what then has to be done, else nothing.

#include "common/tiles.glsl"
#include "dbuffer/overflow.glsl"
#include "dbuffer/params.glsl"

layout(local_size_x = 1) in;

layout(set = 0, binding = 0, std140) uniform Block {
    DbufferParams params;
};
layout(set = 0, binding = 1, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 2, std430) readonly buffer Pool {
    uint chunks_used;
};
layout(set = 0, binding = 3, std430) writeonly buffer OverflowArguments {
    Overflow overflow;
};
layout(set = 0, binding = 4, std430) writeonly buffer FittingArguments {
    Fitting fitting;
};

void main() {
    bool over = chunks_used > params.counts.w;
    uint groups = (arguments.count + DEMAND_LANES - 1u) / DEMAND_LANES;
    overflow.demand = uvec4(over ? groups : 0u, 1u, 1u, 0u);
    overflow.fit = uvec4(over ? 1u : 0u, 1u, 1u, 0u);
    fitting.tiles = TileArguments(0u, 1u, 1u, 0u);
    fitting.lists = uvec4(0u, 1u, 1u, 0u);
}
