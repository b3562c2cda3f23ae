#version 460
// Depth-dependent filtering of a multi-layer depth image (Keating, Max 1999), section 3: a fan of
// rays from each pixel's surface to the light, tested where they cross the boundaries between depth
// buckets against a bit for each boundary and texel. Where the receiver's own plane lies in one of
// the two buckets that meet there, the depths themselves are compared with it.
//
// What no ray of the fan reaches is found first, by halving ranges of boundaries. Each ray then goes
// through the pyramid of texels: one fetch tests all boundaries of a word that it crosses within a
// cell, and cells without any of them are left behind whole.

#include "common/light_above.glsl"
#include "common/octahedral.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "mdi/params.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(constant_id = 0) const uint LIGHT_SHAPE = 1u;

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform MdiBlock {
    MdiParams params;
};
layout(set = 0, binding = 2) uniform sampler2D view_depth;
layout(set = 0, binding = 3) uniform usampler2D geometric_normal;
layout(set = 0, binding = 4) uniform usampler2DArray boundaries;
layout(set = 0, binding = 5) uniform usampler2DArray heads;
layout(set = 0, binding = 6) uniform usampler2D lists;
layout(set = 0, binding = 7, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 8, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 9) uniform usampler2D list;
layout(set = 0, binding = 10, std140) uniform RayBlock {
    vec4 rays[MAX_RAYS]; // xy: place on the light, -1 to 1 along its axes; z: weight, all sum to 1
};

layout(set = 0, binding = 11, r32ui) uniform uimage2D tally; // from row 1 on: pixels traced in each tile

// Rounding of depths and places, as a part of them: 16 units of single precision's last place.
const float ROUNDING = 1.0 / 1048576.0;

// What a view reaches beyond its face of the cube at most: distance by depth at a corner, with a margin
// of 1.
const float FARTHEST_BY_DEPTH = 3.01;

// Texels across and down that are looked at one by one, for all rays at once.
const int MOST_ALIKE = 3;

// What all rays of a pixel share. Along a ray, s grows towards the light and places in the map are
// affine in it: 1 / z, of a sun -z, with z the depth along the view in metres.
struct Fan {
    int layer;     // of the view's first word
    int own;       // the receiver's boundary
    vec4 places;   // of the buckets
    vec2 start;    // the receiver in texels
    float s;       // of the receiver
    vec4 middle;   // xy / z: how many texels a ray moves for each unit of s; w: above the plane if > 0
    vec4 along_x;  // the same, for a step from the light's centre to its rim
    vec4 along_y;
    vec2 low;      // least and greatest texels of all rays for each unit of s
    vec2 high;
    vec3 plane;    // dot product with (texels, s) from the receiver: > 0 on the light's side
    vec2 rounding; // of that: x + y * abs(s)
    mat2 spread;   // texels that a ray begins off the middle for each unit of its place on the light
    float growth;  // by how much the last grows for each unit of s
    uint seed;     // of random places
};

vec3 in_view(LightView light_view, vec3 v) {
    return vec3(dot(v, light_view.right.xyz), dot(v, light_view.up.xyz),
        dot(v, light_view.forward.xyz));
}

