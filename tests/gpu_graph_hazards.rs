//! Controls for the validation layer: plans with one mistake each, which the layer and the
//! simulator must both report. Without these, a run without messages would prove nothing.

mod support;

#[path = "gpu_graph/layer.rs"]
mod layer;
#[path = "support/random_graph.rs"]
mod random_graph;
#[path = "gpu_graph/scene.rs"]
mod scene;
#[path = "gpu_graph/shaders.rs"]
mod shaders;
#[path = "gpu_graph/work.rs"]
mod work;

use antumbra::ash::vk;
use antumbra::graph::simulate::Problem;
use antumbra::graph::{Access, PassKind, Plan, ResourceOrigin, Stage, Transition};
use scene::{Scene, barrier, drop_barrier, plant};
use vk::{AccessFlags2 as A, ImageLayout as L, PipelineStageFlags2 as S};

const COMPUTE_WRITE: Access = Access::StorageWrite(Stage::Compute);
const COMPUTE_READ: Access = Access::StorageRead(Stage::Compute);
const COMPUTE_SAMPLED: Access = Access::Sampled(Stage::Compute);

const RAW: &str = "SYNC-HAZARD-READ-AFTER-WRITE";
const WAW: &str = "SYNC-HAZARD-WRITE-AFTER-WRITE";
const WAR: &str = "SYNC-HAZARD-WRITE-AFTER-READ";

fn read_after_write(problem: &Problem) -> bool {
    *problem == Problem::ReadAfterWrite
}

fn write_after_write(problem: &Problem) -> bool {
    *problem == Problem::WriteAfterWrite
}

fn wrong_layout(problem: &Problem) -> bool {
    matches!(problem, Problem::WrongLayout { .. })
}

/// A pass makes an image in one way and the next reads it in another.
fn chain(
    scene: &mut Scene<'_>,
    format: vk::Format,
    write: (PassKind, Access),
    read: (PassKind, Access),
) {
    let mut image = scene.image_of("image", format);
    let mut result = scene.image("result");
    let output = match read.0 {
        PassKind::Graphics => Access::ColorAttachment,
        _ => COMPUTE_WRITE,
    };
    scene.pass("write", write.0, &mut [(&mut image, write.1)]);
    scene.pass(
        "read",
        read.0,
        &mut [(&mut result, output), (&mut image, read.1)],
    );
    scene.results(&[result]);
}

fn compute_to_sampled(scene: &mut Scene<'_>) {
    let write = (PassKind::Compute, COMPUTE_WRITE);
    chain(
        scene,
        vk::Format::R32_SFLOAT,
        write,
        (PassKind::Compute, COMPUTE_SAMPLED),
    );
}

fn color_to_sampled(scene: &mut Scene<'_>) {
    let write = (PassKind::Graphics, Access::ColorAttachment);
    let read = (PassKind::Graphics, Access::Sampled(Stage::Fragment));
    chain(scene, vk::Format::R32_SFLOAT, write, read);
}

fn depth_to_sampled(scene: &mut Scene<'_>) {
    let write = (PassKind::Graphics, Access::DepthAttachment);
    chain(
        scene,
        vk::Format::D32_SFLOAT,
        write,
        (PassKind::Compute, COMPUTE_SAMPLED),
    );
}

#[test]
fn compute_write_to_sampled_read_without_a_barrier() {
    let edit = |plan: &mut Plan| drop_barrier(plan, "read", "image");
    plant(
        "compute -> sampled: dropped",
        compute_to_sampled,
        edit,
        RAW,
        read_after_write,
    );
}

#[test]
fn compute_write_to_sampled_read_for_another_stage() {
    let edit = |plan: &mut Plan| barrier(plan, "read", "image").dst_stages = S::FRAGMENT_SHADER;
    plant(
        "compute -> sampled: for another stage",
        compute_to_sampled,
        edit,
        RAW,
        read_after_write,
    );
}

#[test]
fn color_attachment_to_sampled_read_without_a_barrier() {
    let edit = |plan: &mut Plan| drop_barrier(plan, "read", "image");
    plant(
        "colour attachment -> sampled: dropped",
        color_to_sampled,
        edit,
        RAW,
        read_after_write,
    );
}

