//! The scene's triangles for rays: the BVH over them, and what is decided about one triangle and
//! one ray.
//!
//! Vertices are `f32` and taken as they are; everything about rays is `f64`. Two things are decided
//! for a triangle and a segment, apart from each other:
//!
//! - Which side of its edges the line passes. Vertices are sheared into the plane across the ray
//!   and edge functions taken there (Woop, Benthin and Wald 2013, "Watertight Ray/Triangle
//!   Intersection"). A vertex lands at the same place for all its triangles, and the difference of
//!   two rounded products never has the wrong sign, so no line passes between triangles that share
//!   an edge or a vertex; a line through an edge counts as inside.
//! - Whether the segment's ends lie on opposite sides of its plane, by more than the rounding of
//!   the ends and of the plane. So a triangle in whose plane the segment starts (the receiver's
//!   own, its coplanar neighbours and duplicates) or ends does not block it, and no offset of the
//!   start is needed.

use std::time::Duration;

use glam::{DVec3, Vec2, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb as Box3;
use obvhs::bvh2::builder::build_bvh2;

use crate::scene::{Scene, TextureImage, Wrap};

/// Half the distance from 1 to the next `f64`: the relative rounding of one operation.
pub(super) const ROUNDING: f64 = 0.5 * f64::EPSILON;
const SOLID: u32 = u32::MAX;

/// A node of the hierarchy, with the exact box of its triangles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) min: [f32; 3],
    pub(super) max: [f32; 3],
    /// Of the first child, of two, or of the first triangle.
    pub(super) first: u32,
    /// Number of triangles; 0 for an inner node.
    pub(super) count: u32,
}

/// A triangle, in the order of the hierarchy's leaves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub(super) corners: [Vec3; 3],
    /// Index of its cut-out, or `SOLID`.
    cutout: u32,
    pub(super) primitive: u32,
    /// Number within its primitive.
    pub(super) index: u32,
}

/// How a triangle with holes is told to have one somewhere.
#[derive(Clone, Copy, Debug)]
struct Cutout {
    uvs: [Vec2; 3],
    image: u32,
    wrap: [Wrap; 2],
    /// The surface's own alpha.
    alpha: f32,
    cutoff: f32,
}

/// Triangles in a bounding volume hierarchy.
#[derive(Debug)]
pub(super) struct Triangles {
    pub(super) nodes: Vec<Node>,
    pub(super) list: Vec<Triangle>,
    cutouts: Vec<Cutout>,
    /// Images of cut-outs; those of other surfaces are empty.
    images: Vec<TextureImage>,
}

/// The hit of a line on a triangle: three weights of one sign, not all 0, unnormalised.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weights(pub(super) [f64; 3]);

impl Weights {
    /// Weights that add up to 1.
    pub(super) fn normalised(self) -> [f64; 3] {
        let sum = self.0[0] + self.0[1] + self.0[2];
        self.0.map(|w| w / sum)
    }
}

/// A line from the origin in the frame that shears it onto an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    axes: [usize; 3],
    sx: f64,
    sy: f64,
}

/// The axis along which `d` is longest; the first of several.
pub(super) fn main_axis(d: DVec3) -> usize {
    let a = d.abs();
    if a.x >= a.y && a.x >= a.z {
        0
    } else if a.y >= a.z {
        1
    } else {
        2
    }
}

/// The axes for a line whose main one is `axis`, that one last.
pub(super) fn axes(axis: usize) -> [usize; 3] {
    [[1, 2, 0], [2, 0, 1], [0, 1, 2]][axis]
}

impl Line {
    pub(super) fn new(direction: DVec3) -> Self {
        let axes = axes(main_axis(direction));
        let d = direction.to_array();
        Self {
            axes,
            sx: d[axes[0]] / d[axes[2]],
            sy: d[axes[1]] / d[axes[2]],
        }
    }

    /// Where the line meets the triangle of these corners, which are relative to its start.
    pub(super) fn weights(&self, corners: &[DVec3; 3]) -> Option<Weights> {
        let [x, y, z] = self.axes;
        let sheared = corners.map(|v| {
            let v = v.to_array();
            (v[x] - self.sx * v[z], v[y] - self.sy * v[z])
        });
        edge_weights(sheared)
    }
}

