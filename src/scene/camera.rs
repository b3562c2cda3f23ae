//! A perspective camera, its matrices and its rays.
//!
//! Clip space is Vulkan's: x right, y **down**, depth 0 to 1. Pixel (0, 0) is the top left one and
//! its centre lies at (0.5, 0.5). View space is x right, y up, looking along -Z.

use glam::{DVec3, Mat4, UVec2, Vec3, Vec4};

use super::Aabb;

/// A ray through the centre of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start in scene space, metres.
    pub origin: Vec3,
    /// Unit vector.
    pub direction: Vec3,
}

/// A perspective camera in scene space.
///
/// `right`, `up` and `-forward` form a right-handed orthonormal frame.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneCamera {
    /// Name of the node, of its camera, or a made-up one.
    pub name: String,
    /// Index of the glTF node; `None` for a camera that no file holds.
    pub node: Option<usize>,
    /// Position among all camera nodes in document order: the INDEX of the command line.
    pub index: usize,
    /// The eye in scene space, metres.
    pub position: Vec3,
    /// Unit vector to the right of the picture.
    pub right: Vec3,
    /// Unit vector to the top of the picture.
    pub up: Vec3,
    /// Unit vector along which the camera looks.
    pub forward: Vec3,
    /// Vertical field of view in radians, above 0 and below pi. The picture's width follows from
    /// its aspect ratio.
    pub yfov: f32,
    /// Distance of the near plane in metres, above 0.
    pub znear: f32,
    /// Distance of the far plane in metres, above `znear`; `None` for an infinite one.
    pub zfar: Option<f32>,
}

impl SceneCamera {
    /// A camera that holds the whole of `bounds` in a picture of any aspect ratio from 1 up, from
    /// the front, the right and above. The same bounds give the same camera. Empty bounds are
    /// looked at as a unit cube about the origin.
    pub fn framing(bounds: &Aabb) -> Self {
        let (center, radius) = if bounds.is_empty() {
            (DVec3::ZERO, 1.0)
        } else {
            let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
            let radius = 0.5 * (high - low).length();
            let center = 0.5 * (low + high);
            // A single point still needs a distance to be seen from.
            (center, radius.max(1.0e-3 * center.length()).max(1.0e-6))
        };
        let yfov = std::f64::consts::FRAC_PI_4;
        let backward = DVec3::new(0.55, 0.45, 0.85).normalize();
        let distance = 1.05 * radius / (0.5 * yfov).sin();
        let right = DVec3::Y.cross(backward).normalize();
        Self {
            name: "framing".into(),
            node: None,
            index: 0,
            position: (center + backward * distance).as_vec3(),
            right: right.as_vec3(),
            up: backward.cross(right).as_vec3(),
            forward: -backward.as_vec3(),
            yfov: yfov as f32,
            znear: (0.01 * distance) as f32,
            zfar: None,
        }
    }

    /// From scene space to view space.
    pub fn view(&self) -> Mat4 {
        let (x, y, z) = (self.right, self.up, -self.forward);
        let eye = self.position;
        Mat4::from_cols(
            Vec4::new(x.x, y.x, z.x, 0.0),
            Vec4::new(x.y, y.y, z.y, 0.0),
            Vec4::new(x.z, y.z, z.z, 0.0),
            Vec4::new(-x.dot(eye), -y.dot(eye), -z.dot(eye), 1.0),
        )
    }

    /// From view space to clip space for a picture `aspect` times as wide as high: depth 0 at the
    /// near plane, 1 at the far plane or at infinity.
    pub fn projection(&self, aspect: f32) -> Mat4 {
        let near = f64::from(self.znear);
        let (zz, zw) = match self.zfar {
            Some(far) => {
                let far = f64::from(far);
                (far / (near - far), near * far / (near - far))
            }
            None => (-1.0, -near),
        };
        self.projection_with_depth(aspect, zz as f32, zw as f32)
    }

    /// As [`projection`](Self::projection), with depth 1 at the near plane and 0 at infinity; the
    /// far plane is dropped. Float depth is then about equally fine at all distances: clear to 0
    /// and compare with `GREATER`.
    pub fn projection_reversed(&self, aspect: f32) -> Mat4 {
        self.projection_with_depth(aspect, 0.0, self.znear)
    }

    fn projection_with_depth(&self, aspect: f32, zz: f32, zw: f32) -> Mat4 {
        let focal = 1.0 / self.tan_half_fov();
        let aspect = f64::from(aspect);
        Mat4::from_cols(
            Vec4::new((focal / aspect) as f32, 0.0, 0.0, 0.0),
            Vec4::new(0.0, -focal as f32, 0.0, 0.0),
            Vec4::new(0.0, 0.0, zz, -1.0),
            Vec4::new(0.0, 0.0, zw, 0.0),
        )
    }

    /// `projection(aspect) * view()`.
    pub fn view_projection(&self, aspect: f32) -> Mat4 {
        self.projection(aspect) * self.view()
    }

    /// `projection_reversed(aspect) * view()`.
    pub fn view_projection_reversed(&self, aspect: f32) -> Mat4 {
        self.projection_reversed(aspect) * self.view()
    }

