// Places along a silhouette edge, each an outline or not.
#ifndef ANTUMBRA_SSOC_PLACES_GLSL
#define ANTUMBRA_SSOC_PLACES_GLSL

// Places that an edge is divided into at most: bits of a uvec4.
const uint MOST_PLACES = 128u;

// Whether the edge is an outline at t, 0 to 1 along it.
bool is_outline(uvec4 places, uint count, float t) {
    uint place = min(uint(clamp(t, 0.0, 1.0) * float(count)), count - 1u);
    uint word = place < 32u ? places.x : place < 64u ? places.y : place < 96u ? places.z : places.w;
    return (word >> (place & 31u) & 1u) != 0u;
}

#endif
