//! Points of a light: low-discrepancy numbers, and the maps from the unit square to each shape.

use std::f64::consts::{FRAC_PI_4, PI};

use glam::{DVec2, DVec3};

use super::triangles::End;
use crate::light::{AreaLight, LightShape};

/// A scrambled Sobol' sequence in two dimensions.
///
/// Any 2^k points that follow a multiple of 2^k are spread as evenly as a k-bit grid allows (a
/// (0, 2)-sequence in base 2), so going on with a sequence never spoils what is there. The scramble
/// makes each point uniform over the square: means over it are without bias, and sequences of
/// different seeds are independent of each other. Owen 1997; as hashes, Burley 2020, "Practical
/// Hash-based Owen Scrambling", with the hash of Vegdahl 2021.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sequence {
    seeds: [u32; 2],
}

impl Sequence {
    /// The sequence of that number.
    pub(super) fn new(number: u64) -> Self {
        let bits = mix(number.wrapping_add(0x9e37_79b9_7f4a_7c15));
        Self {
            seeds: [bits as u32, (bits >> 32) as u32],
        }
    }

    /// Point `index`, each coordinate within 0 to 1, both excluded.
    pub(super) fn point(&self, index: u32) -> DVec2 {
        // The first two dimensions of Sobol': the radical inverse, and the Pascal triangle mod 2.
        let x = index.reverse_bits();
        let mut y = index;
        y ^= (y & 0xaaaa_aaaa) >> 1;
        y ^= (y & 0xcccc_cccc) >> 2;
        y ^= (y & 0xf0f0_f0f0) >> 4;
        y ^= (y & 0xff00_ff00) >> 8;
        y ^= (y & 0xffff_0000) >> 16;
        let y = y.reverse_bits();
        let unit = |bits: u32| (f64::from(bits) + 0.5) / 4_294_967_296.0;
        DVec2::new(
            unit(scramble(x, self.seeds[0])),
            unit(scramble(y, self.seeds[1])),
        )
    }
}

/// The finaliser of `splitmix64`.
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Flips each bit by a hash of the seed and the bits above it.
fn scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// From the square [-1, 1]^2 to the unit disk, keeping relative area and neighbourhood
/// (Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square").
fn disk_from_square(p: DVec2) -> DVec2 {
    if p.x == 0.0 && p.y == 0.0 {
        return DVec2::ZERO;
    }
    let (radius, angle) = if p.x.abs() > p.y.abs() {
        (p.x, FRAC_PI_4 * (p.y / p.x))
    } else {
        (p.y, 2.0 * FRAC_PI_4 - FRAC_PI_4 * (p.x / p.y))
    };
    let (sin, cos) = angle.sin_cos();
    DVec2::new(radius * cos, radius * sin)
}

/// A light as one receiver sees it: what turns coordinates on the light into ends of segments.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightFrom<'a> {
    kind: Kind,
    /// From the receiver to the middle of the light; for a sun a unit vector.
    center: DVec3,
    /// From the middle to (1, 0) and to (0, 1).
    half_x: DVec3,
    half_y: DVec3,
    /// How exactly its points are known, metres.
    error: f64,
    /// How bright its parts are.
    light: &'a AreaLight,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Point,
    Rect,
    Disk,
    /// A sphere around the receiver, of this radius.
    Around(f64),
    Line,
    /// A cone of directions about the centre; 1 - cosine of half its angle.
    Sun(f64),
}

