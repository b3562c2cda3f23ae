// The texels whose centres a triangle covers as the light sees it, with the depths there: what
// `count.comp` and `fill.comp` share. One invocation looks at one triangle.
#ifndef ANTUMBRA_MDI_COVERAGE_GLSL
#define ANTUMBRA_MDI_COVERAGE_GLSL

#include "common/holes.glsl"
#include "mdi/params.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std140) uniform MdiBlock {
    MdiParams params;
};
layout(set = 0, binding = 1) uniform sampler2D triangles;
layout(set = 0, binding = 2) uniform sampler2D materials;
layout(set = 0, binding = 3) uniform sampler2D triangle_uvs;
layout(set = 0, binding = 4) uniform sampler2D footprints;

layout(push_constant) uniform Push {
    uint view;
    uint groups_across;
    uint count;
    uint unused;
    uvec2 runs[14]; // of triangles. x: the invocation that it ends before, y: added to their numbers
} push;

// 1 where triangles of the scene may have holes.
layout(constant_id = 0) const uint MASKED = 0u;

vec4 fetch_triangle_texel(uint texel) {
    return texelFetch(triangles, triangle_texel_place(texel), 0);
}

vec4 fetch_material_texel(ivec2 place) {
    return texelFetch(materials, place, 0);
}

vec4 fetch_uv_texel(ivec2 place) {
    return texelFetch(triangle_uvs, place, 0);
}

vec4 fetch_footprint(ivec2 place) {
    return texelFetch(footprints, place, 0);
}

// Of a depth along the view, metres: what `place_of` takes.
float depth_s(float z) {
    return params.views[push.view].forward.w > 0.0 ? 1.0 / z : -z;
}

// Defined by the entry file. nearest, farthest: depths along the view between which the triangle
// lies within the texel, metres; z: at its centre.
void cover_texel(ivec2 texel, float z, float nearest, float farthest);

// A corner in a view: texels across and down, and what is affine in them: 1 / z, of a sun z.
vec3 corner_in_view(LightView light_view, vec3 v, float size) {
    bool perspective = light_view.forward.w > 0.0;
    vec2 at = perspective ? v.xy / v.z : v.xy;
    at = (at - vec2(light_view.right.w, light_view.up.w)) * light_view.scale.xy * size;
    return vec3(at, perspective ? 1.0 / v.z : v.z);
}

// A triangle in texels of a view.
struct Shape {
    vec3 a;
    vec3 b;
    vec3 c;
    ivec2 first; // texels whose centres it may cover
    ivec2 last;
    bool holes;  // alpha may cut some
    vec4 plane;  // xyz: unit normal along the axes of the view, w: dot product with any point
};

Shape shape_of(vec3 a, vec3 b, vec3 c, bool holes, vec4 plane) {
    float size = float(params.counts.y);
    vec2 low = min(a.xy, min(b.xy, c.xy));
    vec2 high = max(a.xy, max(b.xy, c.xy));
    // Centres of texels lie at whole numbers and a half.
    ivec2 first = ivec2(clamp(ceil(low - 0.5), 0.0, size));
    ivec2 last = ivec2(clamp(floor(high - 0.5), -1.0, size - 1.0));
    return Shape(a, b, c, first, last, holes, plane);
}

float cross_2d(vec2 a, vec2 b) {
    return a.x * b.y - a.y * b.x;
}

// Narrows a row's texels to those on the inner side of an edge, but for a texel of rounding.
void cut_row(inout ivec2 range, vec2 from, vec2 along, float y, float turn) {
    // cross(along, (x, y) - from) * turn >= 0
    float slope = -along.y * turn;
    float constant = (along.x * (y - from.y) + along.y * from.x) * turn;
    float at = clamp(-constant / slope, -1.0e6, 1.0e6);
    range.x = slope > 0.0 ? max(range.x, int(floor(at - 0.5)) - 1) : range.x;
    range.y = slope < 0.0 ? min(range.y, int(ceil(at - 0.5)) + 1) : range.y;
}

void cover_row(uint triangle, Shape shape, int y) {
    vec3 a = shape.a;
    vec3 b = shape.b;
    vec3 c = shape.c;
    float area = cross_2d(b.xy - a.xy, c.xy - a.xy);
    if (y < shape.first.y || y > shape.last.y || area == 0.0) {
        return;
    }
    float turn = area > 0.0 ? 1.0 : -1.0;
    // The plane rather than the corners: those of a large triangle round off its depths.
    LightView light_view = params.views[push.view];
    bool perspective = light_view.forward.w > 0.0;
    vec2 scale = light_view.scale.xy * float(params.counts.y);
    vec2 corner = vec2(light_view.right.w, light_view.up.w);
    vec4 plane = shape.plane;
    vec2 slope = (perspective ? plane.xy / plane.w : -plane.xy / plane.z) / scale;
    float reach = 0.5 * (abs(slope.x) + abs(slope.y));
    float least = min(a.z, min(b.z, c.z));
    float most = max(a.z, max(b.z, c.z));
    ivec2 range = ivec2(shape.first.x, shape.last.x);
    float middle = float(y) + 0.5;
    cut_row(range, b.xy, c.xy - b.xy, middle, turn);
    cut_row(range, c.xy, a.xy - c.xy, middle, turn);
    cut_row(range, a.xy, b.xy - a.xy, middle, turn);
    for (int x = range.x; x <= range.y; ++x) {
        vec2 p = vec2(float(x) + 0.5, middle);
        precise float u = cross_2d(c.xy - b.xy, p - b.xy) * turn;
        precise float v = cross_2d(a.xy - c.xy, p - c.xy) * turn;
        precise float w = cross_2d(b.xy - a.xy, p - a.xy) * turn;
        bool covered = u >= 0.0 && v >= 0.0 && w >= 0.0;
        float across = dot(plane.xy, p / scale + corner);
        float at = perspective ? (across + plane.z) / plane.w : (plane.w - across) / plane.z;
        at = clamp(at, least, most);
        if (MASKED != 0u && covered && shape.holes) {
            vec3 weights = vec3(u, v, w) / max(abs(area), 1.0e-38);
            if (perspective) {
                // Weights in space from weights in the image.
                weights *= vec3(a.z, b.z, c.z);
                weights /= weights.x + weights.y + weights.z;
            }
            float stored = fetch_triangle_texel(4u * triangle + 3u).w;
            covered = !is_hole(material_number(stored), fetch_uv(triangle, weights));
        }
        if (covered) {
            float from = clamp(at - reach, least, most);
            float to = clamp(at + reach, least, most);
            vec3 z = perspective ? vec3(1.0 / at, 1.0 / to, 1.0 / from) : vec3(at, from, to);
            cover_texel(ivec2(x, y), z.x, z.y, z.z);
        }
    }
}

