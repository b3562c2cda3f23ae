//! Closed meshes of distance fields.
//!
//! One vertex in each cell of a grid that the surface crosses, one quad around each edge of the
//! grid that it crosses (S. Gibson: Constrained Elastic Surface Nets. MICCAI 1998), so that all
//! triangles are about equally large.

use std::collections::HashMap;

use super::field::Field;
use super::math::{V3, add, length, scale, sub};
use super::mesh::Mesh;

/// A cube of space that holds the solid with a margin.
#[derive(Clone, Copy)]
pub struct Room {
    pub low: V3,
    pub side: f64,
}

/// A mesh of about so many triangles: within 3 % from some thousand on.
pub fn mesh_of(field: &Field, room: Room, triangles: usize) -> Mesh {
    let mut cells = 48;
    let mut net = Net::new(field, room, cells);
    // The number of triangles goes with the square of the cells.
    for _ in 0..3 {
        let wanted = f64::from(cells) * (triangles as f64 / net.triangles() as f64).sqrt();
        let wanted = wanted.round().max(8.0) as u32;
        if wanted == cells {
            break;
        }
        cells = wanted;
        net = Net::new(field, room, cells);
    }
    net.mesh()
}

type Place = [u32; 3];

struct Net<'a> {
    field: &'a Field,
    room: Room,
    cells: u32,
    /// Cells that the surface crosses, in order, and which of their corners are inside.
    crossed: Vec<(Place, u8)>,
    numbers: HashMap<Place, u32>,
}

impl<'a> Net<'a> {
    fn new(field: &'a Field, room: Room, cells: u32) -> Self {
        let mut net = Self {
            field,
            room,
            cells,
            crossed: Vec::new(),
            numbers: HashMap::new(),
        };
        net.look_into([0; 3], cells.next_power_of_two());
        let numbered = net.crossed.iter().zip(0..);
        net.numbers = numbered.map(|((place, _), i)| (*place, i)).collect();
        net
    }

    fn step(&self) -> f64 {
        self.room.side / f64::from(self.cells)
    }

    fn corner(&self, place: Place) -> V3 {
        add(self.room.low, place.map(|i| f64::from(i) * self.step()))
    }

    /// Finds the crossed cells of a block of `side` cells.
    fn look_into(&mut self, place: Place, side: u32) {
        if place.iter().any(|i| *i >= self.cells) {
            return;
        }
        let half = 0.5 * f64::from(side) * self.step();
        let middle = add(self.corner(place), [half; 3]);
        // From the middle, no corner is farther than this.
        if self.field.at(middle).abs() > 1.74 * half {
            return;
        }
        if side == 1 {
            let inside = |corner: u32| {
                let at = [0, 1, 2].map(|axis| place[axis] + (corner >> axis & 1));
                u8::from(self.field.at(self.corner(at)) < 0.0) << corner
            };
            let mask = (0..8).map(inside).fold(0, |a, b| a | b);
            if mask != 0 && mask != 0xff {
                self.crossed.push((place, mask));
            }
            return;
        }
        for corner in 0..8u32 {
            let at = [0, 1, 2].map(|axis| place[axis] + (corner >> axis & 1) * (side / 2));
            self.look_into(at, side / 2);
        }
    }

    /// Crossed edges from the low corner of each cell: axis, and whether the corner is inside.
    fn edges(mask: u8) -> impl Iterator<Item = (usize, bool)> {
        let inside = mask & 1 != 0;
        let is_crossed = move |axis: &usize| (mask >> (1 << axis) & 1 != 0) != inside;
        (0..3).filter(is_crossed).map(move |axis| (axis, inside))
    }

    fn triangles(&self) -> usize {
        let cells = self.crossed.iter();
        cells.map(|(_, mask)| 2 * Self::edges(*mask).count()).sum()
    }

    fn mesh(&self) -> Mesh {
        let mut mesh = Mesh::default();
        for (place, mask) in &self.crossed {
            let position = self.vertex(*place, *mask);
            mesh.positions.push(position);
            mesh.normals
                .push(self.field.normal(position, 0.25 * self.step()));
        }
        for (place, mask) in &self.crossed {
            for (axis, inside) in Self::edges(*mask) {
                let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
                let behind = |axes: &[usize]| {
                    let mut at = *place;
                    axes.iter().for_each(|axis| at[*axis] -= 1);
                    self.numbers[&at]
                };
                let mut quad = [behind(&[]), behind(&[b]), behind(&[b, c]), behind(&[c])];
                if !inside {
                    quad.swap(1, 3);
                }
                let long = |i: usize, k: usize| {
                    let at = |i: usize| mesh.positions[quad[i] as usize];
                    length(sub(at(i), at(k)))
                };
                let order = match long(0, 2) <= long(1, 3) {
                    true => [0, 1, 2, 0, 2, 3],
                    false => [0, 1, 3, 1, 2, 3],
                };
                mesh.indices.extend(order.map(|i: usize| quad[i]));
            }
        }
        mesh
    }

    /// The middle of where the cell's edges are crossed, moved onto the surface in the cell.
    fn vertex(&self, place: Place, mask: u8) -> V3 {
        let corner =
            |corner: u32| self.corner([0, 1, 2].map(|axis| place[axis] + (corner >> axis & 1)));
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for from in 0..8_u32 {
            for axis in (0..3).filter(|axis| from >> axis & 1 == 0) {
                let to = from | 1 << axis;
                if (mask >> from & 1) == (mask >> to & 1) {
                    continue;
                }
                let (a, b) = (corner(from), corner(to));
                let (at_a, at_b) = (self.field.at(a), self.field.at(b));
                let t = at_a / (at_a - at_b);
                sum = add(sum, add(a, scale(sub(b, a), t)));
                count += 1.0;
            }
        }
        let mut position = scale(sum, 1.0 / count);
        let (low, high) = (corner(0), corner(7));
        for _ in 0..3 {
            let normal = self.field.normal(position, 0.25 * self.step());
            let moved = sub(position, scale(normal, self.field.at(position)));
            position = [0, 1, 2].map(|i| moved[i].clamp(low[i], high[i]));
        }
        position
    }
}
