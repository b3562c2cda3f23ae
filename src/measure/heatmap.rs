//! Errors as a picture.

use std::fmt;

/// A picture of errors in 8-bit sRGB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeatMap {
    /// Pixels.
    pub width: u32,
    /// Pixels: the image's height and the legend's.
    pub height: u32,
    /// Three bytes a pixel, rows from the top.
    pub rgb: Vec<u8>,
}

/// Errors from `-range` (too dark, blue) over 0 (near white) to `range` (too bright, red), the scale
/// on a strip below with its ends and 0 written under it where there is room. Larger errors have the
/// colours of the ends, pixels that are not valid are dark grey.
///
/// Of slices of different lengths the missing values count as invalid. `range` is made positive.
pub fn heat_map(
    width: u32,
    height: u32,
    image: &[f32],
    truth: &[f32],
    valid: &[bool],
    range: f64,
) -> HeatMap {
    let range = if range.is_finite() && range > 0.0 {
        range
    } else {
        1.0e-6
    };
    let (columns, rows) = (width as usize, height as usize);
    let mut rgb = Vec::with_capacity(3 * columns * (rows + LEGEND));
    for index in 0..columns * rows {
        let color = match (image.get(index), truth.get(index), valid.get(index)) {
            (Some(found), Some(wanted), Some(true)) => {
                color_of((f64::from(*found) - f64::from(*wanted)) / range)
            }
            _ => INVALID,
        };
        rgb.extend(color);
    }
    rgb.extend(legend(columns, range));
    HeatMap {
        width,
        height: height + LEGEND as u32,
        rgb,
    }
}

const INVALID: [u8; 3] = [70, 70, 70];
/// Rows of the legend: a gap, the strip, a gap, digits of 5 rows twice as large, a gap.
const LEGEND: usize = 2 + 8 + 3 + 10 + 2;
const STRIP: std::ops::Range<usize> = 2..10;
const DIGITS: std::ops::Range<usize> = 13..23;

/// Stops of the scale in sRGB, from -1 to 1: blue, light blue, near white, orange, red. Told apart
/// by people who do not tell red from green.
const SCALE: [[f64; 3]; 5] = [
    [5.0, 48.0, 97.0],
    [103.0, 169.0, 207.0],
    [247.0, 247.0, 247.0],
    [239.0, 138.0, 98.0],
    [103.0, 0.0, 31.0],
];

/// The colour of an error in units of the range. NaN is invalid.
fn color_of(error: f64) -> [u8; 3] {
    if error.is_nan() {
        return INVALID;
    }
    let place = (error.clamp(-1.0, 1.0) + 1.0) * 2.0;
    let stop = (place as usize).min(3);
    let part = place - stop as f64;
    let mix = |i: usize| SCALE[stop][i] * (1.0 - part) + SCALE[stop + 1][i] * part;
    [0, 1, 2].map(|i| (mix(i) + 0.5) as u8)
}

fn legend(columns: usize, range: f64) -> Vec<u8> {
    let mut rgb = vec![255; 3 * columns * LEGEND];
    let mut set = |x: usize, y: usize, color: [u8; 3]| {
        let at = 3 * (y * columns + x);
        rgb[at..at + 3].copy_from_slice(&color);
    };
    for x in 0..columns {
        let error = 2.0 * (x as f64 + 0.5) / columns as f64 - 1.0;
        for y in STRIP {
            set(x, y, color_of(error));
        }
    }
    let number = Number(range).to_string();
    let (low, high) = (format!("-{number}"), format!("+{number}"));
    let width = |text: &str| text.len() * 8;
    if width(&low) + width(&high) + 24 > columns {
        return rgb;
    }
    for (text, left) in [
        (low.as_str(), 2),
        ("0", columns / 2 - 3),
        (high.as_str(), columns - width(&high)),
    ] {
        for (number, character) in text.chars().enumerate() {
            for (x, y) in glyph(character) {
                for dy in 0..2 {
                    for dx in 0..2 {
                        set(
                            left + 8 * number + 2 * x + dx,
                            DIGITS.start + 2 * y + dy,
                            [0; 3],
                        );
                    }
                }
            }
        }
    }
    rgb
}

/// A number in few characters.
struct Number(f64);

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if (1.0e-3..1.0e4).contains(&self.0) {
            let digits = (2 - self.0.log10().floor() as i32).clamp(0, 5) as usize;
            write!(f, "{:.digits$}", self.0)
        } else {
            write!(f, "{:.1e}", self.0)
        }
    }
}

/// The dark points of a character, 3 wide and 5 high.
fn glyph(character: char) -> impl Iterator<Item = (usize, usize)> {
    let rows: [u8; 5] = match character {
        '0' => [0b111, 0b101, 0b101, 0b101, 0b111],
        '1' => [0b010, 0b110, 0b010, 0b010, 0b111],
        '2' => [0b111, 0b001, 0b111, 0b100, 0b111],
        '3' => [0b111, 0b001, 0b111, 0b001, 0b111],
        '4' => [0b101, 0b101, 0b111, 0b001, 0b001],
        '5' => [0b111, 0b100, 0b111, 0b001, 0b111],
        '6' => [0b111, 0b100, 0b111, 0b101, 0b111],
        '7' => [0b111, 0b001, 0b010, 0b010, 0b010],
        '8' => [0b111, 0b101, 0b111, 0b101, 0b111],
        '9' => [0b111, 0b101, 0b111, 0b001, 0b111],
        '.' => [0, 0, 0, 0, 0b010],
        '-' => [0, 0, 0b111, 0, 0],
        '+' => [0, 0b010, 0b111, 0b010, 0],
        'e' => [0, 0b111, 0b111, 0b100, 0b111],
        _ => [0; 5],
    };
    (0..15)
        .map(|i| (i % 3, i / 3))
        .filter(move |&(x, y)| rows[y] >> (2 - x) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let text = |value| Number(value).to_string();
        assert_eq!(text(0.25), "0.250");
        assert_eq!(text(1.0), "1.00");
        assert_eq!(text(0.0123), "0.0123");
        assert_eq!(text(1.0e-6), "1.0e-6");
    }

    #[test]
    fn colours_diverge() {
        assert_eq!(color_of(0.0), [247; 3]);
        assert_eq!(color_of(-9.0), [5, 48, 97]);
        assert_eq!(color_of(1.0), [103, 0, 31]);
        assert_eq!(color_of(f64::NAN), INVALID);
    }
}
