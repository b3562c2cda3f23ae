//! Perceived difference of pictures.

/// Difference of two pictures as people see it, 0 (none) to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Flip {
    /// Mean over all pixels: the one number to compare by.
    pub mean: f64,
    /// Largest.
    pub max: f64,
    /// Each pixel's, rows from the top.
    pub map: Vec<f32>,
}

/// The LDR-FLIP difference (Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating
/// Images") at 67 pixels a degree, of two pictures of `width` times `height` in 8-bit sRGB, three
/// bytes a pixel. `None` if a picture has another number of bytes or no pixel.
pub fn flip(width: u32, height: u32, image: &[u8], reference: &[u8]) -> Option<Flip> {
    let bytes = 3 * u64::from(width) * u64::from(height);
    let has_all = |picture: &[u8]| picture.len() as u64 == bytes;
    // The library counts in 32 bits.
    if bytes == 0 || bytes > u64::from(u32::MAX) || !has_all(image) || !has_all(reference) {
        return None;
    }
    let picture = |bytes: &[u8]| nv_flip::FlipImageRgb8::with_data(width, height, bytes);
    let map = nv_flip::flip(
        picture(reference),
        picture(image),
        nv_flip::DEFAULT_PIXELS_PER_DEGREE,
    )
    .to_vec();
    let sum: f64 = map.iter().copied().map(f64::from).sum();
    Some(Flip {
        mean: sum / map.len() as f64,
        max: f64::from(map.iter().copied().fold(0.0, f32::max)),
        map,
    })
}
