//! Tables of light samples, so that a pixel's samples cost little beside their rays.
//!
//! Each set is a Sobol' sequence in two dimensions with an Owen scramble of its own (Owen 1997; the
//! hash is that of Laine and Karras 2011 as improved by Vegdahl 2021). A pixel takes one of many
//! sets and changes it in a way that keeps how evenly it is spread: in the square by a digital
//! shift, in the disk by a turn.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use glam::{UVec2, Vec2};

use super::light::Domain;

/// Samples that all sets together have about.
const ENTRIES: usize = 1 << 14;
/// Turns that a disk may take.
const TURNS: usize = 1 << 10;

/// Sets of samples for one number of rays and one domain.
#[derive(Debug)]
pub(super) struct Patterns {
    domain: Domain,
    /// Samples of a set.
    count: usize,
    /// Number of sets, a power of two.
    sets: usize,
    /// Of the square, in units of 2^-32.
    square: Vec<UVec2>,
    disk: Vec<Vec2>,
    /// Cosine and sine.
    turns: Vec<Vec2>,
}

/// How a pixel takes its samples from the tables.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draw<'a> {
    square: &'a [UVec2],
    disk: &'a [Vec2],
    shift: UVec2,
    turn: Vec2,
}

impl Patterns {
    /// Sets of `first` samples and `more` that go on with them; each of the two parts is in an
    /// order in which samples that follow each other are near each other.
    pub(super) fn new(domain: Domain, first: usize, more: usize) -> Self {
        let count = if domain == Domain::Point {
            1
        } else {
            first + more
        };
        let sets = (ENTRIES / count).clamp(16, 4096).next_power_of_two();
        let mut patterns = Self {
            domain,
            count,
            sets,
            square: Vec::new(),
            disk: Vec::new(),
            turns: (0..TURNS)
                .map(|i| Vec2::from_angle(i as f32 / TURNS as f32 * TAU))
                .collect(),
        };
        if domain == Domain::Point {
            return patterns;
        }
        for set in 0..sets {
            let bits = mix(set as u64 + 0x5851_f42d_4c95_7f2d);
            let seeds = UVec2::new(bits as u32, (bits >> 32) as u32);
            let mut points: Vec<UVec2> = (0..count as u32).map(|i| sobol(i, seeds)).collect();
            let place = |p: &UVec2| spread_bits(p.x) | spread_bits(p.y) << 1;
            points[..first].sort_by_key(place);
            points[first..].sort_by_key(place);
            match domain {
                Domain::Disk => patterns
                    .disk
                    .extend(points.iter().map(|&p| disk(signed(p)))),
                _ => patterns.square.extend(points),
            }
        }
        patterns
    }

    /// Number of samples of a set.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// What the pixel of that number takes.
    #[inline]
    pub(super) fn draw(&self, pixel: u64) -> Draw<'_> {
        let bits = mix(pixel);
        let set = (bits as usize & (self.sets - 1)) * self.count;
        let again = bits.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let turn = (bits >> 32) as usize & (TURNS - 1);
        let range = set..set + self.count;
        Draw {
            square: self.square.get(range.clone()).unwrap_or_default(),
            disk: self.disk.get(range).unwrap_or_default(),
            shift: UVec2::new(again as u32, (again >> 32) as u32),
            turn: self.turns[turn],
        }
    }

    /// Where the samples lie.
    pub(super) fn domain(&self) -> Domain {
        self.domain
    }
}

impl Draw<'_> {
    /// Sample `index` of the square.
    #[inline(always)]
    pub(super) fn square(&self, index: usize) -> Vec2 {
        signed(self.square[index] ^ self.shift)
    }

    /// Sample `index` of the disk.
    #[inline(always)]
    pub(super) fn disk(&self, index: usize) -> Vec2 {
        let p = self.disk[index];
        let t = self.turn;
        Vec2::new(t.x * p.x - t.y * p.y, t.y * p.x + t.x * p.y)
    }
}

