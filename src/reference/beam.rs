//! Many segments from one receiver at once.
//!
//! All segments of a pixel start at the same point, so they are sorted into narrow bundles, and the
//! hierarchy is walked once a bundle instead of once a segment: sheared along one axis a bundle is
//! a pyramid, and whether a box may meet it is a matter of two intervals. What is decided about one
//! triangle and one segment is the same as in `Triangles::occluded`, and the results are equal.

use glam::{DVec2, DVec3};

use super::triangles::{
    End, Node, PlaneFrom, ROUNDING, Start, Triangle, Triangles, Weights, axes, main_axis, separates,
};

/// Segments that are tested together.
const TILE: usize = 64;
/// Triangles that a bundle collects before it is split.
const COLLECTED: usize = 24;
/// Side of the grid over the light by which segments are sorted.
const GRID: usize = 16;
/// Six ways along an axis, times the grid.
const KEYS: usize = 6 * GRID * GRID;

/// The segments of one receiver, and room to work in; kept from receiver to receiver.
#[derive(Debug, Default)]
pub(super) struct Beam {
    ends: Vec<Segment>,
    sorted: Vec<Segment>,
    keys: Vec<u16>,
    /// First segment of each way along an axis, in `sorted`.
    groups: Vec<(usize, usize)>,
    /// Of `sorted`: shear in two axes.
    shear_x: Vec<f64>,
    shear_y: Vec<f64>,
    offset: [Vec<f64>; 3],
    blocked: Vec<u64>,
    collected: Vec<u32>,
    stack: Vec<u32>,
    error: f64,
    at_infinity: bool,
    /// Longest offset in the sum norm.
    longest: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Segment {
    offset: DVec3,
    /// Number that the caller knows it by.
    number: u32,
}

/// What a bundle of segments reaches, sheared along its axis.
#[derive(Clone, Copy, Debug)]
struct Pyramid {
    axes: [usize; 3],
    /// Lowest and highest shear in each of the two other axes.
    x: [f64; 2],
    y: [f64; 2],
    /// From the receiver along the axis.
    z: [f64; 2],
}

impl Beam {
    /// Forgets the segments of the last receiver.
    pub(super) fn clear(&mut self) {
        self.ends.clear();
        self.keys.clear();
        self.longest = 0.0;
    }

    /// Adds a segment; `place` within the unit square tells neighbours from each other.
    pub(super) fn add(&mut self, number: u32, place: DVec2, end: End) {
        let cell = |p: f64| ((p * GRID as f64) as usize).min(GRID - 1);
        let axis = main_axis(end.offset);
        let way = 2 * axis + usize::from(end.offset[axis] < 0.0);
        let key = way * GRID * GRID + interleave(cell(place.x), cell(place.y));
        self.keys.push(key as u16);
        self.ends.push(Segment {
            offset: end.offset,
            number,
        });
        let a = end.offset.abs();
        self.longest = self.longest.max(a.x + a.y + a.z);
        self.error = end.error;
        self.at_infinity = end.at_infinity;
    }

    /// Calls `seen` with the number of each segment that nothing blocks, in no stated order.
    pub(super) fn trace(
        &mut self,
        triangles: &Triangles,
        from: &Start,
        normal: DVec3,
        mut seen: impl FnMut(u32),
    ) {
        if self.ends.is_empty() {
            return;
        }
        self.sort();
        self.blocked.clear();
        self.blocked.resize(self.sorted.len().div_ceil(TILE), 0);
        if !triangles.nodes.is_empty() {
            for group in 0..self.groups.len() {
                let (first, last) = self.groups[group];
                self.resolve(triangles, from, normal, first, last);
            }
        }
        for (at, segment) in self.sorted.iter().enumerate() {
            if self.blocked[at / TILE] >> (at % TILE) & 1 == 0 {
                seen(segment.number);
            }
        }
    }

