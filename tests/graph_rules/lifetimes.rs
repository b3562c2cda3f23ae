//! What runs, what lives how long, and what crosses the ends of a frame.

use super::{
    SAMPLED, WRITE, before, checked, consume, desc, host_buffer, host_image, make, on, plan,
    running, step_of,
};
use antumbra::ash::vk::{AccessFlags2 as A, ImageLayout as L, PipelineStageFlags2 as S};
use antumbra::graph::{
    Access, BufferDesc, BufferState, FakeMemory, Graph, HistoryState, HistoryStates, ImageState,
    Load, PassKind, Placement, Plan, ResourceOrigin, Stage, Transition,
};

#[track_caller]
fn placement(plan: &Plan, name: &str) -> Option<Placement> {
    let found = plan.resources.iter().find(|resource| resource.name == name);
    match found.unwrap().origin {
        ResourceOrigin::Transient(place) => place,
        other => panic!("`{name}` is {other:?}"),
    }
}

#[test]
fn passes_that_nobody_needs_are_culled_in_a_chain() {
    let plan = plan(|g| {
        let (a, b) = (g.create_image("a", desc()), g.create_image("b", desc()));
        let a = make(g, "make a", a);
        let mut pass = g.pass("make b", PassKind::Compute);
        pass.read(a, SAMPLED);
        let b = pass.overwrite(b, WRITE);
        let mut pass = g.pass("read b", PassKind::Compute);
        pass.read(b, SAMPLED);
        let c = g.create_image("c", desc());
        let c = make(g, "make c", c);
        g.keep(c);
    });
    assert_eq!(running(&plan), ["make c"]);
    let culled: Vec<_> = plan
        .culled
        .iter()
        .map(|p| (p.name.as_ref(), p.reason.as_str()))
        .collect();
    let wanted = [
        ("make a", "nobody reads what it writes: `a`"),
        ("make b", "nobody reads what it writes: `b`"),
        ("read b", "it writes nothing"),
    ];
    assert_eq!(culled, wanted);
    assert_eq!(placement(&plan, "a"), None);
    assert!(placement(&plan, "c").is_some());
}

#[test]
fn writing_an_import_keeps_a_pass_and_what_it_reads() {
    let plan = plan(|g| {
        let source = g.create_image("source", desc());
        let source = make(g, "make", source);
        let state = BufferState::HOST_READ;
        let target = g.import_buffer("target", host_buffer(BufferState::IDLE, state));
        let mut pass = g.pass("write", PassKind::Compute);
        pass.read(source, SAMPLED);
        let _ = pass.overwrite(target, WRITE);
    });
    assert_eq!(running(&plan), ["make", "write"]);
}

#[test]
fn a_writer_whose_work_is_overwritten_unread_is_culled() {
    let plan = plan(|g| {
        let idle = BufferState::IDLE;
        let target = g.import_buffer("target", host_buffer(idle, idle));
        let mut pass = g.pass("lost", PassKind::Compute);
        let target = pass.overwrite(target, WRITE);
        let mut pass = g.pass("last", PassKind::Transfer);
        let _ = pass.overwrite(target, Access::Clear);
    });
    assert_eq!(running(&plan), ["last"]);
    assert_eq!(plan.culled[0].name, "lost");
}

#[test]
fn a_writer_whose_work_stays_beneath_the_next_is_kept() {
    let plan = plan(|g| {
        let idle = BufferState::IDLE;
        let target = g.import_buffer("target", host_buffer(idle, idle));
        let mut pass = g.pass("below", PassKind::Compute);
        let target = pass.overwrite(target, WRITE);
        let mut pass = g.pass("above", PassKind::Transfer);
        let _ = pass.write(target, Access::CopyWrite);
    });
    assert_eq!(running(&plan), ["below", "above"]);
}

#[test]
fn an_image_cleared_by_its_last_pass_keeps_nothing_before() {
    let plan = plan(|g| {
        let image = g.create_image("image", desc());
        let image = make(g, "lost", image);
        let mut pass = g.pass("draw", PassKind::Graphics);
        let image = pass.color(image, Load::Clear([1.0; 4]));
        g.keep(image);
    });
    assert_eq!(running(&plan), ["draw"]);
}