/// The weights of the origin within a triangle in the plane, if it lies within.
#[inline(always)]
fn edge_weights([a, b, c]: [(f64, f64); 3]) -> Option<Weights> {
    let u = c.0 * b.1 - c.1 * b.0;
    let v = a.0 * c.1 - a.1 * c.0;
    let w = b.0 * a.1 - b.1 * a.0;
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    (inside && u + v + w != 0.0).then_some(Weights([u, v, w]))
}

/// The plane of a triangle as seen from a point, and how far its numbers can be trusted.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaneFrom {
    /// Across the triangle, of twice its area.
    pub(super) normal: DVec3,
    /// `normal . (corner - point)`.
    pub(super) height: f64,
    /// `height` counts as 0 up to this.
    pub(super) height_error: f64,
    /// A bound on the rounding of `normal`, as the length that a unit of distance is multiplied by.
    normal_error: f64,
    /// Distance to the corner that `height` uses, in the sum norm.
    reach: f64,
}

fn sum_norm(v: DVec3) -> f64 {
    let a = v.abs();
    a.x + a.y + a.z
}

impl PlaneFrom {
    /// From a point that is known to within `error` metres; `corners` are relative to it.
    #[inline]
    pub(super) fn new(triangle: &Triangle, corners: &[DVec3; 3], error: f64) -> Self {
        let [a, b, c] = triangle.corners.map(Vec3::as_dvec3);
        let (ab, ac) = (b - a, c - a);
        let normal = ab.cross(ac);
        let height = normal.dot(corners[0]);
        // One rounding for each difference, product and sum on the way, with some to spare.
        let normal_error = 8.0 * ROUNDING * sum_norm(ab) * sum_norm(ac);
        let reach = sum_norm(corners[0]);
        Self {
            normal,
            height,
            height_error: normal_error * reach
                + sum_norm(normal) * (error + 4.0 * ROUNDING * reach),
            normal_error,
            reach,
        }
    }

    /// True if the point lies in the plane as far as can be told.
    #[inline]
    pub(super) fn holds_point(&self) -> bool {
        self.height.abs() <= self.height_error
    }

    /// What [`separates`](Self::separates) needs to know of all samples of a light, from the point
    /// at most `distance` away (sum norm) and known to within `error`.
    #[inline]
    pub(super) fn end_error(&self, distance: f64, error: f64) -> f64 {
        let reach = self.reach + distance;
        self.normal_error * reach + sum_norm(self.normal) * (error + 4.0 * ROUNDING * reach)
    }
}

impl Triangles {
    pub(super) fn new(scene: &Scene) -> Self {
        let mut list = Vec::with_capacity(scene.triangle_count());
        let mut cutouts = Vec::new();
        for (number, primitive) in scene.primitives.iter().enumerate() {
            let Some(material) = scene.materials.get(primitive.material) else {
                continue;
            };
            let cutoff = material.mask_cutoff();
            let texture = (material.base_texture)
                .filter(|texture| texture.image < scene.images.len() && !primitive.uvs.is_empty());
            let alpha = material.base_color.w;
            if texture.is_none() && cutoff.is_some_and(|cutoff| alpha < cutoff) {
                continue;
            }
            for (index, corners) in primitive.indices.chunks_exact(3).enumerate() {
                let at = |i: usize| primitive.positions.get(corners[i] as usize).copied();
                let (Some(a), Some(b), Some(c)) = (at(0), at(1), at(2)) else {
                    continue;
                };
                let [ab, ac] = [b, c].map(|corner| corner.as_dvec3() - a.as_dvec3());
                let has_area = ab.cross(ac) != DVec3::ZERO;
                if !(has_area && a.is_finite() && b.is_finite() && c.is_finite()) {
                    continue;
                }
                let mut cutout = SOLID;
                if let (Some(cutoff), Some(texture)) = (cutoff, texture) {
                    let uv = |i: usize| primitive.uvs.get(corners[i] as usize).copied();
                    cutout = cutouts.len() as u32;
                    cutouts.push(Cutout {
                        uvs: [0, 1, 2].map(|i| uv(i).unwrap_or_default()),
                        image: texture.image as u32,
                        wrap: texture.wrap,
                        alpha,
                        cutoff,
                    });
                }
                list.push(Triangle {
                    corners: [a, b, c],
                    cutout,
                    primitive: number as u32,
                    index: index as u32,
                });
            }
        }
        let (nodes, order) = build(&list);
        let mut images = vec![TextureImage::default(); scene.images.len()];
        for cutout in &cutouts {
            let image = cutout.image as usize;
            if images[image].texels.is_empty() {
                images[image] = scene.images[image].clone();
            }
        }
        Self {
            nodes,
            list: order.iter().map(|&i| list[i as usize]).collect(),
            cutouts,
            images,
        }
    }

