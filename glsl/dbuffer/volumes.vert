#version 460
// One surface of the volumes of silhouette edges, seen from the light's centre: quads extruded from the
// two points of the light whose planes through the edge touch it, half disks at the edge's ends, in which
// the volume is a cone, and silhouette faces for what neither volume covers.
//
// Rays of the view run from the light's centre, and so it does not matter how far along them a vertex
// stands: all are at the depth of their end of the edge, and as far aside as the volume is where it
// reaches the farthest receiver. Fragments find the surface.

#include "dbuffer/volumes.glsl"
#include "silhouettes/edges.glsl"

layout(set = 0, binding = 0, std140) uniform Block {
    BufferParams params;
};
layout(set = 0, binding = 1) uniform usampler2D list;
layout(set = 0, binding = 2) uniform usampler2D edges;
layout(set = 0, binding = 3) uniform sampler2D points;

layout(push_constant) uniform Push {
    uint view;
    uint umbra;   // 1: the umbra's surface, 0: the penumbra's
    uint layer;   // surfaces drawn before
    uint arcs;    // 1: close the volume at the ends of edges
} push;

layout(location = 0) flat out vec3 first;   // both ends, light's frame; of a face its corners, scene space
layout(location = 1) flat out vec3 second;
layout(location = 2) flat out vec3 third;   // xy: the point of the light that a quad is extruded from
layout(location = 3) flat out vec3 forward; // z of the light's frame
layout(location = 4) flat out uvec3 entry;  // one more than the edge, its blocker, kind

const uint VERTICES = 30u;

// Texels across the edge that a surface starts before it: a receiver's texel may lie that far.
const float WIDER_TEXELS = 1.5;

// Edges nearer to the light than this part of the farthest receiver's distance are cut off.
const float NEAR = 1.0e-4;

// Rounding of heights over planes, as a part of the lengths.
const float ROUNDING = 1.0e-6;

uvec4 fetch_edge_texel(ivec2 place) {
    return texelFetch(edges, place, 0);
}

vec4 fetch_point_texel(ivec2 place) {
    return texelFetch(points, place, 0);
}

vec4 fetch_triangle_texel(uint texel) {
    return vec4(0.0);
}

bool tangent_points(vec3 a, vec3 along, out vec2 points_on[2]) {
    float radius = params.center.w;
    vec3 moment = SUN ? vec3(-along.y, along.x, 0.0) : cross(a, along);
    vec2 q = vec2(-moment.y, moment.x);
    float square = dot(q, q);
    float rise = radius * along.z;
    float rest = 1.0 - rise * rise / square;
    vec2 middle = radius * rise / square * q;
    vec2 aside = radius * sqrt(max(rest, 0.0)) * inversesqrt(square) * vec2(-q.y, q.x);
    points_on[0] = middle + aside;
    points_on[1] = middle - aside;
    return square > 0.0 && rest >= 0.0;
}

// Whether a face is on the side that the surface needs: beyond the plane from the light's centre for the
// penumbra, on the centre's side for the umbra. Twin of the rule in silhouettes/classify.comp, without normals.
bool face_fits(uint corner, vec3 origin, mat3 frame, vec3 a, vec3 normal, float center_side) {
    vec3 across = frame * (fetch_point(corner).xyz - origin) - a;
    float side = dot(normal, across) * center_side;
    side = push.umbra != 0u ? -side : side;
    return side <= ROUNDING * length(normal) * length(across) * abs(center_side);
}

bool faces_fit(uvec4 edge, vec3 origin, mat3 frame, vec3 a, vec3 along, vec2 p) {
    vec3 normal = cross(along, way_from(p, a));
    float center_side = SUN ? -normal.z : -dot(normal, a);
    bool fit = face_fits(edge.z, origin, frame, a, normal, center_side);
    if (edge.w < MORE_FACES) {
        fit = fit && face_fits(edge.w, origin, frame, a, normal, center_side);
    } else if (edge.w != NO_POINT) {
        uint place = edge.w & ~MORE_FACES;
        uvec4 more;
        do {
            more = fetch_edge(place);
            for (uint i = 0u; i < more.w >> 1; ++i) {
                fit = fit && face_fits(more[i], origin, frame, a, normal, center_side);
            }
            place += 1u;
        } while ((more.w & 1u) != 0u);
    }
    return fit;
}

