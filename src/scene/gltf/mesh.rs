//! Meshes: read once in their own space, then placed by each node that shows them.

use glam::{DMat3, DVec3, Vec3};
use gltf::mesh::Mode;
use gltf::{Document, Mesh};

use super::accessor::Accessors;
use super::nodes::PlacedNode;
use super::{SceneError, element};
use crate::scene::{Material, Primitive};

/// A primitive in the space of its mesh.
pub(super) struct LocalPrimitive {
    pub(super) positions: Vec<Vec3>,
    /// As in the file, one a position; `None` asks for flat shading, and then no two triangles
    /// share a vertex.
    pub(super) normals: Option<Vec<Vec3>>,
    /// Three for each triangle, all in range.
    pub(super) indices: Vec<u32>,
    material: Option<usize>,
}

/// The triangle primitives of `mesh`; points and lines have no surface and are left out.
pub(super) fn read(
    accessors: &Accessors<'_>,
    mesh: &Mesh<'_>,
) -> Result<Vec<LocalPrimitive>, SceneError> {
    let mut primitives = Vec::new();
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
        let invalid = |reason: String| accessors.source.invalid(name.clone(), reason);
        let Some(position) = primitive.get(&gltf::Semantic::Positions) else {
            return Err(invalid("it has no POSITION".into()));
        };
        let positions = vectors(accessors, &position, "POSITION", &invalid)?;
        let normals = match primitive.get(&gltf::Semantic::Normals) {
            Some(accessor) => Some(vectors(accessors, &accessor, "NORMAL", &invalid)?),
            None => None,
        };
        if let Some(normals) = &normals
            && normals.len() != positions.len()
        {
            return Err(invalid(format!(
                "it has {} positions and {} normals",
                positions.len(),
                normals.len()
            )));
        }
        let vertices = match primitive.indices() {
            Some(accessor) => accessors.read_indices(&accessor)?,
            None => u32::try_from(positions.len())
                .map(|count| (0..count).collect())
                .map_err(|_| invalid("it has more vertices than 32-bit indices reach".into()))?,
        };
        if let Some((at, index)) =
            (vertices.iter().enumerate()).find(|(_, index)| **index as usize >= positions.len())
        {
            return Err(invalid(format!(
                "index {at} names vertex {index} of {}",
                positions.len()
            )));
        }
        let local = LocalPrimitive {
            indices: triangles(mode, &vertices),
            positions,
            normals,
            material: primitive.material().index(),
        };
        primitives.push(local.unshared_if_flat());
    }
    Ok(primitives)
}

fn vectors(
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

impl LocalPrimitive {
    /// Positions that a triangle uses, repeated as often as it is used.
    pub(super) fn used_positions(&self) -> impl Iterator<Item = Vec3> + '_ {
        self.indices
            .iter()
            .map(|&index| self.positions[index as usize])
    }

    /// Flat shading needs a normal a triangle, so triangles cannot share vertices.
    fn unshared_if_flat(mut self) -> Self {
        if self.normals.is_none() {
            self.positions = self.used_positions().collect();
            // At most as many as there were indices, which are 32-bit themselves.
            self.indices = (0u32..).take(self.positions.len()).collect();
        }
        self
    }

    /// This primitive as `node` shows it, in scene space.
    pub(super) fn place(
        &self,
        node: &PlacedNode,
        name: String,
        origin: DVec3,
        materials: &[Material],
    ) -> Primitive {
        let linear = node.world.matrix3;
        let world: Vec<DVec3> = (self.positions.iter())
            .map(|position| node.world.transform_point3(position.as_dvec3()) - origin)
            .collect();
        let mut indices = self.indices.clone();
        // A mirrored triangle would turn its back.
        let mirrored = linear.determinant() < 0.0;
        if mirrored {
            for triangle in indices.chunks_exact_mut(3) {
                triangle.swap(1, 2);
            }
        }
        let faces = face_normals(&world, &indices);
        let normals = match &self.normals {
            None => faces
                .into_iter()
                .map(|sum| unit_or_up(sum).as_vec3())
                .collect(),
            Some(normals) => {
                // Cofactors in place of the inverse transpose: they exist for flattened nodes too.
                let cofactors = DMat3::from_cols(
                    linear.y_axis.cross(linear.z_axis),
                    linear.z_axis.cross(linear.x_axis),
                    linear.x_axis.cross(linear.y_axis),
                );
                let sign = if mirrored { -1.0 } else { 1.0 };
                (normals.iter().zip(faces))
                    .map(|(normal, face)| {
                        let normal = unit(sign * (cofactors * normal.as_dvec3()));
                        normal.unwrap_or_else(|| unit_or_up(face)).as_vec3()
                    })
                    .collect()
            }
        };
        Primitive {
            name,
            node: Some(node.index),
            material: (self.material)
                .filter(|&index| index < materials.len())
                .unwrap_or(materials.len().saturating_sub(1)),
            positions: world
                .into_iter()
                .map(|position| position.as_vec3())
                .collect(),
            normals,
            indices,
            uvs: Vec::new(),
        }
    }
}

/// For each vertex the sum of the area vectors of its triangles; not normalised.
fn face_normals(positions: &[DVec3], indices: &[u32]) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for triangle in indices.chunks_exact(3) {
        let [a, b, c] = [0, 1, 2].map(|corner| positions[triangle[corner] as usize]);
        let area = (b - a).cross(c - a);
        for &vertex in triangle {
            sums[vertex as usize] += area;
        }
    }
    sums
}

/// `v` normalised without leaving the range of `f64`.
fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    (largest > 0.0 && largest.is_finite()).then(|| (v / largest).normalize())
}

/// A triangle without area has no normal; any will do, as long as it is one.
fn unit_or_up(v: DVec3) -> DVec3 {
    unit(v).unwrap_or(DVec3::Y)
}

/// What messages and reports call primitive `local` of `node`.
pub(super) fn instance_name(document: &Document, node: &PlacedNode, local: usize) -> String {
    let mesh = node.mesh.and_then(|index| document.meshes().nth(index));
    let name = [node.name.as_deref(), mesh.as_ref().and_then(Mesh::name)]
        .into_iter()
        .flatten()
        .find(|name| !name.is_empty());
    let name = name.map_or_else(|| format!("node {}", node.index), super::shorten);
    if mesh.is_some_and(|mesh| mesh.primitives().len() > 1) {
        format!("{name}/{local}")
    } else {
        name
    }
}
