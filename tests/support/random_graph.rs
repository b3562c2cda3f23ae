//! Random graphs, decoded from a string of numbers so that a failing one shrinks.

#![allow(dead_code, reason = "each test binary uses its own part")]

use antumbra::ash::vk::{self, Handle};
use antumbra::graph::{
    Access, BufferDesc, BufferId, BufferPart, BufferState, Graph, HistoryState, HistoryStates,
    HostBuffer, HostImage, ImageDesc, ImageId, ImagePart, ImageState, Load, PassBuilder, PassKind,
    Stage,
};

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

fn image_part(c: &mut Choices<'_>, desc: &ImageDesc) -> ImagePart {
    if c.chance(60) {
        return ImagePart::whole(desc);
    }
    let base_mip = c.below(desc.mips as usize) as u32;
    let base_layer = c.below(desc.layers as usize) as u32;
    ImagePart {
        base_mip,
        mips: 1 + c.below((desc.mips - base_mip) as usize) as u32,
        base_layer,
        layers: 1 + c.below((desc.layers - base_layer) as usize) as u32,
    }
}

fn cells(desc: &ImageDesc, part: &ImagePart) -> Vec<usize> {
    let mips = part.base_mip..part.base_mip + part.mips;
    let layers = part.base_layer..part.base_layer + part.layers;
    mips.flat_map(|mip| {
        layers
            .clone()
            .map(move |l| (mip * desc.layers + l) as usize)
    })
    .collect()
}

fn touches(uses: &[Used], id: ImageId, part: &ImagePart, desc: &ImageDesc) -> bool {
    let mine = cells(desc, part);
    uses.iter().any(|used| match used {
        Used::Image {
            id: other, part, ..
        } => {
            let theirs = cells(desc, part);
            other.same_resource(id) && theirs.iter().any(|cell| mine.contains(cell))
        }
        Used::Buffer { .. } => false,
    })
}

fn attachments(
    c: &mut Choices<'_>,
    pass: &mut PassBuilder<'_, '_>,
    images: &mut [Image],
    uses: &mut Vec<Used>,
    recordable: bool,
) {
    let mut size = None;
    let mut depth_done = false;
    for _ in 0..1 + c.below(3) {
        let index = c.below(images.len());
        let image = &mut images[index];
        let fixed = image.history && recordable;
        if image.read_only || fixed || (image.depth && depth_done) {
            continue;
        }
        let part = ImagePart {
            base_mip: c.below(image.desc.mips as usize) as u32,
            mips: 1,
            base_layer: c.below(image.desc.layers as usize) as u32,
            layers: 1,
        };
        let texels = image.desc.width >> part.base_mip;
        if *size.get_or_insert(texels) != texels || touches(uses, image.id, &part, &image.desc) {
            continue;
        }
        let cell = cells(&image.desc, &part)[0];
        if image.depth && image.written[cell] && part == ImagePart::mip(0) && c.chance(30) {
            depth_done = true;
            pass.depth_test(image.id);
            uses.push(image.used(part, Access::DepthTest));
            continue;
        }
        let load = match c.below(3) {
            0 => Load::Clear([texel(image.tag); 4]),
            1 => Load::Discard,
            _ if image.written[cell] => Load::Keep,
            _ => Load::Clear([texel(image.tag); 4]),
        };
        let access = match (image.depth, load == Load::Keep) {
            (true, true) => Access::DepthAttachmentLoad,
            (true, false) => Access::DepthAttachment,
            (false, true) => Access::ColorAttachmentLoad,
            (false, false) => Access::ColorAttachment,
        };
        image.id = if image.depth {
            depth_done = true;
            pass.depth_part(image.id, part, load)
        } else {
            pass.color_part(image.id, part, load)
        };
        image.written[cell] = true;
        uses.push(image.used(part, access));
    }
}

fn use_image(
    c: &mut Choices<'_>,
    kind: PassKind,
    pass: &mut PassBuilder<'_, '_>,
    images: &mut [Image],
    uses: &mut Vec<Used>,
    recordable: bool,
) {
    let index = c.below(images.len());
    let image = &mut images[index];
    let part = image_part(c, &image.desc);
    if touches(uses, image.id, &part, &image.desc) {
        return;
    }
    let stage = match kind {
        PassKind::Compute => Stage::Compute,
        _ => [Stage::Fragment, Stage::Vertex][c.below(2)],
    };
    let cells = cells(&image.desc, &part);
    let written = cells.iter().all(|cell| image.written[*cell]);
    let reads = match kind {
        PassKind::Transfer => vec![Access::CopyRead],
        _ if image.depth || (image.history && recordable) => vec![Access::Sampled(stage)],
        _ => vec![Access::Sampled(stage), Access::StorageRead(stage)],
    };
    // Vertex shaders may not store, and depth images are no storage images. On a device, fragment
    // shaders may not store either, and a history image has the usage of its first frame.
    let writes = match (kind, stage) {
        (PassKind::Transfer, _) => vec![Access::CopyWrite, Access::Clear],
        (_, Stage::Vertex) => vec![],
        _ if image.depth => vec![],
        _ if recordable && (stage == Stage::Fragment || image.history) => vec![],
        _ => vec![
            Access::StorageWrite(stage),
            Access::StorageReadWrite(stage),
            Access::StorageWrite(stage),
        ],
    };
    let write = !writes.is_empty() && !image.read_only && (!written || c.chance(40));
    if write {
        let mut access = writes[c.below(writes.len())];
        if access.reads() && !written {
            access = Access::StorageWrite(stage);
        }
        let keep = access.reads() || c.chance(40);
        for part in split(part, access, recordable) {
            image.id = if keep {
                pass.write_part(image.id, part, access)
            } else {
                pass.overwrite_part(image.id, part, access)
            };
            uses.push(image.used(part, access));
        }
        cells.iter().for_each(|cell| image.written[*cell] = true);
    } else if written {
        let access = reads[c.below(reads.len())];
        for part in split(part, access, recordable) {
            pass.read_part(image.id, part, access);
            uses.push(image.used(part, access));
        }
    }
}

