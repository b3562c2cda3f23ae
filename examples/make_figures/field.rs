//! Solids as distance fields: below 0 inside, and nowhere steeper than 1.

use super::math::{V3, about, add, cross, dot, length, mix, scale, sub, unit};

/// A solid.
pub struct Field(Box<dyn Fn(V3) -> f64>);

impl Field {
    fn of(f: impl Fn(V3) -> f64 + 'static) -> Self {
        Self(Box::new(f))
    }

    /// No more than the distance to the surface.
    pub fn at(&self, p: V3) -> f64 {
        (self.0)(p)
    }

    pub fn ball(center: V3, radius: f64) -> Self {
        Self::of(move |p| length(sub(p, center)) - radius)
    }

    /// Half axes along x, y, z.
    pub fn ellipsoid(center: V3, half: V3) -> Self {
        let least = half[0].min(half[1]).min(half[2]);
        Self::of(move |p| {
            let [x, y, z] = sub(p, center);
            (length([x / half[0], y / half[1], z / half[2]]) - 1.0) * least
        })
    }

    /// A rod with round ends, `ra` thick at `a` and `rb` at `b`.
    pub fn rod(a: V3, b: V3, ra: f64, rb: f64) -> Self {
        let way = sub(b, a);
        // Between the ends the distance is to the core, less a thickness that changes along it.
        let slope = (ra - rb).abs() / length(way);
        let flat = 1.0 / (1.0 + slope * slope).sqrt();
        Self::of(move |p| {
            let t = (dot(sub(p, a), way) / dot(way, way)).clamp(0.0, 1.0);
            (length(sub(p, mix(a, b, t))) - (ra + (rb - ra) * t)) * flat
        })
    }

    /// Rods from point to point, each with its radius.
    pub fn chain(points: &[(V3, f64)]) -> Vec<Self> {
        let pairs = points.windows(2);
        pairs
            .map(|w| Self::rod(w[0].0, w[1].0, w[0].1, w[1].1))
            .collect()
    }

    /// A ring of a rod of radius `thick`, about `axis`.
    pub fn ring(center: V3, axis: V3, radius: f64, thick: f64) -> Self {
        let axis = unit(axis);
        Self::of(move |p| {
            let p = sub(p, center);
            let high = dot(p, axis);
            let flat = length(sub(p, scale(axis, high))) - radius;
            (flat * flat + high * high).sqrt() - thick
        })
    }

    /// A box of half sides `half` with its edges rounded by `round`, turned about `axis`.
    pub fn slab(center: V3, half: V3, round: f64, axis: V3, angle: f64) -> Self {
        let turn = about(unit(axis), -angle);
        let part = [turn[0], turn[1], turn[2]];
        Self::of(move |p| {
            let p = sub(p, center);
            let t = scale(cross(part, p), 2.0);
            let p = add(add(p, scale(t, turn[3])), cross(part, t));
            let over = [0, 1, 2].map(|i| p[i].abs() - (half[i] - round));
            let inside = over[0].max(over[1]).max(over[2]).min(0.0);
            length(over.map(|x| x.max(0.0))) + inside - round
        })
    }

    /// All of them in one; where two are closer than `soft` they flow together.
    pub fn joined(parts: Vec<Self>, soft: f64) -> Self {
        Self::of(move |p| {
            let all = parts.iter().map(|part| part.at(p));
            all.reduce(|a, b| smooth_min(a, b, soft)).unwrap_or(1e9)
        })
    }

    /// What is left without the others; `soft` as at [`joined`](Self::joined).
    pub fn without(self, holes: Vec<Self>, soft: f64) -> Self {
        Self::of(move |p| {
            let holes = holes.iter().map(|hole| hole.at(p));
            holes.fold(self.at(p), |left, hole| -smooth_min(-left, hole, soft))
        })
    }

    /// The direction away from the solid.
    pub fn normal(&self, p: V3, step: f64) -> V3 {
        let slope = |axis: usize| {
            let mut by = [0.0; 3];
            by[axis] = step;
            self.at(add(p, by)) - self.at(sub(p, by))
        };
        unit([slope(0), slope(1), slope(2)])
    }
}

/// The smaller one, rounded off where they are closer than `soft`.
fn smooth_min(a: f64, b: f64, soft: f64) -> f64 {
    if soft <= 0.0 {
        return a.min(b);
    }
    let near = (soft - (a - b).abs()).max(0.0) / soft;
    a.min(b) - 0.25 * near * near * soft
}
