//! Primitives as nodes show them: morphed, skinned or moved, in scene space.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use gltf::{Document, Mesh};

use super::accessor::Accessors;
use super::document::Side;
use super::mesh::LocalPrimitive;
use super::nodes::{self, PlacedNode};
use super::{SceneError, element, morph, skin};
use crate::scene::Primitive;

/// From a mesh's space to world space minus the scene's origin.
pub(super) enum Placement {
    /// All vertices alike.
    Rigid(DAffine3),
    /// One matrix for each joint of the skin.
    Skinned(Vec<DAffine3>),
}

/// Vertices in scene space.
struct Moved {
    positions: Vec<DVec3>,
    /// Not of length 1, and not to be relied on to be longer than 0.
    normals: Option<Vec<DVec3>>,
    /// Triangles turn their back if left as they are.
    mirrored: bool,
}

impl LocalPrimitive {
    /// The lowest and the highest corner of all vertices that a triangle uses.
    pub(super) fn bounds(&self, placement: &Placement, weights: &[f64]) -> (DVec3, DVec3) {
        let moved = self.moved(placement, weights, false);
        let used = (self.indices.iter()).filter_map(|&index| moved.positions.get(index as usize));
        used.fold(
            (DVec3::INFINITY, DVec3::NEG_INFINITY),
            |(low, high), position| (low.min(*position), high.max(*position)),
        )
    }

    /// This primitive in scene space.
    pub(super) fn place(
        &self,
        node: usize,
        name: String,
        placement: &Placement,
        weights: &[f64],
    ) -> Primitive {
        let moved = self.moved(placement, weights, true);
        let mut indices = self.indices.clone();
        if moved.mirrored {
            for triangle in indices.chunks_exact_mut(3) {
                triangle.swap(1, 2);
            }
        }
        let rest = self.rest(placement);
        let (positions, rest, normals, uvs) = match moved.normals {
            Some(normals) => {
                let normals = unit_normals(&normals, &moved.positions, &indices);
                (moved.positions, rest, normals, self.uvs.clone())
            }
            None => {
                // A normal a triangle, so triangles cannot share vertices.
                let positions = gather(&moved.positions, &indices);
                let rest = gather(&rest, &indices);
                let uvs = gather(&self.uvs, &indices);
                // At most as many as there were indices, which are 32-bit themselves.
                indices = (0u32..).take(positions.len()).collect();
                let faces = face_normals(&positions, &indices);
                let normals = faces.into_iter().map(unit_or_up).collect();
                (positions, rest, normals, uvs)
            }
        };
        Primitive {
            name,
            node: Some(node),
            material: self.material,
            positions: positions
                .iter()
                .map(|position| position.as_vec3())
                .collect(),
            rest,
            normals: normals
                .iter()
                .map(|normal: &DVec3| normal.as_vec3())
                .collect(),
            uvs,
            indices,
        }
    }

    /// Positions before skin and morph targets: in the scene, or in the mesh's space if a skin moves
    /// it; empty where neither does.
    fn rest(&self, placement: &Placement) -> Vec<Vec3> {
        let own = self.positions.iter();
        match placement {
            Placement::Skinned(_) => self.positions.clone(),
            Placement::Rigid(_) if self.targets.is_empty() => Vec::new(),
            Placement::Rigid(matrix) => own
                .map(|position| matrix.transform_point3(position.as_dvec3()).as_vec3())
                .collect(),
        }
    }

    fn moved(&self, placement: &Placement, weights: &[f64], with_normals: bool) -> Moved {
        let mut positions = morph::morphed(&self.positions, &self.targets, weights, |target| {
            &target.positions
        });
        let mut normals = (self.normals.as_ref().filter(|_| with_normals)).map(|normals| {
            morph::morphed(normals, &self.targets, weights, |target| &target.normals)
        });
        let mirrored = match placement {
            Placement::Rigid(matrix) => {
                for position in &mut positions {
                    *position = matrix.transform_point3(*position);
                }
                let turn = normal_matrix(matrix.matrix3);
                for normal in normals.iter_mut().flatten() {
                    *normal = turn * *normal;
                }
                matrix.matrix3.determinant() < 0.0
            }
            Placement::Skinned(joints) => {
                let mut mirrored = 0;
                for (vertex, position) in positions.iter_mut().enumerate() {
                    let matrix = skin::blend(joints, &self.influences, vertex);
                    *position = matrix.transform_point3(*position);
                    if let Some(normal) = normals.as_mut().and_then(|all| all.get_mut(vertex)) {
                        *normal = normal_matrix(matrix.matrix3) * *normal;
                    }
                    mirrored += usize::from(matrix.matrix3.determinant() < 0.0);
                }
                2 * mirrored > positions.len()
            }
        };
        Moved {
            positions,
            normals,
            mirrored,
        }
    }
}

