//! PNG: 8-bit sRGB pictures, 16-bit linear masks and images of numbers.
//!
//! The bytes depend on the pixels only.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};

use super::output::OutputError;

/// The 8-bit sRGB value of a linear one; 0 for NaN and below 0, 255 for above 1.
pub fn srgb_from_linear(linear: f32) -> u8 {
    let x = f64::from(linear);
    // `clamp` would keep NaN.
    let x = if x > 0.0 { x.min(1.0) } else { 0.0 };
    let encoded = if x <= 0.003_130_8 {
        12.92 * x
    } else {
        1.055 * x.powf(1.0 / 2.4) - 0.055
    };
    (255.0 * encoded + 0.5) as u8
}

/// A picture out of sRGB-encoded bytes: R, G, B for each pixel, rows from the top.
///
/// # Errors
/// [`OutputError::Encode`] if there are not three bytes a pixel.
pub fn encode_rgb8(width: u32, height: u32, rgb: &[u8]) -> Result<Vec<u8>, OutputError> {
    encode(width, height, rgb, ExtendedColorType::Rgb8, 3)
}

/// A picture out of linear RGB, rows from the top; values outside 0 to 1 are clipped.
///
/// # Errors
/// [`OutputError::Encode`] if there is not one value a pixel.
pub fn encode_linear_rgb(
    width: u32,
    height: u32,
    rgb: &[[f32; 3]],
) -> Result<Vec<u8>, OutputError> {
    let bytes: Vec<u8> = (rgb.iter().flatten())
        .map(|&value| srgb_from_linear(value))
        .collect();
    encode_rgb8(width, height, &bytes)
}

/// A mask out of values from 0 to 1, linear in 16 bits, rows from the top; values outside are
/// clipped, NaN is 0.
///
/// # Errors
/// [`OutputError::Encode`] if there is not one value a pixel.
pub fn encode_grey16(width: u32, height: u32, values: &[f32]) -> Result<Vec<u8>, OutputError> {
    let bytes = linear16(values);
    encode(width, height, &bytes, ExtendedColorType::L16, 2)
}

/// Three values from 0 to 1 for each pixel, linear in 16 bits, rows from the top; values outside
/// are clipped, NaN is 0.
///
/// # Errors
/// [`OutputError::Encode`] if there are not three values a pixel.
pub fn encode_linear_rgb16(width: u32, height: u32, rgb: &[f32]) -> Result<Vec<u8>, OutputError> {
    let bytes = linear16(rgb);
    encode(width, height, &bytes, ExtendedColorType::Rgb16, 6)
}

fn linear16(values: &[f32]) -> Vec<u8> {
    let bytes = values.iter().flat_map(|&value| {
        // The cast clips, and turns NaN into 0.
        let quantised = (65535.0 * f64::from(value) + 0.5) as u16;
        // The encoder takes native order and writes big-endian.
        quantised.to_ne_bytes()
    });
    bytes.collect()
}

fn encode(
    width: u32,
    height: u32,
    bytes: &[u8],
    color: ExtendedColorType,
    bytes_per_pixel: u64,
) -> Result<Vec<u8>, OutputError> {
    let fault = |reason| OutputError::Encode {
        format: "PNG",
        width,
        height,
        reason,
    };
    let wanted = u64::from(width)
        .checked_mul(u64::from(height))
        .and_then(|pixels| pixels.checked_mul(bytes_per_pixel));
    if wanted != Some(bytes.len() as u64) || bytes.is_empty() {
        let reason = format!("{} bytes at {bytes_per_pixel} a pixel", bytes.len());
        return Err(fault(reason));
    }
    let mut encoded = Vec::new();
    PngEncoder::new_with_quality(&mut encoded, CompressionType::Default, FilterType::Adaptive)
        .write_image(bytes, width, height, color)
        .map_err(|error| fault(error.to_string()))?;
    Ok(encoded)
}
