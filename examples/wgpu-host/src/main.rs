//! An engine on wgpu that draws a G-buffer, has antumbra record the visibility of a disk light, and lights its
//! picture with it. Two frames are in flight.
//!
//! ```sh
//! cargo run --manifest-path examples/wgpu-host/Cargo.toml -- picture.ppm ssoc
//! ```
//!
//! The device needs features that wgpu does not ask for, so it is made by hand, as wgpu would ([`engine`]). A frame
//! is [`Shadows::record`] between two passes of wgpu's ([`passes`]), in an encoder of its own: wgpu does not let its
//! own commands and others into one. Before it, wgpu brings its textures into states that it and antumbra agree on
//! (`transition_resources`); antumbra takes them over from there and hands them back in the same states.

mod engine;
mod passes;

use std::collections::VecDeque;
use std::io::Write as _;

use antumbra::ash::vk;
use antumbra::gpu::Gpu;
use antumbra::graph::{Access, FrameCache, Graph, HostImage, ImageDesc, ImageState, PassKind};
use antumbra::light::{AreaLight, LightShape};
use antumbra::renderer::{GBuffer, NamedLight, SceneBuffers, add_triangle_ids, add_visibility};
use antumbra::scene::{Aabb, Material, Primitive, Scene, SceneCamera};
use antumbra::shadow::Technique;
use engine::Engine;
use glam::Vec3;
use passes::Passes;
use wgpu::TextureUses;
use wgpu::hal::api::Vulkan;

