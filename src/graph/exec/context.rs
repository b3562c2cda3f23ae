//! What a pass sees while it records: its declared resources, and commands on them.

use super::super::access::Access;
use super::super::plan::{Plan, PlanPass, PlanUse, ResourceShape};
use super::super::resource::{BufferId, ImageDesc, ImageId, ImagePart, Part};
use super::misuse;
use super::resources::Views;
use crate::gpu::{
    ComputePipelineDesc, Gpu, GpuError, GraphicsPipelineDesc, PipelineHandle, SamplerDesc,
    SetResource, SetWrite,
};
use ash::vk;

/// Vulkan handles of the frame, by index into [`Plan::resources`]; null where there is none.
pub(crate) struct Handles {
    pub images: Vec<vk::Image>,
    pub buffers: Vec<vk::Buffer>,
}

/// A declared resource for one binding of a shader.
#[derive(Clone, Debug)]
pub struct Bind {
    binding: u32,
    what: Bound,
    part: Option<Part>,
    array: bool,
}

#[derive(Clone, Debug)]
enum Bound {
    Sampled(ImageId, SamplerDesc),
    StorageImage(ImageId),
    Uniform(BufferId),
    StorageBuffer(BufferId),
    Texels(BufferId, vk::Format),
}

impl Bind {
    /// An image read through a sampler.
    pub fn sampled(binding: u32, image: ImageId, sampler: SamplerDesc) -> Self {
        Self::new(binding, Bound::Sampled(image, sampler))
    }

    /// A storage image.
    pub fn storage_image(binding: u32, image: ImageId) -> Self {
        Self::new(binding, Bound::StorageImage(image))
    }

    /// A uniform buffer.
    pub fn uniform(binding: u32, buffer: BufferId) -> Self {
        Self::new(binding, Bound::Uniform(buffer))
    }

    /// A storage buffer.
    pub fn storage_buffer(binding: u32, buffer: BufferId) -> Self {
        Self::new(binding, Bound::StorageBuffer(buffer))
    }

    /// A uniform texel buffer.
    pub fn texels(binding: u32, buffer: BufferId, format: vk::Format) -> Self {
        Self::new(binding, Bound::Texels(buffer, format))
    }

    /// The same, of the part that the pass declared under this name; needed only where it declared
    /// several parts of one resource for the same kind of access.
    pub fn part(self, part: impl Into<Part>) -> Self {
        Self {
            part: Some(part.into()),
            ..self
        }
    }

    /// The same, for an array image (`sampler2DArray`, `image2DArray`) even where the declared part
    /// has one layer.
    pub fn array(self) -> Self {
        Self {
            array: true,
            ..self
        }
    }

    fn new(binding: u32, what: Bound) -> Self {
        Self {
            binding,
            what,
            part: None,
            array: false,
        }
    }
}

/// Records one pass. It refuses resources that the pass did not declare.
pub struct PassContext<'a> {
    pub(super) gpu: &'a mut Gpu,
    pub(super) cmd: vk::CommandBuffer,
    pub(super) plan: &'a Plan,
    pub(super) pass: &'a PlanPass,
    pub(super) handles: &'a Handles,
    pub(super) views: &'a mut Views,
}

