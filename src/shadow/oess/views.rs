//! Views from points on a line light, with a shared orientation: an image's x axis lies along the
//! line, so that a row is the image of one plane through it, and the same plane in every view.

use crate::light::AreaLight;
use crate::scene::Aabb;
use crate::shadow::light_view::LightViews;
use glam::DVec3;

/// Most sectors around a line: quarters.
pub(super) const MOST_SECTORS: usize = 4;

/// Widest half angle of a single sector across its receivers.
const WIDEST: f64 = 65.0 * std::f64::consts::PI / 180.0;

/// Steepest direction along the line that a view looks in, as the tangent against its forward axis.
const STEEPEST: f64 = 12.0;

/// Nearest depth that blockers are looked for in, as a part of the line's length: nearer ones may
/// lie outside of a view.
const NEAREST_BLOCKER: f64 = 0.25;

/// Part of an image kept free around the receivers.
const MARGIN: f64 = 2.0 / 512.0;

/// The views from all points, sector by sector.
#[derive(Clone, Debug)]
pub(super) struct LineViews {
    /// Layer `sector * points + point`.
    pub views: LightViews,
    /// Number of sectors.
    pub sectors: usize,
    /// Largest part of a map's width that the line's length may be in front of a receiver.
    pub widest: f64,
}

/// Axes of a sector: along the line, across, away from it.
type Frame = [DVec3; 3];

/// Finds the sectors around a line that hold receivers, given as convex hulls, and the views from
/// its points, of which there are so many at equal distances. Each view holds what may hide its
/// neighbours from receivers, with `ends` those of the line's ends what may hide the other end.
pub(super) fn line_views(
    light: &AreaLight,
    receivers: &[Vec<DVec3>],
    casters: &[Aabb],
    points: usize,
    ends: bool,
) -> LineViews {
    let axis = light.axis_x.as_dvec3().normalize();
    let length = 2.0 * f64::from(light.shape.bounding_radius());
    let center = light.center.as_dvec3();
    let first = center - axis * (0.5 * length);
    let step = axis * (length / (points - 1) as f64);
    let mut views = LineViews {
        views: LightViews {
            views: Vec::new(),
            clip_from_scene: Vec::new(),
        },
        sectors: 0,
        widest: 0.0,
    };
    for (frame, whole) in sectors(light, receivers) {
        let [right, _, forward] = frame;
        let local = |p: &DVec3| {
            let q = *p - first;
            DVec3::new(q.dot(right), q.dot(frame[1]), q.dot(forward))
        };
        let seen: Vec<DVec3> = receivers
            .iter()
            .flat_map(|hull| {
                let hull: Vec<DVec3> = hull.iter().map(local).collect();
                if whole { hull } else { in_quarter(hull) }
            })
            .collect();
        let far = seen.iter().map(|v| v.length()).fold(0.0, f64::max);
        let near = (far * 1.0e-6).max(f64::from(f32::MIN_POSITIVE) * 1.0e6);
        if seen.iter().all(|v| v.z <= near) {
            continue;
        }
        // A hull may reach to the line's own axis, where rounding decides the sign of depths: what is
        // so near is as steep as it gets.
        let steepness =
            |v: &DVec3, across: f64| (across / v.z.max(near)).clamp(-STEEPEST, STEEPEST);
        let blocker = nearest_depth(casters, &local, far).max(NEAREST_BLOCKER * length);
        // From the line's point at a distance along it, metres.
        let extent = |along: f64| range(seen.iter().map(|v| steepness(v, v.x - along)));
        let ends: Vec<(f64, f64)> = (0..points)
            .map(|point| {
                let (low, high) = extent(length * point as f64 / (points - 1) as f64);
                // What hides a point so far away from a receiver lies at most that far beyond it.
                let step = length / (points - 1) as f64;
                let (outer, last) = (if ends { length } else { step }, points - 1);
                let (before, after) = match point {
                    0 => (0.0, outer),
                    _ if point == last => (outer, 0.0),
                    _ => (step, step),
                };
                (low - before / blocker, high + after / blocker)
            })
            .collect();
        let widest = ends.iter().map(|(a, b)| b - a).fold(1.0e-6, f64::max);
        let (low_y, high_y) = range(seen.iter().map(|v| steepness(v, v.y)));
        let height = (high_y - low_y).max(1.0e-3 * widest);
        for (point, (low, _)) in ends.into_iter().enumerate() {
            let low_x = low - MARGIN * widest;
            views.views.push_perspective(
                first + step * point as f64,
                frame,
                [low_x, low_y - MARGIN * height],
                [
                    low_x + widest * (1.0 + 2.0 * MARGIN),
                    low_y + height * (1.0 + MARGIN),
                ],
                near,
            );
        }
        views.widest = views.widest.max(length / blocker / widest);
        views.sectors += 1;
    }
    views
}

