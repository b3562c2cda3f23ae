//! Which triangles meet at which edges, as the device reads it.
//!
//! Corners at the same position are one point, so neither texture seams nor flat shading split an
//! edge. Faces are known by their opposite corners alone: winding does not matter, and an edge may
//! have one face (open), two, or more (non-manifold).
//!
//! A scene holds one moment: skins and morph targets are applied before. Where they move a primitive,
//! corners at the same place of its [`rest`](crate::scene::Primitive::rest) are one point instead: edges
//! are the same at every moment, whatever touches by chance and however weights are rounded. Only what
//! a pose tears apart is two points then.

use super::scene_layout::is_solid;
use crate::scene::{Primitive, Scene};
use glam::Vec3;
use std::collections::HashMap;

/// No second face: `NO_POINT` in `silhouettes/edges.glsl`.
pub(super) const NO_POINT: u32 = u32::MAX;
/// Marks the place of further faces: `MORE_FACES` in `silhouettes/edges.glsl`.
const MORE_FACES: u32 = 1 << 31;

/// What rounding of weights may part the corners of one point by, as a part of the scene's size.
const TORN: f32 = 1.0e-5;

/// Points and edges of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Adjacency {
    /// Position in scene space, metres; number of the connected part that it belongs to.
    pub points: Vec<[f32; 4]>,
    /// First [`edge_count`](Self::edge_count) edges: both ends, then the corners opposite of the
    /// edge in its faces. The last is [`NO_POINT`] for an open edge. For an edge of three or more
    /// faces it is [`MORE_FACES`] plus the place in this list of further texels: up to three
    /// corners, repeated to fill it, and twice their number plus 1 if another texel follows.
    pub edges: Vec<[u32; 4]>,
    /// Number of edges.
    pub edge_count: usize,
    /// Point of each position of each solid primitive, in their order; [`NO_POINT`] where no triangle
    /// uses it.
    point_of: Vec<u32>,
    /// Whether corners at one place of the rest pose are apart.
    is_torn: bool,
}

/// Where corners have to be to be one point: node that moves them plus 1, or 0 for the scene, and a
/// position.
type Place = (usize, [u32; 3]);

fn place_of(primitive: &Primitive, vertex: usize) -> Place {
    let (node, position) = match primitive.rest.get(vertex) {
        Some(rest) => (primitive.node.map_or(0, |node| node + 1), *rest),
        None => (0, primitive.positions[vertex]),
    };
    // Both zeros are one place.
    (node, (position + Vec3::ZERO).to_array().map(f32::to_bits))
}

fn solid_primitives(scene: &Scene) -> impl Iterator<Item = &Primitive> {
    let all = scene.primitives.iter();
    all.filter(|primitive| is_solid(scene, primitive))
}

/// Whether two moments of a scene have the same points and edges, if neither tears any apart.
pub(super) fn same_topology(a: &Scene, b: &Scene) -> bool {
    let alike = |a: &Primitive, b: &Primitive| {
        let still = a.rest.is_empty() && b.rest.is_empty();
        a.indices == b.indices
            && a.node == b.node
            && a.rest == b.rest
            && a.positions.len() == b.positions.len()
            && (!still || a.positions == b.positions)
    };
    let count = |scene: &Scene| solid_primitives(scene).count();
    count(a) == count(b)
        && solid_primitives(a)
            .zip(solid_primitives(b))
            .all(|(a, b)| alike(a, b))
}

