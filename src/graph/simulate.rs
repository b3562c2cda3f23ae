//! Replays a plan against the memory model and reports what it would get wrong.
//!
//! The planner keeps a summary of each cell and asks what is missing; this keeps every access of
//! the frame as an event of its own, pushes every barrier through every event, and asks whether
//! each access was allowed. The two share the table of accesses and the logical order of stages,
//! and nothing else.
//!
//! An access is allowed if
//! - every earlier write of the same texels or bytes is available, and visible to the access (a
//!   write behind a read need only be ordered behind it);
//! - a write is ordered behind every earlier read;
//! - the image is in the layout of the access, and holds something if it is read;
//! - no other live transient has the memory, and whatever had it before is done with it.

use super::access::{WRITES, expand_access, expand_stages, stage_bits, with_earlier, with_later};
use super::pass::{Mode, overlap};
use super::plan::{Barrier, Placement, Plan, ResourceOrigin, ResourceShape};
use super::resource::{BufferPart, ImagePart, ImageState, Part};
use ash::vk::{AccessFlags2 as Access, ImageLayout, PipelineStageFlags2 as Stages};
use std::fmt;

/// Something that a plan gets wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hazard {
    /// Pass, barrier or end at which it shows.
    pub at: String,
    /// Resource and part.
    pub resource: String,
    /// What is wrong.
    pub problem: Problem,
}

/// Kinds of [`Hazard`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Problem {
    /// A read that an earlier write is not visible to.
    ReadAfterWrite,
    /// A write that an earlier write is not available or not visible to.
    WriteAfterWrite,
    /// A write that is not ordered behind an earlier read.
    WriteAfterRead,
    /// A layout transition that is not ordered behind an earlier access, or drops a write that is
    /// not available.
    TransitionAfterAccess,
    /// An image in one layout, used in another.
    WrongLayout {
        /// Layout that the use needs.
        needed: ImageLayout,
        /// Layout it is in.
        found: ImageLayout,
    },
    /// A read of contents that nobody wrote.
    Undefined,
    /// Two transients alive at once in the same memory.
    SharedMemory,
    /// Memory taken over before its last owner's accesses were done.
    HandOver,
    /// A transient outside its block of memory, or off its alignment.
    Misplaced,
}

impl fmt::Display for Hazard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}: {:?}", self.at, self.resource, self.problem)
    }
}

/// Replays the plan. An empty list says that nothing in it can go wrong.
pub fn simulate(plan: &Plan) -> Vec<Hazard> {
    let mut replay = Replay::new(plan);
    replay.check_placements();
    for (index, step) in plan.steps.iter().enumerate() {
        let at = format!("hand-over {index}");
        replay.batch(&step.hand_over.barriers, &at);
        let at = format!("barriers {index}");
        replay.batch(&step.barriers.barriers, &at);
        for pass in &step.passes {
            replay.pass(*pass, index);
        }
    }
    replay.batch(&plan.leave.barriers, "leave");
    replay.leave();
    replay.hazards
}

/// One stage's share of one access, or one transition.
struct Event {
    cell: usize,
    /// Stage, one bit; none for a transition.
    stage: Stages,
    access: Access,
    write: bool,
    /// Stages whose later work is ordered behind it.
    after: Stages,
    /// For each barrier that made the write available, the stages ordered behind that barrier.
    flushes: Vec<Stages>,
    visible: Vec<(Stages, Access)>,
    /// Whether a later read of the cell has been seen.
    read_since: bool,
}

impl Event {
    fn within(&self, src: Stages) -> bool {
        (self.stage | self.after).intersects(with_earlier(src))
    }

    /// Whether the write was made available, and that is within a barrier's first scope.
    fn available_to(&self, src: Stages) -> bool {
        let src = with_earlier(src);
        self.flushes.iter().any(|behind| behind.intersects(src))
    }

    /// Whether the write was made available before anything that these stages do now.
    fn available_before(&self, stages: Stages) -> bool {
        let before = |stage| self.flushes.iter().any(|behind| behind.contains(stage));
        stage_bits(stages).all(before)
    }

    fn flushed_by(&self, barrier: &Barrier) -> bool {
        !self.stage.is_empty()
            && expand_stages(barrier.src_stages).contains(self.stage)
            && expand_access(barrier.src_access).contains(self.access)
    }

    fn visible_to(&self, stage: Stages, access: Access) -> bool {
        let seen = self.visible.iter().filter(|(s, _)| s.contains(stage));
        seen.fold(Access::empty(), |all, (_, a)| all | *a)
            .contains(access)
    }
}

