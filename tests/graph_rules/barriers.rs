//! Which barriers there are, and how wide.

use super::{
    READ, SAMPLED, WRITE, before, checked, consume, desc, host_buffer, make, plan, step_of,
};
use antumbra::ash::vk::{self, AccessFlags2 as A, ImageLayout as L, PipelineStageFlags2 as S};
use antumbra::graph::{
    Access, BufferDesc, BufferPart, BufferState, FakeMemory, Graph, ImageDesc, ImagePart, Load,
    Part, PassKind, Stage, Transition,
};

fn transition(old: L, new: L) -> Option<Transition> {
    Some(Transition { old, new })
}

/// Stages and access types of a barrier.
type Scopes = (S, A, S, A);

fn scopes(barrier: &antumbra::graph::Barrier) -> Scopes {
    (
        barrier.src_stages,
        barrier.src_access,
        barrier.dst_stages,
        barrier.dst_access,
    )
}

#[test]
fn a_read_behind_a_read_needs_no_barrier() {
    let plan = plan(|g| {
        let image = g.create_image("image", desc());
        let image = make(g, "make", image);
        let first = consume(g, "first", image);
        // Puts the second reader in a later step.
        let late = g.create_image("late", desc());
        let mut pass = g.pass("second", PassKind::Compute);
        pass.read(image, SAMPLED);
        pass.read(first, SAMPLED);
        let late = pass.overwrite(late, WRITE);
        g.keep(late);
    });
    assert!(step_of(&plan, "first") < step_of(&plan, "second"));
    assert_eq!(before(&plan, "first", "image").len(), 1);
    assert_eq!(before(&plan, "second", "image"), []);
}

#[test]
fn one_barrier_serves_later_readers_in_other_stages() {
    let plan = plan(|g| {
        let image = g.create_image("image", desc());
        let image = make(g, "make", image);
        let first = consume(g, "first", image);
        let drawn = g.create_image("drawn", desc());
        let mut pass = g.pass("draw", PassKind::Graphics);
        let drawn = pass.color(drawn, Load::Discard);
        pass.read(image, Access::Sampled(Stage::Fragment));
        pass.read(first, Access::Sampled(Stage::Vertex));
        g.keep(drawn);
    });
    let barriers = before(&plan, "first", "image");
    assert_eq!(barriers.len(), 1);
    let both = S::COMPUTE_SHADER | S::FRAGMENT_SHADER;
    let wanted = (
        S::COMPUTE_SHADER,
        A::SHADER_STORAGE_WRITE,
        both,
        A::SHADER_SAMPLED_READ,
    );
    assert_eq!(scopes(&barriers[0]), wanted);
    assert_eq!(
        barriers[0].transition,
        transition(L::GENERAL, L::READ_ONLY_OPTIMAL)
    );
    assert_eq!(before(&plan, "draw", "image"), []);
    // `first` gets a barrier of its own there, for the vertex shader alone.
    assert_eq!(
        before(&plan, "draw", "first")[0].dst_stages,
        S::VERTEX_SHADER
    );
}

#[test]
fn a_write_behind_a_read_waits_and_flushes_nothing() {
    let plan = plan(|g| {
        let buffer = g.create_buffer("buffer", BufferDesc { size: 1024 });
        let mut pass = g.pass("make", PassKind::Compute);
        let buffer = pass.overwrite(buffer, WRITE);
        let result = g.create_image("result", desc());
        let mut pass = g.pass("read", PassKind::Compute);
        pass.read(buffer, READ);
        let result = pass.overwrite(result, WRITE);
        g.keep(result);
        let mut pass = g.pass("again", PassKind::Transfer);
        let buffer = pass.overwrite(buffer, Access::CopyWrite);
        g.keep(buffer);
    });
    let barriers = before(&plan, "again", "buffer");
    assert_eq!(barriers.len(), 1);
    assert_eq!(
        scopes(&barriers[0]),
        (S::COMPUTE_SHADER, A::NONE, S::COPY, A::NONE)
    );
}

