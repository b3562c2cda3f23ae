//! Lights: frames, extents, bad sizes.

use super::*;

fn light(shape: LightShape) -> AreaLight {
    AreaLight::new(shape, Vec3::ZERO, Vec3::NEG_Y, Vec3::X)
}

#[test]
fn frame_is_orthonormal_for_any_input() {
    let odd = [
        Vec3::ZERO,
        Vec3::X,
        Vec3::new(1e-30, 0.0, 0.0),
        Vec3::new(3e30, -1e30, 2e30),
        Vec3::new(0.3, -0.2, 0.9),
        Vec3::NAN,
    ];
    for d in odd {
        for x in odd {
            let light = AreaLight::new(LightShape::Point, Vec3::ZERO, d, x);
            assert_eq!(light.validate(), Ok(()), "direction {d}, axis {x}");
        }
    }
    let turned = light(LightShape::Point);
    assert_eq!(turned.direction, Vec3::NEG_Y);
    assert_eq!(turned.axis_x, Vec3::X);
    assert_eq!(turned.axis_y, Vec3::NEG_Z);
}

#[test]
fn validate_finds_each_bad_value() {
    let good = light(LightShape::Disk { radius: 1.0 });
    let bad = [
        AreaLight {
            shape: LightShape::Disk { radius: f32::NAN },
            ..good
        },
        AreaLight {
            intensity: -1.0,
            ..good
        },
        AreaLight {
            color: Vec3::new(1.0, f32::INFINITY, 0.0),
            ..good
        },
        AreaLight {
            range: Some(0.0),
            ..good
        },
        AreaLight {
            axis_x: Vec3::Y,
            ..good
        },
        AreaLight {
            center: Vec3::NAN,
            ..good
        },
        AreaLight {
            spot: Some(SpotCone {
                inner: 0.5,
                outer: 0.4,
            }),
            ..good
        },
    ];
    assert_eq!(good.validate(), Ok(()));
    for light in bad {
        assert!(light.validate().is_err(), "{light:?}");
    }
}
