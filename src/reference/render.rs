//! Casting a whole picture, in bands of rows.

use glam::{DVec2, UVec2};
use rayon::prelude::*;

use super::beam::Beam;
use super::samples::{LightFrom, Sequence};
use super::surface::{Surface, is_valid, surface};
use super::{Masks, Pattern, Reference, Sampling, Settings, StandardError, Truth};

/// Rows that one thread does at a time. Results do not depend on it but where pixels of different
/// bands would share their estimates of the error.
const BAND: u32 = 8;
/// Parts of a sequence that are held against each other to estimate its error.
const PARTS: usize = 4;

/// A band of rows with one more row above and below, where there is one.
struct Band<'a> {
    reference: &'a Reference<'a>,
    settings: &'a Settings<'a>,
    /// First row of `surfaces`, in the picture.
    top: u32,
    /// Rows of the band itself, in the picture.
    rows: std::ops::Range<u32>,
    surfaces: Vec<Option<Surface>>,
}

/// What came of a band.
#[derive(Default)]
struct Done {
    visibility: Vec<f32>,
    valid: Vec<bool>,
    words: Vec<u64>,
    rays: u64,
    /// Sum of variances, largest variance, pixels, pixels above the limit.
    errors: (f64, f64, u64, u64),
}

/// Samples of one pixel so far.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    cast: u32,
    /// Those that are seen, of each quarter of the samples.
    seen: [u32; PARTS],
}

impl Tally {
    fn seen(&self) -> u32 {
        self.seen.iter().sum()
    }

    fn visibility(&self) -> f64 {
        f64::from(self.seen()) / f64::from(self.cast.max(1))
    }

    fn is_partial(&self) -> bool {
        self.seen() != 0 && self.seen() != self.cast
    }

    /// Variance of the mean, from how the quarters differ, as if they were independent. Each is
    /// spread evenly by itself and they fill each other's gaps, so that it is rather less.
    fn variance(&self) -> f64 {
        let n = PARTS as f64;
        let cast = f64::from(self.cast.max(1)) / n;
        let means = self.seen.map(|seen| f64::from(seen) / cast);
        let mean = means.iter().sum::<f64>() / n;
        means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))
    }

    /// Quarters of twice as many samples: the first two are known.
    fn widen(&mut self) {
        let [a, b, c, d] = self.seen;
        self.seen = [a + b, c + d, 0, 0];
    }
}

pub(super) fn render(
    reference: &Reference<'_>,
    settings: &Settings<'_>,
    progress: &(dyn Fn(u64) + Sync),
) -> Truth {
    let [width, height] = settings.size;
    let bands: Vec<Done> = (0..height.div_ceil(BAND))
        .into_par_iter()
        .map_init(Beam::default, |beam, band| {
            let band = Band::new(reference, settings, band);
            let done = band.cast(beam);
            progress(done.visibility.len() as u64);
            done
        })
        .collect();

    let pixels = width as usize * height as usize;
    let mut visibility = Vec::with_capacity(pixels);
    let mut valid = Vec::with_capacity(pixels);
    let mut words = Vec::new();
    let (mut rays, mut sum) = (0, 0.0);
    let mut error = StandardError::default();
    for band in bands {
        visibility.extend(band.visibility);
        valid.extend(band.valid);
        words.extend(band.words);
        rays += band.rays;
        sum += band.errors.0;
        error.max = error.max.max(band.errors.1.sqrt());
        error.pixels += band.errors.2;
        error.above += band.errors.3;
    }
    if error.pixels > 0 {
        error.rms = (sum / error.pixels as f64).sqrt();
    }
    Truth {
        size: settings.size,
        visibility,
        valid,
        standard_error: matches!(settings.sampling, Sampling::Estimated { .. }).then_some(error),
        rays,
        masks: match settings.sampling {
            Sampling::Pattern(pattern) => Some(Masks {
                samples: pattern.len(),
                words,
            }),
            _ => None,
        },
    }
}

pub(super) fn center_visibility(reference: &Reference<'_>, settings: &Settings<'_>) -> Vec<f32> {
    let [width, height] = settings.size;
    let rows = (0..height).into_par_iter().map_init(Vec::new, |stack, y| {
        let pixel = |x: u32| {
            let at = UVec2::new(x, y);
            let (scene, triangles) = (reference.scene, &reference.triangles);
            let seen = surface(scene, triangles, settings.camera, settings.size, at, stack);
            let Some(at) = seen else {
                return 1.0;
            };
            let end = LightFrom::new(settings.light, at.position).middle();
            let is_seen =
                at.normal.dot(end.offset) > 0.0 && !triangles.occluded(&at.start, &end, stack);
            f32::from(u8::from(is_seen))
        };
        (0..width).map(pixel).collect::<Vec<f32>>()
    });
    rows.collect::<Vec<_>>().concat()
}

