//! A scene laid out for the device, before it is there.

use super::cover::Cover;
use super::footprints::footprints;
use super::scene_buffers::Draw;
use super::tight_box::tight_box;
use crate::scene::{Aabb, Material, Primitive, Scene, Texture, Wrap};
use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};
use std::collections::BTreeSet;

/// Width in texels of the images that hold the scene: `TRIANGLE_IMAGE_WIDTH` in
/// `common/triangles.glsl`.
pub(super) const IMAGE_WIDTH: usize = 4096;

/// Texels of a material: `MATERIAL_TEXELS` in `common/materials.glsl`.
const MATERIAL_TEXELS: usize = 4;

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
    /// Texture coordinates of the vertices of masked primitives, which come first.
    pub mask_uvs: Vec<[f32; 2]>,
    /// Three for each triangle with area.
    pub indices: Vec<u32>,
    /// Four texels for each triangle: `common/triangles.glsl`.
    pub triangles: Vec<[f32; 4]>,
    /// Two texels for each triangle with a texture; these come before all others.
    pub triangle_uvs: Vec<[f32; 4]>,
    /// Four texels for each material: `common/materials.glsl`.
    pub materials: Vec<[f32; 4]>,
    /// Texels of all textures, rows of [`IMAGE_WIDTH`].
    pub texels: Vec<[u8; 4]>,
    /// Of all textures that cut holes, rows of [`IMAGE_WIDTH`]: `common/holes.glsl`.
    pub footprints: Vec<[u8; 4]>,
    /// Neighbouring triangles of one primitive, with the box around them.
    pub draws: Vec<Draw>,
    /// The largest flat parts that hide what is behind them.
    pub covers: Vec<Cover>,
    /// Triangles that no ray meets and no pixel shows: without area, or cut out as a whole.
    pub degenerate: usize,
    scene_radius: f32,
}

/// Chunks that the triangles of a scene are cut into, at least: few enough to test each against
/// every view, and enough that a box around a chunk says where its triangles are.
const CHUNKS: usize = 512;
/// Fewest triangles of a chunk.
const LEAST_IN_CHUNK: usize = 4;
/// Flat parts that are kept to look for what they hide: each is compared with all boxes.
const MOST_COVERS: usize = 8;
/// Part of the scene's size from which on a chunk is looked at for being mostly empty.
const LARGE: f32 = 0.1;

/// How a primitive uses its texture: the order of primitives on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    /// Holes where its alpha says so.
    Masked,
    /// Solid, with a texture.
    Textured,
    /// Solid, one colour.
    Plain,
}

impl Layout {
    /// Lays out a scene.
    pub fn new(scene: &Scene) -> Self {
        let mut layout = Self {
            scene_radius: scene.bounds.radius(),
            ..Self::default()
        };
        let rows = layout.add_textures(scene);
        let hole_rows = layout.add_footprints(scene);
        layout.materials = materials(scene, &rows, &hole_rows);
        let chunk = (scene.triangle_count() / CHUNKS).max(LEAST_IN_CHUNK);
        for kind in [Kind::Masked, Kind::Textured, Kind::Plain] {
            for primitive in &scene.primitives {
                match kind_of(scene, primitive) {
                    Some(found) if found == kind => layout.add(primitive, kind, chunk),
                    None if kind == Kind::Plain => layout.degenerate += primitive.triangle_count(),
                    _ => {}
                }
            }
        }
        layout.covers.sort_by(|a, b| b.area().total_cmp(&a.area()));
        layout.covers.truncate(MOST_COVERS);
        layout
    }

    /// Adds all images; returns each one's first row.
    fn add_textures(&mut self, scene: &Scene) -> Vec<usize> {
        let used = |image: usize| {
            let uses = |m: &Material| m.base_texture.is_some_and(|t| t.image == image);
            scene.materials.iter().any(uses)
        };
        let images = scene.images.iter().enumerate();
        images
            .map(|(index, image)| {
                let row = self.texels.len() / IMAGE_WIDTH;
                if used(index) {
                    self.texels.extend(&image.texels);
                    let rows = self.texels.len().div_ceil(IMAGE_WIDTH);
                    self.texels.resize(rows * IMAGE_WIDTH, [0; 4]);
                }
                row
            })
            .collect()
    }

