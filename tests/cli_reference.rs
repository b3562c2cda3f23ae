//! The commands `reference` and `compare`: files, text, exit codes and the one line of a failure.
#![cfg(feature = "cli")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use antumbra::capture::exr::{self, Channel};
use antumbra::capture::png;
use serde_json::Value;

const SPHERE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/sphere_over_plane.gltf");

/// The program with a cache of its own in `folder`.
fn antumbra(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_antumbra"))
        .args(args)
        .current_dir(folder)
        .env("XDG_CACHE_HOME", folder.join("cache"))
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

#[track_caller]
fn succeeds(output: &Output) -> String {
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!((output.status.code(), &*stderr), (Some(0), ""));
    String::from_utf8(output.stdout.clone()).unwrap()
}

#[track_caller]
fn fails(output: &Output, code: i32, parts: &[&str]) {
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{stderr}");
    assert!(
        stderr.starts_with("error: ") && stderr.lines().count() == 1 && stderr.ends_with('\n'),
        "not one error line: {stderr:?}"
    );
    for part in parts {
        assert!(stderr.contains(part), "{part:?} is not in {stderr:?}");
    }
}

fn reference(folder: &Path, more: &[&str]) -> Output {
    let mut args = vec!["reference", SPHERE, "--size", "48x32", "-o", "truth.exr"];
    args.extend(more);
    antumbra(folder, &args)
}

#[test]
fn a_reference_is_cast_once_and_then_kept() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = succeeds(&reference(folder, &["--samples", "64"]));
    for part in [
        "truth.exr: 48x32, channels Y, valid",
        "disk, radius 0.5",
        "standard error",
        "98304 in",
    ] {
        assert!(text.contains(part), "{part:?} is not in {text}");
    }
    let first = fs::read(folder.join("truth.exr")).unwrap();
    let image = exr::read_image(folder.join("truth.exr")).unwrap();
    assert_eq!((image.width, image.height), (48, 32));
    let (y, valid) = (image.channel("Y").unwrap(), image.channel("valid").unwrap());
    assert!(y.iter().all(|v| (0.0..=1.0).contains(v)));
    assert!(y.contains(&0.0) && y.contains(&1.0) && y.iter().any(|&v| v > 0.2 && v < 0.8));
    assert!(valid.iter().all(|&v| v == 0.0 || v == 1.0));
    assert!(valid.contains(&0.0) && valid.contains(&1.0));

    let text = succeeds(&reference(folder, &["--samples", "64"]));
    assert!(text.contains("kept from an earlier run"), "{text}");
    assert_eq!(fs::read(folder.join("truth.exr")).unwrap(), first);
    let text = succeeds(&reference(folder, &["--samples", "64", "--no-cache"]));
    assert!(!text.contains("kept"), "{text}");
    assert_eq!(fs::read(folder.join("truth.exr")).unwrap(), first);
    // Anything else is another reference; a broken file is cast anew.
    for other in [
        &["--samples", "128"][..],
        &["--samples", "64", "--light-size", "0.6"],
    ] {
        let text = succeeds(&reference(folder, other));
        assert!(!text.contains("kept"), "{other:?}: {text}");
    }
    let kept = folder.join("cache/antumbra/reference");
    for file in fs::read_dir(&kept).unwrap() {
        fs::write(file.unwrap().path(), b"broken").unwrap();
    }
    let text = succeeds(&reference(folder, &["--samples", "64"]));
    assert!(!text.contains("kept"), "{text}");
    assert_eq!(fs::read(folder.join("truth.exr")).unwrap(), first);
}

#[test]
fn refined_patterns_and_lights_by_number() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let refined = ["--samples", "64", "--standard-error", "0.004"];
    let text = succeeds(&reference(folder, &refined));
    let line = text
        .lines()
        .find(|line| line.contains("standard error"))
        .unwrap();
    let most: f64 = line.split_whitespace().nth(4).unwrap().parse().unwrap();
    assert!(most <= 0.004, "{line}");

    fs::write(folder.join("two.txt"), "0 0 # middle\n-1 0\n").unwrap();
    succeeds(&reference(folder, &["--pattern", "two.txt"]));
    let (.., y) = exr::read_channel(folder.join("truth.exr"), "Y").unwrap();
    assert!(y.iter().all(|v| [0.0, 0.5, 1.0].contains(v)) && y.contains(&0.5));
    succeeds(&reference(folder, &["--pattern", "grid8"]));

    let args = [
        "reference",
        SPHERE,
        "--size",
        "8x8",
        "--samples",
        "16",
        "-o",
        "t_{light}.exr",
    ];
    succeeds(&antumbra(folder, &args));
    assert!(folder.join("t_0.exr").exists());
}

