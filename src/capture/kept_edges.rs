//! Lists of silhouettes, kept for frames in which neither lights nor casters have moved.

use super::frame::FrameRequest;
use crate::gpu::{Buffer, Gpu, GpuError, Image, ImageSpec, MemoryLocation, Retired};
use crate::graph::{
    Access, BufferDesc, BufferState, Graph, HostBuffer, HostImage, ImageDesc, ImageState, PassKind,
};
use crate::shadow::silhouettes::{ARGUMENTS_BYTES, Silhouettes};
use crate::shadow::{ShadowMask, Technique};
use ash::vk;

/// Lists of the lights of a request, on the device.
pub(super) struct KeptSilhouettes {
    request: FrameRequest,
    lists: Vec<Option<Kept>>,
}

struct Kept {
    list: Image,
    arguments: Buffer,
}

const LIST_USAGE: vk::ImageUsageFlags = vk::ImageUsageFlags::from_raw(
    vk::ImageUsageFlags::SAMPLED.as_raw() | vk::ImageUsageFlags::TRANSFER_DST.as_raw(),
);

const ARGUMENTS_USAGE: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(
    vk::BufferUsageFlags::INDIRECT_BUFFER.as_raw()
        | vk::BufferUsageFlags::STORAGE_BUFFER.as_raw()
        | vk::BufferUsageFlags::UNIFORM_BUFFER.as_raw()
        | vk::BufferUsageFlags::TRANSFER_DST.as_raw(),
);

/// State between frames: whatever the last one did with it is done.
const BETWEEN: ImageState = ImageState {
    layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
    stages: vk::PipelineStageFlags2::ALL_COMMANDS,
    access: vk::AccessFlags2::SHADER_SAMPLED_READ,
};

impl KeptSilhouettes {
    /// Room for the lists of a frame that was declared; `None` if it has none.
    pub(super) fn new(
        gpu: &mut Gpu,
        graph: &Graph<'_>,
        request: &FrameRequest,
        masks: &[ShadowMask],
    ) -> Result<Option<Self>, GpuError> {
        let mut kept = Self {
            request: request.clone(),
            lists: Vec::with_capacity(masks.len()),
        };
        for mask in masks {
            let desc = mask.silhouettes.and_then(|s| graph.image_desc(s.list));
            match desc.map(|desc| Kept::new(gpu, desc)).transpose() {
                Ok(list) => kept.lists.push(list),
                Err(error) => {
                    kept.retire(gpu);
                    return Err(error);
                }
            }
        }
        Ok(kept.lists.iter().any(Option::is_some).then_some(kept))
    }

    /// Whether they are those of a request, provided that the scene and its lights are the same. The
    /// camera does not matter.
    pub(super) fn fit(&self, request: &FrameRequest) -> bool {
        // What is chosen may change with the camera.
        let is_fixed = !matches!(request.technique, Technique::Auto(_));
        is_fixed
            && self.request.lights == request.lights
            && self.request.technique == request.technique
    }

    /// Lights that have one.
    pub(super) fn count(&self) -> usize {
        self.lists.iter().flatten().count()
    }

    /// Declares the copies that fill them.
    pub(super) fn fill(&self, graph: &mut Graph<'_>, masks: &[ShadowMask]) {
        for (kept, mask) in self.lists.iter().zip(masks) {
            let (Some(kept), Some(made)) = (kept, mask.silhouettes) else {
                continue;
            };
            let target = kept.import(graph, true);
            let mut pass = graph.pass("keep", PassKind::Transfer);
            pass.read(made.list, Access::CopyRead);
            pass.read(made.arguments, Access::CopyRead);
            let list = pass.overwrite(target.list, Access::CopyWrite);
            let arguments = pass.overwrite(target.arguments, Access::CopyWrite);
            pass.record(move |ctx| {
                ctx.copy_image(made.list, list)?;
                ctx.copy_buffer(made.arguments, 0, arguments, 0, ARGUMENTS_BYTES)
            });
        }
    }

    /// The lists in a graph.
    pub(super) fn import(&self, graph: &mut Graph<'_>) -> Vec<Option<Silhouettes>> {
        let lists = self.lists.iter();
        lists
            .map(|kept| kept.as_ref().map(|kept| kept.import(graph, false)))
            .collect()
    }

    /// Gives them back once no frame can still use them.
    pub(super) fn retire(self, gpu: &mut Gpu) {
        for kept in self.lists.into_iter().flatten() {
            gpu.retire(Retired::Image(kept.list));
            gpu.retire(Retired::Buffer(kept.arguments));
        }
    }
}

impl Kept {
    fn new(gpu: &mut Gpu, desc: ImageDesc) -> Result<Self, GpuError> {
        let spec = ImageSpec::new_2d(desc.format, desc.width, desc.height, LIST_USAGE);
        let list = gpu.create_image("kept silhouettes", &spec)?;
        let (usage, location) = (ARGUMENTS_USAGE, MemoryLocation::GpuOnly);
        match gpu.create_buffer("kept silhouettes", ARGUMENTS_BYTES, usage, location) {
            Ok(arguments) => Ok(Self { list, arguments }),
            Err(error) => {
                gpu.destroy_image(list);
                Err(error)
            }
        }
    }

    fn import(&self, graph: &mut Graph<'_>, is_new: bool) -> Silhouettes {
        let [width, height, _] = self.list.spec.extent;
        let list = HostImage {
            image: self.list.raw,
            desc: ImageDesc::new(self.list.spec.format, width, height),
            usage: self.list.spec.usage,
            enter: if is_new {
                ImageState::UNDEFINED
            } else {
                BETWEEN
            },
            leave: BETWEEN,
        };
        // A frame is waited for before the next one begins.
        let arguments = HostBuffer {
            buffer: self.arguments.raw,
            desc: BufferDesc {
                size: self.arguments.size,
            },
            usage: self.arguments.usage,
            enter: BufferState::IDLE,
            leave: BufferState::IDLE,
        };
        Silhouettes {
            list: graph.import_image("kept silhouettes", list),
            arguments: graph.import_buffer("kept silhouettes", arguments),
        }
    }
}
