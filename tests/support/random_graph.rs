//! Random graphs, decoded from a string of numbers so that a failing one shrinks.

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
    /// Imports and history images; their handles are invented, so such graphs cannot be recorded.
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
    read_only: bool,
}

#[derive(Clone)]
struct Buffer {
    id: BufferId,
    size: u64,
    /// Sixteenths of the buffer with contents.
    written: [bool; 16],
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

/// Gives every declared pass its commands.
pub trait Recorder<'f> {
    /// Called once for each pass, after its uses were declared.
    fn record(&mut self, pass: PassBuilder<'_, 'f>, uses: &[Used]);
}

/// A recorder that records nothing.
pub struct Nothing;

impl<'f> Recorder<'f> for Nothing {
    fn record(&mut self, _: PassBuilder<'_, 'f>, _: &[Used]) {}
}

/// One declared use, for recorders. Recorders that record nothing read none of it.
#[allow(dead_code)]
#[derive(Clone, Copy, Debug)]
pub enum Used {
    Image(ImageId, ImageDesc, ImagePart, Access),
    Buffer(BufferId, BufferPart, Access),
}

/// Declares a random graph.
pub fn random_graph<'f>(
    numbers: &[u32],
    limits: Limits,
    recorder: &mut impl Recorder<'f>,
) -> Graph<'f> {
    let c = &mut Choices::new(numbers);
    let history_desc = ImageDesc::new(vk::Format::R32_SFLOAT, 16, 16);
    let mut history = HistoryStates::new();
    if limits.imports && c.chance(50) {
        history.insert(
            "past",
            HistoryState {
                desc: history_desc,
                previous: image_state(c, false),
                current: image_state(c, false),
            },
        );
    }
    let mut graph = Graph::continuing(history);
    let mut images = images(c, &mut graph, limits, history_desc);
    let mut buffers = buffers(c, &mut graph, limits);
    let passes = 1 + c.below(limits.passes);
    for number in 0..passes {
        let kind = [PassKind::Compute, PassKind::Graphics, PassKind::Transfer][c.below(3)];
        let mut pass = graph.pass(format!("pass {number}"), kind);
        let mut uses = Vec::new();
        if kind == PassKind::Graphics {
            attachments(c, &mut pass, &mut images, &mut uses);
        }
        for _ in 0..c.below(5) {
            if c.chance(60) {
                use_image(c, kind, &mut pass, &mut images, &mut uses);
            } else {
                use_buffer(c, kind, &mut pass, &mut buffers, &mut uses);
            }
        }
        recorder.record(pass, &uses);
        if c.done() && number > 0 {
            break;
        }
    }
    let mut kept = false;
    for image in &images {
        if image.written.contains(&true) && !image.read_only && c.chance(30) {
            graph.keep(image.id);
            kept = true;
        }
    }
    for buffer in &buffers {
        if buffer.written.contains(&true) && (!kept || c.chance(20)) {
            graph.keep(buffer.id);
            kept = true;
        }
    }
    graph
}

fn images(
    c: &mut Choices<'_>,
    graph: &mut Graph<'_>,
    limits: Limits,
    history_desc: ImageDesc,
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
            let enter = image_state(c, true);
            let host = HostImage {
                image: vk::Image::from_raw(number as u64 + 1),
                desc,
                usage: vk::ImageUsageFlags::from_raw(0xff),
                enter,
                leave: image_state(c, false),
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
            read_only: false,
        });
    }
    if limits.imports && c.chance(50) {
        let history = graph.history_image("past", history_desc);
        let ids = history.previous.map(|id| (id, true));
        for (id, read_only) in ids.into_iter().chain([(history.current, false)]) {
            images.push(Image {
                id,
                desc: history_desc,
                written: vec![read_only],
                depth: false,
                read_only,
            });
        }
    }
    images
}

