//! Passes over all triangles: small ones with an invocation each, large ones with one for each row.

use super::layers::LIST_WIDTH;
use super::{NAME, ShadowInputs};
use crate::geometry::Draw;
use crate::gpu::{ComputePipelineDesc, SamplerDesc, Shader, spirv};
use crate::graph::{
    Access, Bind, BufferDesc, BufferId, Graph, ImageDesc, ImageId, ImagePart, PassBuilder,
    PassKind, Stage,
};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use std::cmp::Reverse;
use std::ops::Range;

/// Most workgroups in one direction of a dispatch.
const MOST_GROUPS: u32 = 32_768;

/// Most runs of triangles: `runs` in `mdi/coverage.glsl`.
const MOST_RUNS: usize = 14;

/// `Push` in `mdi/coverage.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Push {
    view: u32,
    groups_across: u32,
    count: u32,
    unused: u32,
    runs: [[u32; 2]; MOST_RUNS],
}

/// What the passes of all views share.
pub(super) struct Coverage {
    params: BufferId,
    constants: Vec<(u32, u32)>,
    push: Push,
    /// Of those that may block the light.
    triangles: u32,
    side: u32,
    /// Of the image of boundaries.
    finest: ImagePart,
    /// The large triangles of each view.
    large: Vec<Large>,
}

/// A list of triangles, and the arguments of a dispatch over it.
#[derive(Clone, Copy)]
struct Large {
    arguments: BufferId,
    list: ImageId,
}

impl Coverage {
    pub(super) fn new(
        inputs: &ShadowInputs<'_>,
        params: BufferId,
        side: u32,
        (runs, finest): (&Runs, ImagePart),
    ) -> Self {
        let triangles = runs.triangles();
        let mut push = Push::zeroed();
        push.count = runs.0.len() as u32;
        let mut before = 0;
        for (entry, run) in push.runs.iter_mut().zip(&runs.0) {
            // Numbers of invocations that the run ends at, and what leads from them to its triangles.
            let end = before + (run.end - run.start);
            *entry = [end, run.start.wrapping_sub(before)];
            before = end;
        }
        Self {
            params,
            push,
            constants: vec![(0, u32::from(inputs.scene.has_masks()))],
            triangles,
            side,
            finest,
            large: Vec::new(),
        }
    }

    /// Counts depths and marks boundaries of a view; the images are the counts and the boundaries,
    /// whose finest level is marked.
    pub(super) fn add_count(
        &mut self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        view: u32,
        [mut counts, mut boundaries]: [ImageId; 2],
    ) -> [ImageId; 2] {
        let name = format!("{}.{view}", inputs.light_name);
        let finest = self.finest;
        let arguments =
            graph.create_buffer(format!("{NAME}.arguments {name}"), BufferDesc { size: 16 });
        let rows = self.triangles.div_ceil(LIST_WIDTH).max(1);
        let desc = ImageDesc::new(vk::Format::R32_UINT, LIST_WIDTH, rows);
        let list = graph.create_image(format!("{NAME}.large {name}"), desc);
        let groups = self.side.div_ceil(64);
        let mut pass = graph.pass(format!("{NAME}.start_count {name}"), PassKind::Transfer);
        let arguments = pass.overwrite(arguments, Access::Clear);
        pass.record(move |ctx| {
            ctx.update_buffer(arguments, 0, bytemuck::cast_slice(&[groups, 0, 1, 0]))
        });
        let mut pass = graph.pass(format!("{NAME}.count {name}"), PassKind::Compute);
        self.read(&mut pass, inputs);
        let storage = Access::StorageReadWrite(Stage::Compute);
        counts = pass.write(counts, storage);
        boundaries = pass.write_part(boundaries, finest, storage);
        let arguments = pass.write(arguments, storage);
        let list = pass.overwrite(list, Access::StorageWrite(Stage::Compute));
        let images = [
            Bind::storage_image(5, counts).array(),
            Bind::storage_image(6, boundaries).part(finest).array(),
        ];
        let mut bindings = images.to_vec();
        bindings.push(Bind::storage_buffer(7, arguments));
        bindings.push(Bind::storage_image(8, list));
        self.record(pass, inputs, (&spirv::MDI_COUNT_COMP, bindings), view, None);

        let large = Large { arguments, list };
        self.large.push(large);
        let mut pass = graph.pass(format!("{NAME}.count_large {name}"), PassKind::Compute);
        self.read(&mut pass, inputs);
        counts = pass.write(counts, storage);
        boundaries = pass.write_part(boundaries, finest, storage);
        let shader = &spirv::MDI_COUNT_LARGE_COMP;
        let bindings = vec![
            Bind::storage_image(5, counts).array(),
            Bind::storage_image(6, boundaries).part(finest).array(),
        ];
        large.read(&mut pass);
        self.record(pass, inputs, (shader, bindings), view, Some(large));
        [counts, boundaries]
    }

