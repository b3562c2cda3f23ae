#version 460
// Bands along silhouette edges: the quads and fans of the occlusion camera (Mo, Popescu, Wyman,
// section 3.2), for one side of the edges. Depth falls from 1 at the edge to 0 at the band's rim, so
// that of bands that overlap the edge wins that comes nearest to hiding the light's centre.

#include "silhouettes/edges.glsl"
#include "ssoc/params.glsl"

layout(set = 0, binding = 0, std140) uniform Block {
    SsocParams params;
};
layout(set = 0, binding = 1) uniform usampler2D list;
layout(set = 0, binding = 2) uniform usampler2D edges;
layout(set = 0, binding = 3) uniform sampler2D points;

layout(push_constant) uniform Push {
    vec4 center; // of the light, metres; of a sun the origin
    uint view;
    uint side;   // 0 outer, 1 inner
} push;

layout(location = 0) out vec2 place;        // in the view's units
layout(location = 1) flat out vec4 ends;    // of the edge, in the view's units
layout(location = 2) flat out vec4 depths;  // of both ends, inverse in a perspective view; outward normal
layout(location = 3) flat out uint entry;   // texel of the map

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

vec3 in_view(LightView view, uint point) {
    vec3 q = fetch_point(point).xyz - push.center.xyz;
    return vec3(dot(q, view.right.xyz), dot(q, view.up.xyz), dot(q, view.forward.xyz));
}

// Which side of the edge a face is on: sine of the angle between the planes through edge and light
// and through edge and face, about.
float face_side(bool perspective, vec3 a, vec3 b, vec3 face) {
    vec3 across = perspective ? cross(a, b) : vec3(a.y - b.y, b.x - a.x, 0.0);
    vec3 way = face - a;
    return dot(across, way) / max(length(across) * length(way), 1.0e-37);
}

void main() {
    const vec2 CORNERS[6] = vec2[](vec2(0.0), vec2(1.0, 0.0), vec2(1.0), vec2(0.0), vec2(1.0), vec2(0.0, 1.0));
    uint vertex = uint(gl_VertexIndex) % VERTICES;
    uint index = texelFetch(list, triangle_texel_place(uint(gl_VertexIndex) / VERTICES), 0).x;
    uvec4 edge = fetch_edge(index);
    LightView view = params.views[push.view];
    bool perspective = view.forward.w > 0.0;
    vec3 a = in_view(view, edge.x);
    vec3 b = in_view(view, edge.y);
    float faces = face_side(perspective, a, b, in_view(view, edge.z));
    if (edge.w < MORE_FACES) {
        float other = face_side(perspective, a, b, in_view(view, edge.w));
        faces = abs(other) > abs(faces) ? other : faces;
    }
    float near = params.reach.z;
    gl_Position = vec4(2.0, 2.0, 0.0, 1.0);
    place = vec2(0.0);
    ends = vec4(0.0);
    depths = vec4(0.0);
    entry = 0u;
    // Where the light's centre lies in all of its faces' planes, an edge has no side.
    if (abs(faces) < 1.0e-5 || !clip_edge(view, near, a, b) || (BANDS_ALONE != 0u && vertex >= 6u)) {
        return;
    }
    vec2 p = perspective ? a.xy / a.z : a.xy;
    vec2 q = perspective ? b.xy / b.z : b.xy;
    vec2 depth = perspective ? 1.0 / vec2(a.z, b.z) : vec2(a.z, b.z);
    float far = perspective ? 1.0 / params.reach.y : params.reach.y;
    vec2 map_size = abs(1.0 / view.scale.xy);
    float texel = max(map_size.x, map_size.y) / float(params.bands.x);
    // Wider than the map is as good as wide as the map.
    vec2 width = clamp(
        vec2(
            penumbra_half_width(params.reach.x, perspective, depth.x, far, p),
            penumbra_half_width(params.reach.x, perspective, depth.y, far, q)
        ),
        params.reach.w * texel,
        2.0 * (map_size.x + map_size.y)
    );
    vec2 along = q - p;
    float size = length(along);
    along = size > 0.0 ? along / size : vec2(1.0, 0.0);
    vec2 outward = vec2(-along.y, along.x) * (faces > 0.0 ? -1.0 : 1.0);
    vec2 across = push.side == 0u ? outward : -outward;
    vec2 corner = CORNERS[vertex % 6u];
    vec2 line = corner.x == 0.0 ? p : q;
    float line_width = corner.x == 0.0 ? width.x : width.y;
    float height = 1.0 - corner.y;
    place = line + corner.y * line_width * across;
    if (vertex >= 12u) {
        // A quarter of a disk beyond each end; rims a little narrower towards the edge's own line, so
        // that where edges meet the one wins that faces the texel more.
        uint triangle = (vertex - 12u) / 3u;
        uint rim = (vertex - 12u) % 3u;
        bool second = triangle >= FAN;
        float turn = float(triangle % FAN + rim - 1u) / float(FAN);
        float angle = 1.5707963 * turn;
        vec2 way = cos(angle) * across + sin(angle) * (second ? along : -along);
        height = rim == 0u ? 1.0 : 0.0;
        place = (second ? q : p) + (1.0 - height) * (second ? width.y : width.x) * (1.0 - 0.1 * turn) * way;
    } else if (vertex >= 6u) {
        height = 1.0 - corner.y * texel / line_width;
        place = line + (corner.x == 0.0 ? -texel : texel) * along - corner.y * texel * across;
    }
    gl_Position = vec4(2.0 * map_of(view, place) - 1.0, height, 1.0);
    ends = vec4(p, q);
    depths = vec4(depth, outward);
    entry = (index + 1u) | (faces > 0.0 ? FACES_LEFT : 0u);
}
