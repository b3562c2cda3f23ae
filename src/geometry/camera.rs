//! The camera as shaders see it, and culling against its frustum and those of lights.

use crate::scene::{Aabb, SceneCamera};
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec4};

/// `Camera` in `common/camera.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct PixelCamera {
    /// xyz: the eye in scene space, metres.
    pub eye: [f32; 4],
    /// xyz: ray through the top left corner of pixel (0, 0), of length 1 along the view direction;
    /// w: distance of the near plane in metres.
    pub corner_ray: [f32; 4],
    /// xyz: from one pixel to the next on its right; w: half the width in pixels.
    pub pixel_right: [f32; 4],
    /// xyz: from one pixel to the next below; w: half the height in pixels.
    pub pixel_down: [f32; 4],
}

impl PixelCamera {
    /// The camera of a picture of `size` pixels, both at least 1.
    pub fn new(camera: &SceneCamera, size: [u32; 2]) -> Self {
        let [width, height] = size.map(f64::from);
        let pixel = 2.0 * camera.tan_half_fov() / height;
        let right = camera.right.as_dvec3() * pixel;
        let down = -camera.up.as_dvec3() * pixel;
        let corner = camera.forward.as_dvec3() - right * (0.5 * width) - down * (0.5 * height);
        let row = |v: glam::DVec3, w: f64| v.as_vec3().extend(w as f32).to_array();
        Self {
            eye: camera.position.extend(0.0).to_array(),
            corner_ray: row(corner, f64::from(camera.znear)),
            pixel_right: row(right, 0.5 * width),
            pixel_down: row(down, 0.5 * height),
        }
    }

    /// Width and height of the picture in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.pixel_right[3], self.pixel_down[3]].map(|half| (2.0 * half) as u32)
    }
}

/// Whether any part of a box may be in the frustum of a matrix into Vulkan's clip space. May say
/// yes for a box outside near a corner, never no for one inside.
pub fn frustum_sees(clip_from_scene: &Mat4, bounds: &Aabb) -> bool {
    if bounds.is_empty() {
        return false;
    }
    let corners = bounds
        .corners()
        .map(|corner| *clip_from_scene * Vec4::from((corner, 1.0)));
    let outside = |distance: fn(&Vec4) -> f32| corners.iter().all(|c| distance(c) < 0.0);
    !(outside(|c| c.w + c.x)
        || outside(|c| c.w - c.x)
        || outside(|c| c.w + c.y)
        || outside(|c| c.w - c.y)
        || outside(|c| c.z)
        || outside(|c| c.w - c.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{UVec2, Vec3};

    #[test]
    fn pixel_rays_are_those_of_the_camera() {
        let camera = SceneCamera::framing(&Aabb {
            min: Vec3::new(-1.0, 0.0, -2.0),
            max: Vec3::new(3.0, 2.0, 2.0),
        });
        let size = [64, 48];
        let pixels = PixelCamera::new(&camera, size);
        assert_eq!(pixels.size(), size);
        let vector = |row: [f32; 4]| Vec3::new(row[0], row[1], row[2]);
        for pixel in [[0, 0], [63, 0], [17, 40], [63, 47]] {
            let ray = vector(pixels.corner_ray)
                + (pixel[0] as f32 + 0.5) * vector(pixels.pixel_right)
                + (pixel[1] as f32 + 0.5) * vector(pixels.pixel_down);
            let expected = camera.ray(UVec2::from(pixel), UVec2::from(size));
            assert!((ray.normalize() - expected.direction).length() < 1.0e-6);
            assert!((ray.dot(camera.forward) - 1.0).abs() < 1.0e-6);
        }
    }

    #[test]
    fn culling_keeps_what_may_be_seen() {
        let bounds = Aabb {
            min: Vec3::splat(-1.0),
            max: Vec3::splat(1.0),
        };
        let camera = SceneCamera::framing(&bounds);
        let matrix = camera.view_projection_reversed(1.0);
        assert!(frustum_sees(&matrix, &bounds));
        let behind = camera.position - 10.0 * camera.forward;
        let hidden = Aabb {
            min: behind - Vec3::ONE,
            max: behind + Vec3::ONE,
        };
        assert!(!frustum_sees(&matrix, &hidden));
        let around = Aabb {
            min: camera.position - Vec3::splat(100.0),
            max: camera.position + Vec3::splat(100.0),
        };
        assert!(frustum_sees(&matrix, &around));
        assert!(!frustum_sees(&matrix, &Aabb::EMPTY));
    }
}
