//! Where the scene is cut into slices from: centres of projection, depth ranges, slice planes.

use super::between::{Casters, depths, plane_of};
use super::options::{OcclusionOptions, Planes, Projection};
use crate::light::{AreaLight, LightShape};
use bytemuck::{Pod, Zeroable};
use glam::{DMat4, DVec3, DVec4, Mat4};
use std::rc::Rc;

/// `OcclusionView` in `occlusion_textures/params.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct OcclusionView {
    pub right: [f32; 4],
    pub up: [f32; 4],
    pub forward: [f32; 4],
    pub scale: [f32; 4],
    pub range: [f32; 4],
    pub half_x: [f32; 4],
    pub half_y: [f32; 4],
    pub border: [f32; 4],
}

/// No border: beyond it nothing blocks.
const EMPTY_BEYOND: [f32; 4] = [-1.0e9, -1.0e9, 1.0e9, 1.0e9];

/// A view with what it takes to draw it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SlicedView {
    pub params: OcclusionView,
    /// Scene space to the clip space of the centre of projection, depth clamped by nothing: all in
    /// front of it is drawn.
    pub clip_from_scene: Mat4,
    /// Metres along the view: dot(xyz, p) + w.
    pub depth: [f32; 4],
    /// Depths of the planes between fine slices, one more than there are slices.
    pub planes: Vec<f32>,
    /// Which of the boxes hold what the view shows.
    pub casters: Rc<[bool]>,
    /// Most texels, of an image of 1 texel, that a kernel can cover: its area as a part of the image.
    pub most_kernel: f64,
}

/// Widest half angle of a single view, as a slope: beyond it, texels at the rim are 5.6 times as
/// wide as those in the middle, and the faces of a cube are finer.
const WIDEST: f64 = 2.14;

/// Nearest slice plane, as a part of the farthest one's depth. Blockers between it and the light fall
/// into the first slice.
const NEAREST: f64 = 0.02;

/// Least range of the slices, as a part of what lies between the first plane and the farthest receiver:
/// thinner ones could not tell a surface from itself.
const LEAST_RANGE: f64 = 0.02;

/// Texels kept free around what is looked at, as a part of the image.
const MARGIN: f64 = 2.0 / 512.0;

/// Kernels reach at most this far beyond what receivers project to, as a part of that.
const MOST_REACH: f64 = 0.6;

/// Slope up to which a face of a cube is looked through: a little more than its own 45 degrees, so
/// that rounding leaves no gap.
const FACE: f64 = 1.0 + 1.0e-5;

/// Directions of a light's own frame.
#[derive(Clone, Copy)]
struct Frame {
    right: DVec3,
    up: DVec3,
    forward: DVec3,
}

impl Frame {
    fn of(&self, q: DVec3) -> DVec3 {
        DVec3::new(q.dot(self.right), q.dot(self.up), q.dot(self.forward))
    }
}

/// The views of a light; none where it has nothing to look at. `receivers` are hulls of all surfaces
/// that need its visibility.
pub(super) fn sliced_views(
    light: &AreaLight,
    receivers: &[Vec<DVec3>],
    casters: &Casters<'_>,
    options: &OcclusionOptions,
) -> Vec<SlicedView> {
    let points: Vec<DVec3> = receivers.iter().flatten().copied().collect();
    if points.is_empty() {
        return Vec::new();
    }
    let center = light.center.as_dvec3();
    let [x, y, z] = [light.axis_x, light.axis_y, light.direction].map(|v| v.as_dvec3());
    let own = Frame {
        right: x,
        up: -y,
        forward: z,
    };
    if light.shape.is_sun() {
        return sun_view(light, own, &points, casters, options)
            .into_iter()
            .collect();
    }
    let flat = matches!(
        light.shape,
        LightShape::Rect { .. } | LightShape::Disk { .. }
    );
    let axis = if flat {
        own
    } else {
        let sum: DVec3 = points
            .iter()
            .map(|p| (*p - center).normalize_or_zero())
            .sum();
        turned(&own, sum.normalize_or(z))
    };
    let local =
        |frame: &Frame| -> Vec<DVec3> { points.iter().map(|p| frame.of(*p - center)).collect() };
    let seen = local(&axis);
    let narrow = seen
        .iter()
        .all(|v| v.z > 0.0 && v.x.abs().max(v.y.abs()) <= WIDEST * v.z);
    let one_view = narrow || (flat && options.projection != Projection::Centered);
    if one_view {
        return local_view(light, axis, &seen, casters, options, f64::INFINITY)
            .into_iter()
            .collect();
    }
    let faces = [
        own.forward,
        own.right,
        -own.right,
        own.up,
        -own.up,
        -own.forward,
    ];
    faces
        .iter()
        .take(if flat { 5 } else { 6 })
        .filter_map(|forward| {
            let frame = turned(&own, *forward);
            // Hulls that may show within the face.
            let hulls = receivers.iter().map(|hull| {
                let hull: Vec<DVec3> = hull.iter().map(|p| frame.of(*p - center)).collect();
                clip_to_face(&hull)
            });
            let seen: Vec<DVec3> = hulls.flatten().collect();
            let centered = OcclusionOptions {
                projection: Projection::Centered,
                ..*options
            };
            local_view(light, frame, &seen, casters, &centered, FACE)
        })
        .collect()
}