impl<'a> LightFrom<'a> {
    pub(super) fn new(light: &'a AreaLight, receiver: DVec3) -> Self {
        let [x, y] = [light.axis_x, light.axis_y].map(|axis| axis.as_dvec3().normalize());
        let center = light.center.as_dvec3() - receiver;
        // The light's frame is rounded to f32, so that its points are no better than that.
        let size = f64::from(light.shape.bounding_radius());
        let error = f64::from(f32::EPSILON) * (light.center.as_dvec3().abs().max_element() + size);
        let planar = |kind, x: DVec3, y: DVec3| Self {
            kind,
            center,
            half_x: x,
            half_y: y,
            error,
            light,
        };
        match light.shape {
            LightShape::Point => planar(Kind::Point, DVec3::ZERO, DVec3::ZERO),
            LightShape::Disk { radius } => {
                planar(Kind::Disk, x * f64::from(radius), y * f64::from(radius))
            }
            LightShape::Rect { width, height } => planar(
                Kind::Rect,
                x * (0.5 * f64::from(width)),
                y * (0.5 * f64::from(height)),
            ),
            LightShape::Line { length } => {
                planar(Kind::Line, x * (0.5 * f64::from(length)), DVec3::ZERO)
            }
            LightShape::Sphere { radius } => {
                let radius = f64::from(radius);
                let square = center.length_squared();
                let ratio = radius * radius / square;
                if square <= radius * radius || !ratio.is_finite() {
                    return planar(Kind::Around(radius), x * radius, y * radius);
                }
                let (x, y) = frame_across(center, x, y);
                let outline = radius * (1.0 - ratio).sqrt();
                Self {
                    center: center * (1.0 - ratio),
                    ..planar(Kind::Disk, x * outline, y * outline)
                }
            }
            LightShape::Sun { angular_diameter } => {
                let half = 0.5 * f64::from(angular_diameter);
                let center = -light.direction.as_dvec3().normalize();
                let (x, y) = frame_across(center, x, y);
                let sin = (0.5 * half).sin();
                Self {
                    kind: Kind::Sun(2.0 * sin * sin),
                    center,
                    half_x: x,
                    half_y: y,
                    error: 0.0,
                    light,
                }
            }
        }
    }

    /// True if all of the light is one point.
    pub(super) fn is_point(&self) -> bool {
        matches!(self.kind, Kind::Point | Kind::Sun(0.0))
    }

    /// The light's middle.
    pub(super) fn middle(&self) -> End {
        self.end(self.center)
    }

    /// Ends whose convex hull, as seen from the receiver, holds all of the light; `None` for a light
    /// all around.
    pub(super) fn hull(&self) -> Option<[End; 4]> {
        // A little wider than the light, for rounding. A sun's cone fits into a pyramid.
        let reach = match self.kind {
            Kind::Around(_) => return None,
            Kind::Sun(rise) => {
                let cos = 1.0 - rise;
                (1.0 - cos * cos).max(0.0).sqrt() / cos
            }
            _ => 1.0,
        } * (1.0 + 1.0e-9);
        let corner =
            |x: f64, y: f64| self.end(self.center + reach * (x * self.half_x + y * self.half_y));
        Some([
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ])
    }

    /// The point of the light for a point of the unit square, equal areas to equal areas; on a line
    /// or rectangle to equal parts of its light.
    pub(super) fn spread(&self, p: DVec2) -> End {
        let p = 2.0 * p - 1.0;
        match self.kind {
            Kind::Disk | Kind::Sun(_) => self.at(disk_from_square(p)),
            Kind::Line => {
                let place = self.light.profile.place_of(0.5 * (p.x + 1.0));
                self.at(DVec2::new(2.0 * place - 1.0, 0.0))
            }
            Kind::Rect if self.light.is_uneven() => {
                let place = self.light.weights.place_of((0.5 * (p + 1.0)).to_array());
                self.at(2.0 * DVec2::from_array(place) - 1.0)
            }
            _ => self.at(p),
        }
    }

    /// The point of the light at coordinates of its own: within [-1, 1]^2, for disk, sphere and
    /// sun within the unit disk; a line has the first one only.
    pub(super) fn at(&self, p: DVec2) -> End {
        match self.kind {
            Kind::Point => self.middle(),
            Kind::Rect | Kind::Disk | Kind::Line => {
                self.end(self.center + p.x * self.half_x + p.y * self.half_y)
            }
            Kind::Around(radius) => {
                let z = self.half_x.cross(self.half_y) / radius;
                let (sin, cos) = (PI * p.x).sin_cos();
                let ring = (1.0 - p.y * p.y).max(0.0).sqrt();
                let around = ring * (cos * self.half_x + sin * self.half_y);
                self.end(self.center + around + p.y * z)
            }
            Kind::Sun(rise) => {
                // Area on the sphere of directions is that of the height (Archimedes).
                let square = p.length_squared().min(1.0);
                let height = rise * square;
                let ring = (rise * (2.0 - height)).max(0.0).sqrt();
                let across = ring * (p.x * self.half_x + p.y * self.half_y);
                self.end((1.0 - height) * self.center + across)
            }
        }
    }

    fn end(&self, offset: DVec3) -> End {
        End {
            offset,
            error: self.error,
            at_infinity: matches!(self.kind, Kind::Sun(_)),
        }
    }
}