#[test]
fn bad_references_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fails(
        &reference(folder, &["--samples", "8"]),
        2,
        &["--samples", "16"],
    );
    fails(
        &reference(folder, &["--standard-error", "0"]),
        2,
        &["--standard-error"],
    );
    fails(
        &reference(folder, &["--pattern", "none"]),
        1,
        &["none", "cannot read the pattern"],
    );
    fails(
        &reference(folder, &["--pattern", "grid8", "--samples", "64"]),
        2,
        &["--pattern"],
    );
    fs::write(folder.join("bad.txt"), "0 0\n0 x\n").unwrap();
    fails(
        &reference(folder, &["--pattern", "bad.txt"]),
        1,
        &["bad.txt:2:", "`0 x`"],
    );
    fs::write(folder.join("out.txt"), "1 1\n").unwrap();
    fails(
        &reference(folder, &["--pattern", "out.txt"]),
        2,
        &["unit disk", "disk light"],
    );
    let png = antumbra(folder, &["reference", SPHERE, "-o", "a.png"]);
    fails(&png, 2, &["has to end in .exr"]);
    fails(&antumbra(folder, &["reference", SPHERE]), 2, &["--output"]);
    let missing = antumbra(folder, &["reference", "no.gltf", "-o", "a.exr"]);
    fails(&missing, 1, &["no.gltf"]);
    let nowhere = antumbra(folder, &["reference", SPHERE, "-o", "no/a.exr"]);
    fails(&nowhere, 1, &["no/a.exr", "create it first"]);
    assert!(!folder.join("truth.exr").exists());
}

/// An image of the given channels, 4x2.
fn write(folder: &Path, name: &str, channels: &[(&str, [f32; 8])]) {
    let channels: Vec<Channel> = (channels.iter())
        .map(|(name, values)| Channel { name, values })
        .collect();
    fs::write(folder.join(name), exr::encode(4, 2, &channels).unwrap()).unwrap();
}

#[test]
fn compare_measures_and_judges() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let truth = [0.0, 0.5, 0.5, 1.0, 0.0, 0.5, 0.5, 1.0];
    let image = [0.0, 0.6, 0.5, 1.0, 0.0, 0.5, 0.5, 0.0];
    let valid = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0];
    write(folder, "image.exr", &[("Y", image)]);
    write(folder, "plain.exr", &[("Y", truth)]);
    write(folder, "truth.exr", &[("Y", truth), ("valid", valid)]);
    let compare = |more: &[&str]| {
        let mut args = vec!["compare", "image.exr"];
        args.extend(more);
        antumbra(folder, &args)
    };

    let text = succeeds(&compare(&["truth.exr"]));
    assert!(text.contains("valid where truth.exr says so"), "{text}");
    assert!(
        text.contains("0.050000") && text.contains("+0.025000"),
        "{text}"
    );
    let text = succeeds(&compare(&["plain.exr"]));
    assert!(text.contains("all of them"), "{text}");
    let json: Value = serde_json::from_str(&succeeds(&compare(&["truth.exr", "--json"]))).unwrap();
    assert_eq!(json["error"]["valid"]["pixels"], 7);
    assert_eq!(json["error"]["penumbra"]["pixels"], 4);
    assert_eq!(
        (&json["pixels"], &json["schema"]),
        (&"valid".into(), &1.into())
    );
    assert_eq!(json["passed"], true);
    let json: Value = serde_json::from_str(&succeeds(&compare(&["plain.exr", "--json"]))).unwrap();
    assert_eq!(
        (&json["pixels"], &json["error"]["lit_called_umbra"]),
        (&"all".into(), &0.125.into())
    );

    let fine = [
        "truth.exr",
        "--max-rmse",
        "0.051",
        "--max-bias",
        "0.026",
        "--max-p99",
        "0.11",
    ];
    succeeds(&compare(&fine));
    let over = compare(&["truth.exr", "--max-rmse", "0.049", "--max-bias", "0.024"]);
    fails(
        &over,
        1,
        &["penumbra RMSE 0.05", "over --max-rmse 0.049", "bias"],
    );
    assert!(String::from_utf8_lossy(&over.stdout).contains("penumbra"));
    fails(
        &compare(&["truth.exr", "--max-p99", "0.09"]),
        1,
        &["p99", "--max-p99"],
    );
    let over = compare(&["truth.exr", "--json", "--max-rmse", "0"]);
    fails(&over, 1, &["--max-rmse"]);
    let json: Value = serde_json::from_slice(&over.stdout).unwrap();
    assert_eq!(json["passed"], false);

    succeeds(&compare(&["truth.exr", "--heatmap", "map.png"]));
    let map = image::open(folder.join("map.png")).unwrap().into_rgb8();
    assert!(map.width() == 4 && map.height() > 2);
    let [r, _, b] = map.get_pixel(1, 0).0;
    assert!(r > b, "too bright is red");

    // A mask in 16-bit grey is visibility too.
    fs::write(
        folder.join("image.png"),
        png::encode_grey16(4, 2, &truth).unwrap(),
    )
    .unwrap();
    let args = ["compare", "image.png", "truth.exr", "--max-rmse", "0.00001"];
    succeeds(&antumbra(folder, &args));
}

