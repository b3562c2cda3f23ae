//! Plans as JSON.

use super::pass::Load;
use super::plan::{Barrier, Batch, Placement, Plan, PlanResource, ResourceOrigin, ResourceShape};
use super::resource::{ImageState, Part};
use serde_json::{Value, json};

impl Plan {
    /// The whole plan as JSON. Flags, layouts and formats are named as in Vulkan.
    pub fn to_json(&self) -> Value {
        let passes = self.passes.iter().map(|pass| {
            let uses = pass.uses.iter().map(|used| {
                json!({
                    "resource": self.resources[used.resource].name,
                    "part": part(used.part),
                    "access": format!("{:?}", used.access),
                    "mode": format!("{:?}", used.mode).to_lowercase(),
                })
            });
            let attachments = pass.attachments.iter().map(|attachment| {
                json!({
                    "resource": self.resources[attachment.resource].name,
                    "part": part(Part::Image(attachment.part)),
                    "depth": attachment.depth,
                    "writes": attachment.writes,
                    "load": match attachment.load {
                        Load::Keep => json!("keep"),
                        Load::Discard => json!("discard"),
                        Load::Clear(value) => json!({ "clear": value }),
                    },
                })
            });
            json!({
                "name": pass.name,
                "kind": pass.kind.name(),
                "uses": uses.collect::<Vec<_>>(),
                "attachments": attachments.collect::<Vec<_>>(),
            })
        });
        let steps = self.steps.iter().map(|step| {
            let passes = step.passes.iter().map(|pass| &self.passes[*pass].name);
            json!({
                "hand_over": self.batch(&step.hand_over),
                "barriers": self.batch(&step.barriers),
                "passes": passes.collect::<Vec<_>>(),
            })
        });
        let arenas = self.arenas.iter().map(|arena| {
            json!({
                "bytes": arena.size,
                "alignment": arena.alignment,
                "memory_types": arena.memory_types,
                "holds": if arena.images { "images" } else { "buffers" },
            })
        });
        let culled = self
            .culled
            .iter()
            .map(|pass| json!({ "name": pass.name, "reason": pass.reason }));
        json!({
            "schema": 1,
            "resources": self.resources.iter().map(resource).collect::<Vec<_>>(),
            "passes": passes.collect::<Vec<_>>(),
            "steps": steps.collect::<Vec<_>>(),
            "leave": self.batch(&self.leave),
            "culled": culled.collect::<Vec<_>>(),
            "arenas": arenas.collect::<Vec<_>>(),
            "transient_bytes": self.peak_bytes(),
            "unaliased_bytes": self.unaliased_bytes(),
        })
    }

    fn batch(&self, batch: &Batch) -> Vec<Value> {
        let barriers = batch.barriers.iter();
        barriers.map(|barrier| self.barrier(barrier)).collect()
    }

    fn barrier(&self, barrier: &Barrier) -> Value {
        json!({
            "resource": barrier.target.map(|(resource, _)| &self.resources[resource].name),
            "part": barrier.target.map(|(_, of)| part(of)),
            "src_stages": format!("{:?}", barrier.src_stages),
            "src_access": format!("{:?}", barrier.src_access),
            "dst_stages": format!("{:?}", barrier.dst_stages),
            "dst_access": format!("{:?}", barrier.dst_access),
            "old_layout": barrier.transition.map(|t| format!("{:?}", t.old)),
            "new_layout": barrier.transition.map(|t| format!("{:?}", t.new)),
        })
    }
}

fn part(part: Part) -> Value {
    match part {
        Part::Image(p) => json!({
            "base_mip": p.base_mip, "mips": p.mips, "base_layer": p.base_layer, "layers": p.layers,
        }),
        Part::Buffer(p) => json!({ "offset": p.offset, "bytes": p.size }),
    }
}

fn resource(resource: &PlanResource) -> Value {
    let shape = match resource.shape {
        ResourceShape::Image { desc, usage } => json!({
            "kind": "image",
            "format": format!("{:?}", desc.format),
            "width": desc.width,
            "height": desc.height,
            "layers": desc.layers,
            "mips": desc.mips,
            "usage": format!("{usage:?}"),
        }),
        ResourceShape::Buffer { desc, usage } => json!({
            "kind": "buffer",
            "bytes": desc.size,
            "usage": format!("{usage:?}"),
        }),
    };
    let origin = match resource.origin {
        ResourceOrigin::Transient(_) => "transient",
        ResourceOrigin::Imported { .. } => "imported",
        ResourceOrigin::HistoryPrevious { .. } => "history-previous",
        ResourceOrigin::HistoryCurrent { .. } => "history-current",
    };
    let placement = match resource.origin {
        ResourceOrigin::Transient(place) => place.map(placement),
        _ => None,
    };
    json!({
        "name": resource.name,
        "shape": shape,
        "origin": origin,
        "placement": placement,
        "enter": resource.states().map(|(enter, _)| state(enter)),
        "leave": resource.states().map(|(_, leave)| state(leave)),
        "steps": resource.steps.map(|(first, last)| [first, last]),
    })
}

fn placement(place: Placement) -> Value {
    json!({
        "arena": place.arena,
        "offset": place.offset,
        "bytes": place.size,
        "alignment": place.alignment,
    })
}

fn state(state: ImageState) -> Value {
    json!({
        "layout": format!("{:?}", state.layout),
        "stages": format!("{:?}", state.stages),
        "access": format!("{:?}", state.access),
    })
}