// center, axis_x, axis_y: the light along the axes of the view, metres; of a sun directions.
// position, normal: the receiver.
Fan fan_of(uint index, vec3 position, vec3 normal, vec3 center, vec3 axis_x, vec3 axis_y) {
    LightView light_view = params.views[index];
    bool perspective = LIGHT_SHAPE != LIGHT_SUN;
    vec2 scale = light_view.scale.xy * float(params.counts.y);
    vec2 corner = vec2(light_view.right.w, light_view.up.w);
    float z = position.z;
    Fan fan;
    fan.layer = int(index * words_of(params.options));
    fan.places = params.places[index];
    fan.s = perspective ? 1.0 / z : -z;
    fan.own = bucket_of(params.options, place_of(fan.places, fan.s));
    vec2 at = perspective ? position.xy * fan.s : position.xy;
    fan.start = (at - corner) * scale;

    // A line from the receiver to a place p of the light meets depth 0 at (z p.xy - p.z xy) / (z - p.z).
    vec2 aside = perspective ? position.xy : vec2(0.0);
    float ahead = perspective ? z : 1.0;
    float behind = perspective ? z : 0.0;
    fan.middle = vec4((center.xy * ahead - aside * center.z) * scale, behind - center.z,
        dot(normal, perspective ? center - position : center));
    fan.along_x = vec4((axis_x.xy * ahead - aside * axis_x.z) * scale, -axis_x.z, dot(normal, axis_x));
    fan.along_y = vec4((axis_y.xy * ahead - aside * axis_y.z) * scale, -axis_y.z, dot(normal, axis_y));
    fan.spread = mat2(0.0);
    fan.seed = 0u;
    fan.growth = abs(center.z) + abs(axis_x.z) + abs(axis_y.z);
    fan.growth = perspective ? fan.growth * z / max(z - fan.growth, 1.0e-3 * z) : 0.0;
    fan.low = vec2(1.0e30);
    fan.high = vec2(-1.0e30);
    for (int i = 0; i < 4; ++i) {
        vec2 side = vec2(i & 1, i >> 1) * 2.0 - 1.0;
        vec4 ray = fan.middle + side.x * fan.along_x + side.y * fan.along_y;
        // Places beside the receiver or deeper are seen anywhere.
        fan.low = min(fan.low, ray.z > 0.0 ? ray.xy / ray.z : vec2(-1.0e30));
        fan.high = max(fan.high, ray.z > 0.0 ? ray.xy / ray.z : vec2(1.0e30));
    }

    fan.plane = vec3(normal.xy / scale, -(perspective ? dot(normal, position) : normal.z));
    // Places in the view are sums of its corner and extent, and offsets differences from its origin:
    // what these round off stays where position and place themselves are near 0.
    float size = length(position) + length(params.origin.xyz);
    float extent = length(corner) + length(1.0 / light_view.scale.xy);
    fan.rounding = (perspective ? vec2(extent + 1.0, size) : vec2(size + extent, 1.0)) * ROUNDING;
    return fan;
}

// xy: place on the light, z: weight.
vec3 ray_of(Fan fan, uint i) {
    vec3 ray = rays[i].xyz;
    if ((params.options.w & RANDOM_PLACES) != 0u) {
        // Two steps of a permuted congruential generator (O'Neill 2014) on each number.
        uvec2 bits = uvec2(fan.seed, i) * 1664525u + 1013904223u;
        bits.x += bits.y * 1664525u;
        bits.y += bits.x * 1664525u;
        bits ^= bits >> 16;
        bits.x += bits.y * 1664525u;
        bits.y += bits.x * 1664525u;
        bits ^= bits >> 16;
        vec2 part = vec2(bits >> 8) / 16777216.0;
        float angle = 6.2831853 * part.y;
        bool uneven = (params.options.w & UNEVEN_LIGHT) != 0u;
        bool round = LIGHT_SHAPE != LIGHT_RECT && LIGHT_SHAPE != LIGHT_LINE;
        ray.xy = round ? sqrt(part.x) * vec2(cos(angle), sin(angle)) : 2.0 * part - 1.0;
        ray.xy = uneven ? rays[bits.x % MAX_RAYS].xy : ray.xy;
    }
    return ray;
}

// Half of what a pixel shows of its surface, along the light's axes as the view has them: so that
// places of the one and of the other lie in the same order. Metres along the view's x and y.
mat2 pixel_spread(uvec2 pixel, float depth, vec3 n, LightView light_view, vec2 axis_x, vec2 axis_y) {
    vec3 ray = pixel_ray(view.camera, pixel);
    vec2 sides[2];
    for (uint i = 0u; i < 2u; ++i) {
        vec3 across = i == 0u ? view.camera.pixel_right.xyz : view.camera.pixel_down.xyz;
        vec3 next = ray + across;
        float facing = dot(n, next);
        // Where the surface is seen edge-on, no more than 8 times what it is from the front.
        float stretch = dot(n, across) / (abs(facing) > 1.0e-20 ? facing : 1.0e-20);
        vec3 side = depth * (across - next * stretch);
        side *= min(1.0, 8.0 * depth * length(across) / max(length(side), 1.0e-30));
        sides[i] = in_view(light_view, side).xy;
    }
    vec2 a = dot(axis_x, axis_x) > 0.0 ? normalize(axis_x) : vec2(1.0, 0.0);
    vec2 b = vec2(-a.y, a.x);
    b = dot(b, axis_y) < 0.0 ? -b : b;
    return 0.5 * mat2(a * (abs(dot(a, sides[0])) + abs(dot(a, sides[1]))),
        b * (abs(dot(b, sides[0])) + abs(dot(b, sides[1]))));
}

