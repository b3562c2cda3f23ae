// Umbra and penumbra volumes of silhouette edges (Jakobsen et al. 2004, sections 2.1 and 3.3).
//
// All is done in the light's frame: its centre is the origin, z the depth along its direction. The disk
// that stands for a sphere faces the edge.
#ifndef ANTUMBRA_DBUFFER_VOLUMES_GLSL
#define ANTUMBRA_DBUFFER_VOLUMES_GLSL

#include "common/light.glsl"
#include "dbuffer/buffer.glsl"

layout(constant_id = 0) const uint LIGHT_SHAPE = 1u;
const bool SUN = LIGHT_SHAPE == LIGHT_SUN;

// Quads, half disks that close the volume at the ends of edges, and silhouette faces.
const uint QUAD = 0u;
const uint FIRST_END = 1u;
const uint SECOND_END = 2u;
const uint FACE = 3u;

// Rows are the axes; z of a sphere is the unit vector towards the edge.
mat3 light_frame(BufferParams params, vec3 z) {
    if (LIGHT_SHAPE != LIGHT_SPHERE) {
        return transpose(mat3(params.axis_x.xyz, params.axis_y.xyz, params.axis_z.xyz));
    }
    vec3 near = abs(dot(z, params.axis_x.xyz)) < 0.9 ? params.axis_x.xyz : params.axis_y.xyz;
    vec3 x = normalize(near - z * dot(near, z));
    return transpose(mat3(x, cross(z, x), z));
}

// The way of light from a point p of the light (of a sun an offset of the direction) to a.
vec3 way_from(vec2 p, vec3 a) {
    return SUN ? vec3(-p, 1.0) : a - vec3(p, 0.0);
}

// Whether some of the light is on either side of a face's plane: neither all of it sees its front nor all
// of it its back. Corners from the light's centre; z: unit vector along the light's direction, of a sphere
// any; radius as in BufferParams. Published with points of the disk (section 3.1), needs none.
bool is_silhouette_face(vec3 a, vec3 b, vec3 c, vec3 z, float radius) {
    vec3 n = cross(b - a, c - a);
    float height = SUN ? -dot(n, z) : -dot(n, a);
    return abs(height) < radius * (LIGHT_SHAPE == LIGHT_SPHERE ? length(n) : length(cross(n, z)));
}

#endif
