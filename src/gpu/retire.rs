//! Objects that a frame in flight may still use, and that are freed when its slot comes round
//! again.

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::context::Gpu;
use super::memory::{Buffer, Image};

/// An object on its way out. Retire views before what they view, and placed objects before their
/// block.
#[derive(Debug)]
pub enum Retired {
    /// A buffer with its memory.
    Buffer(Buffer),
    /// An image with its memory.
    Image(Image),
    /// A view of an image.
    View(vk::ImageView),
    /// A texel view of a buffer.
    BufferView(vk::BufferView),
    /// An image placed in a block.
    PlacedImage(vk::Image),
    /// A buffer placed in a block.
    PlacedBuffer(vk::Buffer),
    /// A block of memory and where it was allocated.
    Block(Allocation, MemoryLocation),
}

impl Gpu {
    /// Destroys an object once no frame in flight can use it any more: when the current frame's
    /// slot begins anew, or at [`Gpu::destroy`].
    pub fn retire(&mut self, object: Retired) {
        self.retired[self.slot].push(object);
    }

    pub(super) fn free_retired(&mut self, object: Retired) {
        match object {
            Retired::Buffer(buffer) => self.destroy_buffer(buffer),
            Retired::Image(image) => self.destroy_image(image),
            Retired::View(view) => self.destroy_view(view),
            Retired::BufferView(view) => self.destroy_buffer_view(view),
            // SAFETY: placed by us, and its last frame has finished.
            Retired::PlacedImage(image) => unsafe { self.device.destroy_image(image, None) },
            // SAFETY: as above.
            Retired::PlacedBuffer(buffer) => unsafe { self.device.destroy_buffer(buffer, None) },
            Retired::Block(block, location) => self.free_block(block, location),
        }
    }
}
