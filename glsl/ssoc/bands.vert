#version 460
// Bands along silhouette edges: the quads and fans of the occlusion camera (Mo, Popescu, Wyman,
// section 3.2). Six vertices for the outer side of an edge, six for the inner one, which goes to the
// right half of the image. Rectangles reach beyond both ends; the fragment shader rounds them.

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
} push;

layout(location = 0) out vec2 place;        // in the view's units
layout(location = 1) flat out vec4 ends;    // of the edge, in the view's units
layout(location = 2) flat out vec4 depths;  // of both ends, inverse in a perspective view; outward normal
layout(location = 3) flat out uvec2 number; // one more than the edge's; 0 outer, 1 inner side

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

// Which side of the edge a face is on.
float face_side(bool perspective, vec3 a, vec3 b, vec3 face) {
    return perspective ? dot(cross(a, b), face) : cross(b - a, face - a).z;
}

void main() {
    const vec2 CORNERS[6] = vec2[](vec2(0.0), vec2(1.0, 0.0), vec2(1.0), vec2(0.0), vec2(1.0), vec2(0.0, 1.0));
    uint entry = uint(gl_VertexIndex) / 12u;
    uint vertex = uint(gl_VertexIndex) % 12u;
    uint side = vertex / 6u;
    vec2 corner = CORNERS[vertex % 6u];
    uint index = texelFetch(list, triangle_texel_place(entry), 0).x;
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
    number = uvec2(0u);
    if (perspective) {
        if (max(a.z, b.z) <= near) {
            return;
        }
        a = a.z < near ? mix(b, a, (b.z - near) / (b.z - a.z)) : a;
        b = b.z < near ? mix(a, b, (a.z - near) / (a.z - b.z)) : b;
    }
    vec2 p = perspective ? a.xy / a.z : a.xy;
    vec2 q = perspective ? b.xy / b.z : b.xy;
    vec2 depth = perspective ? 1.0 / vec2(a.z, b.z) : vec2(a.z, b.z);
    float far = perspective ? 1.0 / params.reach.y : params.reach.y;
    float size_texels = float(params.counts.y);
    float texel = max(abs(1.0 / view.scale.x), abs(1.0 / view.scale.y)) / size_texels;
    float width = max(
        penumbra_half_width(params.reach.x, perspective, depth.x, far, p),
        penumbra_half_width(params.reach.x, perspective, depth.y, far, q)
    );
    width = max(width, params.reach.w * texel);
    vec2 along = q - p;
    float size = length(along);
    along = size > 0.0 ? along / size : vec2(1.0, 0.0);
    vec2 outward = vec2(-along.y, along.x) * (faces > 0.0 ? -1.0 : 1.0);
    // A texel beyond the edge itself, so that no texel centre falls between both sides.
    float across = mix(-texel, width, corner.y) * (side == 0u ? 1.0 : -1.0);
    place = mix(p - width * along, q + width * along, corner.x) + across * outward;
    vec2 map = (place - vec2(view.right.w, view.up.w)) * view.scale.xy;
    gl_Position = vec4(map.x + float(side) - 1.0, 2.0 * map.y - 1.0, 0.0, 1.0);
    ends = vec4(p, q);
    depths = vec4(depth, outward);
    number = uvec2(index + 1u, side);
}
