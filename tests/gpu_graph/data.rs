//! Known bytes through long graphs: sharing memory, taking turns with history images, and reusing
//! last frame's transients change none of them.

use antumbra::ash::vk;
use antumbra::gpu::{
    Buffer, ComputePipelineDesc, DepthState, Gpu, GpuError, GraphicsPipelineDesc, MemoryLocation,
    SamplerDesc, Shader,
};
use antumbra::graph::{
    Access, Bind, BufferDesc, BufferId, BufferPart, BufferState, FrameCache, Graph, HostBuffer,
    ImageDesc, ImageId, ImagePart, Load, PassKind, Stage,
};

use crate::layer::assert_current_layer;
use crate::support::{assert_no_messages, compile, destroy_clean, gpu, serial};

const SIDE: u32 = 32;
const TEXELS: usize = (SIDE * SIDE) as usize;
const BYTES: u64 = TEXELS as u64 * 4;
const R32F: vk::Format = vk::Format::R32_SFLOAT;
const SAMPLED: Access = Access::Sampled(Stage::Compute);
const WRITE: Access = Access::StorageWrite(Stage::Compute);

/// `result = 2 source + 1`.
const TWICE: &str = "#version 460
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform sampler2D source;
layout(binding = 1, r32f) uniform writeonly image2D result;
void main() {
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    imageStore(result, p, vec4(2.0 * texelFetch(source, p, 0).r + 1.0));
}
";

/// Sums of neighbours, plus a constant from a buffer of its own.
const SUMS: &str = "#version 460
layout(local_size_x = 64) in;
layout(binding = 0, std430) readonly buffer A { float source[]; };
layout(binding = 1, std430) writeonly buffer B { float result[]; };
layout(binding = 2, std140) uniform C { vec4 constants[16]; };
void main() {
    uint i = gl_GlobalInvocationID.x;
    result[i] = source[i] + source[(i + 1u) % source.length()] + constants[i % 16u][i % 4u];
}
";

const FULL_SCREEN: &str = "#version 460
void main() {
    float x = gl_VertexIndex == 1 ? 3.0 : -1.0, y = gl_VertexIndex == 2 ? 3.0 : -1.0;
    gl_Position = vec4(x, y, 0.25, 1.0);
}
";

/// `result = source / 2`, where the depth test lets it.
const HALF: &str = "#version 460
layout(binding = 0) uniform sampler2D source;
layout(location = 0) out float result;
void main() { result = 0.5 * texelFetch(source, ivec2(gl_FragCoord.xy), 0).r; }
";

/// Means of two by two texels.
const MEANS: &str = "#version 460
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform sampler2D source;
layout(binding = 1, r32f) uniform writeonly image2D result;
void main() {
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, imageSize(result)))) return;
    float sum = 0.0;
    for (int i = 0; i < 4; ++i) sum += texelFetch(source, 2 * p + ivec2(i & 1, i >> 1), 0).r;
    imageStore(result, p, vec4(0.25 * sum));
}
";

struct Shaders {
    twice: &'static Shader,
    sums: &'static Shader,
    full_screen: &'static Shader,
    half: &'static Shader,
    means: &'static Shader,
}

impl Shaders {
    fn new() -> Self {
        use vk::ShaderStageFlags as S;
        Self {
            twice: compile(S::COMPUTE, TWICE),
            sums: compile(S::COMPUTE, SUMS),
            full_screen: compile(S::VERTEX, FULL_SCREEN),
            half: compile(S::FRAGMENT, HALF),
            means: compile(S::COMPUTE, MEANS),
        }
    }
}

fn host_buffer(gpu: &mut Gpu, name: &str, bytes: u64, location: MemoryLocation) -> Buffer {
    let usage = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
    gpu.create_buffer(name, bytes, usage, location).unwrap()
}

fn import(
    graph: &mut Graph<'_>,
    name: &'static str,
    buffer: &Buffer,
    leave: BufferState,
) -> BufferId {
    graph.import_buffer(
        name,
        HostBuffer {
            buffer: buffer.raw,
            desc: BufferDesc { size: buffer.size },
            usage: buffer.usage,
            enter: BufferState::IDLE,
            leave,
        },
    )
}

/// Bytes of the output: the last image, and its chain of means of three levels.
const OUTPUT: u64 = BYTES + BYTES + BYTES / 4 + BYTES / 16;