    /// Whether all of a light is seen or all of it hidden, where that shows without samples:
    /// nothing stands in the pyramid over its hull, or one triangle lies across all of it. What is
    /// decided here is what [`trace`](Self::trace) would find for each sample.
    pub(super) fn trace_hull(
        &mut self,
        triangles: &Triangles,
        from: &Start,
        normal: DVec3,
        hull: &[End; 4],
    ) -> Option<bool> {
        let axis = main_axis(hull[0].offset);
        let is_alike = |end: &End| {
            main_axis(end.offset) == axis
                && (end.offset[axis] < 0.0) == (hull[0].offset[axis] < 0.0)
                && normal.dot(end.offset) > 0.0
        };
        if !hull.iter().all(is_alike) {
            return None;
        }
        if triangles.nodes.is_empty() {
            return Some(true);
        }
        self.clear();
        for (number, end) in hull.iter().enumerate() {
            self.add(number as u32, DVec2::splat(0.5), *end);
        }
        self.sort();
        self.blocked.clear();
        self.blocked.push(0);
        let pyramid = self.pyramid(0, hull.len());
        if !self.collect(triangles, from, normal, &pyramid) {
            return None;
        }
        if self.collected.is_empty() {
            return Some(true);
        }
        for i in 0..self.collected.len() {
            let index = self.collected[i];
            // The segments that a triangle blocks are a convex bundle.
            self.blocked[0] = 0;
            if !Triangles::has_holes(&triangles.list[index as usize]) {
                self.test(triangles, from, index, pyramid.axes, 0, hull.len());
                if self.blocked[0] == 0b1111 {
                    return Some(false);
                }
            }
        }
        None
    }

    /// Counting sort by way along an axis and place on the light.
    fn sort(&mut self) {
        let mut starts = [0u32; KEYS + 1];
        for &key in &self.keys {
            starts[key as usize + 1] += 1;
        }
        for key in 0..KEYS {
            starts[key + 1] += starts[key];
        }
        self.groups.clear();
        for way in 0..6 {
            let at = |way: usize| starts[way * GRID * GRID] as usize;
            let (first, last) = (at(way), at(way + 1));
            if first < last {
                self.groups.push((first, last));
            }
        }
        let count = self.ends.len();
        self.sorted.resize(count, Segment::default());
        for (segment, &key) in self.ends.iter().zip(&self.keys) {
            let at = &mut starts[key as usize];
            self.sorted[*at as usize] = *segment;
            *at += 1;
        }
        self.shear_x.resize(count, 0.0);
        self.shear_y.resize(count, 0.0);
        for list in &mut self.offset {
            list.resize(count, 0.0);
        }
        for (at, segment) in self.sorted.iter().enumerate() {
            let d = segment.offset.to_array();
            let [x, y, z] = axes(main_axis(segment.offset));
            self.shear_x[at] = d[x] / d[z];
            self.shear_y[at] = d[y] / d[z];
            for (list, d) in self.offset.iter_mut().zip(d) {
                list[at] = d;
            }
        }
    }

    /// Decides segments `first` to `last`, which go the same way along the same axis.
    fn resolve(
        &mut self,
        triangles: &Triangles,
        from: &Start,
        normal: DVec3,
        first: usize,
        last: usize,
    ) {
        let pyramid = self.pyramid(first, last);
        if self.collect(triangles, from, normal, &pyramid) {
            for i in 0..self.collected.len() {
                let index = self.collected[i];
                self.test(triangles, from, index, pyramid.axes, first, last);
            }
            return;
        }
        if last - first > TILE {
            // Tiles stay whole.
            let middle = (first + last).div_ceil(2).next_multiple_of(TILE);
            let middle = if middle < last {
                middle
            } else {
                (last - 1) / TILE * TILE
            };
            if middle > first {
                self.resolve(triangles, from, normal, first, middle);
                self.resolve(triangles, from, normal, middle, last);
                return;
            }
        }
        self.walk(triangles, from, normal, &pyramid, first, last);
    }

    fn pyramid(&self, first: usize, last: usize) -> Pyramid {
        let range = |values: &[f64]| {
            let mut range = [f64::INFINITY, f64::NEG_INFINITY];
            for &value in &values[first..last] {
                range[0] = range[0].min(value);
                range[1] = range[1].max(value);
            }
            range
        };
        let axis = main_axis(self.sorted[first].offset);
        let [low, high] = range(&self.offset[axis]);
        let is_up = low >= 0.0;
        let end = match (self.at_infinity, is_up) {
            (true, true) => f64::INFINITY,
            (true, false) => f64::NEG_INFINITY,
            (false, true) => high,
            (false, false) => low,
        };
        Pyramid {
            axes: axes(axis),
            x: range(&self.shear_x),
            y: range(&self.shear_y),
            z: if is_up { [0.0, end] } else { [end, 0.0] },
        }
    }

