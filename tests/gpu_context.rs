//! Creating and destroying a device: nothing is left behind, misuse is seen, what is missing is
//! named.

mod support;

use std::path::PathBuf;
use std::time::Duration;

use antumbra::ash::vk;
use antumbra::gpu::{
    ComputePipelineDesc, Gpu, GpuError, GpuOptions, ImageSpec, MemoryLocation, MessageSeverity,
    Retired, SetWrite, enumerate,
};
use support::work::{COMPUTE, SCALE, STORAGE, bind, full_barrier, scale, storage};
use support::{assert_no_messages, compile, create, destroy_clean, gpu, options, serial};

#[test]
fn an_empty_frame_leaves_nothing_behind() {
    let _one = serial();
    let mut gpu = gpu();
    assert!(!gpu.is_hosted());
    assert!(!gpu.info().name.is_empty() && !gpu.info().driver_name.is_empty());
    assert!(gpu.info().api_version >= vk::API_VERSION_1_3);
    for _ in 0..3 {
        gpu.run(|_, _| Ok::<_, GpuError>(())).unwrap();
    }
    assert_eq!(gpu.pipelines_created(), 0);
    destroy_clean(gpu);
}

#[test]
fn a_device_can_be_made_again_and_again() {
    let _one = serial();
    for _ in 0..3 {
        destroy_clean(gpu());
    }
}

#[test]
fn an_object_that_is_left_over_is_reported_by_name() {
    let _one = serial();
    let mut gpu = gpu();
    let usage = vk::ImageUsageFlags::SAMPLED;
    let image = gpu
        .create_image(
            "forgotten image",
            &ImageSpec::new_2d(vk::Format::R8_UNORM, 4, 4, usage),
        )
        .unwrap();
    std::mem::forget(image);
    let messages = gpu.destroy().unwrap();
    assert!(
        messages
            .iter()
            .any(|m| m.severity == MessageSeverity::Error && m.text.contains("forgotten image")),
        "{messages:?}"
    );
}

#[test]
fn misuse_is_reported() {
    let _one = serial();
    let mut gpu = gpu();
    let info = vk::BufferCreateInfo::default().size(0).usage(STORAGE);
    // SAFETY: the size of 0 is wrong on purpose; the layer reports it, and the software drivers
    // take it.
    let made = unsafe { gpu.device().create_buffer(&info, None) };
    if let Ok(buffer) = made {
        // SAFETY: just created.
        unsafe { gpu.device().destroy_buffer(buffer, None) };
    }
    let messages = gpu.take_messages();
    assert!(
        messages
            .iter()
            .any(|m| m.id.contains("VUID-VkBufferCreateInfo-size-00912")),
        "{messages:?}"
    );
    assert!(gpu.messages().is_empty());
    destroy_clean(gpu);
}

#[test]
fn a_missing_barrier_is_reported() {
    let _one = serial();
    let mut gpu = gpu();
    let buffer = gpu
        .create_buffer(
            "raced",
            1024,
            vk::BufferUsageFlags::TRANSFER_DST,
            MemoryLocation::GpuOnly,
        )
        .unwrap();
    gpu.run(|gpu, cmd| -> Result<(), GpuError> {
        // SAFETY: recording; the missing barrier between the two writes is the point.
        unsafe {
            gpu.device()
                .cmd_fill_buffer(cmd, buffer.raw, 0, vk::WHOLE_SIZE, 1);
            gpu.device()
                .cmd_fill_buffer(cmd, buffer.raw, 0, vk::WHOLE_SIZE, 2);
        }
        Ok(())
    })
    .unwrap();
    gpu.destroy_buffer(buffer);
    let messages = gpu.destroy().unwrap();
    assert!(
        messages
            .iter()
            .any(|m| m.id.contains("SYNC-HAZARD")
                || m.text.contains("SYNC-HAZARD-WRITE-AFTER-WRITE")),
        "synchronization validation is not on: {messages:?}"
    );
}