struct CellState {
    resource: usize,
    part: Part,
    layout: ImageLayout,
    defined: bool,
    begun: bool,
}

struct Replay<'p> {
    plan: &'p Plan,
    cells: Vec<CellState>,
    events: Vec<Event>,
    hazards: Vec<Hazard>,
}

impl<'p> Replay<'p> {
    fn new(plan: &'p Plan) -> Self {
        let mut replay = Self {
            plan,
            cells: Vec::new(),
            events: Vec::new(),
            hazards: Vec::new(),
        };
        for (resource, declared) in plan.resources.iter().enumerate() {
            let enter = declared.states().map(|(enter, _)| enter);
            let buffer = matches!(declared.shape, ResourceShape::Buffer { .. });
            for part in cut(plan, resource) {
                let layout = enter.map_or(ImageLayout::UNDEFINED, |state| state.layout);
                replay.cells.push(CellState {
                    resource,
                    part,
                    layout,
                    defined: enter.is_some() && (buffer || layout != ImageLayout::UNDEFINED),
                    begun: enter.is_some(),
                });
                if let Some(enter) = enter {
                    replay.enter(replay.cells.len() - 1, enter);
                }
            }
        }
        replay
    }

    fn enter(&mut self, cell: usize, state: ImageState) {
        let access = expand_access(state.access);
        let stages = expand_stages(state.stages);
        let (writes, reads) = (access & WRITES, access & !WRITES);
        for stage in stage_bits(stages) {
            if writes.is_empty() {
                self.event(cell, stage, reads, false);
            }
            self.event(cell, stage, writes, true);
            if let Some(event) = self.events.last_mut() {
                if writes.is_empty() {
                    event.flushes.push(with_later(stages));
                    event.visible.push((stages, reads));
                }
                event.read_since = writes.is_empty();
            }
        }
    }

    fn event(&mut self, cell: usize, stage: Stages, access: Access, write: bool) {
        self.events.push(Event {
            cell,
            stage,
            access,
            write,
            after: Stages::empty(),
            flushes: Vec::new(),
            visible: Vec::new(),
            read_since: false,
        });
    }

    fn object(&mut self, at: &str, cell: usize, problem: Problem) {
        let cell = &self.cells[cell];
        let name = &self.plan.resources[cell.resource].name;
        self.hazards.push(Hazard {
            at: at.to_string(),
            resource: format!("`{name}` {}", cell.part),
            problem,
        });
    }

    fn object_to_resource(&mut self, at: &str, resource: usize, problem: Problem) {
        self.hazards.push(Hazard {
            at: at.to_string(),
            resource: format!("`{}`", self.plan.resources[resource].name),
            problem,
        });
    }

    fn check_placements(&mut self) {
        let plan = self.plan;
        let mut placed: Vec<(usize, Placement)> = Vec::new();
        for (index, resource) in plan.resources.iter().enumerate() {
            let ResourceOrigin::Transient(Some(place)) = resource.origin else {
                continue;
            };
            let fits = plan.arenas.get(place.arena).is_some_and(|arena| {
                place.offset % place.alignment == 0
                    && arena.alignment % place.alignment == 0
                    && place.offset + place.size <= arena.size
            });
            if !fits {
                self.object_to_resource("placement", index, Problem::Misplaced);
            }
            for (other, other_place) in &placed {
                let together = match (resource.steps, plan.resources[*other].steps) {
                    (Some(a), Some(b)) => a.0 <= b.1 && b.0 <= a.1,
                    _ => false,
                };
                if together && shares(&place, other_place) {
                    self.object_to_resource("placement", index, Problem::SharedMemory);
                }
            }
            placed.push((index, place));
        }
    }