// Whether all that marks boundary k in some texels, from one to another, is on the light's side of the
// receiver's plane.
bool is_clear(Fan fan, ivec2 from, ivec2 to, int k) {
    vec2 low = fan.plane.xy * (vec2(from) - fan.start);
    vec2 high = fan.plane.xy * (vec2(to + 1) - fan.start);
    vec2 least = min(low, high);
    float range = params.options.y != 0u ? 0.501 : 1.001;
    float s = s_of(fan.places, float(k) + (fan.plane.z > 0.0 ? range : -range));
    return least.x + least.y + fan.plane.z * (s - fan.s) > fan.rounding.x + fan.rounding.y * abs(s);
}

// Whether something that marks boundary k in a texel is on the light's side of the receiver's plane.
bool is_blocked(Fan fan, ivec2 texel, int k) {
    bool blocked = is_clear(fan, texel, texel, k);
    vec2 texels = vec2(texel) + 0.5 - fan.start;
    uvec2 head = texelFetch(heads, ivec3(texel, fan.layer / int(words_of(params.options))), 0).xy;
    int bucket = 0;
    for (uint i = 0u; i < head.y && bucket <= k && !blocked; ++i) {
        float z = uintBitsToFloat(texelFetch(lists, list_place(head.x + i), 0).x);
        float s = LIGHT_SHAPE == LIGHT_SUN ? -z : 1.0 / z;
        bucket = bucket_of(params.options, place_of(fan.places, s));
        bool near = bucket <= k && bucket >= (params.options.y != 0u ? k : k - 1);
        float height = dot(fan.plane, vec3(texels, s - fan.s));
        blocked = near && height > fan.rounding.x + fan.rounding.y * abs(s);
    }
    return blocked;
}

// Where a boundary is, or a place so many buckets beyond it, or the receiver if that is nearer.
float boundary_s(Fan fan, int k, float beyond) {
    return max(s_of(fan.places, float(k) + beyond), fan.s);
}

// How far before and behind a boundary rays are tested, buckets.
float side_of() {
    return (params.options.w & TESTED_SIDES) != 0u ? 0.5 : 0.0;
}

// Texels that rays look up between two boundaries: x, y of the first, x, y of the last.
ivec4 texels_between(Fan fan, int first, int last) {
    float near = boundary_s(fan, first, -side_of()) - fan.s;
    float far = boundary_s(fan, last, side_of()) - fan.s;
    vec2 aside = (abs(fan.spread[0]) + abs(fan.spread[1])) * (1.0 + fan.growth * near);
    aside += (params.options.w & DITHERED_TEXELS) != 0u ? 0.5 : 0.0;
    vec2 low = fan.start + min(fan.low * near, fan.low * far) - aside;
    vec2 high = fan.start + max(fan.high * near, fan.high * far) + aside;
    return ivec4(clamp(floor(vec4(low, high)), 0.0, float(params.counts.y) - 1.0));
}

int highest(uvec4 bits) {
    int word = bits.w != 0u ? 3 : bits.z != 0u ? 2 : bits.y != 0u ? 1 : 0;
    return 32 * word + findMSB(bits[word]);
}