#[test]
fn color_attachment_to_sampled_read_from_another_stage() {
    let edit = |plan: &mut Plan| {
        let barrier = barrier(plan, "read", "image");
        (barrier.src_stages, barrier.src_access) = (S::COMPUTE_SHADER, A::SHADER_STORAGE_WRITE);
    };
    let problem = |p: &Problem| *p == Problem::TransitionAfterAccess;
    plant(
        "colour attachment -> sampled: from another stage",
        color_to_sampled,
        edit,
        WAW,
        problem,
    );
}

#[test]
fn depth_attachment_to_sampled_read_without_a_barrier() {
    let edit = |plan: &mut Plan| drop_barrier(plan, "read", "image");
    plant(
        "depth attachment -> sampled: dropped",
        depth_to_sampled,
        edit,
        RAW,
        read_after_write,
    );
}

#[test]
fn depth_attachment_to_sampled_read_without_its_late_tests() {
    let edit = |plan: &mut Plan| {
        barrier(plan, "read", "image").src_stages = S::EARLY_FRAGMENT_TESTS;
    };
    let problem = |p: &Problem| *p == Problem::TransitionAfterAccess;
    plant(
        "depth attachment -> sampled: early tests only",
        depth_to_sampled,
        edit,
        WAW,
        problem,
    );
}

#[test]
fn compute_write_to_attachment_without_a_barrier() {
    let build = |scene: &mut Scene<'_>| {
        let mut image = scene.image("image");
        scene.pass(
            "write",
            PassKind::Compute,
            &mut [(&mut image, COMPUTE_WRITE)],
        );
        let uses = &mut [(&mut image, Access::ColorAttachmentLoad)];
        scene.pass("draw", PassKind::Graphics, uses);
        scene.results(&[image]);
    };
    let edit = |plan: &mut Plan| drop_barrier(plan, "draw", "image");
    plant(
        "compute -> attachment: dropped",
        build,
        edit,
        RAW,
        read_after_write,
    );
    let edit = |plan: &mut Plan| barrier(plan, "draw", "image").dst_access = A::NONE;
    plant(
        "compute -> attachment: visible to nothing",
        build,
        edit,
        RAW,
        read_after_write,
    );
}

#[test]
fn transition_that_waits_for_nothing() {
    let nothing = |plan: &mut Plan| {
        let barrier = barrier(plan, "read", "image");
        (barrier.src_stages, barrier.src_access) = (S::NONE, A::NONE);
    };
    let problem = |p: &Problem| *p == Problem::TransitionAfterAccess;
    plant(
        "transition behind a write: waits for nothing",
        compute_to_sampled,
        nothing,
        WAW,
        problem,
    );
    plant(
        "transition behind a draw: waits for nothing",
        color_to_sampled,
        nothing,
        WAW,
        problem,
    );
    let build = |scene: &mut Scene<'_>| {
        let (mut image, mut result) = (scene.image("image"), scene.image("result"));
        scene.pass(
            "write",
            PassKind::Compute,
            &mut [(&mut image, COMPUTE_WRITE)],
        );
        let uses = &mut [(&mut result, COMPUTE_WRITE), (&mut image, COMPUTE_SAMPLED)];
        scene.pass("sample", PassKind::Compute, uses);
        scene.pass(
            "read",
            PassKind::Compute,
            &mut [(&mut image, COMPUTE_WRITE)],
        );
        scene.results(&[image, result]);
    };
    plant(
        "transition behind a read: waits for nothing",
        build,
        nothing,
        WAR,
        problem,
    );
}

#[test]
fn transition_to_the_wrong_layout() {
    let edit = |plan: &mut Plan| {
        let barrier = barrier(plan, "read", "image");
        barrier.transition = Some(Transition {
            old: L::GENERAL,
            new: L::TRANSFER_SRC_OPTIMAL,
        });
    };
    let id = "imageLayout-00344";
    plant(
        "transition to the wrong layout",
        compute_to_sampled,
        edit,
        id,
        wrong_layout,
    );
}

