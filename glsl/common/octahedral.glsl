// Unit vectors in 32 bits: octahedral, two 16-bit signed normalised numbers (Meyer et al. 2010, "On
// floating-point normal vectors"). The largest error is 4e-5 radians.
#ifndef ANTUMBRA_COMMON_OCTAHEDRAL_GLSL
#define ANTUMBRA_COMMON_OCTAHEDRAL_GLSL

vec2 octahedral_fold(vec2 v) {
    vec2 signs = vec2(v.x >= 0.0 ? 1.0 : -1.0, v.y >= 0.0 ? 1.0 : -1.0);
    return (1.0 - abs(v.yx)) * signs;
}

vec2 octahedral_from_unit(vec3 n) {
    vec2 p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    return n.z < 0.0 ? octahedral_fold(p) : p;
}

vec3 unit_from_octahedral(vec2 p) {
    float z = 1.0 - abs(p.x) - abs(p.y);
    return normalize(vec3(z < 0.0 ? octahedral_fold(p) : p, z));
}

uint pack_unit(vec3 n) {
    return packSnorm2x16(octahedral_from_unit(n));
}

vec3 unpack_unit(uint bits) {
    return unit_from_octahedral(unpackSnorm2x16(bits));
}

#endif
