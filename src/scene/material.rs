//! Surfaces and their images.

use glam::{Vec2, Vec3, Vec4};

/// How the alpha of a surface counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Ignored: the surface is solid.
    #[default]
    Opaque,
    /// Below `cutoff` the surface has a hole, to light as well.
    Mask {
        /// 0 or more.
        cutoff: f32,
    },
    /// See-through in the picture; solid to light.
    Blend,
}

/// A surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// For messages; may be empty.
    pub name: String,
    /// Linear RGB and alpha, each 0 to 1. Multiplies `base_texture`.
    pub base_color: Vec4,
    /// Colour and alpha over the surface; [`Primitive::uvs`](super::Primitive::uvs) places it.
    pub base_texture: Option<Texture>,
    /// Part of the surface that is metal, 0 to 1: it reflects in its base colour and has no
    /// diffuse part.
    pub metallic: f32,
    /// glTF's roughness, 0 (a mirror) to 1.
    pub roughness: f32,
    /// Light that the surface gives off in the picture, linear RGB, each 0 or more. It lights
    /// nothing else.
    pub emissive: Vec3,
    /// Shaded on both sides. Light is blocked from both sides in any case.
    pub double_sided: bool,
    /// How alpha counts.
    pub alpha_mode: AlphaMode,
}

impl Default for Material {
    /// White, rough, opaque, single-sided, no metal.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec4::ONE,
            base_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            emissive: Vec3::ZERO,
            double_sided: false,
            alpha_mode: AlphaMode::Opaque,
        }
    }
}

impl Material {
    /// The alpha below which this surface has holes, if it can have any.
    pub fn mask_cutoff(&self) -> Option<f32> {
        match self.alpha_mode {
            AlphaMode::Mask { cutoff } => Some(cutoff),
            AlphaMode::Opaque | AlphaMode::Blend => None,
        }
    }
}

/// An image over a surface, bilinear from its full resolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Texture {
    /// Index into [`Scene::images`](super::Scene::images).
    pub image: usize,
    /// What lies beyond 0 to 1 in u and in v.
    pub wrap: [Wrap; 2],
}

/// How an image goes on beyond its borders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// It begins anew.
    #[default]
    Repeat,
    /// It begins anew, mirrored every other time.
    Mirror,
    /// Its border goes on.
    Clamp,
}

impl Wrap {
    /// The texel that stands at `index` in a row of `size` (at least 1).
    pub fn texel(self, index: i64, size: u32) -> u32 {
        let size = i64::from(size.max(1));
        let at = match self {
            Self::Repeat => index.rem_euclid(size),
            Self::Mirror => {
                let at = index.rem_euclid(2 * size);
                at.min(2 * size - 1 - at)
            }
            Self::Clamp => index.clamp(0, size - 1),
        };
        at as u32
    }
}

/// An image in memory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TextureImage {
    /// For messages.
    pub name: String,
    /// Width in texels, at least 1.
    pub width: u32,
    /// Height in texels, at least 1.
    pub height: u32,
    /// RGB in sRGB and linear alpha, row by row from the top (v = 0).
    pub texels: Vec<[u8; 4]>,
}

impl TextureImage {
    /// Alpha at `uv`, bilinear between texel centres: texel (i, j) has its centre at
    /// ((i + 0.5) / width, (j + 0.5) / height). 1 where `uv` is not finite. Twin of
    /// `is_hole_at` in `common/holes.glsl`.
    pub fn alpha(&self, uv: Vec2, wrap: [Wrap; 2]) -> f32 {
        let size = Vec2::new(self.width as f32, self.height as f32);
        let place = uv * size - 0.5;
        if !place.is_finite() {
            return 1.0;
        }
        // Far beyond the image a float has no fraction left; integers have to hold what there is.
        let corner = place.floor().clamp(Vec2::splat(-1.0e9), Vec2::splat(1.0e9));
        let part = (place - corner).clamp(Vec2::ZERO, Vec2::ONE);
        let at = |dx: i64, dy: i64| {
            let x = wrap[0].texel(corner.x as i64 + dx, self.width);
            let y = wrap[1].texel(corner.y as i64 + dy, self.height);
            let index = y as usize * self.width as usize + x as usize;
            f32::from(self.texels.get(index).map_or(255, |texel| texel[3])) / 255.0
        };
        let top = at(0, 0) * (1.0 - part.x) + at(1, 0) * part.x;
        let bottom = at(0, 1) * (1.0 - part.x) + at(1, 1) * part.x;
        top * (1.0 - part.y) + bottom * part.y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wraps() {
        let row = |wrap: Wrap| (-4..8).map(|i| wrap.texel(i, 3)).collect::<Vec<_>>();
        assert_eq!(row(Wrap::Repeat), [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1]);
        assert_eq!(row(Wrap::Mirror), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]);
        assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2, 2]);
    }

    #[test]
    fn alpha_is_bilinear_between_texel_centres() {
        let image = TextureImage {
            name: String::new(),
            width: 2,
            height: 1,
            texels: vec![[0, 0, 0, 0], [0, 0, 0, 255]],
        };
        let alpha = |u: f32, wrap: Wrap| image.alpha(Vec2::new(u, 0.3), [wrap; 2]);
        assert_eq!(alpha(0.25, Wrap::Clamp), 0.0);
        assert_eq!(alpha(0.75, Wrap::Clamp), 1.0);
        assert_eq!(alpha(0.5, Wrap::Clamp), 0.5);
        assert_eq!(alpha(0.0, Wrap::Clamp), 0.0);
        assert_eq!(alpha(0.0, Wrap::Repeat), 0.5);
        assert_eq!(alpha(1.0, Wrap::Mirror), 1.0);
        assert_eq!(alpha(f32::NAN, Wrap::Repeat), 1.0);
        assert_eq!(alpha(1.0e30, Wrap::Clamp), 1.0);
    }
}