/// From units of 2^-32 to -1 to 1, both excluded. 23 bits are kept, and no rounding spoils
/// the spread.
#[inline(always)]
fn signed(p: UVec2) -> Vec2 {
    let unit = |v: u32| ((v >> 9) as i32 as f32 + 0.5) * (2.0 / 8_388_608.0) - 1.0;
    Vec2::new(unit(p.x), unit(p.y))
}

fn sobol(index: u32, seeds: UVec2) -> UVec2 {
    // The first two dimensions: the radical inverse, and the Pascal triangle mod 2.
    let mut y = index;
    for (shift, mask) in [
        (1, 0xaaaa_aaaa),
        (2, 0xcccc_cccc),
        (4, 0xf0f0_f0f0),
        (8, 0xff00_ff00),
        (16, 0xffff_0000_u32),
    ] {
        y ^= (y & mask) >> shift;
    }
    // Scrambles work on reversed bits: a bit is flipped by those below it.
    UVec2::new(scramble(index, seeds.x), scramble(y, seeds.y))
}

/// Flips each bit by a hash of the seed and the bits below it, then reverses all.
fn scramble(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// The upper 16 bits, each followed by a 0.
fn spread_bits(v: u32) -> u32 {
    let mut v = v >> 16;
    v = (v | v << 8) & 0x00ff_00ff;
    v = (v | v << 4) & 0x0f0f_0f0f;
    v = (v | v << 2) & 0x3333_3333;
    (v | v << 1) & 0x5555_5555
}

/// Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square".
fn disk(p: Vec2) -> Vec2 {
    if p == Vec2::ZERO {
        p
    } else if p.x.abs() > p.y.abs() {
        p.x * Vec2::from_angle(FRAC_PI_4 * (p.y / p.x))
    } else {
        p.y * Vec2::from_angle(FRAC_PI_2 - FRAC_PI_4 * (p.x / p.y))
    }
}

/// The finaliser of `splitmix64`.
#[inline]
fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_draw_is_spread_evenly() {
        for (first, more) in [(1, 0), (4, 0), (16, 0), (64, 0), (256, 0), (9, 64)] {
            let patterns = Patterns::new(Domain::Square, first, more);
            for pixel in 0..200 {
                let draw = patterns.draw(pixel);
                let points: Vec<Vec2> = (0..first + more).map(|i| draw.square(i)).collect();
                assert!(points.iter().all(|p| p.abs().max_element() < 1.0));
                // Every elementary box of the largest power of two holds one sample; with more
                // samples than that, at least one.
                let boxes = ((first + more).ilog2()) as usize;
                for i in 0..=boxes {
                    let (nx, ny) = (1usize << i, 1usize << (boxes - i));
                    let mut seen = vec![0; nx * ny];
                    for p in &points {
                        let unit = 0.5 * *p + 0.5;
                        let cell =
                            (unit.x * nx as f32) as usize + nx * (unit.y * ny as f32) as usize;
                        seen[cell] += 1;
                    }
                    assert!(seen.iter().all(|&n| n >= 1), "{first} {more} {pixel} {i}");
                }
            }
        }
    }

    #[test]
    fn draws_are_uniform_over_pixels() {
        for count in [1, 9] {
            for domain in [Domain::Square, Domain::Disk] {
                let patterns = Patterns::new(domain, count, 0);
                let pixels = 200_000 / count;
                let mut cells = [0u32; 16];
                for pixel in 0..pixels as u64 {
                    let draw = patterns.draw(pixel);
                    for index in 0..count {
                        // Of the disk, rings of equal area and sectors.
                        let unit = match domain {
                            Domain::Disk => {
                                let p = draw.disk(index);
                                Vec2::new(p.length_squared(), (p.y.atan2(p.x) / TAU + 1.0).fract())
                            }
                            _ => 0.5 * draw.square(index) + 0.5,
                        };
                        cells[(unit.x * 4.0) as usize + 4 * (unit.y * 4.0) as usize] += 1;
                    }
                }
                let wanted = (pixels * count) as f64 / 16.0;
                for n in cells {
                    // Sets are few for many samples: 2 % is five deviations and what they leave.
                    assert!(
                        (f64::from(n) / wanted - 1.0).abs() < 0.02,
                        "{count} {domain:?} {cells:?}"
                    );
                }
            }
        }
    }
}
