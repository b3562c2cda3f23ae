//! The node tree: world transforms in `f64`, and frames out of them.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use gltf::Document;

use super::animation::Pose;
use super::document::{Side, SideNode};
use super::{SceneError, Source, element};

/// A node of the scene that is shown.
pub(super) struct PlacedNode {
    pub(super) index: usize,
    pub(super) name: Option<String>,
    pub(super) mesh: Option<usize>,
    pub(super) skin: Option<usize>,
    pub(super) camera: Option<usize>,
    /// From the node's space to world space.
    pub(super) world: DAffine3,
}

/// What a node does to its children, in parts that can be animated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts {
    pub(super) translation: DVec3,
    /// Of length 1.
    pub(super) rotation: DQuat,
    pub(super) scale: DVec3,
}

#[derive(Clone, Copy, Debug)]
enum Local {
    Matrix(DAffine3),
    Parts(Parts),
}

/// The transforms of all nodes as the file has them, and who is whose parent.
#[derive(Debug)]
pub(super) struct Tree {
    locals: Vec<Local>,
    parents: Vec<Option<usize>>,
}

impl Tree {
    pub(super) fn read(
        source: Source<'_>,
        document: &Document,
        side: &Side,
    ) -> Result<Self, SceneError> {
        let nodes = &document.as_json().nodes;
        let mut tree = Self {
            locals: Vec::with_capacity(nodes.len()),
            parents: vec![None; nodes.len()],
        };
        let unmoved = SideNode::default();
        for (index, node) in nodes.iter().enumerate() {
            let local = local_transform(side.nodes.get(index).unwrap_or(&unmoved));
            let local = local
                .map_err(|why| source.invalid(element("node", index, node.name.as_deref()), why))?;
            tree.locals.push(local);
            for child in node.children.iter().flatten() {
                if let Some(parent) = tree.parents.get_mut(child.value()) {
                    *parent = Some(index);
                }
            }
        }
        Ok(tree)
    }

    /// The parts of a node that is not given by a matrix.
    pub(super) fn parts(&self, node: usize) -> Option<Parts> {
        match self.locals.get(node)? {
            Local::Parts(parts) => Some(*parts),
            Local::Matrix(_) => None,
        }
    }

    fn local(&self, node: usize, pose: &Pose) -> DAffine3 {
        let parts = match (pose.parts.get(&node), self.locals.get(node)) {
            (Some(parts), _) | (None, Some(Local::Parts(parts))) => parts,
            (None, Some(Local::Matrix(matrix))) => return *matrix,
            (None, None) => return DAffine3::IDENTITY,
        };
        DAffine3::from_scale_rotation_translation(parts.scale, parts.rotation, parts.translation)
    }

    /// For each node, shown or not, from its space to world space; `None` for its own ancestors.
    pub(super) fn worlds(&self, pose: &Pose) -> Vec<Option<DAffine3>> {
        let mut worlds = vec![None; self.parents.len()];
        let mut seen = vec![false; self.parents.len()];
        let mut chain = Vec::new();
        for node in 0..self.parents.len() {
            let mut at = Some(node);
            while let Some(index) = at.filter(|&index| !seen[index]) {
                seen[index] = true;
                chain.push(index);
                at = self.parents[index];
            }
            // A node that was seen and has no transform yet is in this chain, or hangs on a loop.
            let mut world = at.map_or(Some(DAffine3::IDENTITY), |index| worlds[index]);
            while let Some(index) = chain.pop() {
                world = world.map(|world| world * self.local(index, pose));
                worlds[index] = world;
            }
        }
        worlds
    }

    /// The nodes of the default scene, in document order. Without a default it is the first scene,
    /// and in a file without scenes all nodes.
    pub(super) fn place(
        &self,
        source: Source<'_>,
        document: &Document,
        pose: &Pose,
    ) -> Result<Vec<PlacedNode>, SceneError> {
        let nodes = &document.as_json().nodes;
        let mut open: Vec<(usize, DAffine3)> = self
            .roots(document)
            .into_iter()
            .map(|root| (root, DAffine3::IDENTITY))
            .collect();
        let mut placed = Vec::new();
        let mut seen = vec![false; nodes.len()];
        while let Some((index, parent)) = open.pop() {
            let (Some(json), Some(seen)) = (nodes.get(index), seen.get_mut(index)) else {
                continue;
            };
            let element = || element("node", index, json.name.as_deref());
            // Also what ends the walk of a tree that bites its tail.
            if std::mem::replace(seen, true) {
                let reason = "it is reached twice: nodes must form a tree";
                return Err(source.invalid(element(), reason));
            }
            let world = parent * self.local(index, pose);
            if !world.is_finite() {
                return Err(source.invalid(element(), "its transform is not finite"));
            }
            let children = json.children.iter().flatten();
            open.extend(children.map(|child| (child.value(), world)));
            placed.push(PlacedNode {
                index,
                name: json.name.clone(),
                mesh: json.mesh.map(|mesh| mesh.value()),
                skin: json.skin.map(|skin| skin.value()),
                camera: json.camera.map(|camera| camera.value()),
                world,
            });
        }
        placed.sort_by_key(|node| node.index);
        Ok(placed)
    }

