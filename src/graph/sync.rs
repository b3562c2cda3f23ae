//! What the barriers issued so far have ordered, made available and made visible.
//!
//! The rules are those of the Vulkan specification, chapter "Synchronization and Cache Control":
//! an execution dependency orders *all* earlier commands of its first scope before all later ones
//! of its second, and chains through common stages; availability and visibility cover only the
//! memory that the barrier names, and visibility only what is already available.

use super::access::{WRITES, expand_access, expand_stages, stage_bits, with_earlier, with_later};
use super::plan::{Barrier, Transition};
use super::resource::ImageState;
use ash::vk::{AccessFlags2 as Access, ImageLayout, PipelineStageFlags2 as Stages};

/// Execution scopes of one barrier, with logically earlier and later stages.
#[derive(Clone, Copy)]
struct Scopes {
    src: Stages,
    dst: Stages,
}

/// The execution dependencies of the frame so far, batch by batch.
#[derive(Default)]
pub(crate) struct Log {
    batches: Vec<Vec<Scopes>>,
}

impl Log {
    /// Appends a batch that is now final.
    pub fn push(&mut self, batch: &[Barrier]) {
        let scopes = batch.iter().map(|barrier| Scopes {
            src: with_earlier(barrier.src_stages),
            dst: with_later(barrier.dst_stages),
        });
        self.batches.push(scopes.collect());
    }

    /// The time after the last batch.
    pub fn now(&self) -> usize {
        self.batches.len()
    }

    /// Stages whose later work is ordered behind work that `origin` had done at time `since`.
    fn reach(&self, origin: Stages, since: usize) -> Stages {
        let mut reached = Stages::empty();
        for batch in &self.batches[since..] {
            let mut added = Stages::empty();
            for scope in batch {
                if (origin | reached).intersects(scope.src) {
                    added |= scope.dst;
                }
            }
            reached |= added;
        }
        reached
    }
}

/// Something done to a cell, for later work to be ordered behind.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Event {
    /// Stages that did it, as their author stated them; for a transition, the stages that its
    /// barrier puts behind it.
    pub declared: Stages,
    /// The same, one bit for each stage.
    stages: Stages,
    /// Time at which it was done.
    pub since: usize,
    /// Done by a barrier (a layout transition, or a flush), so already ordered before `stages`.
    pub by_barrier: bool,
}

/// How far one stage's share of an event has been ordered.
struct Order {
    /// Stages whose later work is behind it.
    reached: Stages,
    /// Stages that a barrier's first scope must name one of, to be behind it.
    chain: Stages,
}

impl Event {
    fn new(declared: Stages, since: usize) -> Self {
        Self {
            declared,
            stages: expand_stages(declared),
            since,
            by_barrier: false,
        }
    }

    /// Something that a barrier of the batch before `since` did.
    pub fn by_barrier(declared: Stages, since: usize) -> Self {
        Self {
            by_barrier: true,
            ..Self::new(declared, since)
        }
    }

    fn orders(&self, log: &Log, mut visit: impl FnMut(Order) -> bool) -> bool {
        if self.by_barrier {
            let behind = with_later(self.stages);
            let reached = behind | log.reach(behind, self.since);
            return visit(Order {
                reached,
                chain: reached,
            });
        }
        stage_bits(self.stages).all(|bit| {
            let reached = log.reach(bit, self.since);
            visit(Order {
                reached,
                chain: bit | reached,
            })
        })
    }

    /// Whether work of every stage in `dst` behind `batch`, the next one, is behind this event.
    fn before(&self, log: &Log, batch: &[Barrier], dst: Stages) -> bool {
        self.orders(log, |order| {
            let chained = batch
                .iter()
                .filter(|barrier| order.chain.intersects(with_earlier(barrier.src_stages)))
                .fold(order.reached, |all, b| all | with_later(b.dst_stages));
            chained.contains(dst)
        })
    }

    /// Whether the first scope of a barrier with these source stages is behind this event.
    fn in_first_scope(&self, log: &Log, src: Stages) -> bool {
        let src = with_earlier(src);
        self.orders(log, |order| order.chain.intersects(src))
    }
}

/// The last write of a cell.
#[derive(Clone, Debug)]
struct Write {
    event: Event,
    /// Access types, as their author stated them.
    declared: Access,
    /// The same, one bit for each type.
    access: Access,
    /// The barriers that made it available. What builds on one must be ordered behind it.
    flushes: Vec<Event>,
    /// Stages and the accesses in them that the write is visible to.
    visible: Vec<(Stages, Access)>,
}

impl Write {
    fn is_flushed_by(&self, barrier: &Barrier) -> bool {
        expand_access(barrier.src_access).contains(self.access)
            && expand_stages(barrier.src_stages).contains(self.event.stages)
    }

