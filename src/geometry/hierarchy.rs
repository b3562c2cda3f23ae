//! A bounding volume hierarchy over the scene's triangles, laid out for walking without a stack.

use super::neighbours::{Neighbours, beside};
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb as Box3;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use std::time::Duration;

/// Most nodes: their numbers are stored as floats, which hold whole numbers up to here.
const MOST_NODES: usize = 1 << 24;

/// Most triangles that a hierarchy can be over.
pub(super) const MOST_TRIANGLES: usize = MOST_NODES / 2;

/// Texels of a node: `NODE_TEXELS` in `common/hierarchy.glsl`.
pub(super) const NODE_TEXELS: usize = 3;

/// Number of nodes over so many triangles: one triangle a leaf.
pub(super) fn node_count(triangles: usize) -> usize {
    (2 * triangles).saturating_sub(1)
}

/// Nodes over triangles of four texels each (`common/triangles.glsl`), in the order of a walk that
/// goes on with the first child where a box is met and with the next node outside where not:
/// `common/hierarchy.glsl`.
pub(super) fn nodes(triangles: &[[f32; 4]], neighbours: &Neighbours) -> Vec<[f32; 4]> {
    let corner = |texel: &[f32; 4]| Vec3A::new(texel[0], texel[1], texel[2]);
    let boxes = triangles
        .chunks_exact(4)
        .map(|texels| Box3::from_points(&[0, 1, 2].map(|i| corner(&texels[i]))));
    let boxes: Vec<Box3> = boxes.collect();
    if boxes.is_empty() {
        return Vec::new();
    }
    let params = BvhBuildParams {
        max_prims_per_leaf: 1,
        post_collapse_reinsertion_batch_ratio_multiplier: 0.0,
        ..BvhBuildParams::medium_build()
    };
    let mut nodes = flatten(&build_bvh2(&boxes, params, &mut Duration::default()));
    add_cones(&mut nodes, triangles, neighbours);
    nodes
}

/// What is known of the triangles of a node and their neighbours.
#[derive(Clone, Copy)]
struct Ring {
    low: Vec3,
    high: Vec3,
    /// Axis and half the angle of a cone that holds all normals; none where there is no such cone or
    /// edges of other kinds than between two alike triangles.
    cone: Option<(Vec3, f32)>,
}

impl Ring {
    fn of_triangle(triangles: &[[f32; 4]], neighbours: &Neighbours, triangle: u32) -> Self {
        let xyz = |texel: usize| {
            let [x, y, z, _] = triangles[texel];
            Vec3::new(x, y, z)
        };
        let mut ring = Self {
            low: Vec3::INFINITY,
            high: Vec3::NEG_INFINITY,
            cone: None,
        };
        let beside = neighbours[triangle as usize].map(beside);
        let own = triangle as usize;
        let all = beside.iter().flatten().map(|(other, _)| *other as usize);
        for of in all.chain([own]) {
            for corner in 0..3 {
                ring.low = ring.low.min(xyz(4 * of + corner));
                ring.high = ring.high.max(xyz(4 * of + corner));
            }
        }
        // Corners and plane; a plane's last number is less than 0 where there are holes.
        let normal = |of: usize| (triangles[4 * of + 3][3] >= 0.0).then(|| xyz(4 * of + 3));
        let mut cone = normal(own).map(|n| (n, 0.0));
        for other in &beside[..3] {
            let normal = other
                .filter(|(_, alike)| *alike)
                .and_then(|(t, _)| normal(t as usize));
            cone = cone.zip(normal).and_then(|(cone, n)| join(cone, (n, 0.0)));
        }
        ring.cone = cone;
        ring
    }

    fn join(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            cone: self.cone.zip(other.cone).and_then(|(a, b)| join(a, b)),
        }
    }
}

/// The smallest cone around two, none from half a turn on.
fn join(a: (Vec3, f32), b: (Vec3, f32)) -> Option<(Vec3, f32)> {
    let between = a.0.cross(b.0).length().atan2(a.0.dot(b.0));
    if between + b.1 <= a.1 {
        return Some(a);
    }
    if between + a.1 <= b.1 {
        return Some(b);
    }
    // Room for rounding.
    let half = 0.5 * (a.1 + between + b.1) + 1.0e-5;
    if half >= 1.5 {
        return None;
    }
    // From a towards b.
    let turn = half - a.1;
    let across = (b.0 - a.0 * a.0.dot(b.0)).normalize_or_zero();
    let axis = (a.0 * turn.cos() + across * turn.sin()).normalize_or_zero();
    Some((axis, half))
}

