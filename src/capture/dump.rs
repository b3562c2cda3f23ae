//! Images of a frame by name, as `antumbra graph` prints them, brought back to memory.

use super::frame::CaptureError;
use crate::graph::{Graph, ImageDesc, ImageId};
use crate::renderer::Frame;
use ash::vk;
use std::ops::Range;

/// An image of a frame in host memory.
#[derive(Clone, Debug, PartialEq)]
pub struct CapturedImage {
    /// As it was asked for.
    pub name: String,
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// Numbers of the array layers that `planes` holds, ascending.
    pub layers: Vec<u32>,
    /// What the values are.
    pub content: ImageContent,
    /// Values of each channel of each layer, channels first: `layers * channels` planes.
    pub planes: Vec<Samples>,
}

/// What the values of a [`CapturedImage`] are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageContent {
    /// Whatever the texels hold.
    Values,
    /// Unit vectors along the world's axes, X, Y and Z; all 0 where nothing was hit.
    Normals,
}

/// One value a texel, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Of a float or normalised format.
    Float(Vec<f32>),
    /// Of an unsigned integer format.
    Uint(Vec<u32>),
}

impl CapturedImage {
    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.planes.len() / self.layers.len().max(1)
    }

    /// Names of the channels: `Y` for one, `X`, `Y`, `Z` for normals, else `R`, `G`, `B`, `A`.
    pub fn channel_names(&self) -> &'static [&'static str] {
        match (self.content, self.channels()) {
            (ImageContent::Normals, _) => &["X", "Y", "Z"],
            (_, 0 | 1) => &["Y"],
            (_, count) => &["R", "G", "B", "A"][..count.min(4)],
        }
    }
}

/// Names that stand for an image of the frame, whatever that is called in the graph.
pub const FRIENDLY_NAMES: [&str; 5] = [
    "depth",
    "normal",
    "shading_normal",
    "visibility",
    "visibility_bound",
];

/// A dump on its way: what is copied, and what becomes of it.
pub(super) struct Dump {
    name: String,
    format: TexelFormat,
    content: ImageContent,
    /// What to copy. The second of two says where something was hit.
    pub sources: Vec<Source>,
}

/// A mip level of some layers of an image.
#[derive(Clone, Copy)]
pub(super) struct Source {
    pub image: ImageId,
    pub mip: u32,
    pub first_layer: u32,
    pub layers: u32,
    pub width: u32,
    pub height: u32,
    pub texel_bytes: u64,
}

impl Source {
    fn new(image: ImageId, desc: &ImageDesc, mip: u32, layers: Range<u32>, bytes: usize) -> Self {
        Self {
            image,
            mip,
            first_layer: layers.start,
            layers: layers.end - layers.start,
            width: (desc.width >> mip).max(1),
            height: (desc.height >> mip).max(1),
            texel_bytes: bytes as u64,
        }
    }

    /// Bytes of all its texels.
    pub fn bytes(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height) * u64::from(self.layers) * self.texel_bytes
    }
}

impl Dump {
    /// Finds the image called `name`: a friendly name or one of the graph, the latter also as
    /// `NAME[LAYER]` or `NAME[LAYER,LEVEL]`.
    pub fn find(graph: &Graph<'_>, frame: &Frame, name: &str) -> Result<Self, CaptureError> {
        let gbuffer = &frame.gbuffer;
        let friendly = match name {
            "depth" => Some((gbuffer.view_depth, ImageContent::Values)),
            "normal" => Some((gbuffer.geometric_normal, ImageContent::Normals)),
            "shading_normal" => Some((gbuffer.shading_normal, ImageContent::Normals)),
            "visibility" => (frame.visibility.first()).map(|id| (*id, ImageContent::Values)),
            "visibility_bound" => {
                let bound = frame.masks.first().and_then(|mask| mask.error_bound);
                bound.map(|id| (id, ImageContent::Values))
            }
            _ => None,
        };
        if let Some((image, content)) = friendly {
            let mut dump = Self::whole(graph, image, name, 0, None)?;
            if content == ImageContent::Normals {
                dump.content = content;
                let hit = Self::whole(graph, gbuffer.view_depth, name, 0, None)?;
                dump.sources.extend(hit.sources);
            }
            return Ok(dump);
        }
        if let Some(image) = graph.image_named(name) {
            return Self::whole(graph, image, name, 0, None);
        }
        if let Some((base, layer, mip)) = split_part(name)
            && let Some(image) = graph.image_named(base)
        {
            return Self::whole(graph, image, name, mip, Some(layer));
        }
        let graph_names = graph.image_names().map(str::to_string);
        let have = FRIENDLY_NAMES.iter().map(ToString::to_string);
        Err(CaptureError::NoSuchImage {
            name: name.into(),
            have: have.chain(graph_names).collect(),
        })
    }

