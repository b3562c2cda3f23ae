//! Materials: metallic-roughness, or specular-glossiness brought to it.

use std::borrow::Cow;
use std::collections::BTreeMap;

use glam::{DAffine2, DVec2, Vec3, Vec4};
use gltf::Document;
use gltf::texture::WrappingMode;

use super::mesh::LocalPrimitive;
use super::textures::Images;
use super::{LoadOptions, SceneError, Source};
use crate::scene::{AlphaMode, Material, Texture, TextureImage, Wrap};

/// A material before its images are read.
pub(super) struct Surface {
    /// Without texture.
    material: Material,
    pub(super) base_texture: Option<TextureUse>,
    /// Index of the document's image: roughness in G, metallic in B.
    metallic_roughness: Option<usize>,
    /// Index of the document's image.
    emissive: Option<usize>,
}

/// A texture as a material uses it.
pub(super) struct TextureUse {
    /// Index of the document's image.
    image: usize,
    wrap: [Wrap; 2],
    /// Which TEXCOORD_n.
    pub(super) tex_coord: u32,
    /// From the file's coordinates to the image's.
    pub(super) transform: DAffine2,
}

/// All materials, and last the one for primitives that name none.
pub(super) fn read(document: &Document) -> Vec<Surface> {
    let mut surfaces: Vec<Surface> = document.materials().map(|m| read_one(&m)).collect();
    surfaces.push(Surface {
        // What glTF says of a material without any property.
        material: Material {
            metallic: 1.0,
            ..Material::default()
        },
        base_texture: None,
        metallic_roughness: None,
        emissive: None,
    });
    surfaces
}

fn read_one(material: &gltf::Material<'_>) -> Surface {
    let pbr = material.pbr_metallic_roughness();
    let emissive = material.emissive_texture();
    let strength = material.emissive_strength().unwrap_or(1.0);
    let mut surface = Surface {
        material: Material {
            name: material.name().unwrap_or_default().into(),
            base_color: unit_color(pbr.base_color_factor()),
            metallic: pbr.metallic_factor().clamp(0.0, 1.0),
            roughness: pbr.roughness_factor().clamp(0.0, 1.0),
            emissive: strength * Vec3::from_array(material.emissive_factor()),
            double_sided: material.double_sided(),
            alpha_mode: match material.alpha_mode() {
                gltf::material::AlphaMode::Opaque => AlphaMode::Opaque,
                gltf::material::AlphaMode::Blend => AlphaMode::Blend,
                gltf::material::AlphaMode::Mask => AlphaMode::Mask {
                    cutoff: material.alpha_cutoff().unwrap_or(0.5),
                },
            },
            base_texture: None,
        },
        base_texture: pbr.base_color_texture().map(|info| texture_use(&info)),
        metallic_roughness: pbr.metallic_roughness_texture().map(|info| image_of(&info)),
        emissive: emissive.map(|info| image_of(&info)),
    };
    // The diffuse part is what shows; how glossy it is follows from the factor alone.
    if let Some(diffuse) = material.pbr_specular_glossiness() {
        surface.material.base_color = unit_color(diffuse.diffuse_factor());
        surface.material.metallic = 0.0;
        surface.material.roughness = (1.0 - diffuse.glossiness_factor()).clamp(0.0, 1.0);
        surface.base_texture = diffuse.diffuse_texture().map(|info| texture_use(&info));
        surface.metallic_roughness = None;
    }
    surface
}

fn unit_color(color: [f32; 4]) -> Vec4 {
    Vec4::from_array(color).clamp(Vec4::ZERO, Vec4::ONE)
}

fn image_of(info: &gltf::texture::Info<'_>) -> usize {
    info.texture().source().index()
}

fn texture_use(info: &gltf::texture::Info<'_>) -> TextureUse {
    let sampler = info.texture().sampler();
    let wrap = |mode| match mode {
        WrappingMode::Repeat => Wrap::Repeat,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
        WrappingMode::ClampToEdge => Wrap::Clamp,
    };
    let mut used = TextureUse {
        image: image_of(info),
        wrap: [wrap(sampler.wrap_s()), wrap(sampler.wrap_t())],
        tex_coord: info.tex_coord(),
        transform: DAffine2::IDENTITY,
    };
    if let Some(transform) = info.texture_transform() {
        let double = |[x, y]: [f32; 2]| DVec2::new(f64::from(x), f64::from(y));
        // Counter-clockwise as seen on the image, whose v points down: KHR_texture_transform's own
        // listing has it the other way round (issue 1563 of its repository), its test model and
        // the viewers do not.
        used.transform = DAffine2::from_scale_angle_translation(
            double(transform.scale()),
            -f64::from(transform.rotation()),
            double(transform.offset()),
        );
        used.tex_coord = transform.tex_coord().unwrap_or(used.tex_coord);
    }
    used
}

/// The scene's materials and images. Only images of materials that a primitive has are read.
/// Primitives with a colour of their own get a material of their own, after all others.
pub(super) fn finish(
    source: Source<'_>,
    document: &Document,
    buffers: &[Cow<'_, [u8]>],
    options: &LoadOptions,
    surfaces: Vec<Surface>,
    meshes: &mut BTreeMap<usize, Vec<LocalPrimitive>>,
) -> Result<(Vec<Material>, Vec<TextureImage>), SceneError> {
    let mut used = vec![false; surfaces.len()];
    for primitive in meshes.values().flatten() {
        if let Some(used) = used.get_mut(primitive.material) {
            *used = true;
        }
    }
    let mut images = Images::new(source, document, buffers, options);
    let mut materials = Vec::with_capacity(surfaces.len());
    for (surface, used) in surfaces.into_iter().zip(used) {
        let mut material = surface.material;
        if used {
            if let Some(texture) = surface.base_texture {
                material.base_texture = Some(Texture {
                    image: images.keep(texture.image)?,
                    wrap: texture.wrap,
                });
            }
            if let Some(image) = surface.metallic_roughness
                && (material.metallic > 0.0 || material.roughness > 0.0)
            {
                let [_, roughness, metallic, _] = images.mean(image)?;
                material.roughness *= roughness;
                material.metallic *= metallic;
            }
            if let Some(image) = surface.emissive
                && material.emissive != Vec3::ZERO
            {
                let [r, g, b, _] = images.mean_linear(image)?;
                material.emissive *= Vec3::new(r, g, b);
            }
        }
        materials.push(material);
    }
    let mut coloured = BTreeMap::new();
    for primitive in meshes.values_mut().flatten() {
        let Some(color) = primitive.color else {
            continue;
        };
        let key = (primitive.material, color.to_array().map(f32::to_bits));
        primitive.material = *coloured.entry(key).or_insert_with(|| {
            let mut material = materials[primitive.material].clone();
            material.base_color *= color;
            materials.push(material);
            materials.len() - 1
        });
    }
    Ok((materials, images.into_images()))
}
