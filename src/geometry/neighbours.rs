//! Which triangles lie beside each other, triangle by triangle.

use std::collections::HashMap;

/// Of each triangle the ones across its edges: from its first corner to the second, from the second
/// to the third, from the third to the first; then nothing. Twice the triangle's number, plus 1 where
/// the two are wound against each other; [`NONE`] where not exactly two solid triangles meet.
pub(super) type Neighbours = Vec<[u32; 4]>;

/// No neighbour: `NO_NEIGHBOUR` in `shaft_masks/entries.comp`.
const NONE: u32 = u32::MAX;

/// A neighbour's number, and whether it is wound alike.
pub(super) fn beside(stored: u32) -> Option<(u32, bool)> {
    (stored != NONE).then_some((stored >> 1, stored & 1 == 0))
}

/// Finds the neighbours of all triangles of four texels each (`common/triangles.glsl`). Corners at the
/// same place are one.
pub(super) fn neighbours(triangles: &[[f32; 4]]) -> Neighbours {
    let count = triangles.len() / 4;
    let mut welded: HashMap<[u32; 3], u32> = HashMap::with_capacity(count);
    let mut halves: Vec<(u64, u32, bool)> = Vec::with_capacity(3 * count);
    for (triangle, texels) in triangles.chunks_exact(4).enumerate() {
        // With holes.
        if texels[3][3] < 0.0 {
            continue;
        }
        let points = [texels[0], texels[1], texels[2]].map(|[x, y, z, _]| {
            let next = welded.len() as u32;
            // Both zeros are one place.
            let key = [x, y, z].map(|v| (v + 0.0).to_bits());
            *welded.entry(key).or_insert(next)
        });
        for corner in 0..3 {
            let (from, to) = (points[corner], points[(corner + 1) % 3]);
            let key = u64::from(from.min(to)) << 32 | u64::from(from.max(to));
            halves.push((key, (4 * triangle + corner) as u32, from < to));
        }
    }
    halves.sort_unstable();
    let mut found = vec![[NONE; 4]; count];
    for faces in halves.chunk_by(|a, b| a.0 == b.0) {
        let &[(_, a, up), (_, b, other_up)] = faces else {
            continue;
        };
        if a / 4 == b / 4 {
            continue;
        }
        let against = u32::from(up == other_up);
        found[a as usize / 4][a as usize % 4] = (2 * (b / 4)) | against;
        found[b as usize / 4][b as usize % 4] = (2 * (a / 4)) | against;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_solid_triangles_at_an_edge_are_neighbours() {
        let corner = |x: f32, y: f32, z: f32| [x, y, z, 0.5];
        let (a, b, c, d) = (
            corner(0.0, 0.0, 0.0),
            corner(1.0, 0.0, 0.0),
            corner(0.0, 1.0, 0.0),
            corner(1.0, 1.0, 0.0),
        );
        let minus = corner(-0.0, 0.0, 0.0);
        let plane = [0.0, 0.0, 1.0, 0.0];
        let square = [a, b, c, plane, c, b, d, plane];
        assert_eq!(
            neighbours(&square),
            [[NONE, 2, NONE, NONE], [0, NONE, NONE, NONE]]
        );
        assert_eq!(beside(2), Some((1, true)));
        // The other way round, and a corner with a zero less than nothing.
        let against = [minus, b, c, plane, a, b, d, plane];
        assert_eq!(
            neighbours(&against),
            [[3, NONE, NONE, NONE], [1, NONE, NONE, NONE]]
        );
        // A third one at the edge, and one with holes.
        let third = [
            a,
            b,
            c,
            plane,
            c,
            b,
            d,
            plane,
            b,
            c,
            corner(0.0, 0.0, 1.0),
            plane,
        ];
        assert_eq!(neighbours(&third), vec![[NONE; 4]; 3]);
        let holes = [a, b, c, plane, c, b, d, [0.0, 0.0, 1.0, -1.0]];
        assert_eq!(neighbours(&holes), vec![[NONE; 4]; 2]);
    }
}
