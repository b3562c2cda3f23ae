// How light is spread along a line.
#ifndef ANTUMBRA_OESS_PROFILE_GLSL
#define ANTUMBRA_OESS_PROFILE_GLSL

float profile_cells();         // defined by the entry file: 0 for an even light
vec4 fetch_profile(uint cell); // defined by the entry file: `profile` of oess/params.glsl

// Light before a place of the line, 0 to 1, and the same light times its place.
vec2 light_before(float place) {
    float cells = profile_cells();
    if (cells == 0.0) {
        return vec2(place, 0.5 * place * place);
    }
    float cell = clamp(floor(place * cells), 0.0, cells - 1.0);
    float x = place * cells - cell;
    vec4 at = fetch_profile(uint(cell));
    float part = x * (at.x + 0.5 * x * at.y);
    float moment = cell * part + x * x * (0.5 * at.x + x * at.y / 3.0);
    return at.zw + vec2(part, moment / cells) / cells;
}

#endif