/// Fills in the cones of all nodes, and how far neighbours reach out of their boxes.
fn add_cones(nodes: &mut [[f32; 4]], triangles: &[[f32; 4]], neighbours: &Neighbours) {
    let count = nodes.len() / NODE_TEXELS;
    let mut rings: Vec<Option<Ring>> = vec![None; count];
    for node in (0..count).rev() {
        let texel = NODE_TEXELS * node;
        let code = nodes[texel][3];
        let ring = if code >= 0.0 {
            Some(Ring::of_triangle(triangles, neighbours, code as u32))
        } else {
            let after = |child: usize| match nodes[NODE_TEXELS * child][3] {
                code if code >= 0.0 => child + 1,
                code => -code as usize,
            };
            let (first, second) = (node + 1, after(node + 1));
            let first = rings[first].zip(rings[second]);
            first.map(|(first, second)| first.join(second))
        };
        rings[node] = ring;
        let Some(ring) = ring else { continue };
        let [low, high] = [nodes[texel], nodes[texel + 1]].map(|[x, y, z, _]| Vec3::new(x, y, z));
        let out = (low - ring.low).max(ring.high - high).max_element();
        nodes[texel + 1][3] = out.max(0.0);
        nodes[texel + 2] = match ring.cone {
            Some((axis, half)) => axis.extend(half.sin()).to_array(),
            None => [0.0, 0.0, 0.0, 2.0],
        };
    }
}

/// The hierarchy depth first.
fn flatten(bvh: &Bvh2) -> Vec<[f32; 4]> {
    let sizes = subtree_sizes(bvh);
    let mut texels = Vec::with_capacity(NODE_TEXELS * bvh.nodes.len());
    let mut stack = vec![0u32];
    while let Some(index) = stack.pop() {
        let node = &bvh.nodes[index as usize];
        let place = texels.len() / NODE_TEXELS;
        let code = if node.is_leaf() {
            bvh.primitive_indices[node.first_index as usize] as f32
        } else {
            stack.extend([node.first_index + 1, node.first_index]);
            // The node after all that this one holds.
            -((place + sizes[index as usize] as usize) as f32)
        };
        let (min, max) = (node.aabb().min, node.aabb().max);
        texels.push([min.x, min.y, min.z, code]);
        texels.push([max.x, max.y, max.z, 0.0]);
        texels.push([0.0, 0.0, 0.0, 2.0]);
    }
    texels
}

/// Number of nodes of each subtree, itself included.
fn subtree_sizes(bvh: &Bvh2) -> Vec<u32> {
    let mut order = vec![0u32];
    let mut at = 0;
    while at < order.len() {
        let node = &bvh.nodes[order[at] as usize];
        if !node.is_leaf() {
            order.extend([node.first_index, node.first_index + 1]);
        }
        at += 1;
    }
    let mut sizes = vec![0; bvh.nodes.len()];
    for &index in order.iter().rev() {
        let node = &bvh.nodes[index as usize];
        sizes[index as usize] = if node.is_leaf() {
            1
        } else {
            let first = node.first_index as usize;
            1 + sizes[first] + sizes[first + 1]
        };
    }
    sizes
}

#[cfg(test)]
mod tests {
    use super::super::neighbours::neighbours;
    use super::*;

    /// Walks as shaders do; `meets` is asked for each inner box.
    fn walk(nodes: &[[f32; 4]], meets: impl Fn([f32; 3], [f32; 3]) -> bool) -> Vec<u32> {
        let mut found = Vec::new();
        let mut at = 0;
        while at < nodes.len() / NODE_TEXELS {
            let [low, high] = [nodes[NODE_TEXELS * at], nodes[NODE_TEXELS * at + 1]];
            let corner = |t: [f32; 4]| [t[0], t[1], t[2]];
            at = if low[3] >= 0.0 {
                found.push(low[3] as u32);
                at + 1
            } else if meets(corner(low), corner(high)) {
                at + 1
            } else {
                -low[3] as usize
            };
        }
        found
    }

