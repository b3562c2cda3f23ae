//! Whole frames on a device of our own, brought back to memory.

use super::dump::{CapturedImage, Dump, Source};
use super::frame::{
    CaptureError, CapturedFrame, CapturedLight, FrameRequest, Shadows, check, declare,
};
use super::kept::KeptMasks;
use super::kept_edges::KeptSilhouettes;
use crate::gpu::{Buffer, Gpu, GpuError, MemoryLocation, Retired, ValidationMessage};
use crate::graph::{
    Access, BufferDesc, BufferPart, BufferState, FrameCache, FrameReport, Graph, HostBuffer,
    ImagePart, PassKind, Plan,
};
use crate::renderer::{Frame, SceneBuffers, Survey, UploadError};
use crate::scene::Scene;
use crate::shadow::Tally;
use ash::vk;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::time::Instant;

/// Name of the passes that copy images to the host: no part of the frame.
const READ_BACK: &str = "read back";

/// How a frame is rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Whole,
    /// And the techniques' counts are brought back.
    Counted,
    /// With what techniques made in an earlier frame, where it fits.
    Static,
}

/// Renders frames of a scene, and of the scenes that follow it in an animation.
pub struct FrameRenderer<'s> {
    gpu: Gpu,
    scene: Cow<'s, Scene>,
    buffers: SceneBuffers,
    cache: FrameCache,
    kept: Option<KeptMasks>,
    kept_silhouettes: Option<KeptSilhouettes>,
    /// Of both.
    kept_filled: bool,
}

impl<'s> FrameRenderer<'s> {
    /// Uploads a scene to a device of our own. The device is destroyed if that fails.
    pub fn new(gpu: Gpu, scene: &'s Scene) -> Result<Self, CaptureError> {
        Self::with(gpu, Cow::Borrowed(scene))
    }

    fn with(mut gpu: Gpu, scene: Cow<'s, Scene>) -> Result<Self, CaptureError> {
        match upload(&mut gpu, &scene) {
            Ok(buffers) => Ok(Self {
                gpu,
                scene,
                buffers,
                cache: FrameCache::new(),
                kept: None,
                kept_silhouettes: None,
                kept_filled: false,
            }),
            Err(error) => {
                match gpu.destroy() {
                    Ok(messages) => {
                        for message in messages {
                            log::warn!("after a failed upload: {message}");
                        }
                    }
                    Err(second) => log::warn!("after a failed upload: {second}"),
                }
                Err(error)
            }
        }
    }

    /// The scene that [`render`](Self::render) renders.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Goes on with another scene, such as the next moment of an animation. Device, pipelines and
    /// transient memory stay, and so does what is on the device if only lights and cameras differ;
    /// returns whether it was uploaded anew. After an error the renderer is as it was.
    pub fn set_scene(&mut self, scene: Scene) -> Result<bool, CaptureError> {
        let old = &*self.scene;
        let same = old.primitives == scene.primitives
            && old.materials == scene.materials
            && old.images == scene.images
            && old.bounds == scene.bounds;
        if !same {
            let buffers = upload(&mut self.gpu, &scene)?;
            let old_buffers = std::mem::replace(&mut self.buffers, buffers);
            let earlier = (old_buffers, &*self.scene);
            // `run` has waited: no frame uses the old ones any more.
            (self.buffers.continue_edges(&scene, earlier)).destroy(&mut self.gpu);
        }
        if !same || self.scene.lights != scene.lights {
            self.forget_kept();
        }
        self.scene = Cow::Owned(scene);
        Ok(!same)
    }

    /// Renders one frame and waits for it.
    pub fn render(&mut self, request: &FrameRequest) -> Result<CapturedFrame, CaptureError> {
        self.render_with_images(request, &[])
    }

    /// As [`render`](Self::render), and brings back images of the frame by name: `depth` (metres
    /// along the view direction, 0 where nothing was hit), `normal` and `shading_normal` (world
    /// axes), `visibility` (of the first light), `visibility_bound` (the most that it is off, where the
    /// technique proves that), or any image that the frame writes, under its name
    /// in the [`Plan`]; `NAME[LAYER]` and `NAME[LAYER,LEVEL]` are parts of it.
    ///
    /// # Errors
    /// As for [`render`](Self::render), and [`CaptureError::NoSuchImage`],
    /// [`CaptureError::NoSuchPart`] or [`CaptureError::DumpFormat`].
    pub fn render_with_images(
        &mut self,
        request: &FrameRequest,
        names: &[&str],
    ) -> Result<CapturedFrame, CaptureError> {
        self.render_one(request, names, Mode::Whole)
    }