impl Adjacency {
    /// Finds the edges of all triangles that block light as a whole: where a texture's alpha makes
    /// holes, the outline is the texture's.
    pub fn new(scene: &Scene) -> Self {
        let torn = torn_at(scene);
        // The first point at a place; those that a pose tears off it are few.
        let mut welded: HashMap<Place, u32> = HashMap::new();
        let mut torn_off: HashMap<Place, Vec<u32>> = HashMap::new();
        let mut positions: Vec<Vec3> = Vec::new();
        let mut point_of: Vec<u32> = Vec::new();
        let mut halves: Vec<(u64, u32)> = Vec::with_capacity(3 * scene.triangle_count());
        for primitive in solid_primitives(scene) {
            let first = point_of.len();
            point_of.resize(first + primitive.positions.len(), NO_POINT);
            let mut point = |index: &u32| {
                let vertex = *index as usize;
                if point_of[first + vertex] != NO_POINT {
                    return point_of[first + vertex];
                }
                let position = primitive.positions[vertex];
                let place = place_of(primitive, vertex);
                let next = positions.len() as u32;
                let mut found = *welded.entry(place).or_insert(next);
                let is_near = |point: u32| {
                    (positions.get(point as usize)).is_none_or(|p| p.distance(position) <= torn)
                };
                if !is_near(found) {
                    let others = torn_off.entry(place).or_default();
                    found = others.iter().copied().find(|p| is_near(*p)).unwrap_or(next);
                    if found == next {
                        others.push(next);
                    }
                }
                if found == next {
                    positions.push(position);
                }
                point_of[first + vertex] = found;
                found
            };
            for corners in primitive.indices.chunks_exact(3) {
                let [a, b, c] = [&corners[0], &corners[1], &corners[2]].map(&mut point);
                if a == b || b == c || c == a {
                    continue;
                }
                for (from, to, opposite) in [(a, b, c), (b, c, a), (c, a, b)] {
                    let key = u64::from(from.min(to)) << 32 | u64::from(from.max(to));
                    halves.push((key, opposite));
                }
            }
        }
        // Ordered by content: the same scene gives the same list.
        halves.sort_unstable();
        let parts = parts(positions.len(), &halves);
        let points = positions.iter().zip(parts);
        let mut found = Self {
            points: points
                .map(|(p, part)| p.extend(part as f32).to_array())
                .collect(),
            point_of,
            is_torn: !torn_off.is_empty(),
            ..Self::default()
        };
        let edges = || halves.chunk_by(|a, b| a.0 == b.0);
        found.edge_count = edges().count();
        found.edges.reserve(found.edge_count);
        let mut more: Vec<[u32; 4]> = Vec::new();
        for faces in edges() {
            let (key, first) = faces[0];
            let last = match &faces[1..] {
                [] => NO_POINT,
                [(_, second)] => *second,
                others => {
                    let place = found.edge_count + more.len();
                    let corners: Vec<u32> = others.iter().map(|(_, corner)| *corner).collect();
                    let texels = corners.chunks(3);
                    let count = texels.len();
                    more.extend(texels.enumerate().map(|(i, texel)| {
                        let at = |i: usize| texel[i.min(texel.len() - 1)];
                        let follows = u32::from(i + 1 < count);
                        [at(0), at(1), at(2), 2 * texel.len() as u32 + follows]
                    }));
                    MORE_FACES | place as u32
                }
            };
            found
                .edges
                .push([(key >> 32) as u32, key as u32, first, last]);
        }
        found.edges.extend(more);
        found
    }

    /// The same edges at another moment, of which [`same_topology`] holds; `None` where either moment
    /// tears points apart. Equal to [`new`](Self::new) of that moment.
    pub fn posed(mut self, scene: &Scene) -> Option<Self> {
        if self.is_torn {
            return None;
        }
        let torn = torn_at(scene);
        let mut is_placed = vec![false; self.points.len()];
        let positions = solid_primitives(scene).flat_map(|primitive| &primitive.positions);
        for (point, position) in self.point_of.iter().zip(positions) {
            let Some(known) = self.points.get_mut(*point as usize) else {
                continue;
            };
            let [x, y, z, part] = *known;
            let is_first = !std::mem::replace(&mut is_placed[*point as usize], true);
            if is_first {
                *known = position.extend(part).to_array();
            } else if Vec3::new(x, y, z).distance(*position) > torn {
                return None;
            }
        }
        Some(self)
    }
}

fn torn_at(scene: &Scene) -> f32 {
    TORN * scene.bounds.radius()
}

