//! Descriptor sets that belong to one frame, and writes that are checked against the shader.
//!
//! A set that a frame is done with is handed out again for the same layout; pools are never reset. Drivers need not
//! allocate in each frame then, and Mesa's software driver, which loses the names of sets when their pool is reset,
//! does not lose more with each frame.

use std::collections::HashMap;

use ash::vk;

use super::context::Gpu;
use super::error::{CallResult, GpuError};
use super::pipeline_desc::PipelineHandle;

/// Sets and descriptors of each kind in an ordinary pool.
const SETS: u32 = 64;
const DESCRIPTORS: u32 = 256;

/// What a binding is given.
#[derive(Clone, Copy, Debug)]
pub enum SetResource {
    /// An image with its sampler (`sampler2D`).
    SampledImage {
        /// The view.
        view: vk::ImageView,
        /// The layout it is in when read.
        layout: vk::ImageLayout,
        /// The sampler.
        sampler: vk::Sampler,
    },
    /// An image without sampler (`texture2D`).
    SeparateImage {
        /// The view.
        view: vk::ImageView,
        /// The layout it is in when read.
        layout: vk::ImageLayout,
    },
    /// A sampler alone.
    Sampler(vk::Sampler),
    /// An image in layout `GENERAL` for loads and stores (`image2D`).
    StorageImage {
        /// The view, of one mip level.
        view: vk::ImageView,
    },
    /// A uniform block.
    UniformBuffer {
        /// The buffer.
        buffer: vk::Buffer,
        /// Offset in bytes.
        offset: u64,
        /// Size in bytes or `vk::WHOLE_SIZE`.
        range: u64,
    },
    /// A storage block.
    StorageBuffer {
        /// The buffer.
        buffer: vk::Buffer,
        /// Offset in bytes.
        offset: u64,
        /// Size in bytes or `vk::WHOLE_SIZE`.
        range: u64,
    },
    /// A texel view for reading (`samplerBuffer`).
    UniformTexelBuffer(vk::BufferView),
    /// A texel view for loads and stores (`imageBuffer`).
    StorageTexelBuffer(vk::BufferView),
}

impl SetResource {
    fn kind(&self) -> vk::DescriptorType {
        match self {
            Self::SampledImage { .. } => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
            Self::SeparateImage { .. } => vk::DescriptorType::SAMPLED_IMAGE,
            Self::Sampler(_) => vk::DescriptorType::SAMPLER,
            Self::StorageImage { .. } => vk::DescriptorType::STORAGE_IMAGE,
            Self::UniformBuffer { .. } => vk::DescriptorType::UNIFORM_BUFFER,
            Self::StorageBuffer { .. } => vk::DescriptorType::STORAGE_BUFFER,
            Self::UniformTexelBuffer(_) => vk::DescriptorType::UNIFORM_TEXEL_BUFFER,
            Self::StorageTexelBuffer(_) => vk::DescriptorType::STORAGE_TEXEL_BUFFER,
        }
    }
}

/// One resource for one binding. For an array, each write of its binding fills the next element.
#[derive(Clone, Copy, Debug)]
pub struct SetWrite {
    /// The binding's number.
    pub binding: u32,
    /// What it is given.
    pub resource: SetResource,
}

struct Pool {
    raw: vk::DescriptorPool,
    sets_left: u32,
    /// Descriptors left, by kind.
    left: HashMap<vk::DescriptorType, u32>,
}

impl Pool {
    fn takes(&self, need: &HashMap<vk::DescriptorType, u32>) -> bool {
        self.sets_left > 0
            && need
                .iter()
                .all(|(kind, count)| self.left.get(kind).is_some_and(|left| left >= count))
    }
}

#[derive(Default)]
struct Slot {
    pools: Vec<Pool>,
    /// Handed out in the frame.
    sets: HashMap<vk::DescriptorSet, vk::DescriptorSetLayout>,
    /// Left over from earlier frames.
    free: HashMap<vk::DescriptorSetLayout, Vec<vk::DescriptorSet>>,
}

pub(super) struct Descriptors {
    slots: Vec<Slot>,
}

impl Descriptors {
    pub(super) fn new(slots: usize) -> Self {
        Self {
            slots: (0..slots).map(|_| Slot::default()).collect(),
        }
    }
}

const KINDS: [vk::DescriptorType; 8] = [
    vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
    vk::DescriptorType::SAMPLED_IMAGE,
    vk::DescriptorType::SAMPLER,
    vk::DescriptorType::STORAGE_IMAGE,
    vk::DescriptorType::UNIFORM_BUFFER,
    vk::DescriptorType::STORAGE_BUFFER,
    vk::DescriptorType::UNIFORM_TEXEL_BUFFER,
    vk::DescriptorType::STORAGE_TEXEL_BUFFER,
];

