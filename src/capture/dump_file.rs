//! Images of a frame as files.

use std::fmt;

use super::exr::{Plane, encode_planes};
use super::output::OutputError;
use super::png::{encode_grey16, encode_linear_rgb16};
use super::{CapturedImage, ImageContent, Samples};

/// An OpenEXR file with all layers and channels: `Y` of one, `R`, `G`, `B`, `A` of several, `X`,
/// `Y`, `Z` of normals. Channels of several layers are called `layer0.Y` and so on. Integers stay
/// integers.
///
/// # Errors
/// As [`encode_planes`].
pub fn to_exr(image: CapturedImage) -> Result<Vec<u8>, OutputError> {
    let names = image.channel_names();
    let several = image.layers.len() > 1;
    let mut all = Vec::new();
    for layer in &image.layers {
        for name in names {
            all.push(if several {
                format!("layer{layer}.{name}")
            } else {
                (*name).to_string()
            });
        }
    }
    let planes = all.into_iter().zip(image.planes);
    let planes = planes.map(|(name, samples)| Plane { name, samples });
    encode_planes(image.width, image.height, planes.collect())
}

/// A linear 16-bit PNG to look at, layers one below the other: normals as 0.5 + 0.5 n, all else
/// scaled so that the least number becomes 0 and the greatest 1. One channel is grey; of several
/// the first three are red, green and blue.
///
/// # Errors
/// [`OutputError::Encode`] if the file cannot be made.
pub fn to_png(image: &CapturedImage) -> Result<Vec<u8>, OutputError> {
    let (low, scale) = match image.content {
        ImageContent::Normals => (-1.0, 0.5),
        ImageContent::Values => {
            let range = ValueRange::of(image);
            let size = range.max - range.min;
            (range.min, if size > 0.0 { 1.0 / size } else { 0.0 })
        }
    };
    let (width, height) = (image.width, image.height);
    let rows = height.saturating_mul(image.layers.len() as u32);
    let scaled = |plane: &Samples, at: usize| ((value(plane, at) - low) * scale) as f32;
    let channels = image.channels();
    if channels <= 1 {
        let planes = image.planes.iter();
        let values: Vec<f32> = planes
            .flat_map(|plane| (0..len(plane)).map(move |at| scaled(plane, at)))
            .collect();
        return encode_grey16(width, rows, &values);
    }
    let mut values = Vec::new();
    for layer in image.planes.chunks_exact(channels) {
        for at in 0..len(&layer[0]) {
            let three = layer.iter().take(3).map(|plane| scaled(plane, at));
            values.extend(three.chain(std::iter::once(0.0)).take(3));
        }
    }
    encode_linear_rgb16(width, rows, &values)
}

/// Least and greatest finite number of an image; alpha does not count. 0 and 0 without any.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueRange {
    /// The least.
    pub min: f64,
    /// The greatest.
    pub max: f64,
}

impl ValueRange {
    /// Of all layers.
    pub fn of(image: &CapturedImage) -> Self {
        let channels = image.channels().max(1);
        let colour = (image.planes.iter().enumerate()).filter(|(at, _)| at % channels < 3);
        let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
        for (_, plane) in colour {
            for at in 0..len(plane) {
                let value = value(plane, at);
                if value.is_finite() {
                    (min, max) = (min.min(value), max.max(value));
                }
            }
        }
        if min > max {
            (min, max) = (0.0, 0.0);
        }
        Self { min, max }
    }
}

impl fmt::Display for ValueRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let whole = self.min.fract() == 0.0 && self.max.fract() == 0.0;
        let Self { min, max } = self;
        match whole {
            true => write!(f, "min {min}  max {max}"),
            false => write!(f, "min {min:.6}  max {max:.6}"),
        }
    }
}

fn len(plane: &Samples) -> usize {
    match plane {
        Samples::Float(values) => values.len(),
        Samples::Uint(values) => values.len(),
    }
}

fn value(plane: &Samples, at: usize) -> f64 {
    match plane {
        Samples::Float(values) => f64::from(values[at]),
        Samples::Uint(values) => f64::from(values[at]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(layers: &[u32], planes: Vec<Samples>) -> CapturedImage {
        CapturedImage {
            name: "image".into(),
            width: 2,
            height: 1,
            layers: layers.into(),
            content: ImageContent::Values,
            planes,
        }
    }

    fn decoded(bytes: &[u8]) -> image::DynamicImage {
        match image::load_from_memory_with_format(bytes, image::ImageFormat::Png) {
            Ok(image) => image,
            Err(error) => panic!("{error}"),
        }
    }

    #[test]
    fn numbers_are_scaled_to_the_whole_range() -> Result<(), OutputError> {
        let ids = image(
            &[0, 1],
            vec![Samples::Uint(vec![1, 3]), Samples::Uint(vec![5, 2])],
        );
        assert_eq!(ValueRange::of(&ids).to_string(), "min 1  max 5");
        let png = decoded(&to_png(&ids)?).into_luma16();
        assert_eq!(png.dimensions(), (2, 2));
        assert_eq!(png.as_raw(), &[0, 32768, 65535, 16384]);
        let holes = [f32::NAN, f32::INFINITY, -0.5, 1.5];
        let holes = image(
            &[3, 4],
            holes.chunks(2).map(|v| Samples::Float(v.into())).collect(),
        );
        assert_eq!(
            ValueRange::of(&holes).to_string(),
            "min -0.500000  max 1.500000"
        );
        let png = decoded(&to_png(&holes)?).into_luma16();
        assert_eq!(png.as_raw(), &[0, 65535, 0, 65535]);
        let flat = image(&[0], vec![Samples::Float(vec![7.0; 2])]);
        assert_eq!(decoded(&to_png(&flat)?).into_luma16().as_raw(), &[0, 0]);
        Ok(())
    }

    #[test]
    fn normals_are_colours_about_grey() -> Result<(), OutputError> {
        let planes = [[1.0, 0.0], [0.0, 0.0], [-1.0, 0.0]];
        let mut normals = image(&[0], planes.map(|p| Samples::Float(p.into())).into());
        normals.content = ImageContent::Normals;
        let png = decoded(&to_png(&normals)?).into_rgb16();
        assert_eq!(png.as_raw(), &[65535, 32768, 0, 32768, 32768, 32768]);
        Ok(())
    }

    #[test]
    fn alpha_is_left_out_of_the_range_and_two_channels_have_no_blue() -> Result<(), OutputError> {
        let plane = |a, b| Samples::Float(vec![a, b]);
        let four = vec![
            plane(0.0, 1.0),
            plane(2.0, 0.0),
            plane(4.0, 0.0),
            plane(9.0, 9.0),
        ];
        assert_eq!(ValueRange::of(&image(&[0], four)).max, 4.0);
        let two = image(&[0], vec![plane(0.0, 1.0), plane(2.0, 1.0)]);
        let png = decoded(&to_png(&two)?).into_rgb16();
        assert_eq!(png.as_raw(), &[0, 65535, 0, 32768, 32768, 0]);
        Ok(())
    }
}