    /// Collects the triangles whose boxes the pyramid meets. False if there are too many.
    fn collect(
        &mut self,
        triangles: &Triangles,
        from: &Start,
        normal: DVec3,
        pyramid: &Pyramid,
    ) -> bool {
        self.collected.clear();
        self.stack.clear();
        self.stack.push(0);
        while let Some(node) = self.stack.pop() {
            let node = &triangles.nodes[node as usize];
            if !pyramid.meets(node, from, normal) {
                continue;
            }
            if node.count == 0 {
                self.stack.extend([node.first, node.first + 1]);
                continue;
            }
            for index in node.first..node.first + node.count {
                let triangle = &triangles.list[index as usize];
                if index != from.own && pyramid.meets(&box_of(triangle), from, normal) {
                    if self.collected.len() == COLLECTED {
                        return false;
                    }
                    self.collected.push(index);
                }
            }
        }
        true
    }

    /// Tests the triangles whose boxes the pyramid meets, until all segments are blocked.
    fn walk(
        &mut self,
        triangles: &Triangles,
        from: &Start,
        normal: DVec3,
        pyramid: &Pyramid,
        first: usize,
        last: usize,
    ) {
        let mut stack = std::mem::take(&mut self.stack);
        stack.clear();
        stack.push(0);
        'nodes: while let Some(node) = stack.pop() {
            let node = &triangles.nodes[node as usize];
            if !pyramid.meets(node, from, normal) {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first, node.first + 1]);
                continue;
            }
            for index in node.first..node.first + node.count {
                if index != from.own
                    && self.test(triangles, from, index, pyramid.axes, first, last)
                    && self.are_all_blocked(first, last)
                {
                    break 'nodes;
                }
            }
        }
        self.stack = stack;
    }

    fn are_all_blocked(&self, first: usize, last: usize) -> bool {
        (first / TILE..last.div_ceil(TILE)).all(|tile| {
            let wanted = tile_mask(tile, first, last);
            self.blocked[tile] & wanted == wanted
        })
    }

    /// Marks the segments that the triangle blocks; true if there was any.
    fn test(
        &mut self,
        triangles: &Triangles,
        from: &Start,
        index: u32,
        axes: [usize; 3],
        first: usize,
        last: usize,
    ) -> bool {
        let triangle = &triangles.list[index as usize];
        let corners = (triangle.corners).map(|corner| corner.as_dvec3() - from.position);
        let plane = PlaneFrom::new(triangle, &corners, from.error);
        if plane.holds_point() {
            return false;
        }
        let sheared = Sheared {
            corners: corners.map(|corner| axes.map(|axis| corner[axis])),
            plane,
            end_error: plane.end_error(self.longest, self.error),
            at_infinity: self.at_infinity,
        };
        let has_holes = Triangles::has_holes(triangle);
        let mut any = false;
        for tile in first / TILE..last.div_ceil(TILE) {
            let wanted = tile_mask(tile, first, last) & !self.blocked[tile];
            if wanted == 0 {
                continue;
            }
            let start = tile * TILE;
            let end = (start + TILE).min(self.sorted.len());
            let mut hits = sheared.hits(
                &self.shear_x[start..end],
                &self.shear_y[start..end],
                [0, 1, 2].map(|i| &self.offset[i][start..end]),
            ) & wanted;
            if has_holes {
                let mut left = hits;
                while left != 0 {
                    let bit = left.trailing_zeros() as usize;
                    left &= left - 1;
                    let at = start + bit;
                    let weights = sheared.weights(self.shear_x[at], self.shear_y[at]);
                    if !triangles.is_solid_at(triangle, weights) {
                        hits &= !(1 << bit);
                    }
                }
            }
            any |= hits != 0;
            self.blocked[tile] |= hits;
        }
        any
    }
}

/// Bits of the segments `first` to `last` within a tile.
fn tile_mask(tile: usize, first: usize, last: usize) -> u64 {
    let start = tile * TILE;
    let low = first.saturating_sub(start);
    let high = (last - start).min(TILE);
    (u64::MAX << low) & (u64::MAX >> (TILE - high))
}

