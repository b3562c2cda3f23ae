#version 460
// Chooses the tiles whose masks are made anew with four times the samples, the worst first: one workgroup.
//
// Every lane has a run of tiles and sorts it into classes, half an octave of squared error each; the choice
// is a prefix of all classes, worst first, within a class in the order of tiles. All sums are made in a fixed
// order, so that the same picture is made again.

#include "common/tiles.glsl"
#include "shaft_masks/estimates.glsl"
#include "shaft_masks/lists.glsl"
#include "shaft_masks/params.glsl"

const uint LANES = 32u;
const uint CLASSES = 32u;

layout(local_size_x = 32) in;

layout(set = 0, binding = 0, std140) uniform ShaftBlock {
    ShaftParams params; // of the new masks
};
layout(set = 0, binding = 1, r32ui) uniform uimage2D estimates;
layout(set = 0, binding = 2, rgba32ui) uniform uimage2D lists;
layout(set = 0, binding = 3, std430) buffer TileListArguments {
    TileArguments selected;
    TileArguments blocks_of_selected;
};
layout(set = 0, binding = 4, r32ui) uniform writeonly uimage2D selected_list;
layout(set = 0, binding = 5, std430) buffer TaskArguments {
    TileArguments further;
};
layout(set = 0, binding = 6, rgba32ui) uniform writeonly uimage2D tasks;
layout(set = 0, binding = 7, std430) buffer PartialArguments {
    TileArguments partial;
};
layout(set = 0, binding = 8, r32ui) uniform writeonly uimage2D partial_list;
// Over all rounds of a picture.
layout(set = 0, binding = 9, std430) buffer Spent {
    uint work;
    uint unused;
    uint begin_low; // ticks of the clock
    uint begin_high;
    uint now_low;
    uint now_high;
} spent;

layout(push_constant) uniform Push {
    // Squared error to be reached: 0 works on all tiles. Below 0 where a bound on each pixel is asked for.
    float target_square;
    float bound;
    float scale;         // squared error of a pixel for one change among 64 samples
    uint work;           // most that all rounds may do
    uint capacity;       // most tiles
    uint rounds;         // this one and those after it, among which its tiles are shared out
    float tick_ms;
    float most_ms;
    uint parts_down;
} push;

// By class and lane.
shared float squares[CLASSES][LANES];
shared uint counts[CLASSES][LANES];
shared uint works[CLASSES][LANES];
shared float other_squares[LANES];
shared uint pixels[LANES];
shared float class_squares[CLASSES];
shared uint class_counts[CLASSES];
shared uint last_class; // CLASSES where there is none
shared uint most_tiles;

uint add_sat(uint a, uint b) {
    return a + min(b, 0xffffffffu - a);
}

struct Tile {
    uint index; // class; CLASSES where it is none of those to choose from
    float square; // sum of squared errors of its pixels
    uint pixels;
    uint work;
};

Tile fetch_tile(uvec2 part) {
    uint changes = imageLoad(estimates, estimate_place(part, ESTIMATE_CHANGES)).x;
    uint level = imageLoad(estimates, estimate_place(part, ESTIMATE_LEVEL)).x;
    Tile tile;
    tile.pixels = changes / CHANGED_PIXEL;
    float samples = exp2(4.0 * float(clamp(level, 1u, params.pattern.w) - 1u));
    tile.square = push.scale * float(changes % CHANGED_PIXEL) / samples;
    tile.work = imageLoad(estimates, estimate_place(part, ESTIMATE_WORK)).x;
    tile.work = min(tile.work, 0xffffffffu / params.pattern.y) * params.pattern.y;
    float key = tile.pixels > 0u ? tile.square / float(tile.pixels) : 0.0;
    if (push.target_square < 0.0) {
        float bound = uintBitsToFloat(imageLoad(estimates, estimate_place(part, ESTIMATE_BOUND)).x);
        key = bound > push.bound ? bound * bound : 0.0;
    }
    // Samples may all agree and still pass by an edge.
    bool open = level + 1u == params.pattern.w && (key > 0.0 || push.target_square == 0.0);
    // Half an octave a class, from 1 down.
    int from_one = (int(floatBitsToUint(1.0) >> 22) - int(floatBitsToUint(min(key, 1.0)) >> 22));
    tile.index = open ? uint(clamp(from_one, 0, int(CLASSES) - 1)) : CLASSES;
    return tile;
}

bool is_out_of_time() {
    uint low = spent.now_low - spent.begin_low;
    uint high = spent.now_high - spent.begin_high - (spent.now_low < spent.begin_low ? 1u : 0u);
    return (float(high) * 4294967296.0 + float(low)) * push.tick_ms >= push.most_ms;
}

