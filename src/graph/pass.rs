//! Declaring a pass: what it reads, what it writes, and the commands it records.

use super::access::{Access, expand_access, expand_stages};
use super::error::GraphError;
use super::exec::PassContext;
use super::resource::{ImageId, ImagePart, Part, ResourceId};
use super::{Declarations, Graph, Kind, Name, Origin};
use crate::gpu::GpuError;
use ash::vk;

/// What a pass records.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PassKind {
    /// Draws into attachments. The graph opens and closes dynamic rendering.
    Graphics,
    /// Dispatches.
    Compute,
    /// Copies, fills and clears.
    Transfer,
}

impl PassKind {
    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            PassKind::Graphics => "graphics",
            PassKind::Compute => "compute",
            PassKind::Transfer => "transfer",
        }
    }

    /// Pipeline stages that a pass of this kind can execute.
    fn stages(self) -> vk::PipelineStageFlags2 {
        use vk::PipelineStageFlags2 as S;
        expand_stages(match self {
            PassKind::Graphics => S::ALL_GRAPHICS,
            PassKind::Compute => S::COMPUTE_SHADER | S::DRAW_INDIRECT,
            PassKind::Transfer => S::ALL_TRANSFER,
        })
    }
}

/// What an attachment holds when the pass begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// What earlier passes wrote.
    Keep,
    /// One value everywhere: four channels, or depth in the first.
    Clear([f32; 4]),
    /// Anything: the pass writes every texel.
    Discard,
}

/// An attachment of a graphics pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attachment {
    /// Index of the image in [`super::Plan::resources`].
    pub resource: usize,
    /// The mip level and layer drawn to.
    pub part: ImagePart,
    /// Contents at the start.
    pub load: Load,
    /// Depth, else colour.
    pub depth: bool,
    /// Whether the pass can change it.
    pub writes: bool,
}

/// How a use treats what was there before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Mode {
    /// Reads only.
    Read,
    /// Writes some of it, or reads and writes; the rest stays.
    Write,
    /// Replaces all of it; what was there is dropped.
    Overwrite,
}

#[derive(Clone, Debug)]
pub(crate) struct UseDecl {
    pub resource: usize,
    pub part: Part,
    pub access: Access,
    pub mode: Mode,
}

pub(crate) type RecordFn<'f> = Box<dyn FnOnce(&mut PassContext<'_>) -> Result<(), GpuError> + 'f>;

pub(crate) struct PassDecl {
    pub name: Name,
    pub kind: PassKind,
    pub uses: Vec<UseDecl>,
    pub attachments: Vec<Attachment>,
}

/// Declares one pass. Dropping it without [`PassBuilder::record`] leaves a pass that records no
/// commands of its own: an attachment clear, for example.
pub struct PassBuilder<'g, 'f> {
    pub(crate) graph: &'g mut Graph<'f>,
    pub(crate) pass: usize,
}

