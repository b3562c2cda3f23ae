//! Skins: vertices that follow several nodes at once.

use glam::{DAffine3, DMat4, DVec3};
use gltf::Document;
use gltf::accessor::DataType;

use super::accessor::Accessors;
use super::{SceneError, Source, element};

/// The joints of a skin and where they are when the mesh is as modelled.
#[derive(Debug)]
pub(super) struct Skin {
    element: String,
    /// Nodes.
    joints: Vec<usize>,
    /// One for each joint: from the mesh's space to the joint's.
    inverse_bind: Vec<DAffine3>,
}

/// What one vertex follows: four joints and their shares.
#[derive(Clone, Copy, Debug)]
pub(super) struct Influence {
    pub(super) joints: [u16; 4],
    /// Each 0 or more. All of a vertex, over its sets, add up to 1.
    pub(super) weights: [f32; 4],
}

impl Skin {
    pub(super) fn read(
        accessors: &Accessors<'_>,
        document: &Document,
        index: usize,
    ) -> Result<Self, SceneError> {
        let source = accessors.source;
        let json = document.as_json();
        let Some(skin) = json.skins.get(index) else {
            return Err(source.invalid(element("skin", index, None), "it is missing"));
        };
        let element = element("skin", index, skin.name.as_deref());
        let joints: Vec<usize> = skin.joints.iter().map(|joint| joint.value()).collect();
        if joints.is_empty() {
            return Err(source.invalid(element, "it has no joints"));
        }
        if let Some(joint) = joints.iter().find(|&&joint| joint >= json.nodes.len()) {
            let reason = format!("its joint names node {joint}, which is missing");
            return Err(source.invalid(element, reason));
        }
        let inverse_bind = match skin.inverse_bind_matrices {
            None => vec![DAffine3::IDENTITY; joints.len()],
            Some(matrices) => {
                let Some(accessor) = document.accessors().nth(matrices.value()) else {
                    let reason = "the accessor of its inverse bind matrices is missing";
                    return Err(source.invalid(element, reason));
                };
                let matrices = accessors.read_vectors::<16>(&accessor)?;
                if matrices.len() < joints.len() {
                    let reason = format!(
                        "it has {} joints and {} inverse bind matrices",
                        joints.len(),
                        matrices.len()
                    );
                    return Err(source.invalid(element, reason));
                }
                let used = matrices.iter().take(joints.len()).enumerate();
                used.map(|(number, matrix)| {
                    affine(matrix).ok_or_else(|| {
                        let reason = format!(
                            "inverse bind matrix {number} is not finite, or its last row is not \
                             0 0 0 1"
                        );
                        source.invalid(element.clone(), reason)
                    })
                })
                .collect::<Result<_, _>>()?
            }
        };
        Ok(Self {
            element,
            joints,
            inverse_bind,
        })
    }

    /// For each joint, from the mesh's space to world space minus `origin`; `worlds` are those of
    /// all nodes.
    pub(super) fn matrices(
        &self,
        source: Source<'_>,
        worlds: &[Option<DAffine3>],
        origin: DVec3,
    ) -> Result<Vec<DAffine3>, SceneError> {
        (self.joints.iter().zip(&self.inverse_bind))
            .map(|(&joint, inverse_bind)| {
                let mut world = worlds.get(joint).copied().flatten().ok_or_else(|| {
                    let reason = "it is its own ancestor: nodes must form a tree";
                    source.invalid(element("node", joint, None), reason)
                })?;
                world.translation -= origin;
                let matrix = world * *inverse_bind;
                if matrix.is_finite() {
                    Ok(matrix)
                } else {
                    let reason = format!("the transform of its joint node {joint} is not finite");
                    Err(source.invalid(self.element.clone(), reason))
                }
            })
            .collect()
    }

