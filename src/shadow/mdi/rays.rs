//! The fan of rays: places on a light, with weights.

use crate::light::{AreaLight, LightShape};

/// Rays that a table has room for: `MAX_RAYS` in `mdi/params.glsl`.
pub(super) const MOST_RAYS: usize = 256;

/// A place on the light, -1 to 1 along its axes, and the part of the light that it stands for.
pub(super) type Ray = [f32; 4];

/// `count` places spread evenly over the area of a light; of an uneven one over its brightness, so that
/// all stand for equal parts of its light.
pub(super) fn ray_table(light: &AreaLight, count: u32) -> Vec<Ray> {
    let weight = 1.0 / count as f32;
    (0..count)
        .map(|index| {
            let [x, y] = match light.shape {
                LightShape::Line { .. } => {
                    let part = (f64::from(index) + 0.5) / f64::from(count);
                    [2.0 * light.profile.place_of(part) - 1.0, 0.0]
                }
                LightShape::Point => square_place(index, count),
                LightShape::Rect { .. } => {
                    let place = square_place(index, count).map(|v| 0.5 * v + 0.5);
                    light.weights.place_of(place).map(|v| 2.0 * v - 1.0)
                }
                _ => disk_place(square_place(index, count)),
            };
            [x as f32, y as f32, weight, 0.0]
        })
        .collect()
}

/// Places in a square: one in each of `count` columns, each half of the width's in the halves of the
/// height and so on (Hammersley), moved so that the mean is the middle.
fn square_place(index: u32, count: u32) -> [f64; 2] {
    let x = (f64::from(index) + 0.5) / f64::from(count);
    // The additive recurrence of the golden ratio.
    let y = (0.5 + f64::from(index) * 0.618_033_988_749_894_9).fract();
    [2.0 * x - 1.0, 2.0 * y - 1.0]
}

/// A square's place moved to the disk so that equal areas stay equal (Shirley and Chiu 1997).
fn disk_place([x, y]: [f64; 2]) -> [f64; 2] {
    let quarter = std::f64::consts::FRAC_PI_4;
    if x == 0.0 && y == 0.0 {
        return [0.0; 2];
    }
    let (radius, angle) = if x.abs() > y.abs() {
        (x, quarter * y / x)
    } else {
        (y, 2.0 * quarter - quarter * x / y)
    };
    [radius * angle.cos(), radius * angle.sin()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::{LightProfile, LightWeights};
    use glam::Vec3;

    fn at(shape: LightShape) -> AreaLight {
        AreaLight::new(shape, Vec3::ZERO, Vec3::NEG_Y, Vec3::X)
    }

    #[test]
    fn rays_go_where_an_uneven_light_is_bright() {
        let square = LightShape::Rect {
            width: 1.0,
            height: 1.0,
        };
        let weights = LightWeights::new(3, &[1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
        let light = AreaLight {
            weights: weights.unwrap(),
            ..at(square)
        };
        let mut corners = [0; 4];
        for [x, y, weight, _] in ray_table(&light, 64) {
            assert!(x.abs() >= 0.33 && y.abs() >= 0.33 && weight == 1.0 / 64.0);
            corners[usize::from(x > 0.0) + 2 * usize::from(y > 0.0)] += 1;
        }
        assert!(corners.iter().all(|n| (15..=17).contains(n)), "{corners:?}");

        // Brightness that rises from 0: a quarter of the light is in the first half.
        let light = AreaLight {
            profile: LightProfile::new(&[0.0, 1.0]).unwrap(),
            ..at(LightShape::Line { length: 1.0 })
        };
        let rays = ray_table(&light, 64);
        assert_eq!(rays.iter().filter(|ray| ray[0] < 0.0).count(), 16);
    }

    #[test]
    fn rays_cover_lights_evenly() {
        for (shape, second_moment) in [
            (LightShape::Disk { radius: 2.0 }, 0.25),
            (
                LightShape::Rect {
                    width: 1.0,
                    height: 2.0,
                },
                1.0 / 3.0,
            ),
            (LightShape::Line { length: 1.0 }, 1.0 / 3.0),
        ] {
            for count in [4, 36, 64, 256] {
                let rays = ray_table(&at(shape), count);
                let weights: f32 = rays.iter().map(|ray| ray[2]).sum();
                assert!((weights - 1.0).abs() < 1.0e-5);
                let mean: f32 = rays.iter().map(|ray| ray[0] * ray[2]).sum();
                let moment: f32 = rays.iter().map(|ray| ray[0] * ray[0] * ray[2]).sum();
                let slack = 0.5 / (count as f32).sqrt();
                assert!(
                    mean.abs() < slack && (moment - second_moment).abs() < slack,
                    "{shape:?}"
                );
                assert!(
                    rays.iter()
                        .all(|ray| ray[0].abs() <= 1.0 && ray[1].abs() <= 1.0)
                );
            }
        }
    }
}
