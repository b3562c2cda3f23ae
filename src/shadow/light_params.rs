//! A light as shaders read it.

use crate::geometry::PixelCamera;
use crate::light::{AreaLight, LightShape};
use bytemuck::{Pod, Zeroable};

/// `Light` in `common/light.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct LightParams {
    /// Centre in scene space, metres, and 1; of a sun the unit vector towards it, and 0.
    pub center: [f32; 4],
    /// Unit vector; half the width or length, or the radius; of a sun the tangent of half its
    /// angle.
    pub axis_x: [f32; 4],
    /// Unit vector; half the height of a rectangle, else as `axis_x`.
    pub axis_y: [f32; 4],
    /// Unit vector that it emits along; sine of half a sun's angle.
    pub direction: [f32; 4],
    /// Linear RGB candela along its axis, of a sun lux; 1/m of its range, 0 for no limit.
    pub intensity: [f32; 4],
    /// Cosines at which a spot begins to fade and ends; 2 and -1 for none.
    pub cone: [f32; 4],
}

impl LightParams {
    /// A light for shaders.
    pub fn new(light: &AreaLight) -> Self {
        let (half_x, half_y, sine) = match light.shape {
            LightShape::Point => (0.0, 0.0, 0.0),
            LightShape::Disk { radius } | LightShape::Sphere { radius } => (radius, radius, 0.0),
            LightShape::Rect { width, height } => (0.5 * width, 0.5 * height, 0.0),
            LightShape::Line { length } => (0.5 * length, 0.5 * length, 0.0),
            LightShape::Sun { angular_diameter } => {
                let half = 0.5 * angular_diameter;
                (half.tan(), half.tan(), half.sin())
            }
        };
        let center = if light.shape.is_sun() {
            (-light.direction).extend(0.0)
        } else {
            light.center.extend(1.0)
        };
        let cone = light.spot.map(|cone| (cone.inner.cos(), cone.outer.cos()));
        let (inner, outer) = cone.unwrap_or((2.0, -1.0));
        let intensity = light.color * light.candela();
        let inverse_range = light.range.map_or(0.0, |range| 1.0 / range);
        Self {
            center: center.to_array(),
            axis_x: light.axis_x.extend(half_x).to_array(),
            axis_y: light.axis_y.extend(half_y).to_array(),
            direction: light.direction.extend(sine).to_array(),
            intensity: intensity.extend(inverse_range).to_array(),
            cone: [inner, outer, 0.0, 0.0],
        }
    }
}

/// Number of a shape in `common/light.glsl`: the value of specialization constants `LIGHT_SHAPE`.
pub fn shape_number(shape: &LightShape) -> u32 {
    match shape {
        LightShape::Point => 0,
        LightShape::Disk { .. } => 1,
        LightShape::Rect { .. } => 2,
        LightShape::Sphere { .. } => 3,
        LightShape::Line { .. } => 4,
        LightShape::Sun { .. } => 5,
    }
}

/// Camera and light: the uniform block that passes of one light share.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ViewParams {
    /// Camera of the picture.
    pub camera: PixelCamera,
    /// The light.
    pub light: LightParams,
}
