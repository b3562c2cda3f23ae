//! Convex polyhedra cut by planes.

use glam::DVec3;

/// A half-space: points with `dot(normal, p) <= offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Need not be of length 1.
    pub normal: DVec3,
    /// In units of the normal's length.
    pub offset: f64,
}

impl HalfSpace {
    /// Below 0 for points inside, in units of the normal's length.
    pub fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

/// The six faces of a box, given by its corners (x changing fastest, then y), as polygons.
pub fn box_faces(corners: &[DVec3; 8]) -> Vec<Vec<DVec3>> {
    let faces = [
        [0, 1, 3, 2],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 3, 7, 5],
    ];
    faces.map(|face| face.map(|i| corners[i]).to_vec()).to_vec()
}

/// Cuts a convex polyhedron, given by its faces, by a half-space, and closes the cut. Only the hull
/// of the result counts, so the points of the cut need no order.
pub fn clip(faces: &mut Vec<Vec<DVec3>>, plane: &HalfSpace) {
    let mut cut = Vec::new();
    for face in faces.iter_mut() {
        let mut kept = Vec::with_capacity(face.len() + 1);
        for (i, &from) in face.iter().enumerate() {
            let to = face[(i + 1) % face.len()];
            let (a, b) = (plane.distance(from), plane.distance(to));
            if a <= 0.0 {
                kept.push(from);
            }
            if (a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0) {
                let point = from + (to - from) * (a / (a - b));
                kept.push(point);
                cut.push(point);
            }
        }
        *face = kept;
    }
    faces.retain(|face| !face.is_empty());
    if let Some(closing) = in_order(cut, plane.normal) {
        faces.push(closing);
    }
}

/// Points of a convex polygon across `normal`, sorted around their middle.
fn in_order(mut points: Vec<DVec3>, normal: DVec3) -> Option<Vec<DVec3>> {
    if points.len() < 3 {
        return None;
    }
    let middle = points.iter().sum::<DVec3>() / points.len() as f64;
    let x = normal.normalize_or(DVec3::Z).any_orthonormal_vector();
    let y = normal.normalize_or(DVec3::Z).cross(x);
    let angle = |p: &DVec3| (*p - middle).dot(y).atan2((*p - middle).dot(x));
    points.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    Some(points)
}
