//! What an unshadowed light gives to a surface.
//!
//! A rectangle and a line are exact: Lambert's formula for the polygon above the surface's plane,
//! and an integral in closed form. So is a sphere (Snyder 1996, "Area light sources for real-time
//! graphics"). A disk has a closed form for its whole form factor, as a vector: its dot product with
//! a surface's normal is the form factor wherever all of the disk is above the surface's plane.
//! Where the plane cuts the disk, a sphere of the same form factor stands in.

use super::{AreaLight, LightShape};
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI};

impl AreaLight {
    /// Irradiance in lux of a white light at `point` on a surface with unit normal `normal` (scene
    /// space, metres), from what lies above the surface; without shadows and colour.
    ///
    /// Disk and rectangle emit like Lambert surfaces, to their front. Spheres, lines and points
    /// emit the same all round. Cone and range are those of the centre. Twin of `light_irradiance`
    /// in `common/light_irradiance.glsl`.
    pub fn irradiance(&self, point: Vec3, normal: Vec3) -> f32 {
        let offset = self.center - point;
        let square = offset.length_squared().max(f32::MIN_POSITIVE);
        let towards = offset / square.sqrt();
        let full = match self.shape {
            LightShape::Point => self.candela() * normal.dot(towards).max(0.0) / square,
            LightShape::Disk { radius } => {
                let factor = disk_factor(offset, self.direction, radius);
                self.candela() / (radius * radius) * factor_above(factor, normal)
            }
            LightShape::Rect { width, height } => {
                let (x, y) = (self.axis_x * (0.5 * width), self.axis_y * (0.5 * height));
                let corners = [
                    offset - x - y,
                    offset + x - y,
                    offset + x + y,
                    offset - x + y,
                ];
                let front = offset.dot(self.direction) < 0.0;
                let factor = if front {
                    rect_above(corners, normal)
                } else {
                    0.0
                };
                self.candela() * PI / (width * height) * factor
            }
            LightShape::Sphere { radius } => {
                let part = (radius * radius / square).min(1.0);
                self.candela() / (radius * radius) * factor_above(towards * part, normal)
            }
            LightShape::Line { length } => {
                self.candela() / length * line_integral(offset, self.axis_x, 0.5 * length, normal)
            }
            LightShape::Sun { angular_diameter } => {
                let part = (0.5 * angular_diameter).sin().powi(2).max(1.0e-12);
                self.intensity * factor_above(-self.direction * part, normal) / part
            }
        };
        full * self.falloff(point)
    }

    /// What spot cone and range leave at a point, 0 to 1.
    fn falloff(&self, point: Vec3) -> f32 {
        if self.shape.is_sun() {
            return 1.0;
        }
        let offset = self.center - point;
        let square = offset.length_squared().max(f32::MIN_POSITIVE);
        let cone = self.spot.map_or(1.0, |cone| {
            let along = -offset.dot(self.direction) / square.sqrt();
            let width = (cone.inner.cos() - cone.outer.cos()).max(1.0e-4);
            ((along - cone.outer.cos()) / width).clamp(0.0, 1.0).powi(2)
        });
        // KHR_lights_punctual: a smooth window that reaches 0 at the range.
        let reach = self.range.map_or(0.0, |range| square / (range * range));
        cone * (1.0 - reach * reach).clamp(0.0, 1.0)
    }
}

/// The form factor of a disk as a vector towards it. `offset` leads to its centre, `direction` is
/// its unit normal on the side that emits; zero behind it.
fn disk_factor(offset: Vec3, direction: Vec3, radius: f32) -> Vec3 {
    let height = -offset.dot(direction);
    if height <= 0.0 {
        return Vec3::ZERO;
    }
    let inward = offset + direction * height; // from the point's foot to the centre
    let (zz, ss, rr) = (height * height, inward.length_squared(), radius * radius);
    let sum = zz + ss + rr;
    let inner = zz + rr - ss;
    let root = (inner * inner + 4.0 * zz * ss).sqrt();
    // Written so that no two large numbers cancel, near the axis or far from it.
    let rest = if inner > 0.0 {
        inner + root
    } else {
        4.0 * zz * ss / (root - inner)
    };
    let scale = rr / (root * (sum + root));
    -direction * (scale * rest) + inward * (2.0 * height * scale)
}

/// The form factor of the part of a rectangle above the plane of `normal`: Lambert's formula. The
/// corners are seen from the point and follow each other around the rectangle.
fn rect_above(corners: [Vec3; 4], normal: Vec3) -> f32 {
    let (mut sum, mut crossings) = (0.0, [None; 2]);
    for i in 0..4 {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        let (above_a, above_b) = (normal.dot(a), normal.dot(b));
        let crossing = a + (b - a) * (above_a / (above_a - above_b));
        match (above_a > 0.0, above_b > 0.0) {
            (true, true) => sum += edge(a, b, normal),
            (true, false) => {
                sum += edge(a, crossing, normal);
                crossings[0] = Some(crossing);
            }
            (false, true) => {
                sum += edge(crossing, b, normal);
                crossings[1] = Some(crossing);
            }
            (false, false) => {}
        }
    }
    // The plane itself closes what it has cut.
    if let [Some(down), Some(up)] = crossings {
        sum += edge(down, up, normal);
    }
    // The order of the corners only turns the sign.
    (0.5 * FRAC_1_PI * sum).abs()
}

