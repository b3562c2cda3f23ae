//! The real program: exit codes, the one line on standard error, files whole or not at all.
#![cfg(feature = "cli")]

#[path = "cli/choice.rs"]
mod choice;
#[path = "cli/failures.rs"]
mod failures;
#[cfg(unix)]
#[path = "cli/interrupted.rs"]
mod interrupted;
#[path = "cli/program.rs"]
mod program;

use std::ffi::OsStr;
use std::fs;
use std::path::PathBuf;

use antumbra::capture::{exr, png};
use program::{COURT, FOLIAGE, Result, SPHERE, antumbra, assert_fails, capture, capture_command};
use program::{changed_scene, default_capture_command, names, node, run};
use serde_json::{Value, json};

/// Adds a copy of the node called `name`, moved, and returns it.
fn add_node<'a>(scene: &'a mut Value, name: &str, new_name: &str, at: [f64; 3]) -> &'a mut Value {
    let Some(nodes) = scene["nodes"].as_array_mut() else {
        panic!("the scene has no nodes");
    };
    let Some(node) = nodes.iter().find(|node| node["name"] == name) else {
        panic!("no node {name}");
    };
    let mut node = node.clone();
    node["name"] = json!(new_name);
    node["translation"] = json!(at);
    nodes.push(node);
    let index = nodes.len() - 1;
    if let Some(roots) = scene["scenes"][0]["nodes"].as_array_mut() {
        roots.push(json!(index));
    }
    &mut scene["nodes"][index]
}

#[test]
fn help_and_version_go_to_standard_output() -> Result {
    let version = run(["--version"])?;
    assert!(version.status.success());
    let wanted = concat!("antumbra ", env!("CARGO_PKG_VERSION"), "\n");
    assert_eq!(String::from_utf8(version.stdout)?, wanted);
    for args in [
        &["--help"][..],
        &["help"],
        &["capture", "--help"],
        &["graph", "-h"],
        &["info", "--help"],
        &["techniques", "--help"],
    ] {
        let help = run(args)?;
        assert!(help.status.success() && help.stderr.is_empty(), "{args:?}");
        let text = String::from_utf8(help.stdout)?;
        assert!(text.contains("Usage: antumbra"), "{args:?}: {text}");
        assert!(text.contains("Examples:"), "{args:?}: {text}");
    }
    Ok(())
}

#[test]
fn a_capture_writes_picture_visibility_and_report() -> Result {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let text = capture(
        capture_command(SPHERE, "64x48")
            .arg("-o")
            .arg(at("picture.png"))
            .arg("--visibility")
            .arg(at("visibility.exr"))
            .arg("--report")
            .arg(at("report.json"))
            .args(["--repeat", "3"]),
    )?;
    let files = ["picture.png", "report.json", "visibility.exr"];
    assert_eq!(names(folder.path())?, files);
    for part in ["driver", "64x48", "frame", "min", "mean", "max", "`lamp`"]
        .iter()
        .chain(&files)
    {
        assert!(text.contains(part), "{part} is not in {text}");
    }

    let picture = image::open(at("picture.png"))?;
    assert!(matches!(picture, image::DynamicImage::ImageRgb8(_)));
    assert_eq!((picture.width(), picture.height()), (64, 48));
    let (width, height, visibility) = exr::read_channel(at("visibility.exr"), "Y")?;
    assert_eq!((width, height), (64, 48));
    // A hard shadow has no penumbra, and this view holds lit and shadowed points.
    assert!(visibility.iter().all(|v| *v == 0.0 || *v == 1.0));
    assert!(visibility.contains(&0.0) && visibility.contains(&1.0));

    let report: Value = serde_json::from_slice(&fs::read(at("report.json"))?)?;
    assert_eq!(report["schema"], 1);
    assert_eq!(report["images"].as_array().map(Vec::len), Some(1));
    let entry = &report["images"][0];
    let wanted = json!({
        "scene": SPHERE, "frame": 0, "light": "lamp", "technique": "hard", "options": {},
        "width": 64, "height": 48,
    });
    for (key, value) in wanted.as_object().into_iter().flatten() {
        assert_eq!(&entry[key], value, "{key}");
    }
    assert!(
        entry["driver"]
            .as_str()
            .is_some_and(|text| !text.is_empty())
    );
    let number = |value: &Value| {
        value
            .as_f64()
            .ok_or_else(|| format!("{value} is no number"))
    };
    for key in ["frame_ms", "frame_ms_static", "visibility_ms"] {
        let spread = &entry[key];
        let (min, max) = (number(&spread["min"])?, number(&spread["max"])?);
        let median = number(&spread["median"])?;
        assert!(
            0.0 < min && min <= median && median <= max,
            "{key}: {spread}"
        );
    }
    let passes = entry["passes"].as_array().ok_or("no passes")?;
    assert!(passes.len() >= 4, "{passes:?}");
    let is_text = |value: &Value| value.as_str().is_some_and(|text| !text.is_empty());
    for pass in passes {
        assert!(is_text(&pass["name"]), "{pass}");
        let (ms, has_run) = (number(&pass["gpu_ms"])?, pass["skipped"].is_null());
        let is_skipped = is_text(&pass["skipped"]) && ms == 0.0;
        assert!(if has_run { ms >= 0.0 } else { is_skipped }, "{pass}");
    }
    let run = passes.iter().filter(|pass| pass["skipped"].is_null());
    assert!(run.count() >= 4, "{passes:?}");
    assert!(number(&entry["setup_ms"]["load"])? > 0.0);
    assert!(number(&entry["setup_ms"]["first_frame"])? > 0.0);
    // The picture alone takes that much.
    assert!(number(&entry["peak_bytes"]["device"])? >= 64.0 * 48.0 * 16.0);
    assert!(entry["counters"].is_object());
    Ok(())
}