impl<'a> Band<'a> {
    fn new(reference: &'a Reference<'a>, settings: &'a Settings<'a>, number: u32) -> Self {
        let [width, height] = settings.size;
        let rows = number * BAND..((number + 1) * BAND).min(height);
        let top = rows.start.saturating_sub(1);
        let bottom = (rows.end + 1).min(height);
        let mut stack = Vec::new();
        let mut surfaces = Vec::with_capacity(((bottom - top) * width) as usize);
        for y in top..bottom {
            for x in 0..width {
                surfaces.push(surface(
                    reference.scene,
                    &reference.triangles,
                    settings.camera,
                    settings.size,
                    UVec2::new(x, y),
                    &mut stack,
                ));
            }
        }
        Self {
            reference,
            settings,
            top,
            rows,
            surfaces,
        }
    }

    fn width(&self) -> usize {
        self.settings.size[0] as usize
    }

    /// Numbers of the band's own pixels within `surfaces`.
    fn own(&self) -> std::ops::Range<usize> {
        let row = |y: u32| (y - self.top) as usize * self.width();
        row(self.rows.start)..row(self.rows.end)
    }

    /// Number in the picture of the pixel with this number within `surfaces`.
    fn in_picture(&self, at: usize) -> u64 {
        u64::from(self.top) * self.width() as u64 + at as u64
    }