    /// Fills the lists of a view; the images are the counts, which end as 0, and the lists.
    pub(super) fn add_fill(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        view: u32,
        [mut counts, mut lists]: [ImageId; 2],
        heads: ImageId,
    ) -> [ImageId; 2] {
        let large = self.large[view as usize];
        for (shader, what, large) in [
            (&spirv::MDI_FILL_COMP, "fill", None),
            (&spirv::MDI_FILL_LARGE_COMP, "fill_large", Some(large)),
        ] {
            let name = format!("{NAME}.{what} {}.{view}", inputs.light_name);
            let mut pass = graph.pass(name, PassKind::Compute);
            self.read(&mut pass, inputs);
            counts = pass.write(counts, Access::StorageReadWrite(Stage::Compute));
            pass.read(heads, Access::Sampled(Stage::Compute));
            lists = pass.write(lists, Access::StorageWrite(Stage::Compute));
            if let Some(large) = large {
                large.read(&mut pass);
            }
            let bindings = vec![
                Bind::storage_image(5, counts).array(),
                Bind::sampled(6, heads, SamplerDesc::nearest()).array(),
                Bind::storage_image(7, lists),
            ];
            self.record(pass, inputs, (shader, bindings), view, large);
        }
        [counts, lists]
    }

    fn read(&self, pass: &mut PassBuilder<'_, '_>, inputs: &ShadowInputs<'_>) {
        pass.read(self.params, Access::Uniform(Stage::Compute));
        pass.read(inputs.ids.triangles, Access::Sampled(Stage::Compute));
        for image in inputs.ids.mask_images() {
            pass.read(image, Access::Sampled(Stage::Compute));
        }
    }

    fn record(
        &self,
        pass: PassBuilder<'_, '_>,
        inputs: &ShadowInputs<'_>,
        (shader, extra): (&'static Shader, Vec<Bind>),
        view: u32,
        large: Option<Large>,
    ) {
        let (params, ids) = (self.params, inputs.ids);
        let pipeline = ComputePipelineDesc {
            constants: self.constants.clone(),
            ..ComputePipelineDesc::new(shader)
        };
        let [groups, ..] = shader.groups([self.triangles, 1, 1]);
        let push = Push {
            view,
            groups_across: groups.clamp(1, MOST_GROUPS),
            ..self.push
        };
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let mut bindings = vec![
                Bind::uniform(0, params),
                Bind::sampled(1, ids.triangles, nearest),
                Bind::sampled(2, ids.materials, nearest),
                Bind::sampled(3, ids.triangle_uvs, nearest),
                Bind::sampled(4, ids.footprints, nearest),
            ];
            bindings.extend(extra);
            let Some(large) = large else {
                ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
                ctx.dispatch([push.groups_across, groups.div_ceil(push.groups_across), 1]);
                return Ok(());
            };
            bindings.push(Bind::uniform(8, large.arguments));
            bindings.push(Bind::sampled(9, large.list, nearest));
            ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
            ctx.dispatch_indirect(large.arguments, 0)
        });
    }
}