#[test]
fn a_report_counts_tiles_and_has_the_bound() -> Result {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let report = |options: &[&str]| -> Result<Value> {
        capture(
            default_capture_command(SPHERE, "64x48")
                .args(["--technique", "shaft-masks", "--repeat", "1"])
                .args(options)
                .arg("--visibility-bound")
                .arg(at("bound.exr"))
                .arg("--report")
                .arg(at("report.json")),
        )?;
        let report: Value = serde_json::from_slice(&fs::read(at("report.json"))?)?;
        Ok(report["images"][0].clone())
    };
    let few = report(&["--target-error", "none"])?;
    let count = |entry: &Value, name: &str| entry["counters"][name].as_u64().unwrap_or(u64::MAX);
    let penumbra = count(&few, "tiles_penumbra");
    // Tiles of 8x8 pixels, of which those that span a gap in depth are two.
    let tiles = penumbra + count(&few, "tiles_lit") + count(&few, "tiles_umbra");
    assert!((1..=2 * 8 * 6).contains(&tiles), "{few}");
    assert!(
        penumbra > 0 && count(&few, "tile_entries") >= penumbra,
        "{few}"
    );
    assert_eq!(
        (count(&few, "tiles_256"), count(&few, "tiles_1024")),
        (0, 0),
        "{few}"
    );

    // It is of the pixels in the image.
    let (_, _, mut bounds) = exr::read_channel(at("bound.exr"), "Y")?;
    bounds.sort_by(f32::total_cmp);
    let stated = |name: &str| few["bound"][name].as_f64().map(|bound| bound as f32);
    assert_eq!(stated("max"), bounds.last().copied());
    assert_eq!(stated("p99"), bounds.get(64 * 48 * 99 / 100).copied());
    assert!(stated("max") > Some(0.0), "{few}");

    let most = report(&["--target-error", "0"])?;
    let [lit, umbra] = ["tiles_lit", "tiles_umbra"].map(|name| count(&most, name));
    assert_eq!(
        (lit, umbra),
        (count(&few, "tiles_lit"), count(&few, "tiles_umbra"))
    );
    assert_eq!(count(&most, "tiles_1024"), penumbra, "{most}");
    let error = |entry: &Value| count(entry, "estimated_error_millionths");
    assert!(error(&most) < error(&few), "{most}");
    Ok(())
}

