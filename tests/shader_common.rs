//! Functions of `glsl/common/` do the same as their Rust twins, and shared structs lie the same; functions
//! of techniques do what sampling says.

mod support;

use antumbra::geometry::PixelCamera;
use antumbra::gpu::{ComputePipelineDesc, GpuError, MemoryLocation, SetWrite};
use antumbra::light::{AreaLight, LightShape};
use antumbra::scene::{Aabb, SceneCamera};
use antumbra::shadow::hard::HardParams;
use antumbra::shadow::{LightParams, LightView, ViewParams, light_views, shape_number};
use glam::{DVec3, UVec2, Vec3, Vec4, vec3};
use support::work::{COMPUTE, STORAGE, bind, full_barrier, storage};
use support::{compile, destroy_clean, gpu, serial};

/// Runs `body`, which makes `vec4 r` of `vec4 s`, once for each element, after `head`.
fn map(head: &str, body: &str, push: &[u8], source: &[[f32; 4]]) -> Vec<[f32; 4]> {
    map_for(head, body, push, source, Vec::new())
}

/// The same with values of specialization constants.
fn map_for(
    head: &str,
    body: &str,
    push: &[u8],
    source: &[[f32; 4]],
    constants: Vec<(u32, u32)>,
) -> Vec<[f32; 4]> {
    let shader = compile(
        COMPUTE,
        &format!(
            "#version 460
            #extension GL_GOOGLE_include_directive : require
            layout(local_size_x = 1) in;
            layout(binding = 0, std430) readonly buffer In {{ vec4 source[]; }};
            layout(binding = 1, std430) writeonly buffer Out {{ vec4 result[]; }};
            {head}
            void main() {{
                vec4 s = source[gl_WorkGroupID.x];
                vec4 r;
                {body}
                result[gl_WorkGroupID.x] = r;
            }}"
        ),
    );
    let mut gpu = gpu();
    let bytes = size_of_val(source) as u64;
    let mut input = gpu
        .create_buffer("source", bytes, STORAGE, MemoryLocation::CpuToGpu)
        .unwrap();
    let output = gpu
        .create_buffer("result", bytes, STORAGE, MemoryLocation::GpuToCpu)
        .unwrap();
    let target = input.mapped_mut().unwrap();
    target.copy_from_slice(bytemuck::cast_slice(source));
    gpu.run(|gpu, cmd| -> Result<(), GpuError> {
        let desc = ComputePipelineDesc {
            constants: constants.clone(),
            ..ComputePipelineDesc::new(shader)
        };
        let pipeline = gpu.compute_pipeline(&desc)?;
        let set = gpu.allocate_set(&pipeline)?;
        let buffers = [input.raw, output.raw].into_iter().zip(0..);
        let writes = buffers.map(|(buffer, binding)| SetWrite {
            binding,
            resource: storage(buffer),
        });
        gpu.write_set(set, &writes.collect::<Vec<_>>())?;
        bind(gpu, cmd, &pipeline, Some(set), push);
        // SAFETY: everything the dispatch needs is bound.
        unsafe { gpu.device().cmd_dispatch(cmd, source.len() as u32, 1, 1) };
        full_barrier(gpu, cmd);
        Ok(())
    })
    .unwrap();
    let result = bytemuck::cast_slice(output.mapped().unwrap()).to_vec();
    gpu.destroy_buffer(input);
    gpu.destroy_buffer(output);
    destroy_clean(gpu);
    result
}

/// Unit vectors all over the sphere, the poles and seams of the octahedron among them.
fn directions() -> Vec<Vec3> {
    let mut all = vec![
        Vec3::X,
        Vec3::NEG_X,
        Vec3::Y,
        Vec3::NEG_Y,
        Vec3::Z,
        Vec3::NEG_Z,
    ];
    for i in 0..200 {
        let z = 1.0 - (2.0 * i as f32 + 1.0) / 200.0;
        let angle = 2.399_963 * i as f32;
        let r = (1.0 - z * z).sqrt();
        all.push(Vec3::new(r * angle.cos(), r * angle.sin(), z));
    }
    all
}

