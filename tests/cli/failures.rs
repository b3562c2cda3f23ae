//! What goes wrong: which exit code, which line, and that no file is left.

use std::fs;
use std::path::PathBuf;

use antumbra::capture::exr;
use serde_json::json;

use super::program::{
    COURT, Result, SPHERE, antumbra, assert_fails, capture, capture_command, changed_scene,
    default_capture_command, names, node, run,
};

#[test]
fn wrong_usage_exits_2() -> Result {
    let folder = tempfile::tempdir()?;
    let picture = folder.path().join("a.png");
    let picture = picture.to_string_lossy();
    let cases: &[(&[&str], &[&str])] = &[
        (&[], &["no command", "--help"]),
        (&["render"], &["render"]),
        (&["capture"], &["SCENE"]),
        (&["capture", SPHERE, "second"], &["second"]),
        (
            &["capture", SPHERE, "--technique", "hard", "--budget-ms", "3"],
            &["--budget-ms"],
        ),
        (&["capture", SPHERE, "--time", "nan"], &["--time", "nan"]),
        (&["capture", SPHERE, "--time", "inf"], &["--time"]),
        (&["capture", SPHERE, "--time", "soon"], &["seconds"]),
        (&["capture", SPHERE, "--fps", "24"], &["--frames"]),
        (
            &["capture", SPHERE, "--frames", "0..2", "--fps", "0"],
            &["--fps"],
        ),
        (&["capture", SPHERE, "--frames", "3..3"], &["3..3", "above"]),
        (&["capture", SPHERE, "--frames", "5..2"], &["5..2"]),
        (&["capture", SPHERE, "--frames", "-1..2"], &["A..B"]),
        (&["capture", SPHERE, "--frames", "3"], &["A..B"]),
        (
            &["capture", SPHERE, "--frames", "0..999999999"],
            &["100000"],
        ),
        (
            &["capture", SPHERE, "--frames", "0..2", "-o", &picture],
            &["2 frames", "{frame:04}"],
        ),
        (
            &["capture", SPHERE, "--frames", "0..2", "-o", "-"],
            &["2 frames"],
        ),
        (
            &["capture", SPHERE, "-o", "a{frame:4}.png"],
            &["{frame:04}"],
        ),
        (
            &["capture", SPHERE, "--dump", "depth"],
            &["--dump", "NAME=FILE"],
        ),
        (&["capture", SPHERE, "--dump", "depth=d.txt"], &[".exr"]),
        (&["capture", SPHERE, "--dump", "depth=-"], &[".exr"]),
        (
            &["capture", SPHERE, "--technique", "magic"],
            &["unknown technique `magic`", "hard"],
        ),
        (
            &["capture", SPHERE, "--technique", "hard:taps=4"],
            &["no option `taps`"],
        ),
        (
            &["capture", SPHERE, "--size", "0x8"],
            &["--size", "640x480"],
        ),
        (&["capture", SPHERE, "--size", "8x0"], &["--size"]),
        (
            &["capture", SPHERE, "--size", "99999999x9"],
            &["--size", "16384"],
        ),
        (&["capture", SPHERE, "--size", "16384x16384"], &["--size"]),
        (&["capture", SPHERE, "--size", "big"], &["--size", "big"]),
        (
            &["capture", SPHERE, "--size", "8\n8\u{1b}[31m"],
            &["--size"],
        ),
        (&["capture", SPHERE, "--repeat", "0"], &["--repeat"]),
        (
            &["capture", SPHERE, "--light", "moon"],
            &["no light `moon`", "0 `lamp`"],
        ),
        (
            &["capture", SPHERE, "--camera", "7"],
            &["no camera `7`", "0 `camera`"],
        ),
        (
            &["capture", SPHERE, "--light-shape", "cube"],
            &["`cube`", "rect"],
        ),
        (&["capture", SPHERE, "--light-size", "-1"], &["`-1`"]),
        (
            &["capture", SPHERE, "--light-size", "1x2"],
            &["light `lamp`", "disk"],
        ),
        (&["capture", SPHERE, "--light-scale", "nan"], &["`nan`"]),
        (&["capture", SPHERE, "--sun-angle", "5"], &["--sun-angle"]),
        (
            &["capture", SPHERE, "-o", "a.jpg"],
            &["a.jpg", ".png", ".exr"],
        ),
        (&["capture", SPHERE, "--visibility", "v"], &[".png", ".exr"]),
        (&["capture", SPHERE, "--visibility", "-"], &[".png", ".exr"]),
        (
            &["capture", SPHERE, "-o", &picture, "--visibility", &picture],
            &["two outputs"],
        ),
        (
            &["capture", SPHERE, "-o", "-", "--report", "-"],
            &["two outputs"],
        ),
        (&["capture", SPHERE, "--report", SPHERE], &["is the scene"]),
        (
            &["capture", SPHERE, "--device", "voodoo", "-o", &picture],
            &["\"voodoo\"", "available: 0: "],
        ),
        (&["graph", SPHERE, "--format", "pdf"], &["text, dot, json"]),
        (&["graph", SPHERE, "--technique", "magic"], &["magic"]),
        (&["techniques", "extra"], &["extra"]),
    ];
    for (args, parts) in cases {
        assert_fails(&run(*args)?, 2, parts);
    }
    assert_eq!(names(folder.path())?, [""; 0], "nothing was written");
    Ok(())
}

