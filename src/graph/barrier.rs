//! The walk over the steps that gives each its barriers.
//!
//! A barrier is there if the layout changes, a write is not yet available, or an access is not yet
//! visible to, or ordered before, what the step does; [`super::sync`] holds the rules. One barrier
//! serves all reads up to the next write. Barriers of a step form one batch; stage bits and whole
//! barriers that the rest of the batch makes redundant are taken out.

use super::alias::Tenant;
use super::cells::{CellMap, join};
use super::pass::Mode;
use super::plan::{Barrier, Batch, Placement};
use super::resource::{ImageState, Part};
use super::sync::{Cell, Event, Log, Need, Scope};
use super::{Declarations, Kind, Origin};
use ash::vk::{self, ImageLayout};

/// Barriers of one step, as in [`super::Step`].
#[derive(Default)]
pub(crate) struct StepBarriers {
    pub hand_over: Batch,
    pub barriers: Batch,
}

/// All barriers of a frame.
pub(crate) struct Barriers {
    pub steps: Vec<StepBarriers>,
    pub leave: Batch,
    /// States that resources which outlive the frame are left in, by resource.
    pub left: Vec<Option<ImageState>>,
}

/// What the walk needs to know beside the declarations.
pub(crate) struct Schedule<'a> {
    pub decl: &'a Declarations,
    pub maps: &'a [CellMap],
    pub levels: &'a [Vec<usize>],
    /// For every placed transient: resource, tenant, placement.
    pub placed: &'a [(usize, Tenant, Placement)],
}

/// What one step does to one cell.
struct Visit {
    step: usize,
    need: Need,
}

/// A cell that a step touches, and the barrier of the batch that covers it.
struct Touch {
    resource: usize,
    cell: usize,
    need: Need,
    own: Option<usize>,
}

pub(crate) fn barriers(schedule: &Schedule<'_>) -> Barriers {
    let Schedule {
        decl, maps, levels, ..
    } = schedule;
    let mut visits = visits(schedule);
    let mut log = Log::default();
    let mut cells: Vec<Vec<Cell>> = decl
        .resources
        .iter()
        .zip(*maps)
        .map(|(resource, map)| vec![initial(&resource.origin); map.len()])
        .collect();

    let mut steps = Vec::new();
    for step in 0..levels.len() {
        let hand_over = hand_over(schedule, step, &visits, &mut cells, &mut log);
        let touches = touches(step, &mut visits);
        let barriers = cross(touches, maps, &mut cells, &mut log);
        steps.push(StepBarriers {
            hand_over,
            barriers,
        });
    }

    let left: Vec<Option<ImageState>> = decl
        .resources
        .iter()
        .zip(&cells)
        .map(|(resource, cells)| leaving(&resource.origin, cells))
        .collect();
    let touches = left
        .iter()
        .enumerate()
        .filter_map(|(resource, state)| state.map(|state| (resource, state)))
        .flat_map(|(resource, state)| {
            (0..maps[resource].len()).map(move |cell| Touch {
                resource,
                cell,
                need: leave_need(state),
                own: None,
            })
        })
        .collect();
    let leave = cross(touches, maps, &mut cells, &mut log);
    Barriers { steps, leave, left }
}

fn initial(origin: &Origin) -> Cell {
    match origin {
        Origin::Transient => Cell::fresh(Vec::new()),
        Origin::Image(host) => Cell::entering(host.enter),
        Origin::Buffer(host) => Cell::entering(buffer_state(host.enter)),
        Origin::HistoryPrevious { state, .. } | Origin::HistoryCurrent { state, .. } => {
            Cell::entering(*state)
        }
    }
}

/// A buffer's state in the form that images have.
pub(crate) fn buffer_state(state: super::resource::BufferState) -> ImageState {
    ImageState {
        layout: ImageLayout::UNDEFINED,
        stages: state.stages,
        access: state.access,
    }
}

/// The state that a resource which outlives the frame is left in.
fn leaving(origin: &Origin, cells: &[Cell]) -> Option<ImageState> {
    match origin {
        Origin::Transient => None,
        Origin::Image(host) => Some(host.leave),
        Origin::Buffer(host) => Some(buffer_state(host.leave)),
        Origin::HistoryPrevious { .. } | Origin::HistoryCurrent { .. } => {
            // The next frame's graph is not known yet, so the image stays as its last use had it
            // and the next frame waits for exactly that.
            let layout = cells[0].layout;
            let mut state = ImageState {
                layout,
                ..ImageState::UNDEFINED
            };
            for cell in cells {
                for event in cell.last_events() {
                    state.stages |= event.declared;
                }
                if let Some(write) = cell.unflushed() {
                    state.stages |= write.stages;
                    state.access |= write.access;
                }
            }
            Some(state)
        }
    }
}