#[test]
fn a_unit_vector_survives_32_bits() {
    let _one = serial();
    let source: Vec<[f32; 4]> = directions()
        .iter()
        .map(|d| d.extend(0.0).to_array())
        .collect();
    let head = "#include \"common/octahedral.glsl\"";
    let body = "r = vec4(unpack_unit(pack_unit(s.xyz)), 0.0);";
    for (result, expected) in map(head, body, &[], &source).iter().zip(directions()) {
        let error = (Vec3::from_slice(result) - expected).length();
        assert!(error < 6.0e-5, "{expected}: {error}");
    }
}

#[test]
fn pixel_rays_are_those_of_the_camera() {
    let _one = serial();
    let mut bounds = Aabb::EMPTY;
    bounds.insert(Vec3::splat(-2.0));
    bounds.insert(Vec3::splat(3.0));
    let camera = SceneCamera::framing(&bounds);
    let size = UVec2::new(97, 61);
    let pixels = PixelCamera::new(&camera, size.to_array());
    let source: Vec<[f32; 4]> = [(0, 0), (96, 0), (48, 30), (13, 57), (96, 60)]
        .map(|(x, y)| [x as f32, y as f32, 0.0, 0.0])
        .to_vec();
    let head = "#include \"common/camera.glsl\"
        layout(push_constant) uniform Push { Camera camera; } push;";
    let body = "vec3 ray = pixel_ray(push.camera, uvec2(s.xy));
        r = vec4(ray, dot(ray, view_forward(push.camera)));";
    let results = map(head, body, bytemuck::bytes_of(&pixels), &source);
    for (result, source) in results.iter().zip(&source) {
        let pixel = UVec2::new(source[0] as u32, source[1] as u32);
        let expected = camera.ray(pixel, size).direction;
        let ray = Vec3::from_slice(result);
        assert!(
            (ray.normalize() - expected).length() < 1.0e-6,
            "{ray} {expected}"
        );
        assert!(
            (result[3] - 1.0).abs() < 1.0e-5,
            "of length 1 along the view"
        );
    }
}

/// A point on a plane projects where the clip matrix puts it, and the plane's depth there, predicted
/// from any other point of the plane, is the point's own.
/// The point of a triangle that is nearest to one in its plane, in double precision.
fn nearest_in_triangle(corners: [DVec3; 3], p: DVec3) -> DVec3 {
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let edges = [0, 1, 2].map(|i| (corners[i], corners[(i + 1) % 3]));
    if (edges.iter()).all(|(a, b)| normal.cross(*b - *a).dot(p - *a) >= 0.0) {
        return p;
    }
    let on_edges = edges.map(|(a, b)| {
        let part = (p - a).dot(b - a) / (b - a).length_squared();
        a + part.clamp(0.0, 1.0) * (b - a)
    });
    (on_edges.into_iter())
        .min_by(|a, b| a.distance(p).total_cmp(&b.distance(p)))
        .unwrap()
}

