//! The part of a light above a plane: what a surface's own plane leaves of it.

use super::{AreaLight, LightShape};
use glam::Vec3;

impl AreaLight {
    /// The part of the light, 0 to 1, that lies above the plane through `point` with unit normal
    /// `normal` (scene space, metres): by area for a disk, rectangle and line; for a sphere and a
    /// sun of the disk that they appear as. 0 or 1 for a point, whose own plane counts as below.
    ///
    /// Exact but for rounding and, on disks, 3e-5. Twin of `light_above` in
    /// `common/light_above.glsl`.
    pub fn part_above(&self, point: Vec3, normal: Vec3) -> f32 {
        let to_center = self.center - point;
        let height = normal.dot(to_center);
        let across = |axis: Vec3| normal.dot(axis).abs();
        match self.shape {
            LightShape::Point => f32::from(u8::from(height > 0.0)),
            LightShape::Disk { radius } => {
                let slope = across(self.axis_x).hypot(across(self.axis_y));
                disk_above(ratio(height, radius * slope))
            }
            LightShape::Rect {
                width,
                height: tall,
            } => {
                let (x, y) = (
                    0.5 * width * across(self.axis_x),
                    0.5 * tall * across(self.axis_y),
                );
                rect_above(height, x, y)
            }
            LightShape::Sphere { radius } => {
                let distance = to_center.length();
                let sine = (radius / distance.max(f32::MIN_POSITIVE)).min(1.0);
                let cosine = (1.0 - sine * sine).max(0.0).sqrt();
                cone_above(height / distance.max(f32::MIN_POSITIVE), sine, cosine)
            }
            LightShape::Line { length } => {
                let reach = 0.5 * length * across(self.axis_x);
                0.5 + 0.5 * ratio(height, reach)
            }
            LightShape::Sun { angular_diameter } => {
                let (sine, cosine) = (0.5 * angular_diameter).sin_cos();
                cone_above(-normal.dot(self.direction), sine, cosine)
            }
        }
    }
}

/// `height / reach`, -1 to 1, for any two numbers.
fn ratio(height: f32, reach: f32) -> f32 {
    if height.abs() < reach {
        height / reach
    } else if height == 0.0 {
        0.0
    } else {
        height.signum()
    }
}

/// The part of a round cone of directions above a plane, seen as a disk: `up` is the cosine between
/// its axis and the normal, the others belong to its half angle.
fn cone_above(up: f32, sine: f32, cosine: f32) -> f32 {
    let along = (1.0 - up * up).max(0.0).sqrt();
    disk_above(ratio(up * cosine, along * sine))
}

/// The part of a unit disk beyond the chord at `-offset` from its centre, -1 to 1: V_poly of the
/// formula notes, within 2.5e-5 of the exact area.
fn disk_above(offset: f32) -> f32 {
    let t = 0.5 + 0.5 * offset;
    let m = t.min(1.0 - t).max(0.0);
    let part = m * m.sqrt() * (1.695_086_4 - m * (0.485_652_5 + m * 0.152_186_23));
    if t > 0.5 { 1.0 - part } else { part }
}

