//! Where the samples of `shaft-masks` lie on a light: in rows, equal areas to equal areas.
//!
//! Things are often built along the same axes as the light above them. An edge along a row would hide or
//! show all of it at once, so rows of round lights are turned against the light's axes and those of
//! rectangles rise, and from row to row samples stand elsewhere in their cells. Each is still in a cell
//! of its own.

use crate::light::LightShape;
use glam::DVec2;

/// A row of samples: `rows` in `shaft_masks/params.glsl`.
///
/// Places are in units of half the light's size, -1 to 1; of a sun on the plane that touches the
/// sphere of directions, in units of the tangent of half its angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Row {
    /// Place along the light's second axis.
    y: f64,
    /// Columns in a unit of place along the first axis, at its middle.
    scale: f64,
    /// Column at place 0.
    middle: f64,
    /// 1 + (tangent * y)^2.
    w: f64,
    /// Least and most place along the second axis of the part of the light that the row stands for.
    strip: [f64; 2],
}

impl Row {
    /// As shaders read it.
    pub(super) fn texel(&self) -> [f32; 4] {
        [self.y, self.scale, self.middle, self.w].map(|v| v as f32)
    }

    /// The row's strip, as shaders read it: its least and most place along the second axis, and the
    /// narrowest and the widest half chord there; of lights that are not round the whole width.
    pub(super) fn strip_texel(&self, shape: &LightShape) -> [f32; 4] {
        let [from, to] = self.strip;
        let [narrow, wide] = match shape {
            LightShape::Disk { .. } | LightShape::Sphere { .. } | LightShape::Sun { .. } => {
                let chord = |y: f64| (1.0 - y * y).max(0.0).sqrt();
                let middle = 0.0_f64.clamp(from, to);
                [chord(from).min(chord(to)), chord(middle)]
            }
            LightShape::Point | LightShape::Rect { .. } | LightShape::Line { .. } => [1.0, 1.0],
        };
        [from, to, narrow, wide].map(|v| v as f32)
    }

    /// Place along the first axis of the sample in a column.
    fn x(&self, column: u32, tangent: f64) -> f64 {
        let q = (f64::from(column) + 0.5 - self.middle) / self.scale;
        q * (self.w / (1.0 - (tangent * q).powi(2))).sqrt()
    }
}

/// Turns places in a round light's rows to its own axes: `ROW_COSINE` and `ROW_SINE` in
/// `shaft_masks/params.glsl`, of pi / 8.
const TURN: DVec2 = DVec2::new(0.923_879_532_51, 0.382_683_432_36);

/// Columns that the samples of a row stand off the middles of their cells, -0.5 to 0.5: bits
/// reversed, so that neighbours differ much and a row and the one that mirrors it are opposite.
fn shift(row: u32, side: u32) -> f64 {
    let reversed = row.reverse_bits() >> (32 - side.ilog2());
    (f64::from(reversed) + 0.5) / f64::from(side) - 0.5
}

/// Tangent of half a sun's angle, 0 for other lights.
fn tangent(shape: &LightShape) -> f64 {
    match shape {
        LightShape::Sun { angular_diameter } => (0.5 * f64::from(*angular_diameter)).tan(),
        _ => 0.0,
    }
}

/// Whether the light is a sun for which `SMALL_SUN` in `shaft_masks/masks.glsl` may be set: of the root
/// 1 / sqrt(1 + e) the part after the second power of e is below 1e-7, for e is at most 2.7 times this square near the sun.
pub(super) fn is_small_sun(shape: &LightShape) -> bool {
    matches!(shape, LightShape::Sun { .. }) && tangent(shape).powi(2) <= 0.0025
}

/// `side` rows of `side` samples.
pub(super) fn rows(shape: &LightShape, side: u32) -> Vec<Row> {
    let count = f64::from(side);
    let even = |r: u32| (2.0 * f64::from(r) + 1.0) / count - 1.0;
    let row = |y: f64, scale: f64, middle: f64| Row {
        y,
        scale,
        middle,
        w: 1.0,
        strip: [y - 1.0 / count, y + 1.0 / count],
    };
    match shape {
        LightShape::Point | LightShape::Rect { .. } => (0..side)
            .map(|r| row(even(r), 0.5 * count, 0.5 * count - shift(r, side)))
            .collect(),
        // One row after the other.
        LightShape::Line { .. } => {
            let scale = 0.5 * count * count;
            let middle = |r: u32| scale - f64::from(r) * count;
            (0..side).map(|r| row(0.0, scale, middle(r))).collect()
        }
        LightShape::Disk { .. } | LightShape::Sphere { .. } | LightShape::Sun { .. } => {
            strips(side, tangent(shape))
        }
    }
}