// Boundaries that rays may be blocked at, a bit each; in `clear` those of them where whatever marks
// them is on the light's side of the receiver's plane.
uvec4 reached(Fan fan, out uvec4 clear) {
    uvec4 found = uvec4(0u);
    clear = uvec4(0u);
    int k = fan.own;
    int count = 32;
    while (k >= 0) {
        int word = k >> 5;
        int first = max(k - count + 1, 32 * word);
        ivec4 texels = texels_between(fan, first, k);
        int level = findMSB(max(texels.z - texels.x, texels.w - texels.y)) + 1;
        ivec4 cells = texels >> level;
        int layer = fan.layer + word;
        uint bits = texelFetch(boundaries, ivec3(cells.xy, layer), level).x
            | texelFetch(boundaries, ivec3(cells.zw, layer), level).x
            | texelFetch(boundaries, ivec3(cells.zy, layer), level).x
            | texelFetch(boundaries, ivec3(cells.xw, layer), level).x;
        bits &= (0xFFFFFFFFu << (first & 31)) & (0xFFFFFFFFu >> (31 - (k & 31)));
        if (bits == 0u) {
            k = first - 1;
            count = min(2 * count, 32);
        } else if (first < k) {
            k = 32 * word + findMSB(bits);
            count = max(count >> 1, 1);
        } else {
            found[word] |= bits;
            clear[word] |= is_clear(fan, texels.xy, texels.zw, k) ? bits : 0u;
            --k;
        }
    }
    return found;
}

// Those of some boundaries that are not shown to be free for all rays at once: a few texels around the
// receiver need not keep any ray from its own surface.
uvec4 not_free(Fan fan, uvec4 marks) {
    uvec4 left = uvec4(0u);
    while (marks != uvec4(0u)) {
        int k = highest(marks);
        uint bit = 1u << (k & 31);
        marks[k >> 5] ^= bit;
        ivec4 texels = texels_between(fan, k, k);
        bool blocked = max(texels.z - texels.x, texels.w - texels.y) >= MOST_ALIKE;
        ivec2 texel = texels.xy;
        while (!blocked && texel.y <= texels.w) {
            uint here = texelFetch(boundaries, ivec3(texel, fan.layer + (k >> 5)), 0).x;
            blocked = (here & bit) != 0u && is_blocked(fan, texel, k);
            texel = texel.x < texels.z ? texel + ivec2(1, 0) : ivec2(texels.x, texel.y + 1);
        }
        left[k >> 5] |= blocked ? bit : 0u;
    }
    return left;
}

// Boundaries up to one, none below 0.
uvec4 up_to(int k) {
    ivec4 count = clamp(k + 1 - ivec4(0, 32, 64, 96), 0, 32);
    uvec4 part = (uvec4(1u) << (count & 31)) - 1u;
    return mix(part, uvec4(0xFFFFFFFFu), equal(count, ivec4(32)));
}

