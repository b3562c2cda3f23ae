//! The smallest complete host: it owns instance, device, images and command buffers, draws a G-buffer
//! of its own, has the shadow of a disk light found between two of its own passes, and lights its
//! picture with it. Two frames are in flight.
//!
//! ```sh
//! cargo run --example embed -- picture.ppm pcss
//! ```
//!
//! What belongs to the host is [`Host`] and [`Passes`], in `embed/`; what it takes to embed is [`record`] and the
//! dozen lines of [`run`] around it.

#[path = "embed/host.rs"]
mod host;
#[path = "embed/passes.rs"]
mod passes;

use std::io::Write as _;

use antumbra::ash::vk;
use antumbra::gpu::Gpu;
use antumbra::graph::{Access, FrameCache, Graph, HostImage, ImageDesc, ImageState, PassKind};
use antumbra::light::{AreaLight, LightShape};
use antumbra::renderer::{GBuffer, NamedLight, SceneBuffers, add_triangle_ids, add_visibility};
use antumbra::scene::{Aabb, Material, Primitive, Scene, SceneCamera};
use antumbra::shadow::Technique;
use glam::Vec3;
use host::{Host, Image};
use passes::Passes;

const SIZE: u32 = 384;
const FRAMES_IN_FLIGHT: usize = 2;
const FRAMES: usize = 5;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

#[allow(dead_code)] // unused where this file is a module of a test
fn main() -> std::process::ExitCode {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().unwrap_or_else(|| "embed.ppm".to_string());
    let technique = arguments.next().unwrap_or_else(|| "pcss".to_string());
    let done = run(&technique).and_then(|rgb| {
        let mut bytes = format!("P6 {SIZE} {SIZE} 255\n").into_bytes();
        bytes.extend(rgb);
        Ok(std::fs::File::create(&path)?.write_all(&bytes)?)
    });
    match done {
        Ok(()) => {
            println!("{path}");
            std::process::ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            std::process::ExitCode::FAILURE
        }
    }
}

/// Draws some frames and returns the last one: RGB, 8 bits each, rows from the top.
pub fn run(technique: &str) -> Outcome<Vec<u8>> {
    let technique: Technique = technique.parse()?;
    let triangles = triangles();
    let scene = scene(&triangles)?;
    let camera = SceneCamera {
        position: Vec3::new(0.0, 3.0, 6.0),
        right: Vec3::X,
        up: Vec3::new(0.0, 6.0, -3.0).normalize(),
        forward: Vec3::new(0.0, -3.0, -6.0).normalize(),
        yfov: 0.8,
        znear: 0.1,
        ..SceneCamera::framing(&Aabb::EMPTY)
    };
    let host = Host::new()?;
    let passes = Passes::new(&host, &triangles)?;

    // Once: lend the device, upload the triangles.
    let mut gpu = Gpu::from_host(host.lend())?;
    let mut cache = FrameCache::new();
    let mut uploaded = None;
    host.submit(0, |cmd| {
        gpu.begin_frame()?;
        let mut buffers = SceneBuffers::upload(&mut gpu, cmd, &scene)?;
        if technique.reads_edges() {
            buffers.add_edges(&mut gpu, cmd, &scene)?;
        }
        uploaded = Some(buffers);
        Ok(())
    })?;
    let buffers = uploaded.ok_or("nothing was uploaded")?;

    for frame in 0..FRAMES {
        let angle = 0.05 * frame as f32;
        let light = NamedLight {
            name: "lamp".to_string(),
            light: AreaLight::new(
                LightShape::Disk { radius: 0.35 },
                Vec3::new(2.0 * angle.sin() - 1.0, 4.0, 1.0),
                Vec3::new(0.2, -1.0, -0.2),
                Vec3::X,
            ),
        };
        host.submit(frame % FRAMES_IN_FLIGHT, |cmd| {
            passes.draw_surfaces(&host, cmd, &camera);
            let lamp = std::slice::from_ref(&light);
            record(
                (&mut gpu, &mut cache, cmd),
                &buffers,
                &passes,
                &camera,
                lamp,
                technique,
            )?;
            passes.draw_lighting(&host, cmd, &camera, light.light.center);
            Ok(())
        })?;
    }
    host.wait_idle()?;
    let picture = passes.picture.read(&host)?;

    cache.destroy(&mut gpu);
    buffers.destroy(&mut gpu);
    gpu.destroy()?;
    passes.destroy(&host);
    let messages = host.end();
    if messages > 0 {
        return Err(format!("the validation layer had {messages} messages").into());
    }
    Ok(picture
        .chunks(4)
        .flat_map(|rgba| rgba[..3].to_vec())
        .collect())
}