    fn whole(
        graph: &Graph<'_>,
        image: ImageId,
        name: &str,
        mip: u32,
        layer: Option<u32>,
    ) -> Result<Self, CaptureError> {
        let Some(desc) = graph.image_desc(image) else {
            unreachable!("the graph has just named this image");
        };
        let layers = layer.map_or(0..desc.layers, |layer| layer..layer.saturating_add(1));
        if layers.end > desc.layers || mip >= desc.mips {
            return Err(CaptureError::NoSuchPart {
                name: name.into(),
                layers: desc.layers,
                mips: desc.mips,
            });
        }
        let Some(format) = TexelFormat::of(desc.format) else {
            return Err(CaptureError::DumpFormat {
                name: name.into(),
                format: desc.format,
            });
        };
        let source = Source::new(image, &desc, mip, layers, format.texel_bytes());
        Ok(Self {
            name: name.into(),
            format,
            content: ImageContent::Values,
            sources: vec![source],
        })
    }

    /// The image out of the bytes of each of its sources.
    pub fn decode(&self, bytes: &[&[u8]]) -> CapturedImage {
        let main = self.sources[0];
        let part = |at: usize| bytes.get(at).copied().unwrap_or_default();
        let planes = match self.content {
            ImageContent::Values => self.format.planes(part(0), main.layers as usize),
            ImageContent::Normals => normals(part(0), part(1)),
        };
        CapturedImage {
            name: self.name.clone(),
            width: main.width,
            height: main.height,
            layers: (main.first_layer..main.first_layer + main.layers).collect(),
            content: self.content,
            planes,
        }
    }
}

/// `NAME[LAYER]` and `NAME[LAYER,LEVEL]` taken apart.
fn split_part(text: &str) -> Option<(&str, u32, u32)> {
    let (base, part) = text.strip_suffix(']')?.rsplit_once('[')?;
    let (layer, mip) = part.split_once(',').unwrap_or((part, "0"));
    Some((base, layer.trim().parse().ok()?, mip.trim().parse().ok()?))
}

/// Unit vectors out of octahedral texels; zero where the depth is.
fn normals(texels: &[u8], depths: &[u8]) -> Vec<Samples> {
    let mut axes = [Vec::new(), Vec::new(), Vec::new()];
    let (texels, depths) = (texels.as_chunks().0, depths.as_chunks().0);
    for (texel, depth) in texels.iter().zip(depths) {
        let hit = f32::from_ne_bytes(*depth) != 0.0;
        let unit = if hit {
            unit_from_octahedral(u32::from_ne_bytes(*texel))
        } else {
            [0.0; 3]
        };
        for (axis, value) in axes.iter_mut().zip(unit) {
            axis.push(value);
        }
    }
    axes.map(Samples::Float).into()
}

/// `unpack_unit` of `common/octahedral.glsl`.
fn unit_from_octahedral(bits: u32) -> [f32; 3] {
    let snorm = |bits: u32| f32::from(bits as u16 as i16).max(-32767.0) / 32767.0;
    let (x, y) = (snorm(bits), snorm(bits >> 16));
    let z = 1.0 - x.abs() - y.abs();
    let (x, y) = if z < 0.0 {
        let sign = |v: f32| if v >= 0.0 { 1.0 } else { -1.0 };
        ((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y))
    } else {
        (x, y)
    };
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}

/// How texels lie in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct TexelFormat {
    channels: usize,
    number: Number,
}

/// The form of one channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Number {
    Float32,
    Float16,
    Uint32,
    Uint16,
    Uint8,
    Unorm16,
    Unorm8,
    /// sRGB but for alpha.
    Srgb8,
    Snorm16,
    Snorm8,
}

impl Number {
    fn bytes(self) -> usize {
        match self {
            Self::Float32 | Self::Uint32 => 4,
            Self::Float16 | Self::Uint16 | Self::Unorm16 | Self::Snorm16 => 2,
            Self::Uint8 | Self::Unorm8 | Self::Srgb8 | Self::Snorm8 => 1,
        }
    }

