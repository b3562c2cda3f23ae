struct Lamp {
    eye: vec4f,
    // The ray through the picture's top left corner, and from one pixel to the next.
    corner: vec4f,
    right: vec4f,
    down: vec4f,
    lamp: vec4f,
}
@group(0) @binding(0) var<uniform> view: Lamp;
@group(0) @binding(1) var view_depth: texture_2d<f32>;
@group(0) @binding(2) var normals: texture_2d<u32>;
@group(0) @binding(3) var visibility: texture_2d<f32>;

@vertex
fn vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(4.0 * vec2f(f32(i & 1u), f32(i >> 1u)) - 1.0, 0.0, 1.0);
}

@fragment
fn fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = vec2i(at.xy);
    let depth = textureLoad(view_depth, pixel, 0).x;
    if depth == 0.0 {
        return vec4f(0.2, 0.3, 0.4, 1.0);
    }
    let flat_n = unpack2x16snorm(textureLoad(normals, pixel, 0).x);
    let z = 1.0 - abs(flat_n.x) - abs(flat_n.y);
    let signs = select(vec2f(-1.0), vec2f(1.0), flat_n >= vec2f(0.0));
    let n = normalize(vec3f(select(flat_n, (1.0 - abs(flat_n.yx)) * signs, z < 0.0), z));
    let p = view.eye.xyz + depth * (view.corner + at.x * view.right + at.y * view.down).xyz;
    let l = view.lamp.xyz - p;
    let seen = textureLoad(visibility, pixel, 0).x;
    let light = max(dot(n, normalize(l)), 0.0) * 16.0 / dot(l, l) * seen;
    return vec4f(sqrt(vec3f(0.04, 0.05, 0.06) + 0.7 * vec3f(1.0, 0.9, 0.8) * light), 1.0);
}