/// Points in and around triangles of all sizes and shapes, far from the origin and off their planes too.
#[test]
fn points_beside_a_triangle_go_to_the_nearest_of_it() {
    let _one = serial();
    let shapes = [
        [Vec3::ZERO, vec3(1.0, 0.2, 0.1), vec3(0.3, 0.9, -0.4)],
        [Vec3::ZERO, vec3(1.0, 0.0, 0.0), vec3(0.4, 0.002, 0.003)],
        [Vec3::ZERO, vec3(0.1, 0.0, 2.0), vec3(-1.5, 0.0, 0.3)],
    ];
    let head = "vec4 texels[4];
        vec4 fetch_triangle_texel(uint texel) { return texels[texel]; }
        #include \"common/triangles.glsl\"
        layout(push_constant) uniform Push { vec4 corners[3]; vec4 plane; } push;";
    let body = "for (uint i = 0u; i < 3u; ++i) { texels[i] = push.corners[i]; }
        texels[3] = push.plane;
        r = vec4(way_into_triangle(s.xyz, uint(s.w)), 0.0);";
    for (size, away) in [(1.0, 0.0), (1.0e-3, 0.0), (1.0e-2, 8.0), (1.0e3, 0.0)] {
        for shape in shapes {
            let corners = shape.map(|p| size * p + away * vec3(1.0, -0.5, 0.8));
            let exact = corners.map(Vec3::as_dvec3);
            let (ab, ac) = (exact[1] - exact[0], exact[2] - exact[0]);
            let normal = ab.cross(ac).normalize();
            let mut points = vec![exact[0], exact[1], exact[2]];
            for i in -6..=12 {
                for j in -6..=12 {
                    points.push(exact[0] + f64::from(i) / 6.0 * ab + f64::from(j) / 6.0 * ac);
                }
            }
            let push =
                [corners[0], corners[1], corners[2], normal.as_vec3()].map(|v| v.extend(0.0));
            let rounding = f64::from(size + away) * 1.0e-6;
            for lift in [0.0, 0.01 * f64::from(size)] {
                let source = |p: &DVec3| (*p + lift * normal).as_vec3().extend(1.0).to_array();
                let source: Vec<[f32; 4]> = points.iter().map(source).collect();
                let results = map(head, body, bytemuck::bytes_of(&push), &source);
                for (result, source) in results.iter().zip(&source) {
                    let p = Vec3::from_slice(source).as_dvec3();
                    let height = (p - exact[0]).dot(normal);
                    let in_plane = p - height * normal;
                    let nearest = nearest_in_triangle(exact, in_plane);
                    let way = Vec3::from_slice(result).as_dvec3();
                    // One over the triangle stays where it is, one over its outline may.
                    let outside = nearest.distance(in_plane);
                    let stays = way == DVec3::ZERO && outside < 2.0 * rounding;
                    let error = (p + way).distance(nearest);
                    assert!(
                        stays || error < 2.0 * rounding,
                        "{corners:?} {p}: {way}, {nearest}"
                    );
                }
            }
            let none = map(
                head,
                body,
                bytemuck::bytes_of(&push),
                &[[9.0, 9.0, 9.0, 0.0]],
            );
            assert_eq!(none, [[0.0; 4]]);
        }
    }
}

#[test]
fn a_plane_has_the_depth_that_is_predicted_for_it() {
    let _one = serial();
    let mut bounds = Aabb::EMPTY;
    bounds.insert(Vec3::new(-2.0, -1.0, -2.0));
    bounds.insert(Vec3::new(2.0, 1.0, 2.0));
    let hull = bounds.corners().map(|corner| corner.as_dvec3()).to_vec();
    let above = Vec3::new(0.5, 6.0, 1.0);
    let disk = LightShape::Disk { radius: 0.2 };
    let sun = LightShape::Sun {
        angular_diameter: 0.01,
    };
    for shape in [disk, sun] {
        let light = AreaLight::new(shape, above, Vec3::new(0.1, -1.0, 0.2), Vec3::X);
        let views = light_views(&light, std::slice::from_ref(&hull), &bounds, 0.0);
        let (view, clip) = (views.views[0], views.clip_from_scene[0]);
        let origin = if light.shape.is_sun() {
            Vec3::ZERO
        } else {
            above
        };
        let normal = Vec3::new(0.3, 0.9, -0.2).normalize();
        let on_plane = |x: f32, z: f32| {
            let y = -(normal.x * x + normal.z * z) / normal.y;
            Vec3::new(x, y, z)
        };
        let points =
            [(-1.0, 0.4), (0.0, 0.0), (1.3, -0.7), (0.2, 1.4)].map(|(x, z)| on_plane(x, z));
        let source = points.map(|p| (p - origin).extend(0.0).to_array());
        let anchor = on_plane(0.6, -1.1) - origin;
        let push: Vec<f32> = [view.right, view.up, view.forward, view.scale]
            .into_iter()
            .flatten()
            .chain(anchor.extend(0.0).to_array())
            .chain(normal.extend(0.0).to_array())
            .collect();
        let head = "#include \"common/light_view.glsl\"
            layout(push_constant) uniform Push { LightView view; vec4 q; vec4 n; } push;";
        let body = "r = vec4(light_view_project(push.view, s.xyz), 0.0);
            r.w = light_view_plane(push.view, push.q.xyz, push.n.xyz, r.xy).x;";
        let results = map(head, body, bytemuck::cast_slice(&push), &source);
        for (result, point) in results.iter().zip(points) {
            let c = clip * Vec4::from((point, 1.0));
            let ndc = c.truncate() / c.w;
            let expected = Vec3::new(0.5 * ndc.x + 0.5, 0.5 * ndc.y + 0.5, ndc.z);
            let error = (Vec3::from_slice(result) - expected).abs();
            assert!(error.max_element() < 2.0e-6, "{result:?} {expected}");
            assert!((result[3] / result[2] - 1.0).abs() < 1.0e-5, "{result:?}");
        }
    }
}

