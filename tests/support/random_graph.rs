//! Random graphs, decoded from a string of numbers so that a failing one shrinks.

#![allow(dead_code, reason = "each test binary uses its own part")]

use antumbra::ash::vk::{self, Handle};
use antumbra::graph::{
    Access, BufferDesc, BufferId, BufferPart, BufferState, Graph, HistoryState, HistoryStates,
    HostBuffer, HostImage, ImageDesc, ImageId, ImagePart, ImageState, PassBuilder, PassKind, Stage,
};

#[path = "random_uses.rs"]
mod uses;

use uses::{attachments, use_buffer, use_image};

/// Reads choices from a string of numbers; past its end every choice is 0.
pub struct Choices<'a> {
    numbers: &'a [u32],
    next: usize,
}

impl<'a> Choices<'a> {
    pub fn new(numbers: &'a [u32]) -> Self {
        Self { numbers, next: 0 }
    }

    /// A number below `count`.
    pub fn below(&mut self, count: usize) -> usize {
        let number = self.numbers.get(self.next).copied().unwrap_or(0);
        self.next += 1;
        number as usize % count.max(1)
    }

    pub fn chance(&mut self, percent: usize) -> bool {
        self.below(100) >= 100 - percent
    }

    pub fn done(&self) -> bool {
        self.next >= self.numbers.len()
    }
}

/// What random graphs may contain.
#[derive(Clone, Copy)]
pub struct Limits {
    pub passes: usize,
    pub images: usize,
    pub buffers: usize,
    /// Imports and history images.
    pub imports: bool,
}

/// Where a declared id stands.
#[derive(Clone)]
struct Image {
    id: ImageId,
    desc: ImageDesc,
    /// Cells with contents, level by level.
    written: Vec<bool>,
    depth: bool,
    history: bool,
    read_only: bool,
    tag: usize,
}

impl Image {
    fn used(&self, part: ImagePart, access: Access) -> Used {
        Used::Image {
            id: self.id,
            desc: self.desc,
            part,
            access,
            tag: self.tag,
        }
    }
}

#[derive(Clone)]
struct Buffer {
    id: BufferId,
    size: u64,
    /// Sixteenths of the buffer with contents.
    written: [bool; 16],
    tag: usize,
}

const STATES: [(vk::ImageLayout, vk::PipelineStageFlags2, vk::AccessFlags2); 5] = [
    (
        vk::ImageLayout::UNDEFINED,
        vk::PipelineStageFlags2::NONE,
        vk::AccessFlags2::NONE,
    ),
    (
        vk::ImageLayout::GENERAL,
        vk::PipelineStageFlags2::ALL_COMMANDS,
        vk::AccessFlags2::MEMORY_WRITE,
    ),
    (
        vk::ImageLayout::READ_ONLY_OPTIMAL,
        vk::PipelineStageFlags2::FRAGMENT_SHADER,
        vk::AccessFlags2::SHADER_SAMPLED_READ,
    ),
    (
        vk::ImageLayout::ATTACHMENT_OPTIMAL,
        vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
        vk::AccessFlags2::COLOR_ATTACHMENT_WRITE,
    ),
    (
        vk::ImageLayout::GENERAL,
        vk::PipelineStageFlags2::COMPUTE_SHADER,
        vk::AccessFlags2::from_raw(
            vk::AccessFlags2::SHADER_STORAGE_READ.as_raw()
                | vk::AccessFlags2::SHADER_STORAGE_WRITE.as_raw(),
        ),
    ),
];

fn image_state(c: &mut Choices<'_>, undefined: bool) -> ImageState {
    let first = usize::from(!undefined);
    let (layout, stages, access) = STATES[first + c.below(STATES.len() - first)];
    ImageState {
        layout,
        stages,
        access,
    }
}

fn buffer_state(c: &mut Choices<'_>) -> BufferState {
    let (_, stages, access) = STATES[[0, 1, 2, 4][c.below(4)]];
    BufferState { stages, access }
}

