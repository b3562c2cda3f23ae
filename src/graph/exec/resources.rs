//! Memory, images and buffers behind a plan, kept from frame to frame.

use super::super::alias::{MemoryModel, MemoryNeed};
use super::super::compile::Host;
use super::super::plan::{Arena, Placement, Plan, ResourceOrigin, ResourceShape};
use super::super::resource::{HistoryState, HistoryStates, ImageDesc, ImagePart, ImageState};
use super::context::Handles;
use crate::gpu::{Allocation, Gpu, GpuError, Image, ImageSpec, MemoryLocation, Retired};
use ash::vk;
use std::collections::{BTreeMap, HashMap};

/// Views made so far in a frame: resource, part, array or not.
pub(crate) type Views = HashMap<(usize, ImagePart, bool), vk::ImageView>;

/// Frames after which an unused set of transients is freed.
const KEEP_FRAMES: u64 = 8;

/// Transient memory and history images, kept from frame to frame.
///
/// Frames in flight do not share transient memory: each has its own, taken up again when
/// [`Gpu::begin_frame`] comes round to its slot.
#[derive(Default)]
pub struct FrameCache {
    sets: Vec<TransientSet>,
    history: BTreeMap<&'static str, HistoryPair>,
    frame: u64,
    current: Option<usize>,
}

/// The transients of one plan in one frame slot.
struct TransientSet {
    slot: usize,
    key: SetKey,
    blocks: Vec<Allocation>,
    images: Vec<vk::Image>,
    buffers: Vec<vk::Buffer>,
    views: Views,
    used: u64,
}

/// What two frames must have in common to use the same transients: blocks, shapes and places.
#[derive(Clone, Debug, PartialEq)]
struct SetKey {
    arenas: Vec<Arena>,
    resources: Vec<Option<(ResourceShape, Placement)>>,
}

/// Two images that take turns at being written.
struct HistoryPair {
    desc: ImageDesc,
    usage: vk::ImageUsageFlags,
    images: [Image; 2],
    states: [ImageState; 2],
    /// Which of them the next frame writes.
    current: usize,
}

impl MemoryModel for Gpu {
    fn need(&self, shape: &ResourceShape) -> MemoryNeed {
        let need = match shape {
            ResourceShape::Image { desc, usage } => {
                self.memory_requirements_image(&spec(desc, *usage).create_info())
            }
            ResourceShape::Buffer { desc, usage } => {
                let info = vk::BufferCreateInfo::default()
                    .size(desc.size)
                    .usage(*usage);
                self.memory_requirements_buffer(&info)
            }
        };
        MemoryNeed {
            size: need.size,
            alignment: need.alignment.max(1),
            memory_types: need.memory_type_bits,
        }
    }
}

fn spec(desc: &ImageDesc, usage: vk::ImageUsageFlags) -> ImageSpec {
    ImageSpec {
        mip_levels: desc.mips,
        array_layers: desc.layers,
        ..ImageSpec::new_2d(desc.format, desc.width, desc.height, usage)
    }
}

impl FrameCache {
    /// An empty cache.
    pub fn new() -> Self {
        Self::default()
    }

    /// What past frames left of history images: the start of the next graph.
    pub fn history(&self) -> HistoryStates {
        let pairs = self.history.iter();
        pairs
            .map(|(key, pair)| {
                let state = HistoryState {
                    desc: pair.desc,
                    previous: pair.states[1 - pair.current],
                    current: pair.states[pair.current],
                };
                (*key, state)
            })
            .collect()
    }

    /// Gives everything back once the frames in flight are done with it. Call before
    /// [`Gpu::destroy`].
    pub fn destroy(self, gpu: &mut Gpu) {
        for set in self.sets {
            retire_set(gpu, set);
        }
        for pair in self.history.into_values() {
            for image in pair.images {
                gpu.retire(Retired::Image(image));
            }
        }
    }