    /// Whether the write is available to what a barrier with these source stages makes of it.
    fn is_available(&self, log: &Log, src: Stages) -> bool {
        // Barriers of one batch do not build on each other.
        let mut earlier = self.flushes.iter().filter(|f| f.since <= log.now());
        earlier.any(|flush| flush.in_first_scope(log, src))
    }

    fn apply(&mut self, log: &Log, barrier: &Barrier) {
        let flushed = self.is_flushed_by(barrier);
        if flushed || self.is_available(log, barrier.src_stages) {
            let dst = expand_stages(barrier.dst_stages);
            self.visible.push((dst, expand_access(barrier.dst_access)));
        }
        if flushed {
            let flush = Event::by_barrier(barrier.dst_stages, log.now() + 1);
            self.flushes.push(flush);
        }
    }

    fn is_visible(&self, scope: &Scope) -> bool {
        let wanted = expand_access(scope.access);
        stage_bits(expand_stages(scope.stages)).all(|bit| {
            let rows = self
                .visible
                .iter()
                .filter(|(stages, _)| stages.contains(bit));
            rows.fold(Access::empty(), |all, (_, access)| all | *access)
                .contains(wanted)
        })
    }
}

/// Stages, and what they do to memory, as their author stated them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scope {
    pub stages: Stages,
    pub access: Access,
}

/// What a step does to a cell, and what later steps will read of it in the same layout.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Need {
    /// Accesses of this step.
    pub now: Vec<Scope>,
    /// Reads of later steps before the next write or transition: one barrier serves them all.
    pub ahead: Vec<Scope>,
    /// Something is written.
    pub writes: bool,
    /// Earlier contents are read.
    pub reads: bool,
    /// Earlier contents stay where the step does not write.
    pub keeps: bool,
    /// Layout; `UNDEFINED` for buffers.
    pub layout: ImageLayout,
}

impl Need {
    fn stages(&self) -> Stages {
        self.now
            .iter()
            .fold(Stages::empty(), |all, s| all | s.stages)
    }

    fn scopes(&self) -> impl Iterator<Item = &Scope> {
        self.now.iter().chain(&self.ahead)
    }
}

/// Synchronization state of one cell.
#[derive(Clone, Debug)]
pub(crate) struct Cell {
    pub layout: ImageLayout,
    write: Option<Write>,
    /// Reads since the last write; for a transient that has not begun, what was done with its
    /// memory by those that had it before.
    reads: Vec<Event>,
}

impl Cell {
    /// A transient's cell before its first use, behind what `others` did with its memory.
    pub fn fresh(others: Vec<Event>) -> Self {
        Self {
            layout: ImageLayout::UNDEFINED,
            write: None,
            reads: others,
        }
    }

    /// A cell that enters the frame in a state that its owner stated.
    pub fn entering(state: ImageState) -> Self {
        let event = Event::new(state.stages, 0);
        let stages = event.stages;
        let access = expand_access(state.access);
        let written = access & WRITES;
        let used = !stages.is_empty();
        let reads = (used && written.is_empty()).then_some(event);
        Self {
            layout: state.layout,
            write: used.then(|| Write {
                event,
                declared: state.access & WRITES,
                access: written,
                // What the owner only read, the owner has made visible to those reads.
                flushes: if written.is_empty() {
                    vec![Event::by_barrier(state.stages, 0)]
                } else {
                    Vec::new()
                },
                visible: if written.is_empty() {
                    vec![(stages, access)]
                } else {
                    Vec::new()
                },
            }),
            reads: reads.into_iter().collect(),
        }
    }