const SIZE: u32 = 384;
const FRAMES_IN_FLIGHT: usize = 2;
const FRAMES: usize = 5;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> std::process::ExitCode {
    let mut arguments = std::env::args().skip(1);
    let path = arguments
        .next()
        .unwrap_or_else(|| "wgpu-host.ppm".to_string());
    let technique = arguments.next().unwrap_or_else(|| "ssoc".to_string());
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
fn run(technique: &str) -> Outcome<Vec<u8>> {
    let technique: Technique = technique.parse()?;
    let triangles = triangles();
    let camera = SceneCamera {
        position: Vec3::new(0.0, 3.0, 6.0),
        right: Vec3::X,
        up: Vec3::new(0.0, 6.0, -3.0).normalize(),
        forward: Vec3::new(0.0, -3.0, -6.0).normalize(),
        yfov: 0.8,
        znear: 0.1,
        ..SceneCamera::framing(&Aabb::EMPTY)
    };
    let engine = Engine::new()?;
    let passes = Passes::new(&engine, &triangles);
    let mut shadows = Shadows::new(&engine, &scene(&triangles)?, technique)?;

    let mut submitted = VecDeque::new();
    for frame in 0..FRAMES {
        // Before antumbra begins frame n, frame n - FRAMES_IN_FLIGHT is done.
        if submitted.len() == FRAMES_IN_FLIGHT {
            engine.wait(submitted.pop_front())?;
        }
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
        passes.place(&engine.queue, &camera, light.light.center);
        let encoders = [(); 3].map(|()| engine.device.create_command_encoder(&Default::default()));
        let [mut before, mut ours, mut after] = encoders;
        passes.draw_surfaces(&mut before);
        hand_over(&mut before, &passes);
        shadows.record(&mut ours, &passes, &camera, &light)?;
        passes.draw_lighting(&mut after);
        let commands = [before, ours, after].map(wgpu::CommandEncoder::finish);
        submitted.push_back(engine.queue.submit(commands));
    }
    engine.wait(None)?;
    let picture = passes.read(&engine)?;
    shadows.end()?;
    drop((passes, engine));
    match engine::messages() {
        0 => Ok(picture
            .chunks(4)
            .flat_map(|rgba| rgba[..3].to_vec())
            .collect()),
        messages => Err(format!("wgpu or the validation layer had {messages} messages").into()),
    }
}

/// Everything of antumbra's.
struct Shadows {
    gpu: Gpu,
    cache: FrameCache,
    scene: SceneBuffers,
    technique: Technique,
}

impl Shadows {
    /// Takes the device as a guest and uploads the triangles with a submission of wgpu's.
    fn new(engine: &Engine, scene: &Scene, technique: Technique) -> Outcome<Self> {
        let mut gpu = Gpu::from_host(engine.lend()?)?;
        let mut encoder = engine.device.create_command_encoder(&Default::default());
        let uploaded = with_commands(&mut encoder, |cmd| {
            gpu.begin_frame()?;
            let mut buffers = SceneBuffers::upload(&mut gpu, cmd, scene)?;
            if technique.reads_edges() {
                buffers.add_edges(&mut gpu, cmd, scene)?;
            }
            Ok(buffers)
        })?;
        engine.queue.submit([encoder.finish()]);
        Ok(Self {
            gpu,
            cache: FrameCache::new(),
            scene: uploaded,
            technique,
        })
    }

    /// Records the light's visibility from the engine's G-buffer into its image of it.
    fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        passes: &Passes,
        camera: &SceneCamera,
        light: &NamedLight,
    ) -> Outcome<()> {
        self.gpu.begin_frame()?;
        let mut graph = Graph::continuing(self.cache.history());
        let [view_depth, normal, target] = {
            let mut imported = Vec::new();
            for (texture, (_, state)) in shared(passes) {
                imported.push(graph.import_image("host", host_image(texture, state)?));
            }
            imported.try_into().map_err(|_| "three images")?
        };
        let ids = self.scene.import(&mut graph);
        let size = [SIZE; 2];
        let gbuffer = GBuffer {
            ids: add_triangle_ids(&mut graph, &self.scene, &ids, camera, size),
            view_depth,
            geometric_normal: normal,
            shading_normal: normal,
        };
        let lights = std::slice::from_ref(light);
        let scene = (&self.scene, ids);
        let found = add_visibility(
            &mut graph,
            scene,
            gbuffer,
            camera,
            size,
            lights,
            self.technique,
        )?;
        let visibility = found.masks[0].visibility;
        let mut pass = graph.pass("host.copy", PassKind::Transfer);
        pass.read(visibility, Access::CopyRead);
        let target = pass.overwrite(target, Access::CopyWrite);
        pass.record(move |ctx| ctx.copy_image(visibility, target));

        let compiled = graph.compile(&self.gpu)?;
        with_commands(encoder, |cmd| {
            compiled.record(&mut self.gpu, &mut self.cache, cmd)?;
            Ok(())
        })
    }

    /// When the device is idle.
    fn end(mut self) -> Outcome<()> {
        self.cache.destroy(&mut self.gpu);
        self.scene.destroy(&mut self.gpu);
        self.gpu.destroy()?;
        Ok(())
    }
}

/// The textures that antumbra reads and writes, in states that both have a name for.
fn shared(passes: &Passes) -> [(&wgpu::Texture, (TextureUses, ImageState)); 3] {
    let read = ImageState {
        layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
        stages: vk::PipelineStageFlags2::VERTEX_SHADER
            | vk::PipelineStageFlags2::FRAGMENT_SHADER
            | vk::PipelineStageFlags2::COMPUTE_SHADER,
        access: vk::AccessFlags2::SHADER_READ,
    };
    let written = ImageState {
        layout: vk::ImageLayout::TRANSFER_DST_OPTIMAL,
        stages: vk::PipelineStageFlags2::ALL_TRANSFER,
        access: vk::AccessFlags2::TRANSFER_WRITE,
    };
    [
        (&passes.view_depth, (TextureUses::RESOURCE, read)),
        (&passes.normal, (TextureUses::RESOURCE, read)),
        (&passes.visibility, (TextureUses::COPY_DST, written)),
    ]
}

/// wgpu's half of the hand-over: brings the shared textures into their states.
fn hand_over(encoder: &mut wgpu::CommandEncoder, passes: &Passes) {
    let textures = shared(passes);
    encoder.transition_resources(
        std::iter::empty(),
        textures
            .iter()
            .map(|(texture, (state, _))| wgpu::TextureTransition {
                texture: *texture,
                selector: None,
                state: *state,
            }),
    );
}

