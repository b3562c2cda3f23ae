//! An explicit render graph.
//!
//! Passes declare what they read and write; [`Graph::compile`] turns the declarations into a
//! [`Plan`]: which passes run, in which order, with which barriers, and where every transient
//! resource lies in memory. Compiling is a pure function that touches no device, so a plan can be
//! printed, compared and replayed ([`simulate`]) anywhere. [`CompiledGraph::record`] then turns
//! the plan into commands in a command buffer of the caller's.
//!
//! ```
//! use antumbra::ash::vk;
//! use antumbra::graph::{Access, FakeMemory, Graph, ImageDesc, Load, PassKind, Stage};
//!
//! let mut graph = Graph::new();
//! let desc = ImageDesc::new(vk::Format::R32_SFLOAT, 64, 64);
//! let depth = graph.create_image("depth", ImageDesc::new(vk::Format::D32_SFLOAT, 64, 64));
//! let mask = graph.create_image("mask", desc);
//!
//! let mut pass = graph.pass("map", PassKind::Graphics);
//! let depth = pass.depth(depth, Load::Clear([1.0; 4]));
//! pass.record(|_| Ok(()));
//!
//! let mut pass = graph.pass("visibility", PassKind::Compute);
//! pass.read(depth, Access::Sampled(Stage::Compute));
//! let mask = pass.overwrite(mask, Access::StorageWrite(Stage::Compute));
//! pass.record(|_| Ok(()));
//!
//! graph.keep(mask);
//! let compiled = graph.compile(&FakeMemory)?;
//! assert_eq!(compiled.plan().steps.len(), 2);
//! # Ok::<(), antumbra::graph::GraphError>(())
//! ```

mod access;
mod alias;
mod barrier;
mod cells;
mod compile;
mod error;
pub mod exec;
mod order;
mod pass;
mod plan;
#[cfg(feature = "json")]
mod plan_json;
mod print;
mod resource;
pub mod simulate;
mod sync;

pub use access::{Access, AccessInfo, Stage};
pub use alias::{FakeMemory, MemoryModel, MemoryNeed};
pub use compile::CompiledGraph;
pub use error::GraphError;
pub use exec::{Bind, FrameCache, FrameReport, PassContext};
pub use pass::{Attachment, Load, Mode, PassBuilder, PassKind};
pub use plan::{
    Arena, Barrier, Batch, CulledPass, Placement, Plan, PlanPass, PlanResource, PlanUse,
    ResourceOrigin, ResourceShape, Step, Transition,
};
pub use resource::{
    BufferDesc, BufferId, BufferPart, BufferState, History, HistoryState, HistoryStates,
    HostBuffer, HostImage, ImageDesc, ImageId, ImagePart, ImageState, Part, ResourceId,
};

use pass::{PassDecl, RecordFn};
use resource::Version;
use std::borrow::Cow;
use std::sync::atomic::{AtomicU32, Ordering};

/// Name of a pass or a resource.
pub type Name = Cow<'static, str>;

#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    Image(ImageDesc),
    Buffer(BufferDesc),
}

