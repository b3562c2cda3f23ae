//! Which passes run, and in which order.

use super::cells::CellMap;
use super::error::GraphError;
use super::pass::Mode;
use super::{Declarations, Origin};
use ash::vk::ImageLayout;

/// Refuses reads of what nobody wrote: such a pass would show whatever memory held.
pub(crate) fn check_initialised(decl: &Declarations, maps: &[CellMap]) -> Result<(), GraphError> {
    let mut written: Vec<Vec<bool>> = decl
        .resources
        .iter()
        .zip(maps)
        .map(|(resource, map)| {
            let defined = match &resource.origin {
                Origin::Transient | Origin::HistoryCurrent { .. } => false,
                Origin::Image(host) => host.enter.layout != ImageLayout::UNDEFINED,
                Origin::Buffer(_) | Origin::HistoryPrevious { .. } => true,
            };
            vec![defined; map.len()]
        })
        .collect();
    for pass in &decl.passes {
        for used in &pass.uses {
            if !used.access.reads() {
                continue;
            }
            let map = &maps[used.resource];
            if let Some(cell) = map.cells(used.part).find(|c| !written[used.resource][*c]) {
                return Err(GraphError::ReadBeforeWrite {
                    pass: pass.name.to_string(),
                    resource: decl.resources[used.resource].name.to_string(),
                    part: map.part(cell).to_string(),
                });
            }
        }
        for used in pass.uses.iter().filter(|used| used.mode != Mode::Read) {
            for cell in maps[used.resource].cells(used.part) {
                written[used.resource][cell] = true;
            }
        }
    }
    Ok(())
}

/// Which passes have a result that somebody needs: dead-code elimination over cells, backwards.
pub(crate) fn live_passes(decl: &Declarations, maps: &[CellMap]) -> Vec<bool> {
    let mut needed: Vec<Vec<bool>> = decl
        .resources
        .iter()
        .zip(maps)
        .map(|(resource, map)| {
            let root = !matches!(resource.origin, Origin::Transient);
            vec![root; map.len()]
        })
        .collect();
    for kept in &decl.kept {
        needed[*kept].fill(true);
    }
    let mut live = vec![false; decl.passes.len()];
    for (index, pass) in decl.passes.iter().enumerate().rev() {
        live[index] = pass.uses.iter().any(|used| {
            used.mode != Mode::Read
                && maps[used.resource]
                    .cells(used.part)
                    .any(|cell| needed[used.resource][cell])
        });
        if !live[index] {
            continue;
        }
        for used in pass.uses.iter().filter(|u| u.mode == Mode::Overwrite) {
            for cell in maps[used.resource].cells(used.part) {
                needed[used.resource][cell] = false;
            }
        }
        for used in pass.uses.iter().filter(|u| u.access.reads()) {
            for cell in maps[used.resource].cells(used.part) {
                needed[used.resource][cell] = true;
            }
        }
    }
    live
}

/// The live passes in levels: a pass stands one level after the last pass that it depends on.
///
/// Passes of one level touch nothing in common that one of them writes, nor one image in two
/// layouts, so that all barriers of a level can be issued at once, in front of it. The number of
/// barrier batches is then the length of the longest chain of dependent passes, the least there
/// can be. Within a level the order of declaration stays. Passes of a part
/// ([`Graph::begin_part`](super::Graph::begin_part)) stand behind all of the part before.
pub(crate) fn levels(decl: &Declarations, maps: &[CellMap], live: &[bool]) -> Vec<Vec<usize>> {
    #[derive(Clone)]
    struct Cell {
        /// Level at and below which writers stand; 0 stands for none.
        after_write: u32,
        /// One more than the highest level of a reader since.
        after_reads: u32,
        layout: Option<ImageLayout>,
    }
    let start = Cell {
        after_write: 0,
        after_reads: 0,
        layout: None,
    };
    let mut cells: Vec<Vec<Cell>> = maps.iter().map(|m| vec![start.clone(); m.len()]).collect();
    let mut levels: Vec<Vec<usize>> = Vec::new();
    let mut parts = decl.parts.iter().peekable();
    let mut first = 0;
    for (index, pass) in decl.passes.iter().enumerate().filter(|(i, _)| live[*i]) {
        while parts.next_if(|part| **part <= index).is_some() {
            first = levels.len() as u32;
        }
        let mut level = first;
        for used in &pass.uses {
            let layout = used.access.info().layout;
            for cell in maps[used.resource].cells(used.part) {
                let cell = &cells[used.resource][cell];
                level = level.max(cell.after_write);
                let relayout = cell.after_reads > 0 && cell.layout != layout;
                if used.mode != Mode::Read || relayout {
                    level = level.max(cell.after_reads);
                }
            }
        }
        for used in &pass.uses {
            let layout = used.access.info().layout;
            for cell in maps[used.resource].cells(used.part) {
                let cell = &mut cells[used.resource][cell];
                if used.mode == Mode::Read {
                    // A reader in another layout must stay behind all readers before it.
                    if cell.layout != layout {
                        cell.after_write = cell.after_write.max(level);
                    }
                    cell.after_reads = cell.after_reads.max(level + 1);
                } else {
                    cell.after_write = level + 1;
                    cell.after_reads = 0;
                }
                cell.layout = layout;
            }
        }
        let level = level as usize;
        levels.resize_with(levels.len().max(level + 1), Vec::new);
        levels[level].push(index);
    }
    levels
}
