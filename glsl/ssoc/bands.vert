#version 460
// Bands along silhouette edges: the quads and fans of the occlusion camera (Mo, Popescu, Wyman,
// section 3.2), for one side of the edges. Depth falls from 1 at the edge to 0 at the band's rim, so
// that of bands that overlap the edge wins that comes nearest to hiding the light's centre.

#include "ssoc/params.glsl"

layout(set = 0, binding = 0, std140) uniform Block {
    SsocParams params;
};
layout(set = 0, binding = 1) uniform usampler2D list;
layout(set = 0, binding = 2) uniform usampler2D edges;
layout(set = 0, binding = 3) uniform sampler2D points;
layout(set = 0, binding = 4) uniform usampler2D outlines; // the view's

layout(push_constant) uniform Push {
    vec4 center; // of the light, metres; of a sun the origin
    uint view;
    uint side;   // 0 outer, 1 inner
} push;

#include "ssoc/outline.glsl"

layout(location = 0) out float t;            // along the edge, 0 to 1 between its ends
layout(location = 1) flat out uvec4 places;  // along the edge: whether it is an outline there
layout(location = 2) flat out uvec2 entry;   // texel of the map; number of places

// Vertices of each edge: the band, a strip of a texel on its other side so that no texel centre falls
// between both sides, and a fan of FAN triangles around each end.
const uint FAN = 4u;
const uint VERTICES = 12u + 6u * FAN;

// 1: the bands alone, of the points that have an edge before them and not just an end.
layout(constant_id = 0) const uint BANDS_ALONE = 0u;

uvec4 fetch_edge_texel(ivec2 at) {
    return texelFetch(edges, at, 0);
}

vec4 fetch_point_texel(ivec2 at) {
    return texelFetch(points, at, 0);
}

vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0);
}

void main() {
    const vec2 CORNERS[6] = vec2[](vec2(0.0), vec2(1.0, 0.0), vec2(1.0), vec2(0.0), vec2(1.0), vec2(0.0, 1.0));
    uint vertex = uint(gl_VertexIndex) % VERTICES;
    ivec2 slot = triangle_texel_place(uint(gl_VertexIndex) / VERTICES);
    gl_Position = vec4(2.0, 2.0, 0.0, 1.0);
    t = 0.0;
    entry = uvec2(0u);
    places = texelFetch(outlines, slot, 0);
    if (all(equal(places, uvec4(0u))) || (BANDS_ALONE != 0u && vertex >= 6u)) {
        return;
    }
    uint index = texelFetch(list, slot, 0).x;
    LightView view = params.views[push.view];
    Outline outline = outline_of(view, push.center.xyz, index);
    uint count = outline_places(view, outline);
    bool around_second = vertex >= 12u + 3u * FAN;
    // A fan around an end that is no outline would be all holes.
    if (!outline.shown || (vertex >= 12u && !is_outline(places, count, around_second ? 1.0 : 0.0))) {
        return;
    }
    vec2 p = outline.from;
    vec2 q = outline.to;
    bool perspective = view.forward.w > 0.0;
    float far = perspective ? 1.0 / params.reach.y : params.reach.y;
    vec2 map_size = abs(1.0 / view.scale.xy);
    float texel = max(map_size.x, map_size.y) / float(params.bands.x);
    // Wider than the map is as good as wide as the map.
    vec2 width = clamp(
        vec2(
            penumbra_half_width(params.reach.x, perspective, outline.depths.x, far, p),
            penumbra_half_width(params.reach.x, perspective, outline.depths.y, far, q)
        ),
        params.reach.w * texel,
        2.0 * (map_size.x + map_size.y)
    );
    vec2 across = push.side == 0u ? outline.outward : -outline.outward;
    vec2 along = vec2(outline.outward.y, -outline.outward.x) * (outline.left ? -1.0 : 1.0);
    vec2 corner = CORNERS[vertex % 6u];
    vec2 line = corner.x == 0.0 ? p : q;
    float line_width = corner.x == 0.0 ? width.x : width.y;
    float height = 1.0 - corner.y;
    vec2 place = line + corner.y * line_width * across;
    if (vertex >= 12u) {
        // A quarter of a disk beyond each end; rims a little narrower towards the edge's own line, so
        // that where edges meet the one wins that faces the texel more.
        uint triangle = (vertex - 12u) / 3u;
        uint rim = (vertex - 12u) % 3u;
        float turn = float(triangle % FAN + rim - 1u) / float(FAN);
        float angle = 1.5707963 * turn;
        vec2 way = cos(angle) * across + sin(angle) * (around_second ? along : -along);
        height = rim == 0u ? 1.0 : 0.0;
        place = (around_second ? q : p)
            + (1.0 - height) * (around_second ? width.y : width.x) * (1.0 - 0.1 * turn) * way;
    } else if (vertex >= 6u) {
        height = 1.0 - corner.y * texel / line_width;
        place = line + (corner.x == 0.0 ? -texel : texel) * along - corner.y * texel * across;
    }
    gl_Position = vec4(2.0 * map_of(view, place) - 1.0, height, 1.0);
    float size = distance(p, q);
    t = size > 0.0 ? dot(place - p, along) / size : 0.0;
    entry = uvec2((index + 1u) | (outline.left ? FACES_LEFT : 0u), count);
}
