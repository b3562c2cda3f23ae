//! Meshes: each read once, in its own space.

use glam::{DVec2, Vec2, Vec3, Vec4};
use gltf::accessor::Dimensions;
use gltf::mesh::Mode;
use gltf::{Mesh, Semantic};

use super::accessor::Accessors;
use super::materials::Surface;
use super::morph::{self, Target};
use super::skin::{self, Influence};
use super::{SceneError, element};

/// Sets of joints and weights that are read: eight joints a vertex.
const JOINT_SETS: u32 = 2;

/// A primitive in the space of its mesh. Lists of vertices are of the same length, or empty where
/// that is said.
#[derive(Debug)]
pub(super) struct LocalPrimitive {
    pub(super) positions: Vec<Vec3>,
    /// As in the file; `None` asks for flat shading.
    pub(super) normals: Option<Vec<Vec3>>,
    /// Where the material's base texture lies; empty without one.
    pub(super) uvs: Vec<Vec2>,
    /// Three for each triangle, all in range.
    pub(super) indices: Vec<u32>,
    pub(super) targets: Vec<Target>,
    /// JOINTS_0 and WEIGHTS_0, then the next set.
    pub(super) influences: Vec<Vec<Influence>>,
    /// Index into the surfaces.
    pub(super) material: usize,
    /// The one colour of all vertices, linear, if it is not white.
    pub(super) color: Option<Vec4>,
}

/// The triangle primitives of `mesh`; points and lines have no surface and are left out.
pub(super) fn read(
    accessors: &Accessors<'_>,
    mesh: &Mesh<'_>,
    surfaces: &[Surface],
) -> Result<Vec<LocalPrimitive>, SceneError> {
    let mut primitives: Vec<LocalPrimitive> = Vec::new();
    for primitive in mesh.primitives() {
        let name = format!(
            "{}, primitive {}",
            element("mesh", mesh.index(), mesh.name()),
            primitive.index()
        );
        let mode = primitive.mode();
        if !matches!(
            mode,
            Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
        ) {
            log::warn!("{}: {name}: {mode:?} ignored", accessors.source.label());
            continue;
        }
        let read = read_primitive(accessors, &primitive, mode, surfaces, &name)?;
        if let Some(first) = primitives.first()
            && first.targets.len() != read.targets.len()
        {
            let reason = format!(
                "it has {} morph targets and the first primitive {}",
                read.targets.len(),
                first.targets.len()
            );
            return Err(accessors.source.invalid(name, reason));
        }
        primitives.push(read);
    }
    Ok(primitives)
}

fn read_primitive(
    accessors: &Accessors<'_>,
    primitive: &gltf::Primitive<'_>,
    mode: Mode,
    surfaces: &[Surface],
    name: &str,
) -> Result<LocalPrimitive, SceneError> {
    let invalid = |reason: String| accessors.source.invalid(name, reason);
    let Some(position) = primitive.get(&Semantic::Positions) else {
        return Err(invalid("it has no POSITION".into()));
    };
    let positions = read_vec3(accessors, &position, "POSITION", &invalid)?;
    let count = positions.len();
    let normals = match primitive.get(&Semantic::Normals) {
        Some(accessor) => Some(read_vec3(accessors, &accessor, "NORMAL", &invalid)?),
        None => None,
    };
    if let Some(normals) = &normals
        && normals.len() != count
    {
        let reason = format!("it has {count} positions and {} normals", normals.len());
        return Err(invalid(reason));
    }
    let vertices = match primitive.indices() {
        Some(accessor) => accessors.read_indices(&accessor)?,
        None => u32::try_from(count)
            .map(|count| (0..count).collect())
            .map_err(|_| invalid("it has more vertices than 32-bit indices reach".into()))?,
    };
    if let Some((at, index)) =
        (vertices.iter().enumerate()).find(|(_, index)| **index as usize >= count)
    {
        return Err(invalid(format!(
            "index {at} names vertex {index} of {count}"
        )));
    }
    let material = (primitive.material().index())
        .filter(|&index| index < surfaces.len())
        .unwrap_or(surfaces.len().saturating_sub(1));
    Ok(LocalPrimitive {
        uvs: read_uvs(
            accessors,
            primitive,
            surfaces.get(material),
            count,
            &invalid,
        )?,
        targets: morph::read(accessors, primitive, count, normals.is_some(), &invalid)?,
        influences: read_influences(accessors, primitive, count, name)?,
        color: read_color(accessors, primitive, count, name)?,
        indices: triangles(mode, &vertices),
        positions,
        normals,
        material,
    })
}

/// Finite vectors of three.
pub(super) fn read_vec3(
    accessors: &Accessors<'_>,
    accessor: &gltf::Accessor<'_>,
    attribute: &str,
    invalid: &dyn Fn(String) -> SceneError,
) -> Result<Vec<Vec3>, SceneError> {
    let values = accessors.read_vectors::<3>(accessor)?;
    let vectors: Vec<Vec3> = values.into_iter().map(Vec3::from_array).collect();
    match vectors.iter().position(|v| !v.is_finite()) {
        None => Ok(vectors),
        Some(vertex) => Err(invalid(format!(
            "{attribute} of vertex {vertex} is not finite ({})",
            vectors[vertex]
        ))),
    }
}

