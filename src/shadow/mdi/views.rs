//! Views of a light and the depth range of their buckets.

use super::options::{Buckets, Footprint, MdiOptions};
use super::rays::{MOST_RAYS, Ray, ray_table};
use crate::light::AreaLight;
use crate::scene::Aabb;
use crate::shadow::light_view::{LightView, MAX_LIGHT_VIEWS, light_views};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;

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

/// Views reach at most this far beyond the receivers, as the tangent of an angle at the light:
/// blockers outside are missed.
const MOST_MARGIN: f64 = 0.5;

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

pub(super) fn mdi_views(
    light: &AreaLight,
    receivers: &[Vec<DVec3>],
    casters: &[Aabb],
    triangles: u32,
    (options, size): (&MdiOptions, u32),
) -> MdiViews {
    let around = casters.iter().fold(Aabb::EMPTY, |all, one| all.union(one));
    let sun = light.shape.is_sun();
    let reach = f64::from(light.shape.reach());
    let center = light.center.as_dvec3();
    let distance = |b: &Aabb| {
        let nearest = light.center.clamp(b.min, b.max) - light.center;
        f64::from(nearest.length())
    };
    let nearest = casters.iter().map(distance).fold(f64::INFINITY, f64::min);
    let margin = if sun {
        reach * f64::from(around.radius())
    } else {
        (reach / nearest.max(reach).max(1.0e-6)).min(MOST_MARGIN)
    };
    let views = light_views(light, receivers, &around, margin);
    let count = views.views.len() as u32;
    let capacity = options.depths * size * size * count.max(1);
    let origin = if sun { DVec3::ZERO } else { center };
    let mut params = MdiParams {
        counts: [count, size, capacity, triangles],
        options: [
            options.buckets,
            u32::from(options.nearest),
            options.rays,
            u32::from(options.random)
                | (u32::from(options.footprint == Footprint::Pixel) << 1)
                | (u32::from(options.dithered) << 2)
                | (u32::from(light.is_uneven()) << 3),
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
        let corners = casters.iter().flat_map(|b| b.corners());
        let depths = corners.map(|c| (c.as_dvec3() - origin).dot(forward));
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
    let places = if drawn {
        MOST_RAYS as u32
    } else {
        options.rays
    };
    let mut rays = ray_table(light, places);
    for ray in rays.iter_mut().filter(|_| drawn) {
        ray[2] = 1.0 / options.rays as f32;
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