impl Gpu {
    /// A descriptor set for set 0 of a pipeline. It is valid until this frame's slot begins anew.
    ///
    /// Every binding has to be written with [`Gpu::write_set`] before the set is bound.
    ///
    /// # Errors
    /// A pipeline of another device, or a failing call.
    pub fn allocate_set(
        &mut self,
        pipeline: &PipelineHandle,
    ) -> Result<vk::DescriptorSet, GpuError> {
        let Some(interface) = self.pipelines.sets.get(&pipeline.set_layout) else {
            return Err(GpuError::Stale {
                what: "the pipeline",
            });
        };
        let slot = &mut self.descriptors.slots[self.slot];
        let free = slot.free.get_mut(&pipeline.set_layout);
        if let Some(set) = free.and_then(Vec::pop) {
            slot.sets.insert(set, pipeline.set_layout);
            return Ok(set);
        }
        let mut need = HashMap::new();
        for binding in &interface.key.bindings {
            *need.entry(binding.info.kind).or_insert(0) += binding.info.count;
        }
        let name = format!("set of {}", interface.shader);
        let known = self.descriptors.slots[self.slot]
            .pools
            .iter()
            .position(|pool| pool.takes(&need));
        let index = match known {
            Some(index) => index,
            None => self.add_pool(&need)?,
        };
        let slot = &mut self.descriptors.slots[self.slot];
        let layouts = [pipeline.set_layout];
        let info = vk::DescriptorSetAllocateInfo::default()
            .descriptor_pool(slot.pools[index].raw)
            .set_layouts(&layouts);
        // SAFETY: pool and layout are live, and the pool has room.
        let sets = unsafe { self.device.allocate_descriptor_sets(&info) }
            .call("vkAllocateDescriptorSets", &name)?;
        let set = sets.first().copied().unwrap_or_default();
        slot.pools[index].sets_left -= 1;
        for (kind, count) in need {
            if let Some(left) = slot.pools[index].left.get_mut(&kind) {
                *left -= count;
            }
        }
        slot.sets.insert(set, pipeline.set_layout);
        self.set_name(set, &name);
        Ok(set)
    }

    fn add_pool(&mut self, need: &HashMap<vk::DescriptorType, u32>) -> Result<usize, GpuError> {
        let sizes: HashMap<_, _> = KINDS
            .iter()
            .map(|kind| (*kind, DESCRIPTORS.max(need.get(kind).copied().unwrap_or(0))))
            .collect();
        let pool_sizes: Vec<_> = KINDS
            .iter()
            .map(|&ty| vk::DescriptorPoolSize {
                ty,
                descriptor_count: sizes[&ty],
            })
            .collect();
        let info = vk::DescriptorPoolCreateInfo::default()
            .max_sets(SETS)
            .pool_sizes(&pool_sizes);
        // SAFETY: the description is complete.
        let raw = unsafe { self.device.create_descriptor_pool(&info, None) }
            .call("vkCreateDescriptorPool", "the frame's descriptors")?;
        let pools = &mut self.descriptors.slots[self.slot].pools;
        pools.push(Pool {
            raw,
            sets_left: SETS,
            left: sizes,
        });
        let index = pools.len() - 1;
        self.set_name(raw, &format!("descriptor pool {}.{index}", self.slot));
        Ok(index)
    }