    /// True if the triangle is there at the point of these weights.
    pub(super) fn is_solid_at(&self, triangle: &Triangle, weights: Weights) -> bool {
        let Some(cutout) = self.cutouts.get(triangle.cutout as usize) else {
            return true;
        };
        let [u, v, w] = weights.normalised();
        let [a, b, c] = cutout.uvs.map(Vec2::as_dvec2);
        let uv = (u * a + v * b + w * c).as_vec2();
        let image = &self.images[cutout.image as usize];
        image.alpha(uv, cutout.wrap) * cutout.alpha >= cutout.cutoff
    }

    pub(super) fn has_holes(triangle: &Triangle) -> bool {
        triangle.cutout != SOLID
    }

    /// The triangle that a ray meets first at `least` lengths of `direction` or more: its index
    /// into `list`, the distance in lengths of `direction`, and the weights there. Of several at
    /// the same distance the first in the scene.
    pub(super) fn nearest(
        &self,
        origin: DVec3,
        direction: DVec3,
        least: f64,
        stack: &mut Vec<u32>,
    ) -> Option<(u32, f64, Weights)> {
        let line = Line::new(direction);
        let slabs = Slabs::new(origin, direction);
        let along = main_axis(direction);
        let scale = 1.0 / direction[along];
        let mut best: Option<(u32, f64, Weights)> = None;
        stack.clear();
        if !self.nodes.is_empty() {
            stack.push(0);
        }
        while let Some(node) = stack.pop() {
            let limit = best.map_or(f64::INFINITY, |(_, t, _)| t);
            let node = &self.nodes[node as usize];
            if slabs.enter(node, least, limit).is_none() {
                continue;
            }
            if node.count == 0 {
                let near = |i: u32| slabs.enter(&self.nodes[i as usize], least, limit);
                match (near(node.first), near(node.first + 1)) {
                    (Some(a), Some(b)) if a <= b => stack.extend([node.first + 1, node.first]),
                    (Some(_), Some(_)) => stack.extend([node.first, node.first + 1]),
                    (Some(_), None) => stack.push(node.first),
                    (None, Some(_)) => stack.push(node.first + 1),
                    (None, None) => {}
                }
                continue;
            }
            for index in node.first..node.first + node.count {
                let triangle = &self.list[index as usize];
                let corners = triangle.corners.map(|corner| corner.as_dvec3() - origin);
                let Some(weights) = line.weights(&corners) else {
                    continue;
                };
                let [u, v, w] = weights.normalised();
                let [a, b, c] = corners;
                let t = (u * a[along] + v * b[along] + w * c[along]) * scale;
                let is_nearer = best.is_none_or(|(other, limit, _)| {
                    let order = |i: u32| {
                        let triangle = &self.list[i as usize];
                        (triangle.primitive, triangle.index)
                    };
                    t < limit || (t == limit && order(index) < order(other))
                });
                if t >= least && is_nearer && self.is_solid_at(triangle, weights) {
                    best = Some((index, t, weights));
                }
            }
        }
        best
    }

