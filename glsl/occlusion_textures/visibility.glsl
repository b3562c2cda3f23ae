// The body of visibility_*.comp.
#ifndef ANTUMBRA_OCCLUSION_TEXTURES_VISIBILITY_GLSL
#define ANTUMBRA_OCCLUSION_TEXTURES_VISIBILITY_GLSL

// What a light's kernel sees through the occlusion textures between it and each pixel (Eisemann,
// Decoret 2006): the part of each texture that is blocked within what the light covers of it, seen
// from the surface, and all of them combined.

#include "common/combine.glsl"
#include "common/light_above.glsl"
#include "common/octahedral.glsl"
#include "common/tiles.glsl"
#include "common/view_params.glsl"
#include "occlusion_textures/groups.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(constant_id = 0) const uint LIGHT_SHAPE = 1u;
layout(constant_id = 1) const uint COMBINE = 4u;
layout(constant_id = 4) const uint FIRST_VIEW = 1u; // pixels that no view sees are settled here
layout(constant_id = 5) const float DETAIL = 1.0;   // texels of the bits in one of the table
layout(constant_id = 6) const float ROUND_KERNEL = 1.0; // half side of the square for a disk of radius 1

layout(constant_id = 7) const uint CONTACT = 4u;    // rays of the test within a group; 0: none
layout(constant_id = 8) const uint FINE = 64u;      // fine slices
layout(constant_id = 13) const uint EARLY = 1u;     // leave out what can add nothing
layout(constant_id = 12) const uint COUNT = 0u;     // show what filters fetch, in 1024, instead

const uint COMBINE_PRODUCT = 0u;
const uint COMBINE_SUM = 1u;
const uint COMBINE_MAXIMUM = 2u;
const uint COMBINE_THIN = 3u; // a product; the groups' masks overlap
const uint COMBINE_CUMULATIVE = 4u; // textures hold what a group adds
const uint COMBINE_BOUNDED = 5u;    // and no more than passes any one

layout(set = 0, binding = 0, std140) uniform ViewBlock {
    ViewParams view;
};
layout(set = 0, binding = 1, std140) uniform OcclusionBlock {
    OcclusionView slice_view;
};
layout(set = 0, binding = 2, std140) uniform GroupBlock {
    SliceGroups groups;
};
layout(set = 0, binding = 3) uniform sampler2D view_depth;
layout(set = 0, binding = 4) uniform usampler2D geometric_normal;
layout(set = 0, binding = 6) uniform usampler2D any_slices;
layout(set = 0, binding = 7, r32f) uniform writeonly image2D visibility;
layout(set = 0, binding = 8, std140) uniform Arguments {
    TileArguments arguments;
};
layout(set = 0, binding = 9) uniform usampler2D list;

layout(set = 0, binding = 10) uniform usampler2D bits;
layout(set = 0, binding = 11, std140) uniform PlaneBlock {
    vec4 fine_planes[MAX_FINE_SLICES / 4u + 1u]; // depths of the planes between fine slices
};

// In texels of the textures.
struct Kernel {
    vec2 middle;
    vec2 halves; // as seen; a box for a filter is at least a texel wide
    vec2 low;    // of the box, cut to what is known
    vec2 high;
};

// The receiver as the slices see it.
struct Receiver {
    vec3 v;      // offset from the light's centre along the view's axes, metres
    vec2 halves; // of the light's box in the plane through its centre
    vec3 n;      // unit normal along the view's axes
    float side;  // texels of a texture across
};

// Defined by the entry file: halves of the box for its filter.
vec2 filter_halves(vec2 halves);

Kernel kernel_at(Receiver at, float plane, float inverse) {
    bool sun = LIGHT_SHAPE == LIGHT_SUN;
    float along = sun ? 1.0 : plane / at.v.z;
    float wide = sun ? at.v.z - plane : 1.0 - along;
    vec2 middle = (at.v.xy * (along * inverse) - vec2(slice_view.right.w, slice_view.up.w))
        * slice_view.scale.xy * at.side;
    vec2 halves = at.halves * abs(slice_view.scale.xy) * (wide * inverse * at.side);
    vec2 box = filter_halves(halves);
    vec2 known_low = slice_view.border.xy * at.side;
    vec2 known_high = slice_view.border.zw * at.side;
    vec2 least = min(2.0 * box, 1.0);
    return Kernel(middle, halves, clamp(middle - box, known_low, known_high - least),
        clamp(middle + box, known_low + least, known_high));
}

// Fine slices with anything in a box of texels, and in those beside it.
uvec4 slices_in_box(vec2 low, vec2 high) {
    low = (low * DETAIL - 1.0) * 0.25;
    high = (high * DETAIL + 1.0) * 0.25;
    ivec2 size = textureSize(any_slices, 0);
    low = clamp(low, vec2(0.0), vec2(size) - 1.0);
    high = clamp(high, vec2(0.0), vec2(size) - 1.0);
    float reach = max(high.x - low.x, high.y - low.y);
    int level = reach <= 1.0 ? 0 : min(int(ceil(log2(reach))), findMSB(uint(size.x)));
    ivec2 from = ivec2(low) >> level;
    ivec2 to = ivec2(high) >> level;
    return texelFetch(any_slices, from, level) | texelFetch(any_slices, to, level)
        | texelFetch(any_slices, ivec2(from.x, to.y), level)
        | texelFetch(any_slices, ivec2(to.x, from.y), level);
}