#[test]
fn transition_from_the_wrong_layout() {
    let edit = |plan: &mut Plan| {
        let barrier = barrier(plan, "read", "image");
        barrier.transition = Some(Transition {
            old: L::TRANSFER_SRC_OPTIMAL,
            new: L::READ_ONLY_OPTIMAL,
        });
    };
    let id = "VUID-VkImageMemoryBarrier2-oldLayout-01197";
    plant(
        "transition from the wrong layout",
        compute_to_sampled,
        edit,
        id,
        wrong_layout,
    );
}

/// A pass fills a buffer in one way, the next uses it in another.
fn buffer_chain(scene: &mut Scene<'_>, write: (PassKind, Access), then: (PassKind, Access)) {
    let (mut buffer, mut result) = (scene.buffer("buffer"), scene.image("result"));
    scene.pass("write", write.0, &mut [(&mut buffer, write.1)]);
    match then.0 {
        PassKind::Transfer => {
            // What a transfer reads goes to the host; the clear keeps the pass.
            let uses = &mut [(&mut buffer, then.1), (&mut result, Access::Clear)];
            scene.pass("use", then.0, uses);
        }
        PassKind::Compute => {
            scene.pass(
                "use",
                then.0,
                &mut [(&mut result, COMPUTE_WRITE), (&mut buffer, then.1)],
            );
        }
        PassKind::Graphics => {
            let uses = &mut [
                (&mut result, Access::ColorAttachment),
                (&mut buffer, then.1),
            ];
            scene.pass("use", then.0, uses);
        }
    }
    scene.results(&[result]);
}

#[track_caller]
fn plant_in_buffer(mistake: &str, write: (PassKind, Access), read: (PassKind, Access)) {
    let build = |scene: &mut Scene<'_>| buffer_chain(scene, write, read);
    let edit = |plan: &mut Plan| drop_barrier(plan, "use", "buffer");
    plant(
        &format!("{mistake}: dropped"),
        build,
        edit,
        RAW,
        read_after_write,
    );
    let edit = |plan: &mut Plan| barrier(plan, "use", "buffer").src_access = A::NONE;
    plant(
        &format!("{mistake}: execution only"),
        build,
        edit,
        RAW,
        read_after_write,
    );
}

const COPY_WRITE: (PassKind, Access) = (PassKind::Transfer, Access::CopyWrite);
const DISPATCH_WRITE: (PassKind, Access) = (PassKind::Compute, COMPUTE_WRITE);

#[test]
fn copy_to_copy_without_a_barrier() {
    plant_in_buffer(
        "copy -> copy",
        COPY_WRITE,
        (PassKind::Transfer, Access::CopyRead),
    );
}

#[test]
fn copy_to_compute_without_a_barrier() {
    plant_in_buffer(
        "copy -> storage",
        COPY_WRITE,
        (PassKind::Compute, COMPUTE_READ),
    );
    let uniform = Access::Uniform(Stage::Compute);
    plant_in_buffer("copy -> uniform", COPY_WRITE, (PassKind::Compute, uniform));
}

#[test]
fn compute_to_indirect_arguments_without_a_barrier() {
    let draw = (PassKind::Graphics, Access::Indirect);
    plant_in_buffer("compute -> indirect arguments", DISPATCH_WRITE, draw);
}

#[test]
fn compute_to_vertex_input_without_a_barrier() {
    let (vertices, indices) = (Access::Vertex, Access::Index);
    plant_in_buffer(
        "compute -> vertices",
        DISPATCH_WRITE,
        (PassKind::Graphics, vertices),
    );
    plant_in_buffer(
        "compute -> indices",
        DISPATCH_WRITE,
        (PassKind::Graphics, indices),
    );
}

#[test]
fn compute_to_transfer_without_a_barrier() {
    plant_in_buffer(
        "compute -> copy",
        DISPATCH_WRITE,
        (PassKind::Transfer, Access::CopyRead),
    );
}

