//! Commands of a pass that move bytes: copies, fills, clears.

use super::super::access::Access;
use super::super::resource::{BufferId, BufferPart, ImageId, ImagePart, Part};
use super::context::PassContext;
use super::misuse;
use crate::gpu::GpuError;
use ash::vk;

impl PassContext<'_> {
    /// Copies one mip level and layer of an image into a buffer, rows tightly packed.
    pub fn copy_image_to_buffer(
        &mut self,
        image: ImageId,
        part: ImagePart,
        buffer: BufferId,
        offset: u64,
    ) -> Result<(), GpuError> {
        let source = self.find(image.0.resource, None, |a| a == Access::CopyRead)?;
        let target = self.find(buffer.0.resource, None, |a| a == Access::CopyWrite)?;
        let region = self.copy_region(source.resource, part, offset)?;
        let (from, to) = (
            self.handles.images[source.resource],
            self.handles.buffers[target.resource],
        );
        let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        let device = self.gpu.device();
        // SAFETY: `cmd` is recording outside rendering; both were declared for the copy.
        unsafe { device.cmd_copy_image_to_buffer(self.cmd, from, layout, to, &[region]) };
        Ok(())
    }

    /// Copies tightly packed rows from a buffer into one mip level and layer of an image.
    pub fn copy_buffer_to_image(
        &mut self,
        buffer: BufferId,
        offset: u64,
        image: ImageId,
        part: ImagePart,
    ) -> Result<(), GpuError> {
        let source = self.find(buffer.0.resource, None, |a| a == Access::CopyRead)?;
        let target = self.find(image.0.resource, None, |a| a == Access::CopyWrite)?;
        let region = self.copy_region(target.resource, part, offset)?;
        let (from, to) = (
            self.handles.buffers[source.resource],
            self.handles.images[target.resource],
        );
        let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        let device = self.gpu.device();
        // SAFETY: `cmd` is recording outside rendering; both were declared for the copy.
        unsafe { device.cmd_copy_buffer_to_image(self.cmd, from, to, layout, &[region]) };
        Ok(())
    }

    /// Copies an image of one mip level and layer to another of the same size.
    pub fn copy_image(&mut self, from: ImageId, to: ImageId) -> Result<(), GpuError> {
        let source = self.find(from.0.resource, None, |a| a == Access::CopyRead)?;
        let target = self.find(to.0.resource, None, |a| a == Access::CopyWrite)?;
        let sizes = [source, target].map(|used| {
            let desc = self.image_desc(used.resource);
            desc.map(|desc| [desc.width, desc.height])
        });
        let [Some([width, height]), Some(other)] = sizes else {
            return Err(misuse(self.pass, "copies no image".to_string()));
        };
        if [width, height] != other {
            let problem = format!("copies {width}x{height} texels into {other:?}");
            return Err(misuse(self.pass, problem));
        }
        let layers = vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            layer_count: 1,
            ..Default::default()
        };
        let region = vk::ImageCopy::default()
            .src_subresource(layers)
            .dst_subresource(layers)
            .extent(vk::Extent3D {
                width,
                height,
                depth: 1,
            });
        let [from, to] = [source, target].map(|used| self.handles.images[used.resource]);
        let before = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        let after = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        let device = self.gpu.device();
        // SAFETY: `cmd` is recording outside rendering; both were declared for the copy.
        unsafe { device.cmd_copy_image(self.cmd, from, before, to, after, &[region]) };
        Ok(())
    }

    /// Copies bytes from one buffer to another.
    pub fn copy_buffer(
        &mut self,
        from: BufferId,
        from_offset: u64,
        to: BufferId,
        to_offset: u64,
        size: u64,
    ) -> Result<(), GpuError> {
        let source = self.find(from.0.resource, None, |a| a == Access::CopyRead)?;
        let target = self.find(to.0.resource, None, |a| a == Access::CopyWrite)?;
        let region = vk::BufferCopy {
            src_offset: from_offset,
            dst_offset: to_offset,
            size,
        };
        let (from, to) = (
            self.handles.buffers[source.resource],
            self.handles.buffers[target.resource],
        );
        // SAFETY: `cmd` is recording outside rendering; both were declared for the copy.
        unsafe {
            self.gpu
                .device()
                .cmd_copy_buffer(self.cmd, from, to, &[region])
        };
        Ok(())
    }

    /// Fills a part of a buffer with one 32-bit value. Offset and size are multiples of 4.
    pub fn fill_buffer(
        &mut self,
        id: BufferId,
        part: BufferPart,
        value: u32,
    ) -> Result<(), GpuError> {
        let used = self.find(id.0.resource, None, |a| a == Access::Clear)?;
        let buffer = self.handles.buffers[used.resource];
        let device = self.gpu.device();
        // SAFETY: `cmd` is recording outside rendering; the buffer was declared for the fill.
        unsafe { device.cmd_fill_buffer(self.cmd, buffer, part.offset, part.size, value) };
        Ok(())
    }

    /// Writes bytes into a buffer, at most 65,536, a multiple of 4.
    pub fn update_buffer(
        &mut self,
        id: BufferId,
        offset: u64,
        bytes: &[u8],
    ) -> Result<(), GpuError> {
        let used = self.find(id.0.resource, None, |a| a == Access::Clear)?;
        let buffer = self.handles.buffers[used.resource];
        let device = self.gpu.device();
        // SAFETY: `cmd` is recording outside rendering; the buffer was declared for the update.
        unsafe { device.cmd_update_buffer(self.cmd, buffer, offset, bytes) };
        Ok(())
    }

    /// Writes the device's clock into a buffer that was declared as [`Access::CopyWrite`]: 64 bits,
    /// once all passes before are done. Writes nothing on a queue without timestamps.
    pub(crate) fn write_clock(&mut self, id: BufferId, offset: u64) -> Result<(), GpuError> {
        let used = self.find(id.0.resource, None, |a| a == Access::CopyWrite)?;
        let buffer = self.handles.buffers[used.resource];
        self.gpu.write_clock(self.cmd, buffer, offset)
    }

    /// Clears the declared part of a colour image.
    pub fn clear_image(&mut self, id: ImageId, value: [f32; 4]) -> Result<(), GpuError> {
        let used = *self.find(id.0.resource, None, |a| a == Access::Clear)?;
        let Part::Image(part) = used.part else {
            return Err(misuse(self.pass, "clears a buffer as an image".to_string()));
        };
        let image = self.handles.images[used.resource];
        let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        let color = vk::ClearColorValue { float32: value };
        let range = part.subresource_range(vk::ImageAspectFlags::COLOR);
        let device = self.gpu.device();
        // SAFETY: `cmd` is recording outside rendering; the image was declared for the clear.
        unsafe { device.cmd_clear_color_image(self.cmd, image, layout, &color, &[range]) };
        Ok(())
    }

    fn copy_region(
        &self,
        resource: usize,
        part: ImagePart,
        offset: u64,
    ) -> Result<vk::BufferImageCopy, GpuError> {
        let Some(desc) = self.image_desc(resource) else {
            return Err(misuse(self.pass, "copies a buffer as an image".to_string()));
        };
        let level = |size: u32| (size >> part.base_mip).max(1);
        Ok(vk::BufferImageCopy {
            buffer_offset: offset,
            buffer_row_length: 0,
            buffer_image_height: 0,
            image_subresource: vk::ImageSubresourceLayers {
                aspect_mask: desc.aspect(),
                mip_level: part.base_mip,
                base_array_layer: part.base_layer,
                layer_count: part.layers,
            },
            image_offset: vk::Offset3D::default(),
            image_extent: vk::Extent3D {
                width: level(desc.width),
                height: level(desc.height),
                depth: 1,
            },
        })
    }
}
