//! Views of a light and the depth range of their buckets.

use super::layers::MOST_DEPTHS;
use super::options::{Buckets, Footprint, MdiOptions};
use super::rays::{MOST_RAYS, Ray, ray_table};
use crate::light::AreaLight;
use crate::scene::Aabb;
use crate::shadow::light_view::{LightView, MAX_LIGHT_VIEWS, light_views};
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

/// `MdiParams` in `mdi/params.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct MdiParams {
    counts: [u32; 4],
    options: [u32; 4],
    origin: [f32; 4],
    views: [LightView; MAX_LIGHT_VIEWS],
    places: [[f32; 4]; MAX_LIGHT_VIEWS],
    nearest: [[f32; 4]; MAX_LIGHT_VIEWS],
}

/// Views reach at most this far beyond the receivers, as the tangent of an angle at the light. Blockers
/// so near to the light that rays pass them farther outside have views of their own.
const MOST_MARGIN: f64 = 1.0;

/// Nearest depth of a caster as a part of the light's reach: what is nearer is cut off.
const NEAREST: f64 = 1.0 / 64.0;

/// Most that the thickest bucket is as thick as the thinnest, the square of this.
const MOST_RATIO: f64 = 8.0;

/// What the passes need.
#[derive(Clone, Debug)]
pub(super) struct MdiViews {
    pub count: u32,
    /// Texels across and down each view's image.
    pub side: u32,
    pub params: MdiParams,
    pub rays: Vec<Ray>,
    /// Depths that the lists have room for.
    pub capacity: u32,
}