#[test]
fn a_wait_that_another_barrier_brings_along_is_left_out() {
    let plan = plan(|g| {
        let size = BufferDesc { size: 1024 };
        let (buffer, image) = (
            g.create_buffer("buffer", size),
            g.create_image("image", desc()),
        );
        let mut pass = g.pass("make", PassKind::Compute);
        let buffer = pass.overwrite(buffer, WRITE);
        let image = {
            let mut pass = g.pass("read", PassKind::Compute);
            pass.read(buffer, READ);
            pass.overwrite(image, WRITE)
        };
        // The copy waits for what "read" wrote, so it also waits for what it read.
        let mut pass = g.pass("copy", PassKind::Transfer);
        pass.read(image, Access::CopyRead);
        let buffer = pass.overwrite(buffer, Access::CopyWrite);
        g.keep(buffer);
    });
    assert_eq!(before(&plan, "copy", "buffer"), []);
    assert_eq!(before(&plan, "copy", "image").len(), 1);
}

#[test]
fn a_transition_and_a_flush_are_one_barrier() {
    let plan = plan(|g| {
        let image = g.create_image("image", desc());
        let mut pass = g.pass("draw", PassKind::Graphics);
        let image = pass.color(image, Load::Clear([0.0; 4]));
        consume(g, "read", image);
    });
    let barriers = before(&plan, "read", "image");
    assert_eq!(barriers.len(), 1);
    let from = (S::COLOR_ATTACHMENT_OUTPUT, A::COLOR_ATTACHMENT_WRITE);
    let to = (S::COMPUTE_SHADER, A::SHADER_SAMPLED_READ);
    assert_eq!(scopes(&barriers[0]), (from.0, from.1, to.0, to.1));
    let wanted = transition(L::ATTACHMENT_OPTIMAL, L::READ_ONLY_OPTIMAL);
    assert_eq!(barriers[0].transition, wanted);
}

#[test]
fn a_transition_behind_reads_only_waits() {
    let plan = plan(|g| {
        let image = g.create_image("image", desc());
        let image = make(g, "make", image);
        consume(g, "read", image);
        let mut pass = g.pass("add", PassKind::Compute);
        let image = pass.write(image, Access::StorageReadWrite(Stage::Compute));
        g.keep(image);
    });
    let barriers = before(&plan, "add", "image");
    assert_eq!(barriers.len(), 1);
    let access = A::SHADER_STORAGE_READ | A::SHADER_STORAGE_WRITE;
    assert_eq!(
        scopes(&barriers[0]),
        (S::COMPUTE_SHADER, A::NONE, S::COMPUTE_SHADER, access)
    );
    assert_eq!(
        barriers[0].transition,
        transition(L::READ_ONLY_OPTIMAL, L::GENERAL)
    );
}

#[test]
fn an_overwritten_image_enters_undefined() {
    let plan = plan(|g| {
        let image = g.create_image("image", desc());
        let image = make(g, "make", image);
        consume(g, "read", image);
        let mut pass = g.pass("clear", PassKind::Transfer);
        let image = pass.overwrite(image, Access::Clear);
        g.keep(image);
    });
    assert_eq!(
        before(&plan, "make", "image")[0].transition,
        transition(L::UNDEFINED, L::GENERAL)
    );
    let barriers = before(&plan, "clear", "image");
    assert_eq!(barriers.len(), 1);
    let wanted = transition(L::UNDEFINED, L::TRANSFER_DST_OPTIMAL);
    assert_eq!(barriers[0].transition, wanted);
}

#[test]
fn a_partly_written_image_keeps_its_contents() {
    let plan = plan(|g| {
        let image = g.create_image("image", desc());
        let image = make(g, "make", image);
        let mut pass = g.pass("copy", PassKind::Transfer);
        let image = pass.write(image, Access::CopyWrite);
        g.keep(image);
    });
    let wanted = transition(L::GENERAL, L::TRANSFER_DST_OPTIMAL);
    assert_eq!(before(&plan, "copy", "image")[0].transition, wanted);
    assert_eq!(plan.passes.len(), 2);
}

