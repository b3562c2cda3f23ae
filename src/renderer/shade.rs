//! Shading: an ambient term and what surfaces give off, then each light times its visibility.

use super::NamedLight;
use crate::geometry::{GBuffer, PixelCamera, SceneBuffers, SceneIds};
use crate::gpu::{Blend, GraphicsPipelineDesc, SamplerDesc, spirv};
use crate::graph::{
    Access, Bind, BufferId, BufferPart, Graph, ImageDesc, ImageId, Load, PassKind, Stage,
};
use crate::scene::Aabb;
use crate::shadow::{ShadowMask, shape_number};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// Light from nowhere in particular, so that shadows are not black.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ambient {
    /// Radiance of a white surface, linear RGB.
    pub surface: Vec3,
    /// Radiance where nothing was hit, linear RGB.
    pub background: Vec3,
}

impl Ambient {
    /// An eighth of what the lights together give, unshadowed, at the middle of the scene.
    pub fn of(lights: &[NamedLight], bounds: Aabb) -> Self {
        let total: Vec3 = lights
            .iter()
            .map(|named| {
                let light = &named.light;
                let square = if light.shape.is_sun() {
                    1.0
                } else {
                    // Not nearer than a quarter of the scene: a lamp in its middle is not infinite.
                    let least = (0.25 * bounds.radius()).max(f32::MIN_POSITIVE);
                    (light.center - bounds.center()).length().max(least).powi(2)
                };
                light.color * (light.candela() / square)
            })
            .sum();
        let surface = total * (0.125 * std::f32::consts::FRAC_1_PI);
        Self {
            surface,
            background: surface * 2.0 * Vec3::new(0.8, 0.9, 1.0),
        }
    }
}

/// Push constants of `shade/base.frag`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct BasePush {
    /// The camera.
    pub camera: PixelCamera,
    /// Radiance of a white surface.
    pub ambient: [f32; 4],
    /// Radiance where nothing was hit.
    pub background: [f32; 4],
}

/// What shading is made of.
#[derive(Clone, Copy, Debug)]
pub struct ShadingInputs<'a> {
    /// The scene on the device.
    pub scene: &'a SceneBuffers,
    /// Its resources in the graph.
    pub ids: &'a SceneIds,
    /// The surface at each pixel.
    pub gbuffer: &'a GBuffer,
    /// The picture's camera.
    pub camera: PixelCamera,
    /// The lights.
    pub lights: &'a [NamedLight],
    /// What the technique made for each light; lights beyond the list have no shadows.
    pub masks: &'a [ShadowMask],
    /// A uniform buffer with [`ViewParams`](crate::shadow::ViewParams) of each light.
    pub params: BufferId,
    /// Where in it each light's are.
    pub parts: &'a [BufferPart],
    /// Light from nowhere in particular.
    pub ambient: Ambient,
    /// For each light, why nothing in view gets any of it, if so; lights beyond the list may light all.
    pub unlit: &'a [Option<&'static str>],
    /// For each light, whether all of it is above the plane of every surface in view; lights beyond the list
    /// may be below some.
    pub above: &'a [bool],
}

/// Images that shading makes, of the picture's size.
#[derive(Clone, Copy, Debug)]
pub struct Shading {
    /// RGBA8 sRGB base colour.
    pub albedo: ImageId,
    /// RGBA32F linear radiance; alpha 1 on surfaces, 0 elsewhere.
    pub radiance: ImageId,
}

/// What hides a light, as `SHADOW` of `shade/light.frag`: what its mask says, each surface's own horizon, nothing.
const MASK: u32 = 0;
const HORIZON: u32 = 1;
const NO_SHADOW: u32 = 2;

