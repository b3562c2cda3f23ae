//! A bounding volume hierarchy over the scene's triangles, laid out for walking without a stack.

use glam::Vec3A;
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
pub(super) const NODE_TEXELS: usize = 2;

/// Number of nodes over so many triangles: one triangle a leaf.
pub(super) fn node_count(triangles: usize) -> usize {
    (2 * triangles).saturating_sub(1)
}

/// Nodes over triangles of four texels each (`common/triangles.glsl`), in the order of a walk that
/// goes on with the first child where a box is met and with the next node outside where not:
/// `common/hierarchy.glsl`.
pub(super) fn nodes(triangles: &[[f32; 4]]) -> Vec<[f32; 4]> {
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
    flatten(&build_bvh2(&boxes, params, &mut Duration::default()))
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
    use super::*;

    /// Walks as shaders do; `meets` is asked for each inner box.
    fn walk(nodes: &[[f32; 4]], meets: impl Fn([f32; 3], [f32; 3]) -> bool) -> Vec<u32> {
        let mut found = Vec::new();
        let mut at = 0;
        while at < nodes.len() / NODE_TEXELS {
            let [low, high] = [nodes[2 * at], nodes[2 * at + 1]];
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
        let nodes = nodes(&triangles);
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
        assert!(nodes(&[]).is_empty());
        let one = [
            [0.0, 0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 2.0, 0.0],
            [0.0; 4],
        ];
        assert_eq!(nodes(&one), [[0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 2.0, 0.0]]);
    }
}
