//! Compiles GLSL to SPIR-V with includes from `glsl/`. Shared by the build script and the tests.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::sync::Once;

use shaderc::{
    CompileOptions, Compiler, EnvVersion, OptimizationLevel, ResolvedInclude, ShaderKind,
    SourceLanguage, SpirvVersion, TargetEnv,
};

/// What to compile for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// Fast code, without names.
    Performance,
    /// Everything that the source declares, with names.
    Reflection,
}

/// A compiled module.
pub struct Compiled {
    pub words: Vec<u32>,
    /// One a line; empty when there are none.
    pub warnings: String,
    /// Every file that was included.
    pub includes: BTreeSet<PathBuf>,
}

/// The stage that a file name's end stands for.
pub fn kind_of(path: &Path) -> Option<ShaderKind> {
    match path.extension()?.to_str()? {
        "vert" => Some(ShaderKind::Vertex),
        "frag" => Some(ShaderKind::Fragment),
        "comp" => Some(ShaderKind::Compute),
        _ => None,
    }
}

/// Compiles a source. `file` is its name in messages; includes are looked up from `root`, the
/// folder `glsl`.
///
/// The error has one line for each problem, as `file:line: error: what`, also for what is wrong
/// inside an include.
pub fn compile(
    source: &str,
    file: &str,
    kind: ShaderKind,
    root: &Path,
    goal: Goal,
) -> Result<Compiled, String> {
    let includes = RefCell::new(BTreeSet::new());
    let failed = |e: shaderc::Error| format!("{file}: {e}");
    // The last compiler to go takes the tables of built-in functions with it, which cost more than a shader.
    static TABLES: Once = Once::new();
    TABLES.call_once(|| std::mem::forget(Compiler::new()));
    let compiler = Compiler::new().map_err(failed)?;
    let mut options = CompileOptions::new().map_err(failed)?;
    options.set_source_language(SourceLanguage::GLSL);
    options.set_target_env(TargetEnv::Vulkan, EnvVersion::Vulkan1_3 as u32);
    options.set_target_spirv(SpirvVersion::V1_6);
    match goal {
        Goal::Performance => options.set_optimization_level(OptimizationLevel::Performance),
        Goal::Reflection => {
            options.set_optimization_level(OptimizationLevel::Zero);
            options.set_generate_debug_info();
        }
    }
    options.set_include_callback(|requested, _, _, _| {
        let inside = Path::new(requested)
            .components()
            .all(|c| matches!(c, Component::Normal(_)));
        if !inside {
            return Err(format!(
                "\"{requested}\" has to be a path below glsl/, such as \"common/depth.glsl\""
            ));
        }
        let path = root.join(requested);
        let content = fs::read_to_string(&path).map_err(|e| {
            format!("cannot read glsl/{requested} ({e}); includes are looked up from glsl/")
        })?;
        if content.contains('\0') {
            return Err(format!("glsl/{requested} has a zero byte in it"));
        }
        includes.borrow_mut().insert(path);
        Ok(ResolvedInclude {
            resolved_name: format!("glsl/{requested}"),
            content,
        })
    });
    if source.contains('\0') {
        return Err(format!("{file}: error: it has a zero byte in it"));
    }
    let artifact = compiler
        .compile_into_spirv(source, kind, file, "main", Some(&options))
        .map_err(|e| match e {
            shaderc::Error::CompilationError(_, text) => text.trim_end().to_owned(),
            other => format!("{file}: error: {other}"),
        })?;
    let (words, warnings) = (
        artifact.as_binary().to_vec(),
        artifact.get_warning_messages().trim_end().to_owned(),
    );
    drop(artifact);
    drop(options);
    Ok(Compiled {
        words,
        warnings,
        includes: includes.into_inner(),
    })
}