fn leave_need(state: ImageState) -> Need {
    Need {
        now: vec![Scope {
            stages: state.stages,
            access: state.access,
        }],
        ahead: Vec::new(),
        writes: state.access.intersects(super::access::WRITES),
        reads: true,
        keeps: true,
        layout: state.layout,
    }
}

/// Every cell's needs in step order, with reads of the same contents looked ahead for.
fn visits(schedule: &Schedule<'_>) -> Vec<Vec<Vec<Visit>>> {
    let mut visits: Vec<Vec<Vec<Visit>>> = schedule
        .maps
        .iter()
        .map(|map| (0..map.len()).map(|_| Vec::new()).collect())
        .collect();
    for (step, level) in schedule.levels.iter().enumerate() {
        for used in level.iter().flat_map(|p| &schedule.decl.passes[*p].uses) {
            let info = used.access.info();
            let image = matches!(schedule.decl.resources[used.resource].kind, Kind::Image(_));
            let layout = info.layout.filter(|_| image);
            let scope = Scope {
                stages: info.stages,
                access: info.access,
            };
            for cell in schedule.maps[used.resource].cells(used.part) {
                let visits = &mut visits[used.resource][cell];
                match visits.last_mut() {
                    Some(last) if last.step == step => {
                        if !last.need.now.contains(&scope) {
                            last.need.now.push(scope);
                        }
                    }
                    _ => visits.push(Visit {
                        step,
                        need: Need {
                            now: vec![scope],
                            ahead: Vec::new(),
                            writes: used.mode != Mode::Read,
                            reads: used.access.reads(),
                            keeps: used.mode != Mode::Overwrite,
                            layout: layout.unwrap_or(ImageLayout::UNDEFINED),
                        },
                    }),
                }
            }
        }
    }
    for visits in visits.iter_mut().flatten() {
        for i in (1..visits.len()).rev() {
            let (before, after) = visits.split_at_mut(i);
            let (Some(before), after) = (before.last_mut(), &after[0].need) else {
                continue;
            };
            let continues = !after.writes && after.layout == before.need.layout;
            if continues && !before.need.writes {
                let ahead = after.now.iter().chain(&after.ahead);
                before.need.ahead = ahead.copied().collect();
            }
        }
    }
    visits
}

fn touches(step: usize, visits: &mut [Vec<Vec<Visit>>]) -> Vec<Touch> {
    let mut touches = Vec::new();
    for (resource, cells) in visits.iter_mut().enumerate() {
        for (cell, visits) in cells.iter_mut().enumerate() {
            let Ok(found) = visits.binary_search_by_key(&step, |visit| visit.step) else {
                continue;
            };
            touches.push(Touch {
                resource,
                cell,
                need: visits[found].need.clone(),
                own: None,
            });
        }
    }
    touches
}