/// Views that look at all receivers, and at all blockers of their light but for what is nearer to the
/// light than a 64th of its reach. `boxes`: corners of the scene's, x changing fastest, then y; scene
/// space, metres; `blocks`: which of them may block the light. `picture`: its size in pixels.
pub(super) fn mdi_views(
    light: &AreaLight,
    receivers: &[Vec<DVec3>],
    (boxes, blocks): (&[[Vec3; 8]], &[bool]),
    (options, picture): (&MdiOptions, [u32; 2]),
) -> MdiViews {
    // Buckets span what there is, blocker or not: they stay where they are when a blocker is added.
    let corners = || boxes.iter().flatten().map(|corner| corner.as_dvec3());
    let mut around = Aabb::EMPTY;
    boxes.iter().flatten().for_each(|p| around.insert(*p));
    let sun = light.shape.is_sun();
    let reach = f64::from(light.shape.reach());
    let center = light.center.as_dvec3();
    let nearest_of = |only_blockers: bool| {
        let pairs = boxes.iter().zip(blocks);
        let pairs = pairs.filter(|(_, blocks)| **blocks || !only_blockers);
        let distances = pairs.map(|(b, _)| distance_to(b, center));
        distances.fold(f64::INFINITY, f64::min)
    };
    let nearest = nearest_of(false);
    let views = if sun {
        let middle = around.center().as_dvec3();
        let radius = corners().map(|p| p.distance(middle)).fold(0.0, f64::max);
        light_views(light, receivers, &around, reach * radius)
    } else {
        // Rays pass blockers near the light far beside the receivers: these must be in some view too.
        let pairs = boxes.iter().zip(blocks).filter(|(_, blocks)| **blocks);
        let close = pairs.filter(|(b, _)| reach > MOST_MARGIN * distance_to(b, center));
        let close = close.map(|(corners, _)| corners.map(|p| p.as_dvec3()).to_vec());
        let mut seen = receivers.to_vec();
        seen.extend(close.take(if receivers.is_empty() { 0 } else { usize::MAX }));
        let margin = (reach / nearest_of(true).max(reach).max(1.0e-6)).min(MOST_MARGIN);
        light_views(light, &seen, &around, margin)
    };
    let count = views.views.len() as u32;
    let across = views.views.first().map_or(0.0, |view| {
        penumbra_across(view, 2.0 * reach, corners().map(|p| p - center), sun)
    });
    let size = options.side(picture, count, across);
    let room = u64::from(options.depths) * u64::from(size * size) * u64::from(count.max(1));
    let capacity = room.min(u64::from(MOST_DEPTHS)) as u32;
    // All rays to a light without size are one, and its shadow has an edge.
    let hard = reach == 0.0 && options.footprint == Footprint::Point;
    let ray_count = if hard { 1 } else { options.rays };
    let origin = if sun { DVec3::ZERO } else { center };
    let mut params = MdiParams {
        counts: [count, size, capacity, 0],
        options: [
            options.buckets,
            u32::from(options.nearest),
            ray_count,
            u32::from(options.random)
                | (u32::from(options.footprint == Footprint::Pixel) << 1)
                | (u32::from(options.dithered && reach > 0.0) << 2)
                | (u32::from(light.is_uneven()) << 3)
                | (u32::from(!options.early) << 4)
                | (u32::from(options.sides) << 5),
        ],
        origin: origin.as_vec3().extend(0.0).to_array(),
        views: [LightView::default(); MAX_LIGHT_VIEWS],
        places: [[0.0; 4]; MAX_LIGHT_VIEWS],
        nearest: [[0.0; 4]; MAX_LIGHT_VIEWS],
    };
    for (index, view) in views.views.iter().enumerate() {
        params.views[index] = *view;
        let [x, y, z, _] = view.forward.map(f64::from);
        let forward = DVec3::new(x, y, z);
        let depths = corners().map(|corner| (corner - origin).dot(forward));
        let (near, far) = depths.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| {
            (a.min(z), b.max(z))
        });
        let far = far.max(1.0e-6);
        let (near, cut) = if sun {
            (near, f64::NEG_INFINITY)
        } else {
            let least = (far * 1.0e-5).max(reach * NEAREST).min(0.5 * far);
            (
                near.max(nearest / 3.0_f64.sqrt()).clamp(least, 0.999 * far),
                least,
            )
        };
        // Nothing lies exactly on the outer boundaries.
        let pad = 1.0e-4 * (far - near).max(1.0e-6);
        let (near, far) = (near - if sun { pad } else { 0.0 }, far + pad);
        // Buckets of equal 1 / (depth + shift): the nearest would be too thin without the shift.
        let shift = ((far - MOST_RATIO * near) / (MOST_RATIO - 1.0)).max(0.0);
        // Of nearest boundaries the last one is at the far end.
        let intervals = f64::from(options.buckets - u32::from(options.nearest));
        // place = (x + y s) / (z + w s), with s = 1 / depth, of a sun -depth.
        let places = match options.spacing {
            _ if sun => {
                let part = intervals / (far - near);
                [-part * near, -part, 1.0, 0.0]
            }
            Buckets::Uniform => [1.0, -near, 0.0, (far - near) / intervals],
            Buckets::Reciprocal => {
                // 1 - (near + shift) / (z + shift) = (1 - near s) / (1 + shift s), 1 at the far end
                // after this.
                let part = intervals * (far + shift) / (far - near);
                [part, -part * near, 1.0, shift]
            }
        };
        params.places[index] = places.map(|v| v as f32);
        params.nearest[index] = [cut.max(-1.0e30) as f32, 0.0, 0.0, 0.0];
    }
    // Random rays of an uneven light go to any place of a full table.
    let drawn = options.random && light.is_uneven();
    let places = if drawn { MOST_RAYS as u32 } else { ray_count };
    let mut rays = ray_table(light, places);
    for ray in rays.iter_mut().filter(|_| drawn) {
        ray[2] = 1.0 / ray_count as f32;
    }
    rays.resize(MOST_RAYS, [0.0; 4]);
    MdiViews {
        count,
        side: size,
        params,
        rays,
        capacity,
    }
}

/// Width of a usual penumbra as a part of the view's width: of a blocker a fifth of the way to the light
/// before the farthest receiver, under a sun a twentieth of the scene's depth, of which the ground fills
/// much. `wide`: the light's width in metres, of a sun at distance 1; `corners`: from the light.
fn penumbra_across(
    view: &LightView,
    wide: f64,
    corners: impl Iterator<Item = DVec3>,
    sun: bool,
) -> f64 {
    let [x, y, ..] = view.scale.map(|v| f64::from(v.abs()));
    let [fx, fy, fz, _] = view.forward.map(f64::from);
    let depths = corners.map(|p| p.dot(DVec3::new(fx, fy, fz)));
    let (near, far) = depths.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| {
        (a.min(z), b.max(z))
    });
    let part = if sun {
        0.05 * (far - near)
    } else {
        0.25 / far.max(1.0e-6)
    };
    wide * part * x.max(y)
}

/// From a point to a box, 0 inside; metres.
fn distance_to(corners: &[Vec3; 8], point: DVec3) -> f64 {
    let first = corners[0].as_dvec3();
    let mut offset = point - first;
    for corner in [1, 2, 4] {
        let edge = corners[corner].as_dvec3() - first;
        let square = edge.length_squared().max(f64::MIN_POSITIVE);
        offset -= edge * (offset.dot(edge) / square).clamp(0.0, 1.0);
    }
    offset.length()
}