    fn is_integer(self) -> bool {
        matches!(self, Self::Uint32 | Self::Uint16 | Self::Uint8)
    }

    /// The bytes of one channel, little-endian as the device's, in the low end of a word.
    fn float(self, bits: u32) -> f32 {
        match self {
            Self::Float32 => f32::from_bits(bits),
            Self::Float16 => float_from_half(bits as u16),
            Self::Unorm16 => bits as f32 / 65535.0,
            Self::Unorm8 => bits as f32 / 255.0,
            Self::Srgb8 => linear_from_srgb(bits as f32 / 255.0),
            Self::Snorm16 => (f32::from(bits as u16 as i16) / 32767.0).max(-1.0),
            Self::Snorm8 => (f32::from(bits as u8 as i8) / 127.0).max(-1.0),
            Self::Uint32 | Self::Uint16 | Self::Uint8 => bits as f32,
        }
    }
}

impl TexelFormat {
    fn of(format: vk::Format) -> Option<Self> {
        use vk::Format as F;
        let (channels, number) = match format {
            F::R32_SFLOAT | F::D32_SFLOAT => (1, Number::Float32),
            F::R32G32_SFLOAT => (2, Number::Float32),
            F::R32G32B32A32_SFLOAT => (4, Number::Float32),
            F::R16_SFLOAT => (1, Number::Float16),
            F::R16G16_SFLOAT => (2, Number::Float16),
            F::R16G16B16A16_SFLOAT => (4, Number::Float16),
            F::R32_UINT => (1, Number::Uint32),
            F::R32G32_UINT => (2, Number::Uint32),
            F::R32G32B32A32_UINT => (4, Number::Uint32),
            F::R16_UINT => (1, Number::Uint16),
            F::R16G16_UINT => (2, Number::Uint16),
            F::R16G16B16A16_UINT => (4, Number::Uint16),
            F::R8_UINT => (1, Number::Uint8),
            F::R8G8_UINT => (2, Number::Uint8),
            F::R8G8B8A8_UINT => (4, Number::Uint8),
            F::R16_UNORM | F::D16_UNORM => (1, Number::Unorm16),
            F::R16G16_UNORM => (2, Number::Unorm16),
            F::R16G16B16A16_UNORM => (4, Number::Unorm16),
            F::R8_UNORM => (1, Number::Unorm8),
            F::R8G8_UNORM => (2, Number::Unorm8),
            F::R8G8B8A8_UNORM => (4, Number::Unorm8),
            F::R8G8B8A8_SRGB => (4, Number::Srgb8),
            F::R16_SNORM => (1, Number::Snorm16),
            F::R16G16_SNORM => (2, Number::Snorm16),
            F::R16G16B16A16_SNORM => (4, Number::Snorm16),
            F::R8_SNORM => (1, Number::Snorm8),
            F::R8G8_SNORM => (2, Number::Snorm8),
            F::R8G8B8A8_SNORM => (4, Number::Snorm8),
            _ => return None,
        };
        Some(Self { channels, number })
    }

    fn texel_bytes(self) -> usize {
        self.channels * self.number.bytes()
    }

    /// The channels of all layers out of tightly packed texels, layer after layer.
    fn planes(self, bytes: &[u8], layers: usize) -> Vec<Samples> {
        let (layer_bytes, size) = (bytes.len() / layers.max(1), self.number.bytes());
        let mut planes = Vec::new();
        for layer in bytes.chunks_exact(layer_bytes.max(1)) {
            for channel in 0..self.channels {
                let number = match self.number {
                    Number::Srgb8 if channel == 3 => Number::Unorm8,
                    number => number,
                };
                let bits = layer.chunks_exact(self.texel_bytes()).map(|texel| {
                    let bytes = &texel[channel * size..(channel + 1) * size];
                    (bytes.iter().rev()).fold(0, |bits, byte| (bits << 8) | u32::from(*byte))
                });
                planes.push(if self.number.is_integer() {
                    Samples::Uint(bits.collect())
                } else {
                    Samples::Float(bits.map(|bits| number.float(bits)).collect())
                });
            }
        }
        planes
    }
}

fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

