//! The same case in other guises.

use glam::{DQuat, DVec3, Vec3};

use super::Case;
use super::mesh::finish;
use crate::light::{AreaLight, LightShape, MIN_LIGHT_SIZE};

/// Factors on a light's size: five decades.
pub const LIGHT_FACTORS: [f32; 6] = [1.0e-3, 1.0e-2, 0.1, 1.0, 10.0, 100.0];

/// Factors on everything's size.
pub const SCALES: [f64; 7] = [1.0e-3, 1.0e-2, 0.1, 7.0, 100.0, 1.0e3, 1.0e4];

/// A change of scene, camera and light together that leaves every pixel's visibility as it is:
/// scale first, then a turn, then a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// Factor on lengths, above 0.
    pub scale: f64,
    /// A rotation.
    pub turn: DQuat,
    /// Metres.
    pub shift: DVec3,
}

impl Similarity {
    /// Nothing changes.
    pub const IDENTITY: Self = Self {
        scale: 1.0,
        turn: DQuat::IDENTITY,
        shift: DVec3::ZERO,
    };

    /// Everything larger or smaller.
    pub fn scaled(scale: f64) -> Self {
        Self {
            scale,
            ..Self::IDENTITY
        }
    }

    /// Everything turned about the origin.
    pub fn turned(turn: DQuat) -> Self {
        Self {
            turn,
            ..Self::IDENTITY
        }
    }

    /// Everything moved.
    pub fn moved(shift: DVec3) -> Self {
        Self {
            shift,
            ..Self::IDENTITY
        }
    }

    fn point(&self, p: Vec3) -> Vec3 {
        (self.turn * (p.as_dvec3() * self.scale) + self.shift).as_vec3()
    }

    fn direction(&self, v: Vec3) -> Vec3 {
        (self.turn * v.as_dvec3()).as_vec3()
    }
}

impl Case {
    fn changed(mut self, change: impl FnOnce(&mut Self)) -> Self {
        change(&mut self);
        self.scene.name.clone_from(&self.name);
        self.scene.cameras = vec![self.camera.clone()];
        finish(&mut self.scene);
        self
    }

    /// Scene, camera and light under a similarity, in `f64` and then rounded.
    #[must_use]
    pub fn seen_as(&self, to: &Similarity) -> Self {
        self.clone().changed(|case| {
            if to.scale != 1.0 {
                case.name = format!("{}, scaled by {:e}", self.name, to.scale);
            }
            for primitive in &mut case.scene.primitives {
                for position in &mut primitive.positions {
                    *position = to.point(*position);
                }
                for normal in &mut primitive.normals {
                    *normal = to.direction(*normal);
                }
            }
            let camera = &mut case.camera;
            camera.position = to.point(camera.position);
            camera.right = to.direction(camera.right);
            camera.up = to.direction(camera.up);
            camera.forward = to.direction(camera.forward);
            camera.znear = (f64::from(camera.znear) * to.scale) as f32;
            let light = &mut case.scene.lights[self.light].light;
            let factor = if light.shape.is_sun() { 1.0 } else { to.scale };
            *light = AreaLight {
                shape: light.shape.scaled(factor as f32),
                center: to.point(light.center),
                axis_x: to.direction(light.axis_x),
                axis_y: to.direction(light.axis_y),
                direction: to.direction(light.direction),
                ..*light
            };
        })
    }

    /// Scene and light mirrored at the plane x = 0, and the camera so that its picture is the mirror
    /// image, left for right. The winding of triangles turns over, as that of a mesh under a mirrored
    /// node does.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let mirror = |v: Vec3| Vec3::new(-v.x, v.y, v.z);
        self.clone().changed(|case| {
            case.name = format!("{}, mirrored", self.name);
            for primitive in &mut case.scene.primitives {
                primitive.positions.iter_mut().for_each(|p| *p = mirror(*p));
                primitive.normals.iter_mut().for_each(|n| *n = mirror(*n));
            }
            let camera = &mut case.camera;
            camera.position = mirror(camera.position);
            camera.forward = mirror(camera.forward);
            camera.up = mirror(camera.up);
            // A frame is right-handed: the picture comes out mirrored instead.
            camera.right = -mirror(camera.right);
            let light = &mut case.scene.lights[self.light].light;
            light.center = mirror(light.center);
            light.direction = mirror(light.direction);
            light.axis_x = -mirror(light.axis_x);
            light.axis_y = mirror(light.axis_y);
        })
    }

    /// Another light in the place of this one.
    #[must_use]
    pub fn with_light(&self, light: AreaLight) -> Self {
        let at = self.light;
        self.clone()
            .changed(|case| case.scene.lights[at].light = light)
    }

    /// The light with another shape, where it is.
    #[must_use]
    pub fn with_shape(&self, shape: LightShape) -> Self {
        self.with_light(AreaLight {
            shape,
            ..*self.area_light()
        })
    }

    /// The light's lengths (a sun's angle, up to 2 radians) times `factor`, but none below what a
    /// light may have.
    #[must_use]
    pub fn light_scaled(&self, factor: f32) -> Self {
        let shape = match self.area_light().shape.scaled(factor) {
            LightShape::Point => LightShape::Point,
            LightShape::Disk { radius } => LightShape::Disk {
                radius: radius.max(MIN_LIGHT_SIZE),
            },
            LightShape::Rect { width, height } => LightShape::Rect {
                width: width.max(MIN_LIGHT_SIZE),
                height: height.max(MIN_LIGHT_SIZE),
            },
            LightShape::Sphere { radius } => LightShape::Sphere {
                radius: radius.max(MIN_LIGHT_SIZE),
            },
            LightShape::Line { length } => LightShape::Line {
                length: length.max(MIN_LIGHT_SIZE),
            },
            LightShape::Sun { angular_diameter } => LightShape::Sun {
                angular_diameter: angular_diameter.min(2.0),
            },
        };
        let mut case = self.with_shape(shape);
        case.name = format!("{}, light times {factor:e}", self.name);
        case.scene.name.clone_from(&case.name);
        case
    }

    /// The light shrunk to its centre; a sun to one direction.
    #[must_use]
    pub fn light_of_no_size(&self) -> Self {
        let shape = match self.area_light().shape {
            LightShape::Sun { .. } => LightShape::Sun {
                angular_diameter: 0.0,
            },
            _ => LightShape::Point,
        };
        self.with_shape(shape)
    }

    /// The light moved by `metres`; a sun turned by as many radians.
    #[must_use]
    pub fn light_moved(&self, metres: Vec3) -> Self {
        let light = self.area_light();
        let moved = if light.shape.is_sun() {
            let towards = light.direction + metres;
            AreaLight::new(light.shape, light.center, towards, light.axis_x)
        } else {
            AreaLight {
                center: light.center + metres,
                ..*light
            }
        };
        self.with_light(AreaLight {
            color: light.color,
            intensity: light.intensity,
            ..moved
        })
    }

    /// The camera moved by `metres`.
    #[must_use]
    pub fn camera_moved(&self, metres: Vec3) -> Self {
        self.clone().changed(|case| case.camera.position += metres)
    }

    /// The scene without its last primitive: one blocker less. `None` where there is only one.
    #[must_use]
    pub fn without_last(&self) -> Option<Self> {
        (self.scene.primitives.len() > 1).then(|| {
            self.clone().changed(|case| {
                case.scene.primitives.pop();
            })
        })
    }
}
