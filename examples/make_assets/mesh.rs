//! Triangles under construction.

use super::math::{Quat, V3, add, cross, scale, sub, unit};

/// Triangles with one normal a vertex, and perhaps a place in a texture.
#[derive(Clone, Default)]
pub struct Mesh {
    pub positions: Vec<V3>,
    pub normals: Vec<V3>,
    /// Empty, or one a vertex.
    pub uvs: Vec<[f64; 2]>,
    pub indices: Vec<u32>,
}

impl Mesh {
    /// A convex polygon, counter-clockwise from the front, with a normal for each corner.
    pub fn polygon(&mut self, corners: &[(V3, V3)]) {
        let first = self.positions.len() as u32;
        for (position, normal) in corners {
            self.positions.push(*position);
            self.normals.push(*normal);
        }
        for i in 2..corners.len() as u32 {
            self.indices.extend([first, first + i - 1, first + i]);
        }
    }

    pub fn flat(&mut self, normal: V3, corners: &[V3]) {
        let corners: Vec<_> = corners.iter().map(|corner| (*corner, normal)).collect();
        self.polygon(&corners);
    }

    /// A flat polygon; its corners give the normal.
    pub fn facet(&mut self, corners: &[V3]) {
        let edge = |i: usize| sub(corners[i], corners[0]);
        let normal = (2..corners.len())
            .map(|i| cross(edge(i - 1), edge(i)))
            .fold([0.0; 3], add);
        self.flat(unit(normal), corners);
    }

    /// A flat polygon of which each corner has its place in a texture.
    pub fn textured(&mut self, normal: V3, corners: &[(V3, [f64; 2])]) {
        let places: Vec<_> = corners.iter().map(|corner| corner.0).collect();
        self.flat(normal, &places);
        self.uvs.extend(corners.iter().map(|corner| corner.1));
    }

    pub fn append(&mut self, other: &Self) {
        let first = self.positions.len() as u32;
        self.positions.extend(&other.positions);
        self.normals.extend(&other.normals);
        self.uvs.extend(&other.uvs);
        self.indices.extend(other.indices.iter().map(|i| first + i));
    }

    /// The meshes in one.
    pub fn joined(parts: impl IntoIterator<Item = Self>) -> Self {
        let mut all = Self::default();
        for part in parts {
            all.append(&part);
        }
        all
    }

    fn map(&self, position: impl Fn(V3) -> V3, normal: impl Fn(V3) -> V3) -> Self {
        Self {
            positions: self.positions.iter().map(|p| position(*p)).collect(),
            normals: self.normals.iter().map(|n| normal(*n)).collect(),
            uvs: self.uvs.clone(),
            indices: self.indices.clone(),
        }
    }

    pub fn moved(&self, by: V3) -> Self {
        self.map(|p| add(p, by), |n| n)
    }

    pub fn scaled(&self, by: f64) -> Self {
        self.map(|p| p.map(|x| x * by), |n| n)
    }

    /// Turned about +Y.
    pub fn turned(&self, angle: f64) -> Self {
        let (s, c) = angle.sin_cos();
        let turn = |[x, y, z]: V3| [c * x + s * z, y, c * z - s * x];
        self.map(turn, turn)
    }

    /// Turned about +Z.
    pub fn tilted(&self, angle: f64) -> Self {
        let (s, c) = angle.sin_cos();
        let turn = |[x, y, z]: V3| [c * x - s * y, s * x + c * y, z];
        self.map(turn, turn)
    }

    /// Turned about +X.
    pub fn pitched(&self, angle: f64) -> Self {
        let (s, c) = angle.sin_cos();
        let turn = |[x, y, z]: V3| [x, c * y - s * z, s * y + c * z];
        self.map(turn, turn)
    }

    pub fn rotated(&self, by: Quat) -> Self {
        let axis = [by[0], by[1], by[2]];
        let turn = |v: V3| {
            let t = scale(cross(axis, v), 2.0);
            add(add(v, scale(t, by[3])), cross(axis, t))
        };
        self.map(turn, turn)
    }

    /// The other side out.
    pub fn inside_out(&self) -> Self {
        let mut mesh = self.map(|p| p, |n| n.map(|x| -x));
        for triangle in mesh.indices.chunks_exact_mut(3) {
            triangle.swap(1, 2);
        }
        mesh
    }

    /// Without normals, which the reader then makes from the triangles.
    pub fn without_normals(&self) -> Self {
        Self {
            normals: Vec::new(),
            ..self.clone()
        }
    }
}