#[test]
fn formats_follow_the_ending() -> Result {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    capture(
        capture_command(COURT, "40x30")
            .arg("-o")
            .arg(at("picture.exr"))
            .arg("--visibility")
            .arg(at("visibility.png")),
    )?;
    let picture = exr::read_image(at("picture.exr"))?;
    let channels: Vec<_> = picture.channels.iter().map(|(name, _)| name).collect();
    assert_eq!(channels, ["B", "G", "R"]);
    assert_eq!((picture.width, picture.height), (40, 30));
    let values = || picture.channels.iter().flat_map(|(_, values)| values);
    assert!(values().all(|value| value.is_finite() && *value >= 0.0));
    assert!(values().any(|value| *value > 0.0));
    let mask = image::open(at("visibility.png"))?;
    assert!(matches!(mask, image::DynamicImage::ImageLuma16(_)));

    let output = capture_command(COURT, "40x30").args(["-o", "-"]).output()?;
    assert!(output.status.success());
    let streamed = image::load_from_memory_with_format(&output.stdout, image::ImageFormat::Png)?;
    assert_eq!((streamed.width(), streamed.height()), (40, 30));
    let summary = String::from_utf8(output.stderr)?;
    assert!(summary.contains("driver") && summary.contains("standard output"));
    Ok(())
}

#[test]
fn lights_are_chosen_by_name_index_and_placeholder() -> Result {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let scene = changed_scene(folder.path(), |scene| {
        add_node(scene, "lamp", "second", [3.0, 5.0, -1.0]);
    })?;
    let visible = |path: PathBuf| exr::read_channel(path, "Y");
    let go = |args: &[&str], name: &str| {
        capture(
            capture_command(&scene, "32x24")
                .args(args)
                .arg("--visibility")
                .arg(at(name)),
        )
    };
    let text = go(
        &["--repeat", "1", "--report", &at("r.json").to_string_lossy()],
        "v_{light}.exr",
    )?;
    assert!(
        text.contains("`lamp`") && text.contains("`second`"),
        "{text}"
    );
    let (first, second) = (visible(at("v_0.exr"))?, visible(at("v_1.exr"))?);
    assert_ne!(first, second);
    let report: Value = serde_json::from_slice(&fs::read(at("r.json"))?)?;
    assert_eq!(report["images"].as_array().map(Vec::len), Some(2));
    assert_eq!(report["images"][1]["light"], "second");
    go(&[], "plain.exr")?;
    assert_eq!(visible(at("plain.exr"))?, first);
    go(&["--light", "second"], "named.exr")?;
    assert_eq!(visible(at("named.exr"))?, second);
    let text = go(&["--light", "1"], "n{light}.exr")?;
    assert_eq!(visible(at("n1.exr"))?, second);
    assert!(!at("n0.exr").exists() && !text.contains("`lamp`"), "{text}");

    let text = go(&["--light-shape", "rect", "--light-size", "2x0.5"], "v.exr")?;
    assert_eq!(text.matches("rect, 2 x 0.5 m").count(), 2, "{text}");
    let text = go(&["--light", "0", "--light-scale", "3"], "v.exr")?;
    assert!(text.contains("disk, radius 1.5 m"), "{text}");
    Ok(())
}

#[test]
fn an_image_says_how_bright_a_rect_is() -> Result {
    let folder = tempfile::tempdir()?;
    let path = |name: &str| folder.path().join(name).display().to_string();
    let grey = |values: &[f32]| png::encode_grey16(3, 1, values);
    fs::write(path("left.png"), grey(&[1.0, 0.0, 0.0])?)?;
    fs::write(path("black.png"), grey(&[0.0; 3])?)?;
    fs::write(path("text.png"), "no image")?;
    let go = |shape: &[&str], weights: &str, technique: &str| {
        let mut all: Vec<String> = ["capture", SPHERE, "--size", "32x32", "--visibility"]
            .map(String::from)
            .to_vec();
        all.push(path("v.exr"));
        all.extend(shape.iter().map(|word| word.to_string()));
        all.extend(["--light-weights".to_string(), path(weights)]);
        all.extend(["--technique".to_string(), technique.to_string()]);
        run(all)
    };
    let rect = ["--light-shape", "rect", "--light-size", "2x0.5"];
    let done = go(&rect, "left.png", "mdi")?;
    assert!(done.status.success(), "{done:?}");
    for (shape, weights, technique, wanted) in [
        (&rect[..], "none.png", "mdi", "none.png: "),
        (&rect, "text.png", "mdi", "text.png: "),
        (&rect, "black.png", "mdi", "black.png: it is black"),
        (
            &rect,
            "left.png",
            "pcss",
            "cannot do light weights; `mdi` does",
        ),
        (
            &rect[..0],
            "left.png",
            "mdi",
            "--light-weights needs a rect",
        ),
    ] {
        assert_fails(&go(shape, weights, technique)?, 2, &[wanted]);
    }
    Ok(())
}

