//! What a capture tells about its images.

use std::fmt::{self, Write as _};

use super::shot::Shot;
use crate::capture::dump_file::ValueRange;
use crate::capture::output::Output;

/// Least, mean and greatest of a set of values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stats {
    min: f32,
    mean: f64,
    max: f32,
    /// How many values are no finite number; the others count above.
    not_finite: usize,
}

impl Stats {
    pub(super) fn of(values: impl IntoIterator<Item = f32>) -> Self {
        let (mut min, mut max) = (f32::INFINITY, f32::NEG_INFINITY);
        let (mut sum, mut count, mut not_finite) = (0.0, 0usize, 0);
        for value in values {
            if value.is_finite() {
                (min, max) = (min.min(value), max.max(value));
                sum += f64::from(value);
                count += 1;
            } else {
                not_finite += 1;
            }
        }
        let mean = if count == 0 { 0.0 } else { sum / count as f64 };
        if count == 0 {
            (min, max) = (0.0, 0.0);
        }
        Self {
            min,
            mean,
            max,
            not_finite,
        }
    }
}

impl fmt::Display for Stats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { min, mean, max, .. } = self;
        write!(f, "min {min:.6}  mean {mean:.6}  max {max:.6}")?;
        match self.not_finite {
            0 => Ok(()),
            count => write!(f, "  ({count} values are no number)"),
        }
    }
}

/// A captured frame in a few lines: what it was rendered with if `driver` is given, then what came
/// out. `number` is that of a frame among several.
pub(super) fn summarize(
    shot: &Shot,
    driver: Option<&str>,
    number: Option<u32>,
    files: &[(Output, Vec<u8>)],
) -> String {
    let frame = &shot.captured;
    let mut text = String::new();
    let mut row = |name: &str, value: String| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{name:<11}{value}");
    };
    if let Some(driver) = driver {
        row("driver", driver.into());
        row("size", format!("{}x{}", frame.size[0], frame.size[1]));
        row("technique", shot.technique.name().into());
    }
    match number {
        Some(number) => row("number", format!("{number} at {:.4} s", shot.seconds)),
        None if shot.seconds != 0.0 => row("time", format!("{} s", shot.seconds)),
        None => {}
    }
    row("camera", shot.camera.clone());
    if let Some(spread) = shot.measured.frame() {
        let first = shot.setup.first_frame;
        row(
            "frame",
            if shot.is_measured {
                format!(
                    "{:.3} ms (min {:.3}, max {:.3}; the first {first:.3})",
                    spread.median, spread.min, spread.max
                )
            } else if driver.is_some() {
                format!("{first:.3} ms (the first of a run)")
            } else {
                format!("{first:.3} ms")
            },
        );
    }
    let rgb = frame.color.iter().flat_map(|pixel| &pixel[..3]).copied();
    row("picture", Stats::of(rgb).to_string());
    for (light, scene_light) in frame.lights.iter().zip(&shot.lights) {
        row(
            "visibility",
            format!(
                "{}  light {} `{}` ({})",
                Stats::of(light.visibility.iter().copied()),
                light.light,
                scene_light.name,
                scene_light.light.shape
            ),
        );
        if light.choice.technique != shot.technique {
            let choice = &light.choice;
            row("chosen", format!("{}: {}", choice.spec(), choice.reason));
        }
    }
    for image in &frame.images {
        let layers = match image.layers.len() {
            1 => String::new(),
            count => format!(", {count} layers"),
        };
        row(
            "dump",
            format!(
                "{}  `{}` ({}x{}{layers})",
                ValueRange::of(image),
                image.name,
                image.width,
                image.height
            ),
        );
    }
    for (output, bytes) in files {
        row("wrote", format!("{output} ({} bytes)", bytes.len()));
    }
    text
}

/// The one colour that all pixels have; `None` if there are two.
pub(super) fn single_value(color: &[[f32; 4]]) -> Option<[f32; 3]> {
    let rgb = |pixel: &[f32; 4]| [pixel[0], pixel[1], pixel[2]];
    let bits = |pixel: &[f32; 4]| rgb(pixel).map(f32::to_bits);
    let first = color.first()?;
    let same = color.iter().all(|pixel| bits(pixel) == bits(first));
    same.then(|| rgb(first))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stats() {
        let text = |values: &[f32]| Stats::of(values.iter().copied()).to_string();
        assert_eq!(
            text(&[0.0, 1.0, 0.5]),
            "min 0.000000  mean 0.500000  max 1.000000"
        );
        assert_eq!(text(&[]), "min 0.000000  mean 0.000000  max 0.000000");
        assert!(text(&[1.0, f32::NAN]).ends_with("max 1.000000  (1 values are no number)"));
    }

    #[test]
    fn single_values_are_seen_whatever_they_are() {
        let nan = [f32::NAN; 4];
        assert!(single_value(&[nan, nan]).is_some());
        let grey = |alpha| [0.5, 0.5, 0.5, alpha];
        assert_eq!(single_value(&[grey(0.0), grey(1.0)]), Some([0.5; 3]));
        assert_eq!(single_value(&[grey(1.0), nan]), None);
        assert_eq!(single_value(&[]), None);
    }
}
