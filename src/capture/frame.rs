//! Whole frames on a device of our own, brought back to memory.

use crate::gpu::{Buffer, Gpu, GpuError, MemoryLocation, ValidationMessage};
use crate::graph::{
    Access, BufferDesc, BufferState, FakeMemory, FrameCache, FrameReport, Graph, GraphError,
    HostBuffer, ImageDesc, ImageId, ImagePart, PassKind, Plan,
};
use crate::renderer::{Frame, NamedLight, SceneBuffers, UploadError, add_frame};
use crate::scene::{Scene, SceneCamera};
use crate::shadow::{Technique, TechniqueError};
use ash::vk;
use std::collections::BTreeMap;
use std::time::Instant;

/// What to render.
#[derive(Clone, Debug)]
pub struct FrameRequest {
    /// The camera.
    pub camera: SceneCamera,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Lights, as indices into [`Scene::lights`]: all are shaded, and each one's visibility made.
    pub lights: Vec<usize>,
    /// How shadows are made.
    pub technique: Technique,
}

/// A rendered frame.
#[derive(Clone, Debug)]
pub struct CapturedFrame {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Linear radiance, row by row from the top; alpha 1 on surfaces, 0 elsewhere.
    pub color: Vec<[f32; 4]>,
    /// The lights asked for, in that order.
    pub lights: Vec<CapturedLight>,
    /// What was planned.
    pub plan: Plan,
    /// What was recorded.
    pub report: FrameReport,
    /// Milliseconds on the device of each pass, in order; empty where the queue has no timestamps.
    pub passes: Vec<(String, f64)>,
    /// Milliseconds from the start of the host's work on the frame until the device was done,
    /// without copies back to the host.
    pub frame_ms: f64,
    /// Counts of things, by name.
    pub counters: BTreeMap<String, u64>,
}

/// One light of a [`CapturedFrame`].
#[derive(Clone, Debug)]
pub struct CapturedLight {
    /// Index into [`Scene::lights`].
    pub light: usize,
    /// Part of the light that is seen, 0 to 1, row by row from the top.
    pub visibility: Vec<f32>,
    /// Passes that made it.
    pub passes: Vec<String>,
}

