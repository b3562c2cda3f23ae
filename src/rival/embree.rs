//! Embree: the hierarchy, and packets of rays into it.
//!
//! The binding has a safe interface to all that is used here, so that nothing is `unsafe`.

use std::sync::Arc;

use embree3::{
    BufferUsage, BuildQuality, Config, Device, DeviceProperty, Error, Format, Geometry,
    GeometryKind, HitN, IntersectContext, Ray8, RayN, Scene as Hierarchy, SceneFlags, SoAHit,
    ValidMask, ValidMaskN, ValidityN,
};
use glam::{DVec3, Vec2, Vec3};

use super::RivalError;
use crate::scene::{Scene, TextureImage, Wrap};

/// Rays of a packet.
pub(super) const PACKET: usize = 8;

/// A scene in Embree.
pub(super) struct Tracer {
    /// `None` without triangles.
    hierarchy: Option<Hierarchy<'static>>,
    name: String,
}

/// Triangles of one kind, as Embree takes them.
#[derive(Default)]
struct Mesh {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// Surfaces with holes.
#[derive(Default)]
struct Cutouts {
    /// Texture coordinates of each triangle's corners, and its surface.
    triangles: Vec<([Vec2; 3], u32)>,
    surfaces: Vec<Cutout>,
}

struct Cutout {
    image: Arc<TextureImage>,
    wrap: [Wrap; 2],
    /// The surface's own alpha.
    alpha: f32,
    cutoff: f32,
}

/// A packet under construction. Embree reads rays and mask as whole vectors.
#[repr(align(32))]
pub(super) struct Packet {
    rays: Ray8,
    mask: Mask,
}

#[repr(align(32))]
struct Mask(ValidMaskN<PACKET>);

impl Packet {
    pub(super) fn new() -> Self {
        Self {
            rays: Ray8::empty(),
            mask: Mask(ValidMaskN::all_active()),
        }
    }

    /// Sets a ray that ends at `end` lengths of `direction`.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, origin: Vec3, direction: Vec3, end: f32) {
        self.rays.org_x[lane] = origin.x;
        self.rays.org_y[lane] = origin.y;
        self.rays.org_z[lane] = origin.z;
        self.rays.dir_x[lane] = direction.x;
        self.rays.dir_y[lane] = direction.y;
        self.rays.dir_z[lane] = direction.z;
        self.rays.tfar[lane] = end;
    }

    /// After [`Tracer::cast_packet`]: true if nothing blocks the ray.
    #[inline(always)]
    pub(super) fn is_free(&self, lane: usize) -> bool {
        // Embree moves the ends of blocked rays to minus infinity.
        self.rays.tfar[lane] >= 0.0
    }
}

impl Tracer {
    pub(super) fn new(scene: &Scene) -> Result<Self, RivalError> {
        // Opening a device changes how the thread rounds small numbers; let it be none of ours.
        std::thread::scope(
            |threads| match threads.spawn(|| Self::build(scene)).join() {
                Ok(tracer) => tracer,
                Err(panic) => std::panic::resume_unwind(panic),
            },
        )
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    fn build(scene: &Scene) -> Result<Self, RivalError> {
        let device = Device::with_config(Config {
            report_errors: false,
            ..Config::default()
        })
        .map_err(|error| failed("open a device", error))?;
        let version = |property| device.get_property(property);
        let name = match (
            version(DeviceProperty::VERSION_MAJOR),
            version(DeviceProperty::VERSION_MINOR),
            version(DeviceProperty::VERSION_PATCH),
        ) {
            (Ok(major), Ok(minor), Ok(patch)) => format!("embree {major}.{minor}.{patch}"),
            _ => "embree 3".into(),
        };

        let (solid, pierced, cutouts) = sort(scene)?;
        let mut hierarchy =
            (device.create_scene()).map_err(|error| failed("create a scene", error))?;
        hierarchy.set_build_quality(BuildQuality::HIGH);
        hierarchy.set_flags(SceneFlags::ROBUST);
        let is_empty = solid.triangles.is_empty() && pierced.triangles.is_empty();
        if !solid.triangles.is_empty() {
            hierarchy.attach_geometry(&solid.geometry(&device, None)?);
        }
        if !pierced.triangles.is_empty() {
            hierarchy.attach_geometry(&pierced.geometry(&device, Some(cutouts))?);
        }
        hierarchy.commit();
        match device.get_error() {
            Error::NONE => Ok(Self {
                hierarchy: (!is_empty).then_some(hierarchy),
                name,
            }),
            error => Err(failed("build its hierarchy", error)),
        }
    }

    /// Finds which of the first `count` rays are blocked.
    #[inline]
    pub(super) fn cast_packet(&self, packet: &mut Packet, count: usize) {
        let Some(hierarchy) = &self.hierarchy else {
            return;
        };
        let mut context = IntersectContext::coherent();
        if count == PACKET {
            hierarchy.occluded8(&mut context, &mut packet.rays, &packet.mask.0);
        } else {
            let lane = |i| {
                if i < count {
                    ValidMask::Valid
                } else {
                    ValidMask::Invalid
                }
            };
            let mask = Mask(ValidMaskN::new(std::array::from_fn(lane)));
            hierarchy.occluded8(&mut context, &mut packet.rays, &mask.0);
        }
    }
}

fn failed(what: &'static str, error: Error) -> RivalError {
    RivalError::Embree {
        what,
        reason: error.to_string(),
    }
}

impl Mesh {
    fn geometry(
        &self,
        device: &Device,
        cutouts: Option<Cutouts>,
    ) -> Result<Geometry<'static>, RivalError> {
        let mut geometry = (device.create_geometry(GeometryKind::TRIANGLE))
            .map_err(|error| failed("create a mesh", error))?;
        let no_room = |error| failed("make room for a mesh", error);
        let vertices = self.positions.len();
        (geometry.set_new_buffer::<[f32; 3]>(BufferUsage::VERTEX, 0, Format::FLOAT3, 12, vertices))
            .map_err(no_room)?
            .as_mut()
            .copy_from_slice(&self.positions);
        let triangles = self.triangles.len();
        (geometry.set_new_buffer::<[u32; 3]>(BufferUsage::INDEX, 0, Format::UINT3, 12, triangles))
            .map_err(no_room)?
            .as_mut()
            .copy_from_slice(&self.triangles);
        geometry.set_build_quality(BuildQuality::HIGH);
        if let Some(cutouts) = cutouts {
            geometry.set_occluded_filter_function_owned(drop_holes, cutouts);
        }
        Ok(geometry.commit())
    }
}

