//! What the camera sees at each pixel centre, and where measuring makes sense.

use glam::{DVec3, UVec2};

use super::samples::{Side, is_behind, side};
use super::triangles::{ROUNDING, Start, Triangles};
use crate::light::AreaLight;
use crate::scene::{Scene, SceneCamera};

/// Beyond this slope between two pixels' points, against either one's surface, an edge runs
/// between them.
const EDGE_SLOPE: f64 = 0.35;
/// Below this cosine between two pixels' smooth normals an edge runs between them.
const EDGE_COSINE: f64 = 0.9;

/// The surface that the ray through a pixel's centre meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Scene space, metres.
    pub position: DVec3,
    /// Unit normal of the triangle, turned to the camera.
    pub normal: DVec3,
    /// Unit normal from those of the corners, on the same side.
    pub smooth_normal: DVec3,
    /// Index into [`Scene::primitives`].
    pub primitive: usize,
    /// Number of the triangle in its primitive.
    pub triangle: usize,
    /// Distance along the camera's `forward`, metres.
    pub depth: f64,
    pub(super) start: Start,
}

/// The ray through a pixel's centre, one metre along the camera's `forward`. As
/// [`SceneCamera::ray`], unrounded.
pub(super) fn pixel_direction(camera: &SceneCamera, pixel: UVec2, size: [u32; 2]) -> DVec3 {
    let [width, height] = size.map(f64::from);
    let tan = camera.tan_half_fov();
    let x = (2.0 * (f64::from(pixel.x) + 0.5) - width) / height * tan;
    let y = (height - 2.0 * (f64::from(pixel.y) + 0.5)) / height * tan;
    camera.forward.as_dvec3() + x * camera.right.as_dvec3() + y * camera.up.as_dvec3()
}

pub(super) fn surface(
    scene: &Scene,
    triangles: &Triangles,
    camera: &SceneCamera,
    size: [u32; 2],
    pixel: UVec2,
    stack: &mut Vec<u32>,
) -> Option<Surface> {
    let eye = camera.position.as_dvec3();
    let direction = pixel_direction(camera, pixel, size);
    let near = f64::from(camera.znear);
    let (own, depth, weights) = triangles.nearest(eye, direction, near, stack)?;
    let triangle = &triangles.list[own as usize];
    let corners = triangle.corners.map(|corner| corner.as_dvec3() - eye);
    let [u, v, w] = weights.normalised();
    // Out of the corners, so that rounding moves it along the triangle rather than off it.
    let from_eye = u * corners[0] + v * corners[1] + w * corners[2];
    let farthest = (corners.iter())
        .map(|corner| corner.abs().element_sum())
        .fold(eye.abs().element_sum(), f64::max);

    let [a, b, c] = triangle.corners.map(|corner| corner.as_dvec3());
    let across = (b - a).cross(c - a);
    // Scaled first: squares of a tiny triangle's area are below the least f64.
    let normal = (across / across.abs().max_element()).normalize();
    let normal = if normal.dot(direction) > 0.0 {
        -normal
    } else {
        normal
    };
    let smooth = smooth_normal(scene, triangle.primitive, triangle.index, [u, v, w]);
    let smooth = match smooth {
        Some(smooth) if smooth.dot(normal) < 0.0 => -smooth,
        Some(smooth) => smooth,
        None => normal,
    };
    let position = eye + from_eye;
    Some(Surface {
        position,
        normal,
        smooth_normal: smooth,
        primitive: triangle.primitive as usize,
        triangle: triangle.index as usize,
        depth,
        start: Start {
            position,
            error: 16.0 * ROUNDING * farthest,
            own,
        },
    })
}

fn smooth_normal(scene: &Scene, primitive: u32, triangle: u32, weights: [f64; 3]) -> Option<DVec3> {
    let primitive = scene.primitives.get(primitive as usize)?;
    let first = 3 * triangle as usize;
    let corners = primitive.indices.get(first..first + 3)?;
    let mut sum = DVec3::ZERO;
    for (&corner, weight) in corners.iter().zip(weights) {
        sum += weight * primitive.normals.get(corner as usize)?.as_dvec3();
    }
    sum.try_normalize()
}

/// True if the pixel of `one` is an edge pixel because of its neighbour `other`.
fn is_edge(one: &Surface, other: &Surface) -> bool {
    let offset = other.position - one.position;
    let most = EDGE_SLOPE * offset.length();
    offset.dot(one.normal).abs() > most
        || offset.dot(other.normal).abs() > most
        || one.smooth_normal.dot(other.smooth_normal) < EDGE_COSINE
}

/// Whether visibility at a pixel can be compared: what it shows is hit, is no edge, faces the
/// light's centre, lies in front of a flat light, and has all of the light above its tangent plane.
pub(super) fn is_valid<'a>(
    light: &AreaLight,
    at: &Option<Surface>,
    neighbours: impl Iterator<Item = &'a Option<Surface>>,
) -> bool {
    let Some(at) = at else {
        return false;
    };
    let mut neighbours = neighbours;
    let is_edge = neighbours.any(|other| match other {
        Some(other) => is_edge(at, other),
        None => true,
    });
    !is_edge && side(light, at.position, at.normal) == Side::Above && !is_behind(light, at.position)
}
