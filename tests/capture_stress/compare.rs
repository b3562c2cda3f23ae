//! What can be compared, and how.

use crate::rig::{PIXELS, SIDE};
use antumbra::reference::{Reference, Sampling, Settings};
use antumbra::stress::Case;
use glam::UVec2;

/// Truth about the pixels of a case.
pub struct Known {
    /// Valid pixels of which rounding does not decide on which side of the light they are.
    pub sure: Vec<bool>,
    /// Visibility of the light's centre.
    pub center: Vec<f32>,
    /// Whether that changes within a pixel.
    pub edge: Vec<bool>,
}

/// Places tried in each direction to find edges between pixel centres.
const FINER: u32 = 3;

/// The distance from a receiver's plane to the light, as a part of that between them, below which
/// single precision cannot tell the sides.
const EDGE_ON: f64 = 1.0e-5;

/// [`Known::sure`] of a case.
pub fn sure(case: &Case) -> Vec<bool> {
    sure_of(&Reference::new(&case.scene).unwrap(), case)
}

fn sure_of(reference: &Reference<'_>, case: &Case) -> Vec<bool> {
    let light = case.area_light();
    let settings = Settings {
        camera: &case.camera,
        size: [SIDE; 2],
        light,
        sampling: &Sampling::Plain { samples: 1 },
    };
    let mut sure = reference.render(&settings, &|_| ()).unwrap().valid;
    for (i, sure) in sure.iter_mut().enumerate().filter(|(_, sure)| **sure) {
        let pixel = UVec2::new(i as u32 % SIDE, i as u32 / SIDE);
        let surface = reference.surface(&case.camera, [SIDE; 2], pixel).unwrap();
        let to_light = if light.shape.is_sun() {
            -light.direction.as_dvec3()
        } else {
            light.center.as_dvec3() - surface.position
        };
        *sure = surface.normal.dot(to_light) > EDGE_ON * to_light.length();
    }
    sure
}

pub fn known(case: &Case) -> Known {
    let reference = Reference::new(&case.scene).unwrap();
    let wide = SIDE * FINER;
    let finer = reference
        .center_visibility(&case.camera, [wide; 2], case.area_light())
        .unwrap();
    let at = |x: u32, y: u32| finer[(y * wide + x) as usize];
    let middle = |i: u32| (i % SIDE * FINER + FINER / 2, i / SIDE * FINER + FINER / 2);
    let edge = (0..PIXELS as u32).map(|i| {
        let (x, y) = middle(i);
        let reach = FINER + FINER / 2;
        let rows = y.saturating_sub(reach)..(y + reach + 1).min(wide);
        rows.into_iter().any(|row| {
            let mut columns = x.saturating_sub(reach)..(x + reach + 1).min(wide);
            columns.any(|column| at(column, row) != at(x, y))
        })
    });
    Known {
        edge: edge.collect(),
        center: (0..PIXELS as u32)
            .map(|i| {
                let (x, y) = middle(i);
                at(x, y)
            })
            .collect(),
        sure: sure_of(&reference, case),
    }
}

/// Changes from one picture to another.
#[derive(Debug, Default)]
pub struct Change {
    pub pixels: usize,
    /// Pixels that change by more than asked for.
    pub changed: usize,
    /// Root mean square over pixels that are partly lit, or changed.
    pub rms: f64,
    /// Mean, with its sign.
    pub mean: f64,
    /// The 99.9th percentile.
    pub p999: f32,
    pub most: f32,
}

impl Change {
    pub fn of(from: &[f32], to: &[f32], counted: impl Fn(usize) -> bool, more_than: f32) -> Self {
        let mut change = Self::default();
        let (mut squares, mut partial, mut all) = (0.0, 0, Vec::new());
        for i in (0..from.len()).filter(|i| counted(*i)) {
            let (v, w) = (from[i], to[i]);
            let size = (w - v).abs();
            all.push(size);
            change.changed += usize::from(size > more_than);
            change.mean += f64::from(w - v);
            if v.min(w) < 1.0 && v.max(w) > 0.0 {
                squares += f64::from(size).powi(2);
                partial += 1;
            }
        }
        all.sort_by(f32::total_cmp);
        change.pixels = all.len();
        change.mean /= all.len().max(1) as f64;
        change.rms = (squares / f64::from(partial.max(1))).sqrt();
        change.most = all.last().copied().unwrap_or_default();
        let at = all.len().saturating_sub(1) * 999 / 1000;
        change.p999 = all.get(at).copied().unwrap_or_default();
        change
    }

    /// Part of the pixels that change.
    pub fn part(&self) -> f64 {
        self.changed as f64 / self.pixels.max(1) as f64
    }
}

/// A picture mirrored left for right.
pub fn flipped(picture: &[f32]) -> Vec<f32> {
    let rows = picture.chunks(SIDE as usize);
    rows.flat_map(|row| row.iter().rev().copied()).collect()
}