#[test]
fn scenes_that_cannot_be_read_exit_1() -> Result {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let court = fs::read(COURT)?;
    fs::write(at("short.glb"), &court[..court.len() / 2])?;
    fs::write(at("header.glb"), &court[..7])?;
    fs::write(at("empty.glb"), "")?;
    fs::write(at("two\nlines.gltf"), "no glTF")?;
    fs::write(at("broken.gltf"), "{\"asset\":")?;
    let dark = changed_scene(folder.path(), |scene| {
        scene["nodes"]
            .as_array_mut()
            .into_iter()
            .flatten()
            .for_each(|node| {
                node["extensions"] = json!({});
            });
    })?;
    fs::rename(dark, at("dark.gltf"))?;
    let bare = changed_scene(folder.path(), |scene| {
        let nodes = scene["nodes"].as_array_mut().into_iter().flatten();
        for node in nodes.filter_map(|node| node.as_object_mut()) {
            node.remove("mesh");
        }
    })?;
    fs::rename(bare, at("bare.gltf"))?;
    let before = names(folder.path())?;
    let picture = at("picture.png");
    for (scene, parts) in [
        ("missing.glb", &["missing.glb", "No such file"][..]),
        (".", &["directory"]),
        ("short.glb", &["short.glb", "glTF"]),
        ("header.glb", &["header.glb", "glTF"]),
        ("empty.glb", &["empty.glb", "glTF"]),
        ("two\nlines.gltf", &["lines.gltf", "glTF"]),
        ("broken.gltf", &["broken.gltf", "JSON"]),
        ("dark.gltf", &["dark.gltf", "no light"]),
        ("bare.gltf", &["bare.gltf", "no triangles"]),
    ] {
        let output = capture_command(at(scene), "8x8")
            .arg("-o")
            .arg(&picture)
            .output()?;
        assert_fails(&output, 1, parts);
        let graph = antumbra().arg("graph").arg(at(scene)).output()?;
        assert_fails(&graph, 1, parts);
    }
    assert_eq!(names(folder.path())?, before, "nothing was written");
    Ok(())
}

#[test]
fn outputs_that_cannot_be_written_exit_1() -> Result {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("folder.png"))?;
    let mut cases = vec![
        (at("no/such/a.png"), "create it first"),
        (at("folder.png"), "is a folder"),
    ];
    if cfg!(target_os = "linux") {
        // Not even root makes files there.
        cases.push((PathBuf::from("/proc/antumbra.png"), "/proc/antumbra.png"));
        // A device that takes nothing: the disk is full.
        let links = tempfile::tempdir()?;
        let full = links.path().join("full.png");
        std::os::unix::fs::symlink("/dev/full", &full)?;
        let report = at("report.json");
        let output = capture_command(SPHERE, "8x8")
            .arg("--visibility")
            .arg(&full)
            .arg("--report")
            .arg(&report)
            .output()?;
        assert_fails(&output, 1, &["full.png", "space"]);
        assert!(!report.exists());
    }
    for (path, part) in cases {
        for flag in ["-o", "--visibility"] {
            let output = capture_command(SPHERE, "8x8")
                .arg("--report")
                .arg(at("report.json"))
                .arg(flag)
                .arg(&path)
                .output()?;
            assert_fails(&output, 1, &[part]);
        }
    }
    assert_eq!(names(folder.path())?, ["folder.png"]);
    Ok(())
}

