//! Views from a light's centre that together look at every receiver.

use super::ShadowInputs;
use super::casters::is_before;
use crate::graph::Graph;
use crate::light::AreaLight;
use crate::scene::Aabb;
use bytemuck::{Pod, Zeroable};
use glam::{DMat4, DVec3, DVec4, Mat4};

/// Most views that a light can need: the faces of a cube.
pub const MAX_LIGHT_VIEWS: usize = 6;

/// One view from a light, as shaders read it: `LightView` in `common/light_view.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct LightView {
    /// Unit vector of the map's x; w: x of the map's corner.
    pub right: [f32; 4],
    /// Unit vector of the map's y; w: y of the map's corner.
    pub up: [f32; 4],
    /// Unit vector away from the light; w: 1 for a perspective view, 0 for a sun's.
    pub forward: [f32; 4],
    /// Scale of x and y, scale and offset of depth.
    pub scale: [f32; 4],
}

/// All views of one light, with the matrices that draw them.
#[derive(Clone, Debug, PartialEq)]
pub struct LightViews {
    /// As shaders read them.
    pub views: Vec<LightView>,
    /// From scene space to the clip space of each view: depth 1 near the light, 0 far away.
    pub clip_from_scene: Vec<Mat4>,
}

/// Widest half angle of a single perspective view around its receivers. Texels at its rim are 1 / cos^2 = 5.6 times as
/// wide as those in its middle; beyond that, the faces of a cube are finer.
const WIDEST: f64 = 65.0 * std::f64::consts::PI / 180.0;

/// Texels kept free around the receivers, as a part of the map: rounding must not push the outermost
/// ones out.
const MARGIN: f64 = 2.0 / 1024.0;

/// Finds the views of a light that look at every one of `receivers` (but behind a disk or rectangle,
/// where it gives no light): points whose convex hulls,
/// eight corners of a box or fewer of a clipped one, hold all surfaces that need its visibility.
/// One fitted view serves a sun, and a light whose receivers lie within a cone; otherwise there are
/// those faces of a cube that receivers stand before. No receivers, no views.
///
/// A sun's view begins before all of `casters`. Other views begin at the light.
///
/// `margin` is how far views reach beyond the receivers, as the tangent of an angle at the light (of
/// a sun in metres): techniques that look at the neighbourhood of a receiver need it, and 0 is for
/// those that do not.
pub fn light_views(
    light: &AreaLight,
    receivers: &[Vec<DVec3>],
    casters: &Aabb,
    margin: f64,
) -> LightViews {
    // A disk or rectangle gives no light behind its plane, so nobody there asks what blocks it.
    let counts = |hull: &&Vec<DVec3>| is_before(light, hull);
    let receivers: Vec<&Vec<DVec3>> = receivers.iter().filter(counts).collect();
    let points: Vec<DVec3> = receivers.iter().copied().flatten().copied().collect();
    let mut views = LightViews {
        views: Vec::new(),
        clip_from_scene: Vec::new(),
    };
    if points.is_empty() || casters.is_empty() {
        return views;
    }
    if light.shape.is_sun() {
        views.push_sun(light, &points, casters, margin);
        return views;
    }
    let center = light.center.as_dvec3();
    let offsets: Vec<DVec3> = points.iter().map(|p| *p - center).collect();
    let far = offsets.iter().map(|q| q.length()).fold(0.0, f64::max);
    // Reversed float depth is equally fine at every distance, so the near plane can be as close as
    // triangles can be told apart from the light itself.
    let near = (far * 1.0e-6).max(f64::from(f32::MIN_POSITIVE) * 1.0e6);
    let axis = middle_direction(&offsets).unwrap_or(light.direction.as_dvec3());
    let narrow = offsets
        .iter()
        .all(|q| q.dot(axis) > 0.0 && q.dot(axis) >= WIDEST.cos() * q.length());
    if narrow {
        let (right, up) = axes_across(axis, light);
        let slopes = offsets.iter().map(|q| {
            let z = q.dot(axis);
            [q.dot(right) / z, q.dot(up) / z]
        });
        let slopes: Vec<_> = slopes.collect();
        let turn = tightest_turn(&slopes);
        let (low, high) = bounds_of(slopes.into_iter().map(|p| turned(p, turn)), margin);
        let [right, up] = turned_axes(right, up, turn);
        views.push_perspective(center, [right, up, axis], low, high, near);
        return views;
    }
    for [forward, up] in cube_faces(light) {
        let right = forward.cross(up);
        let sides = [right, -right, up, -up].map(|side| forward + side);
        let planes = [forward, sides[0], sides[1], sides[2], sides[3]];
        let seen = receivers.iter().filter(|hull| {
            let within = |plane: &DVec3| hull.iter().any(|p| (*p - center).dot(*plane) >= 0.0);
            planes.iter().all(within)
        });
        // What is seen, within the face: a hull that reaches behind the light may show anywhere.
        let mut part: Option<([f64; 2], [f64; 2])> = None;
        for hull in seen {
            let (low, high) = extent_on_face(hull, center, [right, up, forward]);
            if low[0] > high[0] || low[1] > high[1] {
                continue;
            }
            let (a, b) = part.get_or_insert((low, high));
            for axis in 0..2 {
                a[axis] = a[axis].min(low[axis]);
                b[axis] = b[axis].max(high[axis]);
            }
        }
        if let Some((low, high)) = part {
            let (low, high) = bounds_of([low, high].into_iter(), margin);
            views.push_perspective(center, [right, up, forward], low, high, near);
        }
    }
    views
}