/// A long chain of passes of all kinds. With `keep` no two transients can share memory.
fn chain<'f>(shaders: &'f Shaders, input: &Buffer, output: &Buffer, keep: bool) -> Graph<'f> {
    let mut graph = Graph::new();
    let desc = ImageDesc::new(R32F, SIDE, SIDE);
    let input = import(&mut graph, "input", input, BufferState::IDLE);
    let mut output = import(&mut graph, "output", output, BufferState::HOST_READ);

    let loaded = graph.create_image("loaded", desc);
    let mut pass = graph.pass("upload", PassKind::Transfer);
    pass.read(input, Access::CopyRead);
    let loaded = pass.overwrite(loaded, Access::CopyWrite);
    pass.record(move |c| c.copy_buffer_to_image(input, 0, loaded, ImagePart::mip(0)));

    let doubled = graph.create_image("doubled", desc);
    let doubled = twice(&mut graph, shaders, "double", loaded, doubled);

    let list = graph.create_buffer("list", BufferDesc { size: BYTES });
    let mut pass = graph.pass("to buffer", PassKind::Transfer);
    pass.read(doubled, Access::CopyRead);
    let list = pass.overwrite(list, Access::CopyWrite);
    pass.record(move |c| c.copy_image_to_buffer(doubled, ImagePart::mip(0), list, 0));

    let constants = graph.create_buffer("constants", BufferDesc { size: 256 });
    let mut pass = graph.pass("fill", PassKind::Transfer);
    let constants = pass.overwrite(constants, Access::Clear);
    pass.record(move |c| {
        let part = BufferPart {
            offset: 0,
            size: 256,
        };
        c.fill_buffer(constants, part, 8f32.to_bits())
    });

    let copy = graph.create_buffer("copy", BufferDesc { size: BYTES });
    let mut pass = graph.pass("copy", PassKind::Transfer);
    pass.read(list, Access::CopyRead);
    let copy = pass.overwrite(copy, Access::CopyWrite);
    pass.record(move |c| c.copy_buffer(list, 0, copy, 0, BYTES));

    let sums = graph.create_buffer("sums", BufferDesc { size: BYTES });
    let mut pass = graph.pass("sums", PassKind::Compute);
    pass.read(copy, Access::StorageRead(Stage::Compute));
    pass.read(constants, Access::Uniform(Stage::Compute));
    let sums = pass.overwrite(sums, WRITE);
    pass.record(move |c| {
        let binds = [
            Bind::storage_buffer(0, copy),
            Bind::storage_buffer(1, sums),
            Bind::uniform(2, constants),
        ];
        c.bind_compute(&ComputePipelineDesc::new(shaders.sums), &binds, &[])?;
        c.dispatch([TEXELS as u32 / 64, 1, 1]);
        Ok(())
    });

    let summed = graph.create_image("summed", desc);
    let mut pass = graph.pass("to image", PassKind::Transfer);
    pass.read(sums, Access::CopyRead);
    let summed = pass.overwrite(summed, Access::CopyWrite);
    pass.record(move |c| c.copy_buffer_to_image(sums, 0, summed, ImagePart::mip(0)));

    let (depth, halved) = (
        graph.create_image("depth", ImageDesc::new(vk::Format::D32_SFLOAT, SIDE, SIDE)),
        graph.create_image("halved", desc),
    );
    let mut pass = graph.pass("half", PassKind::Graphics);
    let halved = pass.color(halved, Load::Clear([-1.0; 4]));
    let depth = pass.depth(depth, Load::Clear([0.5; 4]));
    pass.read(summed, Access::Sampled(Stage::Fragment));
    pass.record(move |c| {
        let mut pipeline = GraphicsPipelineDesc::new(shaders.full_screen, Some(shaders.half));
        pipeline.depth = Some(DepthState {
            compare: vk::CompareOp::LESS,
            write: true,
        });
        let source = Bind::sampled(0, summed, SamplerDesc::nearest());
        c.bind_graphics(pipeline, &[source], &[])?;
        c.draw(0, 3, 1);
        Ok(())
    });

    // Nothing passes this test: the depth is now a quarter everywhere.
    let mut pass = graph.pass("hidden", PassKind::Graphics);
    let halved = pass.color(halved, Load::Keep);
    pass.depth_test(depth);
    pass.read(doubled, Access::Sampled(Stage::Fragment));
    pass.record(move |c| {
        let mut pipeline = GraphicsPipelineDesc::new(shaders.full_screen, Some(shaders.half));
        pipeline.depth = Some(DepthState {
            compare: vk::CompareOp::LESS,
            write: false,
        });
        let source = Bind::sampled(0, doubled, SamplerDesc::nearest());
        c.bind_graphics(pipeline, &[source], &[])?;
        c.draw(0, 3, 1);
        Ok(())
    });

    let mut levels = graph.create_image("levels", desc.mips(3));
    let mut pass = graph.pass("level 0", PassKind::Compute);
    pass.read(halved, SAMPLED);
    levels = pass.overwrite_part(levels, ImagePart::mip(0), WRITE);
    record_twice(pass, shaders, halved, levels, SIDE);
    for mip in 1..3 {
        let mut pass = graph.pass(format!("level {mip}"), PassKind::Compute);
        pass.read_part(levels, ImagePart::mip(mip - 1), SAMPLED);
        levels = pass.overwrite_part(levels, ImagePart::mip(mip), WRITE);
        pass.record(move |c| {
            let binds = [
                Bind::sampled(0, levels, SamplerDesc::nearest()),
                Bind::storage_image(1, levels),
            ];
            c.bind_compute(&ComputePipelineDesc::new(shaders.means), &binds, &[])?;
            c.dispatch([(SIDE >> mip).div_ceil(8), (SIDE >> mip).div_ceil(8), 1]);
            Ok(())
        });
    }

    let mut pass = graph.pass("read back", PassKind::Transfer);
    pass.read(halved, Access::CopyRead);
    pass.read(levels, Access::CopyRead);
    output = pass.overwrite(output, Access::CopyWrite);
    pass.record(move |c| {
        c.copy_image_to_buffer(halved, ImagePart::mip(0), output, 0)?;
        let mut offset = BYTES;
        for mip in 0..3 {
            c.copy_image_to_buffer(levels, ImagePart::mip(mip), output, offset)?;
            offset += BYTES >> (2 * mip);
        }
        Ok(())
    });
    if keep {
        for image in [loaded, doubled, summed, depth, halved, levels] {
            graph.keep(image);
        }
        for buffer in [list, constants, copy, sums] {
            graph.keep(buffer);
        }
    }
    graph
}