#[test]
fn structs_shared_with_shaders_lie_the_same() {
    assert_layout!(PixelCamera { eye, corner_ray, pixel_right, pixel_down }
        = "Camera" in "gbuffer/surface.frag");
    assert_layout!(LightView { right, up, forward, scale }
        = "LightView" in "hard/visibility.comp");
    assert_layout!(HardParams { camera, light, counts, views }
        = "HardParams" in "hard/visibility.comp");
    assert_layout!(LightParams { center, axis_x, axis_y, direction, intensity, cone }
        = "Light" in "shade/light.frag");
    assert_layout!(ViewParams { camera, light } = "ViewParams" in "shade/light.frag");
}

/// Lights of all shapes, seen from points and normals all round, many of whose planes cut them.
fn light_cases() -> Vec<(AreaLight, Vec<[f32; 4]>)> {
    let shapes = [
        LightShape::Point,
        LightShape::Disk { radius: 0.7 },
        LightShape::Rect {
            width: 1.5,
            height: 0.4,
        },
        LightShape::Sphere { radius: 0.6 },
        LightShape::Line { length: 2.0 },
        LightShape::Sun {
            angular_diameter: 0.3,
        },
    ];
    let cases = shapes.map(|shape| {
        let center = Vec3::new(0.2, 1.0, -0.4);
        let light = AreaLight::new(
            shape,
            center,
            Vec3::new(0.3, -1.0, 0.2),
            Vec3::new(1.0, 0.1, 0.4),
        );
        let rows = directions()
            .into_iter()
            .enumerate()
            .flat_map(|(i, normal)| {
                let height = 0.6 * (i % 7) as f32 / 6.0;
                let point = Vec3::new(0.1 * (i % 11) as f32 - 0.3, height, 0.1 * (i % 5) as f32);
                [point.extend(0.0).to_array(), normal.extend(0.0).to_array()]
            });
        (light, rows.collect())
    });
    cases.to_vec()
}

/// Runs `function(light, shape, p, n)` for each case and hands both answers to `check`.
fn compare_light_function(
    include: &str,
    function: &str,
    twin: fn(&AreaLight, Vec3, Vec3) -> f32,
    check: fn(&AreaLight, f32, f32, Vec3, Vec3),
) {
    for (light, rows) in light_cases() {
        let head = format!(
            "#include \"{include}\"
            layout(push_constant) uniform Push {{ Light light; }} push;"
        );
        let shape = shape_number(&light.shape);
        let body = format!(
            "vec3 n = source[(gl_WorkGroupID.x | 1u)].xyz; vec3 p = source[gl_WorkGroupID.x & ~1u].xyz;
            r = vec4({function}(push.light, {shape}u, p, n));"
        );
        let params = LightParams::new(&light);
        let results = map(&head, &body, bytemuck::bytes_of(&params), &rows);
        for (result, rows) in results.chunks(2).zip(rows.chunks(2)) {
            let [p, n] = [rows[0], rows[1]].map(|row| Vec3::from_slice(&row));
            check(&light, result[0][0], twin(&light, p, n), p, n);
        }
    }
}

#[test]
fn the_part_of_a_light_above_a_plane_is_the_same_in_both_languages() {
    let _one = serial();
    compare_light_function(
        "common/light_above.glsl",
        "light_above",
        AreaLight::part_above,
        |light, found, expected, p, n| {
            let error = (found - expected).abs();
            assert!(
                error < 2.0e-5,
                "{}: {found}, not {expected}, at {p}, {n}",
                light.shape
            );
        },
    );
}

