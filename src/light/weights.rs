//! How the brightness of a rectangle goes over it.

use std::fmt;

/// Most columns and rows of weights: as many cells as rays or samples that a light is seen by.
pub const MAX_WEIGHTS: usize = 16;

/// Brightness over a rectangle, relative: a grid of cells, each evenly bright. Several small lights are
/// one such grid with dark cells between.
#[derive(Clone, Copy, PartialEq)]
pub struct LightWeights {
    columns: usize,
    rows: usize,
    /// Rows from the top (+y), each from the left (-x).
    values: [f32; MAX_WEIGHTS * MAX_WEIGHTS],
    sums: [f32; MAX_WEIGHTS],
}

impl LightWeights {
    /// The same all over.
    pub const EVEN: Self = {
        let mut even = Self {
            columns: 1,
            rows: 1,
            values: [0.0; MAX_WEIGHTS * MAX_WEIGHTS],
            sums: [0.0; MAX_WEIGHTS],
        };
        even.values[0] = 1.0;
        even.sums[0] = 1.0;
        even
    };

    /// A grid of finite numbers of 0 or more that are not all 0, rows from the top (the light's +y),
    /// each from the left (-x); `None` for others and for a number of values that is no such grid. Of
    /// more than [`MAX_WEIGHTS`] columns or rows means are taken, of equal parts of the width or height.
    pub fn new(columns: usize, values: &[f32]) -> Option<Self> {
        let rows = values.len().checked_div(columns)?;
        let greatest = values.iter().copied().fold(0.0, f32::max);
        let fits = rows * columns == values.len()
            && values.iter().all(|v| (0.0..=1.0e30).contains(v))
            && greatest > 0.0;
        if !fits {
            return None;
        }
        let mut weights = Self {
            columns: columns.min(MAX_WEIGHTS),
            rows: rows.min(MAX_WEIGHTS),
            ..Self::EVEN
        };
        let across = parts(columns, weights.columns);
        let down = parts(rows, weights.rows);
        for (row, lines) in down.iter().enumerate() {
            let mut row_sum = 0.0;
            for (column, places) in across.iter().enumerate() {
                let mut sum = 0.0;
                for (y, tall) in lines {
                    for (x, wide) in places {
                        sum += tall * wide * f64::from(values[y * columns + x] / greatest);
                    }
                }
                row_sum += sum;
                weights.values[row * weights.columns + column] = sum as f32;
            }
            weights.sums[row] = row_sum as f32;
        }
        Some(weights)
    }

    /// Columns of the grid.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The cells' weights, 0 to 1, rows from the top, each from the left.
    pub fn values(&self) -> &[f32] {
        &self.values[..self.columns * self.rows]
    }

    /// True if all cells are equally bright.
    pub fn is_even(&self) -> bool {
        self.values().iter().all(|v| *v == self.values[0])
    }

    /// The place for a point of the unit square, x to the right and y up: equal areas go to equal parts
    /// of the light, and what is beside each other stays so within a row.
    pub fn place_of(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (row, down) = pick(&self.sums[..self.rows], 1.0 - y);
        let cells = &self.values[row * self.columns..][..self.columns];
        let (column, across) = pick(cells, x);
        [
            (column as f64 + across) / self.columns as f64,
            1.0 - (row as f64 + down) / self.rows as f64,
        ]
    }
}

impl fmt::Debug for LightWeights {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "LightWeights({}x{})", self.columns, self.rows)
    }
}

/// For each of `to` equal parts of `from` items: the items in it, and the part of it that each fills.
fn parts(from: usize, to: usize) -> Vec<Vec<(usize, f64)>> {
    let wide = from as f64 / to as f64;
    let of = |part: usize| {
        let (begin, end) = (part as f64 * wide, (part + 1) as f64 * wide);
        let items = begin as usize..(end.ceil() as usize).min(from);
        let filled = items.map(|i| {
            let both = (i as f64 + 1.0).min(end) - (i as f64).max(begin);
            (i, both.max(0.0) / wide)
        });
        filled.collect()
    };
    (0..to).map(of).collect()
}

/// The cell before whose end lies a part, 0 to 1, of the sum, and how far into it.
fn pick(weights: &[f32], part: f64) -> (usize, f64) {
    let sum: f64 = weights.iter().copied().map(f64::from).sum();
    let mut left = part.clamp(0.0, 1.0) * sum;
    let mut last = (0, 0.0);
    for (i, weight) in weights.iter().copied().map(f64::from).enumerate() {
        if weight > 0.0 {
            last = (i, (left / weight).min(1.0));
            if left <= weight {
                break;
            }
        }
        left -= weight;
    }
    last
}