/// Directions and up vectors of the faces of a cube around a light. That of a flat light stands
/// along it, so that its last face looks where the light does not.
fn cube_faces(light: &AreaLight) -> Vec<[DVec3; 2]> {
    let (x, y, z) = if light.shape.is_one_sided() {
        let (x, z) = (light.axis_x.as_dvec3(), light.direction.as_dvec3());
        (x, z.cross(x), z)
    } else {
        (DVec3::X, DVec3::Y, DVec3::Z)
    };
    let mut faces = vec![[z, y], [x, y], [-x, y], [y, x], [-y, x], [-z, y]];
    if light.shape.is_one_sided() {
        faces.pop();
    }
    faces
}

/// Where a hull may show on a face of the cube, within -1 to 1.
fn extent_on_face(
    hull: &[DVec3],
    center: DVec3,
    [right, up, forward]: [DVec3; 3],
) -> ([f64; 2], [f64; 2]) {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for point in hull {
        let q = *point - center;
        let z = q.dot(forward);
        if z <= 1.0e-6 * q.length() {
            return ([-1.0; 2], [1.0; 2]);
        }
        let at = [q.dot(right) / z, q.dot(up) / z];
        for axis in 0..2 {
            low[axis] = low[axis].min(at[axis]);
            high[axis] = high[axis].max(at[axis]);
        }
    }
    (low.map(|v| v.max(-1.0)), high.map(|v| v.min(1.0)))
}

/// The direction in the middle of all of them: the axis of about the narrowest cone around them
/// (Badoiu and Clarkson 2003, on the sphere). How many there are on which side does not matter.
fn middle_direction(offsets: &[DVec3]) -> Option<DVec3> {
    let directions: Vec<DVec3> = offsets.iter().map(|q| q.normalize_or_zero()).collect();
    let sum: DVec3 = directions.iter().sum();
    let mut axis = sum.try_normalize()?;
    for step in 1..=64 {
        let farthest = directions
            .iter()
            .min_by(|a, b| a.dot(axis).total_cmp(&b.dot(axis)))?;
        axis = (axis + (*farthest - axis) / f64::from(step + 1)).try_normalize()?;
    }
    Some(axis)
}

/// The turn, as cosine and sine, after which an upright rectangle around the points is smallest, of
/// 16 in a right angle: finer texels for the same map.
fn tightest_turn(points: &[[f64; 2]]) -> [f64; 2] {
    let area = |turn: [f64; 2]| {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points {
            let at = turned(*point, turn);
            for axis in 0..2 {
                low[axis] = low[axis].min(at[axis]);
                high[axis] = high[axis].max(at[axis]);
            }
        }
        (high[0] - low[0]) * (high[1] - low[1])
    };
    let turns = (0..16).map(|step| {
        let (sine, cosine) = (f64::from(step) * std::f64::consts::PI / 32.0).sin_cos();
        [cosine, sine]
    });
    let best = turns.min_by(|a, b| area(*a).total_cmp(&area(*b)));
    best.unwrap_or([1.0, 0.0])
}

/// A point in axes that are turned by an angle.
fn turned([x, y]: [f64; 2], [cosine, sine]: [f64; 2]) -> [f64; 2] {
    [x * cosine + y * sine, y * cosine - x * sine]
}