fn twice<'f>(
    graph: &mut Graph<'f>,
    shaders: &'f Shaders,
    name: &'static str,
    source: ImageId,
    result: ImageId,
) -> ImageId {
    let mut pass = graph.pass(name, PassKind::Compute);
    pass.read(source, SAMPLED);
    let result = pass.overwrite(result, WRITE);
    record_twice(pass, shaders, source, result, SIDE);
    result
}

fn record_twice<'f>(
    pass: antumbra::graph::PassBuilder<'_, 'f>,
    shaders: &'f Shaders,
    source: ImageId,
    result: ImageId,
    side: u32,
) {
    pass.record(move |c| {
        let binds = [
            Bind::sampled(0, source, SamplerDesc::nearest()),
            Bind::storage_image(1, result),
        ];
        c.bind_compute(&ComputePipelineDesc::new(shaders.twice), &binds, &[])?;
        c.dispatch([side / 8, side / 8, 1]);
        Ok(())
    });
}

/// What the chain makes of its input; every number is exact in 32-bit floats.
fn expected(input: &[f32]) -> Vec<f32> {
    let doubled: Vec<f32> = input.iter().map(|x| 2.0 * x + 1.0).collect();
    let sums = (0..TEXELS).map(|i| doubled[i] + doubled[(i + 1) % TEXELS] + 8.0);
    let halved: Vec<f32> = sums.map(|x| 0.5 * x).collect();
    let mut level: Vec<f32> = halved.iter().map(|x| 2.0 * x + 1.0).collect();
    let mut out = halved;
    let mut side = SIDE as usize;
    out.extend(&level);
    for _ in 1..3 {
        let half = side / 2;
        let means = (0..half * half).map(|i| {
            let (x, y) = (i % half, i / half);
            let at = |dx: usize, dy: usize| level[(2 * y + dy) * side + 2 * x + dx];
            0.25 * (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1))
        });
        level = means.collect();
        side = half;
        out.extend(&level);
    }
    out
}

#[test]
fn sharing_memory_changes_no_byte() {
    let _one = serial();
    assert_current_layer();
    let mut gpu = gpu();
    let shaders = Shaders::new();
    let mut input = host_buffer(&mut gpu, "input", BYTES, MemoryLocation::CpuToGpu);
    let mut output = host_buffer(&mut gpu, "output", OUTPUT, MemoryLocation::GpuToCpu);
    let (mut shared, mut apart) = (FrameCache::new(), FrameCache::new());
    for frame in 0..4 {
        let numbers: Vec<f32> = (0..TEXELS)
            .map(|i| ((i * 37 + frame * 11) % 1009) as f32)
            .collect();
        input.mapped_mut().unwrap()[..BYTES as usize]
            .copy_from_slice(bytemuck::cast_slice(&numbers));
        let mut results = Vec::new();
        for keep in [false, true] {
            output.mapped_mut().unwrap().fill(0xff);
            let cache = if keep { &mut apart } else { &mut shared };
            let compiled = chain(&shaders, &input, &output, keep)
                .compile(&gpu)
                .unwrap();
            let (peak, sum) = (
                compiled.plan().peak_bytes(),
                compiled.plan().unaliased_bytes(),
            );
            assert_eq!(keep, peak == sum, "{peak} of {sum} bytes");
            gpu.run(|gpu, cmd| compiled.record(gpu, cache, cmd))
                .unwrap();
            let bytes = &output.mapped().unwrap()[..OUTPUT as usize];
            results.push(bytemuck::pod_collect_to_vec::<u8, f32>(bytes));
        }
        assert_eq!(
            results[0], results[1],
            "frame {frame}: shared memory or not"
        );
        assert_eq!(results[0], expected(&numbers), "frame {frame}");
    }
    for cache in [shared, apart] {
        cache.destroy(&mut gpu);
    }
    assert_no_messages(&gpu.take_messages());
    gpu.destroy_buffer(input);
    gpu.destroy_buffer(output);
    destroy_clean(gpu);
}

