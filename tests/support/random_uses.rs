//! What the passes of random graphs use.

use super::{Buffer, Choices, DISPATCH_OFFSET, Image, Used, texel};
use antumbra::ash::vk;
use antumbra::graph::{
    Access, BufferPart, ImageDesc, ImageId, ImagePart, Load, PassBuilder, PassKind, Stage,
};

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

pub(super) fn attachments(
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

pub(super) fn use_image(
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

pub(super) fn use_buffer(
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