#[test]
fn a_scene_without_a_camera_is_seen_whole() -> Result {
    let folder = tempfile::tempdir()?;
    let scene = changed_scene(folder.path(), |scene| {
        if let Some(node) = node(scene, "camera").as_object_mut() {
            node.remove("camera");
        }
    })?;
    let text = capture(
        capture_command(&scene, "24x24")
            .arg("-o")
            .arg(folder.path().join("a.png")),
    )?;
    assert!(text.contains("camera     none in the scene"), "{text}");
    let output = capture_command(&scene, "24x24")
        .args(["--camera", "0"])
        .output()?;
    assert_fails(&output, 2, &["no camera"]);
    Ok(())
}

#[test]
fn visibility_is_the_same_in_every_run_and_with_any_number_of_threads() -> Result {
    let folder = tempfile::tempdir()?;
    // The last ones have more edges and leaves before some tiles than lists have room for.
    let cases = [
        (SPHERE, "auto"),
        (COURT, "auto"),
        (FOLIAGE, "dbuffer:room=2"),
        (FOLIAGE, "dbuffer:room=8"),
        (FOLIAGE, "shaft-masks:room=8"),
    ];
    for (scene, technique) in cases {
        let mut seen: Option<Vec<u8>> = None;
        for threads in [None, None, Some("1"), Some("2")] {
            let path = folder.path().join("v.exr");
            let mut command = default_capture_command(scene, "96x96");
            command.args(["--light", "0", "--technique", technique]);
            if let Some(threads) = threads {
                command.env("LP_NUM_THREADS", threads);
            }
            capture(command.arg("--visibility").arg(&path))?;
            let bytes = fs::read(&path)?;
            fs::remove_file(&path)?;
            match &seen {
                Some(seen) => assert!(
                    *seen == bytes,
                    "{technique}, {scene} with {threads:?} threads"
                ),
                None => seen = Some(bytes),
            }
        }
    }
    Ok(())
}

#[test]
fn the_validation_layer_has_nothing_to_say() -> Result {
    let folder = tempfile::tempdir()?;
    for scene in [SPHERE, COURT] {
        capture(
            capture_command(scene, "32x24")
                .arg("--validation")
                .args(["--repeat", "2", "-o"])
                .arg(folder.path().join("a.png")),
        )?;
    }
    Ok(())
}

