// The part of a light above a surface's own plane: exact for each shape but for rounding and 3e-5 on
// disks. Twin of AreaLight::part_above.
#ifndef ANTUMBRA_COMMON_LIGHT_ABOVE_GLSL
#define ANTUMBRA_COMMON_LIGHT_ABOVE_GLSL

#include "common/light.glsl"

// height / reach, -1 to 1, for any two numbers.
float light_ratio(float height, float reach) {
    return abs(height) < reach ? height / reach : sign(height);
}

// The part of a unit disk beyond the chord at -offset from its centre.
float disk_above(float offset) {
    float t = 0.5 + 0.5 * offset;
    float m = max(min(t, 1.0 - t), 0.0);
    float part = m * sqrt(m) * (1.6950864 - m * (0.4856525 + m * 0.15218623));
    return t > 0.5 ? 1.0 - part : part;
}

// The part of a round cone of directions above a plane, seen as a disk. up: cosine between its axis
// and the normal; sine, cosine: of its half angle.
float cone_above(float up, float sine, float cosine) {
    float along = sqrt(max(1.0 - up * up, 0.0));
    return disk_above(light_ratio(up * cosine, along * sine));
}

// The part of |u| <= 1, |v| <= 1 where height + x u + y v > 0, for x, y >= 0.
float rect_above(float height, float x, float y) {
    float longer = max(x, y);
    float shorter = min(x, y);
    float depth = abs(height);
    float corner = longer + shorter - depth;
    float part = depth <= longer - shorter
        ? 0.5 - 0.5 * depth / max(longer, 1.0e-38)
        : 0.125 * (corner / max(longer, 1.0e-38)) * (corner / max(shorter, 1.0e-38));
    part = depth >= longer + shorter ? (height == 0.0 ? 0.5 : 0.0) : part;
    return height > 0.0 ? 1.0 - part : part;
}

// n: unit normal of the surface at p.
float light_above(Light light, uint shape, vec3 p, vec3 n) {
    vec3 offset = light_offset(light, p);
    float height = dot(n, offset);
    float x = light.axis_x.w * abs(dot(n, light.axis_x.xyz));
    float y = light.axis_y.w * abs(dot(n, light.axis_y.xyz));
    if (shape == LIGHT_DISK) {
        return disk_above(light_ratio(height, length(vec2(x, y))));
    } else if (shape == LIGHT_RECT) {
        return rect_above(height, x, y);
    } else if (shape == LIGHT_SPHERE) {
        float distance_m = max(length(offset), 1.0e-37);
        float sine = min(light.axis_x.w / distance_m, 1.0);
        return cone_above(height / distance_m, sine, sqrt(max(1.0 - sine * sine, 0.0)));
    } else if (shape == LIGHT_LINE) {
        return 0.5 + 0.5 * light_ratio(height, x);
    } else if (shape == LIGHT_SUN) {
        float sine = light.direction.w;
        return cone_above(height, sine, sqrt(max(1.0 - sine * sine, 0.0)));
    }
    return height > 0.0 ? 1.0 : 0.0;
}

#endif
