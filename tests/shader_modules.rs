//! Every shader is valid SPIR-V, and the tools that compare its structs with Rust's see a
//! difference.

mod support;

use std::collections::HashSet;
use std::io::Write;
use std::mem::offset_of;
use std::process::{Command, Stdio};

use antumbra::ash::vk;
use antumbra::gpu::{Shader, spirv};
use support::reflect::{Kind, Reflection, compare_layout, struct_layout};
use support::{compile, glsl, glsl_root};

/// Runs `spirv-val` on a module.
fn validate(words: &[u32]) -> Result<(), String> {
    let missing = |e: std::io::Error| {
        format!("cannot run spirv-val ({e}); install it (Debian, Ubuntu: apt install spirv-tools)")
    };
    // Local sizes by specialization constant belong to maintenance4, which the device has to have.
    let mut child = Command::new("spirv-val")
        .args(["--target-env", "vulkan1.3", "--allow-localsizeid", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(missing)?;
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    // A module refused early closes the pipe; the verdict says why.
    let _ = child
        .stdin
        .take()
        .ok_or("no pipe to spirv-val")?
        .write_all(&bytes);
    let output = child.wait_with_output().map_err(missing)?;
    if output.status.success() {
        return Ok(());
    }
    let said = [output.stdout, output.stderr].concat();
    Err(String::from_utf8_lossy(&said).trim().to_owned())
}

#[test]
fn every_module_passes_spirv_val() {
    let problems: Vec<String> = spirv::ALL
        .iter()
        .filter_map(|shader| {
            validate(shader.words)
                .err()
                .map(|problem| format!("{}: {problem}", shader.name))
        })
        .collect();
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

#[test]
fn spirv_val_refuses_a_broken_module() {
    let shader = compile(
        vk::ShaderStageFlags::COMPUTE,
        "#version 460\nlayout(local_size_x = 8) in;\nvoid main() {}\n",
    );
    assert_eq!(validate(shader.words), Ok(()));
    let mut broken = shader.words.to_vec();
    broken.pop();
    assert!(validate(&broken).is_err());
}

#[test]
fn every_entry_file_is_compiled_in() {
    fn count(folder: &std::path::Path) -> usize {
        let entries =
            std::fs::read_dir(folder).map(|d| d.flatten().map(|e| e.path()).collect::<Vec<_>>());
        entries
            .unwrap_or_default()
            .iter()
            .map(|path| {
                if path.is_dir() {
                    count(path)
                } else {
                    usize::from(glsl::kind_of(path).is_some())
                }
            })
            .sum()
    }
    assert_eq!(spirv::ALL.len(), count(&glsl_root()));
    let names: HashSet<&str> = spirv::ALL.iter().map(|shader| shader.name).collect();
    assert_eq!(names.len(), spirv::ALL.len());
    for Shader {
        name,
        words,
        push_constant_bytes,
        ..
    } in spirv::ALL
    {
        assert_eq!(words[0], 0x0723_0203, "{name}");
        assert!(*push_constant_bytes <= 128, "{name}");
    }
}

const SHARED: &str = "#version 460
layout(local_size_x_id = 7, local_size_y = 4) in;
layout(local_size_x = 8) in;
struct Item { vec3 position; float radius; mat3x4 turn; uint flags; };
layout(binding = 3, std430) buffer Items { Item items[]; };
layout(binding = 1) uniform Frame { mat4 world_to_clip; vec4 levels[3]; vec2 size_texels; float scale; } frame;
layout(binding = 0) uniform sampler2DShadow maps[2];
layout(binding = 6, r32f) uniform writeonly image2D unused;
layout(push_constant) uniform Push { uvec2 origin; float bias; } push;
void main() {
    Item item = items[gl_GlobalInvocationID.x];
    item.radius += frame.scale + push.bias + texture(maps[1], vec3(0.5)) + frame.levels[2].x;
    items[gl_GlobalInvocationID.x] = item;
}
";

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Item {
    position: [f32; 3],
    radius: f32,
    turn: [[f32; 4]; 3],
    flags: u32,
    pad: [u32; 3],
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Frame {
    world_to_clip: [[f32; 4]; 4],
    levels: [[f32; 4]; 3],
    size_texels: [f32; 2],
    scale: f32,
}

fn shared_words() -> Vec<u32> {
    let kind = shaderc::ShaderKind::Compute;
    match glsl::compile(
        SHARED,
        "shared.comp",
        kind,
        &glsl_root(),
        glsl::Goal::Reflection,
    ) {
        Ok(compiled) => compiled.words,
        Err(problem) => panic!("{problem}"),
    }
}

#[test]
fn a_struct_is_where_rust_has_it() {
    let words = shared_words();
    let item = struct_layout(&words, "Item").unwrap();
    assert_eq!(
        item.size, 80,
        "the stride of the array, with the padding at its end"
    );
    let mut fields = vec![
        ("position", offset_of!(Item, position)),
        ("radius", offset_of!(Item, radius)),
        ("turn", offset_of!(Item, turn)),
        ("flags", offset_of!(Item, flags)),
    ];
    assert_eq!(compare_layout(&item, &fields, size_of::<Item>()), Ok(()));
    let frame = struct_layout(&words, "Frame").unwrap();
    let frame_fields = [
        ("world_to_clip", offset_of!(Frame, world_to_clip)),
        ("levels", offset_of!(Frame, levels)),
        ("size_texels", offset_of!(Frame, size_texels)),
        ("scale", offset_of!(Frame, scale)),
    ];
    assert_eq!(
        compare_layout(&frame, &frame_fields, size_of::<Frame>()),
        Ok(())
    );

    // Each kind of difference is seen.
    fields[2].1 += 4;
    let text = compare_layout(&item, &fields, size_of::<Item>()).unwrap_err();
    assert_eq!(text, "`turn` at 16 in GLSL is `turn` at 20 in Rust");
    assert!(compare_layout(&item, &fields[..3], size_of::<Item>()).is_err());
    fields[2].1 -= 4;
    fields[3].0 = "mask";
    assert!(compare_layout(&item, &fields, size_of::<Item>()).is_err());
    fields[3].0 = "flags";
    assert!(compare_layout(&item, &fields, size_of::<Item>() - 4).is_err());
}

#[test]
fn a_struct_that_is_not_there_is_an_error() {
    let text = struct_layout(&shared_words(), "Absent").unwrap_err();
    assert!(text.contains("Absent"), "{text}");
}

#[test]
fn the_interface_is_what_the_source_declares() {
    let interface = Reflection::new(&shared_words())
        .and_then(|r| r.interface())
        .unwrap();
    let bindings: Vec<_> = interface
        .bindings
        .iter()
        .map(|b| (b.binding, b.kind, b.count, b.name.as_str()))
        .collect();
    assert_eq!(
        bindings,
        [
            (0, Kind::CombinedImageSampler, 2, "maps"),
            (1, Kind::UniformBuffer, 1, "frame"),
            (3, Kind::StorageBuffer, 1, "Items"),
            (6, Kind::StorageImage, 1, "unused"),
        ]
    );
    assert_eq!(interface.push_constant_bytes, 12);
    assert_eq!(interface.workgroup, [8, 4, 1]);
}

/// The error of a compute shader with these declarations and this body.
fn refused(declarations: &str, body: &str) -> String {
    let source = format!(
        "#version 460\n#extension GL_GOOGLE_include_directive : require\nlayout(local_size_x = 8) in;\n{declarations}\nvoid main() {{ {body} }}\n"
    );
    let kind = shaderc::ShaderKind::Compute;
    glsl::compile(
        &source,
        "glsl/bad/bad.comp",
        kind,
        &glsl_root(),
        glsl::Goal::Reflection,
    )
    .and_then(|compiled| Reflection::new(&compiled.words))
    .and_then(|reflection| reflection.interface())
    .map(|interface| panic!("it was taken: {interface:?}"))
    .unwrap_err()
}

#[test]
fn a_second_set_is_refused() {
    let text = refused("layout(set = 1, binding = 0) uniform sampler2D albedo;", "");
    assert_eq!(text, "`albedo` is in set 1; all bindings belong in set 0");
}

#[test]
fn large_push_constants_are_refused() {
    let text = refused(
        "layout(push_constant) uniform P { mat4 a; mat4 b; float c; } p;",
        "float x = p.c;",
    );
    assert!(text.starts_with("132 bytes of push constants"), "{text}");
}

#[test]
fn two_variables_on_one_binding_are_refused() {
    let text = refused(
        "layout(binding = 2) uniform sampler2D a; layout(binding = 2) uniform sampler2D b;",
        "vec4 x = textureLod(a, vec2(0), 0.0) + textureLod(b, vec2(0), 0.0);",
    );
    assert!(text.contains("binding 2 is both"), "{text}");
}

#[test]
fn an_error_names_file_and_line() {
    let text = refused("", "\nfloat x = nothing;");
    assert!(
        text.starts_with("glsl/bad/bad.comp:6: error:") && text.contains("nothing"),
        "{text}"
    );
    let text = refused("#include \"common/not_there.glsl\"", "");
    assert!(
        text.starts_with("glsl/bad/bad.comp:4: error:")
            && text.contains("glsl/common/not_there.glsl"),
        "{text}"
    );
    let text = refused("#include \"../Cargo.toml\"", "");
    assert!(text.contains("below glsl/"), "{text}");
}

#[test]
fn an_error_inside_an_include_names_that_file_and_line() {
    let folder = std::env::temp_dir().join(format!("antumbra-include-{}", std::process::id()));
    std::fs::create_dir_all(folder.join("common")).unwrap();
    std::fs::write(
        folder.join("common/bad.glsl"),
        "float fine() { return 1.0; }\n\nfloat bad() { return missing; }\n",
    )
    .unwrap();
    let source = "#version 460\n#extension GL_GOOGLE_include_directive : require\n#include \"common/bad.glsl\"\nvoid main() {}\n";
    let kind = shaderc::ShaderKind::Compute;
    let text = glsl::compile(
        source,
        "glsl/a.comp",
        kind,
        &folder,
        glsl::Goal::Performance,
    )
    .err();
    std::fs::remove_dir_all(&folder).unwrap();
    let text = text.unwrap_or_default();
    assert!(
        text.starts_with("glsl/common/bad.glsl:3: error:") && text.contains("missing"),
        "{text}"
    );
}