/// x and y bit by bit in turn, of a grid of 16 by 16.
fn interleave(x: usize, y: usize) -> usize {
    let spread = |v: usize| {
        let v = (v | v << 2) & 0x33;
        (v | v << 1) & 0x55
    };
    spread(x) | spread(y) << 1
}

fn box_of(triangle: &Triangle) -> Node {
    let [a, b, c] = triangle.corners;
    Node {
        min: a.min(b).min(c).to_array(),
        max: a.max(b).max(c).to_array(),
        first: 0,
        count: 0,
    }
}

impl Pyramid {
    /// Whether a box may hold a point of the bundle above the receiver's tangent plane. May say yes
    /// for one outside, never no for one inside.
    #[inline]
    fn meets(&self, node: &Node, from: &Start, normal: DVec3) -> bool {
        let origin = from.position.to_array();
        let side = |axis: usize| {
            [
                f64::from(node.min[axis]) - origin[axis],
                f64::from(node.max[axis]) - origin[axis],
            ]
        };
        let z = side(self.axes[2]);
        let (near, far) = (z[0].max(self.z[0]), z[1].min(self.z[1]));
        let slack = 16.0 * ROUNDING * (z[0].abs() + z[1].abs());
        if near > far + slack {
            return false;
        }
        let reaches = |shear: &[f64; 2], [low, high]: [f64; 2]| {
            // Corners of an interval product: where they lie does not matter, only their range.
            let (a, b) = (shear[0] * near, shear[0] * far);
            let (c, d) = (shear[1] * near, shear[1] * far);
            let least = a.min(b).min(c).min(d);
            let most = a.max(b).max(c).max(d);
            let slack = 16.0 * ROUNDING * (low.abs() + high.abs() + least.abs() + most.abs());
            least <= high + slack && most >= low - slack
        };
        let (x, y) = (side(self.axes[0]), side(self.axes[1]));
        if !(reaches(&self.x, x) && reaches(&self.y, y)) {
            return false;
        }
        let n = normal.to_array();
        let mut highest = 0.0;
        let mut size = 0.0;
        for (axis, [low, high]) in self.axes.into_iter().zip([x, y, z]) {
            highest += (n[axis] * low).max(n[axis] * high);
            size += low.abs().max(high.abs());
        }
        highest >= -(2.0 * from.error + 32.0 * ROUNDING * size)
    }
}

/// A triangle with what is the same for all segments of one way along one axis.
struct Sheared {
    /// Relative to the receiver, in the order of the bundle's axes.
    corners: [[f64; 3]; 3],
    plane: PlaneFrom,
    end_error: f64,
    at_infinity: bool,
}

impl Sheared {
    /// The edge functions of `Line::weights`.
    #[inline(always)]
    fn weights(&self, sx: f64, sy: f64) -> Weights {
        let [a, b, c] = self.corners.map(|v| (v[0] - sx * v[2], v[1] - sy * v[2]));
        Weights([
            c.0 * b.1 - c.1 * b.0,
            a.0 * c.1 - a.1 * c.0,
            b.0 * a.1 - b.1 * a.0,
        ])
    }

    /// A bit for each of up to 64 segments that the triangle lies across.
    fn hits(&self, sx: &[f64], sy: &[f64], offset: [&[f64]; 3]) -> u64 {
        let mut flags = [0u8; TILE];
        let n = self.plane.normal;
        let count = sx.len().min(TILE);
        let (sx, sy) = (&sx[..count], &sy[..count]);
        let [dx, dy, dz] = offset.map(|list| &list[..count]);
        for i in 0..count {
            let Weights([u, v, w]) = self.weights(sx[i], sy[i]);
            let low = u.min(v).min(w);
            let high = u.max(v).max(w);
            let inside = ((low >= 0.0) | (high <= 0.0)) & (u + v + w != 0.0);
            let fall = n.x * dx[i] + n.y * dy[i] + n.z * dz[i];
            let apart = separates(&self.plane, fall, self.end_error, self.at_infinity);
            flags[i] = u8::from(inside & apart);
        }
        let mut bits = 0;
        for (i, chunk) in flags.chunks_exact(8).enumerate() {
            // One bit out of each byte.
            let bytes = chunk
                .iter()
                .rev()
                .fold(0u64, |all, &b| all << 8 | u64::from(b));
            bits |= (bytes.wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * i);
        }
        bits
    }
}

#[cfg(test)]
mod tests;