    #[test]
    fn walks_find_what_boxes_hold() {
        // A row of unit triangles along x.
        let count = 100;
        let triangles: Vec<[f32; 4]> = (0..count)
            .flat_map(|i| {
                let x = i as f32;
                [
                    [x, 0.0, 0.0, 0.0],
                    [x + 0.9, 0.0, 0.0, 0.0],
                    [x, 1.0, 0.5, 0.0],
                    [0.0, 0.0, 1.0, 0.0],
                ]
            })
            .collect();
        let nodes = nodes(&triangles, &neighbours(&triangles));
        assert_eq!(nodes.len(), NODE_TEXELS * node_count(count));
        let mut all = walk(&nodes, |_, _| true);
        all.sort_unstable();
        assert_eq!(all, (0..count as u32).collect::<Vec<_>>());
        let near = walk(&nodes, |low, high| low[0] <= 40.5 && high[0] >= 40.0);
        assert!(near.contains(&40));
        assert!(near.len() < 20, "{near:?}");
        assert!(walk(&nodes, |_, _| false).is_empty());
    }

    #[test]
    fn few_triangles() {
        assert!(nodes(&[], &Vec::new()).is_empty());
        let one = [
            [0.0, 0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 2.0, 0.0],
            [0.0; 4],
        ];
        let found = nodes(&one, &neighbours(&one));
        let wanted = [
            [0.0, 0.0, 0.0, 0.0],
            [1.0, 1.0, 2.0, 0.0],
            [0.0, 0.0, 0.0, 2.0],
        ];
        assert_eq!(found, wanted);
    }

    #[test]
    fn cones_hold_the_normals_of_neighbours() {
        // A ball of 12 x 24 squares, two triangles each.
        let at = |i: i32, j: i32| {
            let (v, u) = (i as f32 / 12.0, j.rem_euclid(24) as f32 / 24.0);
            let (phi, theta) = (v * std::f32::consts::PI, u * std::f32::consts::TAU);
            Vec3::new(phi.sin() * theta.cos(), phi.cos(), phi.sin() * theta.sin())
        };
        let mut triangles = Vec::new();
        for (i, j) in (1..11).flat_map(|i| (0..24).map(move |j| (i, j))) {
            let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(y, x)| at(i + y, j + x));
            for [a, b, c] in [[a, b, c], [a, c, d]] {
                triangles.extend([a, b, c].map(|p| p.extend(0.0).to_array()));
                let normal = (b - a).cross(c - a).normalize();
                triangles.push(normal.extend(0.0).to_array());
            }
        }
        let beside = neighbours(&triangles);
        let nodes = nodes(&triangles, &beside);
        let mut cones = 0;
        for node in nodes.chunks_exact(NODE_TEXELS).enumerate() {
            let (place, [low, high, cone]) = (node.0, [node.1[0], node.1[1], node.1[2]]);
            let end = if low[3] >= 0.0 {
                place + 1
            } else {
                -low[3] as usize
            };
            if cone[3] > 1.0 {
                continue;
            }
            cones += 1;
            let axis = Vec3::new(cone[0], cone[1], cone[2]);
            for leaf in place..end {
                let code = nodes[NODE_TEXELS * leaf][3];
                if code < 0.0 {
                    continue;
                }
                let around = beside[code as usize].map(super::beside);
                let around = around.iter().flatten().map(|(t, _)| *t);
                for triangle in around.chain([code as u32]) {
                    let [x, y, z, _] = triangles[4 * triangle as usize + 3];
                    let along = axis.dot(Vec3::new(x, y, z));
                    assert!(along * along >= 1.0 - cone[3] * cone[3] - 1.0e-5 && along > 0.0);
                    for corner in 0..3 {
                        let p = triangles[4 * triangle as usize + corner];
                        for i in 0..3 {
                            let out = (low[i] - p[i]).max(p[i] - high[i]);
                            assert!(out <= high[3] + 1.0e-6);
                        }
                    }
                }
            }
        }
        // Of 480 triangles those at the two rims have an open edge.
        assert!(cones > 400, "{cones}");
    }
}
