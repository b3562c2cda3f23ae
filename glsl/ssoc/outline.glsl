// A silhouette edge in a view from the light's centre.
#ifndef ANTUMBRA_SSOC_OUTLINE_GLSL
#define ANTUMBRA_SSOC_OUTLINE_GLSL

#include "silhouettes/edges.glsl"
#include "ssoc/params.glsl"
#include "ssoc/places.glsl"

// `params` is the entry file's block.

struct Outline {
    vec2 from;    // of the part that the view shows, in the view's units
    vec2 to;
    vec2 depths;  // of both ends, inverse in a perspective view
    vec2 outward; // unit vector away from the faces
    bool left;    // whether the faces are to the left of the way from `from` to `to`
    bool shown;   // false: nothing of it is in view, or it has no side
};

vec3 outline_point(LightView view, vec3 center, uint point) {
    vec3 q = fetch_point(point).xyz - center;
    return vec3(dot(q, view.right.xyz), dot(q, view.up.xyz), dot(q, view.forward.xyz));
}

// Which side of the edge a face is on: sine of the angle between the planes through edge and light
// and through edge and face, about.
float face_side(bool perspective, vec3 a, vec3 b, vec3 face) {
    vec3 across = perspective ? cross(a, b) : vec3(a.y - b.y, b.x - a.x, 0.0);
    vec3 way = face - a;
    return dot(across, way) / max(length(across) * length(way), 1.0e-37);
}

// center: of the light, metres; of a sun the origin.
Outline outline_of(LightView view, vec3 center, uint number) {
    uvec4 edge = fetch_edge(number);
    bool perspective = view.forward.w > 0.0;
    vec3 a = outline_point(view, center, edge.x);
    vec3 b = outline_point(view, center, edge.y);
    float faces = face_side(perspective, a, b, outline_point(view, center, edge.z));
    if (edge.w < MORE_FACES) {
        float other = face_side(perspective, a, b, outline_point(view, center, edge.w));
        faces = abs(other) > abs(faces) ? other : faces;
    }
    Outline outline = Outline(vec2(0.0), vec2(0.0), vec2(0.0), vec2(1.0, 0.0), faces > 0.0, false);
    // Where the light's centre lies in all of its faces' planes, an edge has no side.
    if (abs(faces) < 1.0e-5 || !clip_edge(view, params.reach.z, a, b)) {
        return outline;
    }
    outline.from = perspective ? a.xy / a.z : a.xy;
    outline.to = perspective ? b.xy / b.z : b.xy;
    outline.depths = perspective ? 1.0 / vec2(a.z, b.z) : vec2(a.z, b.z);
    vec2 along = outline.to - outline.from;
    float size = length(along);
    along = size > 0.0 ? along / size : vec2(1.0, 0.0);
    outline.outward = vec2(-along.y, along.x) * (faces > 0.0 ? -1.0 : 1.0);
    outline.shown = true;
    return outline;
}

// Width of a texel of the shadow map, in the view's units.
float map_texel(LightView view) {
    return max(abs(1.0 / view.scale.x), abs(1.0 / view.scale.y)) / float(params.counts.y);
}

// Into how many places the edge is divided: one for each texel of the shadow map that it crosses.
uint outline_places(LightView view, Outline outline) {
    return uint(clamp(ceil(distance(outline.from, outline.to) / map_texel(view)), 1.0, float(MOST_PLACES)));
}

#endif