#[cfg(feature = "cli")]
mod file {
    use super::LightWeights;
    use image::{GenericImageView as _, ImageReader, Limits};
    use std::path::Path;

    /// Largest side of an image of weights.
    const MOST_SIDE: u32 = 8192;

    impl LightWeights {
        /// The weights in a PNG or JPEG: its values are linear emission, those of a coloured one its
        /// luma; alpha is left out.
        ///
        /// # Errors
        /// One line that names the file and what is wrong with it.
        pub fn read(path: &Path) -> Result<Self, String> {
            let fault = |reason: String| format!("light weights {}: {reason}", path.display());
            let mut limits = Limits::default();
            limits.max_image_width = Some(MOST_SIDE);
            limits.max_image_height = Some(MOST_SIDE);
            let mut reader = ImageReader::open(path)
                .and_then(ImageReader::with_guessed_format)
                .map_err(|error| fault(error.to_string()))?;
            reader.limits(limits);
            let image = reader.decode().map_err(|error| {
                let text = error.to_string();
                fault(text.lines().next().unwrap_or_default().to_string())
            })?;
            let grey = image.to_luma32f();
            let columns = image.dimensions().0 as usize;
            Self::new(columns, grey.as_raw())
                .ok_or_else(|| fault("it is black: give at least one pixel that is not".into()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids() {
        assert!(LightWeights::EVEN.is_even());
        let corners = LightWeights::new(3, &[1.0, 0.0, 2.0, 0.0, 0.0, 0.0, 4.0, 0.0, 1.0]).unwrap();
        assert_eq!(corners.values()[6], 1.0);
        assert!(!corners.is_even());
        for (columns, values) in [
            (0, vec![]),
            (2, vec![]),
            (2, vec![1.0; 3]),
            (1, vec![0.0; 3]),
            (1, vec![-1.0, 2.0]),
            (1, vec![f32::NAN]),
            (1, vec![f32::INFINITY]),
        ] {
            assert!(LightWeights::new(columns, &values).is_none(), "{values:?}");
        }
    }

    #[test]
    fn larger_grids_are_averaged() {
        // 40 columns to 16: 2.5 each; a third of the light on the left half.
        let values = (0..40 * 3).map(|i| if i % 40 < 20 { 0.5 } else { 1.0 });
        let weights = LightWeights::new(40, &values.collect::<Vec<_>>()).unwrap();
        assert_eq!((weights.columns(), weights.values().len()), (16, 48));
        for (i, v) in weights.values().iter().enumerate() {
            let wanted = if i % 16 < 8 { 0.5 } else { 1.0 };
            assert!((v - wanted).abs() < 1.0e-6, "{i}: {v}");
        }
        let one = LightWeights::new(17, &(0..17).map(|i| i as f32).collect::<Vec<_>>()).unwrap();
        let mean: f32 = one.values().iter().sum::<f32>() / 16.0;
        assert!((mean - 0.5).abs() < 1.0e-6);
    }

    #[test]
    fn equal_parts_of_the_square_are_equal_parts_of_the_light() {
        let values = [0.0, 1.0, 3.0, 2.0, 0.0, 2.0];
        let weights = LightWeights::new(3, &values).unwrap();
        const SIDE: usize = 400;
        let mut found = [0_usize; 6];
        for i in 0..SIDE * SIDE {
            let at = |i: usize| (i as f64 + 0.5) / SIDE as f64;
            let [x, y] = weights.place_of([at(i % SIDE), at(i / SIDE)]);
            assert!((0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y));
            let row = ((1.0 - y) * 2.0).min(1.999) as usize;
            found[row * 3 + (x * 3.0).min(2.999) as usize] += 1;
        }
        for (count, value) in found.iter().zip(values) {
            let part = *count as f32 / (SIDE * SIDE) as f32;
            assert!((part - value / 8.0).abs() < 0.003, "{found:?}");
        }
        for corner in [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0], [1.0, 0.0]] {
            let [x, y] = weights.place_of(corner);
            assert!((0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y));
        }
        assert_eq!(LightWeights::EVEN.place_of([0.3, 0.6]), [0.3, 0.6]);
    }
}
