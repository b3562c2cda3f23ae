//! Lambert shading: an ambient term, then each light times its visibility.

use super::NamedLight;
use super::camera::PixelCamera;
use super::gbuffer::GBuffer;
use super::scene_buffers::SceneIds;
use crate::gpu::{Blend, GraphicsPipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, ImageDesc, ImageId, Load, PassKind, Stage};
use crate::light::AreaLight;
use crate::scene::Aabb;
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
#[derive(Clone, Copy, Pod, Zeroable)]
struct BasePush {
    ambient: [f32; 4],
    background: [f32; 4],
}

/// Push constants of `shade/light.frag`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct LightPush {
    /// Scene space, metres.
    pub eye: [f32; 3],
    /// 1/m; 0 for no limit.
    pub inverse_range: f32,
    /// As in [`PixelCamera`].
    pub corner_ray: [f32; 3],
    /// Cosine at which a spot cone begins to fade; 2 for no cone.
    pub cos_inner: f32,
    /// As in [`PixelCamera`].
    pub pixel_right: [f32; 3],
    /// Cosine at which a spot cone ends.
    pub cos_outer: f32,
    /// As in [`PixelCamera`].
    pub pixel_down: [f32; 3],
    /// 1 if it emits like a Lambert surface, 0 if the same all round.
    pub one_sided: f32,
    /// Centre, or the unit vector towards a sun.
    pub light: [f32; 3],
    /// 1, or 0 for a sun.
    pub positional: f32,
    /// Unit vector that the light emits along.
    pub direction: [f32; 3],
    /// Padding.
    pub unused: f32,
    /// Candela along the axis, or lux of a sun; linear RGB.
    pub intensity: [f32; 3],
    /// Padding.
    pub unused_too: f32,
}

impl LightPush {
    fn new(camera: &PixelCamera, light: &AreaLight) -> Self {
        let xyz = |row: [f32; 4]| [row[0], row[1], row[2]];
        let sun = light.shape.is_sun();
        let cone = light.spot.map(|cone| (cone.inner.cos(), cone.outer.cos()));
        let (cos_inner, cos_outer) = cone.unwrap_or((2.0, -1.0));
        Self {
            eye: xyz(camera.eye),
            inverse_range: light.range.map_or(0.0, |range| 1.0 / range),
            corner_ray: xyz(camera.corner_ray),
            cos_inner,
            pixel_right: xyz(camera.pixel_right),
            cos_outer,
            pixel_down: xyz(camera.pixel_down),
            one_sided: f32::from(u8::from(light.shape.is_one_sided())),
            light: if sun { -light.direction } else { light.center }.to_array(),
            positional: f32::from(u8::from(!sun)),
            direction: light.direction.to_array(),
            unused: 0.0,
            intensity: (light.color * light.candela()).to_array(),
            unused_too: 0.0,
        }
    }
}

/// Declares the shading passes; returns RGBA32F radiance.
pub fn add_shading(
    graph: &mut Graph<'_>,
    ids: &SceneIds,
    gbuffer: &GBuffer,
    camera: PixelCamera,
    lights: &[NamedLight],
    visibility: &[ImageId],
    ambient: Ambient,
) -> ImageId {
    let [width, height] = camera.size();
    let desc = ImageDesc::new(vk::Format::R32G32B32A32_SFLOAT, width, height);
    let radiance = graph.create_image("radiance", desc);
    let (triangle_ids, triangles, materials) = (gbuffer.ids, ids.triangles, ids.materials);
    let nearest = SamplerDesc::nearest();
    let scene_bindings = move || {
        vec![
            Bind::sampled(0, triangle_ids, nearest),
            Bind::sampled(1, triangles, nearest),
            Bind::sampled(2, materials, nearest),
        ]
    };

    let mut pass = graph.pass("shade.base", PassKind::Graphics);
    for image in [triangle_ids, triangles, materials] {
        pass.read(image, Access::Sampled(Stage::Fragment));
    }
    let mut radiance = pass.color(radiance, Load::Discard);
    pass.record(move |ctx| {
        let fragment = Some(&spirv::SHADE_BASE_FRAG);
        let pipeline = GraphicsPipelineDesc::new(&spirv::SCREEN_FULLSCREEN_VERT, fragment);
        let push = BasePush {
            ambient: ambient.surface.extend(0.0).to_array(),
            background: ambient.background.extend(0.0).to_array(),
        };
        ctx.bind_graphics(pipeline, &scene_bindings(), bytemuck::bytes_of(&push))?;
        ctx.draw(0, 3, 1);
        Ok(())
    });

    let (view_depth, normal) = (gbuffer.view_depth, gbuffer.shading_normal);
    for (named, mask) in lights.iter().zip(visibility) {
        let mask = *mask;
        let push = LightPush::new(&camera, &named.light);
        let mut pass = graph.pass(format!("shade.light {}", named.name), PassKind::Graphics);
        for image in [triangle_ids, triangles, materials, view_depth, normal, mask] {
            pass.read(image, Access::Sampled(Stage::Fragment));
        }
        radiance = pass.color(radiance, Load::Keep);
        pass.record(move |ctx| {
            let fragment = Some(&spirv::SHADE_LIGHT_FRAG);
            let mut pipeline = GraphicsPipelineDesc::new(&spirv::SCREEN_FULLSCREEN_VERT, fragment);
            pipeline.blend = Blend::Add;
            let mut bindings = scene_bindings();
            bindings.push(Bind::sampled(3, view_depth, nearest));
            bindings.push(Bind::sampled(4, normal, nearest));
            bindings.push(Bind::sampled(5, mask, nearest));
            ctx.bind_graphics(pipeline, &bindings, bytemuck::bytes_of(&push))?;
            ctx.draw(0, 3, 1);
            Ok(())
        });
    }
    radiance
}
