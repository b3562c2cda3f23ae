//! What the integration tests share: a validated device, shaders compiled in the test, and layouts
//! read from SPIR-V.

#![allow(
    dead_code,
    unused_imports,
    reason = "each test binary uses its own part"
)]

pub mod faults;
#[path = "../../build/glsl.rs"]
pub mod glsl;
pub mod host;
pub mod plates;
pub mod reflect;
pub mod rig;
pub mod work;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

use antumbra::ash::vk;
use antumbra::gpu::{BindingInfo, Gpu, GpuError, GpuOptions, Shader, ValidationMessage};

/// GPU tests run one at a time: they share the machine's cores with the software driver.
pub fn serial() -> MutexGuard<'static, ()> {
    static ONE: Mutex<()> = Mutex::new(());
    ONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Options of [`gpu`]: the first device, or the one that `ANTUMBRA_DEVICE` names, under the
/// validation layer.
pub fn options() -> GpuOptions {
    GpuOptions {
        device: std::env::var("ANTUMBRA_DEVICE").ok(),
        validation: true,
        application_name: "antumbra tests".to_owned(),
        ..Default::default()
    }
}

/// A device under the validation layer. Not having either is a failure, and the message says what
/// to install.
#[track_caller]
pub fn gpu() -> Gpu {
    create(&options())
}

/// As [`gpu`], with other options.
#[track_caller]
pub fn create(options: &GpuOptions) -> Gpu {
    match Gpu::create(options) {
        Ok(gpu) => gpu,
        Err(error) => panic!("the tests need a Vulkan driver and the validation layer: {error}"),
    }
}

/// Destroys a device and fails when the layer had anything to say, leaked objects included.
#[track_caller]
pub fn destroy_clean(gpu: Gpu) {
    let messages = gpu
        .destroy()
        .unwrap_or_else(|error| panic!("destroy: {error}"));
    assert_no_messages(&messages);
}

/// Fails when there is any message, and shows them all.
#[track_caller]
pub fn assert_no_messages(messages: &[ValidationMessage]) {
    let lines: Vec<String> = messages.iter().map(ToString::to_string).collect();
    assert!(
        messages.is_empty(),
        "{} validation message(s):\n{}",
        lines.len(),
        lines.join("\n")
    );
}

/// The folder of the shaders.
pub fn glsl_root() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl")
}

/// Compiles a GLSL source of a test into a shader that lives as long as the process, the same one when it is asked for
/// again. Includes come from `glsl/`.
#[track_caller]
pub fn compile(stage: vk::ShaderStageFlags, source: &str) -> &'static Shader {
    type Compiled = BTreeMap<(u32, String), &'static Shader>;
    static COMPILED: Mutex<Compiled> = Mutex::new(BTreeMap::new());
    let compiled = || COMPILED.lock().unwrap_or_else(PoisonError::into_inner);
    let key = (stage.as_raw(), source.to_owned());
    if let Some(shader) = compiled().get(&key) {
        return shader;
    }
    let shader = compile_anew(stage, source);
    compiled().insert(key, shader);
    shader
}

#[track_caller]
fn compile_anew(stage: vk::ShaderStageFlags, source: &str) -> &'static Shader {
    let (kind, file) = match stage {
        vk::ShaderStageFlags::VERTEX => (shaderc::ShaderKind::Vertex, "test.vert"),
        vk::ShaderStageFlags::FRAGMENT => (shaderc::ShaderKind::Fragment, "test.frag"),
        vk::ShaderStageFlags::COMPUTE => (shaderc::ShaderKind::Compute, "test.comp"),
        other => panic!("no shader stage of ours: {other:?}"),
    };
    let root = glsl_root();
    let build = |goal| match glsl::compile(source, file, kind, &root, goal) {
        Ok(compiled) => compiled,
        Err(problems) => panic!("the test's shader does not compile:\n{problems}"),
    };
    let (declared, code) = (
        build(glsl::Goal::Reflection),
        build(glsl::Goal::Performance),
    );
    let interface = match reflect::Reflection::new(&declared.words).and_then(|r| r.interface()) {
        Ok(interface) => interface,
        Err(problem) => panic!("the test's shader: {problem}"),
    };
    let bindings: Vec<BindingInfo> = interface
        .bindings
        .into_iter()
        .map(|b| BindingInfo {
            binding: b.binding,
            kind: vk::DescriptorType::from_raw(b.kind as i32),
            count: b.count,
            name: b.name.leak(),
        })
        .collect();
    Box::leak(Box::new(Shader {
        name: file,
        stage,
        words: code.words.leak(),
        bindings: bindings.leak(),
        push_constant_bytes: interface.push_constant_bytes,
        workgroup: interface.workgroup,
    }))
}