/// The part of the rectangle |u| <= 1, |v| <= 1 where `height + x u + y v > 0`, for x, y >= 0.
fn rect_above(height: f32, x: f32, y: f32) -> f32 {
    let (long, short) = (x.max(y), x.min(y));
    let depth = height.abs();
    let part = if depth >= long + short {
        // Above, below, or in the plane itself.
        if height == 0.0 { 0.5 } else { 0.0 }
    } else if depth <= long - short {
        0.5 - 0.5 * depth / long
    } else {
        // Only a corner is cut off: a triangle.
        let corner = long + short - depth;
        0.125 * (corner / long) * (corner / short)
    };
    if height > 0.0 { 1.0 - part } else { part }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(shape: LightShape) -> AreaLight {
        let turned = Vec3::new(0.3, -1.0, 0.2);
        AreaLight::new(
            shape,
            Vec3::new(0.2, 1.0, -0.4),
            turned,
            Vec3::new(1.0, 0.1, 0.4),
        )
    }

    /// The part of a fine grid of points of the light above the plane.
    fn counted(light: &AreaLight, point: Vec3, normal: Vec3) -> f64 {
        const N: i32 = 700;
        let to_center = light.center - point;
        let distance = to_center.length();
        let cells = (0..N).flat_map(|i| (0..N).map(move |j| (i, j)));
        let (mut above, mut all) = (0u32, 0u32);
        for (i, j) in cells {
            let [u, v] = [i, j].map(|k| (2.0 * k as f32 + 1.0) / N as f32 - 1.0);
            let round = u * u + v * v <= 1.0;
            let across = |axis: Vec3, radius: f32| {
                let x = axis.any_orthonormal_vector();
                (x * u + axis.cross(x) * v) * radius
            };
            let (offset, counts) = match light.shape {
                LightShape::Point => (to_center, true),
                LightShape::Disk { radius } => {
                    let in_plane = (light.axis_x * u + light.axis_y * v) * radius;
                    (to_center + in_plane, round)
                }
                LightShape::Rect { width, height } => {
                    let in_plane =
                        light.axis_x * (0.5 * width * u) + light.axis_y * (0.5 * height * v);
                    (to_center + in_plane, true)
                }
                LightShape::Sphere { radius } => {
                    let towards = to_center / distance;
                    let middle = to_center * (1.0 - radius * radius / (distance * distance));
                    let seen = radius * (1.0 - (radius / distance).powi(2)).sqrt();
                    (middle + across(towards, seen), round)
                }
                LightShape::Line { length } => {
                    (to_center + light.axis_x * (0.5 * length * u), true)
                }
                LightShape::Sun { angular_diameter } => {
                    let towards = -light.direction;
                    (
                        towards + across(towards, (0.5 * angular_diameter).tan()),
                        round,
                    )
                }
            };
            if counts {
                all += 1;
                above += u32::from(offset.dot(normal) > 0.0);
            }
        }
        f64::from(above) / f64::from(all)
    }

    #[test]
    fn the_part_above_is_that_of_counted_points() {
        let shapes = [
            LightShape::Point,
            LightShape::Disk { radius: 0.7 },
            LightShape::Rect {
                width: 1.5,
                height: 0.4,
            },
            LightShape::Rect {
                width: 0.3,
                height: 1.1,
            },
            LightShape::Sphere { radius: 0.6 },
            LightShape::Line { length: 2.0 },
            LightShape::Sun {
                angular_diameter: 0.5,
            },
        ];
        let mut cut = 0;
        for shape in shapes {
            let light = light(shape);
            for step in 0..24 {
                let angle = step as f32 * 0.261_8;
                let normal =
                    Vec3::new(angle.cos(), 0.3 * (3.0 * angle).sin(), angle.sin()).normalize();
                let point = Vec3::new(0.1 * angle, 0.4, -0.3);
                let part = light.part_above(point, normal);
                let expected = counted(&light, point, normal);
                cut += usize::from(expected > 0.0 && expected < 1.0);
                let error = (f64::from(part) - expected).abs();
                assert!(
                    error < 2.0e-3,
                    "{shape}, step {step}: {part}, not {expected}"
                );
            }
        }
        assert!(cut > 60, "many planes cut their light: {cut}");
    }

    #[test]
    fn lights_in_the_plane_or_without_reach_are_no_trouble() {
        for shape in [
            LightShape::Disk { radius: 1.0e-9 },
            LightShape::Rect {
                width: 1.0e-9,
                height: 2.0,
            },
            LightShape::Line { length: 1.0 },
            LightShape::Sphere { radius: 5.0 },
            LightShape::Sun {
                angular_diameter: 0.0,
            },
        ] {
            let light = AreaLight::new(shape, Vec3::ZERO, Vec3::NEG_Y, Vec3::X);
            for normal in [Vec3::Y, Vec3::NEG_Y, Vec3::X, Vec3::Z] {
                for point in [Vec3::ZERO, Vec3::NEG_Y, Vec3::Y, Vec3::X] {
                    let part = light.part_above(point, normal);
                    assert!(
                        (0.0..=1.0).contains(&part),
                        "{shape} {normal} {point}: {part}"
                    );
                }
            }
        }
        let disk = AreaLight::new(
            LightShape::Disk { radius: 1.0 },
            Vec3::Y,
            Vec3::NEG_Y,
            Vec3::X,
        );
        assert_eq!(disk.part_above(Vec3::ZERO, Vec3::Y), 1.0);
        assert_eq!(disk.part_above(Vec3::ZERO, Vec3::NEG_Y), 0.0);
        assert!((disk.part_above(Vec3::ZERO, Vec3::X) - 0.5).abs() < 1.0e-6);
    }
}
