//! The passes that find each texel's occluding edge.

use super::options::{Find, OessOptions, Outreach};
use super::{NAME, OessParams, ShadowInputs};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, ImageDesc, ImageId, ImagePart, PassKind, Stage};
use crate::shadow::map::ShadowMap;
use ash::vk;
use bytemuck::{Pod, Zeroable};

/// What to look for edges between.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spans {
    /// In names of passes and images.
    pub suffix: &'static str,
    /// Segments from one end to the next.
    pub stride: u32,
    /// R32_UINT, a row for each sector: 0 for a row of the maps that nobody asks for.
    pub rows: ImageId,
}

/// Outreach maps, R32_UINT: `oess/params.glsl`. A layer for each sector and span.
#[derive(Clone, Copy, Debug)]
pub(super) struct OutreachMaps {
    /// From segments' first ends.
    pub forward: ImageId,
    /// From their last ends.
    pub backward: ImageId,
}

/// Push constants of `oess/outreach.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct HullPush {
    shift: f32,
    backward: u32,
    sector: u32,
}

/// Push constants of `oess/row.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct RowPush {
    here: [f32; 4],
    there: [f32; 4],
    shift: f32,
    backward: u32,
}

/// One layer of the outreach maps: the map of one end, in one direction.
struct Layer {
    name: String,
    map: ImagePart,
    part: ImagePart,
    size: [u32; 2],
    sector: u32,
    push: RowPush,
}

pub(super) fn add_outreach(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    options: &OessOptions,
    maps: &ShadowMap,
    params: &OessParams,
    of: Spans,
) -> OutreachMaps {
    let [sectors, points, width, height] = params.counts;
    let (spans, suffix) = ((points - 1) / of.stride, of.suffix);
    let layers = sectors * spans;
    let name = &inputs.light_name;
    let size = if layers == 0 { [1, 1] } else { [width, height] };
    let mut direction = |backward: bool| {
        let word = if backward { "backward" } else { "forward" };
        let desc = ImageDesc::new(vk::Format::R32_UINT, size[0], size[1]).layers(layers.max(1));
        let mut image = graph.create_image(format!("{NAME}.{word}{suffix} {name}"), desc);
        // Steps that each row took: for those who ask for the image.
        let steps = ImageDesc::new(vk::Format::R32_UINT, size[1], 1).layers(layers.max(1));
        let mut steps = graph.create_image(format!("{NAME}.{word}{suffix}_steps {name}"), steps);
        for layer in 0..layers.max(1) {
            let (sector, first) = (layer / spans, layer % spans * of.stride);
            let (near, far) = match backward {
                false => (first, first + of.stride),
                true => (first + of.stride, first),
            };
            let map = sector * points + near;
            let point = |point: u32| {
                let [x, y, z, step] = params.start;
                let along = step * point as f32;
                let axis = params.axis;
                [
                    x + axis[0] * along,
                    y + axis[1] * along,
                    z + axis[2] * along,
                    0.0,
                ]
            };
            let at = Layer {
                name: format!("{name}.{word}{suffix}.{layer}"),
                map: ImagePart::layer(if layers == 0 { 0 } else { map }),
                part: ImagePart::layer(layer),
                size,
                sector,
                push: RowPush {
                    here: point(near),
                    there: point(far),
                    shift: params.shift[sector as usize][0] * of.stride as f32,
                    backward: u32::from(backward),
                },
            };
            [image, steps] = match options.outreach {
                Outreach::Hull | Outreach::Silhouettes => {
                    add_hull(graph, maps, &at, of.rows, [image, steps])
                }
                _ => add_candidates(graph, inputs, options, maps, &at, [image, steps]),
            };
        }
        image
    };
    OutreachMaps {
        forward: direction(false),
        backward: direction(true),
    }
}

