//! The passes that find visibility from the maps of a line's points.

use super::outreach::{OutreachMaps, Spans, add_outreach};
use super::views::MOST_SECTORS;
use super::{NAME, OessOptions, OessParams, Outreach};
use crate::geometry::{TileList, tile_counts};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, BufferId, Graph, ImageDesc, ImageId, PassKind, Stage};
use crate::shadow::map::ShadowMap;
use crate::shadow::receivers::add_receivers;
use crate::shadow::{ShadowInputs, ShadowMask};
use ash::vk;
use bytemuck::{Pod, Zeroable};

/// Push constants of `oess/visibility.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct VisibilityPush {
    stage: u32,
    stride: u32,
}

/// In names of what is done for segments.
const PARTS: &str = "_parts";

/// `STAGE_ONLY` and so on in `oess/visibility.comp`.
#[derive(Clone, Copy, Debug)]
enum Stages {
    Only,
    First,
    Second,
}

/// What the passes write.
#[derive(Clone, Copy, Debug)]
struct Images {
    /// R32F.
    visibility: ImageId,
    /// RG32F: what of it counts for the line's first end and for its last.
    influences: ImageId,
    /// RG32_UINT: `oess/params.glsl`.
    open: ImageId,
}

/// A line and the maps of its points.
pub(super) struct Line {
    pub options: OessOptions,
    pub data: OessParams,
    /// `data` on the device.
    pub params: BufferId,
    pub maps: ShadowMap,
}

impl Line {
    /// All segments for all pixels.
    pub fn add_whole(&self, graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>) -> ShadowMask {
        let all = self.add_rows(graph, inputs, "rows", 1.0);
        let spans = Spans {
            suffix: "",
            stride: 1,
            rows: all,
        };
        let outreach = add_outreach(graph, inputs, &self.options, &self.maps, &self.data, spans);
        let (list, images) = start(graph, inputs);
        let stage = (Stages::Only, 1);
        let images = self.add_visibility(graph, inputs, outreach, stage, list, images);
        ShadowMask::new(images.visibility)
    }

    /// The line's two ends for all pixels, and its segments for those that they leave open.
    pub fn add_by_need(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        segments: u32,
    ) -> ShadowMask {
        let (options, maps, data) = (&self.options, &self.maps, &self.data);
        let all = self.add_rows(graph, inputs, "rows", 1.0);
        let ends = Spans {
            suffix: "",
            stride: segments,
            rows: all,
        };
        let outreach = add_outreach(graph, inputs, options, maps, data, ends);
        let (list, images) = start(graph, inputs);
        let stage = (Stages::First, segments);
        let images = self.add_visibility(graph, inputs, outreach, stage, list, images);
        let rows = self.add_rows(graph, inputs, "open_rows", 0.0);
        let (open, rows) = add_open(graph, inputs, list, images.open, rows);
        let parts = Spans {
            suffix: PARTS,
            stride: 1,
            rows,
        };
        let outreach = add_outreach(graph, inputs, options, maps, data, parts);
        let stage = (Stages::Second, 1);
        let images = self.add_visibility(graph, inputs, outreach, stage, open, images);
        ShadowMask::new(images.visibility)
    }

    /// Rows of the maps, all asked for or none.
    fn add_rows(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        word: &str,
        value: f32,
    ) -> ImageId {
        let name = format!("{NAME}.{word} {}", inputs.light_name);
        let rows = self.data.counts[3];
        let desc = ImageDesc::new(vk::Format::R32_UINT, rows, MOST_SECTORS as u32);
        let image = graph.create_image(name.clone(), desc);
        let mut pass = graph.pass(name, PassKind::Transfer);
        let image = pass.overwrite(image, Access::Clear);
        pass.record(move |ctx| ctx.clear_image(image, [value; 4]));
        image
    }