/// A frame whose forward axis is given, with axes across it that follow another frame's.
fn turned(frame: &Frame, forward: DVec3) -> Frame {
    let hint = if forward.dot(frame.right).abs() < 0.8 {
        frame.right
    } else {
        frame.up
    };
    let right = (hint - forward * hint.dot(forward)).normalize_or(forward.any_orthonormal_vector());
    Frame {
        right,
        up: forward.cross(right),
        forward,
    }
}

/// Points around the part of a hull, given in a face's own frame, that lies within the face.
fn clip_to_face(hull: &[DVec3]) -> Vec<DVec3> {
    let planes = [
        DVec3::new(1.0, 0.0, 1.0),
        DVec3::new(-1.0, 0.0, 1.0),
        DVec3::new(0.0, 1.0, 1.0),
        DVec3::new(0.0, -1.0, 1.0),
        DVec3::Z,
    ];
    let beyond = |plane: &DVec3| hull.iter().all(|v| v.dot(*plane) < 0.0);
    if planes.iter().any(beyond) {
        return Vec::new();
    }
    let far = hull.iter().map(|v| v.z).fold(0.0, f64::max);
    let within = |v: &&DVec3| v.z > 0.0 && v.x.abs().max(v.y.abs()) <= v.z;
    if hull.iter().filter(within).count() == hull.len() {
        return hull.to_vec();
    }
    // The box of it, cut to the face's pyramid.
    let fold = |pick: fn(&DVec3) -> f64| {
        hull.iter()
            .map(pick)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
                (a.min(v), b.max(v))
            })
    };
    let ((x0, x1), (y0, y1)) = (fold(|v| v.x), fold(|v| v.y));
    let near = hull.iter().map(|v| v.z).fold(f64::INFINITY, f64::min);
    let near = near.max(1.0e-3 * far);
    let mut points = Vec::new();
    for z in [near, far] {
        for x in [x0, x1] {
            for y in [y0, y1] {
                points.push(DVec3::new(x.clamp(-z, z), y.clamp(-z, z), z));
            }
        }
    }
    points
}

