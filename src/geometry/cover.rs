//! Flat, solid, convex parts of a scene, which hide what lies behind them: floors, walls, boards.

use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// A convex polygon that solid triangles fill without a gap.
#[derive(Clone, Debug, PartialEq)]
pub struct Cover {
    /// Corners in order around `normal`, scene space.
    corners: Vec<DVec3>,
    normal: DVec3,
    offset: f64,
    /// How far coordinates may be off by rounding, metres.
    slack: f64,
}

/// Rounding of coordinates that are held in 32 bits, as a part of them.
const ROUNDING: f64 = 1.0e-6;

/// More corners than these are no floor.
const MOST_CORNERS: usize = 64;

impl Cover {
    /// The polygon that triangles make together: all in one plane, of one side, and with a convex
    /// outline. `None` if they don't.
    ///
    /// Edges that two triangles run through in opposite directions cancel; what is left is the
    /// outline. How often triangles cover a point is how often the outline winds around it, so a
    /// convex outline that winds once has no gap inside.
    pub(super) fn of(triangles: &[[Vec3; 3]]) -> Option<Self> {
        let first = triangles.first()?.map(|corner| corner.as_dvec3());
        let normal = (first[1] - first[0])
            .cross(first[2] - first[0])
            .try_normalize()?;
        let offset = normal.dot(first[0]);
        let size = triangles.iter().flatten().map(|p| p.abs().max_element());
        let slack = ROUNDING * f64::from(size.fold(0.0, f32::max));
        let mut next: HashMap<[u32; 3], Vec<Vec3>> = HashMap::new();
        for corners in triangles {
            let [a, b, c] = corners.map(|corner| corner.as_dvec3());
            if [a, b, c]
                .iter()
                .any(|p| (normal.dot(*p) - offset).abs() > slack)
            {
                return None;
            }
            // Winding says nothing about sides: all are turned alike.
            let mut corners = *corners;
            if normal.dot((b - a).cross(c - a)) < 0.0 {
                corners.swap(1, 2);
            }
            for i in 0..3 {
                let (from, to) = (corners[i], corners[(i + 1) % 3]);
                let back = next.entry(key(to)).or_default();
                if let Some(place) = back.iter().position(|p| key(*p) == key(from)) {
                    back.swap_remove(place);
                } else {
                    next.entry(key(from)).or_default().push(to);
                }
            }
        }
        next.retain(|_, ends| !ends.is_empty());
        if next.len() > MOST_CORNERS || next.values().any(|ends| ends.len() != 1) {
            return None;
        }
        // From a corner of the outline that no order of the map decides.
        let start = triangles
            .iter()
            .flatten()
            .find(|p| next.contains_key(&key(**p)))?;
        let mut corners = vec![start.as_dvec3()];
        let mut at = next.get(&key(*start))?[0];
        while key(at) != key(*start) {
            corners.push(at.as_dvec3());
            at = next.get(&key(at))?[0];
            if corners.len() > next.len() {
                return None;
            }
        }
        let cover = Self {
            corners,
            normal,
            offset,
            slack,
        };
        let whole = cover.corners.len() == next.len();
        (whole && cover.corners.iter().all(|c| cover.is_inside(*c, -slack)) && cover.winds_once())
            .then_some(cover)
    }

    /// Whether a convex outline goes around once: fans from its first corner do not turn back.
    fn winds_once(&self) -> bool {
        let [a, rest @ ..] = self.corners.as_slice() else {
            return false;
        };
        let angle: f64 = rest
            .windows(2)
            .map(|pair| (pair[0] - *a).angle_between(pair[1] - *a))
            .sum();
        angle < std::f64::consts::PI + 1.0e-6
    }

    /// Square metres.
    pub(super) fn area(&self) -> f64 {
        let [a, rest @ ..] = self.corners.as_slice() else {
            return 0.0;
        };
        let fans = rest.windows(2);
        fans.map(|pair| 0.5 * (pair[0] - *a).cross(pair[1] - *a).length())
            .sum()
    }