impl<'f> PassBuilder<'_, 'f> {
    /// Reads all of a resource.
    pub fn read<R: ResourceId>(&mut self, id: R, access: Access) {
        self.use_resource(id, None, access, Mode::Read);
    }

    /// Reads a part of a resource. Name what the commands read and no more: the rest would wait for
    /// its writers, and its next writer for this pass, for nothing.
    pub fn read_part<R: ResourceId>(&mut self, id: R, part: R::Part, access: Access) {
        self.use_resource(id, Some(part.into()), access, Mode::Read);
    }

    /// Writes into a resource; what it does not touch stays as it was. Returns the new version.
    #[must_use = "the old id is stale from here on"]
    pub fn write<R: ResourceId>(&mut self, id: R, access: Access) -> R {
        self.use_resource(id, None, access, Mode::Write)
    }

    /// Writes into a part of a resource. Returns the new version of the whole resource.
    #[must_use = "the old id is stale from here on"]
    pub fn write_part<R: ResourceId>(&mut self, id: R, part: R::Part, access: Access) -> R {
        self.use_resource(id, Some(part.into()), access, Mode::Write)
    }

    /// Replaces all contents of a resource. Earlier writers are culled unless somebody read them.
    #[must_use = "the old id is stale from here on"]
    pub fn overwrite<R: ResourceId>(&mut self, id: R, access: Access) -> R {
        self.use_resource(id, None, access, Mode::Overwrite)
    }

    /// Replaces all contents of a part of a resource.
    #[must_use = "the old id is stale from here on"]
    pub fn overwrite_part<R: ResourceId>(&mut self, id: R, part: R::Part, access: Access) -> R {
        self.use_resource(id, Some(part.into()), access, Mode::Overwrite)
    }

    /// Draws into mip level 0, layer 0 of an image as the next colour attachment.
    #[must_use = "the old id is stale from here on"]
    pub fn color(&mut self, id: ImageId, load: Load) -> ImageId {
        self.color_part(id, ImagePart::mip(0), load)
    }

    /// Draws into one mip level of one layer as the next colour attachment.
    #[must_use = "the old id is stale from here on"]
    pub fn color_part(&mut self, id: ImageId, part: ImagePart, load: Load) -> ImageId {
        let (access, mode) = match load {
            Load::Keep => (Access::ColorAttachmentLoad, Mode::Write),
            Load::Clear(_) | Load::Discard => (Access::ColorAttachment, Mode::Overwrite),
        };
        self.attach(id, part, load, false, true);
        self.use_resource(id, Some(part.into()), access, mode)
    }

    /// Tests against and writes mip level 0, layer 0 of an image as the depth attachment.
    #[must_use = "the old id is stale from here on"]
    pub fn depth(&mut self, id: ImageId, load: Load) -> ImageId {
        self.depth_part(id, ImagePart::mip(0), load)
    }

    /// Tests against and writes one mip level of one layer as the depth attachment.
    #[must_use = "the old id is stale from here on"]
    pub fn depth_part(&mut self, id: ImageId, part: ImagePart, load: Load) -> ImageId {
        let (access, mode) = match load {
            Load::Keep => (Access::DepthAttachmentLoad, Mode::Write),
            Load::Clear(_) | Load::Discard => (Access::DepthAttachment, Mode::Overwrite),
        };
        self.attach(id, part, load, true, true);
        self.use_resource(id, Some(part.into()), access, mode)
    }

    /// Tests against an image as the depth attachment without writing it.
    pub fn depth_test(&mut self, id: ImageId) {
        let part = ImagePart::mip(0);
        self.attach(id, part, Load::Keep, true, false);
        self.use_resource(id, Some(part.into()), Access::DepthTest, Mode::Read);
    }

    /// Sets the commands of the pass.
    pub fn record(self, f: impl FnOnce(&mut PassContext<'_>) -> Result<(), GpuError> + 'f) {
        self.graph.records[self.pass] = Some(Box::new(f));
    }

    fn attach(&mut self, id: ImageId, part: ImagePart, load: Load, depth: bool, writes: bool) {
        let resource = id.0.resource as usize;
        self.graph.decl.passes[self.pass]
            .attachments
            .push(Attachment {
                resource,
                part,
                load,
                depth,
                writes,
            });
    }

    fn use_resource<R: ResourceId>(
        &mut self,
        id: R,
        part: Option<Part>,
        access: Access,
        mode: Mode,
    ) -> R {
        let version = id.version();
        match self
            .graph
            .decl
            .check_use(self.pass, version, part, access, mode)
        {
            Err(error) => {
                self.graph.decl.error.get_or_insert(error);
                id
            }
            Ok(part) => {
                let decl = &mut self.graph.decl;
                let pass = &mut decl.passes[self.pass];
                let resource = &mut decl.resources[version.resource as usize];
                pass.uses.push(UseDecl {
                    resource: version.resource as usize,
                    part,
                    access,
                    mode,
                });
                if mode == Mode::Read {
                    return id;
                }
                resource.version += 1;
                resource.writer = pass.name.clone();
                R::from_version(super::resource::Version {
                    version: resource.version,
                    ..version
                })
            }
        }
    }
}