fn sun_view(
    light: &AreaLight,
    frame: Frame,
    points: &[DVec3],
    casters: &Casters<'_>,
    options: &OcclusionOptions,
) -> Option<SlicedView> {
    let LightShape::Sun { angular_diameter } = light.shape else {
        unreachable!("only suns come here");
    };
    let tan = f64::from((0.5 * angular_diameter).tan());
    let seen: Vec<DVec3> = points.iter().map(|p| frame.of(*p)).collect();
    let far = seen.iter().map(|v| v.z).fold(f64::NEG_INFINITY, f64::max);
    let (low, high) = bounds(seen.iter().map(|v| [v.x, v.y]));
    // What the light covers of the plane at a depth, seen from the receivers, and all before those.
    let mut shaft = vec![plane_of(DVec3::Z, far)];
    for axis in 0..2 {
        let across = [DVec3::X, DVec3::Y][axis];
        shaft.push(plane_of(across + DVec3::Z * tan, high[axis] + tan * far));
        shaft.push(plane_of(DVec3::Z * tan - across, tan * far - low[axis]));
    }
    let (parts, casters) = casters.within(&shaft, |p| frame.of(p));
    if parts.is_empty() {
        return None;
    }
    let [near, last] = depths(&parts);
    let margin = tan * (far - near);
    let (mut low, mut high) = widened(low, high, margin);
    // Nothing outside of the casters' own extent blocks.
    let (casters_low, casters_high) = bounds(parts.iter().map(|v| [v.x, v.y]));
    let (casters_low, casters_high) = widened(casters_low, casters_high, 0.0);
    for axis in 0..2 {
        low[axis] = low[axis].max(casters_low[axis]);
        high[axis] = high[axis].min(casters_high[axis]);
    }
    let half = [tan as f32, tan as f32, 0.0, 0.0];
    let params = OcclusionView {
        half_x: half,
        half_y: half,
        border: EMPTY_BEYOND,
        ..OcclusionView::default()
    };
    let kernel = (2.0 * tan * (far - near)).powi(2);
    let extent = Extent {
        behind: None,
        low,
        high,
        near,
        far: last,
        length: far - near,
        local: false,
        kernel,
        slope: f64::INFINITY,
    };
    let view = finish(params, frame, DVec3::ZERO, &extent, options);
    Some(SlicedView { casters, ..view })
}

/// A view from behind a light, of receivers given in its frame.
fn local_view(
    light: &AreaLight,
    frame: Frame,
    receivers: &[DVec3],
    casters: &Casters<'_>,
    options: &OcclusionOptions,
    slope: f64,
) -> Option<SlicedView> {
    let center = light.center.as_dvec3();
    let far = receivers.iter().map(|v| v.z).fold(0.0, f64::max);
    if far <= 0.0 {
        return None;
    }
    let [axis_x, axis_y] = [light.axis_x, light.axis_y].map(|v| v.as_dvec3());
    let (half_x, half_y) = match light.shape {
        LightShape::Rect { width, height } => (
            frame.of(axis_x * (0.5 * f64::from(width))),
            frame.of(axis_y * (0.5 * f64::from(height))),
        ),
        LightShape::Disk { radius } => (
            frame.of(axis_x * f64::from(radius)),
            frame.of(axis_y * f64::from(radius)),
        ),
        _ => {
            let radius = f64::from(light.shape.bounding_radius());
            (DVec3::X * radius, DVec3::Y * radius)
        }
    };
    let reach = half_x.length().max(half_y.length());
    // What is between the light and the receivers: within the light's reach of the cone around them.
    let support = |normal: DVec3| match light.shape {
        LightShape::Rect { .. } => half_x.dot(normal).abs() + half_y.dot(normal).abs(),
        LightShape::Disk { .. } => half_x.dot(normal).hypot(half_y.dot(normal)),
        _ => reach * normal.length(),
    };
    let least = (NEAREST * far).max((0.25 * reach).min(0.25 * far));
    let slopes = receivers.iter().filter(|v| v.z > 0.0);
    let (low, high) = bounds(slopes.map(|v| [v.x / v.z, v.y / v.z]));
    let mut shaft = vec![plane_of(DVec3::Z, far), plane_of(-DVec3::Z, 0.0)];
    if receivers.iter().all(|v| v.z > 0.0) {
        for axis in 0..2 {
            let across = [DVec3::X, DVec3::Y][axis];
            for normal in [
                across - DVec3::Z * high[axis],
                DVec3::Z * low[axis] - across,
            ] {
                shaft.push(plane_of(normal, support(normal)));
            }
        }
    }
    let (parts, casters) = casters.within(&shaft, |p| frame.of(p - center));
    if parts.is_empty() {
        return None;
    }
    let [nearest, last] = depths(&parts);
    let near = nearest.max(least);
    if last <= 0.0 {
        return None;
    }
    let behind = match options.projection {
        Projection::Orthographic => None,
        Projection::Centered => Some(0.0),
        Projection::Offset => {
            let corners = parts
                .iter()
                .filter(|v| v.z > near)
                .map(|v| v.abs().to_array());
            let [wide, high] = [
                half_x.x.abs().max(half_y.x.abs()),
                half_x.y.abs().max(half_y.y.abs()),
            ];
            offset_of(corners, wide.max(1.0e-6), high.max(1.0e-6), far)
        }
    };
    let project = |v: DVec3| -> [f64; 2] {
        match behind {
            Some(d) => [v.x / (v.z + d), v.y / (v.z + d)],
            None => [v.x, v.y],
        }
    };
    let inverse = |z: f64| behind.map_or(1.0, |d| 1.0 / (z + d));
    // What kernels look at: from the receiver's own place to that of the line to the light's centre
    // on the nearest plane.
    let looks = receivers.iter().filter(|v| v.z > near).flat_map(|v| {
        let at_near = [v.x, v.y].map(|c| c * near / v.z * inverse(near));
        [project(*v), at_near]
    });
    let looks: Vec<[f64; 2]> = looks.collect();
    if looks.is_empty() {
        return None;
    }
    let (low, high) = bounds(looks.into_iter());
    let widest = (0..2).map(|i| high[i] - low[i]).fold(0.0, f64::max);
    let margin = (reach * (1.0 - near / far) * inverse(near)).min(MOST_REACH * widest);
    let (mut low, mut high) = widened(low, high, margin);
    // Nothing outside of the casters' own extent blocks.
    let at_light = parts.iter().any(|v| v.z <= 1.0e-6 * far);
    let (casters_low, casters_high) = if at_light && behind.is_some() {
        ([f64::NEG_INFINITY; 2], [f64::INFINITY; 2])
    } else {
        bounds(parts.iter().map(|v| project(*v)))
    };
    let (casters_low, casters_high) = widened(casters_low, casters_high, 0.0);
    // Kernels may reach out of the image where it ends before the casters do: what is there is taken
    // to be as what is inside.
    let mut border = [0.0, 0.0, 1.0, 1.0];
    for axis in 0..2 {
        let (a, b) = (
            low[axis].max(casters_low[axis]),
            high[axis].min(casters_high[axis]),
        );
        if a < b {
            if casters_low[axis] >= low[axis] {
                border[axis] = EMPTY_BEYOND[axis];
            }
            if casters_high[axis] <= high[axis] {
                border[2 + axis] = EMPTY_BEYOND[2 + axis];
            }
            (low[axis], high[axis]) = (a, b);
        }
    }
    let kernel = 4.0 * (1.5 * reach * (1.0 - near / far) * inverse(near)).powi(2);
    let row = |v: DVec3| v.as_vec3().extend(0.0).to_array();
    let params = OcclusionView {
        half_x: row(half_x),
        half_y: row(half_y),
        border,
        ..OcclusionView::default()
    };
    let extent = Extent {
        behind,
        low,
        high,
        near,
        far: last,
        length: far - near,
        local: true,
        kernel,
        slope,
    };
    let view = finish(params, frame, center, &extent, options);
    Some(SlicedView { casters, ..view })
}

