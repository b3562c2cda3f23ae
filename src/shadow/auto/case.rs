//! What says how hard a light's shadows are to find.

use crate::geometry::SceneBuffers;
use crate::light::{AreaLight, LightShape, ShapeKind};
use glam::DVec3;

/// One light over one scene, in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// The light's shape.
    pub shape: ShapeKind,
    /// Angle that the light takes up, as seen from the middle of what can block it: radians, 0 of a point.
    pub angle: f64,
    /// Half of the angle of the cone from the light around what can block it, radians, 0 to pi; 0 of a sun.
    pub cone: f64,
    /// Triangles of the draws that can block it.
    pub triangles: f64,
    /// Of them those with holes, 0 to 1.
    pub holes: f64,
    /// Of the picture.
    pub pixels: f64,
    /// Whether parts of the light differ in brightness.
    pub is_uneven: bool,
}

impl Case {
    /// `casters` says of each of the scene's draws whether it can block the light.
    #[must_use]
    pub fn new(light: &AreaLight, casters: &[bool], scene: &SceneBuffers, size: [u32; 2]) -> Self {
        let blocking = scene.draws().iter().zip(casters);
        let blocking: Vec<_> = blocking
            .filter(|(_, can)| **can)
            .map(|(draw, _)| draw)
            .collect();
        let count = |masked: bool| -> f64 {
            let draws = blocking
                .iter()
                .filter(|draw| !masked || draw.mask.is_some());
            // An empty sum of floats is -0.
            draws.fold(0.0, |sum, draw| sum + f64::from(draw.index_count) / 3.0)
        };
        let (triangles, holes) = (count(false), count(true));
        let corners = || {
            let all = blocking.iter().flat_map(|draw| draw.corners);
            all.map(|corner| corner.as_dvec3())
        };
        let center = light.center.as_dvec3();
        let (angle, cone) = match light.shape {
            LightShape::Sun { angular_diameter } => (f64::from(angular_diameter), 0.0),
            _ if blocking.is_empty() => (0.0, 0.0),
            shape => {
                let middle = corners().sum::<DVec3>() / (8 * blocking.len()) as f64;
                let axis = (middle - center).normalize_or_zero();
                let widest = corners()
                    .map(|corner| {
                        (corner - center)
                            .normalize_or_zero()
                            .dot(axis)
                            .clamp(-1.0, 1.0)
                    })
                    .fold(1.0, f64::min);
                let distance = (middle - center).length();
                (
                    2.0 * f64::from(shape.reach()).atan2(distance),
                    widest.acos(),
                )
            }
        };
        Self {
            shape: light.shape.kind(),
            angle,
            cone,
            triangles,
            holes: if triangles > 0.0 {
                holes / triangles
            } else {
                0.0
            },
            pixels: f64::from(size[0]) * f64::from(size[1]),
            is_uneven: light.is_uneven(),
        }
    }

    /// How unlike another case it is, for error and time at the same number of pixels: 0 for the same.
    #[must_use]
    pub fn distance_squared(&self, other: &Self) -> f64 {
        let log = |a: f64, b: f64, least: f64| (a.max(least) / b.max(least)).ln();
        // A factor of e in the light's size counts as much as one of 50 in the number of triangles, half of all
        // triangles having holes, or a light that looks all round instead of down.
        let parts = [
            log(self.angle, other.angle, 1e-4),
            0.25 * log(self.triangles, other.triangles, 1.0),
            2.0 * (self.holes - other.holes),
            0.6 * (self.cone - other.cone),
            match (self.shape, other.shape) {
                (a, b) if a == b => 0.0,
                (ShapeKind::Line | ShapeKind::Point, _)
                | (_, ShapeKind::Line | ShapeKind::Point) => 2.0,
                _ => 0.5,
            },
        ];
        parts.iter().map(|part| part * part).sum()
    }
}