float fetched = 0.0; // texture accesses of filters

// Defined by the entry file. x: mean of what the group blocks over a kernel, y: of what it and all
// before it block.
vec2 blocked(uint group, Kernel kernel);
bool is_empty(vec2 low, vec2 high);         // whether no group blocks anything in a box; false: unknown
bool may_block(uint group, Kernel kernel);  // false where `blocked` is 0 and that is quickly seen
float blocked_before(uint group, Kernel kernel);
float texture_side(); // texels

bool holds_anything(uint group, Kernel kernel) {
    return (slices_in_box(kernel.low, kernel.high) & groups.masks[group]) != uvec4(0u);
}

vec3 axes_of(vec3 q) {
    return vec3(dot(q, slice_view.right.xyz), dot(q, slice_view.up.xyz), dot(q, slice_view.forward.xyz));
}

float fine_plane(uint index) {
    return fine_planes[index >> 2][index & 3u];
}

// Depth of the receiver's own plane at image coordinates u.
float own_depth(Receiver at, vec2 u) {
    float across = dot(at.n.xy, u);
    float offset = dot(at.n, at.v);
    bool perspective = slice_view.scale.z > 0.0;
    float over = perspective ? offset - slice_view.forward.w * across : offset - across;
    float under = perspective ? at.n.z + across : at.n.z;
    return under != 0.0 ? over / under : at.v.z;
}

// The least depth of the receiver's own plane that the smallest kernel can find: it is half a texel
// wide to each side, and of a texel that it cuts all bits count. Elsewhere in a larger kernel the
// plane is below the texture, but where the light is partly below the horizon.
float own_nearest(Receiver at, Kernel kernel) {
    vec2 corner = vec2(slice_view.right.w, slice_view.up.w);
    vec2 texel = 1.0 / (slice_view.scale.xy * at.side);
    vec2 u = kernel.middle * texel + corner;
    float own = own_depth(at, u);
    float apart = abs(own_depth(at, u + vec2(texel.x, 0.0)) - own)
        + abs(own_depth(at, u + vec2(0.0, texel.y)) - own);
    return min(own, at.v.z) - apart * (1.5 - 0.5 / DETAIL);
}

// Whether a ray from the receiver to a place of the light (-1 to 1 across) hits what a fine slice
// holds. Slices that the receiver's own plane passes through within a texel do not count.
bool ray_hits(Receiver at, uint slice, vec2 place) {
    float lower = fine_plane(slice + 1u);
    float z = 0.5 * (lower + fine_plane(slice));
    Kernel kernel = kernel_at(at, z, occlusion_inverse(slice_view, z));
    vec2 map = kernel.middle + kernel.halves * place;
    vec2 texel = 1.0 / (slice_view.scale.xy * at.side);
    vec2 u = map * texel + vec2(slice_view.right.w, slice_view.up.w);
    texel /= DETAIL;
    float own = own_depth(at, u);
    float apart = abs(own_depth(at, u + vec2(texel.x, 0.0)) - own)
        + abs(own_depth(at, u + vec2(0.0, texel.y)) - own);
    ivec2 entry = ivec2(floor(map * DETAIL));
    bool inside = all(equal(entry, clamp(entry, ivec2(0), textureSize(bits, 0) - 1)));
    uvec4 found = inside ? texelFetch(bits, entry, 0) : uvec4(0u);
    return lower < own - apart && (found[slice >> 5] >> (slice & 31u) & 1u) != 0u;
}

// The part of rays towards the light that nothing near the receiver blocks: in groups from the first
// on, of which the first is blocked in part by its texture already.
float through_rays(Receiver at, uint first, float first_weight, uvec4 present) {
    float count = float(max(CONTACT, 1u));
    float sum = 0.0;
    for (uint ray = 0u; ray < CONTACT; ++ray) {
        vec2 place = 2.0 * fract(vec2(0.7548776662, 0.5698402910) * float(ray) + 0.5 / count) - 1.0;
        float through = 1.0;
        float weight = first_weight;
        for (uint group = first; group < groups.count.x && through > 0.0; ++group) {
            uvec4 span = groups.spans[group];
            if (fine_plane(span.x + 1u) >= at.v.z) {
                break;
            }
            uvec4 found = present & groups.masks[group];
            bool hit = false;
            for (uint slice = span.x; slice <= span.y && found != uvec4(0u) && !hit; ++slice) {
                bool set = (found[slice >> 5] >> (slice & 31u) & 1u) != 0u;
                hit = set && fine_plane(slice + 1u) < at.v.z && ray_hits(at, slice, place);
            }
            through *= hit ? 1.0 - weight : 1.0;
            weight = 1.0;
        }
        sum += through;
    }
    return sum / count;
}