    /// What others that take over this memory must be ordered behind.
    pub fn last_events(&self) -> impl Iterator<Item = Event> + '_ {
        // A read is behind the write, and behind what made the write visible to it.
        let write = self.write.iter().filter(|_| self.reads.is_empty());
        let write = write.flat_map(|w| w.flushes.first().into_iter().chain([&w.event]));
        write.chain(&self.reads).copied()
    }

    /// The last write, if it is not available yet.
    pub fn unflushed(&self) -> Option<Scope> {
        let write = self.write.as_ref().filter(|w| w.flushes.is_empty())?;
        Some(Scope {
            stages: write.event.declared,
            access: write.declared,
        })
    }

    /// The last write, if nobody read it and it is not visible to this access.
    pub fn hidden(&self, scope: &Scope) -> Option<Scope> {
        let write = self.write.as_ref().filter(|w| !w.declared.is_empty())?;
        let hidden = self.reads.is_empty() && !write.is_visible(scope);
        hidden.then_some(Scope {
            stages: write.event.declared,
            access: write.declared,
        })
    }

    /// Whether the last write is available to what a barrier makes of it.
    pub fn reaches(&self, log: &Log, barrier: &Barrier) -> bool {
        self.write.as_ref().is_none_or(|write| {
            write.is_flushed_by(barrier) || write.is_available(log, barrier.src_stages)
        })
    }

    /// Whether a step may do this behind `batch`, of which `own` covers this cell.
    pub fn allows(&self, need: &Need, log: &Log, batch: &[Barrier], own: Option<&Barrier>) -> bool {
        if self.layout != need.layout {
            return own.is_some_and(|own| self.allows_transition(need, log, own));
        }
        if let Some(write) = &self.write {
            let ordered = need.reads || (need.writes && self.reads.is_empty());
            if ordered && need.scopes().any(|scope| !write.is_visible(scope)) {
                let mut write = write.clone();
                if let Some(own) = own {
                    write.apply(log, own);
                }
                if need.scopes().any(|scope| !write.is_visible(scope)) {
                    return false;
                }
            }
        }
        let stages = expand_stages(need.stages());
        !need.writes
            || self
                .reads
                .iter()
                .all(|read| read.before(log, batch, stages))
    }

    fn allows_transition(&self, need: &Need, log: &Log, own: &Barrier) -> bool {
        let ordered = |event: Event| event.in_first_scope(log, own.src_stages);
        let available = self.write.as_ref().is_none_or(|write| {
            write.is_flushed_by(own) || write.is_available(log, own.src_stages)
        });
        let write = self.write.iter().map(|write| write.event);
        let write = write.filter(|_| self.reads.is_empty());
        own.transition.is_some_and(|t| t.new == need.layout)
            && available
            && write.chain(self.reads.iter().copied()).all(ordered)
            && need.scopes().all(|scope| {
                expand_stages(own.dst_stages).contains(expand_stages(scope.stages))
                    && expand_access(own.dst_access).contains(expand_access(scope.access))
            })
    }

    /// A barrier that lets a step do this, wide rather than minimal; `None` if none is needed.
    pub fn barrier(&self, need: &Need, log: &Log) -> Option<Barrier> {
        if self.allows(need, log, &[], None) {
            return None;
        }
        let mut barrier = Barrier {
            target: None,
            src_stages: Stages::empty(),
            src_access: Access::empty(),
            dst_stages: need.stages(),
            dst_access: Access::empty(),
            transition: None,
        };
        let transition = self.layout != need.layout;
        if transition {
            barrier.transition = Some(Transition {
                old: if need.keeps {
                    self.layout
                } else {
                    ImageLayout::UNDEFINED
                },
                new: need.layout,
            });
        }
        if need.writes || transition {
            for read in &self.reads {
                barrier.src_stages |= read.declared;
            }
        }
        let mut memory = transition;
        if let Some(write) = &self.write {
            let hidden = need.scopes().any(|scope| !write.is_visible(scope));
            memory |= hidden && (need.reads || self.reads.is_empty());
            if memory && (self.reads.is_empty() || !transition) {
                barrier.src_stages |= write.event.declared;
            }
            if memory && !write.is_available(log, barrier.src_stages) {
                barrier.src_stages |= write.event.declared;
                barrier.src_access = write.declared;
            }
        }
        if memory {
            for scope in need.scopes() {
                barrier.dst_stages |= scope.stages;
                barrier.dst_access |= scope.access;
            }
        }
        Some(barrier)
    }

    /// Notes that the final batch, of which `own` covers this cell, was issued. Call before
    /// [`Log::push`].
    pub fn cross(&mut self, log: &Log, own: &Barrier) {
        match own.transition {
            Some(transition) => {
                let event = Event::by_barrier(own.dst_stages, log.now() + 1);
                self.layout = transition.new;
                self.reads.clear();
                self.write = Some(Write {
                    event,
                    declared: Access::empty(),
                    access: Access::empty(),
                    flushes: vec![event],
                    visible: vec![(event.stages, expand_access(own.dst_access))],
                });
            }
            None => {
                if let Some(write) = &mut self.write {
                    write.apply(log, own);
                }
            }
        }
    }

    /// Notes what the step did. Call after [`Log::push`].
    pub fn access(&mut self, need: &Need, log: &Log) {
        let event = Event::new(need.stages(), log.now());
        if need.writes {
            let access = need
                .now
                .iter()
                .fold(Access::empty(), |all, s| all | s.access);
            self.reads.clear();
            self.write = Some(Write {
                event,
                declared: access & WRITES,
                access: expand_access(access) & WRITES,
                flushes: Vec::new(),
                visible: Vec::new(),
            });
            return;
        }
        // What is ordered behind this read is behind earlier reads of the same stages.
        for read in self.reads.iter_mut().filter(|read| !read.by_barrier) {
            read.stages &= !event.stages;
            read.declared = read.stages;
        }
        self.reads.retain(|read| !read.stages.is_empty());
        self.reads.push(event);
    }
}