/// Turns normals with the surface, up to a positive factor. Cofactors in place of the inverse
/// transpose: they exist for flattened transforms too.
fn normal_matrix(linear: DMat3) -> DMat3 {
    let cofactors = DMat3::from_cols(
        linear.y_axis.cross(linear.z_axis),
        linear.z_axis.cross(linear.x_axis),
        linear.x_axis.cross(linear.y_axis),
    );
    if linear.determinant() < 0.0 {
        -cofactors
    } else {
        cofactors
    }
}

fn gather<T: Copy>(values: &[T], indices: &[u32]) -> Vec<T> {
    (indices.iter())
        .filter_map(|&index| values.get(index as usize).copied())
        .collect()
}

/// `normals` at length 1; where there is none left, that of the triangles around.
fn unit_normals(normals: &[DVec3], positions: &[DVec3], indices: &[u32]) -> Vec<DVec3> {
    let units: Vec<Option<DVec3>> = normals.iter().map(|&normal| unit(normal)).collect();
    if units.iter().all(Option::is_some) {
        return units.into_iter().flatten().collect();
    }
    let faces = face_normals(positions, indices);
    (units.into_iter().zip(faces))
        .map(|(normal, face)| normal.unwrap_or_else(|| unit_or_up(face)))
        .collect()
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
    (largest > 0.0 && v.is_finite()).then(|| (v / largest).normalize())
}

/// A triangle without area has no normal; any will do, as long as it is one.
fn unit_or_up(v: DVec3) -> DVec3 {
    unit(v).unwrap_or(DVec3::Y)
}

/// The copies of the meshes of nodes by EXT_mesh_gpu_instancing, each in the space of its node.
pub(super) fn copies(
    accessors: &Accessors<'_>,
    document: &Document,
    side: &Side,
    placed: &[PlacedNode],
) -> Result<BTreeMap<usize, Vec<DAffine3>>, SceneError> {
    let mut all = BTreeMap::new();
    for node in placed.iter().filter(|node| node.mesh.is_some()) {
        let Some(instancing) = (side.nodes.get(node.index))
            .and_then(|node| node.extensions.as_ref()?.instancing.as_ref())
        else {
            continue;
        };
        let invalid = |reason: String| {
            let element = element("node", node.index, node.name.as_deref());
            (accessors.source).invalid(element, format!("EXT_mesh_gpu_instancing: {reason}"))
        };
        let accessor = |attribute: &str| match instancing.attributes.get(attribute) {
            None => Ok(None),
            Some(index) => (index.as_u64())
                .and_then(|index| document.accessors().nth(usize::try_from(index).ok()?))
                .map(Some)
                .ok_or_else(|| invalid(format!("{attribute} names a missing accessor"))),
        };
        let vectors = |attribute| match accessor(attribute)? {
            Some(accessor) => accessors.read_vectors::<3>(&accessor).map(Some),
            None => Ok(None),
        };
        let (translation, scale) = (vectors("TRANSLATION")?, vectors("SCALE")?);
        let rotation = match accessor("ROTATION")? {
            Some(accessor) => Some(accessors.read_vectors::<4>(&accessor)?),
            None => None,
        };
        let lengths = [&translation, &scale].map(|values| values.as_ref().map(Vec::len));
        let mut counts = lengths
            .into_iter()
            .chain([rotation.as_ref().map(Vec::len)])
            .flatten();
        let Some(count) = counts.next() else {
            continue;
        };
        if counts.any(|other| other != count) {
            return Err(invalid("its accessors are not of one length".into()));
        }
        let mut copies = Vec::new();
        for copy in 0..count {
            let vector = |values: &Option<Vec<[f32; 3]>>, default: f32| {
                let value = values.as_ref().and_then(|values| values.get(copy));
                DVec3::from_array(value.copied().unwrap_or([default; 3]).map(f64::from))
            };
            let turn = rotation.as_ref().and_then(|values| values.get(copy));
            let turn = turn.copied().unwrap_or([0.0, 0.0, 0.0, 1.0]);
            let matrix = nodes::unit_rotation(turn.map(f64::from)).map(|turn| {
                DAffine3::from_scale_rotation_translation(
                    vector(&scale, 1.0),
                    turn,
                    vector(&translation, 0.0),
                )
            });
            match matrix {
                Some(matrix) if matrix.is_finite() => copies.push(matrix),
                _ => {
                    return Err(invalid(format!(
                        "copy {copy} has no finite transform with a unit rotation"
                    )));
                }
            }
        }
        all.insert(node.index, copies);
    }
    Ok(all)
}

/// What messages and reports call primitive `local` of `node`.
pub(super) fn name(document: &Document, node: &PlacedNode, local: usize) -> String {
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