/// Distance of the centre of projection behind a light of these half extents, so that the frustum
/// through the light's border holds all points: the least of z / (|x| / half - 1). `None` where no
/// point is beside the light: an orthographic view. Kept so large that the view stays narrow enough
/// to have useful texels everywhere.
fn offset_of(
    points: impl Iterator<Item = [f64; 3]> + Clone,
    half_width: f64,
    half_height: f64,
    far: f64,
) -> Option<f64> {
    let fits = points.clone().flat_map(|[x, y, z]| {
        [(x, half_width), (y, half_height)]
            .into_iter()
            .filter(|(c, half)| c > half)
            .map(move |(c, half)| z / (c / half - 1.0))
    });
    let fit = fits.reduce(f64::min)?;
    let narrow = points.map(|[x, y, z]| x.max(y) / WIDEST - z);
    let least = narrow.fold(0.0, f64::max).min(far);
    (fit < 1.0e3 * far).then_some(fit.max(least))
}

fn bounds(points: impl Iterator<Item = [f64; 2]>) -> ([f64; 2], [f64; 2]) {
    points.fold(
        ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]),
        |(low, high), p| {
            (
                [low[0].min(p[0]), low[1].min(p[1])],
                [high[0].max(p[0]), high[1].max(p[1])],
            )
        },
    )
}

fn widened(low: [f64; 2], high: [f64; 2], margin: f64) -> ([f64; 2], [f64; 2]) {
    let widest = (high[0] - low[0]).max(high[1] - low[1]).max(1.0e-6);
    let (mut low, mut high) = (low, high);
    for axis in 0..2 {
        let width = (high[axis] - low[axis]).max(1.0e-3 * widest);
        high[axis] = low[axis] + width + MARGIN * width + margin;
        low[axis] -= MARGIN * width + margin;
    }
    (low, high)
}

