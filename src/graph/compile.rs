//! From declarations to a plan, one named step after another. No device is touched.

use super::alias::{MemoryModel, Tenant, place};
use super::barrier::{Barriers, Schedule, barriers};
use super::cells::CellMap;
use super::error::GraphError;
use super::pass::{Mode, RecordFn};
use super::plan::{
    Arena, CulledPass, Placement, Plan, PlanPass, PlanResource, PlanUse, ResourceOrigin,
    ResourceShape, Step,
};
use super::resource::{HostBuffer, HostImage, ImageState};
use super::{Declarations, Graph, Kind, Origin, order};
use ash::vk;

/// A graph that has been planned and can be recorded once.
pub struct CompiledGraph<'f> {
    pub(crate) plan: Plan,
    /// By index into [`Plan::passes`].
    pub(crate) records: Vec<Option<RecordFn<'f>>>,
    /// By index into [`Plan::resources`].
    pub(crate) hosts: Vec<Host>,
}

/// Handles of a resource that the host owns.
#[derive(Clone, Copy)]
pub(crate) enum Host {
    None,
    Image(HostImage),
    Buffer(HostBuffer),
}

impl<'f> Graph<'f> {
    /// Plans the frame.
    pub fn compile(self, memory: &impl MemoryModel) -> Result<CompiledGraph<'f>, GraphError> {
        let Graph {
            decl, mut records, ..
        } = self;
        let plan = compile(&decl, memory)?;
        let records = plan.passes.iter().map(|pass| records[pass.declared].take());
        Ok(CompiledGraph {
            records: records.collect(),
            hosts: decl
                .resources
                .iter()
                .map(|resource| match resource.origin {
                    Origin::Image(host) => Host::Image(host),
                    Origin::Buffer(host) => Host::Buffer(host),
                    _ => Host::None,
                })
                .collect(),
            plan,
        })
    }
}

impl CompiledGraph<'_> {
    /// The plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Changes the plan before it is recorded, so that tests can plant mistakes and see them found.
    #[doc(hidden)]
    pub fn edit_plan(&mut self, edit: impl FnOnce(&mut Plan)) {
        edit(&mut self.plan);
    }
}

fn compile(decl: &Declarations, memory: &impl MemoryModel) -> Result<Plan, GraphError> {
    validate(decl)?;
    let maps = CellMap::all(decl);
    order::check_initialised(decl, &maps)?;
    let live = order::live_passes(decl, &maps);
    let levels = order::levels(decl, &maps, &live);
    let lives = lifetimes(decl, &levels);
    let shapes = shapes(decl, &live);
    let (placed, arenas) = placements(decl, memory, &shapes, &lives);
    let barriers = barriers(&Schedule {
        decl,
        maps: &maps,
        levels: &levels,
        placed: &placed,
    });
    Ok(assemble(
        decl, &live, &levels, &lives, &shapes, &placed, arenas, barriers,
    ))
}

fn validate(decl: &Declarations) -> Result<(), GraphError> {
    if let Some(error) = &decl.error {
        return Err(error.clone());
    }
    for resource in &decl.resources {
        let problem = match resource.kind {
            Kind::Image(desc) if desc.width == 0 || desc.height == 0 => Some(format!(
                "an image of {}x{} texels has no texel",
                desc.width, desc.height
            )),
            Kind::Image(desc) if desc.layers == 0 || desc.mips == 0 => {
                Some("an image needs at least one layer and one mip level".to_string())
            }
            Kind::Image(desc) if desc.mips > desc.max_mips() => Some(format!(
                "{} mip levels, but {}x{} texels allow {}",
                desc.mips,
                desc.width,
                desc.height,
                desc.max_mips()
            )),
            Kind::Buffer(desc) if desc.size == 0 => Some("a buffer of 0 bytes".to_string()),
            _ => None,
        };
        if let Some(problem) = problem {
            return Err(GraphError::BadDescription {
                resource: resource.name.to_string(),
                problem,
            });
        }
    }
    decl.passes.iter().try_for_each(|pass| {
        let sized = |attachment: &super::Attachment| {
            let resource = &decl.resources[attachment.resource];
            match resource.kind {
                Kind::Image(desc) => {
                    let mip = attachment.part.base_mip;
                    let (w, h) = (desc.width >> mip, desc.height >> mip);
                    Some((resource.name.to_string(), w.max(1), h.max(1)))
                }
                Kind::Buffer(_) => None,
            }
        };
        let mut sizes = pass.attachments.iter().filter_map(sized);
        let Some((other, other_width, other_height)) = sizes.next() else {
            return Ok(());
        };
        match sizes.find(|(_, w, h)| (*w, *h) != (other_width, other_height)) {
            None => Ok(()),
            Some((resource, width, height)) => Err(GraphError::AttachmentSize {
                pass: pass.name.to_string(),
                resource,
                width,
                height,
                other,
                other_width,
                other_height,
            }),
        }
    })
}

/// First and last step of every resource.
fn lifetimes(decl: &Declarations, levels: &[Vec<usize>]) -> Vec<Option<(usize, usize)>> {
    let mut lives: Vec<Option<(usize, usize)>> = vec![None; decl.resources.len()];
    for (step, level) in levels.iter().enumerate() {
        for used in level.iter().flat_map(|pass| &decl.passes[*pass].uses) {
            let life = lives[used.resource].get_or_insert((step, step));
            life.1 = step;
        }
    }
    for kept in &decl.kept {
        if let Some(life) = &mut lives[*kept] {
            life.1 = levels.len() - 1;
        }
    }
    lives
}

