//! Errors of visibility.

use std::ops::Range;

/// Truth strictly between these is penumbra; up to the first is umbra, from the second on lit.
pub const PENUMBRA: Range<f32> = 0.005..0.995;

/// Errors over one set of pixels, each `image - truth`. All 0 over no pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ErrorMeasures {
    /// Number of pixels.
    pub pixels: u64,
    /// Root of the mean square.
    pub rmse: f64,
    /// Mean; above 0 for an image too bright.
    pub bias: f64,
    /// Mean magnitude.
    pub mae: f64,
    /// The magnitude that 99 % of the pixels do not exceed: that of rank `ceil(0.99 pixels)`.
    pub p99: f64,
    /// Largest magnitude.
    pub max: f64,
}

/// All measures of a visibility image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Measures {
    /// Over the valid pixels.
    pub valid: ErrorMeasures,
    /// Over the valid pixels whose truth is within [`PENUMBRA`].
    pub penumbra: ErrorMeasures,
    /// Part of the valid pixels whose truth is umbra and that are called lit, 0 to 1.
    pub umbra_called_lit: f64,
    /// Part of the valid pixels whose truth is lit and that are called umbra, 0 to 1.
    pub lit_called_umbra: f64,
}

/// Images that cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeasureError {
    /// They differ in their number of pixels.
    #[error("{image} values cannot be compared with {truth}, marked by {valid}")]
    Count {
        /// Values of the image.
        image: usize,
        /// Values of the truth.
        truth: usize,
        /// Marks of validity.
        valid: usize,
    },
    /// A value is no number.
    #[error("the {which} has the value {value} at pixel number {index}")]
    NotFinite {
        /// `image` or `reference`.
        which: &'static str,
        /// The value.
        value: String,
        /// Number of the pixel, row by row from the top.
        index: usize,
    },
}

/// Compares visibility with the truth, on the pixels marked valid.
///
/// # Errors
/// [`MeasureError`]: different numbers of pixels, or a valid pixel that is NaN or infinite.
pub fn measure(image: &[f32], truth: &[f32], valid: &[bool]) -> Result<Measures, MeasureError> {
    if image.len() != truth.len() || image.len() != valid.len() {
        return Err(MeasureError::Count {
            image: image.len(),
            truth: truth.len(),
            valid: valid.len(),
        });
    }
    let (mut all, mut penumbra) = (Vec::new(), Vec::new());
    let (mut umbra_called_lit, mut lit_called_umbra) = (0_u64, 0_u64);
    for index in (0..image.len()).filter(|&index| valid[index]) {
        let (found, wanted) = (image[index], truth[index]);
        for (which, value) in [("image", found), ("reference", wanted)] {
            if !value.is_finite() {
                return Err(MeasureError::NotFinite {
                    which,
                    value: value.to_string(),
                    index,
                });
            }
        }
        let error = f64::from(found) - f64::from(wanted);
        all.push(error);
        let is_lit = |v: f32| v >= PENUMBRA.end;
        let is_umbra = |v: f32| v <= PENUMBRA.start;
        umbra_called_lit += u64::from(is_umbra(wanted) && is_lit(found));
        lit_called_umbra += u64::from(is_lit(wanted) && is_umbra(found));
        if !is_lit(wanted) && !is_umbra(wanted) {
            penumbra.push(error);
        }
    }
    let pixels = all.len().max(1) as f64;
    Ok(Measures {
        umbra_called_lit: umbra_called_lit as f64 / pixels,
        lit_called_umbra: lit_called_umbra as f64 / pixels,
        valid: ErrorMeasures::of(all),
        penumbra: ErrorMeasures::of(penumbra),
    })
}

impl ErrorMeasures {
    fn of(errors: Vec<f64>) -> Self {
        if errors.is_empty() {
            return Self::default();
        }
        let count = errors.len() as f64;
        let mean = |value: fn(f64) -> f64| errors.iter().copied().map(value).sum::<f64>() / count;
        let (square, bias, mae) = (mean(|e| e * e), mean(|e| e), mean(f64::abs));
        let mut sizes: Vec<f64> = errors.iter().map(|e| e.abs()).collect();
        let rank = (99 * sizes.len()).div_ceil(100);
        let (_, p99, above) = sizes.select_nth_unstable_by(rank - 1, f64::total_cmp);
        let p99 = *p99;
        let max = above.iter().copied().fold(p99, f64::max);
        Self {
            pixels: errors.len() as u64,
            rmse: square.sqrt(),
            bias,
            mae,
            p99,
            max,
        }
    }
}