    /// Handles of every resource of a plan; makes what is not there yet.
    pub(super) fn handles(
        &mut self,
        gpu: &mut Gpu,
        plan: &Plan,
        hosts: &[Host],
    ) -> Result<Handles, GpuError> {
        self.frame += 1;
        self.evict(gpu);
        let index = self.transient_set(gpu, plan)?;
        self.current = Some(index);
        self.make_history(gpu, plan)?;
        let set = &self.sets[index];
        let mut handles = Handles {
            images: set.images.clone(),
            buffers: set.buffers.clone(),
        };
        for (index, resource) in plan.resources.iter().enumerate() {
            match hosts[index] {
                Host::Image(host) => handles.images[index] = host.image,
                Host::Buffer(host) => handles.buffers[index] = host.buffer,
                Host::None => {}
            }
            let (key, previous) = match resource.origin {
                ResourceOrigin::HistoryPrevious { key, .. } => (key, true),
                ResourceOrigin::HistoryCurrent { key, .. } => (key, false),
                _ => continue,
            };
            if let Some(pair) = self.history.get(key) {
                let which = if previous {
                    1 - pair.current
                } else {
                    pair.current
                };
                handles.images[index] = pair.images[which].raw;
            }
        }
        Ok(handles)
    }

    fn evict(&mut self, gpu: &mut Gpu) {
        let (frame, mut kept) = (self.frame, Vec::new());
        for set in self.sets.drain(..) {
            if frame - set.used > KEEP_FRAMES * u64::from(gpu.frames_in_flight()) {
                retire_set(gpu, set);
            } else {
                kept.push(set);
            }
        }
        self.sets = kept;
    }

    fn transient_set(&mut self, gpu: &mut Gpu, plan: &Plan) -> Result<usize, GpuError> {
        let resources = plan.resources.iter().map(|resource| match resource.origin {
            ResourceOrigin::Transient(Some(place)) => Some((resource.shape, place)),
            _ => None,
        });
        let key = SetKey {
            arenas: plan.arenas.clone(),
            resources: resources.collect(),
        };
        let slot = gpu.frame_slot();
        let found = self
            .sets
            .iter()
            .position(|s| s.slot == slot && s.key == key);
        let index = match found {
            Some(index) => index,
            None => {
                let mut set = TransientSet {
                    slot,
                    images: vec![vk::Image::null(); key.resources.len()],
                    buffers: vec![vk::Buffer::null(); key.resources.len()],
                    key,
                    blocks: Vec::new(),
                    views: Views::new(),
                    used: self.frame,
                };
                if let Err(error) = fill(gpu, plan, &mut set) {
                    retire_set(gpu, set);
                    return Err(error);
                }
                self.sets.push(set);
                self.sets.len() - 1
            }
        };
        self.sets[index].used = self.frame;
        Ok(index)
    }

    fn make_history(&mut self, gpu: &mut Gpu, plan: &Plan) -> Result<(), GpuError> {
        let mut wanted: BTreeMap<&'static str, (ImageDesc, vk::ImageUsageFlags, bool)> =
            BTreeMap::new();
        for resource in &plan.resources {
            let (key, previous) = match resource.origin {
                ResourceOrigin::HistoryPrevious { key, .. } => (key, true),
                ResourceOrigin::HistoryCurrent { key, .. } => (key, false),
                _ => continue,
            };
            if let ResourceShape::Image { desc, usage } = resource.shape {
                let empty = (desc, vk::ImageUsageFlags::empty(), false);
                let entry = wanted.entry(key).or_insert(empty);
                entry.1 |= usage;
                entry.2 |= previous;
            }
        }
        for (key, (desc, usage, continues)) in wanted {
            let pair = self.history.get(key);
            if pair.is_some_and(|p| p.desc == desc && p.usage.contains(usage)) {
                continue;
            }
            if continues {
                return Err(GpuError::Invalid {
                    object: format!("history image `{key}`"),
                    problem: format!(
                        "was made without {usage:?}; sample it or copy it, or use it so from its \
                         first frame on"
                    ),
                });
            }
            // The first frame cannot know how later ones read it.
            let usage = usage
                | vk::ImageUsageFlags::SAMPLED
                | vk::ImageUsageFlags::TRANSFER_SRC
                | vk::ImageUsageFlags::TRANSFER_DST;
            let spec = spec(&desc, usage);
            let first = gpu.create_image(key, &spec)?;
            let second = match gpu.create_image(key, &spec) {
                Ok(image) => image,
                Err(error) => {
                    gpu.retire(Retired::Image(first));
                    return Err(error);
                }
            };
            let pair = HistoryPair {
                desc,
                usage,
                images: [first, second],
                states: [ImageState::UNDEFINED; 2],
                current: 0,
            };
            if let Some(old) = self.history.insert(key, pair) {
                for image in old.images {
                    gpu.retire(Retired::Image(image));
                }
            }
        }
        Ok(())
    }