/// Why a frame could not be had.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// The size is 0 or above the device's limit.
    #[error("a picture of {width}x{height} pixels; each side must be 1 to {most}")]
    Size {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Largest side.
        most: u32,
    },
    /// An index beyond the scene's lights.
    #[error("light {light} asked for, but the scene has {count}")]
    NoSuchLight {
        /// The index.
        light: usize,
        /// Number of lights.
        count: usize,
    },
    /// The technique cannot do a light.
    #[error("light `{light}`: {source}")]
    Technique {
        /// The light's name.
        light: String,
        /// Why.
        source: TechniqueError,
    },
    /// The scene cannot be uploaded.
    #[error("scene: {0}")]
    Upload(#[from] UploadError),
    /// The frame's graph is wrong.
    #[error("frame: {0}")]
    Graph(#[from] GraphError),
    /// The device refused.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// Renders frames of one scene.
pub struct FrameRenderer<'s> {
    gpu: Gpu,
    scene: &'s Scene,
    buffers: SceneBuffers,
    cache: FrameCache,
}

/// An image on its way to host memory.
struct ReadBack {
    image: ImageId,
    desc: ImageDesc,
    texel_bytes: u64,
}

impl<'s> FrameRenderer<'s> {
    /// Uploads a scene to a device of our own. The device is destroyed if that fails.
    pub fn new(mut gpu: Gpu, scene: &'s Scene) -> Result<Self, CaptureError> {
        match gpu.run(|gpu, cmd| SceneBuffers::upload(gpu, cmd, scene)) {
            Ok(buffers) => Ok(Self {
                gpu,
                scene,
                buffers,
                cache: FrameCache::new(),
            }),
            Err(error) => {
                if let Err(second) = gpu.destroy() {
                    log::warn!("after a failed upload: {second}");
                }
                Err(error.into())
            }
        }
    }

    /// Renders one frame and waits for it.
    pub fn render(&mut self, request: &FrameRequest) -> Result<CapturedFrame, CaptureError> {
        let most = self.gpu.info().limits.max_image_dimension2_d;
        let lights = check(self.scene, request, most)?;
        let [width, height] = request.size;
        let pixels = u64::from(width) * u64::from(height);
        let images = 1 + request.lights.len() as u64;
        let bytes = pixels * (16 + 4 * (images - 1));
        let usage = vk::BufferUsageFlags::TRANSFER_DST;
        let location = MemoryLocation::GpuToCpu;
        let target = self
            .gpu
            .create_buffer("read back", bytes, usage, location)?;
        let result = self.render_into(request, &lights, &target);
        let frame = result.map(|frame| fill(frame, &target, request));
        self.gpu.destroy_buffer(target);
        frame
    }

    fn render_into(
        &mut self,
        request: &FrameRequest,
        lights: &[NamedLight],
        target: &Buffer,
    ) -> Result<CapturedFrame, CaptureError> {
        let start = Instant::now();
        let pipelines = self.gpu.pipelines_created();
        let mut graph = Graph::continuing(self.cache.history());
        let frame = declare(&mut graph, &self.buffers, request, lights);
        let host = HostBuffer {
            buffer: target.raw,
            desc: BufferDesc { size: target.size },
            usage: target.usage,
            enter: BufferState::IDLE,
            leave: BufferState::HOST_READ,
        };
        let mut offset = 0;
        let mut buffer = graph.import_buffer("read back", host);
        for read in read_backs(&frame, request) {
            let size = u64::from(read.desc.width) * u64::from(read.desc.height) * read.texel_bytes;
            let part = crate::graph::BufferPart { offset, size };
            let mut pass = graph.pass("read back", PassKind::Transfer);
            pass.read(read.image, Access::CopyRead);
            buffer = pass.overwrite_part(buffer, part, Access::CopyWrite);
            let (image, whole) = (read.image, ImagePart::whole(&read.desc));
            pass.record(move |ctx| ctx.copy_image_to_buffer(image, whole, buffer, offset));
            offset += size;
        }
        let compiled = graph.compile(&self.gpu)?;
        let plan = compiled.plan().clone();
        let cache = &mut self.cache;
        let report = self.gpu.run(|gpu, cmd| compiled.record(gpu, cache, cmd))?;
        let mut passes = self.gpu.collect_timings();
        let copies: f64 = passes
            .iter()
            .filter(|(n, _)| n == "read back")
            .map(|(_, ms)| ms)
            .sum();
        passes.retain(|(name, _)| name != "read back");
        let frame_ms = (start.elapsed().as_secs_f64() * 1.0e3 - copies).max(0.0);
        let counters = self.counters(&plan, &report, self.gpu.pipelines_created() - pipelines);
        Ok(CapturedFrame {
            size: request.size,
            color: Vec::new(),
            lights: captured_lights(request, &frame, &plan),
            plan,
            report,
            passes,
            frame_ms,
            counters,
        })
    }

    fn counters(
        &self,
        plan: &Plan,
        report: &FrameReport,
        pipelines: usize,
    ) -> BTreeMap<String, u64> {
        let counts = [
            ("barriers", report.barriers as u64),
            ("passes", report.passes.len() as u64),
            ("passes_culled", plan.culled.len() as u64),
            ("pipelines_created", pipelines as u64),
            ("transient_bytes", plan.peak_bytes()),
            ("transient_bytes_unaliased", plan.unaliased_bytes()),
            ("triangles", self.buffers.triangle_count() as u64),
            (
                "triangles_without_area",
                self.buffers.degenerate_count() as u64,
            ),
        ];
        counts.map(|(name, count)| (name.to_string(), count)).into()
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Gives everything back; returns what the validation layer said, leaks included.
    pub fn destroy(mut self) -> Result<Vec<ValidationMessage>, GpuError> {
        self.cache.destroy(&mut self.gpu);
        self.buffers.destroy(&mut self.gpu);
        self.gpu.destroy()
    }
}

/// Plans a frame without a device.
pub fn plan_frame(scene: &Scene, request: &FrameRequest) -> Result<Plan, CaptureError> {
    // The largest image that every Vulkan device of this engine's minimum can make.
    let lights = check(scene, request, 16384)?;
    let buffers = SceneBuffers::plan_only(scene);
    let mut graph = Graph::new();
    let frame = declare(&mut graph, &buffers, request, &lights);
    graph.keep(frame.radiance);
    for visibility in frame.visibility {
        graph.keep(visibility);
    }
    Ok(graph.compile(&FakeMemory)?.plan().clone())
}

/// Exposure that brings a picture's 98th percentile of luminance on surfaces to 0.8; 1 where
/// nothing is lit. Depends on nothing but the picture.
pub fn exposure(color: &[[f32; 4]]) -> f32 {
    let mut lit: Vec<f32> = color
        .iter()
        .filter(|texel| texel[3] > 0.0)
        .map(|[r, g, b, _]| 0.2126 * r + 0.7152 * g + 0.0722 * b)
        .filter(|luminance| luminance.is_finite() && *luminance > 0.0)
        .collect();
    if lit.is_empty() {
        return 1.0;
    }
    let rank = (lit.len() * 98 / 100).min(lit.len() - 1);
    let (_, luminance, _) = lit.select_nth_unstable_by(rank, f32::total_cmp);
    0.8 / *luminance
}

fn check(
    scene: &Scene,
    request: &FrameRequest,
    most: u32,
) -> Result<Vec<NamedLight>, CaptureError> {
    let [width, height] = request.size;
    if width == 0 || height == 0 || width > most || height > most {
        return Err(CaptureError::Size {
            width,
            height,
            most,
        });
    }
    let lights = request.lights.iter().map(|index| {
        let Some(found) = scene.lights.get(*index) else {
            return Err(CaptureError::NoSuchLight {
                light: *index,
                count: scene.lights.len(),
            });
        };
        let checked = request.technique.check(&found.light);
        checked.map_err(|source| CaptureError::Technique {
            light: found.name.clone(),
            source,
        })?;
        Ok(NamedLight {
            // Names need not be unique; pass names should be.
            name: format!("{index}:{}", found.name),
            light: found.light,
        })
    });
    lights.collect()
}

fn declare<'f>(
    graph: &mut Graph<'f>,
    buffers: &'f SceneBuffers,
    request: &FrameRequest,
    lights: &[NamedLight],
) -> Frame {
    let camera = &request.camera;
    add_frame(
        graph,
        buffers,
        camera,
        request.size,
        lights,
        request.technique,
    )
}

fn read_backs(frame: &Frame, request: &FrameRequest) -> Vec<ReadBack> {
    let [width, height] = request.size;
    let mut all = vec![ReadBack {
        image: frame.radiance,
        desc: ImageDesc::new(vk::Format::R32G32B32A32_SFLOAT, width, height),
        texel_bytes: 16,
    }];
    all.extend(frame.visibility.iter().map(|image| ReadBack {
        image: *image,
        desc: ImageDesc::new(vk::Format::R32_SFLOAT, width, height),
        texel_bytes: 4,
    }));
    all
}

/// The lights, with the passes that make their visibility.
fn captured_lights(request: &FrameRequest, frame: &Frame, plan: &Plan) -> Vec<CapturedLight> {
    let pairs = request.lights.iter().zip(&frame.visibility_passes);
    pairs
        .map(|(light, range)| {
            let own = plan
                .passes
                .iter()
                .filter(|pass| range.contains(&pass.declared));
            CapturedLight {
                light: *light,
                visibility: Vec::new(),
                passes: own.map(|pass| pass.name.to_string()).collect(),
            }
        })
        .collect()
}

/// Takes the pixels out of the buffer they were read back into.
fn fill(mut frame: CapturedFrame, target: &Buffer, request: &FrameRequest) -> CapturedFrame {
    let pixels = request.size[0] as usize * request.size[1] as usize;
    let bytes = target.mapped().unwrap_or_default();
    let (color, mut rest) = bytes.split_at((16 * pixels).min(bytes.len()));
    frame.color = bytemuck::pod_collect_to_vec(color);
    for light in &mut frame.lights {
        let (visibility, others) = rest.split_at((4 * pixels).min(rest.len()));
        light.visibility = bytemuck::pod_collect_to_vec(visibility);
        rest = others;
    }
    frame
}