#[test]
fn the_pipeline_cache_is_a_help_and_never_a_hindrance() -> Result {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let go = |variables: &[(&str, &OsStr)], name: &str| {
        let mut command = capture_command(SPHERE, "16x16");
        command
            .env_remove("ANTUMBRA_PIPELINE_CACHE")
            .env_remove("XDG_CACHE_HOME")
            .env("HOME", at("home"))
            .envs(variables.iter().copied());
        capture(command.arg("--visibility").arg(at(name)))?;
        Ok::<_, Box<dyn std::error::Error>>(fs::read(at(name))?)
    };
    let cache = at("cache");
    let xdg = [("XDG_CACHE_HOME", cache.as_os_str())];
    let first = go(&xdg, "1.exr")?;
    let files = names(&cache.join("antumbra"))?;
    assert_eq!(files.len(), 1, "{files:?}");
    assert!(files[0].starts_with("pipelines-") && files[0].ends_with(".bin"));
    let file = cache.join("antumbra").join(&files[0]);
    assert_eq!(go(&xdg, "2.exr")?, first);
    fs::write(&file, "damaged")?;
    assert_eq!(go(&xdg, "3.exr")?, first);
    assert_ne!(fs::read(&file)?, b"damaged", "replaced");

    // A file where the folder should be; then a file of the user's choice; then none.
    fs::create_dir(at("blocked"))?;
    fs::write(at("blocked/antumbra"), "")?;
    let blocked = at("blocked");
    let variables = [("XDG_CACHE_HOME", blocked.as_os_str())];
    assert_eq!(go(&variables, "4.exr")?, first);
    let (own, home) = (at("own.bin"), at("home/.cache/antumbra"));
    let variables = [("ANTUMBRA_PIPELINE_CACHE", own.as_os_str())];
    assert_eq!(go(&variables, "5.exr")?, first);
    assert!(own.is_file() && !home.exists());
    let variables = [("ANTUMBRA_PIPELINE_CACHE", OsStr::new(""))];
    assert_eq!(go(&variables, "6.exr")?, first);
    assert!(!home.exists());
    assert_eq!(go(&[], "7.exr")?, first);
    assert_eq!(names(&home)?, files);
    Ok(())
}

#[test]
fn graph_prints_the_plan_without_a_driver() -> Result {
    let plan = |format: &str| -> Result<String> {
        let output = antumbra()
            .env("VK_DRIVER_FILES", "/nonexistent")
            .env("VK_ICD_FILENAMES", "/nonexistent")
            .args(["graph", SPHERE, "--technique", "hard", "--size", "64x64"])
            .args(["--format", format])
            .output()?;
        assert!(
            output.status.success() && output.stderr.is_empty(),
            "{format}"
        );
        Ok(String::from_utf8(output.stdout)?)
    };
    let text = plan("text")?;
    assert!(text.contains("barrier") && text.contains("64x64"), "{text}");
    let dot = plan("dot")?;
    assert!(dot.starts_with("digraph") && dot.ends_with("}\n"), "{dot}");
    let json: Value = serde_json::from_str(&plan("json")?)?;
    let passes = json["passes"].as_array().ok_or("no passes")?;
    assert!(passes.len() >= 4, "{json}");
    for pass in passes {
        let name = pass["name"].as_str().ok_or("a pass without a name")?;
        assert!(text.contains(name) && dot.contains(name), "{name}");
    }
    assert_eq!(plan("text")?, text, "the same each time");
    Ok(())
}

#[test]
fn techniques_are_listed_for_people_and_programs() -> Result {
    let text = String::from_utf8(run(["techniques"])?.stdout)?;
    let json: Value = serde_json::from_slice(&run(["techniques", "--json"])?.stdout)?;
    let techniques = json["techniques"].as_array().ok_or("no techniques")?;
    assert!(
        techniques
            .iter()
            .any(|technique| technique["name"] == "hard")
    );
    for technique in techniques {
        let name = technique["name"]
            .as_str()
            .ok_or("a technique without a name")?;
        assert!(text.contains(name), "{text}");
        let shapes = technique["shapes"].as_array().ok_or("no shapes")?;
        assert!(!shapes.is_empty());
        assert!(technique["options"].is_array() && technique["summary"].is_string());
        assert!(technique["paper"].is_string() || technique["paper"].is_null());
        // The scene's light is a disk; a technique that does none gets a line.
        let disk = shapes.iter().any(|shape| shape == "disk");
        let line = ["--light-shape", "line", "--light-size", "1"];
        let mut arguments = vec!["graph", SPHERE, "--technique", name];
        arguments.extend(line.iter().filter(|_| !disk));
        let graph = run(arguments)?;
        assert!(graph.status.success(), "{name}");
    }
    Ok(())
}

#[test]
fn info_lists_devices_and_needs() -> Result {
    let output = run(["info"])?;
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout)?;
    for part in ["  0: ", "Vulkan 1.3", "synchronization2", "hard: "] {
        assert!(text.contains(part), "{part} is not in {text}");
    }
    Ok(())
}