impl Kind {
    fn whole(&self) -> Part {
        match self {
            Kind::Image(desc) => Part::Image(ImagePart::whole(desc)),
            Kind::Buffer(desc) => Part::Buffer(BufferPart {
                offset: 0,
                size: desc.size,
            }),
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Origin {
    Transient,
    Image(HostImage),
    Buffer(HostBuffer),
    HistoryPrevious {
        key: &'static str,
        state: ImageState,
    },
    HistoryCurrent {
        key: &'static str,
        state: ImageState,
    },
}

#[derive(Debug)]
pub(crate) struct ResourceDecl {
    name: Name,
    kind: Kind,
    origin: Origin,
    version: u32,
    writer: Name,
}

/// Everything declared, without the commands: the input of planning.
pub(crate) struct Declarations {
    stamp: u32,
    resources: Vec<ResourceDecl>,
    passes: Vec<PassDecl>,
    kept: Vec<usize>,
    skipped: Vec<CulledPass>,
    /// Passes that begin a part, ascending.
    parts: Vec<usize>,
    error: Option<GraphError>,
}

/// A graph being declared. Passes run in an order that respects the order of declaration wherever
/// two of them touch the same texels or bytes.
///
/// `'f` is the lifetime of what the passes' commands borrow.
pub struct Graph<'f> {
    decl: Declarations,
    records: Vec<Option<RecordFn<'f>>>,
    history: HistoryStates,
}

impl Default for Graph<'_> {
    fn default() -> Self {
        Self::new()
    }
}

impl<'f> Graph<'f> {
    /// An empty graph for a first frame: no history image has a previous version.
    pub fn new() -> Self {
        Self::continuing(HistoryStates::new())
    }

    /// An empty graph for the frame after the one that left `history`.
    pub fn continuing(history: HistoryStates) -> Self {
        // Ids carry the number of their graph, so that an id of last frame's graph is an error and
        // not another resource. It never reaches a plan.
        static STAMP: AtomicU32 = AtomicU32::new(0);
        Self {
            decl: Declarations {
                stamp: STAMP.fetch_add(1, Ordering::Relaxed),
                resources: Vec::new(),
                passes: Vec::new(),
                kept: Vec::new(),
                skipped: Vec::new(),
                parts: Vec::new(),
                error: None,
            },
            records: Vec::new(),
            history,
        }
    }

    /// An image that lives inside this frame only.
    pub fn create_image(&mut self, name: impl Into<Name>, desc: ImageDesc) -> ImageId {
        ImageId(self.add(name.into(), Kind::Image(desc), Origin::Transient))
    }

    /// A buffer that lives inside this frame only.
    pub fn create_buffer(&mut self, name: impl Into<Name>, desc: BufferDesc) -> BufferId {
        BufferId(self.add(name.into(), Kind::Buffer(desc), Origin::Transient))
    }

    /// An image of the host's. Writing it keeps the writer alive.
    pub fn import_image(&mut self, name: impl Into<Name>, image: HostImage) -> ImageId {
        ImageId(self.add(name.into(), Kind::Image(image.desc), Origin::Image(image)))
    }

    /// A buffer of the host's. Writing it keeps the writer alive.
    pub fn import_buffer(&mut self, name: impl Into<Name>, buffer: HostBuffer) -> BufferId {
        BufferId(self.add(
            name.into(),
            Kind::Buffer(buffer.desc),
            Origin::Buffer(buffer),
        ))
    }

    /// An image of which the last frame's contents can still be read. Writing `current` keeps the
    /// writer alive.
    pub fn history_image(&mut self, key: &'static str, desc: ImageDesc) -> History {
        let twice =
            self.decl.resources.iter().any(
                |r| matches!(r.origin, Origin::HistoryCurrent { key: other, .. } if other == key),
            );
        if twice {
            self.decl.error.get_or_insert(GraphError::DuplicateHistory {
                key: key.to_string(),
            });
        }
        let known = self.history.get(key).filter(|state| state.desc == desc);
        let known = known.copied();
        // A frame may declare a history image and then not write it.
        let written = known.filter(|k| k.previous.layout != ash::vk::ImageLayout::UNDEFINED);
        let previous = written.map(|known| {
            let origin = Origin::HistoryPrevious {
                key,
                state: known.previous,
            };
            ImageId(self.add(format!("{key}.previous").into(), Kind::Image(desc), origin))
        });
        let state = known.map_or(ImageState::UNDEFINED, |known| ImageState {
            layout: ash::vk::ImageLayout::UNDEFINED,
            ..known.current
        });
        let origin = Origin::HistoryCurrent { key, state };
        let current = ImageId(self.add(key.into(), Kind::Image(desc), origin));
        History { previous, current }
    }

