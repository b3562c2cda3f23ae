//! What stands between a light and the surfaces that a view of it looks at.

use crate::geometry::{HalfSpace, box_faces, clip};
use glam::{DVec3, Vec3};
use std::rc::Rc;

/// Boxes around all triangles, and which of them can block.
pub(super) struct Casters<'a> {
    pub boxes: &'a [[Vec3; 8]],
    /// For each of them.
    pub blocks: &'a [bool],
}

impl Casters<'_> {
    /// What can block within half-spaces of a view's frame: points whose hulls hold it, in that frame,
    /// and which boxes those are.
    pub(super) fn within(
        &self,
        shaft: &[HalfSpace],
        of: impl Fn(DVec3) -> DVec3,
    ) -> (Vec<DVec3>, Rc<[bool]>) {
        let mut points = Vec::new();
        let kept = self.boxes.iter().zip(self.blocks).map(|(corners, blocks)| {
            if !blocks || !corners.iter().all(|corner| corner.is_finite()) {
                return false;
            }
            let corners = corners.map(|corner| of(corner.as_dvec3()));
            let beyond = |plane: &HalfSpace| corners.iter().all(|c| plane.distance(*c) > 0.0);
            if shaft.iter().any(beyond) {
                return false;
            }
            let mut faces = box_faces(&corners);
            shaft.iter().for_each(|plane| clip(&mut faces, plane));
            let before = points.len();
            points.extend(faces.into_iter().flatten());
            points.len() > before
        });
        let kept = kept.collect();
        (points, kept)
    }
}

/// Nearest and farthest of some.
pub(super) fn depths(points: &[DVec3]) -> [f64; 2] {
    let z = points.iter().map(|v| v.z);
    z.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], z| {
        [a.min(z), b.max(z)]
    })
}

/// Points with `dot(normal, p) <= offset`.
pub(super) fn plane_of(normal: DVec3, offset: f64) -> HalfSpace {
    HalfSpace { normal, offset }
}
