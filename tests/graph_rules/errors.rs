//! Every mistake in a declaration is one clear line that names the pass and the resource.

use super::{SAMPLED, WRITE, desc, host_buffer, host_image, make, try_plan};
use antumbra::ash::vk;
use antumbra::graph::{
    Access, BufferDesc, BufferPart, BufferState, Graph, GraphError, HistoryState, HistoryStates,
    HostImage, ImageDesc, ImagePart, ImageState, Load, PassKind, Stage,
};

/// The message that `build` gets, which must be of one line.
#[track_caller]
fn message(build: impl FnOnce(&mut Graph<'_>), kind: impl Fn(&GraphError) -> bool) -> String {
    let error = try_plan(build).expect_err("the graph has a mistake");
    let text = error.to_string();
    assert!(kind(&error), "{text}");
    assert_eq!(text.lines().count(), 1, "{text}");
    text
}

#[test]
fn an_id_of_another_graph() {
    let mut other = Graph::new();
    let foreign = other.create_image("image", desc());
    let text = message(
        |g| {
            g.create_image("image", desc());
            g.pass("blur", PassKind::Compute).read(foreign, SAMPLED);
        },
        |e| matches!(e, GraphError::ForeignId { .. }),
    );
    let wanted = "pass `blur` uses an id of another graph; ids live only as long as their graph";
    assert_eq!(text, wanted);
    let text = message(
        |g| g.keep(foreign),
        |e| matches!(e, GraphError::ForeignId { .. }),
    );
    assert!(text.contains("`keep`"), "{text}");
}

#[test]
fn an_id_that_a_write_replaced() {
    let stale = |e: &GraphError| matches!(e, GraphError::StaleId { .. });
    let text = message(
        |g| {
            let image = g.create_image("mask", desc());
            make(g, "make", image);
            g.pass("blur", PassKind::Compute).read(image, SAMPLED);
        },
        stale,
    );
    assert_eq!(
        text,
        "pass `blur` uses `mask` version 0, but `make` wrote version 1; use the id that this write \
         returned"
    );
    let text = message(
        |g| {
            let image = g.create_image("mask", desc());
            make(g, "make", image);
            g.keep(image);
        },
        stale,
    );
    assert!(text.contains("`keep`") && text.contains("`make`"), "{text}");
}

#[test]
fn an_access_that_the_resource_cannot_have() {
    let wrong = |e: &GraphError| matches!(e, GraphError::WrongKind { .. });
    let text = message(
        |g| {
            let image = g.create_image("mask", desc());
            g.pass("draw", PassKind::Graphics)
                .read(image, Access::Index);
        },
        wrong,
    );
    assert_eq!(
        text,
        "pass `draw`: `mask` is an image and cannot be accessed as Index"
    );
    let text = message(
        |g| {
            let buffer = g.create_buffer("list", BufferDesc { size: 64 });
            g.pass("blur", PassKind::Compute).read(buffer, SAMPLED);
        },
        wrong,
    );
    let wanted = "pass `blur`: `list` is a buffer and cannot be accessed as Sampled(Compute)";
    assert_eq!(text, wanted);
}

#[test]
fn an_access_in_the_wrong_direction() {
    let wrong = |e: &GraphError| matches!(e, GraphError::WrongDirection { .. });
    let of = |access: Access, how: u32| {
        message(
            |g| {
                let image = g.create_image("mask", desc());
                let mut pass = g.pass("blur", PassKind::Compute);
                match how {
                    0 => pass.read(image, access),
                    1 => _ = pass.write(image, access),
                    _ => _ = pass.overwrite(image, access),
                }
            },
            wrong,
        )
    };
    assert_eq!(
        of(WRITE, 0),
        "pass `blur`: StorageWrite(Compute) of `mask` writes; declare it with `write`"
    );
    let reads = "pass `blur`: Sampled(Compute) of `mask` does not write; declare it with `read`";
    assert_eq!(of(SAMPLED, 1), reads);
    assert_eq!(of(SAMPLED, 2), reads);
    let both = Access::StorageReadWrite(Stage::Compute);
    assert_eq!(
        of(both, 2),
        "pass `blur`: StorageReadWrite(Compute) of `mask` reads what it would drop; declare it \
         with `write`"
    );
}

#[test]
fn an_access_that_the_kind_of_pass_has_no_stage_for() {
    let wrong = |e: &GraphError| matches!(e, GraphError::WrongPassKind { .. });
    for (kind, access, wanted) in [
        (
            PassKind::Compute,
            Access::CopyWrite,
            "a compute pass and cannot access `mask` as CopyWrite",
        ),
        (
            PassKind::Transfer,
            WRITE,
            "a transfer pass and cannot access `mask` as StorageWrite(Compute)",
        ),
        (
            PassKind::Graphics,
            WRITE,
            "a graphics pass and cannot access `mask` as StorageWrite(Compute)",
        ),
    ] {
        let text = message(
            |g| {
                let image = g.create_image("mask", desc());
                let _ = g.pass("blur", kind).overwrite(image, access);
            },
            wrong,
        );
        assert_eq!(text, format!("pass `blur` is {wanted}"));
    }
}

#[test]
fn a_part_outside_its_resource() {
    let outside = |e: &GraphError| matches!(e, GraphError::OutOfRange { .. });
    let image = |part: ImagePart| {
        message(
            |g| {
                let image = g.create_image("mask", desc().mips(2).layers(3));
                let _ = g
                    .pass("blur", PassKind::Compute)
                    .overwrite_part(image, part, WRITE);
            },
            outside,
        )
    };
    assert_eq!(
        image(ImagePart::mip(2)),
        "pass `blur`: mips 2..3 layers 0..1 is outside `mask` (mips 0..2 layers 0..3)"
    );
    for part in [
        ImagePart::layer(3),
        ImagePart {
            mips: 0,
            ..ImagePart::mip(0)
        },
        ImagePart {
            layers: 4,
            ..ImagePart::mip(0)
        },
        ImagePart {
            layers: 0,
            ..ImagePart::mip(1)
        },
    ] {
        image(part);
    }
    let buffer = |offset: u64, size: u64| {
        message(
            |g| {
                let buffer = g.create_buffer("list", BufferDesc { size: 64 });
                let part = BufferPart { offset, size };
                let _ = g
                    .pass("blur", PassKind::Compute)
                    .overwrite_part(buffer, part, WRITE);
            },
            outside,
        )
    };
    let wanted = "pass `blur`: bytes 32..96 is outside `list` (bytes 0..64)";
    assert_eq!(buffer(32, 64), wanted);
    buffer(0, 0);
    buffer(64, 1);
}

/// Numbers whose sum does not fit must be refused, not wrapped around or panicked on.
#[test]
fn a_part_beyond_all_numbers() {
    let outside = |e: &GraphError| matches!(e, GraphError::OutOfRange { .. });
    message(
        |g| {
            let image = g.create_image("mask", desc());
            let part = ImagePart {
                base_mip: u32::MAX,
                mips: 2,
                base_layer: u32::MAX,
                layers: u32::MAX,
            };
            let _ = g
                .pass("blur", PassKind::Compute)
                .overwrite_part(image, part, WRITE);
        },
        outside,
    );
    message(
        |g| {
            let buffer = g.create_buffer("list", BufferDesc { size: 64 });
            let part = BufferPart {
                offset: u64::MAX,
                size: u64::MAX,
            };
            let _ = g
                .pass("blur", PassKind::Compute)
                .overwrite_part(buffer, part, WRITE);
        },
        outside,
    );
}

#[test]
fn two_accesses_of_one_pass_that_cannot_hold_at_once() {
    let conflict = |e: &GraphError| matches!(e, GraphError::Conflict { .. });
    let text = message(
        |g| {
            let image = g.create_image("mask", desc());
            let image = make(g, "make", image);
            let mut pass = g.pass("blur", PassKind::Compute);
            pass.read(image, SAMPLED);
            let _ = pass.write(image, WRITE);
        },
        conflict,
    );
    assert_eq!(
        text,
        "pass `blur` accesses mips 0..1 layers 0..1 of `mask` both as Sampled(Compute) and as \
         StorageWrite(Compute)"
    );
    // Two reads in two layouts.
    message(
        |g| {
            let image = g.create_image("mask", desc());
            let image = make(g, "make", image);
            let mut pass = g.pass("blur", PassKind::Compute);
            pass.read(image, SAMPLED);
            pass.read(image, Access::StorageRead(Stage::Compute));
        },
        conflict,
    );
    // Overlapping parts of a buffer.
    message(
        |g| {
            let buffer = g.create_buffer("list", BufferDesc { size: 64 });
            let mut pass = g.pass("sort", PassKind::Compute);
            let part = |offset| BufferPart { offset, size: 32 };
            let buffer = pass.overwrite_part(buffer, part(0), WRITE);
            let _ = pass.overwrite_part(buffer, part(16), WRITE);
        },
        conflict,
    );
}

#[test]
fn a_read_of_what_nobody_wrote() {
    let unwritten = |e: &GraphError| matches!(e, GraphError::ReadBeforeWrite { .. });
    let text = message(
        |g| {
            let image = g.create_image("mask", desc().mips(2));
            let mut pass = g.pass("make", PassKind::Compute);
            let image = pass.overwrite_part(image, ImagePart::mip(0), WRITE);
            g.pass("blur", PassKind::Compute).read(image, SAMPLED);
        },
        unwritten,
    );
    assert_eq!(
        text,
        "pass `blur` reads mips 1..2 layers 0..1 of `mask`, which no pass before it wrote"
    );
    let text = message(
        |g| {
            let image = g.create_image("color", desc());
            let _ = g.pass("draw", PassKind::Graphics).color(image, Load::Keep);
        },
        unwritten,
    );
    assert!(
        text.contains("`draw`") && text.contains("`color`"),
        "{text}"
    );
    // An import that enters undefined holds nothing.
    message(
        |g| {
            let undefined = ImageState::UNDEFINED;
            let image = g.import_image("target", host_image(undefined, undefined));
            g.pass("blur", PassKind::Compute).read(image, SAMPLED);
        },
        unwritten,
    );
}

#[test]
fn a_write_to_the_last_frames_image() {
    let state = ImageState {
        layout: vk::ImageLayout::GENERAL,
        ..ImageState::UNDEFINED
    };
    let states: HistoryStates = [(
        "past",
        HistoryState {
            desc: desc(),
            previous: state,
            current: state,
        },
    )]
    .into();
    let mut graph = Graph::continuing(states);
    let previous = graph.history_image("past", desc()).previous.unwrap();
    let _ = graph
        .pass("blur", PassKind::Compute)
        .overwrite(previous, WRITE);
    let error = graph.compile(&antumbra::graph::FakeMemory).err().unwrap();
    assert!(matches!(error, GraphError::ReadOnly { .. }));
    assert_eq!(
        error.to_string(),
        "pass `blur` writes `past.previous`, which is what the last frame left and read-only"
    );
}

#[test]
fn a_description_that_no_device_can_make() {
    let bad = |desc: ImageDesc| {
        message(
            |g| _ = g.create_image("mask", desc),
            |e| matches!(e, GraphError::BadDescription { .. }),
        )
    };
    let format = vk::Format::R32_SFLOAT;
    let empty = "`mask`: an image of 0x16 texels has no texel";
    assert_eq!(bad(ImageDesc::new(format, 0, 16)), empty);
    let none = "`mask`: an image needs at least one layer and one mip level";
    assert_eq!(bad(desc().layers(0)), none);
    assert_eq!(bad(desc().mips(0)), none);
    let deep = "`mask`: 6 mip levels, but 16x16 texels allow 5";
    assert_eq!(bad(desc().mips(6)), deep);
    let text = message(
        |g| _ = g.create_buffer("list", BufferDesc { size: 0 }),
        |e| matches!(e, GraphError::BadDescription { .. }),
    );
    assert_eq!(text, "`list`: a buffer of 0 bytes");
}

#[test]
fn an_import_without_the_usage_it_needs() {
    let missing = |e: &GraphError| matches!(e, GraphError::MissingUsage { .. });
    let text = message(
        |g| {
            let host = HostImage {
                usage: vk::ImageUsageFlags::SAMPLED,
                ..host_image(ImageState::UNDEFINED, ImageState::UNDEFINED)
            };
            let image = g.import_image("target", host);
            let _ = g
                .pass("draw", PassKind::Graphics)
                .color(image, Load::Discard);
        },
        missing,
    );
    let wanted = "`target` was imported without usage COLOR_ATTACHMENT, which pass `draw` needs";
    assert_eq!(text, wanted);
    let text = message(
        |g| {
            let mut host = host_buffer(BufferState::IDLE, BufferState::IDLE);
            host.usage = vk::BufferUsageFlags::TRANSFER_SRC;
            let buffer = g.import_buffer("list", host);
            let _ = g.pass("sort", PassKind::Compute).overwrite(buffer, WRITE);
        },
        missing,
    );
    let wanted = "`list` was imported without usage STORAGE_BUFFER, which pass `sort` needs";
    assert_eq!(text, wanted);
}

#[test]
fn attachments_of_different_sizes() {
    let text = message(
        |g| {
            let color = g.create_image("color", desc().mips(2));
            let depth = g.create_image("depth", ImageDesc::new(vk::Format::D32_SFLOAT, 16, 16));
            let mut pass = g.pass("draw", PassKind::Graphics);
            let color = pass.color_part(color, ImagePart::mip(1), Load::Discard);
            let depth = pass.depth(depth, Load::Discard);
            g.keep(color);
            g.keep(depth);
        },
        |e| matches!(e, GraphError::AttachmentSize { .. }),
    );
    assert_eq!(
        text,
        "pass `draw`: attachment `depth` is 16x16, but `color` is 8x8"
    );
}

#[test]
fn a_history_image_declared_twice() {
    let text = message(
        |g| {
            g.history_image("past", desc());
            g.history_image("past", desc());
        },
        |e| matches!(e, GraphError::DuplicateHistory { .. }),
    );
    assert_eq!(text, "history image `past` is declared twice in one graph");
}

/// The first mistake is told, not one that follows from it.
#[test]
fn the_first_of_several_mistakes() {
    let text = message(
        |g| {
            let image = g.create_image("mask", desc());
            g.pass("first", PassKind::Compute)
                .read(image, Access::Index);
            g.pass("second", PassKind::Compute)
                .read(image, Access::Vertex);
        },
        |e| matches!(e, GraphError::WrongKind { .. }),
    );
    assert!(text.contains("`first`"), "{text}");
}
