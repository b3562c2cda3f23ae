#version 460
// Counts the texels of each row that bands cover, and those that bands of several edges cover.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform sampler2D collisions;
layout(set = 0, binding = 1, std140) uniform Arguments {
    uvec4 arguments[2]; // of the list of silhouettes
};
// Texels of a row: covered, by more than one, silhouettes.
layout(set = 0, binding = 2, r32ui) uniform writeonly uimage2D counts;

layout(push_constant) uniform Push {
    uint side;  // of the map in texels
    uint layer;
} push;

void main() {
    uint row = gl_GlobalInvocationID.x;
    if (row >= push.side) {
        return;
    }
    uint covered = 0u;
    uint crowded = 0u;
    for (uint x = 0u; x < push.side; ++x) {
        float bands = texelFetch(collisions, ivec2(x, row), 0).x;
        covered += bands > 0.5 ? 1u : 0u;
        crowded += bands > 1.5 ? 1u : 0u;
    }
    ivec2 at = ivec2(0, int(push.layer * push.side + row));
    imageStore(counts, at, uvec4(covered));
    imageStore(counts, at + ivec2(1, 0), uvec4(crowded));
    imageStore(counts, at + ivec2(2, 0), uvec4(arguments[1].x));
}
