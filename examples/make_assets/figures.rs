//! Bodies that bend: skinned limbs, their joints and their motion.

use std::fmt::Write as _;

use super::document::{Document, Influences, Place};
use super::math::{Quat, V3, add, length, mix, rounded, scale, smoothstep, sub, unit};
use super::mesh::Mesh;
use super::shapes::{catmull_rom, tube};

/// A joint: its name, its parent's number (its own for the root), where it is in the rest pose.
pub struct Joint {
    pub name: &'static str,
    pub parent: usize,
    pub at: V3,
}

/// Limbs in one mesh, with what each vertex follows.
#[derive(Default)]
pub struct Body {
    pub mesh: Mesh,
    pub influences: Vec<Influences>,
}

impl Body {
    /// A limb with round ends through points with radii. Each of `joints`, (number, point), moves
    /// it from its point on to the next joint's, with a soft change over `soft` metres to each side.
    pub fn limb(&mut self, points: &[(V3, f64)], joints: &[(u8, usize)], soft: f64, sides: u32) {
        const STEPS: u32 = 5;
        const CAP: u32 = 4;
        let last = points.len() - 1;
        let mut path = Vec::new();
        // (distance along the limb) of each ring and of each point.
        let (mut rings, mut marks) = (Vec::new(), vec![0.0]);
        let cap = |at: (V3, f64), out: V3, i: u32| {
            let (s, c) = (std::f64::consts::FRAC_PI_2 * f64::from(i) / f64::from(CAP)).sin_cos();
            let radius = if i == 0 { 0.0 } else { at.1 * s };
            (add(at.0, scale(out, at.1 * c)), radius)
        };
        let out = unit(sub(points[0].0, points[1].0));
        for i in 0..CAP {
            path.push(cap(points[0], out, i));
            rings.push(0.0);
        }
        let mut along = 0.0;
        for i in 0..last {
            let [a, b, c, d] = [i.max(1) - 1, i, i + 1, (i + 2).min(last)].map(|k| points[k]);
            for k in u32::from(i > 0)..=STEPS {
                let t = f64::from(k) / f64::from(STEPS);
                let at = [0, 1, 2].map(|x| catmull_rom([a.0[x], b.0[x], c.0[x], d.0[x]], t));
                let radius = catmull_rom([a.1, b.1, c.1, d.1], t);
                if let (Some((before, _)), true) = (path.last(), i + k as usize > 0) {
                    along += length(sub(at, *before));
                }
                path.push((at, radius));
                rings.push(along);
            }
            marks.push(along);
        }
        let out = unit(sub(points[last].0, points[last - 1].0));
        for i in (0..CAP).rev() {
            path.push(cap(points[last], out, i));
            rings.push(along);
        }
        self.mesh.append(&tube(sides, &path));
        for ring in rings {
            let gone = |k: usize| match joints.get(k) {
                Some((_, point)) if k > 0 => {
                    smoothstep(marks[*point] - soft, marks[*point] + soft, ring)
                }
                Some(_) => 1.0,
                None => 0.0,
            };
            let weights = (0..joints.len()).map(|k| (joints[k].0, gone(k) - gone(k + 1)));
            let influences = influences(weights.collect());
            self.influences.extend((0..sides).map(|_| influences));
        }
    }

    /// Flattened in Z between two vertices.
    pub fn flatten(&mut self, from: usize, by: f64) {
        for p in &mut self.mesh.positions[from..] {
            p[2] *= by;
        }
        for n in &mut self.mesh.normals[from..] {
            *n = unit([n[0], n[1], n[2] / by]);
        }
    }
}

/// The four strongest, with weights that add up exactly.
fn influences(mut weights: Vec<(u8, f64)>) -> Influences {
    weights.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    weights.truncate(4);
    let total: f64 = weights.iter().map(|w| w.1).sum();
    let (mut joints, mut parts) = ([0; 4], [0u16; 4]);
    for (i, (joint, weight)) in weights.iter().enumerate() {
        parts[i] = (weight / total * 65535.0).round() as u16;
        // A joint without weight is joint 0, as the format asks.
        joints[i] = if parts[i] > 0 { *joint } else { 0 };
    }
    let rest: u32 = parts[1..].iter().map(|part| u32::from(*part)).sum();
    parts[0] = (65535 - rest) as u16;
    (joints, parts)
}

