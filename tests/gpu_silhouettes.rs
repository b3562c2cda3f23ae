//! Silhouette edges found on the device, against every edge tried from every point of the light.

mod support;

use antumbra::ash::vk;
use antumbra::geometry::{PixelCamera, SceneBuffers, add_gbuffer, add_tile_bounds};
use antumbra::gpu::{GpuError, MemoryLocation};
use antumbra::graph::{
    Access, BufferDesc, BufferPart, BufferState, FrameCache, Graph, HostBuffer, ImagePart, PassKind,
};
use antumbra::light::{AreaLight, LightShape};
use antumbra::scene::{Material, Primitive, Scene, SceneCamera};
use antumbra::shadow::silhouettes::{SilhouetteRule, add_silhouettes};
use antumbra::shadow::{LightParams, ShadowInputs, ViewParams};
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;

/// An edge by the positions of its ends.
type Edge = [[u32; 3]; 2];

fn edge(a: Vec3, b: Vec3) -> Edge {
    let mut ends = [a, b].map(|p| (p + Vec3::ZERO).to_array().map(f32::to_bits));
    ends.sort_unstable();
    ends
}

/// Opposite corners of each edge's faces.
fn faces(scene: &Scene) -> BTreeMap<Edge, Vec<Vec3>> {
    let mut all: BTreeMap<Edge, Vec<Vec3>> = BTreeMap::new();
    for primitive in &scene.primitives {
        for corners in primitive.indices.chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|i| primitive.positions[corners[i] as usize]);
            for (a, b, c) in [(a, b, c), (b, c, a), (c, a, b)] {
                all.entry(edge(a, b)).or_default().push(c);
            }
        }
    }
    all
}

fn place(end: [u32; 3]) -> DVec3 {
    Vec3::from(end.map(f32::from_bits)).as_dvec3()
}

/// How clearly an edge is a silhouette from a point (1) or a direction to a sun (0 as w): negative if
/// it is none, as a part of the lengths in play.
fn silhouette(edge: &Edge, faces: &[Vec3], point: DVec3, w: f64) -> f64 {
    let [a, b] = edge.map(place);
    let to = point - a * w;
    let heights = faces.iter().map(|face| {
        let across = face.as_dvec3() - a;
        let scale = across.length() * (b - a).length() * to.length();
        across.cross(b - a).dot(to) / scale
    });
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
        (l.min(v), h.max(v))
    });
    low.max(-high)
}

/// Points of a light, its rim among them.
fn points(light: &AreaLight) -> Vec<DVec3> {
    let (x, y) = (light.axis_x.as_dvec3(), light.axis_y.as_dvec3());
    let center = if light.shape.is_sun() {
        -light.direction.as_dvec3()
    } else {
        light.center.as_dvec3()
    };
    let rings = (0..=24).flat_map(|ring| {
        let count = if ring == 24 { 2000 } else { 64 };
        (0..count).map(move |i| (f64::from(ring) / 24.0, f64::from(i) / f64::from(count)))
    });
    let round = |radius: f64| {
        let on = |(r, turn): (f64, f64)| {
            let (sine, cosine) = (turn * std::f64::consts::TAU).sin_cos();
            center + (x * cosine + y * sine) * (r * radius)
        };
        rings.clone().map(on).collect()
    };
    match light.shape {
        LightShape::Disk { radius } => round(f64::from(radius)),
        LightShape::Sun { angular_diameter } => round((0.5 * f64::from(angular_diameter)).tan()),
        LightShape::Sphere { radius } => (0..20_000)
            .map(|i| {
                // Evenly over the sphere (Fibonacci).
                let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 20_000.0;
                let (sine, cosine) = (2.399_963_229_728_653 * f64::from(i)).sin_cos();
                let r = (1.0 - z * z).sqrt();
                center + DVec3::new(r * cosine, r * sine, z) * f64::from(radius)
            })
            .collect(),
        LightShape::Rect { width, height } => (0..=40 * 41)
            .map(|i| {
                let [u, v] = [i % 41, i / 41].map(|i| f64::from(i) / 40.0 - 0.5);
                center + x * (u * f64::from(width)) + y * (v * f64::from(height))
            })
            .collect(),
        LightShape::Line { length } => (0..=200)
            .map(|i| center + x * ((f64::from(i) / 200.0 - 0.5) * f64::from(length)))
            .collect(),
        LightShape::Point => vec![center],
    }
}

/// Edges by number: points count from where triangles first use them, edges by their two points.
fn in_order(scene: &Scene) -> Vec<Edge> {
    let mut points: BTreeMap<[u32; 3], usize> = BTreeMap::new();
    for primitive in &scene.primitives {
        for index in &primitive.indices {
            let next = points.len();
            let position = primitive.positions[*index as usize];
            points.entry(edge(position, position)[0]).or_insert(next);
        }
    }
    let number = |edge: &Edge| {
        let mut ends = edge.map(|end| points[&end]);
        ends.sort_unstable();
        ends
    };
    let mut all: Vec<Edge> = faces(scene).into_keys().collect();
    all.sort_by_key(number);
    all
}

