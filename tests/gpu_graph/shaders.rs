//! Shaders for declared uses: each reads all that a pass declared to read, compares it with what
//! writers put there, and writes all that the pass declared to write: the right values, or zeros
//! if anything read was wrong. So a wrong value anywhere reaches the end of the frame.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::sync::{Mutex, PoisonError};

use antumbra::ash::vk;
use antumbra::gpu::Shader;
use antumbra::graph::{Access, Stage};

use crate::support;

/// What a use is to a shader.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resource {
    Image { array: bool },
    Buffer { bytes: u64 },
}

/// One use, at the binding (or location, or place among attachments) that its number gives.
#[derive(Clone, Copy, Debug)]
pub struct ShaderUse {
    pub number: u32,
    pub resource: Resource,
    pub access: Access,
}

/// Words of a buffer's contents, over and over: arguments of a draw of vertices 2, 3 and 4, of which
/// the first three also serve as indices; then arguments of one workgroup; then the buffer's tag.
pub const PATTERN: [u32; 8] = [3, 1, 2, 0, 1, 1, 1, u32::MAX];

/// One word of a buffer's contents.
pub fn word(index: usize, tag: usize) -> u32 {
    match PATTERN[index % 8] {
        u32::MAX => tag as u32,
        word => word,
    }
}

const COMMON: &str = "#version 460
layout(push_constant) uniform Push { uint tags[32]; };
uint word(uint i, uint tag) { return uint[8](3u, 1u, 2u, 0u, 1u, 1u, 1u, tag)[i & 7u]; }
float texel(uint tag) { return float(tag + 1u) * 0.0625; }
";

/// The stage of a shader access.
fn stage(access: Access) -> Option<Stage> {
    match access {
        Access::Sampled(s)
        | Access::StorageRead(s)
        | Access::StorageWrite(s)
        | Access::StorageReadWrite(s)
        | Access::TexelRead(s)
        | Access::Uniform(s) => Some(s),
        _ => None,
    }
}

/// Declares the bindings of one stage, with a function `bad_N` for each read one and `write_N` for
/// each written one.
fn bindings(text: &mut String, uses: &[ShaderUse], of: Stage) -> std::fmt::Result {
    for used in uses.iter().filter(|used| stage(used.access) == Some(of)) {
        let n = used.number;
        let (reads, writes) = (used.access.reads(), used.access.writes());
        let qualifier = match (reads, writes) {
            (true, false) => "readonly",
            (false, true) => "writeonly",
            _ => "",
        };
        match (used.access, used.resource) {
            (Access::Sampled(_), Resource::Image { array }) => {
                let (kind, coordinate) = if array {
                    ("2DArray", "p")
                } else {
                    ("2D", "p.xy")
                };
                writeln!(text, "layout(binding = {n}) uniform sampler{kind} r{n};")?;
                let size = if array {
                    format!("textureSize(r{n}, l)")
                } else {
                    format!("ivec3(textureSize(r{n}, l), 1)")
                };
                let read = format!("texelFetch(r{n}, {coordinate}, l).r");
                bad_texels(text, n, &format!("textureQueryLevels(r{n})"), &size, &read)?;
            }
            (_, Resource::Image { array }) => {
                let (kind, coordinate) = if array {
                    ("2DArray", "p")
                } else {
                    ("2D", "p.xy")
                };
                writeln!(
                    text,
                    "layout(binding = {n}, r32f) uniform {qualifier} image{kind} r{n};"
                )?;
                let size = if array {
                    format!("imageSize(r{n})")
                } else {
                    format!("ivec3(imageSize(r{n}), 1)")
                };
                if reads {
                    let read = format!("imageLoad(r{n}, {coordinate}).r");
                    bad_texels(text, n, "1", &size, &read)?;
                }
                if writes {
                    writeln!(
                        text,
                        "void write_{n}(uint first, uint step, bool bad) {{
  ivec3 size = {size};
  for (uint i = first; i < uint(size.x * size.y * size.z); i += step) {{
    ivec3 p = ivec3(i % size.x, i / size.x % size.y, i / (size.x * size.y));
    imageStore(r{n}, {coordinate}, vec4(bad ? 0.0 : texel(tags[{n}])));
  }}
}}"
                    )?;
                }
            }
            (Access::Uniform(_), Resource::Buffer { bytes }) => {
                let count = bytes / 16;
                writeln!(
                    text,
                    "layout(binding = {n}, std140) uniform B{n} {{ uvec4 r{n}[{count}]; }};"
                )?;
                bad_words(
                    text,
                    n,
                    &format!("{}u", bytes / 4),
                    &format!("r{n}[i / 4u][i & 3u]"),
                )?;
            }
            (Access::TexelRead(_), Resource::Buffer { .. }) => {
                writeln!(text, "layout(binding = {n}) uniform usamplerBuffer r{n};")?;
                let count = format!("uint(textureSize(r{n}))");
                bad_words(text, n, &count, &format!("texelFetch(r{n}, int(i)).r"))?;
            }
            (_, Resource::Buffer { .. }) => {
                writeln!(
                    text,
                    "layout(binding = {n}, std430) {qualifier} buffer B{n} {{ uint r{n}[]; }};"
                )?;
                if reads {
                    bad_words(text, n, &format!("r{n}.length()"), &format!("r{n}[i]"))?;
                }
                if writes {
                    writeln!(
                        text,
                        "void write_{n}(uint first, uint step, bool bad) {{
  for (uint i = first; i < r{n}.length(); i += step) r{n}[i] = bad ? 0u : word(i, tags[{n}]);
}}"
                    )?;
                }
            }
        }
    }
    Ok(())
}

