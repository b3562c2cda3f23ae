//! Visibility as small pictures for the report.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _, ImageError};

/// Longest side of a picture, pixels; larger images lose rows and columns, never values.
pub const MAX_SIDE: u32 = 512;

/// Size of the picture of an image, by the factor that [`MAX_SIDE`] asks for.
pub fn shrunk(size: [u32; 2]) -> [u32; 2] {
    let factor = size[0].max(size[1]).div_ceil(MAX_SIDE).max(1);
    size.map(|side| side.div_ceil(factor))
}

/// An 8-bit grey PNG of values 0 to 1, linear, rows from the top; other values are clipped, NaN is
/// 0. Of images above [`MAX_SIDE`] every second, third, .. pixel is taken, so that values are real.
///
/// # Errors
/// If there is not one value a pixel.
pub fn grey(size: [u32; 2], values: &[f32]) -> Result<Vec<u8>, ImageError> {
    let factor = size[0].max(size[1]).div_ceil(MAX_SIDE).max(1) as usize;
    let rows = values.chunks(size[0].max(1) as usize).step_by(factor);
    let bytes: Vec<u8> = rows
        .flat_map(|row| row.iter().step_by(factor))
        // The cast clips, and turns NaN into 0.
        .map(|&value| (255.0 * value + 0.5) as u8)
        .collect();
    let [width, height] = shrunk(size);
    if bytes.len() as u64 != u64::from(width) * u64::from(height) {
        let kind = image::error::ParameterErrorKind::DimensionMismatch;
        let error = image::error::ParameterError::from_kind(kind);
        return Err(ImageError::Parameter(error));
    }
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::Adaptive)
        .write_image(&bytes, width, height, ExtendedColorType::L8)?;
    Ok(png)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_images_are_thinned_out() -> Result<(), ImageError> {
        let size = [1025, 2];
        let mut values = vec![0.0; 2050];
        values[3] = 1.0;
        values[1025 + 3] = 0.5;
        let decoded = image::load_from_memory(&grey(size, &values)?)?.into_luma8();
        assert_eq!(shrunk(size), [342, 1]);
        assert_eq!(decoded.dimensions(), (342, 1));
        assert_eq!(decoded.as_raw()[..2], [0, 255]);
        assert!(grey([3, 3], &[0.0; 8]).is_err());
        let odd = grey([3, 1], &[f32::NAN, 7.0, -1.0])?;
        assert_eq!(
            image::load_from_memory(&odd)?.into_luma8().into_raw(),
            [0, 255, 0]
        );
        Ok(())
    }
}