    /// Adds the footprints of all textures that cut holes, once for each way that they are
    /// repeated; returns each material's first row, 0 for those without holes.
    fn add_footprints(&mut self, scene: &Scene) -> Vec<usize> {
        let masked = |primitive: &&Primitive| kind_of(scene, primitive) == Some(Kind::Masked);
        let masked = scene.primitives.iter().filter(masked);
        let masked: BTreeSet<usize> = masked.map(|primitive| primitive.material).collect();
        let mut rows = vec![0; scene.materials.len()];
        let mut known: Vec<(Texture, usize)> = Vec::new();
        for material in masked {
            let Some(texture) = scene.materials[material].base_texture else {
                continue;
            };
            let found = known.iter().find(|(known, _)| *known == texture);
            rows[material] = found.map_or(self.footprints.len() / IMAGE_WIDTH, |(_, row)| *row);
            if found.is_none() {
                let image = &scene.images[texture.image];
                self.footprints.extend(footprints(image, texture.wrap));
                let rows_now = self.footprints.len().div_ceil(IMAGE_WIDTH);
                self.footprints.resize(rows_now * IMAGE_WIDTH, [0; 4]);
                known.push((texture, rows[material]));
            }
        }
        rows
    }

    fn add(&mut self, primitive: &Primitive, kind: Kind, chunk: usize) {
        let first_vertex = self.vertices.len();
        let vertex = |position: &Vec3| Vertex {
            position: position.to_array(),
            triangle: u32::MAX,
        };
        self.vertices.extend(primitive.positions.iter().map(vertex));
        let uv = |corner: usize| primitive.uvs.get(corner).map_or([0.0; 2], Vec2::to_array);
        if kind == Kind::Masked {
            let uvs = (0..primitive.positions.len()).map(uv);
            self.mask_uvs.extend(uvs);
        }
        let mut triangles: Vec<[usize; 3]> = Vec::with_capacity(primitive.triangle_count());
        for corners in primitive.indices.chunks_exact(3) {
            let corners = [corners[0], corners[1], corners[2]].map(|corner| corner as usize);
            let points = corners.map(|corner| primitive.positions[corner]);
            if unit_normal(points).is_some() {
                triangles.push(corners);
            } else {
                self.degenerate += 1;
            }
        }
        if triangles.len() > chunk {
            sort_by_place(&mut triangles, &primitive.positions);
        }
        let mut rest = triangles.as_slice();
        while !rest.is_empty() {
            let count = self.chunk_length(rest, &primitive.positions, chunk);
            let (now, later) = rest.split_at(count);
            self.add_chunk(primitive, kind, first_vertex, now);
            rest = later;
        }
    }

    /// How many of the triangles make the next chunk: at most `most`, and fewer where a box around
    /// them would be mostly empty, as one around two walls of a room.
    fn chunk_length(&self, triangles: &[[usize; 3]], positions: &[Vec3], most: usize) -> usize {
        let box_of = |corners: &[usize; 3]| {
            let mut bounds = Aabb::EMPTY;
            corners.iter().for_each(|c| bounds.insert(positions[*c]));
            bounds
        };
        let mut bounds = Aabb::EMPTY;
        for (count, corners) in triangles.iter().take(most).enumerate() {
            let next = box_of(corners);
            let mut both = bounds;
            both.insert(next.min);
            both.insert(next.max);
            let is_large = both.radius() > LARGE * self.scene_radius;
            let filled = half_area(&bounds) + half_area(&next);
            if count > 0 && is_large && half_area(&both) > 1.5 * filled {
                return count;
            }
            bounds = both;
        }
        most.min(triangles.len())
    }

