//! Each rule of planning in a named situation, without a device.

#[path = "graph_rules/barriers.rs"]
mod barriers;
#[path = "graph_rules/errors.rs"]
mod errors;
#[path = "graph_rules/lifetimes.rs"]
mod lifetimes;
#[path = "graph_rules/prints.rs"]
mod prints;
#[path = "support/shadow_frame.rs"]
mod shadow_frame;

use antumbra::ash::vk::{self, Handle};
use antumbra::graph::simulate::simulate;
use antumbra::graph::{
    Access, Barrier, BufferDesc, BufferState, FakeMemory, Graph, GraphError, HostBuffer, HostImage,
    ImageDesc, ImageId, ImageState, PassKind, Plan, Stage,
};

const SAMPLED: Access = Access::Sampled(Stage::Compute);
const READ: Access = Access::StorageRead(Stage::Compute);
const WRITE: Access = Access::StorageWrite(Stage::Compute);

/// A small float image.
fn desc() -> ImageDesc {
    ImageDesc::new(vk::Format::R32_SFLOAT, 16, 16)
}

/// Compiles what `build` declares.
fn try_plan(build: impl FnOnce(&mut Graph<'_>)) -> Result<Plan, GraphError> {
    let mut graph = Graph::new();
    build(&mut graph);
    Ok(graph.compile(&FakeMemory)?.plan().clone())
}

/// As [`try_plan`], of a graph without mistakes, and checks the plan.
#[track_caller]
fn plan(build: impl FnOnce(&mut Graph<'_>)) -> Plan {
    checked(try_plan(build).unwrap())
}

#[track_caller]
fn checked(plan: Plan) -> Plan {
    assert_eq!(simulate(&plan), [], "{plan}");
    plan
}

/// A compute pass that makes an image.
fn make(graph: &mut Graph<'_>, name: &'static str, id: ImageId) -> ImageId {
    let mut pass = graph.pass(name, PassKind::Compute);
    pass.overwrite(id, WRITE)
}

/// A compute pass that reads an image and makes a kept one from it.
fn consume(graph: &mut Graph<'_>, name: &'static str, id: ImageId) -> ImageId {
    let result = graph.create_image(name, desc());
    let mut pass = graph.pass(name, PassKind::Compute);
    pass.read(id, SAMPLED);
    let result = pass.overwrite(result, WRITE);
    graph.keep(result);
    result
}

/// The step in which a pass runs.
#[track_caller]
fn step_of(plan: &Plan, pass: &str) -> usize {
    let has = |step: &antumbra::graph::Step| {
        step.passes
            .iter()
            .any(|index| plan.passes[*index].name == pass)
    };
    let found = plan.steps.iter().position(has);
    found.unwrap_or_else(|| panic!("`{pass}` does not run\n{plan}"))
}

/// The barriers on a resource in front of a pass.
#[track_caller]
fn before(plan: &Plan, pass: &str, resource: &str) -> Vec<Barrier> {
    let barriers = &plan.steps[step_of(plan, pass)].barriers.barriers;
    on(plan, barriers, resource)
}

/// Those barriers of a batch that are on a resource.
#[track_caller]
fn on(plan: &Plan, barriers: &[Barrier], resource: &str) -> Vec<Barrier> {
    let index = plan.resources.iter().position(|r| r.name == resource);
    assert!(index.is_some(), "no `{resource}`");
    let mine = barriers
        .iter()
        .filter(|b| b.target.map(|(of, _)| of) == index);
    mine.copied().collect()
}

/// Names of the passes that run, in order.
fn running(plan: &Plan) -> Vec<String> {
    plan.passes
        .iter()
        .map(|pass| pass.name.to_string())
        .collect()
}

/// An image of the host's, of which every use is allowed.
fn host_image(enter: ImageState, leave: ImageState) -> HostImage {
    HostImage {
        image: vk::Image::from_raw(1),
        desc: desc(),
        usage: vk::ImageUsageFlags::from_raw(0xff),
        enter,
        leave,
    }
}

/// A buffer of the host's, of which every use is allowed.
fn host_buffer(enter: BufferState, leave: BufferState) -> HostBuffer {
    HostBuffer {
        buffer: vk::Buffer::from_raw(2),
        desc: BufferDesc { size: 1024 },
        usage: vk::BufferUsageFlags::from_raw(0x1ff),
        enter,
        leave,
    }
}