#[test]
fn a_mip_chain_gets_one_barrier_for_each_level() {
    let levels = 4;
    let plan = plan(|g| {
        let desc = ImageDesc::new(vk::Format::R32_SFLOAT, 64, 64).mips(levels);
        let mut image = g.create_image("image", desc);
        let mut pass = g.pass("level 0", PassKind::Compute);
        image = pass.overwrite_part(image, ImagePart::mip(0), WRITE);
        for mip in 1..levels {
            let mut pass = g.pass(format!("level {mip}"), PassKind::Compute);
            pass.read_part(image, ImagePart::mip(mip - 1), SAMPLED);
            image = pass.overwrite_part(image, ImagePart::mip(mip), WRITE);
        }
        g.keep(image);
    });
    assert_eq!(plan.steps.len(), levels as usize);
    for mip in 1..levels {
        let barriers = before(&plan, &format!("level {mip}"), "image");
        let of = |level: u32| Part::Image(ImagePart::mip(level));
        let parts: Vec<_> = barriers
            .iter()
            .map(|b| (b.target.unwrap().1, b.transition))
            .collect();
        let wanted = [
            (of(mip - 1), transition(L::GENERAL, L::READ_ONLY_OPTIMAL)),
            (of(mip), transition(L::UNDEFINED, L::GENERAL)),
        ];
        assert_eq!(parts, wanted);
    }
}

#[test]
fn layers_in_the_same_state_share_a_barrier() {
    let plan = plan(|g| {
        let mut image = g.create_image("image", desc().layers(6).mips(2));
        for layer in 1..4 {
            let mut pass = g.pass(format!("layer {layer}"), PassKind::Compute);
            let part = ImagePart {
                mips: 2,
                ..ImagePart::layer(layer)
            };
            image = pass.overwrite_part(image, part, WRITE);
        }
        let result = g.create_image("result", desc());
        let mut pass = g.pass("read", PassKind::Compute);
        let part = ImagePart {
            base_mip: 0,
            mips: 2,
            base_layer: 1,
            layers: 3,
        };
        pass.read_part(image, part, SAMPLED);
        let result = pass.overwrite(result, WRITE);
        g.keep(result);
    });
    // The three writers touch nothing in common: one step, one barrier for all their layers.
    assert_eq!(plan.steps.len(), 2);
    let block = Part::Image(ImagePart {
        base_mip: 0,
        mips: 2,
        base_layer: 1,
        layers: 3,
    });
    for pass in ["layer 1", "read"] {
        let barriers = before(&plan, pass, "image");
        assert_eq!(barriers.len(), 1, "{pass}");
        assert_eq!(barriers[0].target.unwrap().1, block, "{pass}");
    }
}

#[test]
fn neighbouring_parts_of_a_buffer_share_a_barrier() {
    let plan = plan(|g| {
        let mut buffer = g.create_buffer("buffer", BufferDesc { size: 1024 });
        for offset in [0, 256, 512] {
            let part = BufferPart { offset, size: 256 };
            let mut pass = g.pass(format!("write {offset}"), PassKind::Compute);
            buffer = pass.overwrite_part(buffer, part, WRITE);
        }
        let result = g.create_image("result", desc());
        let mut pass = g.pass("read", PassKind::Compute);
        let part = BufferPart {
            offset: 128,
            size: 512,
        };
        pass.read_part(buffer, part, READ);
        let result = pass.overwrite(result, WRITE);
        g.keep(result);
    });
    let barriers = before(&plan, "read", "buffer");
    assert_eq!(barriers.len(), 1);
    let wanted = Part::Buffer(BufferPart {
        offset: 128,
        size: 512,
    });
    assert_eq!(barriers[0].target.unwrap().1, wanted);
}

#[test]
fn parts_that_do_not_touch_need_nothing_of_each_other() {
    let plan = plan(|g| {
        let image = g.create_image("image", desc().layers(2));
        let mut pass = g.pass("zero", PassKind::Compute);
        let image = pass.overwrite_part(image, ImagePart::layer(0), WRITE);
        let result = g.create_image("result", desc());
        let mut pass = g.pass("read zero", PassKind::Compute);
        pass.read_part(image, ImagePart::layer(0), SAMPLED);
        let result = pass.overwrite(result, WRITE);
        let mut pass = g.pass("one", PassKind::Compute);
        let image = pass.overwrite_part(image, ImagePart::layer(1), WRITE);
        g.keep(image);
        g.keep(result);
    });
    assert_eq!(step_of(&plan, "one"), 0);
    assert_eq!(plan.steps.len(), 2);
}