// Offset q from the light's centre, of a sun from the origin of scene space.
vec4 position_of(vec3 q) {
    LightView light_view = params.views[push.view];
    vec3 v = vec3(dot(q, light_view.right.xyz), dot(q, light_view.up.xyz), dot(q, light_view.forward.xyz));
    float w = SUN ? 1.0 : v.z;
    vec2 map = (v.xy - vec2(light_view.right.w, light_view.up.w) * w) * light_view.scale.xy;
    return vec4(2.0 * map - w, 0.5 * w, w);
}

// How far a volume has spread when it reaches the farthest receiver, as seen at an end of the edge.
float spread(vec3 end) {
    float far = params.axis_x.w;
    return SUN ? max(far - end.z, 0.0) : max(1.0 - end.z / far, 0.0);
}

float texel_at(vec3 end) {
    LightView light_view = params.views[push.view];
    float texel = max(abs(1.0 / light_view.scale.x), abs(1.0 / light_view.scale.y)) / float(params.counts.y);
    return SUN ? texel : texel * end.z;
}

void main() {
    const vec2 CORNERS[6] = vec2[](vec2(0.0), vec2(1.0, 0.0), vec2(1.0), vec2(0.0), vec2(1.0), vec2(0.0, 1.0));
    uint vertex = uint(gl_VertexIndex) % VERTICES;
    uint number = texelFetch(list, triangle_texel_place(uint(gl_VertexIndex) / VERTICES), 0).x;
    uvec4 edge = fetch_edge(number);
    vec4 start = fetch_point(edge.x);
    vec3 origin = params.center.xyz;
    vec3 world_a = start.xyz - origin;
    vec3 world_b = fetch_point(edge.y).xyz - origin;
    gl_Position = vec4(2.0, 2.0, 0.0, 1.0);
    first = vec3(0.0);
    second = vec3(0.0);
    third = vec3(0.0);
    vec3 middle = world_a + world_b;
    forward = LIGHT_SHAPE == LIGHT_SPHERE ? normalize(middle) : params.axis_z.xyz;
    entry = uvec3(number + 1u, uint(start.w), FACE);
    if (vertex >= 24u) {
        uint corner = vertex < 27u ? edge.z : edge.w;
        if (push.umbra == 0u || push.layer > 0u || corner >= MORE_FACES) {
            return;
        }
        vec3 world_c = fetch_point(corner).xyz - origin;
        if (is_silhouette_face(world_a, world_b, world_c, forward, params.center.w)) {
            first = world_a;
            second = world_b;
            third = world_c;
            uint at = vertex % 3u;
            gl_Position = position_of(at == 0u ? world_a : (at == 1u ? world_b : world_c));
        }
        return;
    }
    mat3 frame = light_frame(params, forward);
    vec3 a = frame * world_a;
    vec3 b = frame * world_b;
    if (!SUN) {
        float near = NEAR * params.axis_x.w;
        if (max(a.z, b.z) <= near) {
            return;
        }
        float part = (near - a.z) / (b.z - a.z);
        vec3 cut = mix(a, b, part);
        a = a.z < near ? cut : a;
        b = b.z < near ? cut : b;
    }
    vec2 touching[2];
    if (!tangent_points(a, b - a, touching)) {
        return;
    }
    bvec2 fit = bvec2(
        faces_fit(edge, origin, frame, a, b - a, touching[0]),
        faces_fit(edge, origin, frame, a, b - a, touching[1])
    );
    first = a;
    second = b;
    vec2 corner = CORNERS[vertex % 6u];
    if (vertex < 12u) {
        bool one = vertex < 6u;
        vec2 p = one ? touching[0] : touching[1];
        vec3 end = corner.x == 0.0 ? a : b;
        vec2 back = WIDER_TEXELS * texel_at(end) * normalize(p);
        third = vec3(p, 0.0);
        entry.z = QUAD;
        if (one ? fit.x : fit.y) {
            vec2 at = end.xy + mix(back, -spread(end) * p, corner.y);
            gl_Position = position_of(transpose(frame) * vec3(at, end.z));
        }
    } else if (any(fit) && push.arcs != 0u) {
        vec3 end = vertex < 18u ? a : b;
        entry.z = vertex < 18u ? FIRST_END : SECOND_END;
        vec2 at = end.xy + (2.0 * corner - 1.0) * params.center.w * spread(end);
        gl_Position = position_of(transpose(frame) * vec3(at, end.z));
    }
}