/// Nodes of the joints and the skin. `extra` are nodes that hang on a joint: (joint, node).
/// Returns the joints' nodes.
pub fn add_skeleton(b: &mut Document, joints: &[Joint], extra: &[(usize, usize)]) -> Vec<usize> {
    let mut nodes = vec![0; joints.len()];
    // Children stand after their parents, and a node is made after its children.
    for (i, joint) in joints.iter().enumerate().rev() {
        let children = (i + 1..joints.len()).filter(|k| joints[*k].parent == i);
        let mut children: Vec<usize> = children.map(|k| nodes[k]).collect();
        children.extend(extra.iter().filter(|(k, _)| *k == i).map(|(_, node)| node));
        let from = if joint.parent == i {
            [0.0; 3]
        } else {
            joints[joint.parent].at
        };
        let at = sub(joint.at, from).map(|x| rounded(x, 1e6));
        nodes[i] = b.group(joint.name, &Place::at(at), &children);
    }
    let inverse = joints.iter().flat_map(|joint| {
        let [x, y, z] = joint.at.map(|x| -x);
        [
            1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0,
        ]
    });
    let count = joints.len();
    let inverse = b.floats(inverse, &format!(r#""count":{count},"type":"MAT4""#));
    b.skins.push(format!(
        r#"{{"name":"body","inverseBindMatrices":{inverse},"skeleton":{},"joints":{nodes:?}}}"#,
        nodes[0]
    ));
    nodes
}

/// Channels and samplers of one animation.
pub struct Motion {
    times: usize,
    count: usize,
    samplers: Vec<String>,
    channels: Vec<String>,
}

impl Motion {
    /// Keys at `times`, in seconds.
    pub fn new(b: &mut Document, times: &[f64]) -> Self {
        let count = times.len();
        let (first, last) = (times[0] as f32, times[count - 1] as f32);
        let rest = format!(r#""count":{count},"type":"SCALAR","min":[{first:?}],"max":[{last:?}]"#);
        Self {
            times: b.floats(times.iter().copied(), &rest),
            count,
            samplers: Vec::new(),
            channels: Vec::new(),
        }
    }

    fn channel(&mut self, node: usize, path: &str, output: usize, way: &str) {
        let (sampler, input) = (self.samplers.len(), self.times);
        self.samplers.push(format!(
            r#"{{"input":{input},"interpolation":"{way}","output":{output}}}"#
        ));
        self.channels.push(format!(
            r#"{{"sampler":{sampler},"target":{{"node":{node},"path":"{path}"}}}}"#
        ));
    }

    pub fn rotations(&mut self, b: &mut Document, node: usize, keys: &[Quat]) {
        let count = self.count;
        let rest = format!(r#""count":{count},"type":"VEC4""#);
        let output = b.floats(keys.iter().flatten().copied(), &rest);
        self.channel(node, "rotation", output, "LINEAR");
    }

    /// Places and how fast they change, per second.
    pub fn translations(&mut self, b: &mut Document, node: usize, keys: &[(V3, V3)]) {
        let count = 3 * self.count;
        let values = keys.iter().flat_map(|(at, speed)| [*speed, *at, *speed]);
        let values = values.flatten().map(|x| rounded(x, 1e6));
        let output = b.floats(values, &format!(r#""count":{count},"type":"VEC3""#));
        self.channel(node, "translation", output, "CUBICSPLINE");
    }

    /// Of a mesh with one morph target.
    pub fn weights(&mut self, b: &mut Document, node: usize, keys: &[f64]) {
        let count = self.count;
        let values = keys.iter().map(|x| rounded(*x, 1e6));
        let output = b.floats(values, &format!(r#""count":{count},"type":"SCALAR""#));
        self.channel(node, "weights", output, "LINEAR");
    }

    pub fn finish(self, b: &mut Document, name: &str) {
        let mut json = format!(r#"{{"name":"{name}""#);
        for (key, list) in [("samplers", &self.samplers), ("channels", &self.channels)] {
            let _ = write!(json, ",\n\"{key}\":[\n{}\n]", list.join(",\n"));
        }
        json.push('}');
        b.animations.push(json);
    }
}

/// A point of a bone: part of the way from `a` to `b`.
pub fn between(a: V3, b: V3, t: f64, radius: f64) -> (V3, f64) {
    (mix(a, b, t), radius)
}
