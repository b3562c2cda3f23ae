//! Casting the rays of a picture, tile by tile on all cores.

use std::ops::Range;
use std::time::Instant;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::embree::{PACKET, Packet, Tracer};
use super::light::{Domain, Emitter, Seen};
use super::patterns::Patterns;
use super::points::{Point, Points, TILE, TILE_PIXELS, pixel_of, place_of};
use super::{Casting, RivalError, RivalSampling};
use crate::light::AreaLight;
use crate::reference::Reference;

/// What is the same for all tiles.
struct Job<'a> {
    tracer: &'a Tracer,
    points: &'a Points,
    emitter: Emitter,
    patterns: Patterns,
}

/// Samples of a pixel so far.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    cast: u16,
    /// Those that are seen.
    seen: u16,
}

/// How much of its samples a pixel sees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Level {
    Dark,
    #[default]
    Lit,
    Partial,
}

/// Rays waiting until they fill a packet.
struct Queue<'a> {
    tracer: &'a Tracer,
    packet: Packet,
    /// The pixel in its tile of each ray.
    owners: [u8; PACKET],
    count: usize,
    rays: u64,
}

impl Queue<'_> {
    #[inline(always)]
    fn add(&mut self, at: usize, origin: Vec3, direction: Vec3, end: f32, tallies: &mut [Tally]) {
        self.packet.set(self.count, origin, direction, end);
        self.owners[self.count] = at as u8;
        self.count += 1;
        if self.count == PACKET {
            self.flush(tallies);
        }
    }

    #[inline]
    fn flush(&mut self, tallies: &mut [Tally]) {
        if self.count == 0 {
            return;
        }
        self.tracer.cast_packet(&mut self.packet, self.count);
        for lane in 0..self.count {
            let is_free = self.packet.is_free(lane);
            tallies[usize::from(self.owners[lane])].seen += u16::from(is_free);
        }
        self.rays += self.count as u64;
        self.count = 0;
    }
}

impl Tracer {
    pub(super) fn cast(
        &self,
        _: &Reference<'_>,
        points: &Points,
        light: &AreaLight,
        sampling: RivalSampling,
    ) -> Result<Casting, RivalError> {
        let (first, more) = match sampling {
            RivalSampling::Plain(rays) => (rays as usize, 0),
            RivalSampling::Adaptive { first, more } => (first as usize, more as usize),
        };
        let emitter = Emitter::new(light);
        let job = Job {
            tracer: self,
            points,
            patterns: Patterns::new(emitter.domain(), first, more),
            emitter,
        };
        let start = Instant::now();
        let (visibility, rays) = job.run(first);
        Ok(Casting {
            ms: start.elapsed().as_secs_f64() * 1.0e3,
            visibility,
            rays,
        })
    }
}

impl Job<'_> {
    /// Visibility, rows from the top, and the number of rays.
    fn run(&self, first: usize) -> (Vec<f32>, u64) {
        let all = self.patterns.count();
        let first = first.min(all);
        let mut tallies = vec![Tally::default(); self.points.list.len()];
        let mut rays = self.pass(&mut tallies, 0..first, |_, _| true);
        if first < all {
            let levels = self.picture(&tallies, Tally::level);
            rays += self.pass(&mut tallies, first..all, |x, y| {
                self.is_mixed(&levels, x, y)
            });
        }
        (self.picture(&tallies, Tally::visibility), rays)
    }

    /// Casts the samples `range` of the pixels that are `wanted`; returns the number of rays.
    fn pass(
        &self,
        tallies: &mut [Tally],
        range: Range<usize>,
        wanted: impl Fn(usize, usize) -> bool + Sync,
    ) -> u64 {
        let tiles = tallies.par_chunks_mut(TILE_PIXELS).enumerate();
        tiles
            .map(|(tile, tallies)| self.cast_tile(tile, tallies, range.clone(), &wanted))
            .sum()
    }

    /// True if the pixels about this one are not all lit or all dark.
    fn is_mixed(&self, levels: &[Level], x: usize, y: usize) -> bool {
        let [width, height] = self.points.size.map(|side| side as usize);
        let here = levels[y * width + x];
        here == Level::Partial || {
            let columns = x.saturating_sub(1)..(x + 2).min(width);
            let mut rows = y.saturating_sub(1)..(y + 2).min(height);
            rows.any(|row| {
                let row = &levels[row * width..(row + 1) * width];
                row[columns.clone()].iter().any(|&other| other != here)
            })
        }
    }

    /// Rows from the top out of tiles.
    fn picture<T: Send>(&self, tallies: &[Tally], of: impl Fn(Tally) -> T + Sync) -> Vec<T> {
        let [width, height] = self.points.size.map(|side| side as usize);
        let pixels = (0..width * height)
            .into_par_iter()
            .with_min_len(width * TILE);
        pixels
            .map(|i| of(tallies[place_of(self.points.columns, i % width, i / width)]))
            .collect()
    }

    fn cast_tile(
        &self,
        tile: usize,
        tallies: &mut [Tally],
        range: Range<usize>,
        wanted: impl Fn(usize, usize) -> bool,
    ) -> u64 {
        let mut queue = Queue {
            tracer: self.tracer,
            packet: Packet::new(),
            owners: [0; PACKET],
            count: 0,
            rays: 0,
        };
        let points = &self.points.list[tile * TILE_PIXELS..][..TILE_PIXELS];
        for (at, point) in points.iter().enumerate() {
            let [x, y] = pixel_of(self.points.columns, tile, at);
            if !point.is_hit || !wanted(x, y) {
                continue;
            }
            let seen = self.emitter.seen_from(point.origin, point.error);
            let draw = self.patterns.draw(x as u64 | (y as u64) << 32);
            tallies[at].cast += range.len() as u16;
            let range = range.clone();
            match self.patterns.domain() {
                Domain::Point => {
                    let samples = range.map(|_| Vec2::ZERO);
                    queue.add_all(at, point, &seen, samples, tallies);
                }
                Domain::Square => {
                    let samples = range.map(|index| draw.square(index));
                    queue.add_all(at, point, &seen, samples, tallies);
                }
                Domain::Disk => {
                    let samples = range.map(|index| draw.disk(index));
                    queue.add_all(at, point, &seen, samples, tallies);
                }
            }
        }
        queue.flush(tallies);
        queue.rays
    }
}

impl Queue<'_> {
    /// Adds the rays of a point to those samples that are above its tangent plane.
    #[inline(always)]
    fn add_all(
        &mut self,
        at: usize,
        point: &Point,
        light: &Seen,
        samples: impl Iterator<Item = Vec2>,
        tallies: &mut [Tally],
    ) {
        if light.is_above(point.normal) {
            for sample in samples {
                let direction = light.towards(sample);
                self.add(at, point.origin, direction, light.end, tallies);
            }
            return;
        }
        // Heights are from the surface, not from the origin above it.
        let least = if light.end.is_finite() {
            -point.lift
        } else {
            0.0
        };
        for sample in samples {
            let direction = light.towards(sample);
            if point.normal.dot(direction) > least {
                self.add(at, point.origin, direction, light.end, tallies);
            }
        }
    }
}

impl Tally {
    /// 1 without samples: nothing is hit there.
    fn visibility(self) -> f32 {
        match self.cast {
            0 => 1.0,
            cast => f32::from(self.seen) / f32::from(cast),
        }
    }

    fn level(self) -> Level {
        if self.seen == self.cast {
            Level::Lit
        } else if self.seen == 0 {
            Level::Dark
        } else {
            Level::Partial
        }
    }
}