/// IEEE 754 half precision.
fn float_from_half(half: u16) -> f32 {
    let sign = u32::from(half & 0x8000) << 16;
    let (exponent, fraction) = (u32::from(half >> 10) & 0x1f, u32::from(half & 0x3ff));
    match exponent {
        // Below the normal numbers: steps of 2^-24.
        0 => f32::from_bits(sign | (fraction as f32 / 16_777_216.0).to_bits()),
        31 => f32::from_bits(sign | 0x7f80_0000 | (fraction << 13)),
        _ => f32::from_bits(sign | ((exponent + 112) << 23) | (fraction << 13)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves() {
        for (half, float) in [
            (0x0000, 0.0),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0400, 6.103_515_6e-5),
            (0x0001, 5.960_464_5e-8),
            (0x03ff, 6.097_555e-5),
            (0x3555, 0.333_251_95),
            (0x7c00, f32::INFINITY),
            (0xfc00, f32::NEG_INFINITY),
        ] {
            assert_eq!(float_from_half(half), float, "{half:04x}");
        }
        assert!(float_from_half(0x7e00).is_nan());
        assert!(float_from_half(0x8000).is_sign_negative());
    }

    #[test]
    fn unit_vectors_come_out_of_octahedral_bits() {
        let pack = |x: i16, y: i16| u32::from(x as u16) | (u32::from(y as u16) << 16);
        for (bits, wanted) in [
            (pack(0, 0), [0.0, 0.0, 1.0]),
            (pack(32767, 0), [1.0, 0.0, 0.0]),
            (pack(-32767, 0), [-1.0, 0.0, 0.0]),
            (pack(-32768, 0), [-1.0, 0.0, 0.0]),
            (pack(0, 32767), [0.0, 1.0, 0.0]),
            (pack(0, -32767), [0.0, -1.0, 0.0]),
            (pack(32767, 32767), [0.0, 0.0, -1.0]),
        ] {
            let unit = unit_from_octahedral(bits);
            let near = unit.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1.0e-6);
            assert!(near, "{bits:08x}: {unit:?}");
        }
    }

    #[test]
    fn normals_are_zero_where_nothing_was_hit() {
        let texels: Vec<u8> = [0u32; 2].iter().flat_map(|t| t.to_ne_bytes()).collect();
        let depths: Vec<u8> = [0.0f32, 3.0].iter().flat_map(|t| t.to_ne_bytes()).collect();
        let planes = normals(&texels, &depths);
        let float = |values: &[f32]| Samples::Float(values.into());
        let wanted = [float(&[0.0; 2]), float(&[0.0; 2]), float(&[0.0, 1.0])];
        assert_eq!(planes, wanted);
    }

    #[test]
    fn texels_are_taken_apart_by_layer_and_channel() {
        let format = |format| match TexelFormat::of(format) {
            Some(format) => format,
            None => panic!("{format:?}"),
        };
        let bytes: Vec<u8> = [1u32, 2, 0x0102_0304, 4]
            .iter()
            .flat_map(|v| v.to_ne_bytes())
            .collect();
        let uint = |values: &[u32]| Samples::Uint(values.into());
        assert_eq!(
            format(vk::Format::R32_UINT).planes(&bytes, 2),
            [uint(&[1, 2]), uint(&[0x0102_0304, 4])]
        );
        assert_eq!(
            format(vk::Format::R32G32_UINT).planes(&bytes, 1),
            [uint(&[1, 0x0102_0304]), uint(&[2, 4])]
        );
        assert_eq!(
            format(vk::Format::R8G8_UNORM).planes(&[0, 255, 51, 0], 1),
            [
                Samples::Float(vec![0.0, 0.2]),
                Samples::Float(vec![1.0, 0.0])
            ]
        );
        assert_eq!(
            format(vk::Format::R16_SNORM).planes(&[0, 0x80, 0xff, 0x7f], 1),
            [Samples::Float(vec![-1.0, 1.0])]
        );
        let half = 128.0 / 255.0;
        let wanted = [0.0, 1.0, 0.215_860_53, half].map(|v| Samples::Float(vec![v]));
        let srgb = format(vk::Format::R8G8B8A8_SRGB);
        assert_eq!(srgb.planes(&[0, 255, 128, 128], 1), wanted);
        assert!(TexelFormat::of(vk::Format::BC1_RGB_UNORM_BLOCK).is_none());
    }

    #[test]
    fn parts_of_images() {
        assert_eq!(split_part("map[2]"), Some(("map", 2, 0)));
        assert_eq!(split_part("map 0:[x][2,1]"), Some(("map 0:[x]", 2, 1)));
        for not in [
            "map",
            "map[",
            "map]",
            "map[x]",
            "map[-1]",
            "map[1,]",
            "map[1][a]",
        ] {
            assert_eq!(split_part(not), None, "{not}");
        }
    }
}