/// Embree's filter of hits: takes back those in holes.
fn drop_holes(
    _: RayN<'_>,
    hits: HitN<'_>,
    mut valid: ValidityN<'_>,
    _: &mut IntersectContext,
    cutouts: Option<&Cutouts>,
) {
    let Some(cutouts) = cutouts else {
        return;
    };
    for (lane, valid) in valid.iter_mut().enumerate() {
        if *valid != 0 && !cutouts.is_solid_at(hits.prim_id(lane), hits.uv(lane)) {
            *valid = 0;
        }
    }
}

impl Cutouts {
    /// `u` and `v` weigh the second and the third corner.
    fn is_solid_at(&self, triangle: u32, [u, v]: [f32; 2]) -> bool {
        let Some(&([a, b, c], surface)) = self.triangles.get(triangle as usize) else {
            return true;
        };
        let Some(surface) = self.surfaces.get(surface as usize) else {
            return true;
        };
        let at = (1.0 - u - v) * a + u * b + v * c;
        surface.image.alpha(at, surface.wrap) * surface.alpha >= surface.cutoff
    }
}

/// Solid triangles, those with holes, and the holes.
fn sort(scene: &Scene) -> Result<(Mesh, Mesh, Cutouts), RivalError> {
    let count: u64 = (scene.primitives.iter())
        .map(|p| p.positions.len() as u64)
        .sum();
    if count >= 1 << 32 {
        return Err(RivalError::TooManyVertices { count });
    }
    let (mut solid, mut pierced) = (Mesh::default(), Mesh::default());
    let mut cutouts = Cutouts::default();
    let mut images: Vec<Option<Arc<TextureImage>>> = vec![None; scene.images.len()];
    for primitive in &scene.primitives {
        let Some(material) = scene.materials.get(primitive.material) else {
            continue;
        };
        let cutoff = material.mask_cutoff();
        let texture = (material.base_texture)
            .filter(|texture| texture.image < scene.images.len() && !primitive.uvs.is_empty());
        let alpha = material.base_color.w;
        let has_holes = match (cutoff, texture) {
            (Some(cutoff), None) if alpha < cutoff => continue,
            (Some(cutoff), Some(texture)) => {
                let image = images[texture.image]
                    .get_or_insert_with(|| Arc::new(scene.images[texture.image].clone()));
                cutouts.surfaces.push(Cutout {
                    image: image.clone(),
                    wrap: texture.wrap,
                    alpha,
                    cutoff,
                });
                true
            }
            _ => false,
        };
        let mesh = if has_holes { &mut pierced } else { &mut solid };
        let first = mesh.positions.len() as u32;
        mesh.positions
            .extend(primitive.positions.iter().map(|p| p.to_array()));
        for corners in primitive.indices.chunks_exact(3) {
            let at = |i: usize| primitive.positions.get(corners[i] as usize).copied();
            let (Some(a), Some(b), Some(c)) = (at(0), at(1), at(2)) else {
                continue;
            };
            let [ab, ac] = [b, c].map(|corner| corner.as_dvec3() - a.as_dvec3());
            let has_area = ab.cross(ac) != DVec3::ZERO;
            if !(has_area && a.is_finite() && b.is_finite() && c.is_finite()) {
                continue;
            }
            mesh.triangles.push([0, 1, 2].map(|i| first + corners[i]));
            if has_holes {
                let uv = |i: usize| primitive.uvs.get(corners[i] as usize).copied();
                let uvs = [0, 1, 2].map(|i| uv(i).unwrap_or_default());
                let surface = cutouts.surfaces.len() as u32 - 1;
                cutouts.triangles.push((uvs, surface));
            }
        }
    }
    Ok((solid, pierced, cutouts))
}