/// A shader reaches one mip level through a storage image, so that on a device each is declared.
fn split(part: ImagePart, access: Access, recordable: bool) -> Vec<ImagePart> {
    let storage = access.info().layout == Some(vk::ImageLayout::GENERAL);
    if !storage || !recordable {
        return vec![part];
    }
    let levels = part.base_mip..part.base_mip + part.mips;
    levels
        .map(|base_mip| ImagePart {
            base_mip,
            mips: 1,
            ..part
        })
        .collect()
}

fn use_buffer(
    c: &mut Choices<'_>,
    kind: PassKind,
    pass: &mut PassBuilder<'_, '_>,
    buffers: &mut [Buffer],
    uses: &mut Vec<Used>,
    recordable: bool,
) {
    let index = c.below(buffers.len());
    let buffer = &mut buffers[index];
    let (first, count) = match c.below(2) {
        0 => (0, 16),
        _ => {
            let first = c.below(16);
            (first, 1 + c.below(16 - first))
        }
    };
    let unit = buffer.size / 16;
    let part = BufferPart {
        offset: first as u64 * unit,
        size: count as u64 * unit,
    };
    let taken = |buffer: &Buffer, part: &BufferPart| {
        uses.iter().any(|used| match used {
            Used::Buffer { id, part: of, .. } => {
                id.same_resource(buffer.id)
                    && of.offset < part.offset + part.size
                    && part.offset < of.offset + of.size
            }
            Used::Image { .. } => false,
        })
    };
    if taken(buffer, &part) {
        return;
    }
    let written = buffer.written[first..first + count].iter().all(|w| *w);
    let used = |buffer: &Buffer, part, access| Used::Buffer {
        id: buffer.id,
        part,
        access,
        tag: buffer.tag,
    };
    let stage = match kind {
        PassKind::Compute => Stage::Compute,
        _ => [Stage::Fragment, Stage::Vertex][c.below(2)],
    };
    let reads = match kind {
        PassKind::Transfer => vec![Access::CopyRead],
        PassKind::Compute => vec![
            Access::StorageRead(stage),
            Access::Uniform(stage),
            Access::TexelRead(stage),
            Access::Indirect,
        ],
        PassKind::Graphics => vec![
            Access::StorageRead(stage),
            Access::Uniform(stage),
            Access::TexelRead(stage),
            Access::Vertex,
            Access::Index,
            Access::Indirect,
        ],
    };
    let writes = match (kind, stage) {
        (PassKind::Transfer, _) => vec![Access::CopyWrite, Access::Clear],
        (_, Stage::Vertex) => vec![],
        (_, Stage::Fragment) if recordable => vec![],
        _ => vec![Access::StorageWrite(stage), Access::StorageReadWrite(stage)],
    };
    if !writes.is_empty() && (!written || c.chance(40)) {
        let mut access = writes[c.below(writes.len())];
        if access.reads() && !written {
            access = Access::StorageWrite(stage);
        }
        buffer.id = if access.reads() || c.chance(40) {
            pass.write_part(buffer.id, part, access)
        } else {
            pass.overwrite_part(buffer.id, part, access)
        };
        buffer.written[first..first + count].fill(true);
        uses.push(used(buffer, part, access));
    } else if written {
        let access = reads[c.below(reads.len())];
        // On a device, no more is declared than is read: the layer knows which bytes a draw takes,
        // and that an indexed draw may take all vertices from the first on.
        let part = match (access, kind) {
            (Access::Indirect, PassKind::Graphics) if recordable => BufferPart { size: 16, ..part },
            (Access::Indirect, _) if recordable => BufferPart {
                offset: part.offset + DISPATCH_OFFSET,
                size: 12,
            },
            (Access::Vertex, _) if recordable => {
                let size = buffer.size - part.offset;
                let part = BufferPart { size, ..part };
                if buffer.written[first..].contains(&false) || taken(buffer, &part) {
                    return;
                }
                part
            }
            _ => part,
        };
        pass.read_part(buffer.id, part, access);
        uses.push(used(buffer, part, access));
    }
}