    /// Whether a point of the plane lies this far inside of all edges.
    fn is_inside(&self, point: DVec3, margin: f64) -> bool {
        (0..self.corners.len()).all(|i| {
            let from = self.corners[i];
            let along = self.corners[(i + 1) % self.corners.len()] - from;
            let inwards = self.normal.cross(along).normalize_or_zero();
            inwards.dot(point - from) >= margin
        })
    }

    /// The half-space behind it as `eye` sees it: a normal that points there, and an offset a
    /// rounding behind the polygon. `None` for an eye in its plane.
    pub(super) fn behind(&self, eye: DVec3) -> Option<(DVec3, f64)> {
        let side = self.normal.dot(eye) - self.offset;
        let sign = -side.signum();
        let slack = self.slack.max(ROUNDING * eye.abs().max_element());
        (side.abs() > slack).then_some((self.normal * sign, self.offset * sign + slack))
    }

    /// Whether a point behind its plane cannot be seen from `eye`: the line of sight crosses the
    /// polygon, in front of the near plane at `near` along `forward`.
    pub(super) fn hides(&self, point: DVec3, eye: DVec3, forward: DVec3, near: f64) -> bool {
        let (a, b) = (
            self.normal.dot(eye) - self.offset,
            self.normal.dot(point) - self.offset,
        );
        let crossing = eye + (point - eye) * (a / (a - b));
        let slack = self.slack.max(ROUNDING * eye.abs().max_element());
        (a < 0.0) != (b < 0.0)
            && (crossing - eye).dot(forward) > near + slack
            && self.is_inside(crossing, slack)
    }
}

fn key(point: Vec3) -> [u32; 3] {
    // Both zeros are one place.
    (point + Vec3::ZERO).to_array().map(f32::to_bits)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(count: usize) -> Vec<[Vec3; 3]> {
        let at = |x: usize, y: usize| Vec3::new(x as f32, 0.0, y as f32);
        let mut triangles = Vec::new();
        for y in 0..count {
            for x in 0..count {
                let [a, b] = [at(x, y), at(x + 1, y)];
                let [c, d] = [at(x, y + 1), at(x + 1, y + 1)];
                // Winding is as it happens to be.
                triangles.push(if x % 2 == 0 { [a, b, d] } else { [a, d, b] });
                triangles.push([a, c, d]);
            }
        }
        triangles
    }

    #[test]
    fn a_grid_is_a_cover_and_one_with_a_hole_is_none() {
        let mut triangles = grid(3);
        let cover = Cover::of(&triangles).unwrap();
        assert_eq!(cover.corners.len(), 12);
        assert!((cover.area() - 9.0).abs() < 1.0e-9);
        triangles.remove(8);
        assert!(Cover::of(&triangles).is_none());
        // A hole, and its area made up for elsewhere.
        triangles.push(triangles[0]);
        assert!(Cover::of(&triangles).is_none());
        let mut bent = grid(2);
        bent[3][0].y = 0.01;
        assert!(Cover::of(&bent).is_none());
        let mut corner_off = grid(2);
        corner_off.truncate(6);
        assert!(Cover::of(&corner_off).is_none());
    }

    #[test]
    fn what_is_behind_a_floor_is_hidden_and_what_is_beside_it_is_not() {
        let cover = Cover::of(&grid(4)).unwrap();
        let eye = DVec3::new(2.0, 1.0, 2.0);
        let down = DVec3::NEG_Y;
        assert!(cover.hides(DVec3::new(2.5, -1.0, 2.0), eye, down, 0.1));
        assert!(!cover.hides(DVec3::new(2.5, 0.5, 2.0), eye, down, 0.1));
        assert!(!cover.hides(DVec3::new(8.0, -1.0, 2.0), eye, down, 0.1));
        // A floor nearer than the near plane is not drawn.
        assert!(!cover.hides(DVec3::new(2.5, -1.0, 2.0), eye, down, 1.5));
        let (normal, offset) = cover.behind(eye).unwrap();
        assert!(normal.y < 0.0 && offset >= 0.0);
        assert!(cover.behind(DVec3::new(9.0, 0.0, 9.0)).is_none());
    }
}