    /// Adds neighbouring triangles, which one box bounds.
    fn add_chunk(
        &mut self,
        primitive: &Primitive,
        kind: Kind,
        first_vertex: usize,
        triangles: &[[usize; 3]],
    ) {
        let uv = |corner: usize| primitive.uvs.get(corner).map_or([0.0; 2], Vec2::to_array);
        let first_index = self.indices.len();
        let mut bounds = Aabb::EMPTY;
        let mut drawn = Vec::with_capacity(triangles.len());
        for corners in triangles {
            let points = corners.map(|corner| primitive.positions[corner]);
            let Some(normal) = unit_normal(points) else {
                continue;
            };
            points.iter().for_each(|point| bounds.insert(*point));
            drawn.push(points);
            let triangle = (self.indices.len() / 3) as u32;
            let indices = self.own_first_vertex(first_vertex, *corners, points[0], triangle);
            if self.mask_uvs.len() < self.vertices.len() && kind == Kind::Masked {
                self.mask_uvs.push(uv(corners[0]));
            }
            self.indices.extend(indices);
            for (corner, point) in corners.iter().zip(points) {
                let normal = pack_corner_normal(primitive.normals[*corner]);
                self.triangles.push(point.extend(normal).to_array());
            }
            let material = match kind {
                Kind::Masked => -1.0 - primitive.material as f32,
                Kind::Textured | Kind::Plain => primitive.material as f32,
            };
            self.triangles.push(normal.extend(material).to_array());
            if kind != Kind::Plain {
                let [[au, av], [bu, bv], [cu, cv]] = corners.map(uv);
                self.triangle_uvs.push([au, av, bu, bv]);
                self.triangle_uvs.push([cu, cv, 0.0, 0.0]);
            }
        }
        if kind != Kind::Masked {
            self.covers.extend(Cover::of(&drawn));
        }
        self.draws.push(Draw {
            first_index: first_index as u32,
            index_count: (self.indices.len() - first_index) as u32,
            bounds,
            corners: tight_box(&drawn),
            mask: (kind == Kind::Masked).then_some(primitive.material as u32),
        });
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

/// Half the surface of a box; 0 without points.
fn half_area(bounds: &Aabb) -> f32 {
    if bounds.is_empty() {
        return 0.0;
    }
    let size = bounds.max - bounds.min;
    size.x * size.y + size.y * size.z + size.z * size.x
}

/// How a primitive uses its texture; `None` where alpha cuts out all of it.
fn kind_of(scene: &Scene, primitive: &Primitive) -> Option<Kind> {
    let material = &scene.materials[primitive.material];
    let textured = material.base_texture.is_some() && !primitive.uvs.is_empty();
    match material.mask_cutoff() {
        Some(cutoff) if material.base_color.w < cutoff => None,
        Some(cutoff) if textured && cutoff > 0.0 => Some(Kind::Masked),
        _ if textured => Some(Kind::Textured),
        _ => Some(Kind::Plain),
    }
}

/// Whether a primitive's outline is that of its triangles: not where alpha cuts out all or parts of
/// it.
pub(super) fn is_solid(scene: &Scene, primitive: &Primitive) -> bool {
    !matches!(kind_of(scene, primitive), None | Some(Kind::Masked))
}

/// Width and height in texels of an image of `IMAGE_WIDTH` that holds a number of things.
pub fn image_place(count: usize) -> [u32; 2] {
    [
        IMAGE_WIDTH as u32,
        count.div_ceil(IMAGE_WIDTH).max(1) as u32,
    ]
}

/// The texels of all materials: `common/materials.glsl`.
fn materials(scene: &Scene, rows: &[usize], hole_rows: &[usize]) -> Vec<[f32; 4]> {
    let materials = scene.materials.iter().zip(hole_rows);
    let texels = materials.flat_map(|(material, hole_row)| {
        let texture = material.base_texture.and_then(|texture| {
            let image = scene.images.get(texture.image)?;
            let [u, v] = texture.wrap.map(|wrap| match wrap {
                Wrap::Repeat => 0.0,
                Wrap::Mirror => 1.0,
                Wrap::Clamp => 2.0,
            });
            let row = *rows.get(texture.image)? as f32;
            Some([row, image.width as f32, image.height as f32, u + 3.0 * v])
        });
        let emissive = material.emissive;
        [
            material.base_color.to_array(),
            texture.unwrap_or_default(),
            [
                material.roughness,
                material.metallic,
                material.mask_cutoff().unwrap_or(0.0),
                *hole_row as f32,
            ],
            emissive.extend(0.0).to_array(),
        ]
    });
    let texels: Vec<_> = texels.collect();
    assert!(
        texels.len() == MATERIAL_TEXELS * scene.materials.len(),
        "every material has as many texels as the shaders expect"
    );
    texels
}

/// Brings triangles that are near each other together, along a Z-order curve through the middles
/// of their boxes.
fn sort_by_place(triangles: &mut [[usize; 3]], positions: &[Vec3]) {
    let middle = |corners: &[usize; 3]| {
        let [a, b, c] = corners.map(|corner| positions[corner]);
        0.5 * (a.min(b).min(c) + a.max(b).max(c))
    };
    let mut bounds = Aabb::EMPTY;
    for triangle in triangles.iter() {
        bounds.insert(middle(triangle));
    }
    // The same step along all axes: a flat scene is not cut across its thickness.
    let size = (bounds.max - bounds.min).max_element();
    let scale = 2047.0 / size.max(f32::MIN_POSITIVE);
    triangles.sort_by_cached_key(|triangle| {
        let cell = (middle(triangle) - bounds.min) * scale;
        let [x, y, z] = cell.to_array().map(|v| spread(v as u64));
        x | y << 1 | z << 2
    });
}

/// Puts two zeros between the lowest 11 bits of a number.
fn spread(v: u64) -> u64 {
    (0..11).fold(0, |bits, i| bits | (v >> i & 1) << (3 * i))
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
        // Each triangle once, its corners in the same sense of rotation.
        let turned = |mut points: [[f32; 3]; 3]| {
            let least = (0..3).min_by(|a, b| points[*a].partial_cmp(&points[*b]).unwrap());
            points.rotate_left(least.unwrap());
            points.map(|point| point.map(f32::to_bits))
        };
        let mut found = Vec::new();
        for (number, triangle) in layout.indices.chunks_exact(3).enumerate() {
            let first = layout.vertices[triangle[0] as usize];
            assert_eq!(first.triangle, number as u32);
            let points = [0, 1, 2].map(|i| layout.vertices[triangle[i] as usize].position);
            found.push(turned(points));
        }
        let wanted = original.chunks_exact(3).filter(|t| t[0] != t[1]);
        let points = |t: &[u32]| [0, 1, 2].map(|i| positions[t[i] as usize].to_array());
        let mut wanted: Vec<_> = wanted.map(|t| turned(points(t))).collect();
        found.sort_unstable();
        wanted.sort_unstable();
        assert_eq!(found, wanted);
    }

    #[test]
    fn chunks_hold_neighbours() {
        let scene = Scene {
            primitives: vec![grid(64)],
            materials: vec![Material::default()],
            ..Scene::default()
        };
        let layout = Layout::new(&scene);
        let chunk = 64 * 64 * 2 / CHUNKS;
        assert_eq!(layout.draws.len(), 64 * 64 * 2 / chunk);
        for draw in &layout.draws {
            let size = draw.bounds.max - draw.bounds.min;
            assert!(size.max_element() <= 8.0, "{size}");
        }
    }

    #[test]
    fn masked_triangles_come_first_with_their_texture() {
        let image = crate::scene::TextureImage {
            name: String::new(),
            width: 3,
            height: 2,
            texels: vec![[9; 4]; 6],
        };
        let texture = crate::scene::Texture {
            image: 1,
            wrap: [Wrap::Mirror, Wrap::Clamp],
        };
        let masked = |cutoff: f32, alpha: f32| Material {
            base_texture: Some(texture),
            alpha_mode: crate::scene::AlphaMode::Mask { cutoff },
            base_color: glam::Vec4::new(1.0, 1.0, 1.0, alpha),
            ..Material::default()
        };
        let quad = |material: usize| Primitive {
            material,
            uvs: grid(1)
                .positions
                .iter()
                .map(|p| Vec2::new(p.x, p.z))
                .collect(),
            ..grid(1)
        };
        let scene = Scene {
            primitives: vec![quad(0), quad(1), quad(2), quad(3)],
            materials: vec![
                Material::default(),
                masked(0.5, 1.0),
                Material {
                    base_texture: Some(texture),
                    ..Material::default()
                },
                masked(0.5, 0.25),
            ],
            images: vec![image.clone(), image],
            ..Scene::default()
        };
        let layout = Layout::new(&scene);
        assert_eq!(layout.degenerate, 2, "what alpha cuts out as a whole");
        let stored: Vec<f32> = layout
            .triangles
            .iter()
            .skip(3)
            .step_by(4)
            .map(|t| t[3])
            .collect();
        assert_eq!(stored, [-2.0, -2.0, 2.0, 2.0, 0.0, 0.0]);
        assert_eq!(layout.triangle_uvs.len(), 8);
        assert_eq!(layout.mask_uvs.len(), 4);
        assert_eq!(layout.draws[0].mask, Some(1));
        assert_eq!(layout.draws[1].mask, None);
        // The unused image takes no room.
        assert_eq!(layout.texels.len(), IMAGE_WIDTH);
        assert_eq!(layout.materials[5], [0.0, 3.0, 2.0, 1.0 + 3.0 * 2.0]);
        // Mirrored they are twice as many across, clamped one more down: once for all materials.
        assert_eq!(layout.footprints.len(), IMAGE_WIDTH);
        assert_eq!(layout.footprints[17], [9; 4]);
        assert_eq!(layout.footprints[18], [0; 4]);
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