/// Gives every declared pass its commands, and imports their handles. By default there are no
/// commands and the handles are invented.
pub trait Recorder<'f> {
    /// Called once for each pass, after its uses were declared.
    fn record(&mut self, _pass: PassBuilder<'_, 'f>, _kind: PassKind, _uses: &[Used]) {}

    /// Whether graphs must be such that a device with our features can do what they declare.
    fn recordable(&self) -> bool {
        false
    }

    /// The host's image behind an import.
    fn image(&mut self, tag: usize, _: ImageDesc, _: ImageState, _: ImageState) -> vk::Image {
        vk::Image::from_raw(tag as u64 + 1)
    }

    /// The host's buffer behind an import.
    fn buffer(&mut self, tag: usize, _size: u64, _: BufferState, _: BufferState) -> vk::Buffer {
        vk::Buffer::from_raw(tag as u64 + 1)
    }

    /// What the last frames left; otherwise that is invented too.
    fn history(&mut self) -> Option<HistoryStates> {
        None
    }

    /// Called when all passes are there, with reads of what the graph keeps.
    fn finish(&mut self, _graph: &mut Graph<'f>, _kept: &[Used]) {}
}

/// A recorder that records nothing.
pub struct Nothing;

impl<'f> Recorder<'f> for Nothing {}

/// One declared use, for recorders. The tag is the number of the image or buffer; a history image
/// has one for both its versions. Recorders that record nothing read none of it.
#[derive(Clone, Copy, Debug)]
pub enum Used {
    Image {
        id: ImageId,
        desc: ImageDesc,
        part: ImagePart,
        access: Access,
        tag: usize,
    },
    Buffer {
        id: BufferId,
        part: BufferPart,
        access: Access,
        tag: usize,
    },
}

/// Where in a sixteenth of a buffer the arguments of a dispatch lie, in bytes; those of a draw lie at
/// its start.
const DISPATCH_OFFSET: u64 = 16;

/// What every texel of an image holds once it was written. Differs from image to image.
pub fn texel(tag: usize) -> f32 {
    (tag + 1) as f32 / 16.0
}

/// Declares a random graph.
pub fn random_graph<'f>(
    numbers: &[u32],
    limits: Limits,
    recorder: &mut impl Recorder<'f>,
) -> Graph<'f> {
    let c = &mut Choices::new(numbers);
    let history_desc = ImageDesc::new(vk::Format::R32_SFLOAT, 16, 16);
    let known = recorder.history();
    let mut history = HistoryStates::new();
    if limits.imports && c.chance(50) && known.is_none() {
        history.insert(
            "past",
            HistoryState {
                desc: history_desc,
                previous: image_state(c, false),
                current: image_state(c, false),
            },
        );
    }
    let mut graph = Graph::continuing(known.unwrap_or(history));
    let mut images = images(c, &mut graph, limits, history_desc, recorder);
    let mut buffers = buffers(c, &mut graph, limits, recorder);
    let recordable = recorder.recordable();
    let passes = 1 + c.below(limits.passes);
    for number in 0..passes {
        let kind = [PassKind::Compute, PassKind::Graphics, PassKind::Transfer][c.below(3)];
        let mut pass = graph.pass(format!("pass {number}"), kind);
        let mut uses = Vec::new();
        if kind == PassKind::Graphics {
            attachments(c, &mut pass, &mut images, &mut uses, recordable);
        }
        for _ in 0..c.below(5) {
            if c.chance(60) {
                use_image(c, kind, &mut pass, &mut images, &mut uses, recordable);
            } else {
                use_buffer(c, kind, &mut pass, &mut buffers, &mut uses, recordable);
            }
        }
        recorder.record(pass, kind, &uses);
        if c.done() && number > 0 {
            break;
        }
    }
    let mut kept = Vec::new();
    for image in &images {
        if image.written.contains(&true) && !image.read_only && c.chance(30) {
            graph.keep(image.id);
            let access = Access::Sampled(Stage::Compute);
            let parts = written_parts(image).into_iter();
            kept.extend(parts.map(|part| image.used(part, access)));
        }
    }
    for buffer in &buffers {
        if buffer.written.contains(&true) && (kept.is_empty() || c.chance(20)) {
            graph.keep(buffer.id);
            let unit = buffer.size / 16;
            let sixteenths = (0..16).filter(|i| buffer.written[*i]);
            kept.extend(sixteenths.map(|i| Used::Buffer {
                id: buffer.id,
                part: BufferPart {
                    offset: i as u64 * unit,
                    size: unit,
                },
                access: Access::StorageRead(Stage::Compute),
                tag: buffer.tag,
            }));
        }
    }
    recorder.finish(&mut graph, &kept);
    graph
}

