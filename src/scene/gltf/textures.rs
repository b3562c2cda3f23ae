//! Images: PNG and JPEG from a bufferView, a data URI or a file beside the scene.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;

use gltf::Document;
use image::{DynamicImage, ImageDecoder as _, ImageFormat, ImageReader, Limits};

use super::{LoadOptions, SceneError, Source, buffers, element, shorten};
use crate::scene::TextureImage;

/// Reads the images of a file on demand, each once.
pub(super) struct Images<'a> {
    source: Source<'a>,
    document: &'a Document,
    buffers: &'a [Cow<'a, [u8]>],
    max_side: u32,
    /// Texels that may still be decoded.
    left: u64,
    /// From the document's index to that of the scene.
    kept: BTreeMap<usize, usize>,
    images: Vec<TextureImage>,
}

impl<'a> Images<'a> {
    pub(super) fn new(
        source: Source<'a>,
        document: &'a Document,
        buffers: &'a [Cow<'a, [u8]>],
        options: &LoadOptions,
    ) -> Self {
        Self {
            source,
            document,
            buffers,
            max_side: options.max_image_side,
            left: options.max_texels,
            kept: BTreeMap::new(),
            images: Vec::new(),
        }
    }

    /// All images that were asked for.
    pub(super) fn into_images(self) -> Vec<TextureImage> {
        self.images
    }

    /// The index into the scene's images of `image` of the document.
    pub(super) fn keep(&mut self, image: usize) -> Result<usize, SceneError> {
        if let Some(&kept) = self.kept.get(&image) {
            return Ok(kept);
        }
        let decoded = self.read(image)?;
        let json = self.document.as_json().images.get(image);
        let (width, height) = (decoded.width(), decoded.height());
        let texels = decoded.into_rgba8().into_raw();
        self.images.push(TextureImage {
            name: json
                .and_then(|json| {
                    let uri = json.uri.as_deref().filter(|uri| !uri.starts_with("data:"));
                    json.name.as_deref().filter(|name| !name.is_empty()).or(uri)
                })
                .map_or_else(|| format!("image {image}"), shorten),
            width,
            height,
            texels: texels.as_chunks::<4>().0.to_vec(),
        });
        self.kept.insert(image, self.images.len() - 1);
        Ok(self.images.len() - 1)
    }

    /// The mean over all texels of `image` of the document, RGBA, as stored: 0 to 1.
    pub(super) fn mean(&mut self, image: usize) -> Result<[f32; 4], SceneError> {
        self.mean_of(image, |byte| f64::from(byte) / 255.0)
    }

    /// The same with RGB made linear from sRGB first; alpha means nothing.
    pub(super) fn mean_linear(&mut self, image: usize) -> Result<[f32; 4], SceneError> {
        let linear: Vec<f64> = (0..=255u8).map(from_srgb).collect();
        self.mean_of(image, |byte| linear[usize::from(byte)])
    }

    fn mean_of(&mut self, image: usize, value: impl Fn(u8) -> f64) -> Result<[f32; 4], SceneError> {
        let sums = |texels: &mut dyn Iterator<Item = [u8; 4]>| {
            let mut counts = [[0u64; 256]; 4];
            let mut number = 0u64;
            for texel in texels {
                for (count, byte) in counts.iter_mut().zip(texel) {
                    count[usize::from(byte)] += 1;
                }
                number += 1;
            }
            (counts, number)
        };
        let (counts, number) = match self.kept.get(&image).and_then(|&at| self.images.get(at)) {
            Some(kept) => sums(&mut kept.texels.iter().copied()),
            None => {
                let texels = self.read(image)?.into_rgba8();
                sums(&mut texels.pixels().map(|pixel| pixel.0))
            }
        };
        Ok(counts.map(|counts| {
            let sum: f64 = (0..=255u8)
                .zip(counts)
                .map(|(byte, count)| value(byte) * count as f64)
                .sum();
            (sum / number.max(1) as f64) as f32
        }))
    }

    fn read(&mut self, image: usize) -> Result<DynamicImage, SceneError> {
        let Some(json) = self.document.as_json().images.get(image) else {
            let element = element("image", image, None);
            return Err(self.source.invalid(element, "it is missing"));
        };
        let element = element("image", image, json.name.as_deref());
        let invalid = |reason: String| self.source.invalid(element.clone(), reason);
        let data: Cow<'_, [u8]> = match (json.buffer_view, &json.uri) {
            (Some(view), _) => (self.document.views().nth(view.value()))
                .and_then(|view| {
                    let buffer = self.buffers.get(view.buffer().index())?;
                    buffer.get(view.offset()..view.offset().checked_add(view.length())?)
                })
                .map(Cow::Borrowed)
                .ok_or_else(|| {
                    invalid(format!(
                        "bufferView {} reaches beyond its buffer",
                        view.value()
                    ))
                })?,
            (None, Some(uri)) => {
                // A file without end is cut off, and then the decoder complains.
                let limit = self.left.saturating_mul(8).saturating_add(1 << 16);
                let data = buffers::read_uri(self.source.path, uri, limit);
                Cow::Owned(data.map_err(|error| SceneError::Buffer {
                    file: self.source.label(),
                    element: element.clone(),
                    uri: shorten(uri),
                    source: error,
                })?)
            }
            (None, None) => return Err(invalid("it has neither `bufferView` nor `uri`".into())),
        };
        let format = match image::guess_format(&data) {
            Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) => format,
            Ok(other) => {
                return Err(SceneError::Unsupported {
                    file: self.source.label(),
                    element,
                    what: format!("an image of format {other:?}"),
                    remedy: "export it as PNG or JPEG",
                });
            }
            Err(_) => return Err(invalid("it is neither PNG nor JPEG".into())),
        };
        let (decoded, texels) = self.decode(&data, format).map_err(invalid)?;
        self.left = self.left.saturating_sub(texels);
        Ok(decoded)
    }

    /// The image and its number of texels.
    fn decode(&self, data: &[u8], format: ImageFormat) -> Result<(DynamicImage, u64), String> {
        let unreadable = |error: image::ImageError| {
            let reason: String = shorten(&error.to_string());
            format!("it cannot be decoded: {reason}")
        };
        // A file says its size before it shows it: what no data of this length can hold is refused
        // before anything is allocated. Deflate makes at most 1032 bytes out of one, of 8 texels
        // each; a JPEG spends at least one bit a block of 64.
        let most_per_byte = match format {
            ImageFormat::Png => 8 * 1032,
            _ => 512,
        };
        let mut limits = Limits::no_limits();
        limits.max_image_width = Some(self.max_side);
        limits.max_image_height = Some(self.max_side);
        // 16-bit RGBA and the decoder's own buffers.
        limits.max_alloc = Some(self.left.saturating_mul(16).saturating_add(1 << 20));
        let mut reader = ImageReader::with_format(Cursor::new(data), format);
        reader.limits(limits.clone());
        let mut decoder = reader.into_decoder().map_err(unreadable)?;
        let (width, height) = decoder.dimensions();
        let texels = u64::from(width) * u64::from(height);
        if width.max(height) > self.max_side {
            return Err(format!(
                "it is {width}x{height}; at most {} texels a side are read",
                self.max_side
            ));
        }
        if texels > self.left {
            return Err(format!(
                "it is {width}x{height}, more texels than may be decoded ({} left)",
                self.left
            ));
        }
        if texels == 0 || texels > (data.len() as u64).saturating_mul(most_per_byte) {
            return Err(format!(
                "it claims {width}x{height} texels in {} bytes",
                data.len()
            ));
        }
        decoder.set_limits(limits).map_err(unreadable)?;
        let decoded = DynamicImage::from_decoder(decoder).map_err(unreadable)?;
        Ok((decoded, texels))
    }
}

/// IEC 61966-2-1.
fn from_srgb(byte: u8) -> f64 {
    let value = f64::from(byte) / 255.0;
    if value <= 0.040_45 {
        value / 12.92
    } else {
        ((value + 0.055) / 1.055).powf(2.4)
    }
}
