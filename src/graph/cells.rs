//! Resources cut into cells: the smallest parts that a plan ever treats differently.
//!
//! An image has one cell for each mip level of each array layer. A buffer is cut wherever some use
//! begins or ends.

use super::resource::{BufferPart, ImagePart, Part};
use super::{Declarations, Kind};

pub(crate) enum CellMap {
    Image { mips: u32, layers: u32 },
    Buffer { cuts: Vec<u64> },
}

impl CellMap {
    /// The cells of every resource, cut by the parts that passes use.
    pub fn all(decl: &Declarations) -> Vec<CellMap> {
        let mut maps: Vec<CellMap> = decl
            .resources
            .iter()
            .map(|resource| match resource.kind {
                Kind::Image(desc) => CellMap::Image {
                    mips: desc.mips,
                    layers: desc.layers,
                },
                Kind::Buffer(desc) => CellMap::Buffer {
                    cuts: vec![0, desc.size],
                },
            })
            .collect();
        for used in decl.passes.iter().flat_map(|pass| &pass.uses) {
            if let (CellMap::Buffer { cuts }, Part::Buffer(part)) =
                (&mut maps[used.resource], used.part)
            {
                cuts.extend([part.offset, part.offset + part.size]);
            }
        }
        for map in &mut maps {
            if let CellMap::Buffer { cuts } = map {
                cuts.sort_unstable();
                cuts.dedup();
            }
        }
        maps
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        match self {
            CellMap::Image { mips, layers } => (*mips * *layers) as usize,
            CellMap::Buffer { cuts } => cuts.len() - 1,
        }
    }

    /// The cells of a part.
    pub fn cells(&self, part: Part) -> impl Iterator<Item = usize> + use<> {
        let (rows, row_length, start, count) = match (self, part) {
            (CellMap::Image { layers, .. }, Part::Image(p)) => (
                p.mips as usize,
                *layers as usize,
                (p.base_mip * layers + p.base_layer) as usize,
                p.layers as usize,
            ),
            (CellMap::Buffer { cuts }, Part::Buffer(p)) => {
                let start = cuts.partition_point(|cut| *cut < p.offset);
                let end = cuts.partition_point(|cut| *cut < p.offset + p.size);
                (1, 0, start, end - start)
            }
            _ => (0, 0, 0, 0),
        };
        (0..rows).flat_map(move |row| (0..count).map(move |i| start + row * row_length + i))
    }

    /// The part that one cell covers.
    pub fn part(&self, cell: usize) -> Part {
        match self {
            CellMap::Image { layers, .. } => Part::Image(ImagePart {
                base_mip: cell as u32 / layers,
                mips: 1,
                base_layer: cell as u32 % layers,
                layers: 1,
            }),
            CellMap::Buffer { cuts } => Part::Buffer(BufferPart {
                offset: cuts[cell],
                size: cuts[cell + 1] - cuts[cell],
            }),
        }
    }
}

/// Joins two parts if together they form one: `b` must follow `a` in cell order.
pub(crate) fn join(a: Part, b: Part) -> Option<Part> {
    match (a, b) {
        (Part::Image(a), Part::Image(b)) => {
            let same_mips = a.base_mip == b.base_mip && a.mips == b.mips;
            let same_layers = a.base_layer == b.base_layer && a.layers == b.layers;
            if same_mips && a.base_layer + a.layers == b.base_layer {
                let layers = a.layers + b.layers;
                Some(Part::Image(ImagePart { layers, ..a }))
            } else if same_layers && a.base_mip + a.mips == b.base_mip {
                let mips = a.mips + b.mips;
                Some(Part::Image(ImagePart { mips, ..a }))
            } else {
                None
            }
        }
        (Part::Buffer(a), Part::Buffer(b)) if a.offset + a.size == b.offset => {
            let size = a.size + b.size;
            Some(Part::Buffer(BufferPart { size, ..a }))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_map_to_cells_and_back() {
        let map = CellMap::Image { mips: 3, layers: 4 };
        let part = Part::Image(ImagePart {
            base_mip: 1,
            mips: 2,
            base_layer: 1,
            layers: 2,
        });
        let cells: Vec<usize> = map.cells(part).collect();
        assert_eq!(cells, [5, 6, 9, 10]);
        let rows = [
            join(map.part(5), map.part(6)),
            join(map.part(9), map.part(10)),
        ];
        let [Some(a), Some(b)] = rows else {
            unreachable!("cells of one mip level join")
        };
        assert_eq!(join(a, b), Some(part));
        assert_eq!(join(map.part(5), map.part(7)), None);

        let map = CellMap::Buffer {
            cuts: vec![0, 16, 64, 100],
        };
        let part = Part::Buffer(BufferPart {
            offset: 16,
            size: 84,
        });
        assert_eq!(map.cells(part).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(join(map.part(1), map.part(2)), Some(part));
    }
}