/// The parts of an image with contents: all of it, or cell by cell.
fn written_parts(image: &Image) -> Vec<ImagePart> {
    if !image.written.contains(&false) {
        return vec![ImagePart::whole(&image.desc)];
    }
    let layers = image.desc.layers as usize;
    let written = (0..image.written.len()).filter(|cell| image.written[*cell]);
    written
        .map(|cell| ImagePart {
            base_mip: (cell / layers) as u32,
            mips: 1,
            base_layer: (cell % layers) as u32,
            layers: 1,
        })
        .collect()
}

fn images<'f>(
    c: &mut Choices<'_>,
    graph: &mut Graph<'f>,
    limits: Limits,
    history_desc: ImageDesc,
    recorder: &mut impl Recorder<'f>,
) -> Vec<Image> {
    let mut images = Vec::new();
    for number in 0..1 + c.below(limits.images) {
        let depth = c.chance(25);
        let format = if depth {
            vk::Format::D32_SFLOAT
        } else {
            vk::Format::R32_SFLOAT
        };
        let size = [16, 8, 32][c.below(3)];
        let desc = ImageDesc::new(format, size, size)
            .layers([1, 1, 2, 3][c.below(4)] as u32)
            .mips([1, 1, 3][c.below(3)] as u32);
        let cells = (desc.layers * desc.mips) as usize;
        let import = limits.imports && !depth && c.chance(20);
        let (id, written) = if import {
            let (enter, leave) = (image_state(c, true), image_state(c, false));
            let host = HostImage {
                image: recorder.image(number, desc, enter, leave),
                desc,
                usage: vk::ImageUsageFlags::from_raw(0xff),
                enter,
                leave,
            };
            let defined = enter.layout != vk::ImageLayout::UNDEFINED;
            (graph.import_image(format!("image {number}"), host), defined)
        } else {
            (graph.create_image(format!("image {number}"), desc), false)
        };
        images.push(Image {
            id,
            desc,
            written: vec![written; cells],
            depth,
            history: false,
            read_only: false,
            tag: number,
        });
    }
    if limits.imports && c.chance(50) {
        let history = graph.history_image("past", history_desc);
        let ids = history.previous.map(|id| (id, true));
        let tag = images.len();
        for (id, read_only) in ids.into_iter().chain([(history.current, false)]) {
            images.push(Image {
                id,
                desc: history_desc,
                written: vec![read_only],
                depth: false,
                history: true,
                read_only,
                tag,
            });
        }
    }
    images
}

fn buffers<'f>(
    c: &mut Choices<'_>,
    graph: &mut Graph<'f>,
    limits: Limits,
    recorder: &mut impl Recorder<'f>,
) -> Vec<Buffer> {
    (0..1 + c.below(limits.buffers))
        .map(|number| {
            let size = [4096, 16384][c.below(2)];
            let import = limits.imports && c.chance(20);
            let id = if import {
                let (enter, leave) = (buffer_state(c), buffer_state(c));
                let host = HostBuffer {
                    buffer: recorder.buffer(number, size, enter, leave),
                    desc: BufferDesc { size },
                    usage: vk::BufferUsageFlags::from_raw(0x1ff),
                    enter,
                    leave,
                };
                graph.import_buffer(format!("buffer {number}"), host)
            } else {
                graph.create_buffer(format!("buffer {number}"), BufferDesc { size })
            };
            Buffer {
                id,
                size,
                written: [import; 16],
                tag: number,
            }
        })
        .collect()
}