    fn add_visibility(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        outreach: OutreachMaps,
        (stage, stride): (Stages, u32),
        list: TileList,
        mut images: Images,
    ) -> Images {
        let suffix = if matches!(stage, Stages::Second) {
            PARTS
        } else {
            ""
        };
        let name = format!("{NAME}.visibility{suffix} {}", inputs.light_name);
        let ShadowMap {
            depth: map_depth,
            ids: Some(map_ids),
        } = self.maps
        else {
            unreachable!("triangle numbers were asked for");
        };
        let (gbuffer, ids, params) = (inputs.gbuffer, inputs.ids, self.params);
        let (view_params, part) = inputs.view_params;
        let compute = Access::Sampled(Stage::Compute);
        let mut pass = graph.pass(name, PassKind::Compute);
        pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
        pass.read(params, Access::Uniform(Stage::Compute));
        let read = [
            gbuffer.view_depth,
            gbuffer.geometric_normal,
            gbuffer.ids,
            map_depth,
            map_ids,
            outreach.forward,
            outreach.backward,
            ids.triangles,
        ];
        for image in read.into_iter().chain(ids.mask_images()) {
            pass.read(image, compute);
        }
        list.read(&mut pass);
        let both = Access::StorageReadWrite(Stage::Compute);
        if matches!(stage, Stages::Second) {
            images.visibility = pass.write(images.visibility, both);
            images.influences = pass.write(images.influences, both);
            images.open = pass.write(images.open, both);
        } else {
            let written = Access::StorageWrite(Stage::Compute);
            images.visibility = pass.write(images.visibility, written);
            images.influences = pass.overwrite(images.influences, written);
            images.open = pass.overwrite(images.open, written);
        }
        let masked = u32::from(inputs.scene.has_masks());
        let options = self.options;
        let push = VisibilityPush {
            stage: stage as u32,
            stride,
        };
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, view_params).part(part),
                Bind::uniform(1, params),
                Bind::sampled(2, gbuffer.view_depth, nearest),
                Bind::sampled(3, gbuffer.geometric_normal, nearest),
                Bind::sampled(4, gbuffer.ids, nearest),
                Bind::sampled(5, map_depth, nearest).array(),
                Bind::sampled(6, map_ids, nearest).array(),
                Bind::sampled(7, outreach.forward, nearest).array(),
                Bind::sampled(8, outreach.backward, nearest).array(),
                Bind::sampled(9, ids.triangles, nearest),
                Bind::sampled(10, ids.materials, nearest),
                Bind::sampled(11, ids.triangle_uvs, nearest),
                Bind::sampled(12, ids.footprints, nearest),
                Bind::storage_image(13, images.visibility),
                Bind::uniform(14, list.arguments),
                Bind::sampled(15, list.tiles, nearest),
                Bind::storage_image(16, images.influences),
                Bind::storage_image(17, images.open),
            ];
            let maps = [Outreach::Hull, Outreach::Silhouettes];
            let candidates = u32::from(!maps.contains(&options.outreach));
            // Four steps of the grid that vertices snap to: SNAP_TEXELS in hard.glsl.
            let steps = ctx.gpu().info().limits.sub_pixel_precision_bits.min(16);
            let snap = 4.0 / (1u32 << steps) as f32;
            let pipeline = ComputePipelineDesc {
                constants: vec![
                    (0, snap.to_bits()),
                    (1, masked),
                    (2, u32::from(options.exact)),
                    (3, options.walk),
                    (4, u32::from(options.gaps)),
                    (5, candidates),
                    (6, u32::from(options.by_place)),
                ],
                ..ComputePipelineDesc::new(&spirv::OESS_VISIBILITY_COMP)
            };
            ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
            list.dispatch(ctx)
        });
        images
    }
}

/// The tiles to work on, and images that are done outside of them.
fn start(graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>) -> (TileList, Images) {
    let name = &inputs.light_name;
    let receivers = add_receivers(graph, inputs, NAME, inputs.light.shape.bounding_radius());
    let [width, height] = inputs.camera.size();
    let mut image = |word: &str, format| {
        let desc = ImageDesc::new(format, width, height);
        graph.create_image(format!("{NAME}.{word} {name}"), desc)
    };
    let images = Images {
        visibility: receivers.visibility,
        influences: image("influences", vk::Format::R32G32_SFLOAT),
        open: image("open", vk::Format::R32G32_UINT),
    };
    (receivers.list, images)
}

/// The tiles of a list that have open pixels, and the rows of the maps that these ask for.
fn add_open(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    list: TileList,
    open_parts: ImageId,
    rows: ImageId,
) -> (TileList, ImageId) {
    let name = &inputs.light_name;
    let size = inputs.camera.size();
    let mut open = TileList::create(graph, &format!("{NAME}.open_tiles {name}"), size);
    let mut pass = graph.pass(format!("{NAME}.open_start {name}"), PassKind::Transfer);
    open.clear(&mut pass);
    let cleared = open;
    pass.record(move |ctx| cleared.record_clear(ctx));

    let mut pass = graph.pass(format!("{NAME}.open {name}"), PassKind::Compute);
    pass.read(list.arguments, Access::Uniform(Stage::Compute));
    pass.read(list.tiles, Access::Sampled(Stage::Compute));
    pass.read(open_parts, Access::Sampled(Stage::Compute));
    open.fill(&mut pass);
    let rows = pass.write(rows, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, list.arguments),
            Bind::sampled(1, list.tiles, nearest),
            Bind::sampled(2, open_parts, nearest),
            Bind::storage_buffer(3, open.arguments),
            Bind::storage_image(4, open.tiles),
            Bind::storage_image(5, rows),
        ];
        let shader = &spirv::OESS_OPEN_COMP;
        ctx.bind_compute(&ComputePipelineDesc::new(shader), &bindings, &[])?;
        let [across, down] = tile_counts(size);
        ctx.dispatch(shader.groups([across * down, 1, 1]));
        Ok(())
    });
    (open, rows)
}