/// Two unit vectors across `along`, the first as near to `x` as can be, else to `y`.
fn frame_across(along: DVec3, x: DVec3, y: DVec3) -> (DVec3, DVec3) {
    let along = along.normalize();
    let near = if along.dot(x).abs() < 0.9 { x } else { y };
    let x = (near - along * near.dot(along)).normalize();
    (x, along.cross(x))
}

/// Where a receiver's tangent plane stands to a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// All of the light is above.
    Above,
    /// Its centre is above, some of it is not.
    CutAbove,
    /// Its centre is on or below.
    Below,
}

/// The side of a light on which the plane through `position` across `normal` leaves it.
pub(super) fn side(light: &AreaLight, position: DVec3, normal: DVec3) -> Side {
    let [x, y] = [light.axis_x, light.axis_y].map(|axis| normal.dot(axis.as_dvec3()));
    let (height, reach) = match light.shape {
        LightShape::Sun { angular_diameter } => {
            let sin = -normal.dot(light.direction.as_dvec3());
            let half = 0.5 * f64::from(angular_diameter);
            (sin.clamp(-1.0, 1.0).asin(), half)
        }
        shape => {
            let height = normal.dot(light.center.as_dvec3() - position);
            let reach = match shape {
                LightShape::Disk { radius } => f64::from(radius) * x.hypot(y),
                LightShape::Sphere { radius } => f64::from(radius),
                LightShape::Rect { width, height } => {
                    0.5 * (f64::from(width) * x.abs() + f64::from(height) * y.abs())
                }
                LightShape::Line { length } => 0.5 * f64::from(length) * x.abs(),
                LightShape::Point | LightShape::Sun { .. } => 0.0,
            };
            (height, reach)
        }
    };
    if height > reach {
        Side::Above
    } else if height > 0.0 {
        Side::CutAbove
    } else {
        Side::Below
    }
}