/// The texture coordinates that the surface's base texture wants, transformed as it says.
fn read_uvs(
    accessors: &Accessors<'_>,
    primitive: &gltf::Primitive<'_>,
    surface: Option<&Surface>,
    count: usize,
    invalid: &dyn Fn(String) -> SceneError,
) -> Result<Vec<Vec2>, SceneError> {
    let Some(texture) = surface.and_then(|surface| surface.base_texture.as_ref()) else {
        return Ok(Vec::new());
    };
    let set = texture.tex_coord;
    let Some(accessor) = primitive.get(&Semantic::TexCoords(set)) else {
        log::warn!(
            "{}",
            invalid(format!(
                "its texture wants TEXCOORD_{set}, which is missing"
            ))
        );
        return Ok(vec![Vec2::ZERO; count]);
    };
    let values = accessors.read_vectors::<2>(&accessor)?;
    if values.len() != count {
        let reason = format!(
            "it has {count} positions and {} texture coordinates",
            values.len()
        );
        return Err(invalid(reason));
    }
    let place = |[u, v]: [f32; 2]| {
        let uv = DVec2::new(f64::from(u), f64::from(v));
        texture.transform.transform_point2(uv).as_vec2()
    };
    let uvs: Vec<Vec2> = values.into_iter().map(place).collect();
    match uvs.iter().position(|uv| !uv.is_finite()) {
        None => Ok(uvs),
        Some(vertex) => Err(invalid(format!(
            "TEXCOORD_{set} of vertex {vertex} is not finite on its texture"
        ))),
    }
}

fn read_influences(
    accessors: &Accessors<'_>,
    primitive: &gltf::Primitive<'_>,
    count: usize,
    name: &str,
) -> Result<Vec<Vec<Influence>>, SceneError> {
    let invalid = |reason: String| accessors.source.invalid(name, reason);
    let mut sets = Vec::new();
    for set in 0..JOINT_SETS {
        let joints = primitive.get(&Semantic::Joints(set));
        let weights = primitive.get(&Semantic::Weights(set));
        match (joints, weights) {
            (Some(joints), Some(weights)) => {
                let read = skin::read_influences(accessors, &joints, &weights, count)?;
                sets.push(read.map_err(invalid)?);
            }
            (None, None) => break,
            _ => {
                let reason = format!("JOINTS_{set} and WEIGHTS_{set} go together");
                return Err(invalid(reason));
            }
        }
    }
    if primitive.get(&Semantic::Joints(JOINT_SETS)).is_some() {
        let label = accessors.source.label();
        log::warn!("{label}: {name}: joints of JOINTS_{JOINT_SETS} and beyond ignored");
    }
    skin::normalize(&mut sets, count);
    Ok(sets)
}

/// The colour of all vertices where they have but one, and it is not white.
fn read_color(
    accessors: &Accessors<'_>,
    primitive: &gltf::Primitive<'_>,
    count: usize,
    name: &str,
) -> Result<Option<Vec4>, SceneError> {
    let Some(accessor) = primitive.get(&Semantic::Colors(0)) else {
        return Ok(None);
    };
    let colors: Vec<[f32; 4]> = if accessor.dimensions() == Dimensions::Vec3 {
        let colors = accessors.read_vectors::<3>(&accessor)?;
        colors.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()
    } else {
        accessors.read_vectors::<4>(&accessor)?
    };
    let invalid = |reason: String| accessors.source.invalid(name, reason);
    if colors.len() != count {
        let reason = format!("it has {count} positions and {} colours", colors.len());
        return Err(invalid(reason));
    }
    let is_finite = |color: &[f32; 4]| color.iter().all(|c| c.is_finite());
    if let Some(vertex) = colors.iter().position(|color| !is_finite(color)) {
        return Err(invalid(format!("COLOR_0 of vertex {vertex} is not finite")));
    }
    let Some(&first) = colors.first() else {
        return Ok(None);
    };
    if colors.iter().any(|color| *color != first) {
        log::warn!(
            "{}: {name}: vertex colours ignored, for they are not all the same",
            accessors.source.label()
        );
        return Ok(None);
    }
    let color = Vec4::from_array(first).clamp(Vec4::ZERO, Vec4::ONE);
    Ok((color != Vec4::ONE).then_some(color))
}

/// A list of triangles from a list, strip or fan, all wound alike; without those that name a vertex
/// twice, which strips are stitched with.
fn triangles(mode: Mode, v: &[u32]) -> Vec<u32> {
    let all: Vec<[u32; 3]> = match mode {
        Mode::TriangleStrip => v
            .windows(3)
            .enumerate()
            .map(|(i, w)| {
                if i % 2 == 0 {
                    [w[0], w[1], w[2]]
                } else {
                    [w[1], w[0], w[2]]
                }
            })
            .collect(),
        Mode::TriangleFan => match v {
            [hub, rim @ ..] => rim.windows(2).map(|w| [*hub, w[0], w[1]]).collect(),
            [] => Vec::new(),
        },
        _ => v.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    };
    (all.into_iter())
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .flatten()
        .collect()
}
