//! What a graph can hold: descriptions, ids, parts, and the states that a host hands over.

use ash::vk;
use std::fmt;

/// Shape of an image: 2D, optionally with array layers and mip levels, one sample a texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ImageDesc {
    /// Texel format.
    pub format: vk::Format,
    /// Width of mip level 0 in texels.
    pub width: u32,
    /// Height of mip level 0 in texels.
    pub height: u32,
    /// Number of array layers.
    pub layers: u32,
    /// Number of mip levels.
    pub mips: u32,
}

impl ImageDesc {
    /// A single-layer, single-level image.
    pub fn new(format: vk::Format, width: u32, height: u32) -> Self {
        Self {
            format,
            width,
            height,
            layers: 1,
            mips: 1,
        }
    }

    /// The same image with `layers` array layers.
    pub fn layers(self, layers: u32) -> Self {
        Self { layers, ..self }
    }

    /// The same image with `mips` mip levels.
    pub fn mips(self, mips: u32) -> Self {
        Self { mips, ..self }
    }

    /// Aspect of the format.
    pub fn aspect(&self) -> vk::ImageAspectFlags {
        use vk::{Format as F, ImageAspectFlags as A};
        match self.format {
            F::D16_UNORM | F::D32_SFLOAT | F::X8_D24_UNORM_PACK32 => A::DEPTH,
            F::D24_UNORM_S8_UINT | F::D32_SFLOAT_S8_UINT | F::D16_UNORM_S8_UINT => {
                A::DEPTH | A::STENCIL
            }
            F::S8_UINT => A::STENCIL,
            _ => A::COLOR,
        }
    }

    /// Largest number of mip levels that these dimensions allow.
    pub fn max_mips(&self) -> u32 {
        32 - self.width.max(self.height).max(1).leading_zeros()
    }
}

/// Size of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BufferDesc {
    /// Size in bytes.
    pub size: u64,
}

/// A part of an image: a block of mip levels and array layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ImagePart {
    /// First mip level.
    pub base_mip: u32,
    /// Number of mip levels.
    pub mips: u32,
    /// First array layer.
    pub base_layer: u32,
    /// Number of array layers.
    pub layers: u32,
}

impl ImagePart {
    /// All of an image.
    pub fn whole(desc: &ImageDesc) -> Self {
        Self {
            base_mip: 0,
            mips: desc.mips,
            base_layer: 0,
            layers: desc.layers,
        }
    }

    /// One mip level of layer 0.
    pub fn mip(level: u32) -> Self {
        Self {
            base_mip: level,
            mips: 1,
            base_layer: 0,
            layers: 1,
        }
    }

    /// One array layer at mip level 0.
    pub fn layer(layer: u32) -> Self {
        Self {
            base_mip: 0,
            mips: 1,
            base_layer: layer,
            layers: 1,
        }
    }

    /// The same part as Vulkan states it.
    pub fn subresource_range(&self, aspect: vk::ImageAspectFlags) -> vk::ImageSubresourceRange {
        vk::ImageSubresourceRange {
            aspect_mask: aspect,
            base_mip_level: self.base_mip,
            level_count: self.mips,
            base_array_layer: self.base_layer,
            layer_count: self.layers,
        }
    }
}

impl fmt::Display for ImagePart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (m, l) = (self.base_mip, self.base_layer);
        // Errors show parts that no resource has, so the sums may not fit.
        let (mips, layers) = (m.saturating_add(self.mips), l.saturating_add(self.layers));
        write!(f, "mips {m}..{mips} layers {l}..{layers}")
    }
}

/// A part of a buffer, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BufferPart {
    /// First byte.
    pub offset: u64,
    /// Number of bytes.
    pub size: u64,
}

impl fmt::Display for BufferPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let end = self.offset.saturating_add(self.size);
        write!(f, "bytes {}..{end}", self.offset)
    }
}

/// One version of an image in one graph. Writing makes a new version; the old id is then an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ImageId(pub(crate) Version);

/// One version of a buffer in one graph. Writing makes a new version; the old id is then an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BufferId(pub(crate) Version);

impl ImageId {
    /// Whether both ids are versions of one image of one graph.
    pub fn same_resource(self, other: ImageId) -> bool {
        (self.0.graph, self.0.resource) == (other.0.graph, other.0.resource)
    }
}

impl BufferId {
    /// Whether both ids are versions of one buffer of one graph.
    pub fn same_resource(self, other: BufferId) -> bool {
        (self.0.graph, self.0.resource) == (other.0.graph, other.0.resource)
    }
}

/// What an id stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Version {
    pub(crate) graph: u32,
    pub(crate) resource: u32,
    pub(crate) version: u32,
}