#[test]
fn history_carries_over_from_frame_to_frame() {
    let _one = serial();
    assert_current_layer();
    let mut gpu = gpu();
    let shaders = Shaders::new();
    let output = host_buffer(&mut gpu, "output", BYTES, MemoryLocation::GpuToCpu);
    let mut cache = FrameCache::new();
    let mut value = 0.0f32;
    // The shape changes in frame 4, and frame 6 reads the history without writing it.
    for frame in 0..9 {
        let side = if frame < 4 { SIDE } else { SIDE / 2 };
        let texels = (side * side) as usize;
        let mut graph = Graph::continuing(cache.history());
        let sum = graph.history_image("sum", ImageDesc::new(R32F, side, side));
        let first = frame == 0 || frame == 4;
        // What is declared and not written is not there in the next frame.
        let lost = frame == 7;
        assert_eq!(sum.previous.is_none(), first || lost, "frame {frame}");
        let mut out = import(&mut graph, "output", &output, BufferState::HOST_READ);
        let mut newest = sum.previous;
        if frame != 6 {
            value = if sum.previous.is_some() {
                2.0 * value + 1.0
            } else {
                3.0
            };
            let source = sum.previous.unwrap_or_else(|| {
                let one = graph.create_image("one", ImageDesc::new(R32F, side, side));
                let mut pass = graph.pass("begin", PassKind::Transfer);
                let one = pass.overwrite(one, Access::Clear);
                pass.record(move |c| c.clear_image(one, [1.0; 4]));
                one
            });
            let mut pass = graph.pass("advance", PassKind::Compute);
            pass.read(source, SAMPLED);
            let current = pass.overwrite(sum.current, WRITE);
            record_twice(pass, &shaders, source, current, side);
            newest = Some(current);
        }
        let newest = newest.unwrap();
        let mut pass = graph.pass("read back", PassKind::Transfer);
        pass.read(newest, Access::CopyRead);
        out = pass.overwrite(out, Access::CopyWrite);
        pass.record(move |c| c.copy_image_to_buffer(newest, ImagePart::mip(0), out, 0));
        let compiled = graph.compile(&gpu).unwrap();
        gpu.run(|gpu, cmd| compiled.record(gpu, &mut cache, cmd))
            .unwrap();
        let bytes = &output.mapped().unwrap()[..texels * 4];
        let found = bytemuck::pod_collect_to_vec::<u8, f32>(bytes);
        assert_eq!(found, vec![value; texels], "frame {frame}");
        assert_no_messages(&gpu.take_messages());
    }
    cache.destroy(&mut gpu);
    gpu.destroy_buffer(output);
    destroy_clean(gpu);
}

#[test]
fn a_pass_is_refused_what_it_did_not_declare() {
    let _one = serial();
    assert_current_layer();
    let mut gpu = gpu();
    let shaders = Shaders::new();
    let mut cache = FrameCache::new();
    let mut graph = Graph::new();
    let desc = ImageDesc::new(R32F, SIDE, SIDE);
    let (source, result) = (
        graph.create_image("source", desc),
        graph.create_image("result", desc),
    );
    let mut pass = graph.pass("clear", PassKind::Transfer);
    let source = pass.overwrite(source, Access::Clear);
    pass.record(move |c| c.clear_image(source, [1.0; 4]));
    let mut pass = graph.pass("forgetful", PassKind::Compute);
    let result = pass.overwrite(result, WRITE);
    record_twice(pass, &shaders, source, result, SIDE);
    graph.keep(source);
    graph.keep(result);
    let compiled = graph.compile(&gpu).unwrap();
    let error = gpu
        .run(|gpu, cmd| compiled.record(gpu, &mut cache, cmd))
        .unwrap_err();
    let text = error.to_string();
    assert!(matches!(error, GpuError::Invalid { .. }), "{text}");
    assert!(
        text.contains("`forgetful`") && text.contains("`source`"),
        "{text}"
    );
    cache.destroy(&mut gpu);
    destroy_clean(gpu);
}
