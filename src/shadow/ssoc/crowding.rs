//! How crowded the distortion maps are: a texel holds one edge of all whose bands cover it.

use super::{Bands, NAME};
use crate::gpu::{Blend, ComputePipelineDesc, GraphicsPipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, ImageDesc, Load, PassKind, Stage};
use crate::shadow::{ShadowInputs, Tally};
use ash::vk;
use std::collections::BTreeMap;

/// Counts a row of a map: `ssoc/crowding.comp`.
const COUNTS: u32 = 3;

/// Share of crowded texels from which on the light has outgrown the method.
const OUTGROWN: f64 = 0.5;

impl Bands {
    /// Declares the passes that count: `silhouettes`, the edges on the list; `band_texels`, texels of
    /// all maps that an edge's band covers (without the fans around ends, which its neighbours' cover
    /// too); `crowded_texels`, those that several edges' bands cover. Nobody pays for them who does not
    /// read them.
    pub(super) fn add_counts(&self, graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>) -> Tally {
        let name = &inputs.light_name;
        let side = self.side;
        let maps = 2 * self.layers;
        let desc = ImageDesc::new(vk::Format::R32_UINT, COUNTS, (maps * side).max(1));
        let counts = graph.create_image(format!("{NAME}.counts {name}"), desc);
        let mut pass = graph.pass(format!("{NAME}.no_counts {name}"), PassKind::Transfer);
        let mut counts = pass.overwrite(counts, Access::Clear);
        pass.record(move |ctx| ctx.clear_image(counts, [0.0; 4]));
        for layer in 0..maps {
            let desc = ImageDesc::new(vk::Format::R16_SFLOAT, side, side);
            let number = graph.create_image(format!("{NAME}.collisions {name}.{layer}"), desc);
            let pass_name = format!("{NAME}.collisions {name}.{layer}");
            let mut pass = graph.pass(pass_name, PassKind::Graphics);
            let number = pass.color(number, Load::Clear([0.0; 4]));
            let fragment = Some(&spirv::SSOC_COLLISIONS_FRAG);
            let mut pipeline = GraphicsPipelineDesc::new(&spirv::SSOC_BANDS_VERT, fragment);
            pipeline.blend = Blend::Add;
            pipeline.constants = vec![(0, 1)];
            self.draw(pass, inputs, layer, pipeline, None);

            let arguments = self.list.arguments;
            let pass_name = format!("{NAME}.crowding {name}.{layer}");
            let mut pass = graph.pass(pass_name, PassKind::Compute);
            pass.read(number, Access::Sampled(Stage::Compute));
            pass.read(arguments, Access::Uniform(Stage::Compute));
            counts = pass.write(counts, Access::StorageWrite(Stage::Compute));
            let written = counts;
            pass.record(move |ctx| {
                let shader = &spirv::SSOC_CROWDING_COMP;
                let bindings = [
                    Bind::sampled(0, number, SamplerDesc::nearest()),
                    Bind::uniform(1, arguments),
                    Bind::storage_image(2, written),
                ];
                let pipeline = ComputePipelineDesc::new(shader);
                ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&[side, layer]))?;
                ctx.dispatch(shader.groups([side, 1, 1]));
                Ok(())
            });
        }
        Tally {
            image: counts,
            count,
        }
    }
}

fn count(texels: &[u32]) -> Vec<(&'static str, u64)> {
    let rows = || texels.chunks_exact(COUNTS as usize);
    let sum = |at: usize| rows().map(|row| u64::from(row[at])).sum();
    let silhouettes = rows().map(|row| u64::from(row[2])).max();
    vec![
        ("silhouettes", silhouettes.unwrap_or(0)),
        ("band_texels", sum(0)),
        ("crowded_texels", sum(1)),
    ]
}

/// Says so if a light has outgrown the method.
pub(in crate::shadow) fn remark(counters: &BTreeMap<String, u64>) -> Option<String> {
    let of = |name: &str| counters.get(name).map(|n| *n as f64);
    let share = of("crowded_texels")? / of("band_texels")?.max(1.0);
    (share > OUTGROWN).then(|| {
        format!(
            "the light has outgrown the method: {:.0} % of the distortion maps' texels are wanted by \
             several edges, and each holds one",
            100.0 * share
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crowded_maps_are_remarked_upon() {
        let counted = |texels: &[u32]| {
            let counts = count(texels).into_iter();
            counts.map(|(name, n)| (name.to_string(), n)).collect()
        };
        let sparse: BTreeMap<_, _> = counted(&[10, 2, 7, 0, 0, 7]);
        let wanted = [
            ("band_texels", 10),
            ("crowded_texels", 2),
            ("silhouettes", 7),
        ];
        assert!(sparse.iter().map(|(k, n)| (k.as_str(), *n)).eq(wanted));
        assert_eq!(remark(&sparse), None);
        assert_eq!(remark(&counted(&[0; 3])), None);
        assert_eq!(remark(&BTreeMap::new()), None);
        let crowded = remark(&counted(&[10, 6, 7, 10, 6, 7])).unwrap();
        assert!(crowded.contains("60 %"), "{crowded}");
    }
}