/// Shapes with the usage that live passes need.
fn shapes(decl: &Declarations, live: &[bool]) -> Vec<ResourceShape> {
    let mut image_usage = vec![vk::ImageUsageFlags::empty(); decl.resources.len()];
    let mut buffer_usage = vec![vk::BufferUsageFlags::empty(); decl.resources.len()];
    for (pass, _) in decl.passes.iter().zip(live).filter(|(_, live)| **live) {
        for used in &pass.uses {
            let info = used.access.info();
            image_usage[used.resource] |= info.image_usage;
            buffer_usage[used.resource] |= info.buffer_usage;
        }
    }
    let resources = decl.resources.iter().enumerate();
    resources
        .map(|(index, resource)| match resource.kind {
            Kind::Image(desc) => ResourceShape::Image {
                desc,
                usage: image_usage[index],
            },
            Kind::Buffer(desc) => ResourceShape::Buffer {
                desc,
                usage: buffer_usage[index],
            },
        })
        .collect()
}

fn placements(
    decl: &Declarations,
    memory: &impl MemoryModel,
    shapes: &[ResourceShape],
    lives: &[Option<(usize, usize)>],
) -> (Vec<(usize, Tenant, Placement)>, Vec<Arena>) {
    let mut tenants = Vec::new();
    let mut owners = Vec::new();
    for (index, resource) in decl.resources.iter().enumerate() {
        if let (Origin::Transient, Some(steps)) = (&resource.origin, lives[index]) {
            owners.push(index);
            tenants.push(Tenant {
                need: memory.need(&shapes[index]),
                image: matches!(resource.kind, Kind::Image(_)),
                steps,
            });
        }
    }
    let (placements, arenas) = place(&tenants);
    let placed = owners.into_iter().zip(tenants).zip(placements);
    let placed = placed.map(|((owner, tenant), place)| (owner, tenant, place));
    (placed.collect(), arenas)
}

#[allow(clippy::too_many_arguments)]
fn assemble(
    decl: &Declarations,
    live: &[bool],
    levels: &[Vec<usize>],
    lives: &[Option<(usize, usize)>],
    shapes: &[ResourceShape],
    placed: &[(usize, Tenant, Placement)],
    arenas: Vec<Arena>,
    barriers: Barriers,
) -> Plan {
    let state = |index: usize| barriers.left[index].unwrap_or(ImageState::UNDEFINED);
    let resources = decl.resources.iter().enumerate().map(|(index, resource)| {
        let origin = match &resource.origin {
            Origin::Transient => ResourceOrigin::Transient(
                placed
                    .iter()
                    .find(|(owner, ..)| *owner == index)
                    .map(|(.., place)| *place),
            ),
            Origin::Image(host) => ResourceOrigin::Imported {
                enter: host.enter,
                leave: host.leave,
            },
            Origin::Buffer(host) => ResourceOrigin::Imported {
                enter: super::barrier::buffer_state(host.enter),
                leave: super::barrier::buffer_state(host.leave),
            },
            Origin::HistoryPrevious { key, state: enter } => ResourceOrigin::HistoryPrevious {
                key,
                enter: *enter,
                leave: state(index),
            },
            Origin::HistoryCurrent { key, state: enter } => ResourceOrigin::HistoryCurrent {
                key,
                enter: *enter,
                leave: state(index),
            },
        };
        PlanResource {
            name: resource.name.clone(),
            shape: shapes[index],
            origin,
            steps: lives[index],
        }
    });
    let mut passes = Vec::new();
    let mut steps = Vec::new();
    for (level, found) in levels.iter().zip(barriers.steps) {
        let first = passes.len();
        passes.extend(level.iter().map(|index| plan_pass(decl, *index)));
        steps.push(Step {
            hand_over: found.hand_over,
            barriers: found.barriers,
            passes: (first..passes.len()).collect(),
        });
    }
    let dead = decl.passes.iter().enumerate().filter(|(i, _)| !live[*i]);
    let culled = dead.map(|(declared, pass)| CulledPass {
        name: pass.name.clone(),
        declared,
        reason: cull_reason(decl, declared),
    });
    let mut culled: Vec<CulledPass> = culled.chain(decl.skipped.iter().cloned()).collect();
    culled.sort_by_key(|pass| pass.declared);
    Plan {
        resources: resources.collect(),
        culled,
        passes,
        steps,
        leave: barriers.leave,
        arenas,
    }
}

fn plan_pass(decl: &Declarations, declared: usize) -> PlanPass {
    let pass = &decl.passes[declared];
    let uses = pass.uses.iter().map(|used| PlanUse {
        resource: used.resource,
        part: used.part,
        access: used.access,
        mode: used.mode,
    });
    PlanPass {
        name: pass.name.clone(),
        declared,
        kind: pass.kind,
        uses: uses.collect(),
        attachments: pass.attachments.clone(),
    }
}

fn cull_reason(decl: &Declarations, pass: usize) -> String {
    let uses = decl.passes[pass].uses.iter();
    let mut names: Vec<&str> = uses
        .filter(|used| used.mode != Mode::Read)
        .map(|used| decl.resources[used.resource].name.as_ref())
        .collect();
    names.dedup();
    if names.is_empty() {
        return "it writes nothing".to_string();
    }
    let list: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    format!("nobody reads what it writes: {}", list.join(", "))
}