/// True if `position` is not in front of a disk's or rectangle's plane.
pub(super) fn is_behind(light: &AreaLight, position: DVec3) -> bool {
    let to = position - light.center.as_dvec3();
    light.shape.is_one_sided() && to.dot(light.direction.as_dvec3()) <= 0.0
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use glam::Vec3;

    use super::*;

    #[test]
    fn sequences_fill_every_elementary_box() {
        for seed in 0..20 {
            let sequence = Sequence::new(seed);
            for (k, start) in [(4u32, 0u32), (6, 64), (8, 512)] {
                for i in 0..=k {
                    let (nx, ny) = (1u32 << i, 1u32 << (k - i));
                    let mut seen = vec![0; 1 << k];
                    for index in start..start + (1 << k) {
                        let p = sequence.point(index);
                        assert!(p.min_element() > 0.0 && p.max_element() < 1.0);
                        let cell = (p.x * f64::from(nx)) as usize
                            + (p.y * f64::from(ny)) as usize * nx as usize;
                        seen[cell] += 1;
                    }
                    assert!(seen.iter().all(|&n| n == 1), "{seed} {k} {i}: {seen:?}");
                }
            }
        }
    }

    #[test]
    fn points_of_a_sequence_are_uniform() {
        // Over seeds, the first point alone has to be anywhere: an unscrambled one would not be.
        let mut cells = [0u32; 64];
        for seed in 0..64_000 {
            let p = Sequence::new(seed).point(5);
            cells[(p.x * 8.0) as usize + 8 * (p.y * 8.0) as usize] += 1;
        }
        let chi: f64 = cells
            .iter()
            .map(|&n| (f64::from(n) - 1000.0).powi(2) / 1000.0)
            .sum();
        // 63 degrees of freedom: 63 +- 11.2; five deviations.
        assert!(chi < 120.0, "{chi}");
    }

    #[test]
    fn disks_keep_area() {
        // An even grid's cells fall into rings by their shells and into sectors by their wedges.
        let n = 200;
        let (mut within, mut sectors) = ([0; 3], [0; 4]);
        for i in 0..n * n {
            let cell = |i: usize| (i as f64 + 0.5) / n as f64 * 2.0 - 1.0;
            let p = disk_from_square(DVec2::new(cell(i % n), cell(i / n)));
            assert!(p.length() < 1.0);
            for (count, radius) in within.iter_mut().zip([0.25, 0.5, 0.75]) {
                *count += usize::from(p.length() < radius);
            }
            let turn = (p.y.atan2(p.x) / TAU + 1.0).fract();
            sectors[(turn * 4.0) as usize] += 1;
        }
        assert_eq!(within, [n * n / 16, n * n / 4, n * n * 9 / 16]);
        assert_eq!(sectors, [n * n / 4; 4]);
    }

    #[test]
    fn samples_lie_on_their_light() {
        let at = |shape| {
            AreaLight::new(
                shape,
                Vec3::new(0.5, 3.0, -1.0),
                Vec3::new(0.1, -1.0, 0.2),
                Vec3::X,
            )
        };
        let receiver = DVec3::new(1.0, 0.2, 0.3);
        let sphere = at(LightShape::Sphere { radius: 0.7 });
        let from = LightFrom::new(&sphere, receiver);
        let to = sphere.center.as_dvec3() - receiver;
        let sequence = Sequence::new(1);
        for index in 0..200 {
            let end = from.spread(sequence.point(index)).offset;
            // The outline is where lines from the receiver touch the sphere.
            let middle = to * (1.0 - 0.49_f64 / to.length_squared());
            assert!((end - middle).dot(to).abs() < 1e-6);
            assert!(end.angle_between(to) <= (0.7_f32 as f64 / to.length()).asin() + 1e-6);
        }
        let edge = from.at(DVec2::new(0.6, 0.8)).offset;
        assert!((edge.angle_between(to) - (0.7 / to.length()).asin()).abs() < 1e-6);

        let sun = at(LightShape::Sun {
            angular_diameter: 1.0,
        });
        let from = LightFrom::new(&sun, receiver);
        let towards = -sun.direction.as_dvec3();
        let mut inner = 0;
        for index in 0..1024 {
            let d = from.spread(sequence.point(index)).offset;
            assert!((d.length() - 1.0).abs() < 1e-6);
            let angle = d.angle_between(towards);
            assert!(angle <= 0.5 + 1e-6);
            inner += usize::from(angle < 0.25);
        }
        let part = (1.0 - 0.25_f64.cos()) / (1.0 - 0.5_f64.cos());
        assert!((inner as f64 / 1024.0 - part).abs() < 0.01);
        let rim = from.at(DVec2::new(0.0, 1.0)).offset;
        assert!((rim.angle_between(towards) - 0.5).abs() < 1e-6);

        let inside = LightFrom::new(
            &sphere,
            sphere.center.as_dvec3() + DVec3::new(0.1, 0.0, 0.0),
        );
        for index in 0..200 {
            let end = inside.spread(sequence.point(index)).offset;
            let from_center = end + DVec3::new(0.1, 0.0, 0.0);
            assert!((from_center.length() - f64::from(0.7_f32)).abs() < 1e-6);
        }
    }

    #[test]
    fn sides_of_the_tangent_plane() {
        let light = |shape| AreaLight::new(shape, Vec3::new(0.0, 1.0, 0.0), Vec3::X, Vec3::Y);
        let of = |shape| side(&light(shape), DVec3::ZERO, DVec3::Y);
        // The disk stands upright: axis_x is Y.
        assert_eq!(of(LightShape::Disk { radius: 0.99 }), Side::Above);
        assert_eq!(of(LightShape::Disk { radius: 1.01 }), Side::CutAbove);
        assert_eq!(of(LightShape::Line { length: 1.99 }), Side::Above);
        assert_eq!(of(LightShape::Line { length: 2.01 }), Side::CutAbove);
        let rect = |width, height| LightShape::Rect { width, height };
        assert_eq!(of(rect(1.99, 50.0)), Side::Above);
        assert_eq!(of(rect(2.01, 0.1)), Side::CutAbove);
        assert_eq!(of(LightShape::Sphere { radius: 1.01 }), Side::CutAbove);
        assert_eq!(of(LightShape::Point), Side::Above);
        let below = side(&light(LightShape::Point), DVec3::Y, DVec3::Y);
        assert_eq!(below, Side::Below);
        assert!(is_behind(
            &light(rect(1.0, 1.0)),
            DVec3::new(-0.1, 0.0, 0.0)
        ));
        assert!(!is_behind(
            &light(rect(1.0, 1.0)),
            DVec3::new(0.1, 0.0, 0.0)
        ));
        assert!(!is_behind(
            &light(LightShape::Point),
            DVec3::new(-0.1, 0.0, 0.0)
        ));
    }
}
