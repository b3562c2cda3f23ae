//! The engine's own passes: a G-buffer before the shadow, lighting after it.

use antumbra::renderer::PixelCamera;
use antumbra::scene::SceneCamera;
use glam::{Mat4, Vec3};
use wgpu::util::DeviceExt as _;

use crate::engine::Engine;
use crate::{Outcome, SIZE};

/// Images and pipelines of the engine's passes.
pub struct Passes {
    pub view_depth: wgpu::Texture,
    pub normal: wgpu::Texture,
    pub visibility: wgpu::Texture,
    depth: wgpu::Texture,
    color: wgpu::Texture,
    picture: wgpu::Buffer,
    vertices: wgpu::Buffer,
    vertex_count: u32,
    camera: wgpu::Buffer,
    view: wgpu::Buffer,
    surfaces: wgpu::RenderPipeline,
    lighting: wgpu::RenderPipeline,
    surfaces_group: wgpu::BindGroup,
    lighting_group: wgpu::BindGroup,
}

impl Passes {
    pub fn new(engine: &Engine, triangles: &[[Vec3; 3]]) -> Self {
        let Engine { device, queue } = engine;
        use wgpu::{BufferUsages as B, TextureFormat as F, TextureUsages as T};
        let drawn = T::RENDER_ATTACHMENT | T::TEXTURE_BINDING;
        let texture = |label, format, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: EXTENT,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage,
                view_formats: &[],
            })
        };
        let view_depth = texture("view depth", F::R32Float, drawn);
        let normal = texture("normal", F::R32Uint, drawn);
        let visibility = texture("visibility", F::R32Float, T::COPY_DST | T::TEXTURE_BINDING);
        // To wgpu a texture that it never wrote is empty, and is cleared when it is first read: after ours.
        let white = vec![1.0f32; (SIZE * SIZE) as usize];
        queue.write_texture(
            visibility.as_image_copy(),
            bytemuck::cast_slice(&white),
            ROWS,
            EXTENT,
        );
        let depth = texture("depth", F::Depth32Float, T::RENDER_ATTACHMENT);
        let color = texture("color", F::Rgba8Unorm, T::RENDER_ATTACHMENT | T::COPY_SRC);
        let buffer = |label, size, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let picture = buffer(
            "picture",
            u64::from(SIZE * SIZE * 4),
            B::COPY_DST | B::MAP_READ,
        );
        let camera = buffer("camera", 96, B::UNIFORM | B::COPY_DST);
        let view = buffer("view", 80, B::UNIFORM | B::COPY_DST);
        let corners: Vec<[Vec3; 2]> = (triangles.iter())
            .flat_map(|triangle| triangle.map(|corner| [corner, crate::normal_of(triangle)]))
            .collect();
        let vertices = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("vertices"),
            contents: bytemuck::cast_slice(&corners),
            usage: B::VERTEX,
        });

        let layout = wgpu::VertexBufferLayout {
            array_stride: size_of::<[Vec3; 2]>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3],
        };
        let surfaces = pipeline(
            device,
            wgpu::include_wgsl!("surfaces.wgsl"),
            &[Some(layout)],
            &[view_depth.format(), normal.format()],
            Some(depth.format()),
        );
        let lighting = pipeline(
            device,
            wgpu::include_wgsl!("lighting.wgsl"),
            &[],
            &[color.format()],
            None,
        );
        let views = [&view_depth, &normal, &visibility].map(view_of);
        let surfaces_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("surfaces"),
            layout: &surfaces.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: camera.as_entire_binding(),
            }],
        });
        let images = (1..)
            .zip(&views)
            .map(|(binding, view)| wgpu::BindGroupEntry {
                binding,
                resource: wgpu::BindingResource::TextureView(view),
            });
        let first = wgpu::BindGroupEntry {
            binding: 0,
            resource: view.as_entire_binding(),
        };
        let entries: Vec<_> = std::iter::once(first).chain(images).collect();
        let lighting_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("lighting"),
            layout: &lighting.get_bind_group_layout(0),
            entries: &entries,
        });
        Self {
            view_depth,
            normal,
            visibility,
            depth,
            color,
            picture,
            vertices,
            vertex_count: corners.len() as u32,
            camera,
            view,
            surfaces,
            lighting,
            surfaces_group,
            lighting_group,
        }
    }

    /// What the next submission's shaders know of camera and lamp.
    pub fn place(&self, queue: &wgpu::Queue, camera: &SceneCamera, lamp: Vec3) {
        // wgpu turns clip space upside down for Vulkan.
        let clip =
            Mat4::from_scale(Vec3::new(1.0, -1.0, 1.0)) * camera.view_projection_reversed(1.0);
        let eye = camera.position.extend(0.0).to_array();
        let forward = camera.forward.extend(0.0).to_array();
        queue.write_buffer(&self.camera, 0, bytemuck::bytes_of(&clip.to_cols_array()));
        queue.write_buffer(&self.camera, 64, bytemuck::bytes_of(&[eye, forward]));
        let pixels = PixelCamera::new(camera, [SIZE; 2]);
        let lamp = lamp.extend(0.0).to_array();
        let view = [
            pixels.eye,
            pixels.corner_ray,
            pixels.pixel_right,
            pixels.pixel_down,
            lamp,
        ];
        queue.write_buffer(&self.view, 0, bytemuck::bytes_of(&view));
    }

    pub fn draw_surfaces(&self, encoder: &mut wgpu::CommandEncoder) {
        let views = [&self.view_depth, &self.normal].map(view_of);
        let depth = view_of(&self.depth);
        let attachments = views.each_ref().map(cleared);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("surfaces"),
            color_attachments: &attachments,
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.surfaces);
        pass.set_bind_group(0, &self.surfaces_group, &[]);
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        pass.draw(0..self.vertex_count, 0..1);
    }

    /// Draws the picture and copies it to where [`read`](Self::read) finds it.
    pub fn draw_lighting(&self, encoder: &mut wgpu::CommandEncoder) {
        let color = view_of(&self.color);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("lighting"),
            color_attachments: &[cleared(&color)],
            ..Default::default()
        });
        pass.set_pipeline(&self.lighting);
        pass.set_bind_group(0, &self.lighting_group, &[]);
        pass.draw(0..3, 0..1);
        drop(pass);
        encoder.copy_texture_to_buffer(
            self.color.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &self.picture,
                layout: ROWS,
            },
            EXTENT,
        );
    }

    /// RGBA, 8 bits each, rows from the top, of the last picture.
    pub fn read(&self, engine: &Engine) -> Outcome<Vec<u8>> {
        let (send, receive) = std::sync::mpsc::channel();
        let slice = self.picture.slice(..);
        slice.map_async(wgpu::MapMode::Read, move |mapped| {
            // Nobody is left to listen only if waiting failed.
            let _ = send.send(mapped);
        });
        engine.wait(None)?;
        receive.recv()??;
        let bytes = slice.get_mapped_range()?.to_vec();
        self.picture.unmap();
        Ok(bytes)
    }
}

const EXTENT: wgpu::Extent3d = wgpu::Extent3d {
    width: SIZE,
    height: SIZE,
    depth_or_array_layers: 1,
};

/// Rows of four bytes a pixel.
const ROWS: wgpu::TexelCopyBufferLayout = wgpu::TexelCopyBufferLayout {
    offset: 0,
    bytes_per_row: Some(4 * SIZE),
    rows_per_image: None,
};

fn view_of(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&Default::default())
}

fn cleared(view: &wgpu::TextureView) -> Option<wgpu::RenderPassColorAttachment<'_>> {
    Some(wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations {
            load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
            store: wgpu::StoreOp::Store,
        },
    })
}

fn pipeline(
    device: &wgpu::Device,
    shader: wgpu::ShaderModuleDescriptor<'_>,
    buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
    formats: &[wgpu::TextureFormat],
    depth: Option<wgpu::TextureFormat>,
) -> wgpu::RenderPipeline {
    let label = shader.label;
    let module = device.create_shader_module(shader);
    let targets: Vec<_> = (formats.iter())
        .map(|format| Some((*format).into()))
        .collect();
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label,
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            buffers,
        },
        primitive: Default::default(),
        depth_stencil: depth.map(|format| wgpu::DepthStencilState {
            format,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}