    /// Issues one batch: all its barriers see the state from before it.
    fn batch(&mut self, barriers: &[Barrier], at: &str) {
        for barrier in barriers {
            for cell in self.covered(barrier) {
                if let Some(transition) = barrier.transition {
                    self.check_transition(cell, barrier, transition.old, at);
                }
            }
        }
        for index in 0..self.events.len() {
            let event = &self.events[index];
            let mut after = event.after;
            let mut flushes = event.flushes.clone();
            let mut visible = Vec::new();
            for barrier in barriers {
                let behind = with_later(barrier.dst_stages);
                if event.within(barrier.src_stages) {
                    after |= behind;
                }
                let source = with_earlier(barrier.src_stages);
                for (flush, before) in flushes.iter_mut().zip(&event.flushes) {
                    if before.intersects(source) {
                        *flush |= behind;
                    }
                }
                if !event.write || !self.covers(barrier, event.cell) {
                    continue;
                }
                let flushed = event.flushed_by(barrier);
                if flushed || event.available_to(barrier.src_stages) {
                    let dst = expand_stages(barrier.dst_stages);
                    visible.push((dst, expand_access(barrier.dst_access)));
                }
                if flushed {
                    flushes.push(behind);
                }
            }
            let event = &mut self.events[index];
            event.after = after;
            event.flushes = flushes;
            event.visible.append(&mut visible);
        }
        for barrier in barriers {
            let Some(transition) = barrier.transition else {
                continue;
            };
            for cell in self.covered(barrier) {
                self.cells[cell].layout = transition.new;
                self.cells[cell].begun = true;
                self.cells[cell].defined &= transition.old != ImageLayout::UNDEFINED;
                self.event(cell, Stages::empty(), Access::empty(), true);
                if let Some(event) = self.events.last_mut() {
                    let dst = expand_stages(barrier.dst_stages);
                    event.after = with_later(dst);
                    event.flushes.push(event.after);
                    event.visible = vec![(dst, expand_access(barrier.dst_access))];
                }
            }
        }
    }

    fn covers(&self, barrier: &Barrier, cell: usize) -> bool {
        let cell = &self.cells[cell];
        barrier
            .target
            .is_none_or(|(resource, part)| resource == cell.resource && overlap(part, cell.part))
    }

    fn covered(&self, barrier: &Barrier) -> Vec<usize> {
        let cells = 0..self.cells.len();
        cells.filter(|cell| self.covers(barrier, *cell)).collect()
    }

    fn check_transition(&mut self, cell: usize, barrier: &Barrier, old: ImageLayout, at: &str) {
        let state = &self.cells[cell];
        if old != ImageLayout::UNDEFINED && old != state.layout {
            let (needed, found) = (old, state.layout);
            self.object(at, cell, Problem::WrongLayout { needed, found });
        }
        let own = |event: &&Event| event.cell == cell;
        let bad = self.events.iter().filter(own).any(|event| {
            let available = event.flushed_by(barrier) || event.available_to(barrier.src_stages);
            !event.within(barrier.src_stages) || (event.write && !available)
        });
        if bad {
            self.object(at, cell, Problem::TransitionAfterAccess);
        }
        let bad = !self.cells[cell].begun
            && self.former_events(cell).any(|event| {
                let available = event.available_to(barrier.src_stages);
                !event.within(barrier.src_stages) || (event.write && !available)
            });
        if bad {
            self.object(at, cell, Problem::HandOver);
        }
    }

    /// What other transients did with the memory of this cell.
    fn former_events(&self, cell: usize) -> impl Iterator<Item = &Event> {
        let plan = self.plan;
        let place = |cell: usize| match plan.resources[self.cells[cell].resource].origin {
            ResourceOrigin::Transient(place) => place,
            _ => None,
        };
        let own = place(cell);
        let resource = self.cells[cell].resource;
        self.events.iter().filter(move |event| {
            let foreign = self.cells[event.cell].resource != resource;
            let shared = own.zip(place(event.cell));
            foreign && shared.is_some_and(|(own, other)| shares(&own, &other))
        })
    }

    fn pass(&mut self, pass: usize, step: usize) {
        let plan = self.plan;
        let pass = &plan.passes[pass];
        let mut done = Vec::new();
        for used in &pass.uses {
            let info = used.access.info();
            let stages = expand_stages(info.stages);
            let resource = &plan.resources[used.resource];
            if resource.steps.is_none_or(|(a, b)| step < a || b < step) {
                self.object_to_resource(&pass.name, used.resource, Problem::SharedMemory);
            }
            let image = matches!(resource.shape, ResourceShape::Image { .. });
            let layout = info.layout.filter(|_| image);
            let cells = 0..self.cells.len();
            let cells = cells.filter(|cell| {
                let cell = &self.cells[*cell];
                cell.resource == used.resource && overlap(cell.part, used.part)
            });
            for cell in cells.collect::<Vec<_>>() {
                let found = self.cells[cell].layout;
                if let Some(needed) = layout.filter(|needed| *needed != found) {
                    self.object(&pass.name, cell, Problem::WrongLayout { needed, found });
                }
                self.check_access(
                    cell,
                    stages,
                    info.access,
                    used.mode,
                    used.access.reads(),
                    pass,
                );
                done.push((cell, stages, info.access, used.mode));
            }
        }
        for (cell, stages, access, mode) in done {
            self.cells[cell].begun = true;
            let writes = mode != Mode::Read;
            if writes {
                self.cells[cell].defined = true;
            } else {
                let own = self.events.iter_mut().filter(|event| event.cell == cell);
                own.for_each(|event| event.read_since = true);
            }
            for stage in stage_bits(stages) {
                let kind = if writes { access & WRITES } else { access };
                self.event(cell, stage, kind, writes);
            }
        }
    }

