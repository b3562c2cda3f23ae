//! Compiles every shader of `glsl/` to SPIR-V and writes the constants of `gpu::spirv`.

#[path = "build/glsl.rs"]
mod glsl;
#[path = "build/reflect.rs"]
#[allow(dead_code, reason = "the tests use more of it")]
mod reflect;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};

use glsl::{Goal, kind_of};
use reflect::{Kind, Reflection};

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(problems) => {
            for problem in problems.lines() {
                println!("cargo::error={problem}");
            }
            ExitCode::FAILURE
        }
    }
}

fn variable(name: &str) -> Result<PathBuf, String> {
    std::env::var_os(name)
        .map(PathBuf::from)
        .ok_or_else(|| format!("cargo did not set {name}"))
}

fn run() -> Result<(), String> {
    let root = variable("CARGO_MANIFEST_DIR")?.join("glsl");
    let out = variable("OUT_DIR")?;
    for file in ["build.rs", "build/glsl.rs", "build/reflect.rs"] {
        println!("cargo::rerun-if-changed={file}");
    }
    // A folder is followed to its files, so that new and removed ones count as changes.
    println!("cargo::rerun-if-changed=glsl");
    let mut files = Vec::new();
    if root.is_dir() {
        collect(&root, &mut files)?;
    }
    files.sort();

    let mut statics = String::new();
    let mut names: BTreeMap<String, String> = BTreeMap::new();
    let mut problems = Vec::new();
    let mut jobs = Vec::new();
    for path in &files {
        let name = shader_name(&root, path);
        let constant = constant_name(&name);
        if let Some(other) = names.insert(constant.clone(), name.clone()) {
            problems.push(format!(
                "glsl/{name}: error: it and glsl/{other} would both be {constant}; rename one"
            ));
            continue;
        }
        jobs.push((path, name, constant));
    }
    // On all cores: this is a good part of a small build.
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        while let Some((path, name, constant)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
            done.push((name, compile(&root, path, name, constant, &out)));
        }
        done
    };
    let threads = std::thread::available_parallelism().map_or(1, NonZero::get);
    let mut results = Vec::new();
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        for worker in workers {
            let done = worker.join();
            results.extend(done.map_err(|_| "a thread that compiles shaders panicked")?);
        }
        Ok::<_, &str>(())
    })?;
    results.sort_by_key(|(name, _)| *name);
    for (_, result) in results {
        match result {
            Ok(code) => statics.push_str(&code),
            Err(problem) => problems.push(problem),
        }
    }
    if !problems.is_empty() {
        return Err(problems.join("\n"));
    }

    let all: Vec<String> = names
        .keys()
        .map(|constant| format!("    &{constant},\n"))
        .collect();
    let code = format!(
        "{statics}/// Every shader, in the order of their names.\npub static ALL: &[&Shader] = &[\n{}];\n",
        all.concat()
    );
    write(&out.join("spirv.rs"), code.as_bytes())
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), String> {
    let failed = |e: std::io::Error| format!("{}: error: {e}", folder.display());
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else if kind_of(&path).is_some() {
            files.push(path);
        }
    }
    Ok(())
}

/// The path below `glsl/`, with forward slashes.
fn shader_name(root: &Path, path: &Path) -> String {
    let below = path.strip_prefix(root).unwrap_or(path);
    below
        .components()
        .map(|c| c.as_os_str().to_string_lossy())
        .collect::<Vec<_>>()
        .join("/")
}

fn constant_name(name: &str) -> String {
    let upper = name.chars().map(|c| {
        if c.is_ascii_alphanumeric() {
            c.to_ascii_uppercase()
        } else {
            '_'
        }
    });
    let constant: String = upper.collect();
    if constant.starts_with(|c: char| c.is_ascii_digit()) {
        format!("_{constant}")
    } else {
        constant
    }
}

fn write(path: &Path, content: &[u8]) -> Result<(), String> {
    fs::write(path, content).map_err(|e| format!("cannot write {}: {e}", path.display()))
}

fn compile(
    root: &Path,
    path: &Path,
    name: &str,
    constant: &str,
    out: &Path,
) -> Result<String, String> {
    let file = format!("glsl/{name}");
    let kind = kind_of(path).ok_or_else(|| format!("{file}: error: it is no shader stage"))?;
    let source = fs::read_to_string(path).map_err(|e| format!("{file}: error: {e}"))?;
    // The optimiser drops names and whatever is not used; the interface is what the source
    // declares.
    let declared = glsl::compile(&source, &file, kind, root, Goal::Reflection)?;
    for include in &declared.includes {
        println!("cargo::rerun-if-changed={}", include.display());
    }
    for warning in declared.warnings.lines() {
        println!("cargo::warning={warning}");
    }
    let code = glsl::compile(&source, &file, kind, root, Goal::Performance)?;
    let interface = Reflection::new(&declared.words)
        .and_then(|reflection| reflection.interface())
        .map_err(|problem| format!("{file}: error: {problem}"))?;

    let bytes: Vec<u8> = code
        .words
        .iter()
        .flat_map(|word| word.to_le_bytes())
        .collect();
    let spv = format!("{constant}.spv");
    write(&out.join(&spv), &bytes)?;
    let stage = match kind {
        shaderc::ShaderKind::Vertex => "VERTEX",
        shaderc::ShaderKind::Fragment => "FRAGMENT",
        _ => "COMPUTE",
    };
    let mut bindings = String::new();
    for b in &interface.bindings {
        let kind = vulkan_name(b.kind);
        let _ = writeln!(
            bindings,
            "        BindingInfo {{ binding: {}, kind: vk::DescriptorType::{kind}, count: {}, name: {:?} }},",
            b.binding, b.count, b.name
        );
    }
    Ok(format!(
        "/// `glsl/{name}`.\n\
         pub static {constant}: Shader = Shader {{\n    \
             name: {name:?},\n    \
             stage: vk::ShaderStageFlags::{stage},\n    \
             words: {{\n        \
                 static WORDS: [u32; {count}] = words(include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{spv}\")));\n        \
                 &WORDS\n    \
             }},\n    \
             bindings: &[\n{bindings}    ],\n    \
             push_constant_bytes: {push},\n    \
             workgroup: {workgroup:?},\n\
         }};\n",
        count = code.words.len(),
        push = interface.push_constant_bytes,
        workgroup = interface.workgroup,
    ))
}

fn vulkan_name(kind: Kind) -> &'static str {
    match kind {
        Kind::Sampler => "SAMPLER",
        Kind::CombinedImageSampler => "COMBINED_IMAGE_SAMPLER",
        Kind::SampledImage => "SAMPLED_IMAGE",
        Kind::StorageImage => "STORAGE_IMAGE",
        Kind::UniformTexelBuffer => "UNIFORM_TEXEL_BUFFER",
        Kind::StorageTexelBuffer => "STORAGE_TEXEL_BUFFER",
        Kind::UniformBuffer => "UNIFORM_BUFFER",
        Kind::StorageBuffer => "STORAGE_BUFFER",
    }
}
