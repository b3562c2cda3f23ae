//! Where transients lie in memory: those that never live at once share it.

use super::plan::{Arena, Placement, ResourceShape};

/// What a resource needs of memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryNeed {
    /// Size in bytes.
    pub size: u64,
    /// Alignment in bytes, a power of two.
    pub alignment: u64,
    /// One bit for each memory type that can hold it.
    pub memory_types: u32,
}

/// Tells what resources need of memory. A device answers through
/// `vkGetDeviceImageMemoryRequirements`; tests and printing use [`FakeMemory`].
pub trait MemoryModel {
    /// What a resource of this shape and usage needs.
    fn need(&self, shape: &ResourceShape) -> MemoryNeed;
}

/// A memory model without a device: texels are packed, one memory type holds everything.
#[derive(Clone, Copy, Debug, Default)]
pub struct FakeMemory;

impl MemoryModel for FakeMemory {
    fn need(&self, shape: &ResourceShape) -> MemoryNeed {
        let (size, alignment) = match shape {
            ResourceShape::Image { desc, .. } => {
                let texel = texel_bytes(desc.format);
                let level = |mip: u32| {
                    u64::from((desc.width >> mip).max(1)) * u64::from((desc.height >> mip).max(1))
                };
                let texels: u64 = (0..desc.mips).map(level).sum();
                (texels * texel * u64::from(desc.layers), 256)
            }
            ResourceShape::Buffer { desc, .. } => (desc.size, 64),
        };
        MemoryNeed {
            size: size.next_multiple_of(alignment),
            alignment,
            memory_types: 1,
        }
    }
}

/// Bytes of a texel, for estimates: formats that the engine does not use count as 4.
fn texel_bytes(format: ash::vk::Format) -> u64 {
    use ash::vk::Format as F;
    match format {
        F::R8_UNORM | F::R8_UINT => 1,
        F::R16_SFLOAT | F::R16_UINT | F::R16_UNORM | F::D16_UNORM | F::R8G8_UNORM => 2,
        F::R16G16B16A16_SFLOAT | F::R32G32_SFLOAT | F::R32G32_UINT => 8,
        F::R32G32B32A32_SFLOAT | F::R32G32B32A32_UINT => 16,
        _ => 4,
    }
}

/// One transient to be placed.
pub(crate) struct Tenant {
    pub need: MemoryNeed,
    pub image: bool,
    /// First and last step in which it is alive.
    pub steps: (usize, usize),
}

/// Places every tenant at the lowest offset where no tenant that lives in one of the same steps
/// lies: coarsest alignment first, then largest first.
///
/// In this order every offset is 0 or the end of an earlier tenant, already aligned, so no byte
/// below an arena's top is unused by all: an arena is never larger than its tenants side by side.
pub(crate) fn place(tenants: &[Tenant]) -> (Vec<Placement>, Vec<Arena>) {
    let mut arenas: Vec<Arena> = Vec::new();
    let mut placements: Vec<Option<Placement>> = vec![None; tenants.len()];
    let mut order: Vec<usize> = (0..tenants.len()).collect();
    order.sort_by_key(|i| {
        let need = &tenants[*i].need;
        std::cmp::Reverse((need.alignment, need.size))
    });
    for index in order {
        let tenant = &tenants[index];
        let MemoryNeed {
            size,
            alignment,
            memory_types,
        } = tenant.need;
        let size = size.next_multiple_of(alignment);
        let found = arenas
            .iter()
            .position(|a| a.images == tenant.image && a.memory_types == memory_types);
        let arena = found.unwrap_or_else(|| {
            arenas.push(Arena {
                size: 0,
                alignment: 1,
                memory_types,
                images: tenant.image,
            });
            arenas.len() - 1
        });
        let mut neighbours: Vec<(u64, u64)> = placements
            .iter()
            .zip(tenants)
            .filter_map(|(place, other)| place.map(|place| (place, other)))
            .filter(|(place, other)| place.arena == arena && share_a_step(tenant, other))
            .map(|(place, _)| (place.offset, place.offset + place.size))
            .collect();
        neighbours.sort_unstable();
        let mut offset = 0u64;
        for (begin, end) in neighbours {
            if offset + size <= begin {
                break;
            }
            offset = offset.max(end);
        }
        placements[index] = Some(Placement {
            arena,
            offset,
            size,
            alignment,
        });
        let arena = &mut arenas[arena];
        arena.size = arena.size.max(offset + size);
        arena.alignment = arena.alignment.max(alignment);
    }
    (placements.into_iter().flatten().collect(), arenas)
}

fn share_a_step(a: &Tenant, b: &Tenant) -> bool {
    a.steps.0 <= b.steps.1 && b.steps.0 <= a.steps.1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tenant(size: u64, steps: (usize, usize)) -> Tenant {
        Tenant {
            need: MemoryNeed {
                size,
                alignment: 64,
                memory_types: 1,
            },
            image: true,
            steps,
        }
    }

    #[test]
    fn disjoint_lives_share_memory() {
        let (places, arenas) = place(&[
            tenant(256, (0, 1)),
            tenant(128, (1, 2)),
            tenant(256, (2, 3)),
        ]);
        assert_eq!(places[0].offset, 0);
        assert_eq!(places[2].offset, 0);
        assert_eq!(places[1].offset, 256);
        assert_eq!(arenas[0].size, 384);
    }

    #[test]
    fn a_gap_is_filled_before_the_arena_grows() {
        let (places, arenas) = place(&[
            tenant(512, (0, 0)),
            tenant(256, (0, 2)),
            tenant(128, (1, 1)),
        ]);
        assert_eq!((places[1].offset, places[2].offset), (512, 0));
        assert_eq!(arenas[0].size, 768);
    }
}
