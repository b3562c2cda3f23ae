//! Sequences of frames, images by name, running out of memory and being ended: the real program.
#![cfg(feature = "cli")]

#[path = "cli/program.rs"]
mod program;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::time::{Duration, Instant};

use antumbra::capture::exr;
use program::{
    COURT, Result, SPHERE, assert_fails, capture, capture_command, changed_scene, names, node,
};
use serde_json::{Value, json};

/// The sphere's scene with keys of an animation at 0 and 1 s: one node's property goes from `from`
/// to `to` straight, or at the second key at once.
fn animated_scene(
    folder: &Path,
    node: &str,
    property: &str,
    keys: [&[f32]; 2],
    interpolation: &str,
) -> Result<PathBuf> {
    let values = [0.0, 1.0].iter().chain(keys[0]).chain(keys[1]);
    let bytes: Vec<u8> = values.flat_map(|value: &f32| value.to_le_bytes()).collect();
    fs::write(folder.join("keys.bin"), &bytes)?;
    let kind = format!("VEC{}", keys[0].len());
    changed_scene(folder, |scene| {
        let push = |list: &mut Value, item: Value| match list.as_array_mut() {
            Some(list) => {
                list.push(item);
                list.len() - 1
            }
            None => panic!("no list"),
        };
        let target = (scene["nodes"].as_array().into_iter().flatten())
            .position(|candidate| candidate["name"] == node);
        let buffer = json!({"uri": "keys.bin", "byteLength": bytes.len()});
        let buffer = push(&mut scene["buffers"], buffer);
        let mut accessor = |offset: usize, length: usize, kind: &str| {
            let view = json!({"buffer": buffer, "byteOffset": offset, "byteLength": length});
            let view = push(&mut scene["bufferViews"], view);
            let accessor =
                json!({"bufferView": view, "componentType": 5126, "count": 2, "type": kind});
            push(&mut scene["accessors"], accessor)
        };
        let times = accessor(0, 8, "SCALAR");
        let outputs = accessor(8, bytes.len() - 8, &kind);
        scene["accessors"][times]["min"] = json!([0.0]);
        scene["accessors"][times]["max"] = json!([1.0]);
        scene["animations"] = json!([{
            "samplers": [{"input": times, "output": outputs, "interpolation": interpolation}],
            "channels": [{"sampler": 0, "target": {"node": target, "path": property}}],
        }]);
    })
}

/// The sphere moves to the right, 2 m in the second from 0 to 1 s.
fn moving_sphere(folder: &Path) -> Result<PathBuf> {
    let keys: [&[f32]; 2] = [&[0.0, 0.0, 0.0], &[2.0, 0.0, 0.0]];
    animated_scene(folder, "sphere", "translation", keys, "LINEAR")
}

