// A view from the light: its map holds reversed depth, affine in map coordinates for every plane.
#ifndef ANTUMBRA_COMMON_LIGHT_VIEW_GLSL
#define ANTUMBRA_COMMON_LIGHT_VIEW_GLSL

// Views of a light that looks all round.
const uint MAX_LIGHT_VIEWS = 6u;

// q is the offset in metres from the light's centre (of a sun: from the origin of scene space).
// Perspective: map = ((dot(q, right), dot(q, up)) / dot(q, forward) - corner) * scale,
//              depth = depth_scale / dot(q, forward).
// Sun:         map = ((dot(q, right), dot(q, up)) - corner) * scale,
//              depth = depth_scale * dot(q, forward) + depth_offset.
struct LightView {
    vec4 right;   // xyz: unit vector; w: corner.x
    vec4 up;      // xyz: unit vector; w: corner.y
    vec4 forward; // xyz: unit vector; w: 1 perspective, 0 sun
    vec4 scale;   // x, y: scale; z: depth_scale; w: depth_offset
};

// Map coordinates (0 to 1, y down) in xy, stored depth in z; outside 0 to 1 where q is not in view.
vec3 light_view_project(LightView view, vec3 q) {
    vec3 v = vec3(dot(q, view.right.xyz), dot(q, view.up.xyz), dot(q, view.forward.xyz));
    vec2 corner = vec2(view.right.w, view.up.w);
    bool perspective = view.forward.w > 0.0;
    float w = perspective ? 1.0 / v.z : 1.0;
    float depth = perspective ? view.scale.z * w : view.scale.z * v.z + view.scale.w;
    vec3 map = vec3((v.xy * w - corner) * view.scale.xy, depth);
    return perspective && v.z <= 0.0 ? vec3(-1.0) : map;
}

// Depth that the map holds at map coordinates m if the plane through q with unit normal n is there:
// x; and how much it changes from one side of the map to the other, in both directions: yz.
// Exact, because depth is affine in map coordinates.
vec3 light_view_plane(LightView view, vec3 q, vec3 n, vec2 m) {
    vec2 corner = vec2(view.right.w, view.up.w);
    vec3 slopes = vec3(dot(n, view.right.xyz), dot(n, view.up.xyz), dot(n, view.forward.xyz));
    vec2 at = m / view.scale.xy + corner;
    float across = slopes.x * at.x + slopes.y * at.y;
    bool perspective = view.forward.w > 0.0;
    float k = view.scale.z / (perspective ? dot(n, q) : slopes.z);
    float depth = perspective ? k * (across + slopes.z) : k * (dot(n, q) - across) + view.scale.w;
    return vec3(depth, (perspective ? k : -k) * slopes.xy / view.scale.xy);
}

#endif