    /// The ray from the eye through the centre of `pixel` of a picture of `size` pixels (both at
    /// least 1).
    pub fn ray(&self, pixel: UVec2, size: UVec2) -> Ray {
        let t = self.tan_half_fov();
        let (w, h) = (f64::from(size.x.max(1)), f64::from(size.y.max(1)));
        let x = (2.0 * (f64::from(pixel.x) + 0.5) - w) / h * t;
        let y = (h - 2.0 * (f64::from(pixel.y) + 0.5)) / h * t;
        let direction =
            self.forward.as_dvec3() + x * self.right.as_dvec3() + y * self.up.as_dvec3();
        Ray {
            origin: self.position,
            direction: direction.normalize().as_vec3(),
        }
    }

    /// Tangent of half the vertical field of view: half the height of the picture at distance 1.
    pub fn tan_half_fov(&self) -> f64 {
        (0.5 * f64::from(self.yfov)).tan()
    }

    /// What makes this camera unusable, if anything does: `what is wrong; what would be right`.
    pub(super) fn fault(&self) -> Option<String> {
        let unit = |v: Vec3| (v.length_squared() - 1.0).abs() < 1.0e-3;
        let frame = [self.right, self.up, -self.forward];
        if !(self.yfov > 0.0 && self.yfov < std::f32::consts::PI) {
            Some(format!(
                "yfov is {}; it must lie between 0 and pi radians",
                self.yfov
            ))
        } else if !(self.znear > 0.0 && self.znear.is_finite()) {
            Some(format!("znear is {}; it must be above 0", self.znear))
        } else if (self.zfar).is_some_and(|far| !far.is_finite() || far <= self.znear) {
            Some("zfar is not above znear; leave it out for an infinite far plane".into())
        } else if !self.position.is_finite()
            || !frame.into_iter().all(unit)
            || frame[0].cross(frame[1]).dot(frame[2]) < 0.999
        {
            Some("its frame is not finite and orthonormal".into())
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    fn camera() -> SceneCamera {
        let bounds = Aabb {
            min: Vec3::new(-3.0, 0.0, 1.0),
            max: Vec3::new(5.0, 2.0, 4.0),
        };
        SceneCamera {
            znear: 0.1,
            zfar: Some(100.0),
            ..SceneCamera::framing(&bounds)
        }
    }

    #[test]
    fn ray_and_projection_meet_at_the_pixel_centre() {
        let camera = camera();
        for size in [UVec2::new(640, 360), UVec2::new(33, 57), UVec2::ONE] {
            let aspect = size.x as f32 / size.y as f32;
            for pixel in [UVec2::ZERO, size - 1, size / 2] {
                let ray = camera.ray(pixel, size);
                let point = ray.origin + 7.5 * ray.direction;
                for matrix in [
                    camera.view_projection(aspect),
                    camera.view_projection_reversed(aspect),
                ] {
                    let clip = matrix * point.extend(1.0);
                    let ndc = Vec2::new(clip.x, clip.y) / clip.w;
                    let found = (0.5 * ndc + 0.5) * size.as_vec2();
                    let wanted = pixel.as_vec2() + 0.5;
                    assert!((found - wanted).length() < 1e-3, "{found} for {wanted}");
                }
            }
        }
    }

    #[test]
    fn depth_runs_from_zero_to_one_and_reversed() {
        let camera = camera();
        let depth = |m: Mat4, z: f32| {
            let clip = m * Vec4::new(0.0, 0.0, -z, 1.0);
            clip.z / clip.w
        };
        let close = |a: f32, b: f32| assert!((a - b).abs() < 1e-6, "{a} is not {b}");
        close(depth(camera.projection(1.0), 0.1), 0.0);
        close(depth(camera.projection(1.0), 100.0), 1.0);
        close(depth(camera.projection_reversed(1.0), 0.1), 1.0);
        close(depth(camera.projection_reversed(1.0), 1e7), 0.0);
        let endless = SceneCamera {
            zfar: None,
            ..camera
        };
        close(depth(endless.projection(1.0), 0.1), 0.0);
        close(depth(endless.projection(1.0), 1e9), 1.0);
    }

    #[test]
    fn top_of_the_picture_is_up() {
        let camera = camera();
        let size = UVec2::new(8, 8);
        let top = camera.ray(UVec2::new(4, 0), size).direction;
        let bottom = camera.ray(UVec2::new(4, 7), size).direction;
        assert!(top.dot(camera.up) > bottom.dot(camera.up));
        let left = camera.ray(UVec2::new(0, 4), size).direction;
        let right = camera.ray(UVec2::new(7, 4), size).direction;
        assert!(right.dot(camera.right) > left.dot(camera.right));
    }

    #[test]
    fn framing_holds_the_bounds_at_every_scale() {
        for scale in [1e-6, 1.0, 1e6] {
            for offset in [Vec3::ZERO, Vec3::new(10.0, -3.0, 2.0)] {
                let bounds = Aabb {
                    min: (Vec3::new(-1.0, 0.0, -2.0) + offset) * scale,
                    max: (Vec3::new(3.0, 1.0, 2.0) + offset) * scale,
                };
                let camera = SceneCamera::framing(&bounds);
                assert_eq!(camera.fault(), None);
                let matrix = camera.view_projection(1.0);
                for corner in bounds.corners() {
                    let clip = matrix * corner.extend(1.0);
                    assert!(clip.x.abs() <= clip.w && clip.y.abs() <= clip.w);
                    assert!(clip.z >= 0.0 && clip.z <= clip.w);
                }
            }
        }
        let point = Aabb {
            min: Vec3::ONE,
            max: Vec3::ONE,
        };
        for bounds in [Aabb::EMPTY, point] {
            assert_eq!(SceneCamera::framing(&bounds).fault(), None);
        }
    }
}