/// Puts transients that begin in this step behind those that had their memory before.
///
/// What those wrote and nobody read must not reach memory late. An image begins with a transition,
/// to which all that is available is visible, so such writes are made available. A buffer begins
/// with a write, so they are also made visible to the first accesses of all its cells. One barrier
/// does it for all that begin.
fn hand_over(
    schedule: &Schedule<'_>,
    step: usize,
    visits: &[Vec<Vec<Visit>>],
    cells: &mut [Vec<Cell>],
    log: &mut Log,
) -> Batch {
    let mut flush = Barrier {
        target: None,
        src_stages: vk::PipelineStageFlags2::NONE,
        src_access: vk::AccessFlags2::NONE,
        dst_stages: vk::PipelineStageFlags2::NONE,
        dst_access: vk::AccessFlags2::NONE,
        transition: None,
    };
    let mut image_stage = None;
    let mut writers: Vec<&Cell> = Vec::new();
    let mut begins = Vec::new();
    for (resource, tenant, place) in schedule.placed {
        if tenant.steps.0 != step {
            continue;
        }
        let firsts = first_scopes(&visits[*resource], step, tenant.image);
        let mut events = Vec::new();
        let mut behind_flush = false;
        for (other, owner, other_place) in schedule.placed {
            if owner.steps.1 >= step || !share_memory(place, other_place) {
                continue;
            }
            for cell in &cells[*other] {
                let write = if tenant.image {
                    cell.unflushed()
                } else {
                    firsts.iter().find_map(|first| cell.hidden(first))
                };
                let Some(write) = write else {
                    events.extend(cell.last_events());
                    continue;
                };
                behind_flush = true;
                writers.push(cell);
                flush.src_stages |= write.stages;
                flush.src_access |= write.access;
                if tenant.image {
                    image_stage = image_stage.or(firsts.first().map(|first| first.stages));
                } else {
                    for first in firsts.iter().filter(|f| cell.hidden(f).is_some()) {
                        flush.dst_stages |= first.stages;
                        flush.dst_access |= first.access;
                    }
                }
            }
        }
        begins.push((*resource, events, behind_flush));
    }
    let mut batch = Batch::default();
    if !writers.is_empty() {
        if flush.dst_stages.is_empty() {
            flush.dst_stages = image_stage.unwrap_or_default();
        }
        flush = with_least_source(flush, &writers, log);
        for (_, events, behind_flush) in &mut begins {
            if *behind_flush {
                events.push(Event::by_barrier(flush.dst_stages, log.now() + 1));
            }
        }
        let all = cells.iter_mut().flatten();
        all.for_each(|cell| cell.cross(log, &flush));
        batch.barriers.push(flush);
        log.push(&batch.barriers);
    }
    for (resource, events, _) in begins {
        cells[resource].fill(Cell::fresh(events));
    }
    batch
}

/// Drops source stages and accesses that the barrier does without, thanks to others before it.
fn with_least_source(mut barrier: Barrier, writers: &[&Cell], log: &Log) -> Barrier {
    let reaches = |barrier: &Barrier| writers.iter().all(|cell| cell.reaches(log, barrier));
    for bit in super::access::stage_bits(barrier.src_stages) {
        let fewer = Barrier {
            src_stages: barrier.src_stages & !bit,
            ..barrier
        };
        if reaches(&fewer) {
            barrier = fewer;
        }
    }
    let mut accesses = barrier.src_access.as_raw();
    while accesses != 0 {
        let bit = accesses & accesses.wrapping_neg();
        accesses ^= bit;
        let fewer = Barrier {
            src_access: barrier.src_access & !vk::AccessFlags2::from_raw(bit),
            ..barrier
        };
        if reaches(&fewer) {
            barrier = fewer;
        }
    }
    barrier
}

/// What the writes of former owners of its memory must be visible to when a transient begins.
fn first_scopes(visits: &[Vec<Visit>], step: usize, image: bool) -> Vec<Scope> {
    if image {
        // One stage suffices: what else the step does chains behind it, and the transition makes
        // visible by itself.
        let first = visits.iter().flatten().find(|visit| visit.step == step);
        let first = first.and_then(|visit| visit.need.now.first());
        let stage = first.and_then(|first| super::access::stage_bits(first.stages).next());
        let scope = stage.map(|stages| Scope {
            stages,
            access: vk::AccessFlags2::NONE,
        });
        return scope.into_iter().collect();
    }
    let mut scopes: Vec<Scope> = Vec::new();
    for first in visits.iter().filter_map(|cell| cell.first()) {
        for scope in &first.need.now {
            if !scopes.contains(scope) {
                scopes.push(*scope);
            }
        }
    }
    scopes
}

/// Whether two placements share a byte.
pub(crate) fn share_memory(a: &Placement, b: &Placement) -> bool {
    a.arena == b.arena && a.offset < b.offset + b.size && b.offset < a.offset + a.size
}

/// Finds the barriers in front of what `touches` says, and moves all cells past them.
fn cross(
    mut touches: Vec<Touch>,
    maps: &[CellMap],
    cells: &mut [Vec<Cell>],
    log: &mut Log,
) -> Batch {
    let mut batch = Batch::default();
    propose(&mut touches, maps, cells, log, &mut batch.barriers);
    minimise(&mut touches, cells, log, &mut batch.barriers);
    for touch in &touches {
        if let Some(own) = touch.own {
            cells[touch.resource][touch.cell].cross(log, &batch.barriers[own]);
        }
    }
    log.push(&batch.barriers);
    for touch in &touches {
        cells[touch.resource][touch.cell].access(&touch.need, log);
    }
    batch
}