/// What an edge of a polygon adds: the angle it spans, times the cosine between its plane and the
/// surface's.
fn edge(a: Vec3, b: Vec3, normal: Vec3) -> f32 {
    let (a, b) = (a.normalize_or_zero(), b.normalize_or_zero());
    let cross = a.cross(b);
    let sine = cross.length();
    if sine > 0.0 {
        normal.dot(cross) * (sine.atan2(a.dot(b)) / sine)
    } else {
        0.0
    }
}

/// The form factor of what is above the plane of `normal`, for a sphere of the form factor `factor`.
fn factor_above(factor: Vec3, normal: Vec3) -> f32 {
    let part = factor.length().clamp(1.0e-12, 1.0);
    let up = (factor.dot(normal) / factor.length().max(f32::MIN_POSITIVE)).clamp(-1.0, 1.0);
    if up * up >= part {
        return part * up.max(0.0);
    }
    let along = (1.0 - up * up).max(0.0).sqrt();
    let reach = (1.0 / part - 1.0).max(0.0).sqrt();
    let chord = (-reach * up / along.max(1.0e-6)).clamp(-1.0, 1.0);
    let half = (1.0 - chord * chord).sqrt() * along;
    let above = part * (up * chord.acos() - reach * half) + half.atan2(reach);
    (FRAC_1_PI * above).max(0.0)
}