#[test]
fn indirect_arguments_wait_for_their_writer() {
    let plan = plan(|g| {
        let (arguments, result) = (
            g.create_buffer("arguments", BufferDesc { size: 16 }),
            g.create_image("result", desc()),
        );
        let mut pass = g.pass("reset", PassKind::Transfer);
        let arguments = pass.overwrite(arguments, Access::Clear);
        let mut pass = g.pass("count", PassKind::Compute);
        let arguments = pass.write(arguments, Access::StorageReadWrite(Stage::Compute));
        let mut pass = g.pass("use", PassKind::Compute);
        pass.read(arguments, Access::Indirect);
        let result = pass.overwrite(result, WRITE);
        g.keep(result);
    });
    let barriers = before(&plan, "use", "arguments");
    assert_eq!(barriers.len(), 1);
    let to = (S::DRAW_INDIRECT, A::INDIRECT_COMMAND_READ);
    let wanted = (S::COMPUTE_SHADER, A::SHADER_STORAGE_WRITE, to.0, to.1);
    assert_eq!(scopes(&barriers[0]), wanted);
}

#[test]
fn independent_passes_share_a_step_and_its_barriers() {
    let plan = plan(|g| {
        for name in ["a", "b", "c"] {
            let image = g.create_image(name, desc());
            let image = make(g, name, image);
            consume(
                g,
                ["read a", "read b", "read c"][name.as_bytes()[0] as usize - 97],
                image,
            );
        }
    });
    assert_eq!(plan.steps.len(), 2);
    let batches = plan
        .batches()
        .filter(|batch| !batch.barriers.is_empty())
        .count();
    assert_eq!(batches, 2);
}

#[test]
fn depth_waits_for_both_of_its_test_stages() {
    let plan = plan(|g| {
        let map = g.create_image("map", ImageDesc::new(vk::Format::D32_SFLOAT, 16, 16));
        let mut pass = g.pass("draw", PassKind::Graphics);
        let map = pass.depth(map, Load::Clear([1.0; 4]));
        consume(g, "read", map);
    });
    let tests = S::EARLY_FRAGMENT_TESTS | S::LATE_FRAGMENT_TESTS;
    assert_eq!(before(&plan, "draw", "map")[0].dst_stages, tests);
    let barrier = before(&plan, "read", "map")[0];
    // Early tests come logically before late ones, but memory is flushed for each stage named.
    assert_eq!(barrier.src_stages, tests);
    assert_eq!(barrier.src_access, A::DEPTH_STENCIL_ATTACHMENT_WRITE);
}

#[test]
fn depth_can_be_tested_and_sampled_at_once() {
    let plan = plan(|g| {
        let depth = g.create_image("depth", ImageDesc::new(vk::Format::D32_SFLOAT, 16, 16));
        let color = g.create_image("color", desc());
        let mut pass = g.pass("first", PassKind::Graphics);
        let depth = pass.depth(depth, Load::Clear([1.0; 4]));
        let mut pass = g.pass("second", PassKind::Graphics);
        let color = pass.color(color, Load::Discard);
        pass.depth_test(depth);
        pass.read(depth, Access::Sampled(Stage::Fragment));
        g.keep(color);
    });
    let barriers = before(&plan, "second", "depth");
    assert_eq!(barriers.len(), 1);
    assert!(
        barriers[0]
            .dst_stages
            .contains(S::FRAGMENT_SHADER | S::EARLY_FRAGMENT_TESTS)
    );
    assert_eq!(barriers[0].transition.unwrap().new, L::READ_ONLY_OPTIMAL);
}

#[test]
fn a_buffer_that_the_host_only_read_is_not_flushed() {
    let state = BufferState {
        stages: S::VERTEX_SHADER,
        access: A::UNIFORM_READ,
    };
    let mut graph = Graph::new();
    let buffer = graph.import_buffer("buffer", host_buffer(state, BufferState::IDLE));
    let mut pass = graph.pass("write", PassKind::Compute);
    let _ = pass.overwrite(buffer, WRITE);
    let plan = checked(graph.compile(&FakeMemory).unwrap().plan().clone());
    let barriers = before(&plan, "write", "buffer");
    assert_eq!(barriers.len(), 1);
    assert_eq!(
        scopes(&barriers[0]),
        (S::VERTEX_SHADER, A::NONE, S::COMPUTE_SHADER, A::NONE)
    );
}