    /// Notes the states that the recorded frame leaves, and lets the images take turns.
    pub(super) fn remember_history(&mut self, plan: &Plan) {
        for resource in &plan.resources {
            match resource.origin {
                ResourceOrigin::HistoryPrevious { key, leave, .. } => {
                    if let Some(pair) = self.history.get_mut(key) {
                        pair.states[1 - pair.current] = leave;
                    }
                }
                ResourceOrigin::HistoryCurrent { key, leave, .. } => {
                    if let Some(pair) = self.history.get_mut(key) {
                        pair.states[pair.current] = leave;
                    }
                }
                _ => {}
            }
        }
        for resource in &plan.resources {
            if let ResourceOrigin::HistoryCurrent { key, .. } = resource.origin
                && let Some(pair) = self.history.get_mut(key)
            {
                pair.current = 1 - pair.current;
            }
        }
    }

    /// Views of the current set, for the frame to add to.
    pub(super) fn take_views(&mut self, _gpu: &Gpu, _plan: &Plan) -> Views {
        let set = self.current.map(|index| &mut self.sets[index]);
        set.map(|set| std::mem::take(&mut set.views))
            .unwrap_or_default()
    }

    /// Keeps views of transients; those of host and history images end with the frame, since their
    /// images may be others next time.
    pub(super) fn put_views(&mut self, gpu: &mut Gpu, plan: &Plan, views: Views) {
        let mut kept = Views::new();
        for (key, view) in views {
            match plan.resources[key.0].origin {
                ResourceOrigin::Transient(_) => {
                    kept.insert(key, view);
                }
                _ => gpu.retire(Retired::View(view)),
            }
        }
        if let Some(index) = self.current.take() {
            self.sets[index].views = kept;
        }
    }
}

/// Makes blocks, images and buffers. What was made before an error stays in `set`.
fn fill(gpu: &mut Gpu, plan: &Plan, set: &mut TransientSet) -> Result<(), GpuError> {
    for (index, arena) in set.key.arenas.iter().enumerate() {
        let kind = if arena.images { "images" } else { "buffers" };
        let need = vk::MemoryRequirements {
            size: arena.size,
            alignment: arena.alignment,
            memory_type_bits: arena.memory_types,
        };
        let name = format!("transient {kind} {index}");
        let block = gpu.allocate_block(&name, need, MemoryLocation::GpuOnly)?;
        set.blocks.push(block);
    }
    for (index, resource) in set.key.resources.iter().enumerate() {
        let Some((shape, place)) = resource else {
            continue;
        };
        let name = &plan.resources[index].name;
        let block = &set.blocks[place.arena];
        match shape {
            ResourceShape::Image { desc, usage } => {
                let info = spec(desc, *usage).create_info();
                set.images[index] = gpu.create_placed_image(name, &info, block, place.offset)?;
            }
            ResourceShape::Buffer { desc, usage } => {
                let info = vk::BufferCreateInfo::default()
                    .size(desc.size)
                    .usage(*usage);
                set.buffers[index] = gpu.create_placed_buffer(name, &info, block, place.offset)?;
            }
        }
    }
    Ok(())
}

fn retire_set(gpu: &mut Gpu, set: TransientSet) {
    for view in set.views.into_values() {
        gpu.retire(Retired::View(view));
    }
    for image in set.images.into_iter().filter(|i| *i != vk::Image::null()) {
        gpu.retire(Retired::PlacedImage(image));
    }
    for buffer in set.buffers.into_iter().filter(|b| *b != vk::Buffer::null()) {
        gpu.retire(Retired::PlacedBuffer(buffer));
    }
    for block in set.blocks {
        gpu.retire(Retired::Block(block, MemoryLocation::GpuOnly));
    }
}