/// The axes that `turned` gives coordinates in.
fn turned_axes(right: DVec3, up: DVec3, [cosine, sine]: [f64; 2]) -> [DVec3; 2] {
    [right * cosine + up * sine, up * cosine - right * sine]
}

/// Two unit vectors that form a frame with `forward`, turned with the light.
fn axes_across(forward: DVec3, light: &AreaLight) -> (DVec3, DVec3) {
    let hint = light.axis_x.as_dvec3();
    let across = hint - forward * hint.dot(forward);
    let right = across.normalize_or(forward.any_orthonormal_vector());
    (right, forward.cross(right))
}

/// Bounds of points, widened by a margin and some texels. Equal bounds get some width.
fn bounds_of(points: impl Iterator<Item = [f64; 2]>, margin: f64) -> ([f64; 2], [f64; 2]) {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for point in points {
        for axis in 0..2 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    let longest = (high[0] - low[0]).max(high[1] - low[1]).max(1.0e-6);
    for axis in 0..2 {
        let width = (high[axis] - low[axis]).max(1.0e-3 * longest);
        high[axis] = low[axis] + width;
        low[axis] -= MARGIN * width + margin;
        high[axis] += MARGIN * width + margin;
    }
    (low, high)
}

/// Notes in a graph which views of a light are left out, for those that look all round.
pub(super) fn note_left_out(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    technique: &str,
    views: &LightViews,
) {
    let (made, all) = (views.views.len(), cube_faces(&inputs.light).len());
    // One view may be fitted to all that is in view, and then there are no others.
    if (2..all).contains(&made) {
        let reason = format!(
            "{} of {all} views look at nothing that is in view",
            all - made
        );
        graph.skip(format!("{technique}.views {}", inputs.light_name), reason);
    }
}

impl LightViews {
    fn push_sun(&mut self, light: &AreaLight, points: &[DVec3], casters: &Aabb, margin: f64) {
        let forward = light.direction.as_dvec3();
        let (right, up) = axes_across(forward, light);
        let places: Vec<_> = (points.iter().map(|p| [p.dot(right), p.dot(up)])).collect();
        let turn = tightest_turn(&places);
        let (low, high) = bounds_of(places.into_iter().map(|p| turned(p, turn)), margin);
        let [right, up] = turned_axes(right, up, turn);
        let casters = casters.corners().map(|corner| corner.as_dvec3());
        let depths = points.iter().chain(&casters).map(|p| p.dot(forward));
        let (near, far) = depths.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| {
            (a.min(z), b.max(z))
        });
        let width = (far - near).max(1.0e-6);
        let (near, far) = (near - MARGIN * width, far + MARGIN * width);
        let depth = [-1.0 / (far - near), far / (far - near)];
        self.push([right, up, forward], low, high, depth, None);
    }

    /// Adds the perspective view from `center` along the last axis of `frame` (right, up, forward),
    /// between two corners in tangents of angles.
    pub(super) fn push_perspective(
        &mut self,
        center: DVec3,
        frame: [DVec3; 3],
        low: [f64; 2],
        high: [f64; 2],
        near: f64,
    ) {
        self.push(frame, low, high, [near, 0.0], Some(center));
    }

    /// Adds the view in which map coordinates run from `low` to `high`, y downwards.
    fn push(
        &mut self,
        frame: [DVec3; 3],
        low: [f64; 2],
        high: [f64; 2],
        depth: [f64; 2],
        center: Option<DVec3>,
    ) {
        let [right, up, forward] = frame;
        let corner = [low[0], high[1]];
        let scale = [1.0 / (high[0] - low[0]), -1.0 / (high[1] - low[1])];
        let row = |axis: DVec3, w: f64| {
            let v = axis.as_vec3();
            [v.x, v.y, v.z, w as f32]
        };
        let perspective = f64::from(u8::from(center.is_some()));
        self.views.push(LightView {
            right: row(right, corner[0]),
            up: row(up, corner[1]),
            forward: row(forward, perspective),
            scale: [scale[0], scale[1], depth[0], depth[1]].map(|v| v as f32),
        });
        // clip.xy = 2 map - 1 and clip.z = depth, times clip.w = z in a perspective view.
        let origin = center.unwrap_or_default();
        let plane = |axis: DVec3| axis.extend(-axis.dot(origin));
        let one = match center {
            Some(_) => plane(forward),
            None => DVec4::W,
        };
        let clip_axis =
            |axis: DVec3, i: usize| (plane(axis) - one * corner[i]) * (2.0 * scale[i]) - one;
        let clip_z = match center {
            Some(_) => DVec4::W * depth[0],
            None => plane(forward) * depth[0] + DVec4::W * depth[1],
        };
        let rows = [clip_axis(right, 0), clip_axis(up, 1), clip_z, one];
        let matrix = DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
        self.clip_from_scene.push(matrix.as_mat4());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::LightShape;
    use glam::{Vec3, Vec4};

    fn cube(center: Vec3, half: f32) -> Aabb {
        Aabb {
            min: center - Vec3::splat(half),
            max: center + Vec3::splat(half),
        }
    }

    /// Twin of `light_view_project` in `common/light_view.glsl`.
    fn project(view: &LightView, q: Vec3) -> Vec3 {
        let dot = |row: [f32; 4]| Vec3::new(row[0], row[1], row[2]).dot(q);
        let v = Vec3::new(dot(view.right), dot(view.up), dot(view.forward));
        let [sx, sy, sz, offset] = view.scale;
        if view.forward[3] > 0.0 {
            let x = (v.x / v.z - view.right[3]) * sx;
            let y = (v.y / v.z - view.up[3]) * sy;
            Vec3::new(x, y, sz / v.z)
        } else {
            let (x, y) = ((v.x - view.right[3]) * sx, (v.y - view.up[3]) * sy);
            Vec3::new(x, y, sz * v.z + offset)
        }
    }

    fn hulls(boxes: &[Aabb]) -> Vec<Vec<DVec3>> {
        let corners = |bounds: &Aabb| bounds.corners().map(|c| c.as_dvec3()).to_vec();
        boxes.iter().map(corners).collect()
    }

    fn check_views(light: &AreaLight, casters: &[Aabb], expected: usize) {
        let around = casters.iter().fold(Aabb::EMPTY, |all, one| all.union(one));
        let views = light_views(light, &hulls(casters), &around, 0.0);
        assert_eq!(views.views.len(), expected);
        let origin = if light.shape.is_sun() {
            Vec3::ZERO
        } else {
            light.center
        };
        for corner in casters.iter().flat_map(|bounds| bounds.corners()) {
            let mut seen = false;
            for (view, matrix) in views.views.iter().zip(&views.clip_from_scene) {
                let clip = *matrix * Vec4::from((corner, 1.0));
                let map = project(view, corner - origin);
                if clip.w > 0.0 && map.x.clamp(0.0, 1.0) == map.x && map.y.clamp(0.0, 1.0) == map.y
                {
                    seen = true;
                    let ndc = clip.truncate() / clip.w;
                    let expected = Vec3::new(2.0 * map.x - 1.0, 2.0 * map.y - 1.0, map.z);
                    let error = (ndc - expected).abs();
                    assert!(error.max_element() < 2.0e-5, "{ndc} {expected}");
                }
            }
            assert!(seen, "{corner} is in no view");
        }
    }

    #[test]
    fn a_narrow_light_gets_one_fitted_view() {
        let light = AreaLight::new(
            LightShape::Disk { radius: 0.3 },
            Vec3::new(1.0, 8.0, 2.0),
            Vec3::NEG_Y,
            Vec3::X,
        );
        let casters = [cube(Vec3::ZERO, 1.0), cube(Vec3::new(2.0, 0.0, 1.0), 0.5)];
        check_views(&light, &casters, 1);
    }

    #[test]
    fn a_sun_gets_one_fitted_view() {
        let shape = LightShape::Sun {
            angular_diameter: 0.01,
        };
        let light = AreaLight::new(shape, Vec3::ZERO, Vec3::new(0.3, -1.0, 0.2), Vec3::X);
        check_views(&light, &[cube(Vec3::new(5.0, 1.0, -3.0), 4.0)], 1);
    }

    #[test]
    fn a_lamp_in_a_room_gets_only_the_faces_it_needs() {
        let light = AreaLight::new(LightShape::Point, Vec3::ZERO, Vec3::NEG_Y, Vec3::X);
        check_views(&light, &[cube(Vec3::ZERO, 3.0)], 6);
        let floor = Aabb {
            min: Vec3::new(-20.0, -1.1, -20.0),
            max: Vec3::new(20.0, -1.0, 20.0),
        };
        check_views(&light, &[floor], 5);
        assert!(light_views(&light, &[], &floor, 0.0).views.is_empty());
        assert!(
            light_views(&light, &hulls(&[floor]), &Aabb::EMPTY, 0.0)
                .views
                .is_empty()
        );
    }
}