#[test]
fn no_driver_and_no_loader_exit_1() -> Result {
    let folder = tempfile::tempdir()?;
    let picture = folder.path().join("a.png");
    let mut without_driver = antumbra();
    without_driver
        .env("VK_DRIVER_FILES", "/nonexistent")
        .env("VK_ICD_FILENAMES", "/nonexistent");
    let output = without_driver
        .args(["capture", SPHERE, "-o"])
        .arg(&picture)
        .output()?;
    assert_fails(&output, 1, &["no Vulkan driver", "install"]);
    let mut without_driver = antumbra();
    without_driver
        .env("VK_DRIVER_FILES", "/nonexistent")
        .env("VK_ICD_FILENAMES", "/nonexistent");
    assert_fails(
        &without_driver.arg("info").output()?,
        1,
        &["no Vulkan driver"],
    );

    if cfg!(target_os = "linux") {
        let fake = tempfile::tempdir()?;
        fs::write(fake.path().join("libvulkan.so.1"), "no library")?;
        let output = antumbra()
            .env("LD_LIBRARY_PATH", fake.path())
            .args(["capture", SPHERE, "-o"])
            .arg(&picture)
            .output()?;
        assert_fails(&output, 1, &["Vulkan loader", "install"]);
    }
    assert_eq!(names(folder.path())?, [""; 0], "nothing was written");
    Ok(())
}

#[test]
fn a_picture_of_one_value_fails_unless_allowed() -> Result {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let scene = changed_scene(folder.path(), |scene| {
        node(scene, "camera")["rotation"] = json!([0.707_106_77, 0, 0, 0.707_106_77]);
    })?;
    let output = capture_command(&scene, "16x16")
        .arg("-o")
        .arg(at("a.png"))
        .arg("--visibility")
        .arg(at("v.exr"))
        .output()?;
    assert_fails(&output, 1, &["every pixel", "--allow-uniform"]);
    assert_eq!(names(folder.path())?, ["scene.gltf"]);

    capture(
        capture_command(&scene, "16x16")
            .arg("--allow-uniform")
            .arg("-o")
            .arg(at("a.png")),
    )?;
    assert!(at("a.png").exists());
    capture(
        capture_command(&scene, "16x16")
            .arg("--visibility")
            .arg(at("v.exr")),
    )?;
    let (_, _, visibility) = exr::read_channel(at("v.exr"), "Y")?;
    assert!(visibility.iter().all(|v| *v == 1.0), "nothing is hit");
    Ok(())
}

#[test]
fn a_closed_or_full_standard_output_is_no_panic() -> Result {
    for args in [
        &["graph", SPHERE][..],
        &["techniques"],
        &["--help"],
        &["capture", SPHERE, "--size", "8x8"],
    ] {
        let (reader, writer) = std::io::pipe()?;
        drop(reader);
        let output = antumbra().args(args).stdout(writer).output()?;
        assert_eq!(output.status.code(), Some(0), "{args:?}");
        assert!(output.stderr.is_empty(), "{args:?}: {:?}", output.stderr);
    }
    let (reader, writer) = std::io::pipe()?;
    drop(reader);
    let mut picture = capture_command(SPHERE, "8x8");
    let output = picture.args(["-o", "-"]).stdout(writer).output()?;
    assert_fails(&output, 1, &["standard output"]);
    if cfg!(target_os = "linux") {
        let full = || fs::OpenOptions::new().write(true).open("/dev/full");
        let output = antumbra().arg("techniques").stdout(full()?).output()?;
        assert_fails(&output, 1, &["standard output"]);
        let mut silent = antumbra();
        let status = silent.arg("nonsense").stderr(full()?).status()?;
        assert_eq!(status.code(), Some(2));
    }
    Ok(())
}

#[test]
fn a_bound_that_is_not_reached_is_a_failure() -> Result {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let with_bound = |bound: &str| {
        let mut command = default_capture_command(SPHERE, "64x48");
        command
            .args(["--technique", "shaft-masks", "--bound", bound])
            .arg("--visibility")
            .arg(at("visibility.exr"))
            .arg("--visibility-bound")
            .arg(at("bound.exr"));
        command
    };
    // Any edge before the light crosses some of 1024 cells.
    let output = with_bound("0.001").output()?;
    assert_fails(&output, 1, &["`lamp`", "0.001", "bound"]);
    assert_eq!(names(folder.path())?, [""; 0]);

    capture(&mut with_bound("0.9"))?;
    assert_eq!(names(folder.path())?, ["bound.exr", "visibility.exr"]);
    let (_, _, bounds) = exr::read_channel(at("bound.exr"), "Y")?;
    let most = bounds.into_iter().fold(0.0, f32::max);
    assert!(most > 0.0 && most <= 0.9, "{most}");
    Ok(())
}