/// What a view looks at.
struct Extent {
    /// Distance of the centre of projection behind the light's centre; `None`: orthographic.
    behind: Option<f64>,
    /// Image coordinates.
    low: [f64; 2],
    high: [f64; 2],
    /// Slice planes, metres.
    near: f64,
    far: f64,
    /// From the nearest plane to the farthest receiver, metres.
    length: f64,
    /// Whether penumbrae narrow evenly in 1 / depth, not in depth.
    local: bool,
    /// Largest kernel, in image coordinates squared.
    kernel: f64,
    /// Largest slope of receivers.
    slope: f64,
}

fn finish(
    params: OcclusionView,
    frame: Frame,
    origin: DVec3,
    extent: &Extent,
    options: &OcclusionOptions,
) -> SlicedView {
    let Extent {
        behind,
        low,
        high,
        near,
        ..
    } = *extent;
    let width = (extent.far - near)
        .max(LEAST_RANGE * extent.length)
        .max(1.0e-6);
    let far = near + width * (1.0 + 1.0e-4);
    let by_inverse = match options.planes {
        Planes::Reciprocal if extent.local => 1.0,
        Planes::Blend if extent.local => 0.5,
        _ => 0.0,
    };
    let scale = [0, 1].map(|i| 1.0 / (high[i] - low[i]));
    let row = |axis: DVec3, w: f64| axis.as_vec3().extend(w as f32).to_array();
    let params = OcclusionView {
        right: row(frame.right, low[0]),
        up: row(frame.up, low[1]),
        forward: row(frame.forward, behind.unwrap_or(0.0)),
        scale: [
            scale[0] as f32,
            scale[1] as f32,
            f32::from(u8::from(behind.is_some())),
            extent.slope.min(f64::from(f32::MAX)) as f32,
        ],
        range: [near as f32, far as f32, by_inverse as f32, 0.0],
        ..params
    };
    let fine = options.fine_slices();
    let planes = (0..=fine)
        .map(|i| plane_depth(near, far, by_inverse, f64::from(i) / f64::from(fine)) as f32);
    let plane = |axis: DVec3| axis.extend(-axis.dot(origin));
    let z = plane(frame.forward);
    let one = behind.map_or(DVec4::W, |d| z + DVec4::W * d);
    let clip = |axis: DVec3, i: usize| (plane(axis) - one * low[i]) * (2.0 * scale[i]) - one;
    // Depth is not used but to drop what is behind a light: 0 there.
    let clip_z = match behind {
        Some(_) => z - DVec4::W * (1.0e-5 * far),
        None => {
            let from = if extent.local { 0.0 } else { near - width };
            (z - DVec4::W * from) * (1.0 / (far + width - from))
        }
    };
    let rows = DMat4::from_cols(clip(frame.right, 0), clip(frame.up, 1), clip_z, one);
    SlicedView {
        params,
        clip_from_scene: rows.transpose().as_mat4(),
        depth: z.as_vec4().to_array(),
        planes: planes.collect(),
        casters: [].into(),
        most_kernel: (extent.kernel * scale[0] * scale[1]).min(1.0),
    }
}

/// Inverse of `slice_place` in `occlusion_textures/params.glsl`: the depth of a place.
fn plane_depth(near: f64, far: f64, by_inverse: f64, place: f64) -> f64 {
    // place = l (1 - b) + b l far / z with l = (z - near) / (far - near): a quadratic in z.
    let b = by_inverse;
    if b <= 0.0 {
        return near + place * (far - near);
    }
    // (1-b) z^2 + z (b far - (1-b) near - place (far - near)) - b far near = 0
    let quadratic = 1.0 - b;
    let linear = b * far - quadratic * near - place * (far - near);
    let constant = -b * far * near;
    if quadratic == 0.0 {
        return -constant / linear;
    }
    let root = (linear * linear - 4.0 * quadratic * constant).sqrt();
    if linear > 0.0 {
        -2.0 * constant / (linear + root)
    } else {
        (root - linear) / (2.0 * quadratic)
    }
}

#[cfg(test)]
mod tests;