#[test]
fn irradiance_is_the_same_in_both_languages() {
    let _one = serial();
    compare_light_function(
        "common/light_irradiance.glsl",
        "light_irradiance",
        AreaLight::irradiance,
        |light, found, expected, p, n| {
            // Drivers' inverse trigonometric functions are good to some 1e-4.
            let facing = light.irradiance(p, (light.center - p).normalize()).max(0.1);
            let error = (found - expected).abs() / facing;
            assert!(
                error < 1.0e-3,
                "{}: {found}, not {expected}, at {p}, {n}",
                light.shape
            );
        },
    );
}

/// A5 of `dbuffer`: a face is a silhouette face if 720 points of the light's rim are not all on one side
/// of its plane. Random faces, and ones nearly level with the light.
#[test]
fn silhouette_faces_are_those_whose_plane_parts_the_rim() {
    const POINTS: u32 = 720;
    // What rounding may change, as a part of the lengths, and what lies between two points of the rim.
    const ROUNDING: f32 = 4.0e-6;
    const BETWEEN: f32 = 1.0e-5;
    let _one = serial();
    let mut state = 11u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 23) as f32 - 1.0
    };
    let mut faces: Vec<([Vec3; 3], Vec3, f32)> = Vec::new();
    for i in 0..3000 {
        let mut vector = || Vec3::new(random(), random(), random());
        let (at, z) = (4.0 * vector(), vector().normalize());
        let mut sides = [vector(), vector()];
        if i % 3 == 0 {
            // Level but for a little, so that only the rim's ends differ.
            let tilt = if i % 2 == 0 { 1.0e-3 } else { 0.1 };
            sides = sides.map(|side| side - z * (side.dot(z) * (1.0 - tilt)));
        }
        faces.push(([at, at + sides[0], at + sides[1]], z, 0.1 + random().abs()));
    }
    let source: Vec<[f32; 4]> = faces
        .iter()
        .flat_map(|([a, b, c], z, radius)| {
            let texel = |v: &Vec3, w: f32| v.extend(w).to_array();
            [
                texel(a, *radius),
                texel(b, 0.0),
                texel(c, 0.0),
                texel(z, 0.0),
            ]
        })
        .collect();
    let head = "#include \"dbuffer/volumes.glsl\"";
    let body = "uint i = gl_WorkGroupID.x / 4u * 4u;
        r = vec4(is_silhouette_face(source[i].xyz, source[i + 1u].xyz, source[i + 2u].xyz,
            source[i + 3u].xyz, source[i].w) ? 1.0 : 0.0);";
    let shapes = [
        LightShape::Disk { radius: 1.0 },
        LightShape::Sphere { radius: 1.0 },
        LightShape::Sun {
            angular_diameter: 1.0,
        },
    ];
    for shape in shapes {
        let constants = vec![(0, shape_number(&shape))];
        let results = map_for(head, body, &[], &source, constants);
        let (mut counts, mut undecided) = ([0; 3], 0);
        for (result, ([a, b, c], z, radius)) in results.chunks_exact(4).zip(&faces) {
            let n = (*b - *a).cross(*c - *a);
            let (x, y) = match shape {
                // The great circle through what of a sphere is nearest to the plane.
                LightShape::Sphere { .. } => {
                    (n.normalize(), n.normalize().any_orthonormal_vector())
                }
                _ => z.any_orthonormal_pair(),
            };
            // Of a sun, directions to its rim.
            let start = if shape.is_sun() { -*z } else { -*a };
            let heights = (0..POINTS).map(|i| {
                let (sine, cosine) = (std::f32::consts::TAU * i as f32 / POINTS as f32).sin_cos();
                n.dot(start + (x * cosine + y * sine) * *radius)
            });
            let (low, high) = heights.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| {
                (l.min(v), h.max(v))
            });
            let class = if low > 0.0 {
                0
            } else if high < 0.0 {
                1
            } else {
                2
            };
            let slack = ROUNDING * n.length() * (start.length() + radius) + BETWEEN * (high - low);
            if low.abs().min(high.abs()) <= slack {
                undecided += 1;
                continue;
            }
            counts[class] += 1;
            assert_eq!(result[0] != [0.0; 4], class == 2, "{shape:?}: {a} {b} {c}");
        }
        assert!(undecided < 30, "{shape:?}: {undecided} too near to tell");
        assert!(counts.iter().all(|count| *count > 200), "{counts:?}");
    }
}