/// Frames of the sectors, and whether each holds all receivers.
fn sectors(light: &AreaLight, receivers: &[Vec<DVec3>]) -> Vec<(Frame, bool)> {
    let right = light.axis_x.as_dvec3().normalize();
    let center = light.center.as_dvec3();
    let across: Vec<DVec3> = receivers
        .iter()
        .flatten()
        .map(|p| *p - center)
        .map(|q| q - right * q.dot(right))
        .collect();
    let frame = |forward: DVec3| [right, forward.cross(right), forward];
    let sum: DVec3 = across.iter().map(|q| q.normalize_or_zero()).sum();
    if let Some(mut forward) = sum.try_normalize() {
        let (x, y) = (forward, forward.cross(right));
        let angles = across.iter().map(|q| q.dot(y).atan2(q.dot(x)));
        let (low, high) = range(angles);
        if high - low <= 2.0 * WIDEST {
            let (sine, cosine) = (0.5 * (low + high)).sin_cos();
            forward = x * cosine + y * sine;
            return vec![(frame(forward), true)];
        }
    }
    if across.is_empty() {
        return Vec::new();
    }
    let down = light.direction.as_dvec3();
    let down = (down - right * down.dot(right)).normalize_or(right.any_orthonormal_vector());
    let side = down.cross(right);
    [down, side, -side, -down]
        .into_iter()
        .map(|forward| (frame(forward), false))
        .collect()
}

/// Points whose convex hull holds the part of a hull within the quarter around the z axis.
fn in_quarter(hull: Vec<DVec3>) -> Vec<DVec3> {
    let mut hull = hull;
    for side in [1.0, -1.0] {
        let height = |v: &DVec3| v.z + side * v.y;
        if hull.iter().all(|v| height(v) >= 0.0) {
            continue;
        }
        let mut cut: Vec<DVec3> = hull.iter().copied().filter(|v| height(v) >= 0.0).collect();
        if cut.is_empty() {
            return cut;
        }
        for (i, a) in hull.iter().enumerate() {
            for b in &hull[i + 1..] {
                let (from, to) = (height(a), height(b));
                if (from < 0.0) != (to < 0.0) {
                    cut.push(*a + (*b - *a) * (from / (from - to)));
                }
            }
        }
        hull = cut;
    }
    hull
}

/// Smallest distance in front of a sector's plane that a box with triangles may have.
fn nearest_depth(casters: &[Aabb], local: &impl Fn(&DVec3) -> DVec3, far: f64) -> f64 {
    let depth = |bounds: &Aabb| {
        let depths = bounds.corners().map(|corner| local(&corner.as_dvec3()).z);
        let (low, high) = range(depths.into_iter());
        if high > 0.0 { low.max(0.0) } else { far }
    };
    let solid = casters.iter().filter(|bounds| !bounds.is_empty());
    solid.map(depth).fold(far, f64::min)
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
        (a.min(v), b.max(v))
    })
}
