//! A scene laid out for the device, before it is there.

use super::scene_buffers::Draw;
use crate::scene::{Aabb, Primitive, Scene};
use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

/// A vertex of `raster/ids.vert`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct Vertex {
    /// Scene space, metres.
    pub position: [f32; 3],
    /// The triangle whose first vertex this is; of no meaning in other places.
    pub triangle: u32,
}

/// Everything of a scene that the device gets.
#[derive(Debug, Default)]
pub(super) struct Layout {
    /// Vertices, with the copies that give every triangle a first vertex of its own.
    pub vertices: Vec<Vertex>,
    /// Three for each triangle with area.
    pub indices: Vec<u32>,
    /// Four texels for each triangle: `common/triangles.glsl`.
    pub triangles: Vec<[f32; 4]>,
    /// Linear base colours.
    pub materials: Vec<[f32; 4]>,
    /// One for each primitive with triangles.
    pub draws: Vec<Draw>,
    /// Triangles without area, which no ray meets and no pixel shows.
    pub degenerate: usize,
}

impl Layout {
    /// Lays out a scene.
    pub fn new(scene: &Scene) -> Self {
        let mut layout = Self::default();
        for primitive in &scene.primitives {
            layout.add(primitive);
        }
        layout.materials = scene
            .materials
            .iter()
            .map(|material| material.base_color.to_array())
            .collect();
        layout
    }

    fn add(&mut self, primitive: &Primitive) {
        let first_vertex = self.vertices.len();
        let first_index = self.indices.len();
        let vertex = |position: &Vec3| Vertex {
            position: position.to_array(),
            triangle: u32::MAX,
        };
        self.vertices.extend(primitive.positions.iter().map(vertex));
        let mut bounds = Aabb::EMPTY;
        for corners in primitive.indices.chunks_exact(3) {
            let corners = [corners[0], corners[1], corners[2]].map(|corner| corner as usize);
            let points = corners.map(|corner| primitive.positions[corner]);
            let Some(normal) = unit_normal(points) else {
                self.degenerate += 1;
                continue;
            };
            points.iter().for_each(|point| bounds.insert(*point));
            let triangle = (self.indices.len() / 3) as u32;
            let indices = self.own_first_vertex(first_vertex, corners, points[0], triangle);
            self.indices.extend(indices);
            for (corner, point) in corners.iter().zip(points) {
                let normal = pack_corner_normal(primitive.normals[*corner]);
                self.triangles.push(point.extend(normal).to_array());
            }
            let material = primitive.material as f32;
            self.triangles.push(normal.extend(material).to_array());
        }
        let index_count = (self.indices.len() - first_index) as u32;
        if index_count > 0 {
            self.draws.push(Draw {
                first_index: first_index as u32,
                index_count,
                bounds,
            });
        }
    }

    /// Indices of a triangle, turned so that its first vertex is no other triangle's first vertex:
    /// flat outputs take their value from there. Adds a vertex where all three are taken, so a
    /// mesh ends up with about as many vertices as triangles instead of three times as many.
    fn own_first_vertex(
        &mut self,
        base: usize,
        corners: [usize; 3],
        point: Vec3,
        triangle: u32,
    ) -> [u32; 3] {
        for turn in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|i| base + corners[(i + turn) % 3]);
            if self.vertices[a].triangle == u32::MAX {
                self.vertices[a].triangle = triangle;
                return [a, b, c].map(|vertex| vertex as u32);
            }
        }
        self.vertices.push(Vertex {
            position: point.to_array(),
            triangle,
        });
        [
            self.vertices.len() - 1,
            base + corners[1],
            base + corners[2],
        ]
        .map(|v| v as u32)
    }
}

/// Unit normal of a triangle on its counter-clockwise side; `None` without area.
fn unit_normal([a, b, c]: [Vec3; 3]) -> Option<Vec3> {
    let [a, b, c] = [a, b, c].map(|point| point.as_dvec3());
    let normal = (b - a).cross(c - a);
    // In f64, products of f32 differences cannot underflow to nothing unless there is no area.
    normal.try_normalize().map(|normal| normal.as_vec3())
}

/// Twin of `unpack_corner_normal` in `common/triangles.glsl`.
fn pack_corner_normal(normal: Vec3) -> f32 {
    let sum = normal.x.abs() + normal.y.abs() + normal.z.abs();
    let mut p = Vec2::new(normal.x, normal.y) / sum.max(f32::MIN_POSITIVE);
    if normal.z < 0.0 {
        let sign = |v: f32| if v >= 0.0 { 1.0 } else { -1.0 };
        p = Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y));
    }
    let cell = |v: f32| ((v + 1.0) * 2047.5).round().clamp(0.0, 4095.0);
    cell(p.x) + 4096.0 * cell(p.y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Material;

    fn grid(n: u32) -> Primitive {
        let positions: Vec<Vec3> = (0..=n)
            .flat_map(|y| (0..=n).map(move |x| Vec3::new(x as f32, 0.0, y as f32)))
            .collect();
        let corner = |x: u32, y: u32| y * (n + 1) + x;
        let quads = (0..n).flat_map(|y| (0..n).map(move |x| (x, y)));
        let indices = quads.flat_map(|(x, y)| {
            let [a, b] = [corner(x, y), corner(x + 1, y)];
            let [c, d] = [corner(x, y + 1), corner(x + 1, y + 1)];
            [a, c, b, b, c, d]
        });
        Primitive {
            normals: vec![Vec3::Y; positions.len()],
            indices: indices.collect(),
            positions,
            ..Primitive::default()
        }
    }

    #[test]
    fn every_triangle_has_a_first_vertex_of_its_own() {
        let mut primitive = grid(20);
        primitive.indices.extend([3, 3, 7]);
        let positions = primitive.positions.clone();
        let original = primitive.indices.clone();
        let scene = Scene {
            primitives: vec![primitive],
            materials: vec![Material::default()],
            ..Scene::default()
        };
        let layout = Layout::new(&scene);
        assert_eq!(layout.degenerate, 1);
        assert_eq!(layout.indices.len(), 2400);
        assert!(
            layout.vertices.len() < 2 * positions.len(),
            "few vertices are added"
        );
        for (number, triangle) in layout.indices.chunks_exact(3).enumerate() {
            assert_eq!(
                layout.vertices[triangle[0] as usize].triangle,
                number as u32
            );
            // The same corners in the same sense of rotation.
            let points = [0, 1, 2].map(|i| layout.vertices[triangle[i] as usize].position);
            let wanted = [0, 1, 2].map(|i| positions[original[3 * number + i] as usize].to_array());
            let turned = (0..3).any(|turn| (0..3).all(|i| points[i] == wanted[(i + turn) % 3]));
            assert!(turned);
        }
    }

    #[test]
    fn corner_normals_are_whole_numbers_that_floats_hold() {
        for normal in [Vec3::X, Vec3::NEG_Z, Vec3::new(0.6, -0.48, -0.64)] {
            let packed = pack_corner_normal(normal);
            assert_eq!(packed, packed.floor());
            assert!(packed < 16_777_216.0);
        }
    }
}