// Whether a ray passes all boundaries, each so many buckets beyond it. `own`: in the receiver's view; else what of the ray lies in
// another one is looked at. level: of the cells of the pyramid to begin with; where a ray ended is a
// fair guess for the next one.
bool passes(Fan fan, bool own, uint index, vec2 place, uvec4 left, uvec4 clear, float beyond,
    inout int level) {
    vec4 course = fan.middle + place.x * fan.along_x + place.y * fan.along_y;
    float size = float(params.counts.y);
    int top = textureQueryLevels(boundaries) - 1;
    float place_z = 1.0 / fan.s - course.z;
    vec2 aside = fan.spread * place;
    vec2 start = fan.start + aside;
    aside *= LIGHT_SHAPE == LIGHT_SUN ? 0.0 : place_z / fan.s;
    vec2 slope = (course.xy - aside) / course.z;
    vec2 across = 1.0 / mix(slope, vec2(1.0e-30), lessThan(abs(slope), vec2(1.0e-30)));
    if ((params.options.w & DITHERED_TEXELS) != 0u) {
        // The additive recurrence of the plastic number (Roberts 2018).
        start += fract(vec2(0.75487766, 0.56984029) * float(index) + 0.5) - 0.5;
    }
    // A light may reach among the boundaries: those behind its place cannot hide it. In another view
    // the receiver may be behind, and the light deeper.
    bool among = LIGHT_SHAPE != LIGHT_SUN && place_z > 0.0;
    float place_s = among ? 1.0 / place_z : 1.0e30;
    float receiver_s = own || fan.s > 0.0 ? fan.s : 1.0e30;
    float near = own ? place_s : max(place_s, receiver_s);
    int least = near < 1.0e30 ? int(clamp(floor(place_of(fan.places, near)) + 1.0, 0.0, 128.0)) : 0;
    if (!own) {
        vec2 side = fan.s - start * across;
        vec2 other = fan.s + (size - start) * across;
        vec2 enters = min(side, other);
        float enter = max(min(place_s, receiver_s), max(enters.x, enters.y));
        left &= up_to(int(clamp(floor(place_of(fan.places, enter)), -1.0, 127.0)));
        left = enter < 1.0e30 ? left : uvec4(0u);
    }
    bool open = true;
    bool found = !own || course.z > 0.0;
    while (found) {
        // Search for a mark on the ray's way.
        found = false;
        ivec2 cell = ivec2(0);
        int k = highest(left);
        while (!found && left != uvec4(0u) && k >= least) {
            float s = own ? boundary_s(fan, k, beyond) : s_of(fan.places, float(k) + beyond);
            vec2 at = floor(start + slope * (s - fan.s));
            bool inside = all(equal(at, clamp(at, 0.0, size - 1.0)));
            cell = ivec2(at) >> level;
            vec2 edge = vec2((cell + ivec2(greaterThan(across, vec2(0.0)))) << level);
            vec2 leaves = (edge - start) * across;
            float last = ceil(place_of(fan.places, fan.s + min(leaves.x, leaves.y)) - beyond);
            int word = k >> 5;
            int lowest = int(clamp(last - float(32 * word), 0.0, float(k & 31)));
            uint bits = left[word];
            uint crossed = bits & (0xFFFFFFFFu << lowest);
            ivec3 texel = ivec3(inside ? cell : ivec2(0), fan.layer + word);
            uint hit = crossed & texelFetch(boundaries, texel, level).x;
            found = inside && hit != 0u && level == 0;
            level = hit == 0u ? min(level + 1, top) : max(level - 2, 0);
            left[word] = bits ^ crossed ^ hit;
            left = inside ? left : uvec4(0u);
            k = highest(left);
        }
        if (found) {
            uint bit = 1u << (k & 31);
            open = (clear[k >> 5] & bit) == 0u && !is_blocked(fan, cell, k);
            left[k >> 5] ^= bit;
            found = open;
        }
    }
    return open;
}

// Boundaries of another view that rays may be blocked at once they have left the receiver's.
uvec4 beyond(Fan fan, uint index) {
    if (LIGHT_SHAPE == LIGHT_SUN || int(index * words_of(params.options)) == fan.layer) {
        return uvec4(0u);
    }
    // The first ray leaves here; from there on rays come no farther from the light's centre.
    vec2 room = min(fan.start / max(-fan.low, 1.0e-30),
        (float(params.counts.y) - fan.start) / max(fan.high, 1.0e-30));
    float s = fan.s + max(min(room.x, room.y), 0.0);
    float reach = max(view.light.axis_x.w, view.light.axis_y.w) * 1.42;
    float farthest = max(FARTHEST_BY_DEPTH / s, reach);
    uvec4 marks = uvec4(0u);
    int top = textureQueryLevels(boundaries) - 1;
    for (uint word = 0u; word < words_of(params.options); ++word) {
        int layer = int(index * words_of(params.options) + word);
        marks[word] = texelFetch(boundaries, ivec3(0, 0, layer), top).x;
    }
    float place = place_of(params.places[index], 1.0 / farthest);
    return marks & up_to(int(clamp(place + 1.0, 0.0, 127.0)));
}

// The light along the axes of the scene, metres; of a sun directions.
struct PlacedLight {
    vec3 center; // from the views' origin
    vec3 axis_x;
    vec3 axis_y;
};

// q, n: the receiver from the views' origin along the axes of the scene, and its normal.
Fan fan_in(uint index, vec3 q, vec3 n, PlacedLight placed) {
    LightView light_view = params.views[index];
    vec3 position = in_view(light_view, q);
    // Beside another view's origin there is no depth to divide by.
    float least = 1.0e-4 * length(position);
    bool beside = LIGHT_SHAPE != LIGHT_SUN && abs(position.z) < least;
    position.z = beside ? (position.z < 0.0 ? -least : least) : position.z;
    return fan_of(index, position, in_view(light_view, n),
        in_view(light_view, placed.center), in_view(light_view, placed.axis_x),
        in_view(light_view, placed.axis_y));
}