/// The integral over a line of max(normal . q, 0) / |q|^3, q leading from the point to the line.
/// `offset` leads to the line's middle, `axis` is a unit vector.
fn line_integral(offset: Vec3, axis: Vec3, half: f32, normal: Vec3) -> f32 {
    let middle = offset.dot(axis);
    let across = offset - axis * middle;
    let (height, climb) = (normal.dot(across), normal.dot(axis));
    let (mut from, mut to) = (middle - half, middle + half);
    // The part where height + climb s > 0.
    if climb > 0.0 {
        from = from.max(-height / climb);
    } else if climb < 0.0 {
        to = to.min(-height / climb);
    } else if height <= 0.0 {
        return 0.0;
    }
    if from >= to {
        return 0.0;
    }
    // On the line's own axis the square vanishes, and height with it.
    let least = 1.0e-10 * offset.length_squared().max(f32::MIN_POSITIVE);
    let square = across.length_squared().max(least);
    let end = |s: f32| {
        let distance = (square + s * s).sqrt();
        (height * s / square - climb) / distance
    };
    (end(to) - end(from)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sum over a fine grid of points of the light, in f64.
    fn summed(light: &AreaLight, point: Vec3, normal: Vec3) -> f64 {
        const N: i32 = 600;
        let mut sum = 0.0;
        let mut count = 0.0;
        for k in 0..N * N {
            let [u, v] = [k % N, k / N].map(|i| (2.0 * f64::from(i) + 1.0) / f64::from(N) - 1.0);
            let inside = u * u + v * v <= 1.0;
            let (x, y) = (light.axis_x.as_dvec3(), light.axis_y.as_dvec3());
            let center = (light.center - point).as_dvec3();
            let distance = center.length();
            let (place, emits, counts) = match light.shape {
                LightShape::Disk { radius } => ((x * u + y * v) * f64::from(radius), true, inside),
                LightShape::Rect { width, height } => {
                    let (w, h) = (0.5 * f64::from(width), 0.5 * f64::from(height));
                    (x * (u * w) + y * (v * h), true, true)
                }
                LightShape::Line { length } => (x * (u * 0.5 * f64::from(length)), false, true),
                LightShape::Sphere { radius } => {
                    // The disk that it appears as, which looks as bright everywhere.
                    let r = f64::from(radius);
                    let towards = center / distance;
                    let a = towards.any_orthonormal_vector();
                    let seen = r * (1.0 - (r / distance).powi(2)).sqrt();
                    let middle = towards * (-r * r / distance);
                    (middle + (a * u + towards.cross(a) * v) * seen, true, inside)
                }
                LightShape::Point | LightShape::Sun { .. } => unreachable!(),
            };
            if !counts {
                continue;
            }
            count += 1.0;
            let q = center + place;
            let facing = match light.shape {
                LightShape::Sphere { .. } => q.dot(center) / (q.length() * distance),
                _ if emits => (-q.dot(light.direction.as_dvec3()) / q.length()).max(0.0),
                _ => 1.0,
            };
            let up = (q.dot(normal.as_dvec3()) / q.length()).max(0.0);
            sum += facing * up / q.length_squared();
        }
        let scale = match light.shape {
            LightShape::Sphere { radius } => {
                1.0 - (f64::from(radius) / distance_of(light, point)).powi(2)
            }
            _ => 1.0,
        };
        f64::from(light.candela()) * scale * sum / count
    }

    fn distance_of(light: &AreaLight, point: Vec3) -> f64 {
        f64::from((light.center - point).length())
    }

    #[test]
    fn irradiance_is_the_sum_over_the_light() {
        let shapes = [
            (LightShape::Disk { radius: 0.8 }, 0.03),
            (
                LightShape::Rect {
                    width: 1.4,
                    height: 0.5,
                },
                5.0e-4,
            ),
            (LightShape::Sphere { radius: 0.5 }, 2.0e-3),
            (LightShape::Line { length: 2.0 }, 2.0e-3),
        ];
        for (shape, cut_error) in shapes {
            let center = Vec3::new(0.3, 1.5, -0.2);
            let light = AreaLight::new(shape, center, Vec3::new(0.1, -1.0, 0.3), Vec3::X);
            let (mut whole, mut cut) = (0, 0);
            for step in 0..40 {
                let angle = 0.157 * step as f32;
                let normal = Vec3::new(angle.cos(), 0.2 + angle.sin(), 0.5 * (2.0 * angle).sin());
                let normal = normal.normalize();
                let point = Vec3::new(0.5 * (3.0 * angle).cos(), 0.1, 0.4 * angle.sin());
                let found = f64::from(light.irradiance(point, normal));
                let expected = summed(&light, point, normal);
                let facing = f64::from(light.irradiance(point, (center - point).normalize()));
                let above = light.part_above(point, normal);
                let most = if above == 1.0 || above == 0.0 {
                    whole += 1;
                    2.0e-4
                } else {
                    cut += 1;
                    cut_error
                };
                let error = (found - expected).abs() / facing;
                assert!(
                    error < most,
                    "{shape}, step {step}: {found}, not {expected}: {error}"
                );
            }
            assert!(whole > 10 && cut > 3, "{shape}: {whole} whole, {cut} cut");
        }
    }

    #[test]
    fn a_small_light_is_a_point_and_a_sun_is_its_lux() {
        let (point, normal) = (
            Vec3::new(0.4, 0.0, 0.1),
            Vec3::new(0.1, 1.0, 0.2).normalize(),
        );
        let at = |shape| {
            AreaLight::new(
                shape,
                Vec3::new(0.0, 2.0, 0.5),
                Vec3::new(0.4, -2.0, -0.4),
                Vec3::X,
            )
        };
        let expected = at(LightShape::Point).irradiance(point, normal);
        for shape in [
            LightShape::Disk { radius: 1.0e-3 },
            LightShape::Rect {
                width: 1.0e-3,
                height: 2.0e-3,
            },
            LightShape::Sphere { radius: 1.0e-3 },
            LightShape::Line { length: 1.0e-3 },
        ] {
            let found = at(shape).irradiance(point, normal);
            assert!(
                (found / expected - 1.0).abs() < 1.0e-3,
                "{shape}: {found}, not {expected}"
            );
        }
        for degrees in [0.0f32, 0.53, 5.0] {
            let shape = LightShape::Sun {
                angular_diameter: degrees.to_radians(),
            };
            let sun = AreaLight::new(shape, Vec3::ZERO, Vec3::new(0.3, -1.0, 0.0), Vec3::X);
            let up = sun.irradiance(point, Vec3::Y);
            assert!((up + sun.direction.y).abs() < 1.0e-5, "{degrees}: {up}");
        }
    }

    #[test]
    fn nothing_comes_from_behind_or_below() {
        let above = Vec3::new(0.0, 2.0, 0.0);
        for shape in [
            LightShape::Disk { radius: 0.5 },
            LightShape::Rect {
                width: 1.0,
                height: 1.0,
            },
        ] {
            let light = AreaLight::new(shape, above, Vec3::Y, Vec3::X);
            assert_eq!(light.irradiance(Vec3::ZERO, Vec3::Y), 0.0);
        }
        for shape in [
            LightShape::Point,
            LightShape::Disk { radius: 0.5 },
            LightShape::Rect {
                width: 1.0,
                height: 1.0,
            },
            LightShape::Sphere { radius: 0.5 },
            LightShape::Line { length: 1.0 },
        ] {
            let light = AreaLight::new(shape, above, Vec3::NEG_Y, Vec3::X);
            assert_eq!(light.irradiance(Vec3::ZERO, Vec3::NEG_Y), 0.0, "{shape}");
            // In the very plane or middle of the light there is some finite answer.
            for point in [above, above + Vec3::X, above + 0.2 * Vec3::X] {
                assert!(
                    light.irradiance(point, Vec3::Y).is_finite(),
                    "{shape} at {point}"
                );
            }
        }
    }
}