#[test]
fn a_missing_barrier_between_dispatches_is_reported() {
    let _one = serial();
    let mut gpu = gpu();
    let shader = compile(COMPUTE, SCALE);
    let usage = STORAGE | vk::BufferUsageFlags::TRANSFER_DST;
    let buffers: Vec<_> = (0..3)
        .map(|i| {
            gpu.create_buffer(&format!("chain {i}"), 256, usage, MemoryLocation::GpuOnly)
                .unwrap()
        })
        .collect();
    let mut chain = |with_barrier: bool| {
        gpu.run(|gpu, cmd| -> Result<(), GpuError> {
            let pipeline = gpu.compute_pipeline(&ComputePipelineDesc::new(shader))?;
            for pair in buffers.windows(2) {
                let set = gpu.allocate_set(&pipeline)?;
                let writes = [
                    SetWrite {
                        binding: 0,
                        resource: storage(pair[0].raw),
                    },
                    SetWrite {
                        binding: 1,
                        resource: storage(pair[1].raw),
                    },
                ];
                gpu.write_set(set, &writes)?;
                bind(
                    gpu,
                    cmd,
                    &pipeline,
                    Some(set),
                    bytemuck::cast_slice(&[64, 1]),
                );
                // SAFETY: everything the dispatch needs is bound; the second reads what the first
                // wrote.
                unsafe { gpu.device().cmd_dispatch(cmd, 1, 1, 1) };
                if with_barrier {
                    full_barrier(gpu, cmd);
                }
            }
            Ok(())
        })
        .unwrap();
        gpu.take_messages()
    };
    assert_no_messages(&chain(true));
    let messages = chain(false);
    assert!(
        messages
            .iter()
            .any(|m| m.to_string().contains("SYNC-HAZARD-READ-AFTER-WRITE")),
        "the layer does not follow what shaders access: {messages:?}"
    );
    for buffer in buffers {
        gpu.destroy_buffer(buffer);
    }
    destroy_clean(gpu);
}

#[test]
fn an_unknown_device_is_an_error_that_lists_the_known_ones() {
    let _one = serial();
    let known = enumerate().unwrap();
    assert!(
        known.iter().any(|device| device.missing.is_empty()),
        "{known:?}"
    );
    let unknown = GpuOptions {
        device: Some("no such device".to_owned()),
        ..options()
    };
    let text = Gpu::create(&unknown).unwrap_err().to_string();
    assert!(
        text.contains("\"no such device\"") && text.contains(&known[0].info.name),
        "{text}"
    );
    assert!(!text.contains('\n'));
    let index = known
        .iter()
        .position(|device| device.missing.is_empty())
        .unwrap();
    let gpu = create(&GpuOptions {
        device: Some(index.to_string()),
        ..options()
    });
    assert_eq!(gpu.info().name, known[index].info.name);
    destroy_clean(gpu);
    let part = known[index].info.name[..4].to_uppercase();
    destroy_clean(create(&GpuOptions {
        device: Some(part),
        ..options()
    }));
}

#[test]
fn work_that_does_not_end_in_time_is_a_typed_error() {
    let _one = serial();
    // Without the layer, whose own checks could add to the time.
    let mut gpu = create(&GpuOptions {
        validation: false,
        ..options()
    });
    let shader = compile(
        COMPUTE,
        "#version 460
layout(local_size_x = 64) in;
layout(binding = 0, std430) buffer Out { uint value[]; };
void main() {
    uint x = gl_GlobalInvocationID.x;
    for (uint i = 0; i < 2000000u; ++i) x = x * 1664525u + value[x & 63u];
    value[gl_GlobalInvocationID.x & 63u] = x;
}
",
    );
    let buffer = gpu
        .create_buffer("out", 256, STORAGE, MemoryLocation::GpuOnly)
        .unwrap();
    gpu.set_time_limit(Duration::from_micros(1));
    let result = gpu.run(|gpu, cmd| -> Result<(), GpuError> {
        let pipeline = gpu.compute_pipeline(&ComputePipelineDesc::new(shader))?;
        let set = gpu.allocate_set(&pipeline)?;
        gpu.write_set(
            set,
            &[SetWrite {
                binding: 0,
                resource: storage(buffer.raw),
            }],
        )?;
        bind(gpu, cmd, &pipeline, Some(set), &[]);
        // SAFETY: everything the dispatch needs is bound.
        unsafe { gpu.device().cmd_dispatch(cmd, 8, 1, 1) };
        Ok(())
    });
    assert!(
        matches!(result, Err(GpuError::Timeout { .. })),
        "{result:?}"
    );
    let again = gpu.run(|_, _| Ok::<_, GpuError>(()));
    assert!(matches!(again, Err(GpuError::Busy { .. })), "{again:?}");
    gpu.set_time_limit(Duration::from_secs(300));
    gpu.retire(Retired::Buffer(buffer));
    assert_no_messages(&gpu.destroy().unwrap());
}