float through_slices(Receiver at) {
    uint count = groups.count.x;
    if (count == 0u) {
        return 1.0;
    }
    // All that kernels from the first plane to the receiver can touch.
    Kernel first = kernel_at(at, groups.planes[0].x, groups.planes[0].w);
    Kernel own = kernel_at(at, at.v.z, occlusion_inverse(slice_view, at.v.z));
    vec2 low = min(first.low, own.low);
    vec2 high = max(first.high, own.high);
    uvec4 present = slices_in_box(low, high);
    if (EARLY != 0u && (present == uvec4(0u) || is_empty(low, high))) {
        return 1.0;
    }
    bool with_rays = CONTACT > 0u && FINE > count;
    float product = 1.0;
    float least = 1.0;
    bool anything_nearer = false;
    uint near_group = count;
    float near_weight = 1.0;
    for (uint group = 0u; group < count; ++group) {
        vec4 plane = groups.planes[group];
        if (fine_plane(groups.spans[group].x) >= at.v.z) {
            break;
        }
        if (EARLY != 0u && (present & groups.masks[group]) == uvec4(0u)) {
            continue;
        }
        // The receiver's own surface must not count where texels are too coarse to tell it from a
        // blocker; rays do better there.
        Kernel kernel = kernel_at(at, plane.x, plane.w);
        float fade = clamp((own_nearest(at, kernel) - plane.y) / plane.z, 0.0, 1.0);
        if (with_rays) {
            if (fade < 1.0 && near_group == count) {
                near_group = group;
                near_weight = 1.0 - fade;
            } else if (near_group < count) {
                fade = 0.0;
            }
        }
        if (fade == 0.0) {
            continue;
        }
        // All between the light and the receiver is a long strip where the light shines in flat: most
        // groups hold something there and nothing in their own kernel.
        if (EARLY != 0u && !may_block(group, kernel)) {
            continue;
        }
        vec2 mean = blocked(group, kernel);
        if (COMBINE == COMBINE_CUMULATIVE) {
            float open = 1.0 - mean.y + mean.x;
            product *= open > 0.0 ? 1.0 - fade * min(mean.x / open, 1.0) : 1.0;
        } else if (COMBINE == COMBINE_BOUNDED) {
            float before = anything_nearer ? blocked_before(group, kernel) : 0.0;
            float all_blocked = anything_nearer ? mean.y : mean.x;
            float factor = before < 1.0 ? (1.0 - all_blocked) / (1.0 - before) : 1.0;
            product *= 1.0 - fade * (1.0 - clamp(factor, 0.0, 1.0));
            least = min(least, 1.0 - fade * mean.x);
            anything_nearer = true;
        } else if (COMBINE == COMBINE_SUM) {
            product -= fade * mean.x;
        } else if (COMBINE == COMBINE_MAXIMUM) {
            product = min(product, 1.0 - fade * mean.x);
        } else {
            product *= 1.0 - fade * mean.x;
        }
        if (EARLY != 0u && product <= 0.0) {
            break;
        }
    }
    float seen = clamp(min(product, least), 0.0, 1.0);
    if (near_group < count && seen > 0.0) {
        seen *= through_rays(at, near_group, near_weight, present);
    }
    return seen;
}

// Halves of the box that stands for the light, in the plane through its centre across the view, as
// seen from v: the light's own moments, moved to that plane along v.
vec2 light_halves(vec3 v) {
    if (LIGHT_SHAPE == LIGHT_SUN) {
        return slice_view.half_x.xx * ROUND_KERNEL;
    }
    vec2 slope = v.xy / v.z;
    if (LIGHT_SHAPE == LIGHT_SPHERE) {
        return slice_view.half_x.x * ROUND_KERNEL * sqrt(1.0 + slope * slope);
    }
    vec2 x = slice_view.half_x.xy - slope * slice_view.half_x.z;
    vec2 y = slice_view.half_y.xy - slope * slice_view.half_y.z;
    return sqrt(x * x + y * y) * (LIGHT_SHAPE == LIGHT_DISK ? ROUND_KERNEL : 1.0);
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
    float depth = texelFetch(view_depth, ivec2(pixel), 0).x;
    vec3 n = unpack_unit(texelFetch(geometric_normal, ivec2(pixel), 0).x);
    vec3 p = view.camera.eye.xyz + depth * pixel_ray(view.camera, pixel);
    bool hit = depth > 0.0;
    float above = light_above(view.light, LIGHT_SHAPE, p, n);
    vec3 q = view.light.center.w > 0.0 ? -light_offset(view.light, p) : p;
    vec3 v = axes_of(q);
    bool seen = LIGHT_SHAPE == LIGHT_SUN
        || (v.z > slice_view.range.x && max(abs(v.x), abs(v.y)) <= slice_view.scale.w * v.z);
    if (hit && above > 0.0 && seen) {
        Receiver at = Receiver(v, light_halves(v), axes_of(n), texture_side());
        above = visibility_and(through_slices(at), above, 0.0);
        above = COUNT != 0u ? fetched / 1024.0 : above;
    } else if (FIRST_VIEW == 0u) {
        return;
    }
    imageStore(visibility, ivec2(pixel), vec4(hit ? above : 1.0));
}

#endif
