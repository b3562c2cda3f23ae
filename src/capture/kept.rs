//! What lights' techniques made, kept for frames in which nothing has moved.

use super::frame::FrameRequest;
use crate::gpu::{Gpu, GpuError, Image, ImageSpec, Retired};
use crate::graph::{Access, Graph, HostImage, ImageDesc, ImageId, ImageState, PassKind};
use crate::light::LightShape;
use crate::renderer::Frame;
use crate::shadow::ShadowMask;
use crate::shadow::auto::Choice;
use ash::vk;

/// Masks of the lights of a request, on the device.
pub(super) struct KeptMasks {
    request: FrameRequest,
    choices: Vec<Choice>,
    masks: Vec<Kept>,
}

struct Kept {
    visibility: Image,
    unblocked: Option<LightShape>,
    end_influences: Option<Image>,
}

const USAGE: vk::ImageUsageFlags = vk::ImageUsageFlags::from_raw(
    vk::ImageUsageFlags::SAMPLED.as_raw()
        | vk::ImageUsageFlags::TRANSFER_SRC.as_raw()
        | vk::ImageUsageFlags::TRANSFER_DST.as_raw(),
);

/// State between frames: whatever the last one did with it is done.
const BETWEEN: ImageState = ImageState {
    layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
    stages: vk::PipelineStageFlags2::ALL_COMMANDS,
    access: vk::AccessFlags2::SHADER_SAMPLED_READ,
};

impl KeptMasks {
    /// Images for the masks of a frame that was declared.
    pub(super) fn new(
        gpu: &mut Gpu,
        request: &FrameRequest,
        frame: &Frame,
    ) -> Result<Self, GpuError> {
        let mut kept = Self {
            request: request.clone(),
            choices: frame.choices.clone(),
            masks: Vec::with_capacity(frame.masks.len()),
        };
        let [width, height] = request.size;
        for mask in &frame.masks {
            let mut image = |name, format| {
                gpu.create_image(name, &ImageSpec::new_2d(format, width, height, USAGE))
            };
            let made = image("kept visibility", vk::Format::R32_SFLOAT).map(|visibility| {
                let ends = mask
                    .end_influences
                    .map(|_| image("kept end influences", vk::Format::R32G32_SFLOAT));
                (visibility, ends.transpose())
            });
            match made {
                Ok((visibility, Ok(end_influences))) => kept.masks.push(Kept {
                    visibility,
                    unblocked: mask.unblocked,
                    end_influences,
                }),
                Ok((visibility, Err(error))) => {
                    gpu.destroy_image(visibility);
                    kept.retire(gpu);
                    return Err(error);
                }
                Err(error) => {
                    kept.retire(gpu);
                    return Err(error);
                }
            }
        }
        Ok(kept)
    }

    /// Each light's technique, and why.
    pub(super) fn choices(&self) -> &[Choice] {
        &self.choices
    }

    /// Whether they are those of a request, provided that the scene is the same.
    pub(super) fn fit(&self, request: &FrameRequest) -> bool {
        let own = &self.request;
        own.camera == request.camera
            && own.size == request.size
            && own.lights == request.lights
            && own.technique == request.technique
    }

    /// Declares the copies that fill them.
    pub(super) fn fill(&self, graph: &mut Graph<'_>, masks: &[ShadowMask]) {
        for (kept, mask) in self.masks.iter().zip(masks) {
            let pairs = [
                (Some(&kept.visibility), Some(mask.visibility)),
                (kept.end_influences.as_ref(), mask.end_influences),
            ];
            for pair in pairs {
                let (Some(image), Some(made)) = pair else {
                    continue;
                };
                let target = import(graph, image, ImageState::UNDEFINED);
                let mut pass = graph.pass("keep", PassKind::Transfer);
                pass.read(made, Access::CopyRead);
                let target = pass.overwrite(target, Access::CopyWrite);
                pass.record(move |ctx| ctx.copy_image(made, target));
            }
        }
    }

    /// The masks in a graph.
    pub(super) fn import(&self, graph: &mut Graph<'_>) -> Vec<ShadowMask> {
        let masks = self.masks.iter().map(|kept| {
            let mut mask = ShadowMask::new(import(graph, &kept.visibility, BETWEEN));
            mask.unblocked = kept.unblocked;
            mask.end_influences =
                (kept.end_influences.as_ref()).map(|image| import(graph, image, BETWEEN));
            mask
        });
        masks.collect()
    }

    /// Gives them back once no frame can still use them.
    pub(super) fn retire(self, gpu: &mut Gpu) {
        for kept in self.masks {
            gpu.retire(Retired::Image(kept.visibility));
            if let Some(image) = kept.end_influences {
                gpu.retire(Retired::Image(image));
            }
        }
    }
}

fn import(graph: &mut Graph<'_>, image: &Image, enter: ImageState) -> ImageId {
    let [width, height, _] = image.spec.extent;
    let host = HostImage {
        image: image.raw,
        desc: ImageDesc::new(image.spec.format, width, height),
        usage: image.spec.usage,
        enter,
        leave: BETWEEN,
    };
    graph.import_image("kept", host)
}
