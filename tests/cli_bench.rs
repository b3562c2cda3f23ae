//! The command `bench`: results, page, resuming, failures.
#![cfg(feature = "cli")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

const SPHERE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/sphere_over_plane.gltf");

type Result = std::result::Result<(), Box<dyn std::error::Error>>;

/// The program with caches of its own in `folder`.
fn bench(folder: &Path, args: &[&str]) -> std::io::Result<Output> {
    Command::new(env!("CARGO_BIN_EXE_antumbra"))
        .arg("bench")
        .args(args)
        .current_dir(folder)
        .env("XDG_CACHE_HOME", folder.join("cache"))
        .stdin(Stdio::null())
        .output()
}

fn small(folder: &Path, techniques: &str, more: &[&str]) -> std::io::Result<Output> {
    let mut args = vec![
        SPHERE,
        "--size",
        "64x64",
        "--samples",
        "64",
        "--repeat",
        "1",
    ];
    args.extend(["--out", "out", "--techniques", techniques]);
    args.extend(more);
    bench(folder, &args)
}

fn results(folder: &Path) -> std::result::Result<Value, Box<dyn std::error::Error>> {
    Ok(serde_json::from_slice(&fs::read(
        folder.join("out/results.json"),
    )?)?)
}

#[test]
fn a_small_benchmark_has_results_and_a_page() -> Result {
    let folder = tempfile::tempdir()?;
    let folder = folder.path();
    let labels = ["hard", "pcss:taps=8,search=8", "rays:4"];
    let output = small(folder, &labels.join(","), &[])?;
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!((output.status.code(), stderr.as_str()), (Some(0), ""));

    let found = results(folder)?;
    assert_eq!(found["schema"], 1);
    assert_eq!(found["failures"], serde_json::json!([]));
    assert_eq!(found["settings"]["techniques"], serde_json::json!(labels));
    let reference = &found["references"][0];
    assert!(
        reference["penumbra_pixels"].as_u64() > Some(50),
        "{reference}"
    );
    assert!(found["driver"].is_string());
    let images = found["images"].as_array().cloned().unwrap_or_default();
    assert_eq!(images.len(), labels.len());
    let rmse = |entry: &Value| {
        entry["error"]["penumbra"]["rmse"]
            .as_f64()
            .unwrap_or(f64::NAN)
    };
    for (entry, label) in images.iter().zip(labels) {
        assert_eq!(entry["label"], label);
        assert_eq!(entry["scene"], SPHERE);
        assert_eq!(
            (&entry["width"], &entry["repeats"]),
            (&64.into(), &1.into())
        );
        assert!(
            entry["visibility_ms"]["median"].as_f64() > Some(0.0),
            "{entry}"
        );
        assert!((0.001..0.6).contains(&rmse(entry)), "{entry}");
        assert_eq!(
            entry["error"]["penumbra"]["pixels"],
            reference["penumbra_pixels"]
        );
        let image = entry["image"].as_str().unwrap_or_default();
        let image = image::open(folder.join("out").join(image))?;
        assert_eq!((image.width(), image.height()), (64, 64));
    }
    let [hard, pcss, rays] = &images[..] else {
        panic!("{images:?}");
    };
    assert!(
        rmse(pcss) < rmse(hard) && rmse(rays) < rmse(hard),
        "{images:?}"
    );
    assert_eq!(pcss["options"]["taps"], 8);
    assert!(hard["frame_ms"]["median"].as_f64() >= hard["visibility_ms"]["median"].as_f64());
    assert!(hard["peak_bytes"]["device"].as_u64() > Some(64 * 64 * 4));
    let passes = hard["passes"].as_array().cloned().unwrap_or_default();
    assert!(passes.iter().any(|pass| pass["visibility"] == true));
    assert!(passes.iter().any(|pass| pass["visibility"] == false));
    assert!(rays["frame_ms"].is_null() && rays["driver"].is_null());
    assert!(rays["counters"]["rays"].as_u64() > Some(0));

    let matrix = fs::read_to_string(folder.join("out/matrix.md"))?;
    assert!(
        matrix.starts_with("| | ") && !matrix.contains("unexplained"),
        "{matrix}"
    );
    let page = fs::read_to_string(folder.join("out/report.html"))?;
    for label in labels {
        let mark = format!("data-technique=\"{label}\"");
        // Summary and scene, each wide and narrow.
        assert_eq!(page.matches(&mark).count(), 4, "{label}");
    }
    for outside in [
        "src=\"http",
        "href=\"http",
        "url(",
        "@import",
        "<link rel=\"stylesheet",
    ] {
        assert!(!page.contains(outside), "{outside}");
    }

    let plot = fs::read_to_string(folder.join("out/plot.svg"))?;
    assert!(plot.starts_with("<svg xmlns=") && plot.trim_end().ends_with("</svg>"));
    for label in labels {
        assert!(
            plot.contains(&format!("data-technique=\"{label}\"")),
            "{label}"
        );
    }

    // All is done: going on measures nothing, so that times stay what they were.
    let output = small(folder, &labels.join(";"), &["--resume"])?;
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(results(folder)?, found);
    let output = small(folder, "hard", &["--resume"])?;
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(
        stderr.contains("measured with other settings (techniques"),
        "{stderr}"
    );
    Ok(())
}