    /// As [`render`](Self::render), and fills in the lights' counters, for which the device may do
    /// more than it does for the picture.
    pub fn render_counted(
        &mut self,
        request: &FrameRequest,
    ) -> Result<CapturedFrame, CaptureError> {
        self.render_one(request, &[], Mode::Counted)
    }

    /// As [`render`](Self::render), but what the technique made is kept, and used again while scene
    /// and request stay as they are: such a frame has no pass of the technique. If only the camera
    /// moves, silhouettes are not searched for again. The counters `masks_kept` and `silhouettes_kept`
    /// say for how many lights that was so.
    pub fn render_static(&mut self, request: &FrameRequest) -> Result<CapturedFrame, CaptureError> {
        self.render_one(request, &[], Mode::Static)
    }

    fn forget_kept(&mut self) {
        if let Some(kept) = self.kept.take() {
            kept.retire(&mut self.gpu);
        }
        if let Some(kept) = self.kept_silhouettes.take() {
            kept.retire(&mut self.gpu);
        }
    }

    fn render_one(
        &mut self,
        request: &FrameRequest,
        names: &[&str],
        mode: Mode,
    ) -> Result<CapturedFrame, CaptureError> {
        let reuse = mode == Mode::Static;
        let most = self.gpu.info().limits.max_image_dimension2_d;
        let lights = check(&self.scene, request, most)?;
        let start = Instant::now();
        let filled = reuse && self.kept_filled;
        let kept = (self.kept.as_ref()).filter(|kept| filled && kept.fit(request));
        let shadows = match kept {
            Some(kept) => Shadows::Kept(kept),
            None => {
                let (camera, technique) = (&request.camera, request.technique);
                let survey = Survey::new(&self.buffers, camera, request.size, &lights, technique)?;
                let kept = self.kept_silhouettes.as_ref();
                Shadows::Made(survey, kept.filter(|kept| filled && kept.fit(request)))
            }
        };
        let (masks_kept, silhouettes_kept, reads_edges) = match &shadows {
            Shadows::Kept(_) => (lights.len(), 0, false),
            Shadows::Made(survey, kept) => {
                let silhouettes = kept.map_or(0, KeptSilhouettes::count);
                (0, silhouettes, survey.reads_edges())
            }
        };
        // They stay for all frames of the scene.
        let mut aside_ms = 0.0;
        if reads_edges && !self.buffers.has_edges() {
            let aside = Instant::now();
            let (buffers, scene) = (&mut self.buffers, &*self.scene);
            let add = |gpu: &mut Gpu, cmd| buffers.add_edges(gpu, cmd, scene);
            if let Err(error) = self.gpu.run(add) {
                self.buffers.forget_edges();
                return Err(error.into());
            }
            aside_ms += milliseconds(aside);
        }

        let pipelines = self.gpu.pipelines_created();
        let mut graph = Graph::continuing(self.cache.history());
        let frame = declare(&mut graph, &self.buffers, request, &lights, &shadows)?;
        if reuse && masks_kept == 0 {
            // Until the device has filled them they fit nothing.
            self.kept_filled = false;
            if let Some(old) = self.kept.take() {
                old.retire(&mut self.gpu);
            }
            let kept = KeptMasks::new(&mut self.gpu, request, &frame)?;
            kept.fill(&mut graph, &frame.masks);
            self.kept = Some(kept);
            if silhouettes_kept == 0 {
                if let Some(old) = self.kept_silhouettes.take() {
                    old.retire(&mut self.gpu);
                }
                let kept = KeptSilhouettes::new(&mut self.gpu, &graph, request, &frame.masks)?;
                if let Some(kept) = &kept {
                    kept.fill(&mut graph, &frame.masks);
                }
                self.kept_silhouettes = kept;
            }
        }
        let wanted = ReadBacks::new(&graph, &frame, request, names, mode == Mode::Counted)?;
        let aside = Instant::now();
        let (usage, location) = (vk::BufferUsageFlags::TRANSFER_DST, MemoryLocation::GpuToCpu);
        let target = (self.gpu).create_buffer(READ_BACK, wanted.bytes, usage, location)?;
        aside_ms += milliseconds(aside);

        wanted.declare(&mut graph, &target);
        let recorded = run(&mut self.gpu, &mut self.cache, graph);
        let total_ms = milliseconds(start);
        let result = recorded.map(|(plan, report)| {
            let mut passes = self.gpu.collect_timings();
            let copies_ms: f64 = (passes.iter())
                .filter(|(name, _)| name == READ_BACK)
                .map(|(_, ms)| ms)
                .sum();
            passes.retain(|(name, _)| name != READ_BACK);
            let created = self.gpu.pipelines_created() - pipelines;
            let bytes = target.mapped().unwrap_or_default();
            CapturedFrame {
                size: request.size,
                color: wanted.take(0, bytes),
                lights: wanted.lights(request, &frame, &plan, bytes),
                images: wanted.images(bytes),
                counters: self.counters(&plan, &report, created, [masks_kept, silhouettes_kept]),
                passes,
                frame_ms: (total_ms - aside_ms - copies_ms).max(0.0),
                plan,
                report,
            }
        });
        match &result {
            Ok(_) => self.gpu.destroy_buffer(target),
            // The device may be writing it still.
            Err(_) => self.gpu.retire(Retired::Buffer(target)),
        }
        self.kept_filled |= reuse && result.is_ok();
        result
    }

