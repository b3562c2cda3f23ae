// What antumbra asks of a G-buffer: distance along the view direction in metres, and the geometric normal,
// turned to the camera, octahedral in 32 bits.

struct Camera {
    clip: mat4x4f,
    eye: vec4f,
    forward: vec4f,
}
@group(0) @binding(0) var<uniform> camera: Camera;

struct Varyings {
    @builtin(position) position: vec4f,
    @location(0) p: vec3f,
    @location(1) @interpolate(flat) n: vec3f,
}

@vertex
fn vertex(@location(0) p: vec3f, @location(1) n: vec3f) -> Varyings {
    return Varyings(camera.clip * vec4f(p, 1.0), p, n);
}

struct Surface {
    @location(0) view_depth: f32,
    @location(1) normal: u32,
}

@fragment
fn fragment(in: Varyings) -> Surface {
    let ray = in.p - camera.eye.xyz;
    let n = select(in.n, -in.n, dot(in.n, ray) > 0.0);
    let flat_n = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    let signs = select(vec2f(-1.0), vec2f(1.0), flat_n >= vec2f(0.0));
    let folded = select(flat_n, (1.0 - abs(flat_n.yx)) * signs, n.z < 0.0);
    return Surface(dot(ray, camera.forward.xyz), pack2x16snorm(folded));
}