    /// Declares the next pass.
    pub fn pass(&mut self, name: impl Into<Name>, kind: PassKind) -> PassBuilder<'_, 'f> {
        self.decl.passes.push(PassDecl {
            name: name.into(),
            kind,
            uses: Vec::new(),
            attachments: Vec::new(),
        });
        self.records.push(None);
        let pass = self.decl.passes.len() - 1;
        PassBuilder { graph: self, pass }
    }

    /// Notes that a pass, or several under one name, need not be declared, and why. Shows among those
    /// that do not run: [`Plan::culled`].
    pub fn skip(&mut self, name: impl Into<Name>, reason: impl Into<String>) {
        let skipped = CulledPass {
            name: name.into(),
            declared: self.pass_count(),
            reason: reason.into(),
        };
        self.decl.skipped.push(skipped);
    }

    /// Passes that are declared from here on run after all that were declared before, whether they depend on
    /// them or not. What only passes of one part use then shares memory with what only those of another
    /// use, at the price of a barrier between the parts where otherwise both would run side by side.
    pub fn begin_part(&mut self) {
        self.decl.parts.push(self.decl.passes.len());
    }

    /// Number of passes declared so far: the place in [`PlanPass::declared`] that the next one gets.
    pub fn pass_count(&self) -> usize {
        self.decl.passes.len()
    }

    /// The newest version of the first image that was declared under `name` for this frame and that
    /// a pass writes. Images of the host's are not looked at.
    pub fn image_named(&self, name: &str) -> Option<ImageId> {
        let mut images = self.written_images();
        images.find(|(_, r)| r.name == name).map(|(index, r)| {
            ImageId(Version {
                graph: self.decl.stamp,
                resource: index as u32,
                version: r.version,
            })
        })
    }

    /// Names of the images that [`image_named`](Self::image_named) finds, in order of declaration.
    pub fn image_names(&self) -> impl Iterator<Item = &str> {
        self.written_images().map(|(_, r)| r.name.as_ref())
    }

    /// Shape of an image of this graph; `None` for an id of another.
    pub fn image_desc(&self, id: ImageId) -> Option<ImageDesc> {
        let resource = self.decl.resources.get(id.0.resource as usize)?;
        match resource.kind {
            Kind::Image(desc) if id.0.graph == self.decl.stamp => Some(desc),
            _ => None,
        }
    }

    fn written_images(&self) -> impl Iterator<Item = (usize, &ResourceDecl)> {
        let all = self.decl.resources.iter().enumerate();
        all.filter(|(_, r)| {
            matches!(r.kind, Kind::Image(_))
                && matches!(r.origin, Origin::Transient | Origin::HistoryCurrent { .. })
                && r.version > 0
        })
    }

    /// Keeps a transient: its last contents are a result of the frame and stay in memory until the
    /// frame's end.
    pub fn keep<R: ResourceId>(&mut self, id: R) {
        let version = id.version();
        if version.graph != self.decl.stamp {
            self.decl.error.get_or_insert(GraphError::ForeignId {
                pass: "keep".to_string(),
            });
            return;
        }
        let resource = &self.decl.resources[version.resource as usize];
        if version.version != resource.version {
            self.decl.error.get_or_insert(GraphError::StaleId {
                pass: "keep".to_string(),
                resource: resource.name.to_string(),
                version: version.version,
                writer: resource.writer.to_string(),
                newer: resource.version,
            });
        }
        self.decl.kept.push(version.resource as usize);
    }

    fn add(&mut self, name: Name, kind: Kind, origin: Origin) -> Version {
        self.decl.resources.push(ResourceDecl {
            name,
            kind,
            origin,
            version: 0,
            writer: Name::Borrowed("nobody"),
        });
        Version {
            graph: self.decl.stamp,
            resource: (self.decl.resources.len() - 1) as u32,
            version: 0,
        }
    }
}
