#version 460
// Depth-dependent filtering of a multi-layer depth image (Keating, Max 1999), section 3: a fan of
// rays from each pixel's surface to the light, tested where they cross the boundaries between depth
// buckets against a bit for each boundary and texel. Where the receiver's own plane lies in one of
// the two buckets that meet there, the depths themselves are compared with it.

#include "common/light_above.glsl"
#include "common/octahedral.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "mdi/params.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(constant_id = 0) const uint LIGHT_SHAPE = 1u;
layout(constant_id = 1) const uint RAYS = 64u;

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

// Rounding of depths, as a part of them: 16 units of single precision's last place.
const float DEPTH_ROUNDING = 1.0 / 1048576.0;

struct Receiver {
    vec3 position; // along the view's axes, metres from the light, of a sun from the scene's origin
    vec3 normal;   // along the view's axes
    vec3 center;   // of the light, as it shows from here; of a sun the direction towards it
    vec3 axis_x;   // from the centre to the light's rim
    vec3 axis_y;
    uint index;    // of the view
    LightView light_view;
    vec4 buckets;
};

vec3 in_view(LightView light_view, vec3 v) {
    return vec3(dot(v, light_view.right.xyz), dot(v, light_view.up.xyz),
        dot(v, light_view.forward.xyz));
}

// How a ray to a place of the light moves across the view for each metre towards the light.
vec2 ray_slope(Receiver receiver, vec3 place) {
    return receiver.light_view.forward.w > 0.0
        ? (place.xy - receiver.position.xy) / (receiver.position.z - place.z)
        : place.xy / -place.z;
}

// Texels of the map where a line from the receiver is at a depth.
vec2 texel_at(Receiver receiver, vec2 slope, float z) {
    LightView light_view = receiver.light_view;
    vec2 at = receiver.position.xy + (receiver.position.z - z) * slope;
    at = light_view.forward.w > 0.0 ? at / z : at;
    vec2 corner = vec2(light_view.right.w, light_view.up.w);
    return (at - corner) * light_view.scale.xy * float(params.counts.y);
}

// Boundaries of a word that are blocked anywhere in a rectangle of texels.
uint blocked_in(Receiver receiver, int word, vec2 low, vec2 high) {
    float size = float(params.counts.y);
    ivec2 first = ivec2(clamp(floor(low), 0.0, size - 1.0));
    ivec2 last = ivec2(clamp(floor(high), 0.0, size - 1.0));
    ivec2 span = last - first;
    int level = findMSB(uint(max(span.x, span.y))) + 1;
    level = min(level, textureQueryLevels(boundaries) - 1);
    first >>= level;
    last >>= level;
    int layer = int(receiver.index * WORDS) + word;
    uint bits = texelFetch(boundaries, ivec3(first, layer), level).x;
    bits |= texelFetch(boundaries, ivec3(last, layer), level).x;
    bits |= texelFetch(boundaries, ivec3(first.x, last.y, layer), level).x;
    return bits | texelFetch(boundaries, ivec3(last.x, first.y, layer), level).x;
}

// Depth of the receiver's plane along the view at the centre of a texel, metres; what rounding of
// positions and normals may move it by; the nearest depth within the texel, 0 where the plane leaves
// the view.
vec3 plane_depth(Receiver receiver, vec2 texel) {
    LightView light_view = receiver.light_view;
    vec2 corner = vec2(light_view.right.w, light_view.up.w);
    vec2 texel_size = 1.0 / (light_view.scale.xy * float(params.counts.y));
    vec2 at = (texel + 0.5) * texel_size + corner;
    float height = dot(receiver.normal, receiver.position);
    float across = dot(receiver.normal.xy, at);
    float reach = 0.5 * dot(abs(receiver.normal.xy), abs(texel_size));
    bool perspective = light_view.forward.w > 0.0;
    float facing = perspective ? across + receiver.normal.z : receiver.normal.z;
    float depth = perspective ? height / facing : (height - across) / facing;
    // Places in the view are sums of its corner and extent, and offsets differences from its origin:
    // what these round off stays where position and place themselves are near 0.
    float extent = length(corner) + length(1.0 / light_view.scale.xy);
    float size = length(receiver.position) + length(params.origin.xyz)
        + extent * (perspective ? abs(depth) : 1.0);
    float slack = (size + abs(depth)) * DEPTH_ROUNDING / max(abs(facing), 1.0e-6);
    float steepest = abs(facing) + reach;
    float nearest = perspective ? abs(height) / steepest : depth - reach / abs(facing);
    bool inside = !perspective || height * facing > 0.0;
    return vec3(depth, slack, inside ? nearest : -1.0e30);
}