/// One barrier for every run of cells that need the same.
fn propose(
    touches: &mut [Touch],
    maps: &[CellMap],
    cells: &[Vec<Cell>],
    log: &Log,
    barriers: &mut Vec<Barrier>,
) {
    let part_of = |touch: &Touch| maps[touch.resource].part(touch.cell);
    // Runs of cells within a mip level first, then levels with equal runs: both merge in cell
    // order, so a second pass over the finished runs joins the rows.
    let mut runs: Vec<(Barrier, usize, Part, Vec<usize>)> = Vec::new();
    for (index, touch) in touches.iter().enumerate() {
        let cell = &cells[touch.resource][touch.cell];
        let Some(barrier) = cell.barrier(&touch.need, log) else {
            continue;
        };
        let part = part_of(touch);
        let joined = runs
            .last_mut()
            .and_then(|(last, resource, so_far, members)| {
                let same = *last == barrier && *resource == touch.resource;
                let whole = same.then(|| join(*so_far, part)).flatten()?;
                *so_far = whole;
                members.push(index);
                Some(())
            });
        if joined.is_none() {
            runs.push((barrier, touch.resource, part, vec![index]));
        }
    }
    let mut rows: Vec<(Barrier, usize, Part, Vec<usize>)> = Vec::new();
    for (barrier, resource, part, members) in runs {
        let joined = rows.iter_mut().rev().find_map(|(other, of, so_far, into)| {
            let same = *other == barrier && *of == resource;
            let whole = same.then(|| join(*so_far, part)).flatten()?;
            *so_far = whole;
            into.extend(&members);
            Some(())
        });
        if joined.is_none() {
            rows.push((barrier, resource, part, members));
        }
    }
    for (barrier, resource, part, members) in rows {
        for member in members {
            touches[member].own = Some(barriers.len());
        }
        barriers.push(Barrier {
            target: Some((resource, part)),
            ..barrier
        });
    }
}

/// Takes out stage bits, then whole barriers, that the rest of the batch makes redundant.
fn minimise(touches: &mut [Touch], cells: &[Vec<Cell>], log: &Log, barriers: &mut Vec<Barrier>) {
    let wanting: Vec<usize> = (0..touches.len())
        .filter(|t| touches[*t].own.is_some())
        .collect();
    let allowed = |touches: &[Touch], barriers: &[Barrier], gone: Option<usize>| {
        wanting.iter().all(|touch| {
            let touch = &touches[*touch];
            let own = touch.own.filter(|own| Some(*own) != gone);
            let own = own.map(|own| &barriers[own]);
            cells[touch.resource][touch.cell].allows(&touch.need, log, barriers, own)
        })
    };
    for index in 0..barriers.len() {
        let single = |stages: vk::PipelineStageFlags2| stages.as_raw().count_ones() <= 1;
        for source in [true, false] {
            let stages = if source {
                barriers[index].src_stages
            } else {
                barriers[index].dst_stages
            };
            if single(stages) {
                continue;
            }
            for bit in super::access::stage_bits(stages) {
                let before = barriers[index];
                let side = if source {
                    &mut barriers[index].src_stages
                } else {
                    &mut barriers[index].dst_stages
                };
                if *side == bit {
                    break;
                }
                *side &= !bit;
                if !allowed(touches, barriers, None) {
                    barriers[index] = before;
                }
            }
        }
    }
    let mut index = 0;
    while index < barriers.len() {
        let barrier = barriers[index];
        let execution_only = barrier.transition.is_none()
            && barrier.src_access.is_empty()
            && barrier.dst_access.is_empty();
        if execution_only && barriers.len() > 1 {
            let mut without = barriers.clone();
            // Kept in place with empty scopes while it is tried, so that indices stay valid.
            without[index].src_stages = vk::PipelineStageFlags2::NONE;
            without[index].dst_stages = vk::PipelineStageFlags2::NONE;
            if allowed(touches, &without, Some(index)) {
                barriers.remove(index);
                for touch in touches.iter_mut() {
                    touch.own = match touch.own {
                        Some(own) if own == index => None,
                        Some(own) if own > index => Some(own - 1),
                        own => own,
                    };
                }
                continue;
            }
        }
        index += 1;
    }
}