// The part of the light that is seen, of that above the receiver's plane; of an uneven light, of all.
float traced(Fan fan, vec3 q, vec3 n, PlacedLight placed, ivec2 tile) {
    uvec4 clear = uvec4(0u);
    uvec4 marks = up_to(fan.own);
    if ((params.options.w & ALL_BOUNDARIES) == 0u) {
        marks = reached(fan, clear);
        marks = (marks & clear) | not_free(fan, marks & ~clear);
    }
    uint others = 0u;
    float nearest = 0.0; // s of what is nearest to the light in another view
    for (uint i = 0u; i < params.counts.x; ++i) {
        uvec4 bits = beyond(fan, i);
        int word = bits.x != 0u ? 0 : bits.y != 0u ? 1 : bits.z != 0u ? 2 : 3;
        bool any_mark = bits != uvec4(0u);
        float place = float(32 * word + findLSB(bits[word])) - 1.001;
        float s = s_of(params.places[i], max(place, 0.0));
        others |= any_mark ? 1u << i : 0u;
        nearest = any_mark ? max(nearest, place > 0.0 ? s : 1.0e30) : nearest;
    }
    bool uneven = (params.options.w & UNEVEN_LIGHT) != 0u;
    if (marks == uvec4(0u) && others == 0u && !uneven) {
        return 1.0;
    }
    imageAtomicAdd(tally, tile + ivec2(0, 1), 1u);
    float seen = 0.0;
    float above = 0.0;
    int level = 0;
    uint count = params.options.z;
    for (uint first = 0u; first < count; first += 32u) {
        uint last = min(first + 32u, count);
        uint open = 0u;
        uint leaving = 0u; // those that may come to a mark of another view
        for (uint i = first; i < last; ++i) {
            vec3 ray = ray_of(fan, i);
            vec4 course = fan.middle + ray.x * fan.along_x + ray.y * fan.along_y;
            bool over = course.w > 0.0;
            above += over ? ray.z : 0.0;
            open |= over ? 1u << (i - first) : 0u;
            vec2 steps = course.z / mix(course.xy, vec2(1.0e-30), lessThan(abs(course.xy), vec2(1.0e-30)));
            vec2 exits = max(-fan.start * steps, (float(params.counts.y) - fan.start) * steps);
            bool leaves = fan.s + min(exits.x, exits.y) <= FARTHEST_BY_DEPTH * nearest;
            leaving |= course.z <= 0.0 || leaves ? 1u << (i - first) : 0u;
        }
        Fan turn = fan;
        uvec4 left = marks;
        uvec4 known = clear;
        bool own = true;
        uint views = others;
        bool more = true;
        while (more) {
            uint waiting = left != uvec4(0u) ? (own ? open : open & leaving) : 0u;
            while (waiting != 0u) {
                uint bit = waiting & (~waiting + 1u);
                waiting ^= bit;
                uint i = first + uint(findLSB(bit));
                vec2 place = ray_of(fan, i).xy;
                float side = side_of();
                bool passed = true;
                for (float beyond = -side; passed && beyond <= side; beyond += 0.5) {
                    passed = passes(turn, own, i, place, left, known, beyond, level);
                }
                open = passed ? open : open ^ bit;
            }
            more = views != 0u && (open & leaving) != 0u;
            if (more) {
                uint next = uint(findLSB(views));
                views &= views - 1u;
                left = beyond(fan, next);
                turn = fan_in(next, q, n, placed);
                known = uvec4(0u);
                own = false;
            }
        }
        for (uint i = first; i < last; ++i) {
            seen += (open >> (i - first) & 1u) != 0u ? rays[i].z : 0.0;
        }
    }
    above = uneven ? 1.0 : above;
    return above > 0.0 ? min(seen / above, 1.0) : 1.0;
}