fn bad_texels(text: &mut String, n: u32, levels: &str, size: &str, read: &str) -> std::fmt::Result {
    writeln!(
        text,
        "bool bad_{n}(uint first, uint step) {{
  bool bad = false;
  for (int l = 0; l < {levels}; ++l) {{
    ivec3 size = {size};
    for (uint i = first; i < uint(size.x * size.y * size.z); i += step) {{
      ivec3 p = ivec3(i % size.x, i / size.x % size.y, i / (size.x * size.y));
      if ({read} != texel(tags[{n}])) bad = true;
    }}
  }}
  return bad;
}}"
    )
}

fn bad_words(text: &mut String, n: u32, count: &str, read: &str) -> std::fmt::Result {
    writeln!(
        text,
        "bool bad_{n}(uint first, uint step) {{
  bool bad = false;
  for (uint i = first; i < {count}; i += step) if ({read} != word(i, tags[{n}])) bad = true;
  return bad;
}}"
    )
}

fn checks(text: &mut String, uses: &[ShaderUse], of: Stage, range: &str) -> std::fmt::Result {
    for used in uses.iter().filter(|used| stage(used.access) == Some(of)) {
        if used.access.reads() {
            writeln!(text, "  if (bad_{}({range})) bad = true;", used.number)?;
        }
    }
    Ok(())
}

/// A compute shader of one workgroup.
pub fn compute(uses: &[ShaderUse]) -> &'static Shader {
    cached(vk::ShaderStageFlags::COMPUTE, |text| {
        text.push_str("layout(local_size_x = 64) in;\nshared uint wrong;\n");
        bindings(text, uses, Stage::Compute)?;
        text.push_str("void main() {\n  uint first = gl_LocalInvocationIndex;\n");
        text.push_str("  if (first == 0u) wrong = 0u;\n  barrier();\n  bool bad = false;\n");
        checks(text, uses, Stage::Compute, "first, 64u")?;
        text.push_str("  if (bad) atomicOr(wrong, 1u);\n  barrier();\n  bad = wrong != 0u;\n");
        for used in uses.iter().filter(|used| used.access.writes()) {
            writeln!(text, "  write_{}(first, 64u, bad);", used.number)?;
        }
        text.push_str("}\n");
        Ok(())
    })
}

