//! Layouts of the structs that GLSL shares with Rust.

#[path = "../../build/reflect.rs"]
mod shared;

use rspirv::spirv::Decoration;

pub use shared::{Binding, Interface, Kind, Reflection};

use super::{glsl, glsl_root};

/// Where the members of a block's struct are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Name and offset in bytes, in the order of declaration.
    pub members: Vec<(String, usize)>,
    /// Bytes from one element to the next when the struct is an array's element, else up to the end
    /// of the last member.
    pub size: usize,
}

/// Layout of the struct or block called `name`. The module has to have its names, as
/// [`glsl::Goal::Reflection`] keeps them, and has to use the struct in a block, which is what gives
/// it a layout.
pub fn struct_layout(words: &[u32], name: &str) -> Result<Layout, String> {
    let reflection = Reflection::new(words)?;
    let mut layouts: Vec<Layout> = Vec::new();
    for (id, member_types) in reflection.structs(name) {
        let mut members = Vec::new();
        let mut end = 0;
        for (member, &ty) in (0_u32..).zip(&member_types) {
            // The same struct in a local variable is another type, which has no offsets.
            let Some(offset) = reflection.member_decoration(id, member, Decoration::Offset) else {
                continue;
            };
            members.push((reflection.member_name(id, member), offset as usize));
            end = end.max(offset + reflection.member_size(id, member, ty)?);
        }
        if members.len() < member_types.len() || members.is_empty() {
            continue;
        }
        let size = match reflection.array_strides(id)[..] {
            [] => end,
            [stride] => stride,
            ref strides => {
                return Err(format!(
                    "arrays of `{name}` have different strides: {strides:?}"
                ));
            }
        };
        let layout = Layout {
            members,
            size: size as usize,
        };
        if !layouts.contains(&layout) {
            layouts.push(layout);
        }
    }
    match layouts.len() {
        0 => Err(format!("no block holds a struct called `{name}`")),
        1 => Ok(layouts.remove(0)),
        _ => Err(format!(
            "`{name}` is laid out in {} ways: {layouts:?}",
            layouts.len()
        )),
    }
}

/// Compares a struct's layout with what Rust says: name and offset of each field, and the size.
pub fn compare_layout(
    layout: &Layout,
    fields: &[(&str, usize)],
    size: usize,
) -> Result<(), String> {
    let ours: Vec<(String, usize)> = fields
        .iter()
        .map(|&(name, offset)| (name.to_owned(), offset))
        .collect();
    let mut problems = Vec::new();
    for (glsl, rust) in layout.members.iter().zip(&ours) {
        if glsl != rust {
            problems.push(format!(
                "`{}` at {} in GLSL is `{}` at {} in Rust",
                glsl.0, glsl.1, rust.0, rust.1
            ));
        }
    }
    if layout.members.len() != ours.len() {
        problems.push(format!(
            "{} members in GLSL, {} in Rust",
            layout.members.len(),
            ours.len()
        ));
    }
    if layout.size != size {
        problems.push(format!("{} bytes in GLSL, {size} in Rust", layout.size));
    }
    if problems.is_empty() {
        Ok(())
    } else {
        Err(problems.join("; "))
    }
}

/// Layout of a struct in an entry file of `glsl/`, compiled anew with its names.
pub fn layout_in_file(shader: &str, name: &str) -> Result<Layout, String> {
    let root = glsl_root();
    let path = root.join(shader);
    let source = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let kind = glsl::kind_of(&path).ok_or_else(|| format!("{shader} is no shader stage"))?;
    let compiled = glsl::compile(&source, shader, kind, &root, glsl::Goal::Reflection)?;
    struct_layout(&compiled.words, name)
}

/// Checks that a `#[repr(C)]` struct's fields, all of them in order, are where the GLSL struct of
/// an entry file has them:
/// `assert_layout!(Camera { view, position } = "Camera" in "gbuffer/gbuffer.vert")`.
#[macro_export]
macro_rules! assert_layout {
    ($rust:ty { $($field:ident),+ $(,)? } = $name:literal in $file:expr) => {{
        let fields = [$((stringify!($field), core::mem::offset_of!($rust, $field))),+];
        let layout = $crate::support::reflect::layout_in_file($file, $name);
        let same = layout
            .and_then(|l| $crate::support::reflect::compare_layout(&l, &fields, core::mem::size_of::<$rust>()));
        if let Err(problem) = same {
            panic!("{} of {}: {problem}", $name, $file);
        }
    }};
}
