//! Functions of `glsl/common/` do the same as their Rust twins.

mod support;

use antumbra::gpu::{ComputePipelineDesc, GpuError, MemoryLocation, SetWrite};
use antumbra::scene::{Aabb, SceneCamera};
use glam::{UVec2, Vec3, Vec4};
use support::work::{COMPUTE, STORAGE, bind, full_barrier, storage};
use support::{compile, destroy_clean, gpu, serial};

/// One pixel a workgroup: in (x, y, depth, near) out (position, hit).
const POSITIONS: &str = "#version 460
#extension GL_GOOGLE_include_directive : require
#include \"common/depth.glsl\"
layout(local_size_x = 1) in;
layout(binding = 0, std430) readonly buffer In { vec4 source[]; };
layout(binding = 1, std430) writeonly buffer Out { vec4 result[]; };
layout(push_constant) uniform Push { uvec2 size_texels; float tan_half_fov; } push;
void main() {
    vec4 s = source[gl_WorkGroupID.x];
    vec3 position_vs = pixel_position_vs(uvec2(s.xy), push.size_texels, s.z, s.w, push.tan_half_fov);
    result[gl_WorkGroupID.x] = vec4(position_vs, is_hit(s.z) ? 1.0 : 0.0);
}
";

#[test]
fn a_pixel_and_its_depth_give_back_the_point_on_the_cameras_ray() {
    let _one = serial();
    let mut bounds = Aabb::default();
    bounds.insert(Vec3::splat(-2.0));
    bounds.insert(Vec3::splat(3.0));
    let camera = SceneCamera::framing(&bounds);
    let size = UVec2::new(97, 61);
    let aspect = size.x as f32 / size.y as f32;
    let (view, clip) = (camera.view(), camera.view_projection_reversed(aspect));
    let mut source = Vec::new();
    let mut expected = Vec::new();
    for (x, y) in [(0, 0), (96, 0), (48, 30), (13, 57), (96, 60)] {
        for distance in [1.5, 7.0, 400.0] {
            let ray = camera.ray(UVec2::new(x, y), size);
            let position = ray.origin + ray.direction * distance;
            let c = clip * position.extend(1.0);
            // The point is drawn at its pixel's centre.
            let at = (Vec4::new(c.x, c.y, 0.0, 0.0) / c.w * 0.5 + 0.5)
                * size.extend(0).extend(0).as_vec4();
            assert!(
                (at.x - x as f32 - 0.5).abs() < 1e-3 && (at.y - y as f32 - 0.5).abs() < 1e-3,
                "{at}"
            );
            source.push([x as f32, y as f32, c.z / c.w, camera.znear]);
            expected.push((view * position.extend(1.0)).truncate());
        }
    }
    // Nothing hit: finite, and no hit.
    source.push([5.0, 5.0, 0.0, camera.znear]);

    let mut gpu = gpu();
    let bytes = size_of_val(&source[..]) as u64;
    let mut input = gpu
        .create_buffer("pixels", bytes, STORAGE, MemoryLocation::CpuToGpu)
        .unwrap();
    let output = gpu
        .create_buffer("positions", bytes, STORAGE, MemoryLocation::GpuToCpu)
        .unwrap();
    input
        .mapped_mut()
        .unwrap()
        .copy_from_slice(bytemuck::cast_slice(&source));
    gpu.run(|gpu, cmd| -> Result<(), GpuError> {
        let pipeline =
            gpu.compute_pipeline(&ComputePipelineDesc::new(compile(COMPUTE, POSITIONS)))?;
        let set = gpu.allocate_set(&pipeline)?;
        let writes = [
            SetWrite {
                binding: 0,
                resource: storage(input.raw),
            },
            SetWrite {
                binding: 1,
                resource: storage(output.raw),
            },
        ];
        gpu.write_set(set, &writes)?;
        let push = [size.x, size.y, (camera.tan_half_fov() as f32).to_bits()];
        bind(gpu, cmd, &pipeline, Some(set), bytemuck::cast_slice(&push));
        // SAFETY: everything the dispatch needs is bound.
        unsafe { gpu.device().cmd_dispatch(cmd, source.len() as u32, 1, 1) };
        full_barrier(gpu, cmd);
        Ok(())
    })
    .unwrap();
    let results: Vec<[f32; 4]> = bytemuck::cast_slice(output.mapped().unwrap()).to_vec();
    for ((result, expected), source) in results.iter().zip(&expected).zip(&source) {
        let position = Vec3::from_slice(result);
        let error = (position - *expected).length() / expected.length();
        assert!(error < 1e-5, "{source:?}: {position} is not {expected}");
        assert_eq!(result[3], 1.0);
    }
    let miss = results[expected.len()];
    assert!(
        miss.iter().all(|v| v.is_finite()) && miss[3] == 0.0,
        "{miss:?}"
    );
    gpu.destroy_buffer(input);
    gpu.destroy_buffer(output);
    destroy_clean(gpu);
}
