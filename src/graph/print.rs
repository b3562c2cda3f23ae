//! Plans as text for people and as DOT for Graphviz.

use super::pass::{Load, Mode};
use super::plan::{Barrier, Batch, Plan, PlanResource, ResourceOrigin, ResourceShape};
use ash::vk;
use std::fmt::{self, Write as _};

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} passes in {} steps, {} culled, {} barriers, {} transient bytes ({} unaliased)",
            self.passes.len(),
            self.steps.len(),
            self.culled.len(),
            self.barrier_count(),
            self.peak_bytes(),
            self.unaliased_bytes()
        )?;
        writeln!(f, "\nresources")?;
        for resource in &self.resources {
            writeln!(f, "  {resource}")?;
        }
        for (index, step) in self.steps.iter().enumerate() {
            writeln!(f, "\nstep {index}")?;
            self.write_batch(f, "flush", &step.hand_over)?;
            self.write_batch(f, "barrier", &step.barriers)?;
            for pass in &step.passes {
                self.write_pass(f, *pass)?;
            }
        }
        if !self.leave.barriers.is_empty() {
            writeln!(f, "\nleave")?;
            self.write_batch(f, "barrier", &self.leave)?;
        }
        if !self.culled.is_empty() {
            writeln!(f, "\nculled")?;
            for pass in &self.culled {
                writeln!(f, "  {}: {}", pass.name, pass.reason)?;
            }
        }
        Ok(())
    }
}

impl Plan {
    fn write_batch(&self, f: &mut fmt::Formatter<'_>, word: &str, batch: &Batch) -> fmt::Result {
        for barrier in &batch.barriers {
            writeln!(f, "  {word} {}", self.barrier_text(barrier))?;
        }
        Ok(())
    }

    fn write_pass(&self, f: &mut fmt::Formatter<'_>, index: usize) -> fmt::Result {
        let pass = &self.passes[index];
        writeln!(f, "  {} pass {}", pass.kind.name(), pass.name)?;
        for used in &pass.uses {
            let verb = match used.mode {
                Mode::Read => "reads",
                Mode::Write => "writes",
                Mode::Overwrite => "overwrites",
            };
            let name = &self.resources[used.resource].name;
            let (part, access) = (used.part, used.access);
            let load = pass
                .attachments
                .iter()
                .find(|a| a.resource == used.resource && super::Part::Image(a.part) == part);
            let load = match load.map(|a| a.load) {
                Some(Load::Clear(value)) if value[1..].iter().all(|v| *v == value[0]) => {
                    format!(", cleared to {}", value[0])
                }
                Some(Load::Clear(value)) => format!(", cleared to {value:?}"),
                Some(Load::Keep) => ", loaded".to_string(),
                _ => String::new(),
            };
            writeln!(f, "    {verb} {name} ({part}) as {access:?}{load}")?;
        }
        Ok(())
    }

    fn barrier_text(&self, barrier: &Barrier) -> String {
        let mut text = match barrier.target {
            Some((resource, part)) => format!("{} ({part})", self.resources[resource].name),
            None => "all memory".to_string(),
        };
        if let Some(transition) = barrier.transition {
            let _ = write!(text, " {:?} -> {:?}", transition.old, transition.new);
        }
        let side = |stages: vk::PipelineStageFlags2, access: vk::AccessFlags2| match (
            stages.is_empty(),
            access.is_empty(),
        ) {
            (true, _) => "nothing".to_string(),
            (false, true) => format!("{stages:?}"),
            (false, false) => format!("{stages:?} {access:?}"),
        };
        let _ = write!(
            text,
            ", {} -> {}",
            side(barrier.src_stages, barrier.src_access),
            side(barrier.dst_stages, barrier.dst_access)
        );
        text
    }

    /// The plan as a Graphviz digraph: passes are boxes, resources ellipses, culled passes dashed.
    pub fn to_dot(&self) -> String {
        let mut dot = String::from("digraph frame {\n  rankdir=LR;\n  node [fontsize=10];\n");
        for (index, resource) in self.resources.iter().enumerate() {
            if resource.steps.is_some() {
                let label = quote(&resource.to_string().replacen(", ", "\n", 1));
                let _ = writeln!(dot, "  r{index} [shape=ellipse, label={label}];");
            }
        }
        for (number, step) in self.steps.iter().enumerate() {
            let count = step.barriers.barriers.len() + step.hand_over.barriers.len();
            let _ = writeln!(dot, "  subgraph cluster_{number} {{");
            let label = quote(&format!("step {number}: {count} barriers"));
            let _ = writeln!(dot, "    label={label};");
            for pass in &step.passes {
                let label = quote(&self.passes[*pass].name);
                let _ = writeln!(dot, "    p{pass} [shape=box, label={label}];");
            }
            let _ = writeln!(dot, "  }}");
        }
        for (index, pass) in self.passes.iter().enumerate() {
            for used in &pass.uses {
                let label = quote(&format!("{:?}", used.access));
                let resource = used.resource;
                let edge = match used.mode {
                    Mode::Read => format!("r{resource} -> p{index}"),
                    Mode::Write | Mode::Overwrite => format!("p{index} -> r{resource}"),
                };
                let _ = writeln!(dot, "  {edge} [label={label}, fontsize=8];");
            }
        }
        for pass in &self.culled {
            let label = quote(&format!("{}\n{}", pass.name, pass.reason));
            let id = pass.declared;
            let _ = writeln!(dot, "  c{id} [shape=box, style=dashed, label={label}];");
        }
        dot.push_str("}\n");
        dot
    }
}

fn quote(text: &str) -> String {
    let text = text.replace('\\', "\\\\").replace('"', "\\\"");
    format!("\"{}\"", text.replace('\n', "\\n"))
}

impl fmt::Display for PlanResource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.name)?;
        match &self.shape {
            ResourceShape::Image { desc, .. } => {
                write!(f, ", {:?} {}x{}", desc.format, desc.width, desc.height)?;
                if desc.layers > 1 {
                    write!(f, " x {} layers", desc.layers)?;
                }
                if desc.mips > 1 {
                    write!(f, " x {} mips", desc.mips)?;
                }
            }
            ResourceShape::Buffer { desc, .. } => write!(f, ", {} bytes", desc.size)?,
        }
        match self.origin {
            ResourceOrigin::Transient(None) => write!(f, ", unused"),
            ResourceOrigin::Transient(Some(place)) => {
                let end = place.offset + place.size;
                write!(f, ", arena {} {}..{end}", place.arena, place.offset)?;
                match self.steps {
                    Some((first, last)) => write!(f, ", steps {first}..={last}"),
                    None => Ok(()),
                }
            }
            ResourceOrigin::Imported { .. } => write!(f, ", imported"),
            ResourceOrigin::HistoryPrevious { key, .. } => write!(f, ", last frame's {key}"),
            ResourceOrigin::HistoryCurrent { key, .. } => write!(f, ", kept as {key}"),
        }
    }
}