/// A vertex shader of which any three neighbours among the first vertices cover all; further ones
/// cover nothing.
pub fn vertex(uses: &[ShaderUse]) -> &'static Shader {
    let inputs = uses.iter().filter(|used| used.access == Access::Vertex);
    cached(vk::ShaderStageFlags::VERTEX, |text| {
        bindings(text, uses, Stage::Vertex)?;
        for (location, _) in inputs.clone().enumerate() {
            writeln!(text, "layout(location = {location}) in uint a{location};")?;
        }
        text.push_str("layout(location = 0) flat out uint wrong;\nvoid main() {\n");
        text.push_str("  uint first = uint(gl_VertexIndex);\n  bool bad = false;\n");
        checks(text, uses, Stage::Vertex, "first % 3u, 3u")?;
        for (location, used) in inputs.enumerate() {
            let n = used.number;
            writeln!(
                text,
                "  if (a{location} != word(first, tags[{n}])) bad = true;"
            )?;
        }
        text.push_str("  wrong = bad ? 1u : 0u;\n  uint corner = first % 3u;\n");
        text.push_str("  float x = corner == 1u ? 3.0 : -1.0, y = corner == 2u ? 3.0 : -1.0;\n");
        text.push_str("  if (first > 5u) x = y = -1.0;\n");
        text.push_str("  gl_Position = vec4(x, y, 0.0, 1.0);\n}\n");
        Ok(())
    })
}

/// A fragment shader that writes every attachment.
pub fn fragment(uses: &[ShaderUse]) -> &'static Shader {
    cached(vk::ShaderStageFlags::FRAGMENT, |text| {
        text.push_str("layout(location = 0) flat in uint wrong;\n");
        bindings(text, uses, Stage::Fragment)?;
        let color = uses.iter().filter(|u| {
            matches!(
                u.access,
                Access::ColorAttachment | Access::ColorAttachmentLoad
            )
        });
        for (location, _) in color.clone().enumerate() {
            writeln!(text, "layout(location = {location}) out float o{location};")?;
        }
        text.push_str("void main() {\n  bool bad = wrong != 0u;\n");
        text.push_str("  uint first = uint(gl_FragCoord.x) + 32u * uint(gl_FragCoord.y);\n");
        checks(text, uses, Stage::Fragment, "first, 1024u")?;
        for (location, used) in color.enumerate() {
            let n = used.number;
            writeln!(text, "  o{location} = bad ? 0.0 : texel(tags[{n}]);")?;
        }
        let depth = uses.iter().find(|u| {
            u.access == Access::DepthTest
                || matches!(
                    u.access,
                    Access::DepthAttachment | Access::DepthAttachmentLoad
                )
        });
        if let Some(depth) = depth {
            let n = depth.number;
            writeln!(text, "  gl_FragDepth = bad ? 0.0 : texel(tags[{n}]);")?;
        }
        text.push_str("}\n");
        Ok(())
    })
}

/// A compute shader that does nothing.
pub fn idle() -> &'static Shader {
    cached(vk::ShaderStageFlags::COMPUTE, |text| {
        text.push_str("layout(local_size_x = 1) in;\nvoid main() {}\n");
        Ok(())
    })
}

type Cache = HashMap<(vk::ShaderStageFlags, String), &'static Shader>;

fn cached(
    stage: vk::ShaderStageFlags,
    write: impl FnOnce(&mut String) -> std::fmt::Result,
) -> &'static Shader {
    static CACHE: Mutex<Option<Cache>> = Mutex::new(None);
    let mut text = COMMON.to_owned();
    write(&mut text).unwrap();
    let mut cache = CACHE.lock().unwrap_or_else(PoisonError::into_inner);
    let cache = cache.get_or_insert_default();
    cache
        .entry((stage, text))
        .or_insert_with_key(|(stage, text)| support::compile(*stage, text))
}
