// Reflection of an area light off a rough surface: GGX (Walter et al. 2007) towards the point of the
// light that the mirror direction comes nearest to, with the lobe widened by the light's size
// (Karis 2013, "Real Shading in Unreal Engine 4").
#ifndef ANTUMBRA_SHADE_SPECULAR_GLSL
#define ANTUMBRA_SHADE_SPECULAR_GLSL

#include "common/light.glsl"

// From p to the point of the light that represents it; mirror: unit vector.
vec3 nearest_to_mirror(Light light, uint shape, vec3 offset, vec3 mirror) {
    float half_x = light.axis_x.w;
    if (shape == LIGHT_SPHERE || shape == LIGHT_SUN) {
        vec3 across = dot(offset, mirror) * mirror - offset;
        return offset + across * min(half_x * inversesqrt(max(dot(across, across), 1.0e-37)), 1.0);
    } else if (shape == LIGHT_DISK || shape == LIGHT_RECT) {
        float along = dot(mirror, light.direction.xyz);
        float to_plane = dot(offset, light.direction.xyz);
        vec3 place = along < 0.0 ? mirror * (to_plane / along) - offset : vec3(0.0);
        vec2 at = vec2(dot(place, light.axis_x.xyz), dot(place, light.axis_y.xyz));
        vec2 reach = vec2(half_x, light.axis_y.w);
        at = shape == LIGHT_RECT
            ? clamp(at, -reach, reach)
            : at * min(half_x * inversesqrt(max(dot(at, at), 1.0e-37)), 1.0);
        return offset + at.x * light.axis_x.xyz + at.y * light.axis_y.xyz;
    } else if (shape == LIGHT_LINE) {
        // Where line and mirror ray are nearest to each other.
        vec3 axis = light.axis_x.xyz;
        float both = dot(axis, mirror);
        float t = (dot(mirror, offset) * both - dot(axis, offset)) / max(1.0 - both * both, 1.0e-6);
        return offset + clamp(t, -half_x, half_x) * axis;
    }
    return offset;
}

// Radiance towards the eye for one candela (of a sun: one lux); before light_falloff. n, to_eye:
// unit vectors; f0: reflectance at normal incidence.
vec3 specular(Light light, uint shape, vec3 offset, vec3 n, vec3 to_eye, float roughness, vec3 f0) {
    vec3 mirror = reflect(-to_eye, n);
    vec3 nearest = nearest_to_mirror(light, shape, offset, mirror);
    float square = max(dot(nearest, nearest), 1.0e-37);
    vec3 to_light = nearest * inversesqrt(square);
    float distance_m = light.center.w > 0.0 ? sqrt(square) : 1.0;
    vec3 middle = normalize(to_light + to_eye);
    float nl = max(dot(n, to_light), 0.0);
    float nv = max(dot(n, to_eye), 1.0e-4);
    float nh = clamp(dot(n, middle), 0.0, 1.0);
    float alpha = max(roughness * roughness, 2.0e-3);
    float wide = min(alpha + light.axis_x.w / (3.0 * distance_m), 1.0);
    float narrowing = alpha / wide;
    float energy = shape == LIGHT_LINE ? narrowing : narrowing * narrowing;
    float lobe = nh * nh * (alpha * alpha - 1.0) + 1.0;
    float d = alpha * alpha / (3.14159265 * lobe * lobe);
    float k = 0.5 * alpha;
    float visible = 0.25 / ((nl * (1.0 - k) + k) * (nv * (1.0 - k) + k));
    vec3 fresnel = f0 + (1.0 - f0) * pow(1.0 - clamp(dot(to_eye, middle), 0.0, 1.0), 5.0);
    bool one_sided = shape == LIGHT_DISK || shape == LIGHT_RECT;
    float emitted = one_sided ? max(-dot(to_light, light.direction.xyz), 0.0) : 1.0;
    float received = emitted * nl / (light.center.w > 0.0 ? square : 1.0);
    return fresnel * (min(d * visible, 1.0e4) * energy * received);
}

#endif