/// The list that the device makes, as edges.
fn found(scene: &Scene, light: AreaLight, rule: SilhouetteRule) -> Vec<Edge> {
    let mut gpu = support::gpu();
    let mut buffers = gpu
        .run(|gpu, cmd| SceneBuffers::upload(gpu, cmd, scene))
        .unwrap();
    assert!(!buffers.has_edges());
    gpu.run(|gpu, cmd| buffers.add_edges(gpu, cmd, scene))
        .unwrap();
    let edges = buffers.edge_count();
    let usage = vk::BufferUsageFlags::TRANSFER_DST;
    // Arguments, then the list in rows of 4096.
    let total = 32 + edges.div_ceil(4096).max(1) as u64 * 4096 * 4;
    let target = gpu
        .create_buffer("found", total, usage, MemoryLocation::GpuToCpu)
        .unwrap();
    let mut cache = FrameCache::new();
    let camera = SceneCamera::framing(&scene.bounds);
    let mut graph = Graph::new();
    let ids = buffers.import(&mut graph);
    let size = [16, 16];
    let gbuffer = add_gbuffer(&mut graph, &buffers, &ids, &camera, size);
    let tile_bounds = add_tile_bounds(&mut graph, &gbuffer, size);
    let params = ViewParams {
        camera: PixelCamera::new(&camera, size),
        light: LightParams::new(&light),
    };
    let bytes = size_of::<ViewParams>() as u64;
    let view = graph.create_buffer("view", BufferDesc { size: bytes });
    let mut pass = graph.pass("view", PassKind::Transfer);
    let view = pass.overwrite(view, Access::Clear);
    pass.record(move |ctx| ctx.update_buffer(view, 0, bytemuck::bytes_of(&params)));
    let inputs = ShadowInputs {
        light_name: "lamp".to_string(),
        light,
        camera: PixelCamera::new(&camera, size),
        gbuffer,
        tile_bounds,
        view_params: (
            view,
            BufferPart {
                offset: 0,
                size: bytes,
            },
        ),
        receivers: [].into(),
        casters: vec![true; buffers.draws().len()].into(),
        scene: &buffers,
        ids,
        silhouettes: None,
    };
    let list = add_silhouettes(&mut graph, &inputs, "test", rule, 6);
    let host = HostBuffer {
        buffer: target.raw,
        desc: BufferDesc { size: total },
        usage,
        enter: BufferState::IDLE,
        leave: BufferState::HOST_READ,
    };
    let back = graph.import_buffer("found", host);
    let mut pass = graph.pass("read back", PassKind::Transfer);
    pass.read(list.arguments, Access::CopyRead);
    pass.read(list.list, Access::CopyRead);
    let back = pass.overwrite(back, Access::CopyWrite);
    pass.record(move |ctx| {
        ctx.copy_buffer(list.arguments, 0, back, 0, 32)?;
        ctx.copy_image_to_buffer(list.list, ImagePart::mip(0), back, 32)
    });
    let compiled = graph.compile(&gpu).unwrap();
    gpu.run(|gpu, cmd| -> Result<(), GpuError> {
        compiled.record(gpu, &mut cache, cmd)?;
        Ok(())
    })
    .unwrap();
    let words: &[u32] = bytemuck::cast_slice(target.mapped().unwrap());
    let count = words[4];
    assert_eq!(words[..4], [6 * count, 1, 0, 0]);
    assert_eq!(words[5..8], [count.div_ceil(64), count.min(1), 1]);
    let numbers = words[8..8 + count as usize].to_vec();
    assert!(numbers.windows(2).all(|two| two[0] < two[1]));
    assert!(numbers.iter().all(|n| (*n as usize) < edges));
    let all = in_order(scene);
    assert_eq!(all.len(), edges);
    let result = numbers.iter().map(|n| all[*n as usize]).collect();
    cache.destroy(&mut gpu);
    buffers.destroy(&mut gpu);
    gpu.destroy_buffer(target);
    support::destroy_clean(gpu);
    result
}

fn mesh(positions: Vec<Vec3>, indices: Vec<u32>) -> Primitive {
    Primitive {
        normals: vec![Vec3::Y; positions.len()],
        positions,
        indices,
        ..Primitive::default()
    }
}

fn scene(primitives: Vec<Primitive>) -> Scene {
    let mut scene = Scene {
        primitives,
        materials: vec![Material::default()],
        ..Scene::default()
    };
    scene.finish().unwrap();
    scene
}