    fn counters(
        &self,
        plan: &Plan,
        report: &FrameReport,
        pipelines: usize,
        [masks_kept, silhouettes_kept]: [usize; 2],
    ) -> BTreeMap<String, u64> {
        let mut counts = vec![
            ("barriers", report.barriers as u64),
            ("masks_kept", masks_kept as u64),
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
        if self.buffers.has_edges() {
            counts.push(("edges", self.buffers.edge_count() as u64));
            counts.push(("edges_found", self.buffers.edges_found()));
            counts.push(("silhouettes_kept", silhouettes_kept as u64));
        }
        let named = counts.into_iter();
        named.map(|(name, n)| (name.to_string(), n)).collect()
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Gives everything back; returns what the validation layer said, leaks included.
    pub fn destroy(self) -> Result<Vec<ValidationMessage>, GpuError> {
        self.into_gpu().destroy()
    }

    /// Gives everything back but the device, which frees it when its next frame begins.
    pub fn into_gpu(mut self) -> Gpu {
        self.forget_kept();
        self.cache.destroy(&mut self.gpu);
        self.buffers.retire(&mut self.gpu);
        self.gpu
    }
}

impl FrameRenderer<'static> {
    /// As [`new`](Self::new), with a scene of its own.
    pub fn owning(gpu: Gpu, scene: Scene) -> Result<Self, CaptureError> {
        Self::with(gpu, Cow::Owned(scene))
    }
}

fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1.0e3
}

fn upload(gpu: &mut Gpu, scene: &Scene) -> Result<SceneBuffers, CaptureError> {
    let mut made = None;
    let uploaded = gpu.run(|gpu, cmd| {
        made = Some(SceneBuffers::upload(gpu, cmd, scene)?);
        Ok::<_, UploadError>(())
    });
    match (uploaded, made) {
        (Ok(()), Some(buffers)) => Ok(buffers),
        (Err(error), made) => {
            if let Some(buffers) = made {
                buffers.retire(gpu);
            }
            Err(error.into())
        }
        (Ok(()), None) => unreachable!("what was recorded is there"),
    }
}

/// Plans and records a frame, submits it and waits.
fn run(
    gpu: &mut Gpu,
    cache: &mut FrameCache,
    graph: Graph<'_>,
) -> Result<(Plan, FrameReport), CaptureError> {
    let compiled = graph.compile(gpu)?;
    let plan = compiled.plan().clone();
    let report = gpu.run(|gpu, cmd| compiled.record(gpu, cache, cmd))?;
    Ok((plan, report))
}

/// What is copied to the host, and where in the buffer: the picture, each light's visibility, then
/// the images asked for by name.
struct ReadBacks {
    sources: Vec<(Source, u64)>,
    dumps: Vec<Dump>,
    /// Of each light, and the place of its image among the sources.
    tallies: Vec<Vec<(Tally, usize)>>,
    /// Number of sources before those of the dumps.
    fixed: usize,
    /// Size of the buffer.
    bytes: u64,
}