void add_tile(uint entry, uvec2 part, uint slot) {
    ivec2 at = list_place(part);
    uvec4 candidates = imageLoad(lists, at);
    uvec4 second = imageLoad(lists, at + ivec2(2, 0));
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    imageStore(lists, at + ivec2(2, 0), uvec4(second.xy, slot, 0u));
    imageStore(selected_list, tile_entry_place(slot, tiles), uvec4(entry));
    imageStore(estimates, estimate_place(part, ESTIMATE_CHANGES), uvec4(0u));
    imageStore(estimates, estimate_place(part, ESTIMATE_BOUND), uvec4(0u));
    imageStore(estimates, estimate_place(part, ESTIMATE_LEVEL), uvec4(params.pattern.w));
    bool is_walked = candidates.w == TILE_WALKED;
    uint entries = is_walked ? 0u : second.x + second.y;
    for (uint i = TASK_ENTRIES; i < entries; i += TASK_ENTRIES) {
        uint task = atomicAdd(further.count, 1u);
        atomicMax(further.groups_x, min(task + 1u, TILE_ROW));
        atomicMax(further.groups_y, task / TILE_ROW + 1u);
        imageStore(tasks, task_place(task), uvec4(entry, i, 0u, 0u));
    }
    if (is_walked || candidates.z < params.counts.z) {
        uint other = atomicAdd(partial.count, 1u);
        atomicMax(partial.groups_x, min(other + 1u, TILE_ROW));
        atomicMax(partial.groups_y, other / TILE_ROW + 1u);
        imageStore(partial_list, tile_entry_place(other, tiles), uvec4(entry));
    }
}

// Decides how many tiles are chosen, and turns counts and works into those of all before.
void choose() {
    float square = 0.0;
    uint pixel_count = 0u;
    for (uint i = 0u; i < LANES; ++i) {
        square += other_squares[i];
        pixel_count += pixels[i];
    }
    for (uint i = 0u; i < CLASSES; ++i) {
        square += class_squares[i];
    }
    float most = push.target_square * float(pixel_count);
    uint last = CLASSES;
    uint wanted = 0u;
    for (uint i = 0u; i < CLASSES; ++i) {
        if (class_counts[i] > 0u && (push.target_square <= 0.0 || square > most)) {
            // Four times the samples are left with an eighth of one edge's squared error and a quarter of what cells full
            // of edges have: 0.12 to 0.17 on whole pictures. Of the last class there are as many as it takes, and some
            // more: estimates are a seventh low where few edges cross the light.
            float gain = 0.83 * class_squares[i];
            float part = push.target_square > 0.0 ? min((square - 0.75 * most) / gain, 1.0) : 1.0;
            square -= gain;
            wanted += uint(ceil(part * float(class_counts[i])));
            last = i;
        }
    }
    bool stop = is_out_of_time();
    most_tiles = stop ? 0u : min((wanted + push.rounds - 1u) / push.rounds, push.capacity);
    last_class = last;
    uint count = 0u;
    uint work = spent.work;
    for (uint i = 0u; i < CLASSES; ++i) {
        for (uint lane = 0u; lane < LANES; ++lane) {
            uint own = counts[i][lane];
            counts[i][lane] = count;
            count += own;
            own = works[i][lane];
            works[i][lane] = work;
            work = add_sat(work, own);
        }
    }
}

void main() {
    uint lane = gl_LocalInvocationIndex;
    uvec2 tiles = (params.counts.xy + TILE_SIZE - 1u) / TILE_SIZE;
    uint parts = tiles.x * push.parts_down;
    uint run = (parts + LANES - 1u) / LANES;
    uint first = min(lane * run, parts);
    uint end = min(first + run, parts);
    for (uint i = 0u; i < CLASSES; ++i) {
        squares[i][lane] = 0.0;
        counts[i][lane] = 0u;
        works[i][lane] = 0u;
    }
    float other = 0.0;
    uint pixel_count = 0u;
    for (uint entry = first; entry < end; ++entry) {
        Tile tile = fetch_tile(tile_of_entry(entry, tiles));
        pixel_count += tile.pixels;
        if (tile.index < CLASSES) {
            squares[tile.index][lane] += tile.square;
            counts[tile.index][lane] += 1u;
            works[tile.index][lane] = add_sat(works[tile.index][lane], tile.work);
        } else {
            other += tile.square;
        }
    }
    other_squares[lane] = other;
    pixels[lane] = pixel_count;
    barrier();
    float square = 0.0;
    uint count = 0u;
    for (uint i = 0u; i < LANES; ++i) {
        square += squares[lane][i];
        count += counts[lane][i];
    }
    class_squares[lane] = square;
    class_counts[lane] = count;
    barrier();
    if (lane == 0u) {
        choose();
    }
    barrier();
    for (uint entry = first; entry < end && last_class < CLASSES && most_tiles > 0u; ++entry) {
        uvec2 part = tile_of_entry(entry, tiles);
        Tile tile = fetch_tile(part);
        if (tile.index <= last_class) {
            uint slot = counts[tile.index][lane];
            uint work = add_sat(works[tile.index][lane], tile.work);
            counts[tile.index][lane] = slot + 1u;
            works[tile.index][lane] = work;
            if (slot < most_tiles && work <= push.work) {
                add_tile(entry, part, slot);
                atomicMax(selected.count, slot + 1u);
                atomicMax(selected.groups_x, min(slot + 1u, TILE_ROW));
                atomicMax(selected.groups_y, slot / TILE_ROW + 1u);
                atomicMax(blocks_of_selected.groups_x, min(slot + 1u, TILE_ROW));
                atomicMax(blocks_of_selected.groups_y, slot / TILE_ROW + 1u);
                atomicMax(spent.work, work);
            }
        }
    }
}