/// A ball whose every triangle has corners of its own and a winding of its own, closed but for its
/// poles, a dish, fans of up to seven faces around one edge: all away from the light.
fn shapes() -> Scene {
    let mut state = 7u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let on = |i: u32, j: u32| {
        let (a, b) = (
            i as f32 * 0.3,
            (j % 20) as f32 * std::f32::consts::TAU / 20.0,
        );
        Vec3::new(a.sin() * b.cos(), a.cos(), a.sin() * b.sin()) * 1.5
    };
    let mut corners = Vec::new();
    for (i, j) in (1..10).flat_map(|i| (0..20).map(move |j| (i, j))) {
        let around = [on(i, j), on(i, j + 1), on(i + 1, j + 1), on(i + 1, j)];
        let order = [[0, 1, 2, 0, 2, 3], [0, 2, 1, 0, 3, 2]][usize::from((i + j) % 3 == 0)];
        corners.extend(order.map(|at| around[at]));
    }
    let count = corners.len() as u32;
    let squashed = |p: &Vec3| *p * Vec3::new(1.0, 0.3, 0.7) + Vec3::new(4.0, 0.0, 1.0);
    let dish = mesh(
        corners[..600].iter().map(squashed).collect(),
        (0..600).collect(),
    );
    let ball = mesh(corners, (0..count).collect());
    let mut parts = vec![ball, dish];
    for count in 1..8u32 {
        let at = Vec3::new(-4.0, 0.0, count as f32 - 4.0);
        let mut fan = vec![at, at + Vec3::new(random(), 0.4, random() - 0.5)];
        let mut indices = Vec::new();
        for face in 0..count {
            indices.extend([0, 1, 2 + face]);
            fan.push(at + Vec3::new(random() - 0.5, random() - 0.5, random() - 0.5));
        }
        parts.push(mesh(fan, indices));
    }
    scene(parts)
}

fn lights() -> Vec<AreaLight> {
    let shapes = [
        LightShape::Point,
        LightShape::Disk { radius: 1.0 },
        LightShape::Sphere { radius: 1.0 },
        LightShape::Rect {
            width: 2.0,
            height: 0.6,
        },
        LightShape::Line { length: 3.0 },
        LightShape::Sun {
            angular_diameter: 0.2,
        },
    ];
    let at = |shape| {
        let down = Vec3::new(0.2, -1.0, 0.1).normalize();
        AreaLight::new(shape, Vec3::new(0.5, 6.0, -0.4), down, Vec3::X)
    };
    shapes.map(at).to_vec()
}

/// Rounding leaves undecided what is nearer than this to being seen edge-on.
const UNDECIDED: f64 = 4.0e-6;

#[test]
fn edges_seen_from_the_centre_are_exact() {
    let _one = support::serial();
    let scene = shapes();
    let faces = faces(&scene);
    for light in lights().into_iter().skip(4) {
        let found = found(&scene, light, SilhouetteRule::Center);
        let w = f64::from(u8::from(!light.shape.is_sun()));
        let center = if light.shape.is_sun() {
            -light.direction.as_dvec3()
        } else {
            light.center.as_dvec3()
        };
        for (edge, faces) in &faces {
            let clear = silhouette(edge, faces, center, w);
            let listed = found.contains(edge);
            assert!(
                listed == (clear > 0.0) || clear.abs() < UNDECIDED,
                "{edge:?}: {clear}"
            );
        }
        assert!(found.len() > 60 && found.len() < faces.len() / 2);
    }
}

#[test]
fn no_edge_seen_from_some_point_of_the_light_is_missed() {
    let _one = support::serial();
    let scene = shapes();
    let faces = faces(&scene);
    for light in lights() {
        let found = found(&scene, light, SilhouetteRule::WholeLight);
        let w = f64::from(u8::from(!light.shape.is_sun()));
        let points = points(&light);
        let mut seen = 0;
        let mut extra = 0;
        for (edge, faces) in &faces {
            let clearest = points.iter().map(|p| silhouette(edge, faces, *p, w));
            let clearest = clearest.fold(f64::NEG_INFINITY, f64::max);
            let listed = found.contains(edge);
            assert!(
                listed || clearest < UNDECIDED,
                "{:?}: {edge:?}: {clearest}",
                light.shape
            );
            seen += usize::from(clearest > 0.0);
            // Points tried are not all points: only what is far from a silhouette must not be there,
            // and only where at most two faces meet.
            let two = faces.len() <= 2;
            assert!(
                !listed || !two || clearest > -0.01,
                "{:?}: {clearest}",
                light.shape
            );
            extra += usize::from(listed && clearest < 0.0);
        }
        println!(
            "{:?}: {seen} of {}, {extra} more listed",
            light.shape,
            faces.len()
        );
        assert!(extra <= 2 + faces.len() / 100, "{:?}: {extra}", light.shape);
    }
}

#[test]
fn the_list_does_not_change_from_run_to_run() {
    let _one = support::serial();
    let scene = shapes();
    let light = lights()[1];
    let first = found(&scene, light, SilhouetteRule::WholeLight);
    let second = found(&scene, light, SilhouetteRule::WholeLight);
    assert!(first == second && !first.is_empty());
}