    /// Writes all bindings of a set allocated in this frame. Every binding (and array element) that
    /// the shader declares has to be there: some drivers crash on an unwritten one even when it is
    /// not used.
    ///
    /// # Errors
    /// [`GpuError::Descriptor`] names a binding that is missing, unknown, written too often or of
    /// another kind; [`GpuError::Stale`] for a set of an earlier frame.
    pub fn write_set(&self, set: vk::DescriptorSet, writes: &[SetWrite]) -> Result<(), GpuError> {
        let interface = self.descriptors.slots[self.slot]
            .sets
            .get(&set)
            .and_then(|layout| self.pipelines.sets.get(layout))
            .ok_or(GpuError::Stale {
                what: "the descriptor set",
            })?;
        let bindings = &interface.key.bindings;
        let wrong = |binding: u32, problem: String| {
            let found = bindings.iter().find(|b| b.info.binding == binding);
            let name = found.map_or("?", |b| b.info.name).to_owned();
            GpuError::Descriptor {
                shader: interface.shader.clone(),
                binding,
                name,
                problem,
            }
        };
        let mut filled = vec![0_u32; bindings.len()];
        let mut elements = Vec::with_capacity(writes.len());
        for write in writes {
            let Some(at) = bindings
                .iter()
                .position(|b| b.info.binding == write.binding)
            else {
                return Err(wrong(
                    write.binding,
                    "is not declared in the shader".to_owned(),
                ));
            };
            let info = &bindings[at].info;
            let kind = write.resource.kind();
            if kind != info.kind {
                return Err(wrong(
                    write.binding,
                    format!("is {:?}, but was given {kind:?}", info.kind),
                ));
            }
            if filled[at] == info.count {
                return Err(wrong(
                    write.binding,
                    format!("takes {}, but was given more", info.count),
                ));
            }
            elements.push(filled[at]);
            filled[at] += 1;
        }
        if let Some((binding, &count)) = bindings
            .iter()
            .zip(&filled)
            .find(|(b, count)| **count < b.info.count)
        {
            let problem = format!(
                "has {count} of {} written; all are needed",
                binding.info.count
            );
            return Err(wrong(binding.info.binding, problem));
        }
        self.update(set, writes, &elements);
        Ok(())
    }

    fn update(&self, set: vk::DescriptorSet, writes: &[SetWrite], elements: &[u32]) {
        // Every write gets its own place in each list, so that the pointers stay put.
        let images: Vec<vk::DescriptorImageInfo> = writes
            .iter()
            .map(|write| match write.resource {
                SetResource::SampledImage {
                    view,
                    layout,
                    sampler,
                } => vk::DescriptorImageInfo {
                    sampler,
                    image_view: view,
                    image_layout: layout,
                },
                SetResource::SeparateImage { view, layout } => vk::DescriptorImageInfo {
                    image_view: view,
                    image_layout: layout,
                    ..Default::default()
                },
                SetResource::Sampler(sampler) => vk::DescriptorImageInfo {
                    sampler,
                    ..Default::default()
                },
                SetResource::StorageImage { view } => vk::DescriptorImageInfo {
                    image_view: view,
                    image_layout: vk::ImageLayout::GENERAL,
                    ..Default::default()
                },
                _ => vk::DescriptorImageInfo::default(),
            })
            .collect();
        let buffers: Vec<vk::DescriptorBufferInfo> = writes
            .iter()
            .map(|write| match write.resource {
                SetResource::UniformBuffer {
                    buffer,
                    offset,
                    range,
                }
                | SetResource::StorageBuffer {
                    buffer,
                    offset,
                    range,
                } => vk::DescriptorBufferInfo {
                    buffer,
                    offset,
                    range,
                },
                _ => vk::DescriptorBufferInfo::default(),
            })
            .collect();
        let texels: Vec<vk::BufferView> = writes
            .iter()
            .map(|write| match write.resource {
                SetResource::UniformTexelBuffer(view) | SetResource::StorageTexelBuffer(view) => {
                    view
                }
                _ => vk::BufferView::null(),
            })
            .collect();
        let raw: Vec<_> = writes
            .iter()
            .enumerate()
            .map(|(i, write)| {
                let base = vk::WriteDescriptorSet::default()
                    .dst_set(set)
                    .dst_binding(write.binding)
                    .dst_array_element(elements[i])
                    .descriptor_type(write.resource.kind());
                match write.resource {
                    SetResource::UniformBuffer { .. } | SetResource::StorageBuffer { .. } => {
                        base.buffer_info(&buffers[i..=i])
                    }
                    SetResource::UniformTexelBuffer(_) | SetResource::StorageTexelBuffer(_) => {
                        base.texel_buffer_view(&texels[i..=i])
                    }
                    _ => base.image_info(&images[i..=i]),
                }
            })
            .collect();
        // SAFETY: set and resources are live, the kinds match the layout, and the set is not bound
        // in a frame that runs.
        unsafe { self.device.update_descriptor_sets(&raw, &[]) };
    }

    /// Takes back what the frame that last used the slot was given: it has finished.
    pub(super) fn reclaim_sets(&mut self) {
        let Slot { sets, free, .. } = &mut self.descriptors.slots[self.slot];
        for (set, layout) in sets.drain() {
            free.entry(layout).or_default().push(set);
        }
    }

    pub(super) fn destroy_descriptors(&mut self) {
        for pool in self
            .descriptors
            .slots
            .iter_mut()
            .flat_map(|slot| slot.pools.drain(..))
        {
            // SAFETY: ours, and the device is idle.
            unsafe { self.device.destroy_descriptor_pool(pool.raw, None) };
        }
    }
}