/// A frame that reads its history where there is one; returns the plan.
fn history_frame(states: HistoryStates) -> Plan {
    let mut graph = Graph::continuing(states);
    let history = graph.history_image("past", desc());
    let mut pass = graph.pass("accumulate", PassKind::Compute);
    if let Some(previous) = history.previous {
        pass.read(previous, SAMPLED);
    }
    let current = pass.overwrite(history.current, WRITE);
    consume(&mut graph, "read", current);
    checked(graph.compile(&FakeMemory).unwrap().plan().clone())
}

/// The state that a frame leaves its current history image in.
fn left(plan: &Plan) -> ImageState {
    let states = plan.resources.iter().find_map(|r| match r.origin {
        ResourceOrigin::HistoryCurrent { leave, .. } => Some(leave),
        _ => None,
    });
    states.unwrap()
}

#[test]
fn history_begins_without_a_previous_frame() {
    let plan = history_frame(HistoryStates::new());
    assert!(
        plan.resources
            .iter()
            .all(|resource| resource.name != "past.previous")
    );
    let first = before(&plan, "accumulate", "past")[0];
    assert_eq!((first.src_stages, first.src_access), (S::NONE, A::NONE));
    let wanted = ImageState {
        layout: L::READ_ONLY_OPTIMAL,
        stages: S::COMPUTE_SHADER,
        access: A::NONE,
    };
    assert_eq!(left(&plan), wanted);
    assert_eq!(plan.leave.barriers, []);
}

#[test]
fn history_is_read_where_the_last_frame_left_it() {
    let first = history_frame(HistoryStates::new());
    let state = |current| HistoryState {
        desc: desc(),
        previous: left(&first),
        current,
    };
    let second = history_frame([("past", state(ImageState::UNDEFINED))].into());
    // The last frame read it in the same layout: no transition, nothing to flush.
    let barrier = before(&second, "accumulate", "past.previous")[0];
    assert_eq!((barrier.src_access, barrier.transition), (A::NONE, None));
    // What is overwritten now was read two frames ago.
    let third = history_frame([("past", state(left(&first)))].into());
    let barrier = before(&third, "accumulate", "past")[0];
    assert_eq!(
        (barrier.src_stages, barrier.src_access),
        (S::COMPUTE_SHADER, A::NONE)
    );
    let wanted = Transition {
        old: L::UNDEFINED,
        new: L::GENERAL,
    };
    assert_eq!(barrier.transition, Some(wanted));
}

#[test]
fn history_of_another_shape_begins_anew() {
    let first = history_frame(HistoryStates::new());
    let state = HistoryState {
        desc: desc().layers(2),
        previous: left(&first),
        current: ImageState::UNDEFINED,
    };
    let plan = history_frame([("past", state)].into());
    assert!(
        plan.resources
            .iter()
            .all(|resource| resource.name != "past.previous")
    );
}

#[test]
fn imports_leave_as_their_owner_asked() {
    let leave = ImageState {
        layout: L::PRESENT_SRC_KHR,
        stages: S::NONE,
        access: A::NONE,
    };
    let plan = plan(|g| {
        let image = g.import_image("image", host_image(ImageState::UNDEFINED, leave));
        make(g, "write", image);
    });
    let barriers = on(&plan, &plan.leave.barriers, "image");
    assert_eq!(barriers.len(), 1);
    let from = (barriers[0].src_stages, barriers[0].src_access);
    assert_eq!(from, (S::COMPUTE_SHADER, A::SHADER_STORAGE_WRITE));
    let wanted = Transition {
        old: L::GENERAL,
        new: L::PRESENT_SRC_KHR,
    };
    assert_eq!(barriers[0].transition, Some(wanted));
}

#[test]
fn an_import_that_no_pass_touches_leaves_as_asked_too() {
    let enter = ImageState {
        layout: L::GENERAL,
        stages: S::COMPUTE_SHADER,
        access: A::SHADER_STORAGE_WRITE,
    };
    let leave = ImageState {
        layout: L::READ_ONLY_OPTIMAL,
        stages: S::FRAGMENT_SHADER,
        access: A::SHADER_SAMPLED_READ,
    };
    let untouched = plan(|g| {
        g.import_image("image", host_image(enter, leave));
    });
    assert!(untouched.passes.is_empty());
    let barriers = on(&untouched, &untouched.leave.barriers, "image");
    assert_eq!(barriers.len(), 1);
    assert_eq!(barriers[0].src_access, A::SHADER_STORAGE_WRITE);
    assert_eq!(barriers[0].dst_access, A::SHADER_SAMPLED_READ);
    let wanted = Transition {
        old: L::GENERAL,
        new: L::READ_ONLY_OPTIMAL,
    };
    assert_eq!(barriers[0].transition, Some(wanted));

    let same = plan(|g| {
        g.import_image("image", host_image(leave, leave));
    });
    assert_eq!(same.barrier_count(), 0);
}

