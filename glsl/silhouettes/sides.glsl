// On which side of an edge its faces lie, seen from a receiver.
#ifndef ANTUMBRA_SILHOUETTES_SIDES_GLSL
#define ANTUMBRA_SILHOUETTES_SIDES_GLSL

#include "silhouettes/edges.glsl"

// Whether a triangle's plane has the receiver on its front or back: the sign of the volume that it spans with
// it. Its sides are differences of the stored positions, which stay exact where it is small and far away.
// A receiver in the plane counts as if moved from it a little, by the same way for all planes: so triangles
// of one plane agree, and the edges between them, which are silhouettes of nothing, do not count.
float side_of_plane(vec3 one, vec3 two, vec3 three, vec3 p) {
    precise vec3 from = one - p;
    precise vec3 first = two - one;
    precise vec3 second = three - one;
    precise float nx = first.y * second.z - first.z * second.y;
    precise float ny = first.z * second.x - first.x * second.z;
    precise float nz = first.x * second.y - first.y * second.x;
    precise float sum = from.x * nx + from.y * ny + from.z * nz;
    float side = sum != 0.0 ? sum : (nx != 0.0 ? nx : (ny != 0.0 ? ny : nz));
    return side >= 0.0 ? 1.0 : -1.0;
}

// 1 where the third point's face lies where the determinant with the first two is positive, else -1: a
// face seen edge-on counts as one or the other, for all of its edges alike. a and b: scene space.
float side_of_face(vec3 p, float turn, uint ia, vec3 a, uint ib, vec3 b, uint corner) {
    vec3 c = fetch_point(corner).xyz;
    // Ends of an edge are in the order of their numbers.
    bool first = corner < ia;
    bool last = corner > ib;
    vec3 one = first ? c : a;
    vec3 two = first ? a : (last ? b : c);
    vec3 three = last ? c : b;
    float sign_of = side_of_plane(one, two, three, p) * turn;
    return first || last ? sign_of : -sign_of;
}

// Faces on the positive side of the plane through an edge and a receiver, less those on the other: 0 where the
// edge is no silhouette. turn: 1, or -1 for the other side.
float faces_on_one_side(vec3 p, float turn, uvec4 edge, vec3 a, vec3 b) {
    float sum = side_of_face(p, turn, edge.x, a, edge.y, b, edge.z);
    if (edge.w < MORE_FACES) {
        sum += side_of_face(p, turn, edge.x, a, edge.y, b, edge.w);
    }
    // Software drivers walk through branches that nobody takes, but not through loops.
    bool has_more = edge.w >= MORE_FACES && edge.w != NO_POINT;
    uint place = edge.w & ~MORE_FACES;
    while (has_more) {
        uvec4 more = fetch_edge(place);
        for (uint i = 0u; i < more.w >> 1; ++i) {
            sum += side_of_face(p, turn, edge.x, a, edge.y, b, more[i]);
        }
        place += 1u;
        has_more = (more.w & 1u) != 0u;
    }
    return sum;
}

#endif