    fn check_access(
        &mut self,
        cell: usize,
        stages: Stages,
        access: Access,
        mode: Mode,
        reads: bool,
        pass: &super::plan::PlanPass,
    ) {
        let at = &pass.name;
        if reads && !self.cells[cell].defined {
            self.object(at, cell, Problem::Undefined);
        }
        let own = |event: &&Event| event.cell == cell;
        let seen = |event: &Event| stage_bits(stages).all(|s| event.visible_to(s, access));
        let behind = |event: &Event| event.after.contains(stages);
        let own_events = || self.events.iter().filter(own);
        let read_after_write = reads && own_events().any(|e| e.write && !seen(e));
        let writes = mode != Mode::Read;
        let write_after_write = writes
            && own_events().any(|e| {
                let available = e.available_before(stages);
                let missing = !available || !behind(e) || (!e.read_since && !seen(e));
                e.write && missing
            });
        let write_after_read = writes && own_events().any(|e| !e.write && !behind(e));
        // An image begins with a transition, to which all that is available is visible.
        let hand_over = !self.cells[cell].begun
            && self.former_events(cell).any(|e| {
                let hidden = !e.available_before(stages) || (!e.read_since && !seen(e));
                !behind(e) || (e.write && hidden)
            });
        for (bad, problem) in [
            (read_after_write, Problem::ReadAfterWrite),
            (write_after_write, Problem::WriteAfterWrite),
            (write_after_read, Problem::WriteAfterRead),
            (hand_over, Problem::HandOver),
        ] {
            if bad {
                self.object(at, cell, problem);
            }
        }
    }

    fn leave(&mut self) {
        for cell in 0..self.cells.len() {
            let resource = &self.plan.resources[self.cells[cell].resource];
            let Some((_, leave)) = resource.states() else {
                continue;
            };
            let found = self.cells[cell].layout;
            if leave.layout != found {
                let needed = leave.layout;
                self.object("leave", cell, Problem::WrongLayout { needed, found });
            }
            let access = expand_access(leave.access);
            let stages = expand_stages(leave.stages);
            let hidden = |event: &Event| {
                event.write && !stage_bits(stages).all(|s| event.visible_to(s, access))
            };
            let own = |event: &&Event| event.cell == cell;
            if self.events.iter().filter(own).any(hidden) {
                self.object("leave", cell, Problem::ReadAfterWrite);
            }
            let writes = access.intersects(WRITES);
            let early = |event: &Event| !event.write && !event.after.contains(stages);
            if writes && self.events.iter().filter(own).any(early) {
                self.object("leave", cell, Problem::WriteAfterRead);
            }
        }
    }
}

fn shares(a: &Placement, b: &Placement) -> bool {
    a.arena == b.arena && a.offset < b.offset + b.size && b.offset < a.offset + a.size
}

/// The smallest parts of a resource that the plan treats as one.
fn cut(plan: &Plan, resource: usize) -> Vec<Part> {
    match plan.resources[resource].shape {
        ResourceShape::Image { desc, .. } => {
            let levels = (0..desc.mips).flat_map(|mip| (0..desc.layers).map(move |l| (mip, l)));
            levels
                .map(|(base_mip, base_layer)| {
                    Part::Image(ImagePart {
                        base_mip,
                        mips: 1,
                        base_layer,
                        layers: 1,
                    })
                })
                .collect()
        }
        ResourceShape::Buffer { desc, .. } => {
            let used = plan.passes.iter().flat_map(|pass| &pass.uses);
            let used = used.map(|used| (used.resource, used.part));
            let barriers = plan.batches().flat_map(|batch| &batch.barriers);
            let targets = barriers.filter_map(|barrier| barrier.target);
            let mut cuts = vec![0, desc.size];
            for (of, part) in used.chain(targets) {
                if let Part::Buffer(part) = part
                    && of == resource
                {
                    cuts.extend([part.offset, part.offset + part.size]);
                }
            }
            cuts.sort_unstable();
            cuts.dedup();
            let spans = cuts.windows(2);
            spans
                .map(|span| {
                    Part::Buffer(BufferPart {
                        offset: span[0],
                        size: span[1] - span[0],
                    })
                })
                .collect()
        }
    }
}