/// A folder of this test's own, gone at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("antumbra-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn the_pipeline_cache_survives_any_file() {
    let _one = serial();
    let folder = Folder::new("cache");
    let path = folder.0.join("below").join("pipelines.bin");
    let shader = compile(COMPUTE, SCALE);
    let run = || {
        let mut gpu = create(&GpuOptions {
            pipeline_cache: Some(path.clone()),
            ..options()
        });
        assert_eq!(scale(&mut gpu, shader, None, &[1, 2, 3], 2), [7, 9, 11]);
        destroy_clean(gpu);
        std::fs::read(&path).unwrap()
    };
    let good = run();
    assert!(good.starts_with(b"ANTUMBPC"));
    let written = std::fs::metadata(&path).unwrap().modified().unwrap();
    assert_eq!(run(), good, "the second run has nothing new");
    assert_eq!(
        std::fs::metadata(&path).unwrap().modified().unwrap(),
        written,
        "so it does not write"
    );

    let mut flipped = good.clone();
    *flipped.last_mut().unwrap() ^= 1;
    let mut foreign = good.clone();
    foreign[12] ^= 1;
    let truncated = good[..good.len() - 1].to_vec();
    for (what, content) in [
        ("empty", Vec::new()),
        ("truncated", truncated),
        ("truncated in the header", good[..40].to_vec()),
        ("of another vendor", foreign),
        ("flipped", flipped),
        ("something else", b"\x89PNG\r\n\x1a\n".repeat(1000)),
    ] {
        std::fs::write(&path, &content).unwrap();
        assert_eq!(run(), good, "a file that is {what} is replaced");
    }
    let names: Vec<_> = std::fs::read_dir(path.parent().unwrap())
        .unwrap()
        .flatten()
        .map(|e| e.file_name())
        .collect();
    assert_eq!(names, ["pipelines.bin"], "nothing written aside is left");

    // A path that cannot be a file.
    std::fs::remove_file(&path).unwrap();
    std::fs::create_dir(&path).unwrap();
    let gpu = create(&GpuOptions {
        pipeline_cache: Some(path.clone()),
        ..options()
    });
    destroy_clean(gpu);
    assert!(path.is_dir());
}

/// Not a test of its own: the tests below run it in a process with another environment.
#[test]
#[ignore = "run by other tests"]
fn child_that_creates_a_device() {
    match Gpu::create(&options()) {
        Ok(gpu) => {
            println!("created on {}", gpu.info().name);
            destroy_clean(gpu);
        }
        Err(error) => println!("error: {error}"),
    }
}

/// What creating a device says in a process with this environment.
fn creation_with(environment: &[(&str, &std::ffi::OsStr)]) -> String {
    let output = std::process::Command::new(std::env::current_exe().unwrap())
        .args([
            "--exact",
            "child_that_creates_a_device",
            "--ignored",
            "--nocapture",
        ])
        .env_remove("VK_ADD_LAYER_PATH")
        .envs(environment.iter().copied())
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.lines()
        .find_map(|line| line.split_once("error: "))
        .map_or(text.clone(), |(_, message)| message.to_owned())
}

#[test]
fn a_machine_without_driver_layer_or_loader_is_told_what_to_install() {
    let _one = serial();
    let nowhere = std::ffi::OsStr::new("/nonexistent");
    let text = creation_with(&[("VK_DRIVER_FILES", nowhere), ("VK_ICD_FILENAMES", nowhere)]);
    assert!(
        text.starts_with("no Vulkan driver found") && text.contains("mesa-vulkan-drivers"),
        "{text}"
    );
    let text = creation_with(&[("VK_LAYER_PATH", nowhere)]);
    assert!(
        text.starts_with("validation needs VK_LAYER_KHRONOS_validation")
            && text.contains("vulkan-validationlayers"),
        "{text}"
    );
    // A library of that name that is none stands for one that is missing.
    let folder = Folder::new("loader");
    std::fs::write(folder.0.join("libvulkan.so.1"), "not a library").unwrap();
    let text = creation_with(&[("LD_LIBRARY_PATH", folder.0.as_os_str())]);
    assert!(
        text.starts_with("cannot load the Vulkan loader") && text.contains("libvulkan1"),
        "{text}"
    );
    assert!(creation_with(&[]).contains("created on"));
}
