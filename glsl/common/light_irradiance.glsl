// What an unshadowed light gives to a surface, in lux for a white light. Twin of
// AreaLight::irradiance, which says how.
#ifndef ANTUMBRA_COMMON_LIGHT_IRRADIANCE_GLSL
#define ANTUMBRA_COMMON_LIGHT_IRRADIANCE_GLSL

#include "common/light.glsl"

const float IRRADIANCE_PI = 3.14159265358979;
const float LEAST_SQUARE = 1.0e-37;

// The form factor of a disk as a vector towards it; zero behind it.
vec3 disk_factor(vec3 offset, vec3 direction, float radius) {
    float height = -dot(offset, direction);
    vec3 inward = offset + direction * height;
    float zz = height * height;
    float ss = dot(inward, inward);
    float rr = radius * radius;
    float sum = zz + ss + rr;
    float inner = zz + rr - ss;
    float root = max(sqrt(inner * inner + 4.0 * zz * ss), LEAST_SQUARE);
    float rest = inner > 0.0 ? inner + root : 4.0 * zz * ss / (root - inner);
    float scale = rr / (root * (sum + root));
    vec3 factor = -direction * (scale * rest) + inward * (2.0 * height * scale);
    return height > 0.0 ? factor : vec3(0.0);
}

// What an edge of a polygon adds to its form factor, times 2 pi.
float edge_factor(vec3 a, vec3 b, vec3 n) {
    vec3 u = a * inversesqrt(max(dot(a, a), LEAST_SQUARE));
    vec3 v = b * inversesqrt(max(dot(b, b), LEAST_SQUARE));
    vec3 across = cross(u, v);
    float sine = length(across);
    return dot(n, across) * (sine > 0.0 ? atan(sine, dot(u, v)) / sine : 0.0);
}

// The form factor of the part of a rectangle above the plane of n.
float rect_factor_above(vec3 offset, vec3 x, vec3 y, vec3 n) {
    vec3 corner = offset - x - y;
    vec3 next_corners[4] = vec3[4](offset + x - y, offset + x + y, offset - x + y, corner);
    float sum = 0.0;
    vec3 down = vec3(0.0); // where the outline leaves through the plane, and where it comes back
    vec3 up = vec3(0.0);
    for (uint i = 0u; i < 4u; ++i) {
        vec3 next = next_corners[i];
        float above = dot(n, corner);
        float above_next = dot(n, next);
        vec3 crossing = mix(corner, next, above / (above - above_next));
        bool leaves = above > 0.0 && !(above_next > 0.0);
        bool returns = !(above > 0.0) && above_next > 0.0;
        down = leaves ? crossing : down;
        up = returns ? crossing : up;
        float part = edge_factor(returns ? crossing : corner, leaves ? crossing : next, n);
        sum += above > 0.0 || above_next > 0.0 ? part : 0.0;
        corner = next;
    }
    sum += edge_factor(down, up, n);
    return abs(0.5 / IRRADIANCE_PI * sum);
}

// The form factor of what is above the plane of n, for a sphere of the form factor given.
float factor_above(vec3 factor, vec3 n) {
    float size = length(factor);
    float part = clamp(size, 1.0e-12, 1.0);
    float up = clamp(dot(factor, n) / max(size, LEAST_SQUARE), -1.0, 1.0);
    float whole = part * max(up, 0.0);
    float along = sqrt(max(1.0 - up * up, 0.0));
    float reach = sqrt(max(1.0 / part - 1.0, 0.0));
    float chord = clamp(-reach * up / max(along, 1.0e-6), -1.0, 1.0);
    float half_chord = sqrt(1.0 - chord * chord) * along;
    float above = part * (up * acos(chord) - reach * half_chord) + atan(half_chord, reach);
    return up * up >= part ? whole : max(above / IRRADIANCE_PI, 0.0);
}

// The integral over a line of max(n . q, 0) / |q|^3, q leading from the point to the line.
float line_integral(vec3 offset, vec3 axis, float half_length, vec3 n) {
    float middle = dot(offset, axis);
    vec3 across = offset - axis * middle;
    float height = dot(n, across);
    float climb = dot(n, axis);
    float from = middle - half_length;
    float to = middle + half_length;
    float crossing = climb != 0.0 ? -height / climb : 0.0;
    from = climb > 0.0 ? max(from, crossing) : from;
    to = climb < 0.0 ? min(to, crossing) : to;
    float square = max(dot(across, across), 1.0e-10 * max(dot(offset, offset), LEAST_SQUARE));
    float end_from = (height * from / square - climb) * inversesqrt(square + from * from);
    float end_to = (height * to / square - climb) * inversesqrt(square + to * to);
    bool none = from >= to || (climb == 0.0 && height <= 0.0);
    return none ? 0.0 : max(end_to - end_from, 0.0);
}

// What spot cone and range leave at an offset from the light's centre, 0 to 1.
float light_falloff(Light light, vec3 offset) {
    float square = max(dot(offset, offset), LEAST_SQUARE);
    float along = -dot(offset, light.direction.xyz) * inversesqrt(square);
    float cone = clamp((along - light.cone.y) / max(light.cone.x - light.cone.y, 1.0e-4), 0.0, 1.0);
    float reach = square * light.intensity.w * light.intensity.w;
    float window = clamp(1.0 - reach * reach, 0.0, 1.0);
    return light.center.w > 0.0 ? window * (light.cone.x < 2.0 ? cone * cone : 1.0) : 1.0;
}

// For a light of one candela (of a sun: one lux) along its axis, before light_falloff.
float light_irradiance(Light light, uint shape, vec3 p, vec3 n) {
    vec3 offset = light_offset(light, p);
    float square = max(dot(offset, offset), LEAST_SQUARE);
    vec3 towards = offset * inversesqrt(square);
    float half_x = light.axis_x.w;
    if (shape == LIGHT_DISK) {
        vec3 factor = disk_factor(offset, light.direction.xyz, half_x);
        return factor_above(factor, n) / (half_x * half_x);
    } else if (shape == LIGHT_RECT) {
        vec3 x = light.axis_x.xyz * half_x;
        vec3 y = light.axis_y.xyz * light.axis_y.w;
        float factor = rect_factor_above(offset, x, y, n);
        factor = dot(offset, light.direction.xyz) < 0.0 ? factor : 0.0;
        return factor * (0.25 * IRRADIANCE_PI) / (half_x * light.axis_y.w);
    } else if (shape == LIGHT_SPHERE) {
        float part = min(half_x * half_x / square, 1.0);
        return factor_above(towards * part, n) / (half_x * half_x);
    } else if (shape == LIGHT_LINE) {
        return line_integral(offset, light.axis_x.xyz, half_x, n) * 0.5 / half_x;
    } else if (shape == LIGHT_SUN) {
        float part = max(light.direction.w * light.direction.w, 1.0e-12);
        return factor_above(light.center.xyz * part, n) / part;
    }
    return max(dot(n, towards), 0.0) / square;
}

#endif
