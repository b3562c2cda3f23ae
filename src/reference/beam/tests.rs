use super::super::samples::{LightFrom, Sequence};
use super::*;
use crate::light::{AreaLight, LightShape};
use crate::scene::{Material, Primitive, Scene};
use glam::Vec3;

/// Triangles of all forms: small, long, flat, sharing corners, standing on y = 0.
fn soup(seed: u64, count: usize) -> Triangles {
    let numbers = Sequence::new(seed);
    let mut drawn = 0;
    let mut draw = || {
        drawn += 1;
        numbers.point(drawn).x as f32
    };
    let mut positions = Vec::new();
    for _ in 0..count {
        let mut point = |size: f32| {
            let mut axis = || (draw() - 0.5) * size;
            Vec3::new(axis(), axis() + 0.5, axis())
        };
        let (center, size) = (point(2.0), [0.1, 0.5, 2.0][positions.len() / 3 % 3]);
        let corner = match positions.last() {
            Some(&last) if positions.len() / 3 % 2 == 1 => last,
            _ => center + point(size),
        };
        positions.extend([corner, center + point(size), center + point(size) * 0.1]);
    }
    let count = positions.len() as u32;
    let scene = Scene {
        primitives: vec![Primitive {
            positions,
            indices: (0..count).collect(),
            ..Default::default()
        }],
        materials: vec![Material::default()],
        ..Default::default()
    };
    Triangles::new(&scene)
}

#[test]
fn bundles_decide_as_single_segments_do() {
    let shapes = [
        LightShape::Disk { radius: 0.4 },
        LightShape::Rect {
            width: 6.0,
            height: 5.0,
        },
        LightShape::Sphere { radius: 1.0 },
        LightShape::Line { length: 9.0 },
        LightShape::Sun {
            angular_diameter: 0.9,
        },
    ];
    let (mut beam, mut stack) = (Beam::default(), Vec::new());
    let (mut dark, mut lit) = (0, 0);
    for (number, count) in [0, 1, 7, 40, 400].into_iter().enumerate() {
        let triangles = soup(number as u64, count);
        for (which, shape) in shapes.into_iter().enumerate() {
            let center = Vec3::new(0.3, 2.5, -0.4);
            let light = AreaLight::new(shape, center, Vec3::new(0.2, -1.0, 0.3), Vec3::X);
            for receiver in 0..12 {
                let at = Sequence::new(receiver).point(which as u32 + 1) * 2.0 - 1.0;
                let position = DVec3::new(at.x, 0.0, at.y);
                let from = Start {
                    position,
                    error: 1e-15,
                    own: u32::MAX,
                };
                let light = LightFrom::new(&light, position);
                let samples = Sequence::new(100 + receiver);
                let mut expected = Vec::new();
                beam.clear();
                for index in 0..200 {
                    let place = samples.point(index);
                    let end = light.spread(place);
                    if end.offset.y > 0.0 {
                        beam.add(index, place, end);
                        if !triangles.occluded(&from, &end, &mut stack) {
                            expected.push(index);
                        }
                    }
                }
                let mut found = Vec::new();
                beam.trace(&triangles, &from, DVec3::Y, |index| found.push(index));
                found.sort_unstable();
                assert_eq!(found, expected, "{count} triangles, {shape}, {receiver}");
                lit += found.len();
                dark += 200 - found.len();
            }
        }
    }
    assert!(lit > 10_000 && dark > 10_000, "{lit} {dark}");
}

#[test]
fn parts_of_tiles() {
    assert_eq!(tile_mask(0, 0, 64), u64::MAX);
    assert_eq!(tile_mask(0, 3, 5), 0b11000);
    assert_eq!(tile_mask(1, 3, 66), 0b11);
    assert_eq!(tile_mask(1, 70, 200), u64::MAX << 6);
    assert_eq!(interleave(15, 0), 0b0101_0101);
    assert_eq!(interleave(2, 15), 0b1010_1110);
}