    /// The up to 8 pixels around one, as numbers within `surfaces`.
    fn around(&self, at: usize) -> impl Iterator<Item = usize> + use<> {
        let width = self.width();
        let height = self.surfaces.len() / width;
        let (x, y) = (at % width, at / width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.flat_map(move |row| {
            let columns = x.saturating_sub(1)..(x + 2).min(width);
            columns.map(move |column| row * width + column)
        })
        .filter(move |&other| other != at)
    }

    fn cast(&self, beam: &mut Beam) -> Done {
        let mut done = Done::default();
        for at in self.own() {
            let around = self.around(at).map(|other| &self.surfaces[other]);
            let valid = is_valid(self.settings.light, &self.surfaces[at], around);
            done.valid.push(valid);
        }
        match self.settings.sampling {
            Sampling::Estimated {
                samples,
                standard_error,
                most,
            } => {
                let first = samples.next_multiple_of(PARTS as u32);
                self.estimated(beam, &mut done, first, *standard_error, *most);
            }
            Sampling::Plain { samples } => {
                for at in self.own() {
                    let mut tally = Tally::default();
                    self.go_on(beam, at, &mut tally, *samples, &mut done.rays);
                    done.visibility.push(self.visibility(at, &tally));
                }
            }
            Sampling::Adaptive { first, more } => self.adaptive(beam, &mut done, *first, *more),
            Sampling::Pattern(pattern) => self.pattern(beam, &mut done, pattern),
        }
        done
    }

    fn visibility(&self, at: usize, tally: &Tally) -> f32 {
        match self.surfaces[at] {
            Some(_) => tally.visibility() as f32,
            None => 1.0,
        }
    }

    fn estimated(
        &self,
        beam: &mut Beam,
        done: &mut Done,
        first: u32,
        limit: Option<f64>,
        most: u32,
    ) {
        let mut tallies = vec![Tally::default(); self.surfaces.len()];
        for at in self.own() {
            self.go_on(beam, at, &mut tallies[at], first, &mut done.rays);
        }
        // Variance of each partly lit pixel, with those around it.
        let variances = |tallies: &[Tally]| -> Vec<(usize, f64)> {
            let own = self.own();
            let is_partial = |at: usize| {
                own.contains(&at) && self.surfaces[at].is_some() && tallies[at].is_partial()
            };
            let partial = own.clone().filter(|&at| is_partial(at));
            let pooled = partial.map(|at| {
                let (mut sum, mut count) = (tallies[at].variance(), 1.0);
                for other in self.around(at).filter(|&other| is_partial(other)) {
                    // As it would be with as many samples as here, by the law of independent ones.
                    let ratio = f64::from(tallies[other].cast) / f64::from(tallies[at].cast);
                    sum += tallies[other].variance() * ratio;
                    count += 1.0;
                }
                (at, sum / count)
            });
            pooled.collect()
        };
        let limit = limit.map_or(f64::INFINITY, |limit| limit * limit);
        let mut current = variances(&tallies);
        loop {
            let mut went_on = false;
            for &(at, variance) in &current {
                let tally = &mut tallies[at];
                let count = tally.cast.saturating_mul(2);
                if variance > limit && count <= most {
                    tally.widen();
                    self.go_on(beam, at, tally, count, &mut done.rays);
                    went_on = true;
                }
            }
            if !went_on {
                break;
            }
            current = variances(&tallies);
        }
        for (_, variance) in current {
            done.errors.0 += variance;
            done.errors.1 = done.errors.1.max(variance);
            done.errors.2 += 1;
            done.errors.3 += u64::from(variance > limit);
        }
        for at in self.own() {
            let visibility = self.visibility(at, &tallies[at]);
            done.visibility.push(visibility);
        }
    }

    fn adaptive(&self, beam: &mut Beam, done: &mut Done, first: u32, more: u32) {
        let mut tallies = vec![Tally::default(); self.surfaces.len()];
        // Rows around the band are needed to decide, and counted where they belong.
        let mut elsewhere = 0;
        for (at, tally) in tallies.iter_mut().enumerate() {
            let rays = if self.own().contains(&at) {
                &mut done.rays
            } else {
                &mut elsewhere
            };
            self.go_on(beam, at, tally, first, rays);
        }
        let seen = |at: usize| match self.surfaces[at] {
            Some(_) => tallies[at].seen(),
            None => first,
        };
        for at in self.own() {
            let here = seen(at);
            let agrees = (here == 0 || here == first) && self.around(at).all(|o| seen(o) == here);
            let mut tally = tallies[at];
            if !agrees {
                self.go_on(beam, at, &mut tally, first + more, &mut done.rays);
            }
            done.visibility.push(self.visibility(at, &tally));
        }
    }

    fn pattern(&self, beam: &mut Beam, done: &mut Done, pattern: &Pattern) {
        let count = pattern.len();
        let all = |words: &mut [u64]| {
            for (i, word) in words.iter_mut().enumerate() {
                let left = count - 64 * i;
                *word = if left < 64 { (1 << left) - 1 } else { u64::MAX };
            }
        };
        for at in self.own() {
            let mut words = vec![0; count.div_ceil(64)];
            let mut seen = 0;
            if let Some(surface) = &self.surfaces[at] {
                let light = LightFrom::new(self.settings.light, surface.position);
                beam.clear();
                for index in 0..count {
                    let (place, end) = pattern.end(&light, index);
                    if surface.normal.dot(end.offset) > 0.0 {
                        beam.add(index as u32, place, end);
                    }
                }
                let triangles = &self.reference.triangles;
                beam.trace(triangles, &surface.start, surface.normal, |index| {
                    words[index as usize / 64] |= 1 << (index % 64);
                    seen += 1;
                });
                done.rays += count as u64;
            } else {
                all(&mut words);
                seen = count;
            }
            done.words.extend(words);
            done.visibility.push((seen as f64 / count as f64) as f32);
        }
    }

    /// Casts what is missing until a pixel has `count` samples.
    fn go_on(&self, beam: &mut Beam, at: usize, tally: &mut Tally, count: u32, rays: &mut u64) {
        let Some(surface) = &self.surfaces[at] else {
            return;
        };
        let light = LightFrom::new(self.settings.light, surface.position);
        let triangles = &self.reference.triangles;
        let part = |index: u32| (u64::from(index) * PARTS as u64 / u64::from(count)) as u32;
        let first = tally.cast;
        tally.cast = count;
        beam.clear();
        if light.is_point() {
            // All samples are one, and the error is none.
            let end = light.middle();
            if surface.normal.dot(end.offset) > 0.0 {
                beam.add(0, DVec2::splat(0.5), end);
            }
            *rays += u64::from(first == 0);
            tally.seen = [0; PARTS];
            beam.trace(triangles, &surface.start, surface.normal, |_| {
                for index in 0..count {
                    tally.seen[part(index) as usize] += 1;
                }
            });
            return;
        }
        *rays += u64::from(count - first);
        let hull = light.hull();
        let normal = surface.normal;
        let whole = hull.and_then(|hull| beam.trace_hull(triangles, &surface.start, normal, &hull));
        if let Some(is_seen) = whole {
            for index in first..count {
                tally.seen[part(index) as usize] += u32::from(is_seen);
            }
            return;
        }
        beam.clear();
        // A rival that cast the truth's own samples would look better than it is.
        let rival = !matches!(self.settings.sampling, Sampling::Estimated { .. });
        let sequence = Sequence::new(self.in_picture(at) | u64::from(rival) << 63);
        for index in first..count {
            let place = sequence.point(index);
            let end = light.spread(place);
            if surface.normal.dot(end.offset) > 0.0 {
                beam.add(part(index), place, end);
            }
        }
        beam.trace(triangles, &surface.start, surface.normal, |part| {
            tally.seen[part as usize] += 1;
        });
    }
}