/// Strips of a round light that have equal areas, each with its mean width; of a sun equal solid
/// angles.
fn strips(side: u32, tangent: f64) -> Vec<Row> {
    // By the angle along the second axis, in which the density of solid angle is the half width.
    const STEPS: usize = 4096;
    let tan = tangent.max(1.0e-6);
    let most = tan.atan();
    let place = |step: f64| ((2.0 * step / STEPS as f64 - 1.0) * most).tan() / tan;
    let half_width = |y: f64| (1.0 - y * y).max(0.0).sqrt();
    let mut sums = vec![0.0];
    for step in 0..STEPS {
        let density = half_width(place(step as f64 + 0.5));
        sums.push(sums[step] + density);
    }
    let border = |part: f64| {
        let wanted = part * sums[STEPS];
        let after = sums.partition_point(|sum| *sum < wanted).clamp(1, STEPS);
        let (low, high) = (sums[after - 1], sums[after]);
        (after - 1) as f64 + (wanted - low) / (high - low)
    };
    let count = f64::from(side);
    let row = |r: u32| {
        let (from, to) = (
            border(f64::from(r) / count),
            border(f64::from(r + 1) / count),
        );
        // Means over the strip.
        const PARTS: usize = 256;
        let (mut width, mut moment, mut area, mut height) = (0.0, 0.0, 0.0, 0.0);
        for part in 0..PARTS {
            let at = |i: f64| place(from + (to - from) * i / PARTS as f64);
            let (y, step) = (
                at(part as f64 + 0.5),
                at(part as f64 + 1.0) - at(part as f64),
            );
            let weight = half_width(y) / (1.0 + (tan * y).powi(2));
            width += half_width(y) * step;
            moment += y * weight * step;
            area += weight * step;
            height += step;
        }
        let (y, half) = (moment / area, width / height);
        let w = 1.0 + (tangent * y).powi(2);
        Row {
            y,
            scale: 0.5 * count * (w + (tangent * half).powi(2)).sqrt() / half,
            middle: 0.5 * count - shift(r, side),
            w,
            strip: [place(from), place(to)],
        }
    };
    (0..side).map(row).collect()
}

/// The light samples of `shaft-masks` with `side` rows of `side`, row by row, as coordinates on the
/// light: within [-1, 1]^2, for round lights within the unit disk (of a sun equal areas of it are
/// equal solid angles); a line has the first one only. The coordinates of the reference's
/// patterns, so that the same samples can be cast as rays.
pub fn light_samples(shape: &LightShape, side: u32) -> Vec<DVec2> {
    let tangent = tangent(shape);
    let on_light = |x: f64, y: f64| {
        let at = DVec2::new(x, y);
        let at = match shape {
            LightShape::Disk { .. } | LightShape::Sphere { .. } | LightShape::Sun { .. } => {
                TURN.rotate(at)
            }
            LightShape::Rect { .. } => DVec2::new(x, y + x / f64::from(side)),
            LightShape::Point | LightShape::Line { .. } => at,
        };
        if tangent == 0.0 || at == DVec2::ZERO {
            return at;
        }
        // Height of the spherical cap up to a direction, as a part of the light's.
        let height = |tan: f64| 2.0 * (0.5 * tan.atan()).sin().powi(2);
        let ring = (height(tangent * at.length()) / height(tangent)).sqrt();
        at.normalize() * ring
    };
    let row = |row: Row| (0..side).map(move |column| on_light(row.x(column, tangent), row.y));
    rows(shape, side).into_iter().flat_map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_on_the_light_and_even() {
        let sun = |angular_diameter: f32| LightShape::Sun { angular_diameter };
        let shapes = [
            LightShape::Disk { radius: 0.3 },
            LightShape::Sphere { radius: 2.0 },
            sun(0.01),
            sun(1.0),
            sun(3.0),
        ];
        for shape in shapes {
            for side in [8, 16, 32] {
                let samples = light_samples(&shape, side);
                assert_eq!(samples.len(), (side * side) as usize);
                assert!(samples.iter().all(|p| p.length() <= 1.0), "{shape:?}");
                let mean = samples.iter().sum::<DVec2>() / samples.len() as f64;
                assert!(mean.length() < 1.0e-9, "{shape:?}: {mean}");
                // Of a disk with equal weights the mean square of the radius is 1 / 2.
                let square: f64 = samples.iter().map(|p| p.length_squared()).sum();
                let square = square / samples.len() as f64;
                let off = (square - 0.5).abs() * f64::from(side);
                assert!(off < 0.3, "{shape:?} {side}: {square}");
            }
        }
        let square = light_samples(
            &LightShape::Rect {
                width: 2.0,
                height: 1.0,
            },
            8,
        );
        // Each in its cell, at places of its own along the first axis.
        let cells = square.iter().map(|p| (4.0 * (*p + 1.0)).floor());
        let wanted = (0..64).map(|i| DVec2::new(f64::from(i % 8), f64::from(i / 8)));
        assert!(cells.eq(wanted), "{square:?}");
        let mut places: Vec<f64> = square.iter().map(|p| p.x).collect();
        places.sort_by(f64::total_cmp);
        let even = |(i, x): (usize, &f64)| (x - ((i as f64 + 0.5) / 32.0 - 1.0)).abs() < 1.0e-12;
        assert!(places.iter().enumerate().all(even), "{places:?}");
        let line = light_samples(&LightShape::Line { length: 1.0 }, 8);
        let evenly =
            |(i, p): (usize, &DVec2)| (p.x - ((i as f64 + 0.5) / 32.0 - 1.0)).abs() < 1.0e-12;
        assert!(line.iter().enumerate().all(evenly), "{line:?}");
    }
}