#[test]
fn an_import_enters_behind_what_its_owner_did() {
    let enter = ImageState {
        layout: L::TRANSFER_DST_OPTIMAL,
        stages: S::COPY,
        access: A::TRANSFER_WRITE,
    };
    let plan = plan(|g| {
        let image = g.import_image("image", host_image(enter, enter));
        consume(g, "read", image);
    });
    let barrier = before(&plan, "read", "image")[0];
    assert_eq!(
        (barrier.src_stages, barrier.src_access),
        (S::COPY, A::TRANSFER_WRITE)
    );
    assert_eq!(barrier.transition.unwrap().old, L::TRANSFER_DST_OPTIMAL);
    assert_eq!(on(&plan, &plan.leave.barriers, "image").len(), 1);
}

#[test]
fn what_the_host_reads_is_flushed_to_it() {
    let plan = plan(|g| {
        let state = BufferState::HOST_READ;
        let buffer = g.import_buffer("buffer", host_buffer(BufferState::IDLE, state));
        let mut pass = g.pass("fill", PassKind::Transfer);
        let _ = pass.overwrite(buffer, Access::CopyWrite);
    });
    let barriers = on(&plan, &plan.leave.barriers, "buffer");
    assert_eq!(barriers.len(), 1);
    assert_eq!(
        (barriers[0].src_stages, barriers[0].src_access),
        (S::COPY, A::TRANSFER_WRITE)
    );
    assert_eq!(
        (barriers[0].dst_stages, barriers[0].dst_access),
        (S::HOST, A::HOST_READ)
    );
}

/// A chain of images in which each is made from the one before.
fn image_chain(g: &mut Graph<'_>, names: &[&'static str]) {
    let mut last = None;
    for name in names {
        let image = g.create_image(*name, desc());
        let mut pass = g.pass(*name, PassKind::Compute);
        if let Some(last) = last {
            pass.read(last, SAMPLED);
        }
        last = Some(pass.overwrite(image, WRITE));
    }
    g.keep(last.unwrap());
}

#[test]
fn images_that_never_live_at_once_share_memory() {
    let plan = plan(|g| image_chain(g, &["a", "b", "c", "d"]));
    let [a, b, c, d] = ["a", "b", "c", "d"].map(|name| placement(&plan, name).unwrap());
    assert_eq!((a.offset, b.offset), (c.offset, d.offset));
    assert_ne!(a.offset, b.offset);
    assert_eq!(plan.peak_bytes() * 2, plan.unaliased_bytes());
}

#[test]
fn an_image_begins_behind_whoever_had_its_memory() {
    let plan = plan(|g| image_chain(g, &["a", "b", "c"]));
    assert_eq!(
        placement(&plan, "a").unwrap().offset,
        placement(&plan, "c").unwrap().offset
    );
    let barrier = before(&plan, "c", "c")[0];
    // "b" read "a"; the write of "a" was made available for that.
    assert_eq!(
        (barrier.src_stages, barrier.src_access),
        (S::COMPUTE_SHADER, A::NONE)
    );
    let wanted = Transition {
        old: L::UNDEFINED,
        new: L::GENERAL,
    };
    assert_eq!(barrier.transition, Some(wanted));
    assert!(
        plan.steps
            .iter()
            .all(|step| step.hand_over.barriers.is_empty())
    );
}

#[test]
fn a_buffer_begins_behind_whoever_read_its_memory() {
    let plan = plan(|g| {
        let mut last = None;
        for name in ["a", "b", "c"] {
            let buffer = g.create_buffer(name, BufferDesc { size: 1024 });
            let mut pass = g.pass(name, PassKind::Compute);
            if let Some(last) = last {
                pass.read(last, Access::Uniform(Stage::Compute));
            }
            last = Some(pass.overwrite(buffer, WRITE));
        }
        g.keep(last.unwrap());
    });
    assert_eq!(
        placement(&plan, "a").unwrap().offset,
        placement(&plan, "c").unwrap().offset
    );
    // Pass "c" waits for "b", which it reads, and so for what "b" read.
    assert_eq!(before(&plan, "c", "c"), []);
    assert!(
        plan.steps
            .iter()
            .all(|step| step.hand_over.barriers.is_empty())
    );
}

