//! Buffers, images, views, and blocks of memory that others place into.

use std::sync::{MutexGuard, PoisonError};

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator};

use super::context::Gpu;
use super::error::{CallResult, GpuError};

/// A buffer with memory of its own.
#[derive(Debug)]
pub struct Buffer {
    /// The handle.
    pub raw: vk::Buffer,
    /// Size in bytes, as asked for.
    pub size: u64,
    /// What it may be used for.
    pub usage: vk::BufferUsageFlags,
    allocation: Allocation,
    host: bool,
}

impl Buffer {
    /// The bytes, when the memory is host visible. The device must not be writing them.
    #[must_use]
    pub fn mapped(&self) -> Option<&[u8]> {
        self.allocation
            .mapped_slice()
            .and_then(|bytes| bytes.get(..usize::try_from(self.size).ok()?))
    }

    /// The bytes, when the memory is host visible. The device must not be using them.
    pub fn mapped_mut(&mut self) -> Option<&mut [u8]> {
        let size = usize::try_from(self.size).ok()?;
        self.allocation
            .mapped_slice_mut()
            .and_then(|bytes| bytes.get_mut(..size))
    }
}

/// An image with memory of its own.
#[derive(Debug)]
pub struct Image {
    /// The handle.
    pub raw: vk::Image,
    /// What it was made from.
    pub spec: ImageSpec,
    allocation: Allocation,
}

/// Everything that describes an optimally tiled image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ImageSpec {
    /// Dimensionality.
    pub image_type: vk::ImageType,
    /// Texel format.
    pub format: vk::Format,
    /// Width, height and depth of level 0 in texels.
    pub extent: [u32; 3],
    /// Number of mip levels, at least 1.
    pub mip_levels: u32,
    /// Number of array layers, at least 1.
    pub array_layers: u32,
    /// What it may be used for.
    pub usage: vk::ImageUsageFlags,
    /// Creation flags, such as cube compatibility.
    pub flags: vk::ImageCreateFlags,
}

impl ImageSpec {
    /// A 2D image of one level and one layer.
    #[must_use]
    pub fn new_2d(format: vk::Format, width: u32, height: u32, usage: vk::ImageUsageFlags) -> Self {
        Self {
            image_type: vk::ImageType::TYPE_2D,
            format,
            extent: [width, height, 1],
            mip_levels: 1,
            array_layers: 1,
            usage,
            flags: vk::ImageCreateFlags::empty(),
        }
    }

    /// The creation structure: one sample a texel, optimal tiling, used by one queue family, layout
    /// undefined.
    pub fn create_info(&self) -> vk::ImageCreateInfo<'static> {
        vk::ImageCreateInfo::default()
            .image_type(self.image_type)
            .format(self.format)
            .extent(vk::Extent3D {
                width: self.extent[0],
                height: self.extent[1],
                depth: self.extent[2],
            })
            .mip_levels(self.mip_levels)
            .array_layers(self.array_layers)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(self.usage)
            .flags(self.flags)
            .sharing_mode(vk::SharingMode::EXCLUSIVE)
            .initial_layout(vk::ImageLayout::UNDEFINED)
    }
}

/// Bytes of device memory in use by our objects, by purpose: a software driver has one kind of
/// memory for both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MemoryUse {
    /// Now, for the device alone.
    pub device_bytes: u64,
    /// Now, for exchange with the host.
    pub host_bytes: u64,
    /// The most there has been, for the device alone.
    pub peak_device_bytes: u64,
    /// The most there has been, for exchange with the host.
    pub peak_host_bytes: u64,
}

impl MemoryUse {
    fn add(&mut self, host: bool, bytes: u64) {
        let (now, peak) = self.of(host);
        *now += bytes;
        *peak = (*peak).max(*now);
    }

    fn sub(&mut self, host: bool, bytes: u64) {
        let (now, _) = self.of(host);
        *now = now.saturating_sub(bytes);
    }

    fn of(&mut self, host: bool) -> (&mut u64, &mut u64) {
        if host {
            (&mut self.host_bytes, &mut self.peak_host_bytes)
        } else {
            (&mut self.device_bytes, &mut self.peak_device_bytes)
        }
    }
}