/// Part of an image or a buffer, as plans hold it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Part {
    /// Of an image.
    Image(ImagePart),
    /// Of a buffer.
    Buffer(BufferPart),
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Part::Image(part) => part.fmt(f),
            Part::Buffer(part) => part.fmt(f),
        }
    }
}

/// An [`ImageId`] or a [`BufferId`].
pub trait ResourceId: Copy + private::Sealed {
    /// The type that names a part of the resource.
    type Part: Into<Part>;
}

impl ResourceId for ImageId {
    type Part = ImagePart;
}

impl ResourceId for BufferId {
    type Part = BufferPart;
}

impl From<ImagePart> for Part {
    fn from(part: ImagePart) -> Self {
        Part::Image(part)
    }
}

impl From<BufferPart> for Part {
    fn from(part: BufferPart) -> Self {
        Part::Buffer(part)
    }
}

pub(crate) mod private {
    use super::{BufferId, ImageId, Version};

    pub trait Sealed {
        fn version(&self) -> Version;
        fn from_version(version: Version) -> Self;
    }

    impl Sealed for ImageId {
        fn version(&self) -> Version {
            self.0
        }
        fn from_version(version: Version) -> Self {
            Self(version)
        }
    }

    impl Sealed for BufferId {
        fn version(&self) -> Version {
            self.0
        }
        fn from_version(version: Version) -> Self {
            Self(version)
        }
    }
}

/// Where an image stands between its owner's commands and ours: its layout, and the stages and
/// accesses that the owner used last (on entering) or will use next (on leaving).
///
/// No stages on entering say that the host has already waited, for example for a fence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ImageState {
    /// Layout; `UNDEFINED` on entering says that the contents do not matter.
    pub layout: vk::ImageLayout,
    /// Pipeline stages.
    pub stages: vk::PipelineStageFlags2,
    /// Memory accesses.
    pub access: vk::AccessFlags2,
}

impl ImageState {
    /// Contents that do not matter and that nobody still uses.
    pub const UNDEFINED: Self = Self {
        layout: vk::ImageLayout::UNDEFINED,
        stages: vk::PipelineStageFlags2::NONE,
        access: vk::AccessFlags2::NONE,
    };
}

/// Where a buffer stands between its owner's commands and ours; see [`ImageState`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BufferState {
    /// Pipeline stages.
    pub stages: vk::PipelineStageFlags2,
    /// Memory accesses.
    pub access: vk::AccessFlags2,
}

impl BufferState {
    /// Nobody still uses the buffer, and its contents are visible to every access.
    pub const IDLE: Self = Self {
        stages: vk::PipelineStageFlags2::NONE,
        access: vk::AccessFlags2::NONE,
    };

    /// The host reads the buffer after waiting for the frame's fence.
    pub const HOST_READ: Self = Self {
        stages: vk::PipelineStageFlags2::HOST,
        access: vk::AccessFlags2::HOST_READ,
    };
}

/// An image that somebody else owns, lent to one frame.
#[derive(Clone, Copy, Debug)]
pub struct HostImage {
    /// The image.
    pub image: vk::Image,
    /// Shape, as it was created.
    pub desc: ImageDesc,
    /// Usage flags it was created with; what the graph does with it must be among them.
    pub usage: vk::ImageUsageFlags,
    /// State on entering the frame.
    pub enter: ImageState,
    /// State that the graph leaves it in, whether or not a pass touched it.
    pub leave: ImageState,
}

/// A buffer that somebody else owns, lent to one frame.
#[derive(Clone, Copy, Debug)]
pub struct HostBuffer {
    /// The buffer.
    pub buffer: vk::Buffer,
    /// Its size.
    pub desc: BufferDesc,
    /// Usage flags it was created with; what the graph does with it must be among them.
    pub usage: vk::BufferUsageFlags,
    /// State on entering the frame.
    pub enter: BufferState,
    /// State that the graph leaves it in.
    pub leave: BufferState,
}

/// An image that lives from frame to frame, as one frame sees it.
#[derive(Clone, Copy, Debug)]
pub struct History {
    /// What the last frame wrote; `None` on the first frame and after a change of shape.
    pub previous: Option<ImageId>,
    /// What this frame writes.
    pub current: ImageId,
}

/// What the last frames left of one history image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HistoryState {
    /// Shape of both images.
    pub desc: ImageDesc,
    /// State of what the last frame wrote.
    pub previous: ImageState,
    /// State of the image that this frame overwrites.
    pub current: ImageState,
}

/// What the frames before left of every history image, by key; the first frame has an empty one.
pub type HistoryStates = std::collections::BTreeMap<&'static str, HistoryState>;