/// Declares the shading passes.
pub fn add_shading(graph: &mut Graph<'_>, inputs: &ShadingInputs<'_>) -> Shading {
    let [width, height] = inputs.camera.size();
    let image = |format| ImageDesc::new(format, width, height);
    let radiance = graph.create_image("radiance", image(vk::Format::R32G32B32A32_SFLOAT));
    let albedo = graph.create_image("shade.albedo", image(vk::Format::R8G8B8A8_SRGB));
    let finish = graph.create_image("shade.finish", image(vk::Format::R8G8_UNORM));
    let (gbuffer, ids) = (*inputs.gbuffer, *inputs.ids);
    let nearest = SamplerDesc::nearest();
    let fragment = Access::Sampled(Stage::Fragment);

    let mut pass = graph.pass("shade.base", PassKind::Graphics);
    for image in [gbuffer.ids, gbuffer.view_depth, ids.triangles] {
        pass.read(image, fragment);
    }
    for image in [ids.triangle_uvs, ids.materials, ids.texels] {
        pass.read(image, fragment);
    }
    let mut radiance = pass.color(radiance, Load::Discard);
    let albedo = pass.color(albedo, Load::Discard);
    let finish = pass.color(finish, Load::Discard);
    let push = BasePush {
        camera: inputs.camera,
        ambient: (inputs.ambient.surface)
            .extend(inputs.scene.textured_triangle_count() as f32)
            .to_array(),
        background: inputs.ambient.background.extend(0.0).to_array(),
    };
    let textured = u32::from(inputs.scene.textured_triangle_count() > 0);
    pass.record(move |ctx| {
        let fragment = Some(&spirv::SHADE_BASE_FRAG);
        let mut pipeline = GraphicsPipelineDesc::new(&spirv::SCREEN_FULLSCREEN_VERT, fragment);
        pipeline.constants = vec![(0, textured)];
        let bindings = [
            Bind::sampled(0, gbuffer.ids, nearest),
            Bind::sampled(1, ids.triangles, nearest),
            Bind::sampled(2, ids.materials, nearest),
            Bind::sampled(3, ids.triangle_uvs, nearest),
            Bind::sampled(4, ids.texels, nearest),
            Bind::sampled(5, gbuffer.view_depth, nearest),
        ];
        ctx.bind_graphics(pipeline, &bindings, bytemuck::bytes_of(&push))?;
        ctx.draw(0, 3, 1);
        Ok(())
    });

    let shiny = u32::from(inputs.scene.is_shiny());
    for (index, named) in inputs.lights.iter().enumerate() {
        if let Some(reason) = inputs.unlit.get(index).copied().flatten() {
            graph.skip(format!("shade.light {}", named.name), reason);
            continue;
        }
        let (params, part) = (inputs.params, inputs.parts[index]);
        let shape = shape_number(&named.light.shape);
        // Where no image is needed any other fills its place.
        let (shadow, horizon, mask) = match inputs.masks.get(index) {
            None => (NO_SHADOW, shape, gbuffer.view_depth),
            Some(mask) => match &mask.unblocked {
                Some(_) if inputs.above.get(index) == Some(&true) => {
                    (NO_SHADOW, shape, gbuffer.view_depth)
                }
                Some(shape) => (HORIZON, shape_number(shape), gbuffer.view_depth),
                None => (MASK, shape, mask.visibility),
            },
        };
        let mut pass = graph.pass(format!("shade.light {}", named.name), PassKind::Graphics);
        pass.read_part(params, part, Access::Uniform(Stage::Fragment));
        let images = [
            gbuffer.view_depth,
            gbuffer.geometric_normal,
            gbuffer.shading_normal,
            albedo,
            finish,
            mask,
        ];
        let read = if shadow == MASK { 6 } else { 5 };
        for image in &images[..read] {
            pass.read(*image, fragment);
        }
        radiance = pass.color(radiance, Load::Keep);
        pass.record(move |ctx| {
            let fragment = Some(&spirv::SHADE_LIGHT_FRAG);
            let mut pipeline = GraphicsPipelineDesc::new(&spirv::SCREEN_FULLSCREEN_VERT, fragment);
            pipeline.blend = Blend::Add;
            pipeline.constants = vec![(0, shape), (1, shiny), (2, shadow), (3, horizon)];
            let mut bindings = vec![Bind::uniform(0, params).part(part)];
            let sampled = images.iter().zip(1..);
            bindings
                .extend(sampled.map(|(image, binding)| Bind::sampled(binding, *image, nearest)));
            ctx.bind_graphics(pipeline, &bindings, &[])?;
            ctx.draw(0, 3, 1);
            Ok(())
        });
    }
    Shading { albedo, radiance }
}