    /// What is wrong with `influences` if they are for this skin: the vertex and its joint.
    pub(super) fn fault(&self, sets: &[Vec<Influence>]) -> Option<String> {
        for set in sets {
            for (vertex, influence) in set.iter().enumerate() {
                for (joint, weight) in influence.joints.iter().zip(influence.weights) {
                    if weight > 0.0 && usize::from(*joint) >= self.joints.len() {
                        return Some(format!(
                            "vertex {vertex} follows joint {joint} of {}, which has {}",
                            self.element,
                            self.joints.len()
                        ));
                    }
                }
            }
        }
        None
    }
}

/// The weighted mean of joint matrices at one vertex.
pub(super) fn blend(matrices: &[DAffine3], sets: &[Vec<Influence>], vertex: usize) -> DAffine3 {
    let mut mean = DAffine3::ZERO;
    for influence in sets.iter().filter_map(|set| set.get(vertex)) {
        for (joint, weight) in influence.joints.iter().zip(influence.weights) {
            if weight > 0.0
                && let Some(matrix) = matrices.get(usize::from(*joint))
            {
                let weight = f64::from(weight);
                mean.matrix3 += matrix.matrix3 * weight;
                mean.translation += matrix.translation * weight;
            }
        }
    }
    mean
}

/// One set of joints and weights, JOINTS_n and WEIGHTS_n. Weights are as in the file.
pub(super) fn read_influences(
    accessors: &Accessors<'_>,
    joints: &gltf::Accessor<'_>,
    weights: &gltf::Accessor<'_>,
    vertices: usize,
) -> Result<Result<Vec<Influence>, String>, SceneError> {
    if !matches!(joints.data_type(), DataType::U8 | DataType::U16) || joints.normalized() {
        let reason = "joints must be unsigned integers of 8 or 16 bits, not normalized";
        return Err(accessors.fault(joints, reason));
    }
    let joints = accessors.read_vectors::<4>(joints)?;
    let weights = accessors.read_vectors::<4>(weights)?;
    if joints.len() != vertices || weights.len() != vertices {
        return Ok(Err(format!(
            "it has {vertices} positions, {} joints and {} weights",
            joints.len(),
            weights.len()
        )));
    }
    // Written so that NaN fails.
    let good = |weight: &f32| *weight >= 0.0 && weight.is_finite();
    if let Some(vertex) = weights.iter().position(|four| !four.iter().all(good)) {
        return Ok(Err(format!(
            "a joint weight of vertex {vertex} is not finite and 0 or more"
        )));
    }
    let four = joints.into_iter().zip(weights);
    Ok(Ok(four
        .map(|(joints, weights)| Influence {
            // Exact: they were 16-bit integers.
            joints: joints.map(|joint| joint as u16),
            weights,
        })
        .collect()))
}

/// Makes the weights of each vertex add up to 1. A vertex that follows nothing follows the joint it
/// names first.
pub(super) fn normalize(sets: &mut [Vec<Influence>], vertices: usize) {
    for vertex in 0..vertices {
        let of_vertex = sets.iter().filter_map(|set| set.get(vertex));
        let sum: f64 = of_vertex
            .flat_map(|influence| influence.weights)
            .map(f64::from)
            .sum();
        for set in sets.iter_mut() {
            if let Some(influence) = set.get_mut(vertex) {
                influence.weights = influence
                    .weights
                    .map(|weight| (f64::from(weight) / sum.max(1e-300)) as f32);
            }
        }
        if sum == 0.0
            && let Some(influence) = sets.first_mut().and_then(|set| set.get_mut(vertex))
        {
            influence.weights = [1.0, 0.0, 0.0, 0.0];
        }
    }
}

/// The affine part of a column-major 4x4 matrix, if there is nothing else to it.
fn affine(matrix: &[f32; 16]) -> Option<DAffine3> {
    let matrix = DMat4::from_cols_array(&matrix.map(f64::from));
    let last = matrix.row(3) - glam::DVec4::W;
    // Some exporters invert in single precision.
    (matrix.is_finite() && last.abs().max_element() < 1.0e-3).then(|| DAffine3::from_mat4(matrix))
}