impl ReadBacks {
    fn new(
        graph: &Graph<'_>,
        frame: &Frame,
        request: &FrameRequest,
        names: &[&str],
        is_counted: bool,
    ) -> Result<Self, CaptureError> {
        let find = |name: &&str| Dump::find(graph, frame, name);
        let dumps: Vec<Dump> = names.iter().map(find).collect::<Result<_, _>>()?;
        let [width, height] = request.size;
        let picture = |image, texel_bytes| Source {
            image,
            mip: 0,
            first_layer: 0,
            layers: 1,
            width,
            height,
            texel_bytes,
        };
        let mut sources = vec![picture(frame.radiance, 16)];
        sources.extend(frame.visibility.iter().map(|image| picture(*image, 4)));
        let mut tallies = Vec::new();
        for mask in &frame.masks {
            // A limit that was asked for is told by the counters too.
            let wanted = is_counted || request.technique.has_limit();
            let made = [mask.tally, mask.settled].into_iter().flatten();
            let mut own = Vec::new();
            for tally in made.filter(|_| wanted) {
                if let Some(desc) = graph.image_desc(tally.image) {
                    own.push((tally, sources.len()));
                    sources.push(Source {
                        width: desc.width,
                        height: desc.height,
                        layers: desc.layers,
                        ..picture(tally.image, 4)
                    });
                }
            }
            tallies.push(own);
        }
        let fixed = sources.len();
        sources.extend(dumps.iter().flat_map(|dump| dump.sources.iter().copied()));
        let mut bytes = 0u64;
        let place = |source: Source| {
            // Copies start at a multiple of the texel's size.
            let offset = bytes.next_multiple_of(16);
            bytes = offset + source.bytes();
            (source, offset)
        };
        Ok(Self {
            sources: sources.into_iter().map(place).collect(),
            dumps,
            tallies,
            fixed,
            bytes,
        })
    }

    /// Declares the copies. They keep what they read in the frame and in memory.
    fn declare(&self, graph: &mut Graph<'_>, target: &Buffer) {
        let host = HostBuffer {
            buffer: target.raw,
            desc: BufferDesc { size: target.size },
            usage: target.usage,
            enter: BufferState::IDLE,
            leave: BufferState::HOST_READ,
        };
        let mut buffer = graph.import_buffer(READ_BACK, host);
        for &(source, offset) in &self.sources {
            let (image, size) = (source.image, source.bytes());
            let part = ImagePart {
                base_mip: source.mip,
                mips: 1,
                base_layer: source.first_layer,
                layers: source.layers,
            };
            let mut pass = graph.pass(READ_BACK, PassKind::Transfer);
            pass.read_part(image, part, Access::CopyRead);
            let place = BufferPart { offset, size };
            buffer = pass.overwrite_part(buffer, place, Access::CopyWrite);
            let target = buffer;
            pass.record(move |ctx| ctx.copy_image_to_buffer(image, part, target, offset));
        }
    }

    fn bytes_of<'b>(&self, at: usize, bytes: &'b [u8]) -> &'b [u8] {
        let Some(&(source, offset)) = self.sources.get(at) else {
            return &[];
        };
        let range = offset as usize..(offset + source.bytes()) as usize;
        bytes.get(range).unwrap_or_default()
    }

    fn take<T: bytemuck::Pod>(&self, at: usize, bytes: &[u8]) -> Vec<T> {
        bytemuck::pod_collect_to_vec(self.bytes_of(at, bytes))
    }

    /// The lights, with the passes that make their visibility.
    fn lights(
        &self,
        request: &FrameRequest,
        frame: &Frame,
        plan: &Plan,
        bytes: &[u8],
    ) -> Vec<CapturedLight> {
        let ranges = request.lights.iter().zip(&frame.visibility_passes);
        let lights = ranges.zip(frame.choices.iter().cloned()).enumerate();
        let lights = lights.map(|(at, ((light, range), choice))| {
            let passes = plan.passes.iter();
            let own = passes.filter(|pass| range.contains(&pass.declared));
            let tallies = self.tallies.get(at).into_iter().flatten();
            let counts =
                tallies.flat_map(|(tally, at)| (tally.count)(&self.take::<u32>(*at, bytes)));
            CapturedLight {
                counters: counts.map(|(name, n)| (name.to_string(), n)).collect(),
                light: *light,
                visibility: self.take(1 + at, bytes),
                passes: own.map(|pass| pass.name.to_string()).collect(),
                choice,
            }
        });
        lights.collect()
    }

    fn images(&self, bytes: &[u8]) -> Vec<CapturedImage> {
        let mut at = self.fixed;
        let images = self.dumps.iter().map(|dump| {
            let parts: Vec<&[u8]> = (at..at + dump.sources.len())
                .map(|at| self.bytes_of(at, bytes))
                .collect();
            at += dump.sources.len();
            dump.decode(&parts)
        });
        images.collect()
    }
}