#[test]
fn unread_writes_are_flushed_before_their_memory_changes_hands() {
    let plan = plan(|g| {
        let size = BufferDesc { size: 1024 };
        let (first, second) = (
            g.create_buffer("first", size),
            g.create_buffer("second", size),
        );
        let image = g.create_image("image", desc());
        let mut pass = g.pass("one", PassKind::Transfer);
        let _ = pass.overwrite(first, Access::CopyWrite);
        let image = pass.overwrite(image, Access::Clear);
        let mut pass = g.pass("two", PassKind::Compute);
        pass.read(image, SAMPLED);
        let second = pass.overwrite(second, WRITE);
        g.keep(second);
    });
    assert_eq!(
        placement(&plan, "first").unwrap().offset,
        placement(&plan, "second").unwrap().offset
    );
    let flushes = &plan.steps[step_of(&plan, "two")].hand_over.barriers;
    assert_eq!(flushes.len(), 1);
    assert_eq!(flushes[0].target, None);
    assert_eq!(
        (flushes[0].src_stages, flushes[0].src_access),
        (S::COPY, A::TRANSFER_WRITE)
    );
    // A late write-back must not land on what the new owner writes.
    let to = (S::COMPUTE_SHADER, A::SHADER_STORAGE_WRITE);
    assert_eq!((flushes[0].dst_stages, flushes[0].dst_access), to);
}

#[test]
fn what_is_kept_stays_in_its_memory_to_the_end() {
    let plan = plan(|g| {
        let kept = g.create_image("kept", desc());
        let kept = make(g, "kept", kept);
        g.keep(kept);
        image_chain(g, &["a", "b", "c", "d"]);
    });
    let own = placement(&plan, "kept").unwrap();
    for name in ["a", "b", "c", "d"] {
        assert_ne!(placement(&plan, name).unwrap().offset, own.offset, "{name}");
    }
}

#[test]
fn images_and_buffers_lie_apart() {
    let plan = plan(|g| {
        let (image, buffer) = (
            g.create_image("image", desc()),
            g.create_buffer("buffer", BufferDesc { size: 4096 }),
        );
        let mut pass = g.pass("write", PassKind::Compute);
        let image = pass.overwrite(image, WRITE);
        let buffer = pass.overwrite(buffer, WRITE);
        g.keep(image);
        g.keep(buffer);
    });
    let (image, buffer) = (
        placement(&plan, "image").unwrap(),
        placement(&plan, "buffer").unwrap(),
    );
    assert_ne!(image.arena, buffer.arena);
    assert!(plan.arenas[image.arena].images && !plan.arenas[buffer.arena].images);
}

#[test]
fn an_empty_graph_is_an_empty_plan() {
    let plan = plan(|_| {});
    assert!(plan.passes.is_empty() && plan.steps.is_empty() && plan.resources.is_empty());
    assert_eq!((plan.peak_bytes(), plan.barrier_count()), (0, 0));
}

/// Chains that have nothing to do with each other run side by side, unless each is a part of its own: then
/// their images lie in the same place.
#[test]
fn parts_follow_each_other_and_share_memory() {
    let chains = |parts: bool| {
        plan(|g| {
            for name in ["first", "second", "third"] {
                if parts {
                    g.begin_part();
                }
                let image = g.create_image(format!("{name} map"), desc());
                let mut pass = g.pass(format!("{name} make"), PassKind::Compute);
                let image = pass.overwrite(image, WRITE);
                let answer = g.create_image(format!("{name} answer"), desc());
                let mut pass = g.pass(format!("{name} use"), PassKind::Compute);
                pass.read(image, SAMPLED);
                let answer = pass.overwrite(answer, WRITE);
                g.keep(answer);
            }
        })
    };
    let (beside, behind) = (chains(false), chains(true));
    assert_eq!(step_of(&beside, "third make"), 0);
    let steps = [
        "first make",
        "first use",
        "second make",
        "second use",
        "third make",
    ];
    assert_eq!(steps.map(|name| step_of(&behind, name)), [0, 1, 2, 3, 4]);
    // Three answers, and one map in place of three.
    let image = desc().width * desc().height * 4;
    assert_eq!(beside.peak_bytes(), 6 * u64::from(image));
    assert_eq!(behind.peak_bytes(), 4 * u64::from(image));
}
