//! The program as scripts see it: running it, and checking what it says.

#![allow(dead_code, reason = "each test binary uses its own part")]

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;

pub type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

pub const SPHERE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/sphere_over_plane.gltf");
pub const COURT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/sun_court.glb");
pub const FOLIAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/foliage.glb");

pub fn antumbra() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_antumbra"));
    command
        .env("ANTUMBRA_PIPELINE_CACHE", "")
        .stdin(Stdio::null());
    command
}

pub fn run<S: AsRef<OsStr>>(args: impl IntoIterator<Item = S>) -> Result<Output> {
    Ok(antumbra().args(args).output()?)
}

/// `capture` by `hard`, whose shaders are the quickest to compile: for what is the same with any technique.
pub fn capture_command(scene: impl AsRef<OsStr>, size: &str) -> Command {
    let mut command = default_capture_command(scene, size);
    command.args(["--technique", "hard"]);
    command
}

/// `capture`, without a technique yet, on the device that `ANTUMBRA_DEVICE` names, else on the first one.
pub fn default_capture_command(scene: impl AsRef<OsStr>, size: &str) -> Command {
    let mut command = antumbra();
    command.arg("capture").arg(scene).args(["--size", size]);
    if let Some(device) = std::env::var_os("ANTUMBRA_DEVICE") {
        command.arg("--device").arg(device);
    }
    command
}

/// A capture that has to succeed; what it prints.
#[track_caller]
pub fn capture(command: &mut Command) -> Result<String> {
    let output = command.output()?;
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{command:?}: {stderr}");
    assert_eq!(stderr, "", "{command:?}");
    Ok(String::from_utf8(output.stdout)?)
}

/// Checks the exit code and that standard error is one `error:` line with each of `parts`, and
/// standard output empty.
#[track_caller]
pub fn assert_fails(output: &Output, code: i32, parts: &[&str]) {
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{stderr}");
    let lines: Vec<&str> = stderr.lines().collect();
    assert!(
        lines.len() == 1 && lines[0].starts_with("error: ") && stderr.ends_with('\n'),
        "not one error line: {stderr:?}"
    );
    for part in parts {
        assert!(stderr.contains(part), "{part:?} is not in {stderr:?}");
    }
    assert!(output.stdout.is_empty(), "{:?}", output.stdout);
}

pub fn names(folder: &Path) -> Result<Vec<String>> {
    let mut names = fs::read_dir(folder)?
        .map(|entry| entry.map(|entry| entry.file_name().to_string_lossy().into_owned()))
        .collect::<std::io::Result<Vec<_>>>()?;
    names.sort();
    Ok(names)
}

/// The sphere's scene, changed and written to `folder`.
pub fn changed_scene(folder: &Path, change: impl FnOnce(&mut Value)) -> Result<PathBuf> {
    let mut scene: Value = serde_json::from_slice(&fs::read(SPHERE)?)?;
    change(&mut scene);
    let path = folder.join("scene.gltf");
    fs::write(&path, scene.to_string())?;
    Ok(path)
}

pub fn node<'a>(scene: &'a mut Value, name: &str) -> &'a mut Value {
    let nodes = scene["nodes"].as_array_mut().into_iter().flatten();
    match nodes.into_iter().find(|node| node["name"] == name) {
        Some(node) => node,
        None => panic!("no node {name}"),
    }
}
