//! Copies of a scene's data to the device, declared in a graph of their own.

use super::scene_buffers::UploadError;
use crate::gpu::{Buffer, Gpu, GpuError, Image, ImageSpec, MemoryLocation};
use crate::graph::{
    Access, BufferDesc, BufferId, BufferState, FrameCache, Graph, HostBuffer, HostImage, ImageDesc,
    ImagePart, ImageState, PassKind,
};
use ash::vk;

/// State of the scene's images between frames: the upload made them visible to every stage that
/// reads them, and nobody writes them, so nobody waits.
pub(super) const STATIC: ImageState = ImageState {
    layout: vk::ImageLayout::READ_ONLY_OPTIMAL,
    stages: vk::PipelineStageFlags2::NONE,
    access: vk::AccessFlags2::NONE,
};

/// Records the copies that `declare` declares.
pub(super) fn record_uploads(
    gpu: &mut Gpu,
    cmd: vk::CommandBuffer,
    declare: impl FnOnce(&mut Gpu, &mut Graph<'_>) -> Result<(), GpuError>,
) -> Result<(), UploadError> {
    let mut graph = Graph::new();
    declare(gpu, &mut graph)?;
    let compiled = graph.compile(gpu)?;
    let mut cache = FrameCache::new();
    let recorded = compiled.record(gpu, &mut cache, cmd);
    cache.destroy(gpu);
    recorded?;
    Ok(())
}

/// What an image of the scene is used for. Those of four numbers a texel, but for colours, are read as storage images,
/// too: on lavapipe such a read takes half the time of one through a sampler.
pub(super) fn usage_of(desc: &ImageDesc) -> vk::ImageUsageFlags {
    let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
    match desc.format {
        vk::Format::R32G32B32A32_SFLOAT
        | vk::Format::R32G32B32A32_UINT
        | vk::Format::R8G8B8A8_UNORM => usage | vk::ImageUsageFlags::STORAGE,
        _ => usage,
    }
}

pub(super) fn upload_images(
    gpu: &mut Gpu,
    graph: &mut Graph<'_>,
    contents: &[(&str, &[u8])],
    descs: &[ImageDesc],
    staging: &mut Vec<Buffer>,
    made: &mut Vec<Image>,
) -> Result<(), GpuError> {
    for ((name, bytes), desc) in contents.iter().zip(descs) {
        let spec = ImageSpec::new_2d(desc.format, desc.width, desc.height, usage_of(desc));
        let image = gpu.create_image(name, &spec)?;
        let uploaded = upload_image(gpu, graph, &image, *desc, bytes, staging);
        made.push(image);
        uploaded?;
    }
    Ok(())
}

/// Brings `bytes`, filled up with zeros to `size`, to a buffer that copies can be made from.
fn stage(
    gpu: &mut Gpu,
    graph: &mut Graph<'_>,
    bytes: &[u8],
    size: usize,
    staging: &mut Vec<Buffer>,
) -> Result<Option<BufferId>, GpuError> {
    if size == 0 {
        return Ok(None);
    }
    let size = size as u64;
    let usage = vk::BufferUsageFlags::TRANSFER_SRC;
    let mut buffer = gpu.create_buffer("upload", size, usage, MemoryLocation::CpuToGpu)?;
    let mapped = buffer.mapped_mut().map(|target| {
        let (data, padding) = target.split_at_mut(bytes.len());
        data.copy_from_slice(bytes);
        padding.fill(0);
    });
    let raw = buffer.raw;
    staging.push(buffer);
    if mapped.is_none() {
        return Err(GpuError::Invalid {
            object: "upload".to_string(),
            problem: "its memory is not visible to the host".to_string(),
        });
    }
    let host = HostBuffer {
        buffer: raw,
        desc: BufferDesc { size },
        usage,
        enter: BufferState::IDLE,
        leave: BufferState::IDLE,
    };
    Ok(Some(graph.import_buffer("upload", host)))
}

pub(super) fn upload_buffer(
    gpu: &mut Gpu,
    graph: &mut Graph<'_>,
    target: &Buffer,
    bytes: &[u8],
    staging: &mut Vec<Buffer>,
) -> Result<(), GpuError> {
    let size = bytes.len() as u64;
    let Some(source) = stage(gpu, graph, bytes, bytes.len(), staging)? else {
        return Ok(());
    };
    let host = HostBuffer {
        buffer: target.raw,
        desc: BufferDesc { size: target.size },
        usage: target.usage,
        enter: BufferState::IDLE,
        leave: BufferState {
            stages: vk::PipelineStageFlags2::VERTEX_INPUT,
            access: vk::AccessFlags2::from_raw(
                vk::AccessFlags2::VERTEX_ATTRIBUTE_READ.as_raw()
                    | vk::AccessFlags2::INDEX_READ.as_raw(),
            ),
        },
    };
    let target = graph.import_buffer("scene", host);
    let mut pass = graph.pass("upload", PassKind::Transfer);
    pass.read(source, Access::CopyRead);
    let target = pass.write(target, Access::CopyWrite);
    pass.record(move |ctx| ctx.copy_buffer(source, 0, target, 0, size));
    Ok(())
}

fn upload_image(
    gpu: &mut Gpu,
    graph: &mut Graph<'_>,
    target: &Image,
    desc: ImageDesc,
    texels: &[u8],
    staging: &mut Vec<Buffer>,
) -> Result<(), GpuError> {
    let texel_bytes = match desc.format {
        vk::Format::R8G8B8A8_SRGB | vk::Format::R8G8B8A8_UNORM => 4,
        _ => 16,
    };
    let size = desc.width as usize * desc.height as usize * texel_bytes;
    let Some(source) = stage(gpu, graph, texels, size, staging)? else {
        return Ok(());
    };
    let host = HostImage {
        image: target.raw,
        desc,
        usage: target.spec.usage,
        enter: ImageState::UNDEFINED,
        leave: ImageState {
            stages: vk::PipelineStageFlags2::from_raw(
                vk::PipelineStageFlags2::VERTEX_SHADER.as_raw()
                    | vk::PipelineStageFlags2::FRAGMENT_SHADER.as_raw()
                    | vk::PipelineStageFlags2::COMPUTE_SHADER.as_raw(),
            ),
            access: vk::AccessFlags2::SHADER_SAMPLED_READ,
            ..STATIC
        },
    };
    let target = graph.import_image("scene", host);
    let mut pass = graph.pass("upload", PassKind::Transfer);
    pass.read(source, Access::CopyRead);
    let target = pass.overwrite(target, Access::CopyWrite);
    let part = ImagePart::whole(&desc);
    pass.record(move |ctx| ctx.copy_buffer_to_image(source, 0, target, part));
    Ok(())
}