/// The Vulkan command buffer of an encoder, for a while.
fn with_commands<T>(
    encoder: &mut wgpu::CommandEncoder,
    record: impl FnOnce(vk::CommandBuffer) -> Outcome<T>,
) -> Outcome<T> {
    // SAFETY: the command buffer is recorded into and left open, and the encoder is not used meanwhile.
    unsafe {
        encoder.as_hal_mut::<Vulkan, _, _>(|commands| {
            let commands = commands.ok_or("not an encoder of Vulkan's")?;
            record(commands.raw_handle())
        })
    }
}

/// A texture of wgpu's as antumbra takes it: in `state` before and afterwards.
fn host_image(texture: &wgpu::Texture, state: ImageState) -> Outcome<HostImage> {
    use vk::ImageUsageFlags as U;
    // SAFETY: the image is used in the frame's command buffer only, and wgpu keeps it until that is done.
    let image = unsafe {
        let hal = texture
            .as_hal::<Vulkan>()
            .ok_or("not a texture of Vulkan's")?;
        hal.raw_handle()
    };
    let (format, usage) = match texture.format() {
        wgpu::TextureFormat::R32Uint => (vk::Format::R32_UINT, U::COLOR_ATTACHMENT | U::SAMPLED),
        _ if texture.usage().contains(wgpu::TextureUsages::COPY_DST) => {
            (vk::Format::R32_SFLOAT, U::TRANSFER_DST | U::SAMPLED)
        }
        _ => (vk::Format::R32_SFLOAT, U::COLOR_ATTACHMENT | U::SAMPLED),
    };
    Ok(HostImage {
        image,
        desc: ImageDesc::new(format, SIZE, SIZE),
        usage,
        enter: state,
        leave: state,
    })
}

/// A floor, and columns in a circle.
fn triangles() -> Vec<[Vec3; 3]> {
    const SIDES: usize = 24;
    let (mut triangles, mut tops) = (Vec::new(), Vec::new());
    let mut quad = |a: Vec3, b: Vec3, c: Vec3, d: Vec3| {
        triangles.push([a, b, c]);
        triangles.push([a, c, d]);
    };
    let p = Vec3::new;
    let w = 6.0;
    quad(p(-w, 0.0, w), p(w, 0.0, w), p(w, 0.0, -w), p(-w, 0.0, -w));
    for column in 0..5 {
        let turn = std::f32::consts::TAU * column as f32 / 5.0;
        let foot = p(1.4 * turn.sin(), 0.0, 1.4 * turn.cos() - 0.4);
        let around = |side: usize, radius: f32, height: f32| {
            let turn = std::f32::consts::TAU * (side % SIDES) as f32 / SIDES as f32;
            foot + p(radius * turn.sin(), height, radius * turn.cos())
        };
        let height = 0.8 + 0.2 * column as f32;
        for side in 0..SIDES {
            let next = side + 1;
            let [a, b] = [around(side, 0.22, 0.0), around(next, 0.22, 0.0)];
            let [c, d] = [around(next, 0.14, height), around(side, 0.14, height)];
            quad(a, b, c, d);
            tops.push([d, c, foot + p(0.0, height, 0.0)]);
        }
    }
    triangles.extend(tops);
    triangles
}

fn normal_of(corners: &[Vec3; 3]) -> Vec3 {
    let [a, b, c] = *corners;
    (b - a).cross(c - a).normalize_or(Vec3::Y)
}

/// The same triangles as antumbra wants them; corners at the same place count as one.
fn scene(triangles: &[[Vec3; 3]]) -> Outcome<Scene> {
    let mut scene = Scene {
        name: "columns".to_string(),
        materials: vec![Material::default()],
        primitives: vec![Primitive {
            name: "columns".to_string(),
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