/// Tangents to the hull of each row.
fn add_hull(
    graph: &mut Graph<'_>,
    maps: &ShadowMap,
    at: &Layer,
    rows_asked: ImageId,
    [image, steps]: [ImageId; 2],
) -> [ImageId; 2] {
    let (depth, map, part) = (maps.depth, at.map, at.part);
    let mut pass = graph.pass(format!("{NAME}.outreach {}", at.name), PassKind::Compute);
    pass.read_part(depth, map, Access::Sampled(Stage::Compute));
    pass.read(rows_asked, Access::Sampled(Stage::Compute));
    // A row reads nothing but what the same invocation wrote.
    let image = pass.overwrite_part(image, part, Access::StorageWrite(Stage::Compute));
    let steps = pass.overwrite_part(steps, part, Access::StorageWrite(Stage::Compute));
    let push = HullPush {
        shift: at.push.shift,
        backward: at.push.backward,
        sector: at.sector,
    };
    let rows = at.size[1];
    pass.record(move |ctx| {
        let shader = &spirv::OESS_OUTREACH_COMP;
        let bindings = [
            Bind::sampled(0, depth, SamplerDesc::nearest()).part(map),
            Bind::storage_image(1, image).part(part),
            Bind::storage_image(2, steps).part(part),
            Bind::sampled(3, rows_asked, SamplerDesc::nearest()),
        ];
        let pipeline = ComputePipelineDesc::new(shader);
        ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
        ctx.dispatch(shader.groups([rows, 1, 1]));
        Ok(())
    });
    [image, steps]
}

/// Occluding edges among the texels, and what they reach.
fn add_candidates(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    options: &OessOptions,
    maps: &ShadowMap,
    at: &Layer,
    [image, steps]: [ImageId; 2],
) -> [ImageId; 2] {
    let (depth, map, part, push) = (maps.depth, at.map, at.part, at.push);
    let [width, height] = at.size;
    let sampled = Access::Sampled(Stage::Compute);
    let written = Access::StorageWrite(Stage::Compute);
    let desc = ImageDesc::new(vk::Format::R32_UINT, width, height);
    let edges = graph.create_image(format!("{NAME}.edges {}", at.name), desc);
    let triangles = inputs.ids.triangles;
    let Some(map_ids) = maps.ids else {
        unreachable!("triangle numbers were asked for");
    };
    let mut pass = graph.pass(format!("{NAME}.edges {}", at.name), PassKind::Compute);
    pass.read_part(depth, map, sampled);
    pass.read_part(map_ids, map, sampled);
    pass.read(triangles, sampled);
    let edges = pass.overwrite(edges, written);
    let image = pass.overwrite_part(image, part, written);
    let steps = pass.overwrite_part(steps, part, written);
    let find = match options.find {
        Find::Fold => 0,
        Find::Location => 1,
        Find::Tilt => 2,
        Find::Both => 3,
    };
    pass.record(move |ctx| {
        let shader = &spirv::OESS_EDGES_COMP;
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::sampled(0, depth, nearest).part(map),
            Bind::sampled(1, map_ids, nearest).part(map),
            Bind::sampled(2, triangles, nearest),
            Bind::storage_image(3, edges),
            Bind::storage_image(4, image).part(part),
            Bind::storage_image(5, steps).part(part),
        ];
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, find)],
            ..ComputePipelineDesc::new(shader)
        };
        ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
        ctx.dispatch(shader.groups([width, height, 1]));
        Ok(())
    });

    let mut pass = graph.pass(format!("{NAME}.outreach {}", at.name), PassKind::Compute);
    let both = Access::StorageReadWrite(Stage::Compute);
    pass.read_part(depth, map, sampled);
    pass.read(edges, sampled);
    let image = pass.write_part(image, part, both);
    let steps = pass.write_part(steps, part, both);
    let scatter = options.outreach == Outreach::Scatter;
    let search = options.outreach == Outreach::Search;
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::sampled(0, depth, nearest).part(map),
            Bind::sampled(1, edges, nearest),
            Bind::storage_image(2, image).part(part),
            Bind::storage_image(3, steps).part(part),
        ];
        let (pipeline, groups) = if scatter {
            let shader = &spirv::OESS_SCATTER_COMP;
            let pipeline = ComputePipelineDesc::new(shader);
            (pipeline, shader.groups([width, height, 1]))
        } else {
            let pipeline = ComputePipelineDesc {
                constants: vec![(0, u32::from(search))],
                ..ComputePipelineDesc::new(&spirv::OESS_SCAN_COMP)
            };
            (pipeline, [height, 1, 1])
        };
        ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
        ctx.dispatch(groups);
        Ok(())
    });
    [image, steps]
}