// Whether a depth of the buckets around a boundary is in front of the receiver's plane.
bool depths_block(Receiver receiver, ivec2 texel, int k, vec3 plane) {
    uvec2 head = texelFetch(heads, ivec3(texel, receiver.index), 0).xy;
    bool blocked = false;
    for (uint i = 0u; i < head.y && !blocked; ++i) {
        float z = uintBitsToFloat(texelFetch(lists, list_place(head.x + i), 0).x);
        int bucket = bucket_of(bucket_place(receiver.buckets, z));
        if (bucket > k || z >= plane.x - plane.y) {
            break;
        }
        blocked = bucket >= (MARK_NEAREST != 0u ? k : k - 1);
    }
    return blocked;
}

// Whether something blocks a ray at boundary k.
bool blocked_at(Receiver receiver, vec2 slope, int k, float z) {
    float size = float(params.counts.y);
    vec2 texel = floor(texel_at(receiver, slope, z));
    if (any(notEqual(texel, clamp(texel, 0.0, size - 1.0)))) {
        return false;
    }
    ivec3 place = ivec3(ivec2(texel), int(receiver.index * WORDS) + (k >> 5));
    if ((texelFetch(boundaries, place, 0).x >> (k & 31) & 1u) == 0u) {
        return false;
    }
    // Behind the boundary's farther bucket the receiver's plane can be disregarded.
    vec3 plane = plane_depth(receiver, texel);
    float farthest_of_ours = float(k) + (MARK_NEAREST != 0u ? 0.501 : 1.001);
    bool clear = plane.z > -1.0e29
        && bucket_place(receiver.buckets, plane.z - plane.y) > farthest_of_ours;
    return clear || depths_block(receiver, place.xy, k, plane);
}

// The part of the light that is seen, of that above the receiver's plane.
float traced(Receiver receiver) {
    bool perspective = receiver.light_view.forward.w > 0.0;
    // The range of slopes.
    vec2 low = vec2(1.0e30);
    vec2 high = vec2(-1.0e30);
    for (int i = 0; i < 4; ++i) {
        vec2 s = vec2(i & 1, i >> 1) * 2.0 - 1.0;
        vec2 slope = ray_slope(receiver, receiver.center + s.x * receiver.axis_x + s.y * receiver.axis_y);
        low = min(low, slope);
        high = max(high, slope);
    }
    int own = bucket_of(bucket_place(receiver.buckets, receiver.position.z));
    float seen = 0.0;
    float above = 0.0;
    for (uint batch = 0u; batch < RAYS; batch += 32u) {
        uint open = 0u;
        for (uint i = batch; i < min(batch + 32u, RAYS); ++i) {
            vec3 place = receiver.center + rays[i].x * receiver.axis_x + rays[i].y * receiver.axis_y;
            vec3 direction = perspective ? place - receiver.position : place;
            bool over = dot(receiver.normal, direction) > 0.0;
            open |= over ? 1u << (i - batch) : 0u;
            above += over ? rays[i].z : 0.0;
        }
        for (int word = own >> 5; word >= 0 && open != 0u; --word) {
            uint bits = 0xFFFFFFFFu >> max(31 - (own - 32 * word), 0);
            float nearest = boundary_depth(receiver.buckets, 32 * word);
            vec2 here = texel_at(receiver, vec2(0.0), receiver.position.z);
            vec2 a = texel_at(receiver, low, nearest);
            vec2 b = texel_at(receiver, high, nearest);
            bits &= blocked_in(receiver, word, min(here, min(a, b)), max(here, max(a, b)));
            while (bits != 0u && open != 0u) {
                int k = findMSB(bits);
                bits ^= 1u << k;
                k += 32 * word;
                float z = min(boundary_depth(receiver.buckets, k), receiver.position.z);
                a = texel_at(receiver, low, z);
                b = texel_at(receiver, high, z);
                uint reached = blocked_in(receiver, word, min(a, b), max(a, b));
                uint left = (reached >> (k & 31) & 1u) != 0u ? open : 0u;
                while (left != 0u) {
                    int i = findLSB(left);
                    left &= left - 1u;
                    vec2 s = rays[batch + uint(i)].xy;
                    vec3 place = receiver.center + s.x * receiver.axis_x + s.y * receiver.axis_y;
                    bool beyond = perspective && place.z >= z;
                    if (!beyond && blocked_at(receiver, ray_slope(receiver, place), k, z)) {
                        open ^= 1u << i;
                    }
                }
            }
        }
        while (open != 0u) {
            int i = findLSB(open);
            open &= open - 1u;
            seen += rays[batch + uint(i)].z;
        }
    }
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
            Receiver receiver;
            receiver.index = found;
            receiver.light_view = params.views[found];
            receiver.buckets = params.buckets[found];
            receiver.position = in_view(receiver.light_view, q);
            receiver.normal = in_view(receiver.light_view, n);
            vec3 center;
            vec3 axis_x;
            vec3 axis_y;
            place_light(p, center, axis_x, axis_y);
            receiver.center = in_view(receiver.light_view, center);
            receiver.axis_x = in_view(receiver.light_view, axis_x);
            receiver.axis_y = in_view(receiver.light_view, axis_y);
            result = above * traced(receiver);
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