const STUDY: &str = r#"
title = "Small"
[[table]]
name = "scales"
title = "By light size"
reproduces = "nothing"
scenes = ["SPHERE"]
light-scales = [1, 3]
sizes = ["32x32"]
techniques = ["pcss:taps=8"]
rivals = ["rays:2"]
samples = 16
columns = ["rmse", "ratio", "passes:pcss.map* as map ms", "penumbra_pixels"]
"#;

/// Measures [`STUDY`] with more or other text in it.
fn study(folder: &Path, text: &str, more: &[&str]) -> std::io::Result<Output> {
    fs::write(folder.join("study.toml"), text.replace("SPHERE", SPHERE))?;
    let mut args = vec!["--study", "study.toml", "--out", "out", "--repeat", "1"];
    args.extend(more);
    bench(folder, &args)
}

#[test]
fn a_study_has_tables_and_goes_on_where_it_was() -> Result {
    let folder = tempfile::tempdir()?;
    let folder = folder.path();
    let output = study(folder, STUDY, &[])?;
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!((output.status.code(), stderr.as_str()), (Some(0), ""));
    let page = fs::read_to_string(folder.join("out/study.md"))?;
    let rows = |page: &str| -> Vec<Vec<String>> {
        let lines = page.lines().filter(|line| line.starts_with('|'));
        let cells = |line: &str| line.split('|').map(|cell| cell.trim().into()).collect();
        lines.map(cells).collect()
    };
    let rows = rows(&page);
    let heads = [
        "",
        "light \u{d7}",
        "technique",
        "rmse",
        "ratio",
        "map ms",
        "penumbra_pixels",
        "",
    ];
    assert_eq!(rows[0], heads, "{page}");
    let wanted = [
        ("1", "`pcss:taps=8`"),
        ("1", "`rays:2`"),
        ("3", "`pcss:taps=8`"),
        ("3", "`rays:2`"),
    ];
    assert_eq!(rows.len(), 2 + wanted.len(), "{page}");
    for (row, (scale, label)) in rows[2..].iter().zip(wanted) {
        assert_eq!((row[1].as_str(), row[2].as_str()), (scale, label));
        assert!(
            row[3]
                .parse::<f64>()
                .is_ok_and(|rmse| rmse > 0.001 && rmse < 0.7),
            "{page}"
        );
        // `hard` is measured without a row; rays have neither frames nor passes.
        let is_number = |cell: &String| cell.parse::<f64>().is_ok_and(|number| number > 0.0);
        assert_eq!(is_number(&row[4]), label.contains("pcss"), "{page}");
        assert_eq!(is_number(&row[5]), label.contains("pcss"), "{page}");
    }
    // A larger light casts wider penumbrae.
    let pixels = |row: usize| rows[row][6].parse::<u32>().unwrap_or(0);
    assert!(pixels(4) > pixels(2) && pixels(2) > 0, "{page}");

    let file = folder.join("out/scales/32x32-light-3/results.json");
    let found: Value = serde_json::from_slice(&fs::read(&file)?)?;
    assert_eq!(found["settings"]["light_scale"], 3.0);
    assert!(file.with_file_name("report.html").exists());
    // All is done: times stay what they were.
    let output = study(folder, STUDY, &["--resume"])?;
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(fs::read_to_string(folder.join("out/study.md"))?, page);
    Ok(())
}