    fn roots(&self, document: &Document) -> Vec<usize> {
        let scene = document
            .default_scene()
            .or_else(|| document.scenes().next());
        if let Some(scene) = scene {
            return scene.nodes().map(|node| node.index()).collect();
        }
        let is_root = |&node: &usize| self.parents.get(node) == Some(&None);
        (0..self.parents.len()).filter(is_root).collect()
    }
}

fn local_transform(node: &SideNode) -> Result<Local, &'static str> {
    if let Some(m) = node.matrix {
        if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
            return Err("the last row of its matrix is not 0 0 0 1");
        }
        return Ok(Local::Matrix(DAffine3::from_cols_array_2d(&[
            [m[0], m[1], m[2]],
            [m[4], m[5], m[6]],
            [m[8], m[9], m[10]],
            [m[12], m[13], m[14]],
        ])));
    }
    let rotation = unit_rotation(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    Ok(Local::Parts(Parts {
        translation: DVec3::from_array(node.translation.unwrap_or([0.0; 3])),
        rotation: rotation.ok_or("its rotation is not a unit quaternion")?,
        scale: DVec3::from_array(node.scale.unwrap_or([1.0; 3])),
    }))
}

/// A quaternion (x, y, z, w) made exactly unit. Rounded ones are common; one that is far from unit
/// is a mistake.
pub(super) fn unit_rotation(xyzw: [f64; 4]) -> Option<DQuat> {
    let rotation = DQuat::from_array(xyzw);
    let length = rotation.length();
    (0.9..=1.1).contains(&length).then(|| rotation / length)
}

/// Largest absolute component of the world scale: the length of the longest axis.
pub(super) fn largest_scale(m: DMat3) -> f64 {
    let lengths = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length);
    lengths.into_iter().fold(0.0, f64::max)
}

/// Which axis stays next to Z where shear has made axes oblique.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Keep {
    X,
    Y,
}

/// The rotation part of a transform: orthonormal, right-handed, Z along the transform's Z, the kept
/// axis as near as can be to its own. Mirroring turns the third axis round. Axes that a zero scale
/// has wiped out are replaced by what the others leave, or by some fixed choice.
pub(super) fn frame(m: DMat3, keep: Keep) -> DMat3 {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(direction);
    let first = match z {
        Some(z) => z,
        None => match (x, y) {
            (Some(x), Some(y)) => direction(x.cross(y)).unwrap_or(x.any_orthonormal_vector()),
            (Some(axis), None) | (None, Some(axis)) => axis.any_orthonormal_vector(),
            (None, None) => DVec3::Z,
        },
    };
    let across = |axis: Option<DVec3>| {
        let rest = axis.map(|axis| axis - first * axis.dot(first))?;
        // What is left of a parallel axis is rounding error.
        if rest.length() > 1.0e-9 {
            direction(rest)
        } else {
            None
        }
    };
    let (x, y) = (across(x), across(y));
    let fallback = || first.any_orthonormal_vector();
    match keep {
        Keep::X => {
            let x = x
                .or_else(|| y.map(|y| y.cross(first)))
                .unwrap_or_else(fallback);
            DMat3::from_cols(x, first.cross(x), first)
        }
        Keep::Y => {
            let y = y
                .or_else(|| x.map(|x| first.cross(x)))
                .unwrap_or_else(fallback);
            DMat3::from_cols(y.cross(first), y, first)
        }
    }
}

/// `v` normalised without leaving the range of `f64`; `None` for 0.
fn direction(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    (largest > 0.0 && largest.is_finite()).then(|| (v / largest).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_rotation(m: DMat3) {
        assert!((m.determinant() - 1.0).abs() < 1e-12, "{m}");
        assert!(
            (m * m.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-12),
            "{m}"
        );
    }

    #[test]
    fn frame_is_a_rotation_for_any_matrix() {
        let axes = [
            DVec3::ZERO,
            DVec3::X,
            -DVec3::Y,
            DVec3::Z * 1e-200,
            DVec3::new(1e200, 2e200, -1e200),
            DVec3::new(0.1, 0.2, 0.3),
        ];
        for x in axes {
            for y in axes {
                for z in axes {
                    for keep in [Keep::X, Keep::Y] {
                        assert_rotation(frame(DMat3::from_cols(x, y, z), keep));
                    }
                }
            }
        }
    }

    #[test]
    fn frame_undoes_scale_and_keeps_rotation() {
        let rotation = DMat3::from_quat(DQuat::from_rotation_y(0.3) * DQuat::from_rotation_x(1.2));
        let scaled = rotation * DMat3::from_diagonal(DVec3::new(3.0, 0.2, 7.0));
        for keep in [Keep::X, Keep::Y] {
            assert!(frame(scaled, keep).abs_diff_eq(rotation, 1e-12));
        }
        assert_eq!(largest_scale(scaled).round(), 7.0);
        let mirrored = rotation * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        assert!(frame(mirrored, Keep::Y).abs_diff_eq(rotation, 1e-12));
        let turned = frame(mirrored, Keep::X);
        assert!(turned.z_axis.abs_diff_eq(rotation.z_axis, 1e-12));
        assert!(turned.x_axis.abs_diff_eq(-rotation.x_axis, 1e-12));
    }
}
