#version 460
// What the published step 3 writes, found by a scan: two occluding edges for every texel, the nearest one
// that hides light from it and the one whose corresponding pixel is least. One workgroup does one row; its
// invocations share the least of their own parts of it.

#include "oess/row.glsl"

layout(local_size_x = 256) in;

layout(set = 0, binding = 0) uniform sampler2D map_depth;
layout(set = 0, binding = 1) uniform usampler2D edges;
layout(set = 0, binding = 2, r32ui) uniform writeonly uimage2D outreach;
layout(set = 0, binding = 3, r32ui) uniform uimage2D steps;

// 1: each texel looks at all of its row, to check the scan by.
layout(constant_id = 0) const uint BRUTE = 0u;

const uint PARTS = 256u;
const uint LEVELS = 8u;
const uint MOST_TEXELS = 16u; // of one part: rows of 4096
const float NONE = 1.0e30;
// An edge counts for a texel whose own place differs by what the receiver's may from the texel's. There
// its part of the light is nearly all, so that slack cannot show.
const float SLACK = 2.0;

// least[level][part]: the least c of the edges in 2^level parts from this one on.
shared float least[LEVELS + 1u][PARTS];
shared uint suffix_place[PARTS]; // of the least one in this part and all after it
shared float suffix_c[PARTS];

float fetch_row_depth(ivec2 texel) {
    return texelFetch(map_depth, texel, 0).x;
}

float edge_c(int u, int row, int size) {
    bool edge = u < size && texelFetch(edges, ivec2(row_column(min(u, size - 1), size), row), 0).x != 0u;
    return edge ? corresponding(u, row, size) : NONE;
}

void store(int u, int row, int size, uint nearest, uint lowest) {
    imageStore(outreach, ivec2(row_column(u, size), row), uvec4(nearest | lowest << 16u));
}

// Every texel against every edge.
void search_all(int size, int row) {
    for (int u = int(gl_LocalInvocationID.x); u < size; u += int(PARTS)) {
        float c = corresponding(u, row, size);
        uint nearest = 0u;
        uint lowest = 0u;
        float lowest_c = NONE;
        for (int v = u + 1; v < size; ++v) {
            float other = edge_c(v, row, size);
            nearest = nearest == 0u && other <= c + SLACK ? uint(size - v) : nearest;
            lowest = other < lowest_c ? uint(size - v) : lowest;
            lowest_c = min(lowest_c, other);
        }
        store(u, row, size, nearest, lowest_c <= c + SLACK ? lowest : 0u);
    }
}

void main() {
    int size = textureSize(map_depth, 0).x;
    int row = int(gl_WorkGroupID.x);
    uint part = gl_LocalInvocationID.x;
    if (BRUTE != 0u) {
        search_all(size, row);
        return;
    }
    int per_part = (size + int(PARTS) - 1) / int(PARTS);
    int first = int(part) * per_part;
    float own[MOST_TEXELS];
    float own_c = NONE;
    uint own_place = 0u;
    for (int k = per_part - 1; k >= 0; --k) {
        own[k] = edge_c(first + k, row, size);
        // Of equal ones the nearest.
        own_place = own[k] < NONE && own[k] <= own_c ? uint(size - first - k) : own_place;
        own_c = min(own_c, own[k]);
    }
    least[0][part] = own_c;
    suffix_c[part] = own_c;
    suffix_place[part] = own_place;
    barrier();
    for (uint level = 0u; level < LEVELS; ++level) {
        uint beyond = part + (1u << level);
        float other = beyond < PARTS ? least[level][beyond] : NONE;
        least[level + 1u][part] = min(least[level][part], other);
        float other_c = beyond < PARTS ? suffix_c[beyond] : NONE;
        uint other_place = beyond < PARTS ? suffix_place[beyond] : 0u;
        barrier();
        if (other_c < suffix_c[part]) {
            suffix_c[part] = other_c;
            suffix_place[part] = other_place;
        }
        barrier();
    }
    float lowest_c = part + 1u < PARTS ? suffix_c[part + 1u] : NONE;
    uint lowest = part + 1u < PARTS ? suffix_place[part + 1u] : 0u;
    uint count = 0u;
    for (int k = per_part - 1; k >= 0; --k) {
        int u = first + k;
        if (u < size) {
            float limit = corresponding(u, row, size) + SLACK;
            uint nearest = 0u;
            for (int j = k + 1; j < per_part && nearest == 0u; ++j) {
                nearest = own[j] <= limit ? uint(size - first - j) : 0u;
                count += 1u;
            }
            if (nearest == 0u && lowest_c <= limit) {
                // The first part that holds one, by halves.
                uint at = part + 1u;
                for (uint level = LEVELS; level > 0u; --level) {
                    uint next = at + (1u << (level - 1u));
                    at = at < PARTS && least[level - 1u][at] > limit ? next : at;
                    count += 1u;
                }
                for (int j = 0; j < per_part && nearest == 0u && at < PARTS; ++j) {
                    int v = int(at) * per_part + j;
                    nearest = edge_c(v, row, size) <= limit ? uint(size - v) : 0u;
                    count += 1u;
                }
            }
            store(u, row, size, nearest, lowest_c <= limit ? lowest : 0u);
            count += 1u;
        }
        lowest = own[k] < NONE && own[k] <= lowest_c ? uint(size - u) : lowest;
        lowest_c = min(lowest_c, own[k]);
    }
    imageAtomicAdd(steps, ivec2(row, 0), count);
}
