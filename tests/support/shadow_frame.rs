//! A frame as a renderer of soft shadows would declare it, without commands.

use antumbra::ash::vk::{self, Handle};
use antumbra::graph::{
    Access, BufferDesc, BufferPart, BufferState, Graph, HostBuffer, HostImage, ImageDesc,
    ImagePart, ImageState, Load, PassKind, Stage,
};

const MAP: u32 = 2048;
const WIDTH: u32 = 1280;
const HEIGHT: u32 = 720;
const LEVELS: u32 = 3;

const SAMPLED: Access = Access::Sampled(Stage::Compute);
const WRITE: Access = Access::StorageWrite(Stage::Compute);

/// Number of passes declared for so many lights.
#[allow(dead_code)]
pub fn pass_count(lights: u32) -> usize {
    (8 + lights * (5 + LEVELS)) as usize
}

/// Declares the frame: G-buffer; for each light a depth map, its bounds in a mip chain, tiles
/// sorted by what they need, and visibility of the tiles that need it; temporal filter, shading,
/// exposure, the host's picture with an overlay, a copy of the visibility for the host to read, and
/// a view that nobody asked for.
pub fn shadow_frame(graph: &mut Graph<'_>, lights: u32) {
    let screen = |format| ImageDesc::new(format, WIDTH, HEIGHT);
    let target = graph.import_image("target", target(screen(vk::Format::R8G8B8A8_UNORM)));
    let read_back = graph.import_buffer("read-back", read_back());
    let depth = graph.create_image("depth", screen(vk::Format::D32_SFLOAT));
    let normal = graph.create_image("normal", screen(vk::Format::R16G16_SNORM));
    let filtered = graph.history_image("filtered", screen(vk::Format::R32_SFLOAT));
    let visibility = screen(vk::Format::R32_SFLOAT).layers(lights);
    let mut visibility = graph.create_image("visibility", visibility);

    let mut pass = graph.pass("g-buffer", PassKind::Graphics);
    let normal = pass.color(normal, Load::Clear([0.0; 4]));
    let depth = pass.depth(depth, Load::Clear([0.0; 4]));

    for light in 0..lights {
        let desc = ImageDesc::new(vk::Format::D32_SFLOAT, MAP, MAP);
        let map = graph.create_image(format!("map {light}"), desc);
        let mut pass = graph.pass(format!("map of light {light}"), PassKind::Graphics);
        let map = pass.depth(map, Load::Clear([1.0; 4]));

        let desc = ImageDesc::new(vk::Format::R32G32_SFLOAT, MAP / 4, MAP / 4).mips(LEVELS);
        let mut bounds = graph.create_image(format!("bounds {light}"), desc);
        for mip in 0..LEVELS {
            let name = format!("bounds of light {light}, level {mip}");
            let mut pass = graph.pass(name, PassKind::Compute);
            match mip {
                0 => pass.read(map, SAMPLED),
                _ => pass.read_part(bounds, ImagePart::mip(mip - 1), SAMPLED),
            }
            bounds = pass.overwrite_part(bounds, ImagePart::mip(mip), WRITE);
        }

        let counts = graph.create_buffer(format!("counts {light}"), BufferDesc { size: 16 });
        let mut pass = graph.pass(format!("reset of light {light}"), PassKind::Transfer);
        let counts = pass.overwrite(counts, Access::Clear);

        let size = u64::from(WIDTH.div_ceil(8) * HEIGHT.div_ceil(8)) * 4;
        let tiles = graph.create_buffer(format!("tiles {light}"), BufferDesc { size });
        let mut pass = graph.pass(format!("tiles of light {light}"), PassKind::Compute);
        pass.read(depth, SAMPLED);
        pass.read(normal, SAMPLED);
        pass.read(bounds, SAMPLED);
        let counts = pass.write(counts, Access::StorageReadWrite(Stage::Compute));
        let tiles = pass.overwrite(tiles, WRITE);
        let layer = ImagePart {
            base_layer: light,
            ..ImagePart::mip(0)
        };
        visibility = pass.overwrite_part(visibility, layer, WRITE);

        let mut pass = graph.pass(format!("visibility of light {light}"), PassKind::Compute);
        pass.read(counts, Access::Indirect);
        pass.read(tiles, Access::StorageRead(Stage::Compute));
        pass.read(depth, SAMPLED);
        pass.read(normal, SAMPLED);
        pass.read(map, SAMPLED);
        visibility = pass.write_part(visibility, layer, WRITE);
    }

    let mut pass = graph.pass("filter", PassKind::Compute);
    pass.read(depth, SAMPLED);
    pass.read_part(visibility, ImagePart::mip(0), SAMPLED);
    if let Some(previous) = filtered.previous {
        pass.read(previous, SAMPLED);
    }
    let filtered = pass.overwrite(filtered.current, WRITE);

    let color = graph.create_image("color", screen(vk::Format::R16G16B16A16_SFLOAT));
    let mut pass = graph.pass("shade", PassKind::Compute);
    for image in [depth, normal, visibility, filtered] {
        pass.read(image, SAMPLED);
    }
    let color = pass.overwrite(color, WRITE);

    let exposure = graph.create_buffer("exposure", BufferDesc { size: 16 });
    let mut pass = graph.pass("exposure", PassKind::Compute);
    pass.read(color, SAMPLED);
    let exposure = pass.overwrite(exposure, WRITE);

    let mut pass = graph.pass("picture", PassKind::Graphics);
    pass.read(color, Access::Sampled(Stage::Fragment));
    pass.read(exposure, Access::Uniform(Stage::Fragment));
    let target = pass.color(target, Load::Discard);

    let mut pass = graph.pass("overlay", PassKind::Graphics);
    let _ = pass.color(target, Load::Keep);

    let mut pass = graph.pass("read back", PassKind::Transfer);
    pass.read(filtered, Access::CopyRead);
    let part = BufferPart {
        offset: 0,
        size: u64::from(WIDTH * HEIGHT) * 4,
    };
    let _ = pass.overwrite_part(read_back, part, Access::CopyWrite);

    let view = graph.create_image("view of the normals", screen(vk::Format::R8G8B8A8_UNORM));
    let mut pass = graph.pass("view of the normals", PassKind::Compute);
    pass.read(normal, SAMPLED);
    let _ = pass.overwrite(view, WRITE);
}

/// A picture of a swap chain, to be shown next.
fn target(desc: ImageDesc) -> HostImage {
    HostImage {
        image: vk::Image::from_raw(1),
        desc,
        usage: vk::ImageUsageFlags::COLOR_ATTACHMENT,
        enter: ImageState {
            layout: vk::ImageLayout::UNDEFINED,
            stages: vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
            access: vk::AccessFlags2::NONE,
        },
        leave: ImageState {
            layout: vk::ImageLayout::PRESENT_SRC_KHR,
            ..ImageState::UNDEFINED
        },
    }
}

fn read_back() -> HostBuffer {
    HostBuffer {
        buffer: vk::Buffer::from_raw(2),
        desc: BufferDesc {
            size: u64::from(WIDTH * HEIGHT) * 4,
        },
        usage: vk::BufferUsageFlags::TRANSFER_DST,
        enter: BufferState::IDLE,
        leave: BufferState::HOST_READ,
    }
}