#[test]
fn write_after_read_without_a_barrier() {
    let build = |scene: &mut Scene<'_>| {
        let (mut buffer, mut result) = (scene.buffer("buffer"), scene.image("result"));
        scene.pass(
            "write",
            PassKind::Compute,
            &mut [(&mut buffer, COMPUTE_WRITE)],
        );
        let uses = &mut [(&mut result, COMPUTE_WRITE), (&mut buffer, COMPUTE_READ)];
        scene.pass("read", PassKind::Compute, uses);
        scene.pass(
            "again",
            PassKind::Transfer,
            &mut [(&mut buffer, Access::CopyWrite)],
        );
        scene.results(&[buffer, result]);
    };
    let edit = |plan: &mut Plan| drop_barrier(plan, "again", "buffer");
    let problem = |p: &Problem| *p == Problem::WriteAfterRead;
    plant("write after read: dropped", build, edit, WAR, problem);
}

#[test]
fn write_after_write_without_a_barrier() {
    let build = |scene: &mut Scene<'_>| {
        let mut buffer = scene.buffer("buffer");
        scene.pass(
            "write",
            PassKind::Transfer,
            &mut [(&mut buffer, Access::CopyWrite)],
        );
        let again = Access::StorageReadWrite(Stage::Compute);
        scene.pass("again", PassKind::Compute, &mut [(&mut buffer, again)]);
        scene.pass("over", PassKind::Compute, &mut [(&mut buffer, again)]);
        scene.results(&[buffer]);
    };
    let edit = |plan: &mut Plan| drop_barrier(plan, "over", "buffer");
    plant(
        "write after write: dropped",
        build,
        edit,
        "SYNC-HAZARD-",
        write_after_write,
    );
}

#[test]
fn memory_that_changes_hands_too_early() {
    // A tenant that only writes: what it wrote must be flushed before the next one begins.
    let build = |scene: &mut Scene<'_>| {
        let (mut first, mut second) = (scene.buffer("first"), scene.buffer("second"));
        let (mut image, mut result) = (scene.image("image"), scene.image("result"));
        let uses = &mut [(&mut first, Access::CopyWrite), (&mut image, Access::Clear)];
        scene.pass("write first", PassKind::Transfer, uses);
        let uses = &mut [(&mut image, COMPUTE_SAMPLED), (&mut second, COMPUTE_WRITE)];
        scene.pass("write second", PassKind::Compute, uses);
        let uses = &mut [(&mut result, COMPUTE_WRITE), (&mut second, COMPUTE_READ)];
        scene.pass("read second", PassKind::Compute, uses);
        scene.results(&[result]);
    };
    let edit = |plan: &mut Plan| {
        let mut flushes = plan
            .steps
            .iter_mut()
            .filter(|s| !s.hand_over.barriers.is_empty());
        flushes
            .next()
            .expect("a flush to drop")
            .hand_over
            .barriers
            .clear();
    };
    let problem = |p: &Problem| *p == Problem::HandOver;
    plant(
        "memory changes hands: flush dropped",
        build,
        edit,
        WAW,
        problem,
    );
}

#[test]
fn memory_shared_by_two_live_tenants() {
    let edit = |plan: &mut Plan| {
        let place = |plan: &Plan, name: &str| {
            let resource = plan.resources.iter().position(|r| r.name == name).unwrap();
            let ResourceOrigin::Transient(Some(place)) = plan.resources[resource].origin else {
                panic!("`{name}` has no place");
            };
            (resource, place)
        };
        let (_, of) = place(plan, "first");
        let (moved, place) = place(plan, "other");
        assert!(place.offset != of.offset);
        plan.resources[moved].origin = ResourceOrigin::Transient(Some(of));
    };
    let build = |scene: &mut Scene<'_>| {
        let mut first = scene.buffer("first");
        let mut other = scene.buffer("other");
        let mut result = scene.image("result");
        scene.pass(
            "write first",
            PassKind::Transfer,
            &mut [(&mut first, Access::CopyWrite)],
        );
        scene.pass(
            "write other",
            PassKind::Compute,
            &mut [(&mut other, COMPUTE_WRITE)],
        );
        let uses = &mut [
            (&mut result, COMPUTE_WRITE),
            (&mut first, COMPUTE_READ),
            (&mut other, COMPUTE_READ),
        ];
        scene.pass("read both", PassKind::Compute, uses);
        scene.results(&[result]);
    };
    let problem = |p: &Problem| *p == Problem::SharedMemory;
    plant(
        "memory shared by two live tenants",
        build,
        edit,
        "SYNC-HAZARD-",
        problem,
    );
}