impl Gpu {
    /// The allocator, ours or the host's. Its allocations have to be freed before [`Gpu::destroy`].
    pub fn allocator(&self) -> MutexGuard<'_, Allocator> {
        self.allocator
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Memory in use by buffers, images and blocks made here.
    #[must_use]
    pub fn memory_use(&self) -> MemoryUse {
        self.memory_use
    }

    /// Refuses one allocation, as if there were no memory for it: that many after the next one. For
    /// tests of what happens then. `None` refuses none.
    pub fn refuse_allocation(&mut self, after: Option<u64>) {
        self.refused_allocation = after;
    }

    fn allocate(
        &mut self,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Result<Allocation, GpuError> {
        let bytes = requirements.size;
        let refused = self.refused_allocation;
        self.refused_allocation = refused.and_then(|after| after.checked_sub(1));
        if refused == Some(0) {
            return Err(GpuError::Allocation {
                object: name.to_owned(),
                bytes,
                source: gpu_allocator::AllocationError::OutOfMemory,
            });
        }
        let desc = AllocationCreateDesc {
            name,
            requirements,
            location,
            linear,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        };
        let allocation =
            self.allocator()
                .allocate(&desc)
                .map_err(|source| GpuError::Allocation {
                    object: name.to_owned(),
                    bytes,
                    source,
                })?;
        self.memory_use
            .add(location != MemoryLocation::GpuOnly, allocation.size());
        Ok(allocation)
    }

    fn release(&mut self, allocation: Allocation, host: bool) {
        self.memory_use.sub(host, allocation.size());
        let freed = self.allocator().free(allocation);
        assert!(
            freed.is_ok(),
            "memory freed that is not of this allocator: {freed:?}"
        );
    }

    /// Memory for objects that the caller places in it, buffers and images side by side.
    ///
    /// # Errors
    /// [`GpuError::Allocation`], also for a size of 0.
    pub fn allocate_block(
        &mut self,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
    ) -> Result<Allocation, GpuError> {
        // Whole pages of the granularity, so that nothing outside the block shares one with what is
        // inside.
        let granularity = self.info.limits.buffer_image_granularity.max(1);
        let rounded = vk::MemoryRequirements {
            size: requirements.size.next_multiple_of(granularity),
            alignment: requirements.alignment.max(granularity),
            ..requirements
        };
        self.allocate(name, rounded, location, false)
    }

    /// Frees a block. Nothing placed in it may still be in use.
    pub fn free_block(&mut self, block: Allocation, location: MemoryLocation) {
        self.release(block, location != MemoryLocation::GpuOnly);
    }

    /// What memory an image would need, without creating it.
    pub fn memory_requirements_image(
        &self,
        info: &vk::ImageCreateInfo<'_>,
    ) -> vk::MemoryRequirements {
        let query = vk::DeviceImageMemoryRequirements::default().create_info(info);
        let mut out = vk::MemoryRequirements2::default();
        // SAFETY: the device is live, of version 1.3 and has maintenance4 enabled.
        unsafe {
            self.device
                .get_device_image_memory_requirements(&query, &mut out)
        };
        out.memory_requirements
    }

    /// What memory a buffer would need, without creating it.
    pub fn memory_requirements_buffer(
        &self,
        info: &vk::BufferCreateInfo<'_>,
    ) -> vk::MemoryRequirements {
        let query = vk::DeviceBufferMemoryRequirements::default().create_info(info);
        let mut out = vk::MemoryRequirements2::default();
        // SAFETY: as for images.
        unsafe {
            self.device
                .get_device_buffer_memory_requirements(&query, &mut out)
        };
        out.memory_requirements
    }

    /// Creates a buffer of `size` bytes (at least 1) with its own memory.
    ///
    /// # Errors
    /// A size of 0 or a failing call.
    pub fn create_buffer(
        &mut self,
        name: &str,
        size: u64,
        usage: vk::BufferUsageFlags,
        location: MemoryLocation,
    ) -> Result<Buffer, GpuError> {
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        let requirements = self
            .check_buffer(name, size)
            .map(|()| self.memory_requirements_buffer(&info))?;
        let allocation = self.allocate(name, requirements, location, true)?;
        let host = location != MemoryLocation::GpuOnly;
        match self.create_placed_buffer(name, &info, &allocation, 0) {
            Ok(raw) => Ok(Buffer {
                raw,
                size,
                usage,
                allocation,
                host,
            }),
            Err(error) => {
                self.release(allocation, host);
                Err(error)
            }
        }
    }

    /// Destroys a buffer that the device no longer uses; see [`Gpu::retire`] for one that it may.
    pub fn destroy_buffer(&mut self, buffer: Buffer) {
        // SAFETY: ours, and no longer in use by the caller's promise.
        unsafe { self.device.destroy_buffer(buffer.raw, None) };
        self.release(buffer.allocation, buffer.host);
    }

    /// Creates an image with its own device memory.
    ///
    /// # Errors
    /// A size beyond the device's limits, an unsupported combination, or a failing call.
    pub fn create_image(&mut self, name: &str, spec: &ImageSpec) -> Result<Image, GpuError> {
        let info = spec.create_info();
        self.check_image(name, &info)?;
        let requirements = self.memory_requirements_image(&info);
        let allocation = self.allocate(name, requirements, MemoryLocation::GpuOnly, false)?;
        match self.create_placed_image(name, &info, &allocation, 0) {
            Ok(raw) => Ok(Image {
                raw,
                spec: *spec,
                allocation,
            }),
            Err(error) => {
                self.release(allocation, false);
                Err(error)
            }
        }
    }

    /// Destroys an image that the device no longer uses, and whose views are gone.
    pub fn destroy_image(&mut self, image: Image) {
        // SAFETY: ours, and no longer in use by the caller's promise.
        unsafe { self.device.destroy_image(image.raw, None) };
        self.release(image.allocation, false);
    }

    fn check_buffer(&self, name: &str, size: u64) -> Result<(), GpuError> {
        if size == 0 {
            return Err(GpuError::Invalid {
                object: name.to_owned(),
                problem: "a buffer of 0 bytes".to_owned(),
            });
        }
        Ok(())
    }

    /// Refuses what the device cannot make before a driver does something undefined with it.
    fn check_image(&self, name: &str, info: &vk::ImageCreateInfo<'_>) -> Result<(), GpuError> {
        let invalid = |problem: String| {
            Err(GpuError::Invalid {
                object: name.to_owned(),
                problem,
            })
        };
        let vk::Extent3D {
            width,
            height,
            depth,
        } = info.extent;
        // SAFETY: the physical device is live.
        let limits = match unsafe {
            self.instance().get_physical_device_image_format_properties(
                self.physical,
                info.format,
                info.image_type,
                info.tiling,
                info.usage,
                info.flags,
            )
        } {
            Ok(limits) => limits,
            Err(vk::Result::ERROR_FORMAT_NOT_SUPPORTED) => {
                return invalid(format!(
                    "the device cannot make {:?} images in format {:?} for {:?}",
                    info.image_type, info.format, info.usage
                ));
            }
            Err(result) => {
                let call = "vkGetPhysicalDeviceImageFormatProperties";
                return Err(GpuError::Call {
                    call,
                    object: name.to_owned(),
                    result,
                });
            }
        };
        let most = limits.max_extent;
        if [width, height, depth].contains(&0) || info.mip_levels == 0 || info.array_layers == 0 {
            return invalid(format!(
                "an image of {width}x{height}x{depth} texels, {} levels, {} layers; none may be 0",
                info.mip_levels, info.array_layers
            ));
        }
        if width > most.width || height > most.height || depth > most.depth {
            return invalid(format!(
                "{width}x{height}x{depth} texels are beyond the device's {}x{}x{}",
                most.width, most.height, most.depth
            ));
        }
        let full_chain = width.max(height).max(depth).ilog2() + 1;
        if info.mip_levels > limits.max_mip_levels.min(full_chain)
            || info.array_layers > limits.max_array_layers
        {
            return invalid(format!(
                "{} levels and {} layers are beyond the possible {} and {}",
                info.mip_levels,
                info.array_layers,
                limits.max_mip_levels.min(full_chain),
                limits.max_array_layers
            ));
        }
        Ok(())
    }

    /// Creates an image at `offset` bytes into a block. The caller keeps the block until the image
    /// is destroyed with
    /// `vkDestroyImage` or [`Retired::PlacedImage`](super::Retired::PlacedImage).
    ///
    /// # Errors
    /// As [`Gpu::create_image`].
    pub fn create_placed_image(
        &self,
        name: &str,
        info: &vk::ImageCreateInfo<'_>,
        block: &Allocation,
        offset: u64,
    ) -> Result<vk::Image, GpuError> {
        self.check_image(name, info)?;
        // SAFETY: the description is complete and within the device's limits.
        let raw = unsafe { self.device.create_image(info, None) }.call("vkCreateImage", name)?;
        // SAFETY: the block is live memory of this device; offset and type suit by the caller's
        // promise.
        let bound = unsafe {
            self.device
                .bind_image_memory(raw, block.memory(), block.offset() + offset)
        };
        if let Err(error) = bound.call("vkBindImageMemory", name) {
            // SAFETY: just created and never used.
            unsafe { self.device.destroy_image(raw, None) };
            return Err(error);
        }
        self.set_name(raw, name);
        Ok(raw)
    }

    /// Creates a buffer at `offset` bytes into a block, as [`Gpu::create_placed_image`] does an
    /// image.
    ///
    /// # Errors
    /// As [`Gpu::create_buffer`].
    pub fn create_placed_buffer(
        &self,
        name: &str,
        info: &vk::BufferCreateInfo<'_>,
        block: &Allocation,
        offset: u64,
    ) -> Result<vk::Buffer, GpuError> {
        self.check_buffer(name, info.size)?;
        // SAFETY: the description is complete.
        let raw = unsafe { self.device.create_buffer(info, None) }.call("vkCreateBuffer", name)?;
        // SAFETY: the block is live memory of this device; offset and type suit by the caller's
        // promise.
        let bound = unsafe {
            self.device
                .bind_buffer_memory(raw, block.memory(), block.offset() + offset)
        };
        if let Err(error) = bound.call("vkBindBufferMemory", name) {
            // SAFETY: just created and never used.
            unsafe { self.device.destroy_buffer(raw, None) };
            return Err(error);
        }
        self.set_name(raw, name);
        Ok(raw)
    }

    /// Creates a view of an image.
    ///
    /// # Errors
    /// A failing call.
    pub fn create_view(
        &self,
        name: &str,
        image: vk::Image,
        view_type: vk::ImageViewType,
        format: vk::Format,
        range: vk::ImageSubresourceRange,
    ) -> Result<vk::ImageView, GpuError> {
        let info = vk::ImageViewCreateInfo::default()
            .image(image)
            .view_type(view_type)
            .format(format)
            .subresource_range(range);
        // SAFETY: the image is live by the caller's promise.
        let raw = unsafe { self.device.create_image_view(&info, None) }
            .call("vkCreateImageView", name)?;
        self.set_name(raw, name);
        Ok(raw)
    }

    /// Destroys a view that the device no longer uses.
    pub fn destroy_view(&self, view: vk::ImageView) {
        // SAFETY: no longer in use by the caller's promise.
        unsafe { self.device.destroy_image_view(view, None) };
    }

    /// Creates a texel view of a buffer; `range` in bytes or `vk::WHOLE_SIZE`. The caller stays within
    /// `max_texel_buffer_elements` of the device's limits, which may be as low as 65536.
    ///
    /// # Errors
    /// A failing call.
    pub fn create_buffer_view(
        &self,
        name: &str,
        buffer: vk::Buffer,
        format: vk::Format,
        offset: u64,
        range: u64,
    ) -> Result<vk::BufferView, GpuError> {
        let info = vk::BufferViewCreateInfo::default()
            .buffer(buffer)
            .format(format)
            .offset(offset)
            .range(range);
        // SAFETY: the buffer is live by the caller's promise.
        let raw = unsafe { self.device.create_buffer_view(&info, None) }
            .call("vkCreateBufferView", name)?;
        self.set_name(raw, name);
        Ok(raw)
    }

    /// Destroys a buffer view that the device no longer uses.
    pub fn destroy_buffer_view(&self, view: vk::BufferView) {
        // SAFETY: no longer in use by the caller's promise.
        unsafe { self.device.destroy_buffer_view(view, None) };
    }
}