impl Declarations {
    /// Checks one use against everything that can be known at once; returns the part it covers.
    fn check_use(
        &self,
        pass: usize,
        id: super::resource::Version,
        part: Option<Part>,
        access: Access,
        mode: Mode,
    ) -> Result<Part, GraphError> {
        let pass = &self.passes[pass];
        let pass_name = pass.name.to_string();
        if id.graph != self.stamp {
            return Err(GraphError::ForeignId { pass: pass_name });
        }
        let resource = &self.resources[id.resource as usize];
        let name = resource.name.to_string();
        if id.version != resource.version {
            return Err(GraphError::StaleId {
                pass: pass_name,
                resource: name,
                version: id.version,
                writer: resource.writer.to_string(),
                newer: resource.version,
            });
        }
        let info = access.info();
        let access_name = format!("{access:?}");
        let (what, fits) = match resource.kind {
            Kind::Image(_) => ("an image", info.layout.is_some()),
            Kind::Buffer(_) => ("a buffer", !info.buffer_usage.is_empty()),
        };
        if !fits {
            return Err(GraphError::WrongKind {
                pass: pass_name,
                resource: name,
                what,
                access: access_name,
            });
        }
        let problem = match mode {
            Mode::Read if access.writes() => Some("writes; declare it with `write`"),
            Mode::Write if !access.writes() => Some("does not write; declare it with `read`"),
            Mode::Overwrite if !access.writes() => Some("does not write; declare it with `read`"),
            Mode::Overwrite if access.reads() => {
                Some("reads what it would drop; declare it with `write`")
            }
            _ => None,
        };
        if let Some(problem) = problem {
            return Err(GraphError::WrongDirection {
                pass: pass_name,
                resource: name,
                access: access_name,
                problem,
            });
        }
        if !pass.kind.stages().contains(expand_stages(info.stages)) {
            return Err(GraphError::WrongPassKind {
                pass: pass_name,
                resource: name,
                kind: pass.kind.name(),
                access: access_name,
            });
        }
        if mode != Mode::Read && matches!(resource.origin, Origin::HistoryPrevious { .. }) {
            return Err(GraphError::ReadOnly {
                pass: pass_name,
                resource: name,
            });
        }
        let whole = resource.kind.whole();
        let part = part.unwrap_or(whole);
        if !inside(part, whole) {
            return Err(GraphError::OutOfRange {
                pass: pass_name,
                resource: name,
                part: part.to_string(),
                extent: whole.to_string(),
            });
        }
        let missing = match &resource.origin {
            Origin::Image(host) => (!host.usage.contains(info.image_usage))
                .then(|| format!("{:?}", info.image_usage & !host.usage)),
            Origin::Buffer(host) => (!host.usage.contains(info.buffer_usage))
                .then(|| format!("{:?}", info.buffer_usage & !host.usage)),
            _ => None,
        };
        if let Some(missing) = missing {
            return Err(GraphError::MissingUsage {
                pass: pass_name,
                resource: name,
                missing,
            });
        }
        for other in &pass.uses {
            let same = other.resource == id.resource as usize && overlap(other.part, part);
            let both_read = other.mode == Mode::Read && mode == Mode::Read;
            let layouts_agree = other.access.info().layout == info.layout || whole_is_buffer(whole);
            if same && !(both_read && layouts_agree) {
                return Err(GraphError::Conflict {
                    pass: pass_name,
                    resource: name,
                    part: part.to_string(),
                    first: format!("{:?}", other.access),
                    second: access_name,
                });
            }
        }
        debug_assert!(!expand_access(info.access).is_empty());
        Ok(part)
    }
}

fn whole_is_buffer(part: Part) -> bool {
    matches!(part, Part::Buffer(_))
}

fn inside(part: Part, whole: Part) -> bool {
    let span = |base: u32, count: u32, end: u32| {
        count > 0 && base.checked_add(count).is_some_and(|last| last <= end)
    };
    match (part, whole) {
        (Part::Image(p), Part::Image(w)) => {
            span(p.base_mip, p.mips, w.mips) && span(p.base_layer, p.layers, w.layers)
        }
        (Part::Buffer(p), Part::Buffer(w)) => {
            p.size > 0
                && p.offset
                    .checked_add(p.size)
                    .is_some_and(|last| last <= w.size)
        }
        _ => false,
    }
}

/// Whether two parts of one resource share a texel or a byte.
pub(crate) fn overlap(a: Part, b: Part) -> bool {
    match (a, b) {
        (Part::Image(a), Part::Image(b)) => {
            a.base_mip < b.base_mip + b.mips
                && b.base_mip < a.base_mip + a.mips
                && a.base_layer < b.base_layer + b.layers
                && b.base_layer < a.base_layer + a.layers
        }
        (Part::Buffer(a), Part::Buffer(b)) => {
            a.offset < b.offset + b.size && b.offset < a.offset + a.size
        }
        _ => false,
    }
}