fn error_line(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_sequence_is_what_single_captures_at_its_moments_are() -> Result {
    let folder = tempfile::tempdir()?;
    let out = tempfile::tempdir()?;
    let scene = moving_sphere(folder.path())?;
    let at = |name: &str| out.path().join(name);
    let text = capture(
        capture_command(&scene, "48x32")
            .args(["--frames", "2..5", "--fps", "4", "--time", "-0.25"])
            .args(["--repeat", "1", "--report"])
            .arg(at("report.json"))
            .arg("-o")
            .arg(at("p_{frame:03}.png"))
            .arg("--visibility")
            .arg(at("v_{light}_{frame}.exr")),
    )?;
    let wanted = [
        "p_002.png",
        "p_003.png",
        "p_004.png",
        "report.json",
        "v_0_2.exr",
        "v_0_3.exr",
        "v_0_4.exr",
    ];
    assert_eq!(names(out.path())?, wanted);
    let headers = text.lines().filter(|line| line.starts_with("driver "));
    assert_eq!(headers.count(), 1, "{text}");
    assert!(text.contains("number     3 at 0.5000 s"), "{text}");

    let report: Value = serde_json::from_slice(&fs::read(at("report.json"))?)?;
    let entries = report["images"].as_array().ok_or("no images")?;
    let numbers: Vec<_> = entries.iter().map(|entry| &entry["frame"]).collect();
    assert_eq!(numbers, [2, 3, 4]);
    assert!(entries.iter().all(|entry| entry["light"] == "lamp"));

    for (number, time) in [(2, "0.25"), (3, "0.5"), (4, "0.75")] {
        let single = out.path().join("single");
        fs::create_dir(&single)?;
        capture(
            capture_command(&scene, "48x32")
                .args(["--time", time])
                .arg("-o")
                .arg(single.join("p{frame}.png"))
                .arg("--visibility")
                .arg(single.join("v.exr")),
        )?;
        assert_eq!(names(&single)?, ["p0.png", "v.exr"]);
        let same = |a: &Path, b: String| -> Result<bool> { Ok(fs::read(a)? == fs::read(at(&b))?) };
        let picture = same(&single.join("p0.png"), format!("p_{number:03}.png"))?;
        let visibility = same(&single.join("v.exr"), format!("v_0_{number}.exr"))?;
        assert!(picture && visibility, "frame {number}");
        fs::remove_dir_all(&single)?;
    }
    assert_ne!(fs::read(at("v_0_2.exr"))?, fs::read(at("v_0_4.exr"))?);
    Ok(())
}

#[test]
fn a_moving_camera_is_selected_anew_and_a_still_scene_stays() -> Result {
    let folder = tempfile::tempdir()?;
    let keys: [&[f32]; 2] = [&[0.4, 4.5, 6.5], &[2.4, 4.5, 6.5]];
    let scene = animated_scene(folder.path(), "camera", "translation", keys, "LINEAR")?;
    for (scene, moves) in [(scene.as_path(), true), (Path::new(COURT), false)] {
        let out = tempfile::tempdir()?;
        capture(
            capture_command(scene, "32x24")
                .args(["--frames", "0..3", "--fps", "2", "--camera", "0"])
                .arg("--validation")
                .arg("-o")
                .arg(out.path().join("{frame}.png")),
        )?;
        let frame = |number: u32| fs::read(out.path().join(format!("{number}.png")));
        assert_eq!(frame(0)? != frame(1)?, moves);
        assert_eq!(frame(1)? != frame(2)?, moves);
    }
    Ok(())
}

#[test]
fn a_failing_frame_is_named_and_those_before_it_stay() -> Result {
    let folder = tempfile::tempdir()?;
    let out = tempfile::tempdir()?;
    // From the second key on the camera sees nothing but background.
    let half = 0.5f32.sqrt();
    let keys: [&[f32]; 2] = [
        &[-0.269_648_7, 0.0, 0.0, 0.962_958_8],
        &[half, 0.0, 0.0, half],
    ];
    let scene = animated_scene(folder.path(), "camera", "rotation", keys, "STEP")?;
    let output = capture_command(&scene, "32x24")
        .args(["--frames", "0..6", "--fps", "2", "-o"])
        .arg(out.path().join("{frame:02}.png"))
        .arg("--report")
        .arg(out.path().join("report.json"))
        .output()?;
    assert_eq!(output.status.code(), Some(1));
    let line = error_line(&output);
    assert!(
        line.starts_with("error: frame 2: every pixel") && line.lines().count() == 1,
        "{line}"
    );
    assert_eq!(names(out.path())?, ["00.png", "01.png"]);

    // A folder that is missing for one frame is found before the first is rendered.
    fs::create_dir(out.path().join("d0"))?;
    let output = capture_command(SPHERE, "8x8")
        .args(["--frames", "0..2", "-o"])
        .arg(out.path().join("d{frame}/a.png"))
        .output()?;
    assert_fails(&output, 1, &["d1", "create it first"]);
    assert!(names(&out.path().join("d0"))?.is_empty());
    // So are names that meet across frames: 1 then 11, and 11 then 1.
    let output = capture_command(SPHERE, "8x8")
        .args(["--frames", "1..12", "-o"])
        .arg(out.path().join("1{frame}.exr"))
        .arg("--visibility")
        .arg(out.path().join("{frame}.exr"))
        .output()?;
    assert_fails(&output, 2, &["two outputs", "11.exr"]);
    Ok(())
}

#[test]
fn termination_leaves_whole_files_only() -> Result {
    let out = tempfile::tempdir()?;
    let mut child = capture_command(SPHERE, "64x64")
        .args(["--frames", "0..100000", "-o"])
        .arg(out.path().join("{frame}.png"))
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()?;
    let begun = Instant::now();
    while !out.path().join("2.png").exists() {
        let ended = child.try_wait()?;
        assert!(
            ended.is_none() && begun.elapsed() < Duration::from_secs(120),
            "{ended:?}"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    let killed = std::process::Command::new("kill")
        .args(["-TERM", &child.id().to_string()])
        .status()?;
    assert!(killed.success());
    let output = child.wait_with_output()?;
    assert_eq!(output.status.code(), Some(143), "{}", error_line(&output));
    assert_eq!(error_line(&output), "");
    let files = names(out.path())?;
    assert!(files.len() >= 3, "{files:?}");
    for file in files {
        let picture = image::open(out.path().join(&file))?;
        assert_eq!((picture.width(), picture.height()), (64, 64), "{file}");
    }
    Ok(())
}

#[test]
fn dumps_hold_the_frames_own_numbers() -> Result {
    let (folder, out) = (tempfile::tempdir()?, tempfile::tempdir()?);
    // Over the edge of the plane.
    let scene = changed_scene(folder.path(), |scene| {
        node(scene, "camera")["rotation"] = json!([-0.13, 0.0, 0.0, 0.991_514]);
    })?;
    let at = |name: &str| out.path().join(name);
    let dump = |name: &str, file: &str| format!("{name}={}", at(file).display());
    capture(
        capture_command(&scene, "40x30")
            .arg("-o")
            .arg(at("plain.exr")),
    )?;
    let text = capture(
        capture_command(&scene, "40x30")
            .arg("--validation")
            .arg("-o")
            .arg(at("picture.exr"))
            .arg("--visibility")
            .arg(at("v.exr"))
            .args(["--dump", &dump("depth", "depth.exr")])
            .args(["--dump", &dump("normal", "normal.exr")])
            .args(["--dump", &dump("normal", "normal.png")])
            .args(["--dump", &dump("shading_normal", "smooth.exr")])
            .args(["--dump", &dump("visibility", "v2.exr")])
            .args(["--dump", &dump("visibility", "v_{light}.png")])
            .args(["--dump", &dump("radiance", "radiance.exr")])
            .args(["--dump", &dump("gbuffer.ids", "ids.exr")])
            .args(["--dump", &dump("gbuffer.depth", "z.exr")])
            .args(["--dump", &dump("hard.map_depth 0:lamp", "map.exr")])
            .args(["--dump", &dump("hard.map_ids 0:lamp[0]", "map.png")]),
    )?;
    assert!(text.contains("`gbuffer.ids` (40x30)"), "{text}");
    assert_eq!(fs::read(at("plain.exr"))?, fs::read(at("picture.exr"))?);
    assert_eq!(fs::read(at("v.exr"))?, fs::read(at("v2.exr"))?);

    let depth = exr::read_image(at("depth.exr"))?;
    let depth = depth.channel("Y").ok_or("no depth")?;
    let hit: Vec<bool> = depth.iter().map(|depth| *depth > 0.0).collect();
    assert!(hit.contains(&true) && hit.contains(&false));
    // The camera is 7.9 m from the origin, and the plane ends 20 m from it.
    assert!(
        depth
            .iter()
            .all(|depth| *depth == 0.0 || (3.0..40.0).contains(depth))
    );
    for name in ["normal.exr", "smooth.exr"] {
        let normal = exr::read_image(at(name))?;
        let axes: Vec<_> = normal.channels.iter().map(|(name, _)| name).collect();
        assert_eq!(axes, ["X", "Y", "Z"]);
        let axis = |name| normal.channel(name).unwrap_or_default();
        for (at, hit) in hit.iter().enumerate() {
            let [x, y, z] = ["X", "Y", "Z"].map(|name| axis(name)[at]);
            let length = (x * x + y * y + z * z).sqrt();
            let wanted = if *hit { 1.0 } else { 0.0 };
            assert!(
                (length - wanted).abs() < 1.0e-5,
                "{name} at {at}: {x} {y} {z}"
            );
        }
        // The plane fills the corners at the bottom and faces up.
        let up = [29 * 40, 29 * 40 + 39].map(|corner| axis("Y")[corner]);
        assert!(up.iter().all(|y| *y > 0.999), "{name}: {up:?}");
    }
    let coloured = image::open(at("normal.png"))?.into_rgb16();
    assert_eq!(coloured.get_pixel(0, 29).0.map(|v| v >> 8), [128, 255, 128]);

    let ids = exr::read_image(at("ids.exr"))?;
    let ids = ids.channel("Y").ok_or("no ids")?;
    for (id, hit) in ids.iter().zip(&hit) {
        assert_eq!(*id > 0.0, *hit);
    }
    let header = fs::read(at("ids.exr"))?;
    // A channel's entry: its name, then its type, of which 0 is UINT.
    let entry = header
        .windows(6)
        .any(|bytes| bytes == [b'Y', 0, 0, 0, 0, 0]);
    assert!(entry, "the numbers of triangles are stored as integers");
    let radiance = exr::read_image(at("radiance.exr"))?;
    let picture = exr::read_image(at("picture.exr"))?;
    for name in ["R", "G", "B"] {
        assert_eq!(radiance.channel(name), picture.channel(name), "{name}");
    }
    assert!(radiance.channel("A").is_some());
    let map = exr::read_image(at("map.exr"))?;
    let (width, height) = (map.width, map.height);
    assert!(
        map.channels
            .iter()
            .all(|(name, _)| name == "Y" || name.starts_with("layer"))
    );
    let picture = image::open(at("map.png"))?;
    assert_eq!((picture.width(), picture.height()), (width, height));
    assert!(at("v_0.png").exists());
    Ok(())
}

#[test]
fn dumps_of_sequences_follow_the_frame() -> Result {
    let folder = tempfile::tempdir()?;
    let out = tempfile::tempdir()?;
    let scene = moving_sphere(folder.path())?;
    let file = |name: &str| out.path().join(name);
    capture(
        capture_command(&scene, "24x16")
            .args(["--frames", "0..2", "--fps", "1", "--repeat", "2", "--dump"])
            .arg(format!("depth={}", file("d{frame}.exr").display())),
    )?;
    assert_eq!(names(out.path())?, ["d0.exr", "d1.exr"]);
    assert_ne!(fs::read(file("d0.exr"))?, fs::read(file("d1.exr"))?);
    Ok(())
}

#[test]
fn wrong_names_of_images_exit_2_and_list_the_right_ones() -> Result {
    let out = tempfile::tempdir()?;
    for (name, parts) in [
        (
            "gbuffer.id",
            &[
                "no image `gbuffer.id`",
                "gbuffer.ids",
                "shading_normal",
                "visibility 0:lamp",
            ][..],
        ),
        ("gbuffer.ids[1]", &["1 layer(s)"]),
        ("gbuffer.ids[0,3]", &["1 mip level(s)"]),
        ("depth[0]", &["no image `depth[0]`"]),
        ("counters", &["no image `counters`"]),
        // Made before the frame, not by it.
        ("scene.triangles", &["no image"]),
    ] {
        let output = capture_command(SPHERE, "8x8")
            .args(["--report", &out.path().join("r.json").to_string_lossy()])
            .arg("--dump")
            .arg(format!("{name}={}", out.path().join("x.exr").display()))
            .output()?;
        assert_fails(&output, 2, parts);
    }
    assert!(names(out.path())?.is_empty());
    Ok(())
}

#[test]
fn light_in_the_name_of_a_picture_wants_one_light() -> Result {
    let folder = tempfile::tempdir()?;
    let scene = changed_scene(folder.path(), |scene| {
        if let Some(nodes) = scene["nodes"].as_array_mut() {
            let lamp = nodes.iter().find(|node| node["name"] == "lamp").cloned();
            nodes.push(lamp.unwrap_or_default());
            let second = nodes.len() - 1;
            scene["scenes"][0]["nodes"] = (0..=second).collect();
        }
    })?;
    let name = folder.path().join("p{light}.png");
    let output = capture_command(&scene, "8x8")
        .arg("-o")
        .arg(&name)
        .output()?;
    assert_fails(&output, 2, &["2 lights", "--light"]);
    capture(
        capture_command(&scene, "8x8")
            .args(["--light", "1", "-o"])
            .arg(&name),
    )?;
    assert!(folder.path().join("p1.png").exists());
    Ok(())
}

#[test]
fn too_little_memory_is_one_line() -> Result {
    let gpu = antumbra::gpu::Gpu::create(&antumbra::gpu::GpuOptions {
        device: std::env::var("ANTUMBRA_DEVICE").ok(),
        application_name: "antumbra tests".into(),
        ..Default::default()
    })?;
    let instance = gpu.instance();
    // SAFETY: the instance and its device live as long as `gpu`.
    let memory = unsafe { instance.get_physical_device_memory_properties(gpu.physical_device()) };
    let largest = memory
        .memory_heaps_as_slice()
        .iter()
        .map(|heap| heap.size)
        .max();
    gpu.destroy()?;
    if largest > Some(2 << 30) {
        // Such a device holds the largest picture there is, and rendering it takes minutes.
        println!("no test: this device has {largest:?} bytes of memory");
        return Ok(());
    }
    let out = tempfile::tempdir()?;
    // More than 2 GB of images.
    let output = capture_command(SPHERE, "8192x8192")
        .args([
            "--dump",
            &format!("depth={}", out.path().join("d.exr").display()),
        ])
        .arg("-o")
        .arg(out.path().join("p.exr"))
        .output()?;
    assert_fails(&output, 1, &["cannot allocate", "bytes", "--size"]);
    assert!(names(out.path())?.is_empty());
    Ok(())
}
