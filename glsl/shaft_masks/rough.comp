#version 460
// The shafts of the listed tiles whose corners do not tell of all their surfaces, or of the parts of a tile that spans a
// gap in depth. One invocation a tile, without barriers.

#include "shaft_masks/shafts.glsl"

layout(local_size_x = PARTS_A_GROUP) in;

void main() {
    uint index = spread_entry(gl_WorkGroupID.x, gl_NumWorkGroups.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (index >= arguments.count) {
        return;
    }
    uvec2 size = params.counts.xy;
    uvec2 tiles = (size + TILE_SIZE - 1u) / TILE_SIZE;
    uvec2 tile = tile_of_entry(texelFetch(list, tile_entry_place(index, tiles), 0).x, tiles);
    Light light = view.light;
    vec3 eye = view.camera.eye.xyz;

    // The gap in the middle of the depths of surfaces that are not turned away, if there is room for one.
    TileBounds bounds = fetch_bounds(tile);
    float width = bounds.nearest * float(TILE_SIZE) * length(view.camera.pixel_right.xyz);
    bool is_deep = bounds.farthest - bounds.nearest > width || !bounds.all_hit;
    uint looks = is_deep && !bounds.one_triangle ? TILE_SIZE * TILE_SIZE : 0u;
    // Normals are looked at where some of them may be turned away.
    vec3 near_light = light_offset(light, eye + bounds.farthest * pixel_ray(view.camera, tile * TILE_SIZE));
    bool turns = MOST_PARTS > 1u && -most_along(bounds.normal_low, bounds.normal_high, -near_light) < 0.0;
    uint normal_looks = turns ? looks : 0u;
    float nearest = turns ? FAR : bounds.nearest;
    float farthest = turns ? 0.0 : bounds.farthest;
    uvec2 seen = uvec2(turns ? 0u : ~0u);
    for (uint i = 0u; i < normal_looks; ++i) {
        uvec2 pixel = min(tile * TILE_SIZE + uvec2(i % TILE_SIZE, i / TILE_SIZE), size - 1u);
        float depth = imageLoad(view_depth, ivec2(pixel)).x;
        vec3 ray = pixel_ray(view.camera, pixel);
        bool counts = depth > 0.0
            && !is_turned_away(light, eye + depth * ray, fetch_normal(imageLoad(ids, ivec2(pixel)).x, ray));
        nearest = counts ? min(nearest, depth) : nearest;
        farthest = counts ? max(farthest, depth) : farthest;
        uint bit = counts ? 1u << (i & 31u) : 0u;
        seen |= i < 32u ? uvec2(bit, 0u) : uvec2(0u, bit);
    }
    float middle = 0.5 * nearest + 0.5 * farthest;
    float before_gap = 0.0;
    float after_gap = FAR;
    uvec2 at_near = tile * TILE_SIZE;
    uvec2 at_far = tile * TILE_SIZE;
    for (uint i = 0u; i < looks; ++i) {
        uvec2 pixel = min(tile * TILE_SIZE + uvec2(i % TILE_SIZE, i / TILE_SIZE), size - 1u);
        bool counts = ((i < 32u ? seen.x : seen.y) >> (i & 31u) & 1u) != 0u;
        float depth = imageLoad(view_depth, ivec2(pixel)).x;
        counts = counts && depth > 0.0;
        depth = counts ? depth : -1.0;
        at_near = depth < middle && depth > before_gap ? pixel : at_near;
        before_gap = depth < middle ? max(before_gap, depth) : before_gap;
        after_gap = counts && depth >= middle ? min(after_gap, depth) : after_gap;
        at_far = depth == farthest ? pixel : at_far;
    }
    float gap = after_gap - before_gap;
    bool both = before_gap > 0.0 && after_gap < FAR;
    bool split = MOST_PARTS > 1u && both && gap > width && gap > LEAST_GAP * (farthest - nearest);
    bool behind = false;
    bool again;
    do {
        vec2 depths = behind ? vec2(after_gap, FAR) : vec2(0.0, split ? after_gap : FAR);
        store_shaft(light, tile, tiles, bounds, depths, split && !behind ? at_near : at_far, behind,
            TILE_SIZE);
        again = split && !behind;
        behind = true;
    } while (again);
}