#[test]
fn compare_pictures_by_flip() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let picture = |name: &str, value: u8| {
        let bytes = png::encode_rgb8(16, 16, &[value; 3 * 256]).unwrap();
        fs::write(folder.join(name), bytes).unwrap();
    };
    picture("a.png", 100);
    picture("b.png", 160);
    let same = ["compare", "a.png", "a.png", "--max-flip", "0"];
    assert!(succeeds(&antumbra(folder, &same)).contains("FLIP mean 0.000000"));
    let other = [
        "compare",
        "a.png",
        "b.png",
        "--max-flip",
        "0.01",
        "--heatmap",
        "m.png",
    ];
    fails(
        &antumbra(folder, &other),
        1,
        &["mean FLIP", "--max-flip 0.01"],
    );
    assert!(folder.join("m.png").exists());
    let wrong = ["compare", "a.png", "b.png", "--max-rmse", "0.01"];
    fails(&antumbra(folder, &wrong), 2, &["--max-flip"]);
}

#[test]
fn what_cannot_be_compared_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let values = [0.5; 8];
    write(folder, "y.exr", &[("Y", values)]);
    write(folder, "z.exr", &[("Z", values)]);
    let mut nan = values;
    nan[3] = f32::NAN;
    write(folder, "nan.exr", &[("Y", nan)]);
    write(
        folder,
        "rgb.exr",
        &[("R", values), ("G", values), ("B", values)],
    );
    fs::write(folder.join("one.exr"), exr::encode_y(1, 1, &[0.5]).unwrap()).unwrap();
    fs::write(folder.join("text.exr"), "text").unwrap();
    fs::write(folder.join("text.png"), "text").unwrap();
    let compare = |args: &[&str]| {
        let mut all = vec!["compare"];
        all.extend(args);
        antumbra(folder, &all)
    };
    fails(
        &compare(&["y.exr", "no.exr"]),
        1,
        &["no.exr", "cannot read"],
    );
    fails(
        &compare(&["no.png", "y.exr"]),
        1,
        &["no.png", "cannot read"],
    );
    fails(
        &compare(&["text.exr", "y.exr"]),
        1,
        &["text.exr", "OpenEXR"],
    );
    fails(&compare(&["text.png", "y.exr"]), 1, &["text.png"]);
    fails(
        &compare(&["y.exr", "one.exr"]),
        1,
        &["4x2", "one.exr is 1x1"],
    );
    fails(&compare(&["y.exr", "z.exr"]), 1, &["z.exr", "it has Z"]);
    fails(
        &compare(&["y.exr", "rgb.exr"]),
        1,
        &["y.exr is visibility", "rgb.exr is a picture"],
    );
    fails(
        &compare(&["nan.exr", "y.exr"]),
        1,
        &["nan.exr", "NaN", "pixel number 3"],
    );
    fails(&compare(&["y.exr"]), 2, &["REFERENCE"]);
    fails(&compare(&["y.exr", "y.jpg"]), 2, &[".png or .exr"]);
    fails(
        &compare(&["y.exr", "y.exr", "--max-rmse", "-1"]),
        2,
        &["--max-rmse"],
    );
    fails(
        &compare(&["y.exr", "y.exr", "--heatmap", "m.exr"]),
        2,
        &["end in .png"],
    );
    fails(
        &compare(&["y.exr", "y.exr", "--heatmap", "no/m.png"]),
        1,
        &["no/m.png"],
    );
    fails(
        &compare(&["y.exr", "y.exr", "--max-flip", "1"]),
        2,
        &["--max-flip is for pictures"],
    );
    fails(
        &compare(&["text.png", "text.png", "--heatmap", "text.png"]),
        2,
        &["is one of the images"],
    );
}
