//! Morph targets: displacements of vertices, each with a weight.

use glam::{DVec3, Vec3};
use gltf::Document;

use super::accessor::Accessors;
use super::animation::Pose;
use super::mesh::read_vec3;
use super::nodes::PlacedNode;
use super::{SceneError, Source, element};

/// What one target adds at weight 1; one displacement for each vertex, or none at all.
#[derive(Debug)]
pub(super) struct Target {
    pub(super) positions: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
}

/// The targets of a primitive of `vertices`; displacements of normals only if it has normals.
pub(super) fn read(
    accessors: &Accessors<'_>,
    primitive: &gltf::Primitive<'_>,
    vertices: usize,
    has_normals: bool,
    invalid: &dyn Fn(String) -> SceneError,
) -> Result<Vec<Target>, SceneError> {
    let mut targets = Vec::new();
    for (number, target) in primitive.morph_targets().enumerate() {
        let read = |accessor: Option<gltf::Accessor<'_>>, attribute: &str| {
            let Some(accessor) = accessor else {
                return Ok(Vec::new());
            };
            let attribute = format!("{attribute} of morph target {number}");
            let values = read_vec3(accessors, &accessor, &attribute, invalid)?;
            if values.len() != vertices {
                return Err(invalid(format!(
                    "it has {vertices} positions, and {attribute} {}",
                    values.len()
                )));
            }
            Ok(values)
        };
        targets.push(Target {
            positions: read(target.positions(), "POSITION")?,
            normals: read(target.normals().filter(|_| has_normals), "NORMAL")?,
        });
    }
    Ok(targets)
}

/// The weights of the targets of `node`'s mesh: animated, else the node's, else the mesh's, else 0.
pub(super) fn weights(
    source: Source<'_>,
    document: &Document,
    node: &PlacedNode,
    pose: &Pose,
    targets: usize,
) -> Result<Vec<f64>, SceneError> {
    if let Some(weights) = pose.weights.get(&node.index) {
        return Ok(weights.clone());
    }
    let json = document.as_json();
    let of_node = (json.nodes.get(node.index)).and_then(|node| node.weights.as_ref());
    let of_mesh = || json.meshes.get(node.mesh?)?.weights.as_ref();
    let Some(weights) = of_node.or_else(of_mesh) else {
        return Ok(vec![0.0; targets]);
    };
    let element = || element("node", node.index, node.name.as_deref());
    if weights.len() != targets {
        let reason = format!(
            "it has {} weights for {targets} morph targets",
            weights.len()
        );
        return Err(source.invalid(element(), reason));
    }
    if !weights.iter().all(|weight| weight.is_finite()) {
        return Err(source.invalid(element(), "a morph weight is not finite"));
    }
    Ok(weights.iter().map(|&weight| f64::from(weight)).collect())
}

/// `base` with the displacements that `pick` takes from each target added by their weights.
pub(super) fn morphed(
    base: &[Vec3],
    targets: &[Target],
    weights: &[f64],
    pick: impl Fn(&Target) -> &[Vec3],
) -> Vec<DVec3> {
    let mut values: Vec<DVec3> = base.iter().map(|value| value.as_dvec3()).collect();
    for (target, &weight) in targets.iter().zip(weights) {
        if weight != 0.0 {
            for (value, displacement) in values.iter_mut().zip(pick(target)) {
                *value += weight * displacement.as_dvec3();
            }
        }
    }
    values
}
