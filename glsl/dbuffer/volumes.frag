#version 460
// Where a ray from the light's centre meets a surface of the volumes, and how far the silhouette is.
// Distances are found for each ray: interpolated over large surfaces they are off, as published.

#include "common/triangles.glsl"
#include "dbuffer/volumes.glsl"

layout(set = 0, binding = 0, std140) uniform Block {
    BufferParams params;
};
layout(set = 0, binding = 4) uniform usampler2D seen;    // triangles that the light's centre sees
layout(set = 0, binding = 5) uniform sampler2D triangles;
layout(set = 0, binding = 6) uniform sampler2D before;   // stored depth of the surface drawn before
layout(set = 0, binding = 7) uniform usampler2D before_texels; // and what was stored with it

layout(push_constant) uniform Push {
    uint view;
    uint umbra;
    uint layer;
    uint arcs;
    uint edges;    // 1: store edges, 0: distances
    uint greatest; // 1: the surface farthest from the light first, 0: the nearest
    uint darkest;  // 1: one surface of each blocker, as far as the layer before tells
} push;

layout(location = 0) flat in vec3 first;
layout(location = 1) flat in vec3 second;
layout(location = 2) flat in vec3 third;
layout(location = 3) flat in vec3 forward;
layout(location = 4) flat in uvec3 entry;

layout(location = 0) out uvec2 texel;

vec4 fetch_triangle_texel(uint number) {
    return texelFetch(triangles, triangle_texel_place(number), 0);
}

bool has_corner(vec3 p, vec3 corners[3]) {
    return p == corners[0] || p == corners[1] || p == corners[2];
}

// Whether the light's centre sees the face itself here: then it looks at its front, and the umbra begins
// at the face's far edge.
bool center_sees_face(ivec2 place) {
    uint id = texelFetch(seen, place, 0).x;
    if (id == 0u) {
        return false;
    }
    vec3 corners[3];
    for (uint i = 0u; i < 3u; ++i) {
        corners[i] = fetch_corner(id - 1u, i).position - params.center.xyz;
    }
    return has_corner(first, corners) && has_corner(second, corners) && has_corner(third, corners);
}

void main() {
    LightView light_view = params.views[push.view];
    vec2 map = gl_FragCoord.xy / float(params.counts.y);
    vec2 at = map / light_view.scale.xy + vec2(light_view.right.w, light_view.up.w);
    vec3 ray = at.x * light_view.right.xyz + at.y * light_view.up.xyz;
    ray = SUN ? ray : normalize(ray + light_view.forward.xyz);
    float radius = params.center.w;
    // Distances from the centre along the ray, of a sun depths along its direction.
    float surface = 0.0;
    float silhouette = 0.0;
    if (entry.z == FACE) {
        vec3 n = cross(second - first, third - first);
        vec3 way = SUN ? params.axis_z.xyz : ray;
        vec3 to = SUN ? first - ray : first;
        surface = dot(n, to) / dot(n, way);
        silhouette = surface;
        if (center_sees_face(ivec2(gl_FragCoord.xy))) {
            discard;
        }
    } else {
        vec3 local = light_frame(params, forward) * ray;
        float slant = SUN ? 1.0 : 1.0 / local.z;
        vec2 aside = local.xy * slant; // at depth 1, of a sun at any
        if (!(slant > 0.0)) {
            discard;
        }
        if (entry.z == QUAD) {
            vec2 p = third.xy;
            vec3 along = second - first;
            vec3 way = way_from(p, first);
            vec3 n = cross(along, way);
            surface = SUN
                ? (dot(n, first) - dot(n.xy, aside)) / n.z
                : dot(n, first) / dot(n, vec3(aside, 1.0));
            vec3 place = SUN ? vec3(aside, surface) : surface * vec3(aside, 1.0);
            vec3 across = cross(n, along);
            silhouette = SUN
                ? surface - dot(across, place - first) / dot(across, way)
                : surface * dot(across, first - vec3(p, 0.0)) / dot(across, place - vec3(p, 0.0));
        } else {
            vec3 end = entry.z == FIRST_END ? first : second;
            vec3 other = entry.z == FIRST_END ? second : first;
            vec2 out_of = end.xy - (SUN ? other.xy : other.xy * (end.z / other.z));
            vec2 apart = (SUN ? aside : aside * end.z) - end.xy;
            float part = length(apart) / max(radius, 1.0e-30);
            if (dot(apart, out_of) < 0.0 || (!SUN && part >= 1.0)) {
                discard;
            }
            silhouette = end.z;
            surface = SUN ? end.z + part : end.z / (1.0 - part);
        }
        surface *= slant;
        silhouette *= slant;
    }
    float begin = params.axis_y.w;
    float depth = SUN
        ? 1.0 - 0.5 * (surface - begin) / max(params.axis_x.w - begin, 1.0e-30)
        : begin / surface;
    if (!(depth > 0.0)) {
        discard;
    }
    depth = min(depth, 1.0);
    if (push.greatest != 0u) {
        // What closes the volume counts only where there is no quad.
        depth = entry.z == QUAD ? 0.5 * depth : 0.5 + 0.4999 * depth;
    }
    if (entry.z == FACE && push.greatest != 0u) {
        // Only where there is no surface.
        depth = 0.99999994;
    }
    if (push.layer > 0u) {
        float last = texelFetch(before, ivec2(gl_FragCoord.xy), 0).x;
        uint last_blocker = texelFetch(before_texels, ivec2(gl_FragCoord.xy), 0).y & 0xffffu;
        bool again = push.darkest != 0u && last_blocker == (entry.y & 0xffffu);
        if (again || (push.greatest != 0u ? depth <= last : depth >= last)) {
            discard;
        }
    }
    gl_FragDepth = depth;
    float from = SUN ? begin : 0.0;
    float part = clamp((silhouette - from) / max(surface - from, 1.0e-30), 0.0, 1.0);
    uint blocker = entry.z == FACE ? 0xffffu : entry.y & 0xffffu;
    texel = push.edges != 0u
        ? uvec2(entry.z == FACE ? NO_EDGE : entry.x, entry.y)
        : uvec2(max(floatBitsToUint(surface - from), 1u), uint(part * MOST_PART + 0.5) << 16 | blocker);
}