fn buffers(c: &mut Choices<'_>, graph: &mut Graph<'_>, limits: Limits) -> Vec<Buffer> {
    (0..1 + c.below(limits.buffers))
        .map(|number| {
            let size = [4096, 16384][c.below(2)];
            let import = limits.imports && c.chance(20);
            let id = if import {
                let host = HostBuffer {
                    buffer: vk::Buffer::from_raw(number as u64 + 1),
                    desc: BufferDesc { size },
                    usage: vk::BufferUsageFlags::from_raw(0x1ff),
                    enter: buffer_state(c),
                    leave: buffer_state(c),
                };
                graph.import_buffer(format!("buffer {number}"), host)
            } else {
                graph.create_buffer(format!("buffer {number}"), BufferDesc { size })
            };
            Buffer {
                id,
                size,
                written: [import; 16],
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
    mips.flat_map(|mip| layers.clone().map(move |l| (mip * desc.layers + l) as usize))
        .collect()
}

fn touches(uses: &[Used], id: ImageId, part: &ImagePart, desc: &ImageDesc) -> bool {
    let mine = cells(desc, part);
    uses.iter().any(|used| match used {
        Used::Image(other, _, of, _) => {
            same_image(*other, id) && cells(desc, of).iter().any(|cell| mine.contains(cell))
        }
        Used::Buffer(..) => false,
    })
}

/// Whether two ids are versions of one image.
fn same_image(a: ImageId, b: ImageId) -> bool {
    a.same_resource(b)
}

fn attachments(
    c: &mut Choices<'_>,
    pass: &mut PassBuilder<'_, '_>,
    images: &mut [Image],
    uses: &mut Vec<Used>,
) {
    let mut size = None;
    let mut depth_done = false;
    for _ in 0..1 + c.below(3) {
        let index = c.below(images.len());
        let image = &mut images[index];
        if image.read_only || (image.depth && depth_done) {
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
        let load = match c.below(3) {
            0 => Load::Clear([0.5; 4]),
            1 => Load::Discard,
            _ if image.written[cell] => Load::Keep,
            _ => Load::Clear([1.0; 4]),
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
        uses.push(Used::Image(image.id, image.desc, part, access));
    }
}

fn use_image(
    c: &mut Choices<'_>,
    kind: PassKind,
    pass: &mut PassBuilder<'_, '_>,
    images: &mut [Image],
    uses: &mut Vec<Used>,
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
        _ if image.depth => vec![Access::Sampled(stage)],
        _ => vec![Access::Sampled(stage), Access::StorageRead(stage)],
    };
    // Vertex shaders may not store, and depth images are no storage images.
    let writes = match (kind, stage) {
        (PassKind::Transfer, _) => vec![Access::CopyWrite, Access::Clear],
        (_, Stage::Vertex) => vec![],
        _ if image.depth => vec![],
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
        image.id = if access.reads() || c.chance(40) {
            pass.write_part(image.id, part, access)
        } else {
            pass.overwrite_part(image.id, part, access)
        };
        cells.iter().for_each(|cell| image.written[*cell] = true);
        uses.push(Used::Image(image.id, image.desc, part, access));
    } else if written {
        let access = reads[c.below(reads.len())];
        pass.read_part(image.id, part, access);
        uses.push(Used::Image(image.id, image.desc, part, access));
    }
}

fn use_buffer(
    c: &mut Choices<'_>,
    kind: PassKind,
    pass: &mut PassBuilder<'_, '_>,
    buffers: &mut [Buffer],
    uses: &mut Vec<Used>,
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
    let taken = uses.iter().any(|used| match used {
        Used::Buffer(id, of, _) => {
            id.same_resource(buffer.id)
                && of.offset < part.offset + part.size
                && part.offset < of.offset + of.size
        }
        Used::Image(..) => false,
    });
    if taken {
        return;
    }
    let written = buffer.written[first..first + count].iter().all(|w| *w);
    let stage = match kind {
        PassKind::Compute => Stage::Compute,
        _ => [Stage::Fragment, Stage::Vertex][c.below(2)],
    };
    let reads = match kind {
        PassKind::Transfer => vec![Access::CopyRead],
        PassKind::Compute => vec![
            Access::StorageRead(stage),
            Access::Uniform(stage),
            Access::Indirect,
        ],
        PassKind::Graphics => vec![
            Access::StorageRead(stage),
            Access::Uniform(stage),
            Access::Vertex,
            Access::Index,
            Access::Indirect,
        ],
    };
    let writes = match (kind, stage) {
        (PassKind::Transfer, _) => vec![Access::CopyWrite, Access::Clear],
        (_, Stage::Vertex) => vec![],
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
        uses.push(Used::Buffer(buffer.id, part, access));
    } else if written {
        let access = reads[c.below(reads.len())];
        pass.read_part(buffer.id, part, access);
        uses.push(Used::Buffer(buffer.id, part, access));
    }
}