impl PassContext<'_> {
    /// The command buffer. In a graphics pass, rendering has begun, and viewport and scissor cover
    /// the attachments.
    pub fn command_buffer(&self) -> vk::CommandBuffer {
        self.cmd
    }

    /// The device.
    pub fn gpu(&mut self) -> &mut Gpu {
        self.gpu
    }

    /// Width and height of the attachments in texels; 1x1 without any.
    pub fn extent(&self) -> [u32; 2] {
        let attachment = self.pass.attachments.first();
        let size = attachment.and_then(|a| {
            let desc = self.image_desc(a.resource)?;
            let mip = a.part.base_mip;
            Some([(desc.width >> mip).max(1), (desc.height >> mip).max(1)])
        });
        size.unwrap_or([1, 1])
    }

    /// The image behind a declared id.
    pub fn image(&self, id: ImageId) -> Result<vk::Image, GpuError> {
        let used = self.find(id.0.resource, None, |_| true)?;
        Ok(self.handles.images[used.resource])
    }

    /// The buffer behind a declared id.
    pub fn buffer(&self, id: BufferId) -> Result<vk::Buffer, GpuError> {
        let used = self.find(id.0.resource, None, |_| true)?;
        Ok(self.handles.buffers[used.resource])
    }

    /// Binds a compute pipeline with its resources and push constants.
    pub fn bind_compute(
        &mut self,
        pipeline: &ComputePipelineDesc,
        bindings: &[Bind],
        push: &[u8],
    ) -> Result<(), GpuError> {
        let pipeline = self.gpu.compute_pipeline(pipeline)?;
        self.bind(&pipeline, bindings, push)
    }

    /// Binds a graphics pipeline with its resources and push constants. Attachment formats are
    /// filled in from the pass.
    pub fn bind_graphics(
        &mut self,
        mut pipeline: GraphicsPipelineDesc,
        bindings: &[Bind],
        push: &[u8],
    ) -> Result<(), GpuError> {
        let attachments = &self.pass.attachments;
        let format = |resource| self.image_desc(resource).map(|desc| desc.format);
        let color = attachments.iter().filter(|a| !a.depth);
        pipeline.color_formats = color.filter_map(|a| format(a.resource)).collect();
        let depth = attachments.iter().find(|a| a.depth);
        pipeline.depth_format = depth.and_then(|a| format(a.resource));
        let pipeline = self.gpu.graphics_pipeline(&pipeline)?;
        self.bind(&pipeline, bindings, push)
    }

    /// Dispatches workgroups of the bound pipeline.
    pub fn dispatch(&mut self, groups: [u32; 3]) {
        let device = self.gpu.device();
        // SAFETY: `cmd` is recording outside rendering; the pipeline and its set are bound.
        unsafe { device.cmd_dispatch(self.cmd, groups[0], groups[1], groups[2]) };
    }

    /// Dispatches as many workgroups as a declared buffer says (three `u32`).
    pub fn dispatch_indirect(&mut self, arguments: BufferId, offset: u64) -> Result<(), GpuError> {
        let buffer = self.indirect(arguments)?;
        // SAFETY: as for `dispatch`; the buffer was declared for indirect arguments.
        unsafe {
            self.gpu
                .device()
                .cmd_dispatch_indirect(self.cmd, buffer, offset)
        };
        Ok(())
    }

    /// Binds declared vertex buffers, by place in the list.
    pub fn bind_vertices(&mut self, buffers: &[(BufferId, u64)]) -> Result<(), GpuError> {
        let mut handles = Vec::with_capacity(buffers.len());
        let mut offsets = Vec::with_capacity(buffers.len());
        for (id, offset) in buffers {
            let used = self.find(id.0.resource, None, |a| a == Access::Vertex)?;
            handles.push(self.handles.buffers[used.resource]);
            offsets.push(*offset);
        }
        let device = self.gpu.device();
        // SAFETY: `cmd` is recording; the buffers were declared as vertex buffers.
        unsafe { device.cmd_bind_vertex_buffers(self.cmd, 0, &handles, &offsets) };
        Ok(())
    }

    /// Binds a declared buffer of 32-bit indices.
    pub fn bind_indices(&mut self, id: BufferId, offset: u64) -> Result<(), GpuError> {
        let used = self.find(id.0.resource, None, |a| a == Access::Index)?;
        let buffer = self.handles.buffers[used.resource];
        let kind = vk::IndexType::UINT32;
        let device = self.gpu.device();
        // SAFETY: `cmd` is recording; the buffer was declared as an index buffer.
        unsafe { device.cmd_bind_index_buffer(self.cmd, buffer, offset, kind) };
        Ok(())
    }

    /// Draws vertices `first..first + count`, once for each instance.
    pub fn draw(&mut self, first: u32, count: u32, instances: u32) {
        let device = self.gpu.device();
        // SAFETY: `cmd` is recording inside rendering; the pipeline and its set are bound.
        unsafe { device.cmd_draw(self.cmd, count, instances, first, 0) };
    }

    /// Draws indices `first..first + count`, with `base_vertex` added to each.
    pub fn draw_indexed(&mut self, first: u32, count: u32, base_vertex: i32) {
        let device = self.gpu.device();
        // SAFETY: as for `draw`; an index buffer is bound.
        unsafe { device.cmd_draw_indexed(self.cmd, count, 1, first, base_vertex, 0) };
    }

    /// Draws what a declared buffer says (four `u32`: vertices, instances, first of each).
    pub fn draw_indirect(&mut self, arguments: BufferId, offset: u64) -> Result<(), GpuError> {
        let buffer = self.indirect(arguments)?;
        // SAFETY: as for `draw`; the buffer was declared for indirect arguments.
        unsafe {
            self.gpu
                .device()
                .cmd_draw_indirect(self.cmd, buffer, offset, 1, 16)
        };
        Ok(())
    }

    fn bind(
        &mut self,
        pipeline: &PipelineHandle,
        bindings: &[Bind],
        push: &[u8],
    ) -> Result<(), GpuError> {
        if push.len() != pipeline.push_bytes as usize {
            let wanted = pipeline.push_bytes;
            let problem = format!("pushes {} bytes, its shader takes {wanted}", push.len());
            return Err(misuse(self.pass, problem));
        }
        let mut set = None;
        if pipeline.has_bindings || !bindings.is_empty() {
            let mut writes = Vec::with_capacity(bindings.len());
            for bind in bindings {
                writes.push(SetWrite {
                    binding: bind.binding,
                    resource: self.resolve(bind)?,
                });
            }
            let allocated = self.gpu.allocate_set(pipeline)?;
            self.gpu.write_set(allocated, &writes)?;
            set = Some(allocated);
        }
        let (cmd, device) = (self.cmd, self.gpu.device());
        // SAFETY: `cmd` is recording; pipeline, layout and set belong to this device and go
        // together, and the push constants have the size of the layout's range.
        unsafe {
            device.cmd_bind_pipeline(cmd, pipeline.bind_point, pipeline.pipeline);
            if let Some(set) = set {
                let point = pipeline.bind_point;
                device.cmd_bind_descriptor_sets(cmd, point, pipeline.layout, 0, &[set], &[]);
            }
            if !push.is_empty() {
                let stages = pipeline.push_stages;
                device.cmd_push_constants(cmd, pipeline.layout, stages, 0, push);
            }
        }
        Ok(())
    }

    fn resolve(&mut self, bind: &Bind) -> Result<SetResource, GpuError> {
        match &bind.what {
            Bound::Sampled(id, sampler) => {
                let sampled = |a| matches!(a, Access::Sampled(_));
                let used = *self.find(id.0.resource, bind.part, sampled)?;
                let view = self.view(&used, bind)?;
                let sampler = self.gpu.sampler(sampler)?;
                Ok(SetResource::SampledImage {
                    view,
                    layout: vk::ImageLayout::READ_ONLY_OPTIMAL,
                    sampler,
                })
            }
            Bound::StorageImage(id) => {
                let used = *self.find(id.0.resource, bind.part, is_storage)?;
                let view = self.view(&used, bind)?;
                Ok(SetResource::StorageImage { view })
            }
            Bound::Uniform(id) => {
                let uniform = |a| matches!(a, Access::Uniform(_));
                let used = self.find(id.0.resource, bind.part, uniform)?;
                let (buffer, offset, range) = self.span(used);
                Ok(SetResource::UniformBuffer {
                    buffer,
                    offset,
                    range,
                })
            }
            Bound::StorageBuffer(id) => {
                let used = self.find(id.0.resource, bind.part, is_storage)?;
                let (buffer, offset, range) = self.span(used);
                Ok(SetResource::StorageBuffer {
                    buffer,
                    offset,
                    range,
                })
            }
            Bound::Texels(id, format) => {
                let texels = |a| matches!(a, Access::TexelRead(_));
                let used = *self.find(id.0.resource, bind.part, texels)?;
                let (buffer, offset, range) = self.span(&used);
                let name = &self.plan.resources[used.resource].name;
                let view = self
                    .gpu
                    .create_buffer_view(name, buffer, *format, offset, range)?;
                self.gpu.retire(crate::gpu::Retired::BufferView(view));
                Ok(SetResource::UniformTexelBuffer(view))
            }
        }
    }

    fn span(&self, used: &PlanUse) -> (vk::Buffer, u64, u64) {
        match used.part {
            Part::Buffer(part) => (self.handles.buffers[used.resource], part.offset, part.size),
            Part::Image(_) => (vk::Buffer::null(), 0, 0),
        }
    }

    fn view(&mut self, used: &PlanUse, bind: &Bind) -> Result<vk::ImageView, GpuError> {
        match bind.part.unwrap_or(used.part) {
            Part::Image(part) => {
                let array = bind.array || part.layers > 1;
                self.view_of(used.resource, part, array)
            }
            Part::Buffer(_) => Err(misuse(self.pass, "views a buffer as an image".to_string())),
        }
    }

    pub(super) fn view_of(
        &mut self,
        resource: usize,
        part: ImagePart,
        array: bool,
    ) -> Result<vk::ImageView, GpuError> {
        let Some(desc) = self.image_desc(resource) else {
            return Err(misuse(self.pass, "views a buffer as an image".to_string()));
        };
        let key = (resource, part, array);
        if let Some(view) = self.views.get(&key) {
            return Ok(*view);
        }
        let kind = if array {
            vk::ImageViewType::TYPE_2D_ARRAY
        } else {
            vk::ImageViewType::TYPE_2D
        };
        let view = self.gpu.create_view(
            &self.plan.resources[resource].name,
            self.handles.images[resource],
            kind,
            desc.format,
            part.subresource_range(desc.aspect()),
        )?;
        self.views.insert(key, view);
        Ok(view)
    }

    pub(super) fn image_desc(&self, resource: usize) -> Option<ImageDesc> {
        match self.plan.resources[resource].shape {
            ResourceShape::Image { desc, .. } => Some(desc),
            ResourceShape::Buffer { .. } => None,
        }
    }

    fn indirect(&self, id: BufferId) -> Result<vk::Buffer, GpuError> {
        let used = self.find(id.0.resource, None, |a| a == Access::Indirect)?;
        Ok(self.handles.buffers[used.resource])
    }

    /// The declared use of a resource that an operation needs.
    pub(super) fn find(
        &self,
        resource: u32,
        part: Option<Part>,
        fits: impl Fn(Access) -> bool,
    ) -> Result<&PlanUse, GpuError> {
        let resource = resource as usize;
        let mut uses = self.pass.uses.iter();
        let found = uses.find(|used| {
            let same_part = part.is_none_or(|part| part == used.part);
            used.resource == resource && same_part && fits(used.access)
        });
        found.ok_or_else(|| {
            let name = self.plan.resources.get(resource).map(|r| r.name.as_ref());
            let name = name.unwrap_or("another graph's resource");
            misuse(
                self.pass,
                format!("uses `{name}` in a way it did not declare"),
            )
        })
    }
}

fn is_storage(access: Access) -> bool {
    matches!(
        access,
        Access::StorageRead(_) | Access::StorageWrite(_) | Access::StorageReadWrite(_)
    )
}