#[test]
fn a_wrong_study_is_refused_in_one_line() -> Result {
    let folder = tempfile::tempdir()?;
    let folder = folder.path();
    for (from, to, code, part) in [
        (
            "sizes",
            "size",
            2,
            "study.toml: line 9: unknown field `size`",
        ),
        (
            "pcss:taps=8",
            "soft",
            2,
            "line 10: unknown technique `soft`",
        ),
        ("\"rmse\"", "\"speed\"", 2, "no column `speed`"),
        ("[1, 3]", "[]", 2, "table `scales`: `light-scales` is empty"),
        (
            "samples",
            "light = \"sun\"\nsamples",
            2,
            "has no light `sun`; it has ",
        ),
        ("SPHERE", "none.glb", 1, "none.glb"),
    ] {
        let output = study(folder, &STUDY.replace(from, to), &[])?;
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{part}: {stderr}");
        assert!(
            stderr.starts_with("error: ") && stderr.lines().count() == 1,
            "{stderr}"
        );
        assert!(stderr.contains(part), "{part}: {stderr}");
        assert!(!folder.join("out").exists(), "{part}");
    }
    let output = study(folder, STUDY, &["--techniques", "hard"])?;
    assert_eq!(output.status.code(), Some(2));
    Ok(())
}

#[test]
fn a_technique_without_a_device_fails_alone() -> Result {
    let folder = tempfile::tempdir()?;
    let folder = folder.path();
    let more = ["--device", "no such device"];
    let output = small(folder, "hard,rays:1", &more)?;
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.starts_with("error: 1 of 2 cells failed"), "{stderr}");
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    let found = results(folder)?;
    assert_eq!(found["failures"][0]["label"], "hard");
    assert_eq!(found["failures"][0]["kind"], "failed");
    assert!(
        found["images"][0]["failure"]["reason"]
            .to_string()
            .contains("no such device")
    );
    assert!(found["images"][1]["error"]["valid"]["rmse"].as_f64() > Some(0.0));
    assert!(fs::read_to_string(folder.join("out/report.html"))?.contains("data-failed=\"hard\""));
    Ok(())
}

#[test]
fn wrong_arguments_are_refused_before_anything_runs() -> Result {
    let folder = tempfile::tempdir()?;
    let folder = folder.path();
    fs::create_dir(folder.join("empty"))?;
    for (args, code, part) in [
        (&["--out", "out"][..], 2, "<SCENE>"),
        (&[SPHERE][..], 2, "--out"),
        (
            &[SPHERE, "--out", "out", "--techniques", "soft"][..],
            2,
            "unknown technique `soft`",
        ),
        (&["empty", "--out", "out"][..], 2, "no .glb or .gltf file"),
        (&["none.glb", "--out", "out"][..], 1, "none.glb"),
        (&["--suite", "other", "--out", "out"][..], 2, "assets"),
    ] {
        let output = bench(folder, args)?;
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{args:?}: {stderr}");
        assert!(
            stderr.starts_with("error: ") && stderr.lines().count() == 1,
            "{stderr}"
        );
        assert!(stderr.contains(part), "{args:?}: {stderr}");
        assert!(!folder.join("out").exists(), "{args:?}");
    }
    Ok(())
}
