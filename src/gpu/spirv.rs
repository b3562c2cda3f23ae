//! The shaders of `glsl/`, compiled by the build script: one constant for each entry file, named
//! after its path.
//!
//! `glsl/shadow/hard.comp` becomes `SHADOW_HARD_COMP`; [`ALL`] lists every one.

#![allow(
    unused_imports,
    dead_code,
    reason = "a tree without shaders needs none of it"
)]

use ash::vk;

use super::shader::{BindingInfo, Shader};

/// SPIR-V words of a little-endian file.
const fn words<const N: usize>(bytes: &[u8]) -> [u32; N] {
    assert!(
        bytes.len() == 4 * N,
        "the build script wrote another number of words"
    );
    let mut words = [0; N];
    let mut i = 0;
    while i < N {
        words[i] = u32::from_le_bytes([
            bytes[4 * i],
            bytes[4 * i + 1],
            bytes[4 * i + 2],
            bytes[4 * i + 3],
        ]);
        i += 1;
    }
    words
}

include!(concat!(env!("OUT_DIR"), "/spirv.rs"));