    /// True if something stands between a receiver and the end of `to_end`, one segment at a time:
    /// the plain form of what `Beam` does for many.
    pub(super) fn occluded(&self, from: &Start, to: &End, stack: &mut Vec<u32>) -> bool {
        let line = Line::new(to.offset);
        let slabs = Slabs::new(from.position, to.offset);
        let limit = if to.at_infinity { f64::INFINITY } else { 1.0 };
        stack.clear();
        if !self.nodes.is_empty() {
            stack.push(0);
        }
        while let Some(node) = stack.pop() {
            let node = &self.nodes[node as usize];
            if slabs.enter(node, 0.0, limit).is_none() {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first, node.first + 1]);
                continue;
            }
            for index in node.first..node.first + node.count {
                if index != from.own && self.blocks(index, from, to, &line) {
                    return true;
                }
            }
        }
        false
    }

    fn blocks(&self, index: u32, from: &Start, to: &End, line: &Line) -> bool {
        let triangle = &self.list[index as usize];
        let corners = (triangle.corners).map(|corner| corner.as_dvec3() - from.position);
        let plane = PlaneFrom::new(triangle, &corners, from.error);
        if plane.holds_point() {
            return false;
        }
        let fall = plane.normal.dot(to.offset);
        let end_error = plane.end_error(sum_norm(to.offset), to.error);
        separates(&plane, fall, end_error, to.at_infinity)
            && (line.weights(&corners)).is_some_and(|weights| self.is_solid_at(triangle, weights))
    }
}

/// Whether a plane, off which the start lies, has the segment's end beyond it; `fall` is
/// `normal . offset`.
#[inline(always)]
pub(super) fn separates(plane: &PlaneFrom, fall: f64, end_error: f64, at_infinity: bool) -> bool {
    let height = if at_infinity { 0.0 } else { plane.height };
    let beyond = height - fall;
    if plane.height > 0.0 {
        beyond < -end_error
    } else {
        beyond > end_error
    }
}

/// Where segments start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Start {
    pub(super) position: DVec3,
    /// How far off its surface `position` may lie by rounding, metres.
    pub(super) error: f64,
    /// The triangle that it lies on, as an index into the list; `u32::MAX` for none.
    pub(super) own: u32,
}

/// Where a segment ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    /// From the start.
    pub(super) offset: DVec3,
    /// How exactly it is known, metres.
    pub(super) error: f64,
    /// The segment has no end; `offset` is its direction.
    pub(super) at_infinity: bool,
}

/// Slab test of boxes against a ray (Kay and Kajiya 1986), widened by its rounding (Ize 2013,
/// "Robust BVH Ray Traversal").
struct Slabs {
    origin: [f64; 3],
    inverse: [f64; 3],
}

impl Slabs {
    fn new(origin: DVec3, direction: DVec3) -> Self {
        // Kept finite: an infinity times the distance 0 of a box's side would be NaN.
        let inverse = |d: f64| {
            if d.abs() > 1.0e-200 {
                1.0 / d
            } else {
                1.0e200_f64.copysign(d)
            }
        };
        Self {
            origin: origin.to_array(),
            inverse: direction.to_array().map(inverse),
        }
    }

    /// Where the ray enters the box, if it does within `least` to `most`.
    #[inline]
    fn enter(&self, node: &Node, least: f64, most: f64) -> Option<f64> {
        let (mut enter, mut leave) = (least, most);
        for i in 0..3 {
            let a = (f64::from(node.min[i]) - self.origin[i]) * self.inverse[i];
            let b = (f64::from(node.max[i]) - self.origin[i]) * self.inverse[i];
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        let slack = 8.0 * ROUNDING;
        (enter * (1.0 - slack) <= leave * (1.0 + slack)).then_some(enter)
    }
}

/// The hierarchy and the order in which its leaves name the triangles.
fn build(list: &[Triangle]) -> (Vec<Node>, Vec<u32>) {
    if list.is_empty() {
        return Default::default();
    }
    let boxes: Vec<Box3> = (list.iter())
        .map(|triangle| {
            let corners = triangle.corners.map(Vec3A::from);
            Box3::from_points(&corners)
        })
        .collect();
    let bvh = build_bvh2(
        &boxes,
        BvhBuildParams::medium_build(),
        &mut Duration::default(),
    );
    let nodes = (bvh.nodes.iter())
        .map(|node| Node {
            min: node.aabb().min.to_array(),
            max: node.aabb().max.to_array(),
            first: node.first_index,
            count: node.prim_count,
        })
        .collect();
    (nodes, bvh.primitive_indices)
}