/// Number of the connected part of each point, in the order of first points.
fn parts(points: usize, halves: &[(u64, u32)]) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..points as u32).collect();
    fn root(parent: &mut [u32], mut of: u32) -> u32 {
        while parent[of as usize] != of {
            let above = parent[parent[of as usize] as usize];
            parent[of as usize] = above;
            of = above;
        }
        of
    }
    for (key, _) in halves {
        let a = root(&mut parent, (key >> 32) as u32);
        let b = root(&mut parent, *key as u32);
        parent[a.max(b) as usize] = a.min(b);
    }
    let mut names: Vec<u32> = vec![NO_POINT; points];
    let mut next = 0;
    (0..points as u32)
        .map(|point| {
            let root = root(&mut parent, point) as usize;
            if names[root] == NO_POINT {
                names[root] = next;
                next += 1;
            }
            names[root]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Material, Primitive};

    fn scene(primitives: Vec<Primitive>) -> Scene {
        Scene {
            primitives,
            materials: vec![Material::default()],
            ..Scene::default()
        }
    }

    fn mesh(positions: &[[f32; 3]], indices: &[u32]) -> Primitive {
        Primitive {
            normals: vec![Vec3::Y; positions.len()],
            positions: positions.iter().map(|p| Vec3::from(*p)).collect(),
            indices: indices.to_vec(),
            ..Primitive::default()
        }
    }

    const SQUARE: [[f32; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn a_seam_and_two_meshes_do_not_split_an_edge() {
        let [a, b, c, d] = SQUARE;
        let seam = mesh(&[a, b, c, [-0.0, 0.0, 0.0], c, d], &[0, 1, 2, 3, 4, 5]);
        let apart = vec![mesh(&[a, b, c], &[0, 1, 2]), mesh(&[c, d, a], &[0, 1, 2])];
        for scene in [scene(vec![seam]), scene(apart)] {
            let found = Adjacency::new(&scene);
            assert_eq!((found.points.len(), found.edge_count), (4, 5));
            let inner = found.edges.iter().filter(|e| e[3] != NO_POINT);
            assert_eq!(inner.copied().collect::<Vec<_>>(), [[0, 2, 1, 3]]);
            assert!(found.points.iter().all(|p| p[3] == 0.0));
        }
    }

    /// A square of two triangles that share no vertices, at rest and in a pose; the second triangle is
    /// `apart` farther up than the first.
    fn posed_square(lift: f32, apart: f32) -> Scene {
        let [a, b, c, d] = SQUARE;
        let mut square = mesh(&[a, b, c, c, d, a], &[0, 1, 2, 3, 4, 5]);
        square.rest = square.positions.clone();
        square.node = Some(3);
        for (vertex, position) in square.positions.iter_mut().enumerate() {
            position.z += lift * position.x + if vertex < 3 { 0.0 } else { apart };
        }
        // Touches a corner of the square in one pose only.
        let other = mesh(
            &[[1.0, 0.0, 0.5], [3.0, 0.0, 0.5], [3.0, 1.0, 0.5]],
            &[0, 1, 2],
        );
        let mut scene = scene(vec![square, other]);
        scene.finish().unwrap();
        scene
    }

    #[test]
    fn a_pose_changes_no_edges() {
        let rest = Adjacency::new(&posed_square(0.0, 0.0));
        assert_eq!((rest.points.len(), rest.edge_count), (7, 8));
        for (lift, apart) in [(0.5, 0.0), (0.25, 1.0e-6)] {
            let scene = posed_square(lift, apart);
            assert!(same_topology(&posed_square(0.0, 0.0), &scene));
            let anew = Adjacency::new(&scene);
            assert_eq!(anew.edges, rest.edges);
            assert_ne!(anew.points, rest.points);
            assert_eq!(rest.clone().posed(&scene), Some(anew));
        }
        // Welded by positions alone the pose would join what only touches.
        let mut touching = posed_square(0.5, 0.0);
        touching.primitives[0].rest.clear();
        assert_eq!(Adjacency::new(&touching).points.len(), 6);
    }

    #[test]
    fn what_a_pose_tears_apart_is_open() {
        let rest = Adjacency::new(&posed_square(0.0, 0.0));
        let torn = posed_square(0.0, 0.1);
        let anew = Adjacency::new(&torn);
        assert_eq!((anew.points.len(), anew.edge_count), (9, 9));
        assert_eq!(rest.posed(&torn), None);
        assert_eq!(anew.posed(&posed_square(0.0, 0.0)), None);
        assert!(!same_topology(
            &torn,
            &scene(vec![mesh(&SQUARE, &[0, 1, 2])])
        ));
    }

    #[test]
    fn edges_of_many_faces_keep_them_all() {
        let mut positions = vec![[0.0; 3], [0.0, 0.0, 1.0]];
        let mut indices = Vec::new();
        for face in 0..6u32 {
            let (y, x) = (face as f32).sin_cos();
            positions.push([x, y, 0.0]);
            // Either winding.
            indices.extend([face % 2, 1 - face % 2, 2 + face]);
        }
        let far = mesh(&[[9.0; 3], [8.0, 9.0, 9.0], [9.0, 8.0, 9.0]], &[0, 1, 2]);
        let found = Adjacency::new(&scene(vec![mesh(&positions, &indices), far]));
        assert_eq!(found.edge_count, 13 + 3);
        let [a, b, first, last] = found.edges[0];
        assert_eq!((a, b, first), (0, 1, 2));
        assert_eq!(last, MORE_FACES | 16);
        assert_eq!(found.edges[16..], [[3, 4, 5, 7], [6, 7, 7, 4]]);
        assert_eq!(found.points[8][3], 1.0, "another part");
    }

    #[test]
    fn triangles_without_three_corners_and_cut_out_ones_have_no_edges() {
        let mut holes = scene(vec![
            mesh(&SQUARE, &[0, 1, 1, 0, 1, 2]),
            mesh(&SQUARE, &[0, 2, 3]),
        ]);
        holes.primitives[1].material = 1;
        holes.materials.push(Material {
            alpha_mode: crate::scene::AlphaMode::Mask { cutoff: 0.5 },
            base_color: glam::Vec4::ZERO,
            ..Material::default()
        });
        assert_eq!(Adjacency::new(&holes).edge_count, 3);
        // A texture with holes.
        holes.primitives[1].uvs = vec![glam::Vec2::ZERO; 4];
        holes.materials[1].base_color = glam::Vec4::ONE;
        holes.materials[1].base_texture = Some(crate::scene::Texture {
            image: 0,
            wrap: [crate::scene::Wrap::Clamp; 2],
        });
        assert_eq!(Adjacency::new(&holes).edge_count, 3);
        holes.materials[1].alpha_mode = crate::scene::AlphaMode::Opaque;
        assert_eq!(Adjacency::new(&holes).edge_count, 5);
    }
}