impl Large {
    fn read(&self, pass: &mut PassBuilder<'_, '_>) {
        pass.read(self.arguments, Access::Indirect);
        pass.read(self.arguments, Access::Uniform(Stage::Compute));
        pass.read(self.list, Access::Sampled(Stage::Compute));
    }
}

/// Triangles of a scene that may block the light: at most [`MOST_RUNS`] runs.
#[derive(Debug, PartialEq)]
pub(super) struct Runs(Vec<Range<u32>>);

impl Runs {
    /// Of the draws that may block; marks some more of them where there are too many gaps. The draws'
    /// triangles follow each other.
    pub(super) fn new(draws: &[Draw], blocks: &mut [bool]) -> Self {
        let mut parts: Vec<Range<usize>> = Vec::new();
        for index in (0..draws.len()).filter(|i| blocks[*i]) {
            match parts.last_mut() {
                Some(part) if part.end == index => part.end += 1,
                _ => parts.push(index..index + 1),
            }
        }
        let triangles = |part: &Range<usize>| {
            let (first, last) = (&draws[part.start], &draws[part.end - 1]);
            first.first_index / 3..(last.first_index + last.index_count) / 3
        };
        // The widest gaps stay.
        let gap = |i: &usize| Reverse(triangles(&(parts[*i - 1].end..parts[*i].start)).len());
        let mut gaps: Vec<usize> = (1..parts.len()).collect();
        gaps.sort_by_key(gap);
        gaps.truncate(MOST_RUNS - 1);
        gaps.sort_unstable();
        let ends = gaps
            .iter()
            .map(|i| parts[i - 1].end)
            .chain(parts.last().map(|last| last.end));
        let starts = parts.first().map(|first| first.start).into_iter();
        let starts = starts.chain(gaps.iter().map(|i| parts[*i].start));
        let parts: Vec<Range<usize>> = starts.zip(ends).map(|(start, end)| start..end).collect();
        for part in &parts {
            blocks[part.clone()].fill(true);
        }
        Self(parts.iter().map(triangles).collect())
    }

    fn triangles(&self) -> u32 {
        self.0.iter().map(|run| run.len() as u32).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Aabb;

    fn draws(counts: &[u32]) -> Vec<Draw> {
        let mut first_index = 0;
        let mut next = |triangles: &u32| {
            let draw = Draw {
                first_index,
                index_count: 3 * triangles,
                bounds: Aabb::EMPTY,
                corners: [glam::Vec3::ZERO; 8],
                mask: None,
            };
            first_index += draw.index_count;
            draw
        };
        counts.iter().map(&mut next).collect()
    }

    #[test]
    fn runs_are_those_of_what_blocks() {
        let mut blocks = [true, true, false, true];
        let runs = Runs::new(&draws(&[2, 3, 4, 5]), &mut blocks);
        assert_eq!(runs.0, [0..5, 9..14]);
        assert_eq!(runs.triangles(), 10);
        assert_eq!(Runs::new(&draws(&[2]), &mut [false]).0, []);
    }

    #[test]
    fn small_gaps_are_closed_where_there_are_too_many() {
        // Every other draw blocks; the gaps grow by a triangle each.
        let counts: Vec<u32> = (0..2 * MOST_RUNS as u32 + 3).map(|i| 1 + i / 2).collect();
        let mut blocks: Vec<bool> = (0..counts.len()).map(|i| i % 2 == 0).collect();
        let runs = Runs::new(&draws(&counts), &mut blocks);
        assert_eq!(runs.0.len(), MOST_RUNS);
        let kept = blocks.iter().filter(|blocks| !**blocks).count();
        assert_eq!(kept, MOST_RUNS - 1);
        assert!(blocks[1] && blocks[3] && !blocks[5]);
        assert_eq!(runs.0[0], 0..1 + 1 + 2 + 2 + 3);
    }
}