/// Records the light's visibility into the host's command buffer: from the host's G-buffer into the
/// host's mask, each in the states that the host says.
fn record(
    (gpu, cache, cmd): (&mut Gpu, &mut FrameCache, vk::CommandBuffer),
    scene: &SceneBuffers,
    passes: &Passes,
    camera: &SceneCamera,
    lights: &[NamedLight],
    technique: Technique,
) -> Outcome<()> {
    gpu.begin_frame()?;
    let mut graph = Graph::continuing(cache.history());
    let drawn = ImageState {
        layout: vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
        stages: vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
        access: vk::AccessFlags2::COLOR_ATTACHMENT_WRITE,
    };
    let sampled = ImageState {
        layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
        stages: vk::PipelineStageFlags2::FRAGMENT_SHADER,
        access: vk::AccessFlags2::SHADER_SAMPLED_READ,
    };
    // What the last frame's lighting may still be reading, and nobody needs any more.
    let read_before = ImageState {
        layout: vk::ImageLayout::UNDEFINED,
        ..sampled
    };
    let mut import = |name: &'static str, image: &Image, enter| {
        graph.import_image(
            name,
            HostImage {
                image: image.raw,
                desc: ImageDesc::new(image.format, SIZE, SIZE),
                usage: image.usage,
                enter,
                leave: sampled,
            },
        )
    };
    let view_depth = import("host.view_depth", &passes.view_depth, drawn);
    let normal = import("host.normal", &passes.normal, drawn);
    let mask = import("host.mask", &passes.mask, read_before);

    let size = [SIZE; 2];
    let ids = scene.import(&mut graph);
    let gbuffer = GBuffer {
        ids: add_triangle_ids(&mut graph, scene, &ids, camera, size),
        view_depth,
        geometric_normal: normal,
        shading_normal: normal,
    };
    let found = add_visibility(
        &mut graph,
        (scene, ids),
        gbuffer,
        camera,
        size,
        lights,
        technique,
    )?;

    // Into the host's image; a pass of the host's own could as well read `visibility` itself.
    let visibility = found.masks[0].visibility;
    let mut pass = graph.pass("host.copy", PassKind::Transfer);
    pass.read(visibility, Access::CopyRead);
    let mask = pass.overwrite(mask, Access::CopyWrite);
    pass.record(move |ctx| ctx.copy_image(visibility, mask));
    graph.compile(gpu)?.record(gpu, cache, cmd)?;
    Ok(())
}

/// A floor and three boxes, as corners of triangles.
fn triangles() -> Vec<[Vec3; 3]> {
    let mut triangles = Vec::new();
    let mut quad = |a: Vec3, b: Vec3, c: Vec3, d: Vec3| {
        triangles.push([a, b, c]);
        triangles.push([a, c, d]);
    };
    let p = Vec3::new;
    let w = 6.0;
    quad(p(-w, 0.0, w), p(w, 0.0, w), p(w, 0.0, -w), p(-w, 0.0, -w));
    for (low, high) in [
        (p(-1.6, 0.0, -0.6), p(-1.0, 1.6, 0.0)),
        (p(-0.2, 0.7, -0.4), p(0.5, 1.1, 0.6)),
        (p(1.1, 0.0, -1.2), p(2.0, 0.8, -0.4)),
    ] {
        let c = |i: usize| {
            let pick = |axis: usize| {
                if i >> axis & 1 == 0 {
                    low[axis]
                } else {
                    high[axis]
                }
            };
            p(pick(0), pick(1), pick(2))
        };
        for [a, b, e, d] in [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ] {
            quad(c(a), c(b), c(e), c(d));
        }
    }
    triangles
}

fn normal_of(corners: &[Vec3; 3]) -> Vec3 {
    let [a, b, c] = *corners;
    (b - a).cross(c - a).normalize_or(Vec3::Y)
}

/// The same triangles as the technique wants them.
fn scene(triangles: &[[Vec3; 3]]) -> Outcome<Scene> {
    let mut scene = Scene {
        name: "boxes".to_string(),
        materials: vec![Material::default()],
        primitives: vec![Primitive {
            name: "boxes".to_string(),
            positions: triangles.iter().flatten().copied().collect(),
            normals: triangles.iter().flat_map(|t| [normal_of(t); 3]).collect(),
            indices: (0..3 * triangles.len() as u32).collect(),
            ..Primitive::default()
        }],
        ..Scene::default()
    };
    scene.finish()?;
    Ok(scene)
}