// Corners along the axes of the view, metres from its origin.
vec3[3] corners_of(uint triangle, LightView light_view) {
    vec3 v[3];
    for (uint i = 0u; i < 3u; ++i) {
        vec3 p = fetch_corner(triangle, i).position - params.origin.xyz;
        v[i] = vec3(dot(p, light_view.right.xyz), dot(p, light_view.up.xyz),
            dot(p, light_view.forward.xyz));
    }
    return v;
}

vec4 plane_of(uint triangle, LightView light_view, vec3 point) {
    vec3 n = fetch_geometric_normal(triangle);
    n = vec3(dot(n, light_view.right.xyz), dot(n, light_view.up.xyz),
        dot(n, light_view.forward.xyz));
    return vec4(n, dot(n, point));
}

bool has_holes(uint triangle) {
    return MASKED != 0u && material_is_masked(fetch_triangle_texel(4u * triangle + 3u).w);
}

// Texels around a triangle that one invocation looks at; larger ones have an invocation a row.
const int MOST_TEXELS = 2048;

// Covers a small triangle; true for one that is left to `cover_large`.
bool cover_small(uint triangle) {
    LightView light_view = params.views[push.view];
    float nearest = params.nearest[push.view].x;
    float size = float(params.counts.y);
    vec3 v[3] = corners_of(triangle, light_view);
    bvec3 behind = lessThan(vec3(v[0].z, v[1].z, v[2].z), vec3(nearest));
    if (any(behind)) {
        return !all(behind);
    }
    Shape shape = shape_of(corner_in_view(light_view, v[0], size),
        corner_in_view(light_view, v[1], size), corner_in_view(light_view, v[2], size),
        has_holes(triangle), plane_of(triangle, light_view, v[0]));
    ivec2 span = max(shape.last - shape.first + 1, 0);
    if (span.x * span.y > MOST_TEXELS) {
        return true;
    }
    for (int y = shape.first.y; y <= shape.last.y; ++y) {
        cover_row(triangle, shape, y);
    }
    return false;
}

// Covers one row of a triangle that may reach behind the light.
void cover_large(uint triangle, int y) {
    LightView light_view = params.views[push.view];
    float nearest = params.nearest[push.view].x;
    float size = float(params.counts.y);
    vec3 v[3] = corners_of(triangle, light_view);
    bvec3 behind = lessThan(vec3(v[0].z, v[1].z, v[2].z), vec3(nearest));
    // The odd one out comes first.
    int odd = behind.x == behind.y ? 2 : behind.x == behind.z ? 1 : 0;
    vec3 a = odd == 0 ? v[0] : odd == 1 ? v[1] : v[2];
    vec3 b = odd == 0 ? v[1] : odd == 1 ? v[2] : v[0];
    vec3 c = odd == 0 ? v[2] : odd == 1 ? v[0] : v[1];
    bool cut = any(behind);
    bool odd_behind = a.z < nearest;
    // Holes are not looked for in cut triangles: their corners have no texture coordinates.
    vec3 ab = mix(a, b, (nearest - a.z) / (b.z - a.z));
    vec3 ac = mix(a, c, (nearest - a.z) / (c.z - a.z));
    vec3 first = !cut ? v[0] : odd_behind ? vec3(ab.xy, nearest) : a;
    vec3 second = !cut ? v[1] : odd_behind ? b : vec3(ab.xy, nearest);
    vec3 third = !cut ? v[2] : odd_behind ? c : vec3(ac.xy, nearest);
    bool holes = !cut && has_holes(triangle);
    vec4 plane = plane_of(triangle, light_view, v[0]);
    int parts = cut && odd_behind ? 2 : 1;
    for (int part = 0; part < parts; ++part) {
        Shape shape = shape_of(corner_in_view(light_view, first, size),
            corner_in_view(light_view, second, size), corner_in_view(light_view, third, size),
            holes, plane);
        cover_row(triangle, shape, y);
        second = third;
        third = vec3(ac.xy, nearest);
    }
}

// The triangle of an invocation of `cover_small`; false if there is none.
bool invocation_triangle(out uint triangle) {
    uint group = gl_WorkGroupID.y * push.groups_across + gl_WorkGroupID.x;
    uint invocation = group * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    uint run = 0u;
    while (run < push.count && invocation >= push.runs[run].x) {
        ++run;
    }
    triangle = run < push.count ? invocation + push.runs[run].y : 0u;
    return run < push.count;
}

#endif
