//! The compiled plan: plain data that can be printed, compared, replayed and changed.

use super::Name;
use super::access::Access;
use super::pass::{Attachment, Mode, PassKind};
use super::resource::{BufferDesc, ImageDesc, ImageState, Part};
use ash::vk;

/// Everything that recording a frame needs to know, and nothing that depends on a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// All declared resources, in order of declaration, used or not.
    pub resources: Vec<PlanResource>,
    /// The passes that run, in order.
    pub passes: Vec<PlanPass>,
    /// Groups of passes that need no barrier between each other, in order.
    pub steps: Vec<Step>,
    /// Barriers after the last pass, which bring imports to the states their owners asked for.
    pub leave: Batch,
    /// Passes that do not run.
    pub culled: Vec<CulledPass>,
    /// Blocks of memory that transients share.
    pub arenas: Vec<Arena>,
}

/// A declared resource.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanResource {
    /// Name given by its author.
    pub name: Name,
    /// Shape and collected usage.
    pub shape: ResourceShape,
    /// Where it comes from.
    pub origin: ResourceOrigin,
    /// First and last step that uses it; `None` if no live pass does.
    pub steps: Option<(usize, usize)>,
}

/// Shape of a resource, with the usage flags that its live passes need.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ResourceShape {
    /// An image.
    Image {
        /// Its description.
        desc: ImageDesc,
        /// Usage collected from accesses.
        usage: vk::ImageUsageFlags,
    },
    /// A buffer.
    Buffer {
        /// Its description.
        desc: BufferDesc,
        /// Usage collected from accesses.
        usage: vk::BufferUsageFlags,
    },
}

/// Where a resource comes from. Buffers have layout `UNDEFINED` in every state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResourceOrigin {
    /// Made for this frame, at this place; `None` if no live pass uses it.
    Transient(Option<Placement>),
    /// The host's.
    Imported {
        /// State on entering.
        enter: ImageState,
        /// State on leaving.
        leave: ImageState,
    },
    /// What the last frame wrote under this key.
    HistoryPrevious {
        /// The key.
        key: &'static str,
        /// State on entering.
        enter: ImageState,
        /// State that the frame leaves it in.
        leave: ImageState,
    },
    /// What this frame writes under this key.
    HistoryCurrent {
        /// The key.
        key: &'static str,
        /// State on entering.
        enter: ImageState,
        /// State that the frame leaves it in.
        leave: ImageState,
    },
}

/// Where a transient lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placement {
    /// Index into [`Plan::arenas`].
    pub arena: usize,
    /// First byte in the arena.
    pub offset: u64,
    /// Size in bytes, as the driver reports it.
    pub size: u64,
    /// Alignment in bytes, as the driver reports it.
    pub alignment: u64,
}

/// A block of memory that transients share.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Arena {
    /// Size in bytes.
    pub size: u64,
    /// Alignment in bytes.
    pub alignment: u64,
    /// Memory types that every resource in it accepts.
    pub memory_types: u32,
    /// Holds images, else buffers: apart, so that no linear resource neighbours an optimal one
    /// within `bufferImageGranularity`.
    pub images: bool,
}

/// A pass that runs.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanPass {
    /// Name given by its author.
    pub name: Name,
    /// Place in the order of declaration.
    pub declared: usize,
    /// What it records.
    pub kind: PassKind,
    /// What it touches.
    pub uses: Vec<PlanUse>,
    /// Attachments, in order of declaration.
    pub attachments: Vec<Attachment>,
}

/// One access of one pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanUse {
    /// Index into [`Plan::resources`].
    pub resource: usize,
    /// What of it.
    pub part: Part,
    /// How.
    pub access: Access,
    /// What becomes of earlier contents.
    pub mode: Mode,
}

/// Passes that need no barrier between each other, and the barriers in front of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Step {
    /// Issued first, and rarely there: flushes writes that nobody read, of transients whose memory
    /// changes hands in this step.
    pub hand_over: Batch,
    /// Issued next, as one command.
    pub barriers: Batch,
    /// Indices into [`Plan::passes`].
    pub passes: Vec<usize>,
}

/// Barriers of one `vkCmdPipelineBarrier2`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// The barriers; none depends on another of the same batch.
    pub barriers: Vec<Barrier>,
}

/// One memory dependency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Barrier {
    /// Resource (index into [`Plan::resources`]) and part; `None` is a global memory barrier.
    pub target: Option<(usize, Part)>,
    /// First synchronization scope.
    pub src_stages: vk::PipelineStageFlags2,
    /// First access scope: writes made available.
    pub src_access: vk::AccessFlags2,
    /// Second synchronization scope.
    pub dst_stages: vk::PipelineStageFlags2,
    /// Second access scope: accesses that what is available is made visible to.
    pub dst_access: vk::AccessFlags2,
    /// Layout transition, if any.
    pub transition: Option<Transition>,
}

/// A change of image layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transition {
    /// Layout before; `UNDEFINED` drops the contents.
    pub old: vk::ImageLayout,
    /// Layout after.
    pub new: vk::ImageLayout,
}

/// A pass that does not run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CulledPass {
    /// Name given by its author.
    pub name: Name,
    /// Place in the order of declaration; of one that was not declared ([`Graph::skip`](super::Graph::skip))
    /// that of the next one.
    pub declared: usize,
    /// Why it does not run.
    pub reason: String,
}

impl Plan {
    /// Bytes of transient memory that the frame needs.
    pub fn peak_bytes(&self) -> u64 {
        self.arenas.iter().map(|arena| arena.size).sum()
    }

    /// Bytes that the transients would need without sharing memory.
    pub fn unaliased_bytes(&self) -> u64 {
        let sizes = self.resources.iter().filter_map(|r| match r.origin {
            ResourceOrigin::Transient(Some(place)) => Some(place.size),
            _ => None,
        });
        sizes.sum()
    }

    /// Every batch of barriers, in order.
    pub fn batches(&self) -> impl Iterator<Item = &Batch> {
        let steps = self.steps.iter();
        steps
            .flat_map(|step| [&step.hand_over, &step.barriers])
            .chain(std::iter::once(&self.leave))
    }

    /// Number of barriers.
    pub fn barrier_count(&self) -> usize {
        self.batches().map(|batch| batch.barriers.len()).sum()
    }
}

impl PlanResource {
    /// States on entering and leaving, for a resource that outlives the frame.
    pub fn states(&self) -> Option<(ImageState, ImageState)> {
        match self.origin {
            ResourceOrigin::Transient(_) => None,
            ResourceOrigin::Imported { enter, leave }
            | ResourceOrigin::HistoryPrevious { enter, leave, .. }
            | ResourceOrigin::HistoryCurrent { enter, leave, .. } => Some((enter, leave)),
        }
    }
}