// The light as it shows from p, relative to the view's origin, along the scene's axes.
void place_light(vec3 p, out vec3 center, out vec3 axis_x, out vec3 axis_y) {
    Light light = view.light;
    center = vec3(0.0);
    axis_x = light.axis_x.xyz * light.axis_x.w;
    axis_y = light.axis_y.xyz * light.axis_y.w;
    if (LIGHT_SHAPE == LIGHT_LINE) {
        axis_y = vec3(0.0);
    } else if (LIGHT_SHAPE == LIGHT_POINT) {
        axis_x = vec3(0.0);
        axis_y = vec3(0.0);
    } else if (LIGHT_SHAPE == LIGHT_SUN || LIGHT_SHAPE == LIGHT_SPHERE) {
        vec3 towards = light_offset(light, p);
        float distance_m = length(towards);
        towards /= distance_m;
        axis_x = light.axis_x.xyz - towards * dot(towards, light.axis_x.xyz);
        float across = length(axis_x);
        vec3 other = light.axis_y.xyz - towards * dot(towards, light.axis_y.xyz);
        axis_x = across > 0.5 ? axis_x / across : normalize(other);
        axis_y = cross(towards, axis_x);
        float radius = light.axis_x.w;
        if (LIGHT_SHAPE == LIGHT_SUN) {
            center = towards;
        } else {
            // The disk that the sphere's outline bounds.
            float sine = min(radius / distance_m, 1.0);
            center = -towards * (radius * sine);
            radius *= sqrt(1.0 - sine * sine);
        }
        axis_x *= radius;
        axis_y *= radius;
    }
}

float pixel_visibility(uvec2 pixel) {
    float depth = texelFetch(view_depth, ivec2(pixel), 0).x;
    vec3 n = unpack_unit(texelFetch(geometric_normal, ivec2(pixel), 0).x);
    vec3 p = view.camera.eye.xyz + depth * pixel_ray(view.camera, pixel);
    bool hit = depth > 0.0;
    float above = light_above(view.light, LIGHT_SHAPE, p, n);
    float result = hit ? above : 1.0;
    if (hit && above > 0.0 && params.counts.x > 0u) {
        vec3 q = p - params.origin.xyz;
        uint found = 0u;
        vec3 at = light_view_project(params.views[0], q);
        while (found + 1u < params.counts.x && any(notEqual(at.xy, clamp(at.xy, 0.0, 1.0)))) {
            found += 1u;
            at = light_view_project(params.views[found], q);
        }
        if (all(equal(at.xy, clamp(at.xy, 0.0, 1.0)))) {
            LightView light_view = params.views[found];
            PlacedLight placed;
            place_light(p, placed.center, placed.axis_x, placed.axis_y);
            Fan fan = fan_in(found, q, n, placed);
            fan.seed = pixel.y << 16 | pixel.x;
            if ((params.options.w & PIXEL_FOOTPRINT) != 0u) {
                mat2 spread = pixel_spread(pixel, depth, n, light_view,
                    in_view(light_view, placed.axis_x).xy, in_view(light_view, placed.axis_y).xy);
                vec2 texels = light_view.scale.xy * float(params.counts.y);
                texels *= LIGHT_SHAPE == LIGHT_SUN ? 1.0 : fan.s;
                fan.spread = mat2(spread[0] * texels, spread[1] * texels);
            }
            bool uneven = (params.options.w & UNEVEN_LIGHT) != 0u;
            result = (uneven ? 1.0 : above) * traced(fan, q, n, placed, ivec2(pixel / TILE_SIZE));
        }
    }
    return result;
}

void main() {
    uint index = gl_WorkGroupID.y * TILE_ROW + gl_WorkGroupID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 size = uvec2(imageSize(visibility));
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uint entry = texelFetch(list, tile_entry_place(index, tiles), 0).x;
    uvec2 pixel = tile_of_entry(entry, tiles) * TILE_SIZE + gl_LocalInvocationID.xy;
    if (any(greaterThanEqual(pixel, size))) {
        return;
    }
    imageStore(visibility, ivec2(pixel), vec4(pixel_visibility(pixel)));
}
