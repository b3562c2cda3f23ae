//! The command `batch`: lists, shards, skipping, killing, two at once.
#![cfg(feature = "cli")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime};

type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

/// A moving figure, and stills of two scenes, of which one light is no line.
const JOBS: &str = "[[job]]\nname = \"walk\"\nscenes = [\"figure.glb\"]\ntechniques = [\"hard\"]\nframes = \"0..12\"\n\
    fps = 8\nsize = \"64x64\"\n\
    [[job]]\nname = \"still\"\nscenes = [\"sphere_over_plane.gltf\", \"tube.gltf\"]\n\
    techniques = [\"hard\", \"pcss:taps=8,search=8\", \"oess\"]\nsize = \"64x64\"\n\
    visibility = \"exr\"\n";
const ITEMS: usize = 12 + 6;

/// A folder with scenes and a file of jobs.
fn folder(jobs: &str) -> Result<tempfile::TempDir> {
    let folder = tempfile::tempdir()?;
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    for name in ["figure.glb", "sphere_over_plane.gltf", "tube.gltf"] {
        fs::copy(assets.join(name), folder.path().join(name))?;
    }
    fs::write(folder.path().join("jobs.toml"), jobs)?;
    Ok(folder)
}

/// The program in `folder`, as if under no scheduler.
fn program(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_antumbra"));
    command.args(args).current_dir(folder).stdin(Stdio::null());
    command.env("XDG_CACHE_HOME", folder.join("cache"));
    for name in ["ID", "MIN", "MAX", "STEP", "COUNT"] {
        command.env_remove(format!("SLURM_ARRAY_TASK_{name}"));
    }
    command.env_remove("JOB_COMPLETION_INDEX");
    command
}

fn batch(folder: &Path, args: &[&str]) -> Result<Output> {
    let all = [&["batch", "jobs.toml"], args].concat();
    Ok(program(folder, &all).output()?)
}

#[track_caller]
fn text(output: &Output, code: i32) -> String {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{said}");
    match code {
        0 => String::from_utf8_lossy(&output.stdout).into_owned(),
        _ => {
            assert_eq!(said.lines().count(), 1, "{said}");
            said
        }
    }
}

/// Images by their path in the folder of results, and nothing half written.
fn images(root: &Path) -> Result<BTreeMap<PathBuf, Vec<u8>>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let ending = path.extension().unwrap_or_default();
            assert!(ending != "part", "{path:?}");
            if !["json", "html", "svg", "md"]
                .iter()
                .any(|other| ending == *other)
            {
                found.insert(path.strip_prefix(root)?.into(), fs::read(&path)?);
            }
        }
    }
    Ok(found)
}

#[test]
fn shards_together_are_the_whole_and_what_is_finished_stays() -> Result {
    let folder = folder(JOBS)?;
    let folder = folder.path();
    let listed = text(&batch(folder, &["--list"])?, 0);
    assert_eq!(listed.lines().count(), ITEMS);
    assert_eq!(listed, text(&batch(folder, &["--list"])?, 0));
    let whole = text(&batch(folder, &["--out", "whole"])?, 0);
    // The sphere's lamp is no line.
    assert!(
        whole.contains("17 rendered, 0 skipped as finished, 1 unsupported"),
        "{whole}"
    );
    assert!(whole.contains("3 scene(s)"), "{whole}");
    let wanted = images(&folder.join("whole"))?;
    assert_eq!(wanted.len(), 12 + 2 * 5);

    let mut parts = String::new();
    for shard in ["2/3", "3/3", "1/3"] {
        parts.push_str(&text(&batch(folder, &["--list", "--shard", shard])?, 0));
        let said = text(&batch(folder, &["--out", "parts", "--shard", shard])?, 0);
        assert!(
            said.starts_with(&format!("shard      {shard} from --shard")),
            "{said}"
        );
    }
    let mut sorted = [parts.lines().collect::<Vec<_>>(), listed.lines().collect()];
    sorted.iter_mut().for_each(|lines| lines.sort_unstable());
    assert_eq!(sorted[0], sorted[1]);
    assert_eq!(images(&folder.join("parts"))?, wanted);

    // Once more, nothing is done; a picture that is gone, broken or of another scene is.
    let again = text(&batch(folder, &["--out", "whole"])?, 0);
    assert!(again.contains("0 rendered, 18 skipped"), "{again}");
    fs::remove_file(folder.join("whole/walk/figure.hard/0003.png"))?;
    fs::write(folder.join("whole/walk/figure.hard/0004.png"), b"")?;
    let mut scene = fs::read(folder.join("tube.gltf"))?;
    scene.push(b'\n');
    fs::write(folder.join("tube.gltf"), scene)?;
    let again = text(&batch(folder, &["--out", "whole"])?, 0);
    assert!(again.contains("5 rendered, 13 skipped"), "{again}");
    assert_eq!(images(&folder.join("whole"))?, wanted);
    Ok(())
}

fn json(path: &Path) -> Result<serde_json::Value> {
    Ok(serde_json::from_slice(&fs::read(path)?)?)
}

#[test]
fn merged_shards_are_what_one_process_makes() -> Result {
    let folder = folder(JOBS)?;
    let folder = folder.path();
    let merge = |args: &[&str]| -> Result<Output> {
        Ok(program(folder, &[&["merge"], args].concat()).output()?)
    };
    text(&batch(folder, &["--out", "whole"])?, 0);
    // On two nodes that share no folder.
    text(&batch(folder, &["--out", "a", "--shard", "1/3"])?, 0);
    text(&batch(folder, &["--out", "b", "--shard", "2/3"])?, 0);
    let output = merge(&["a", "b", "--out", "all"])?;
    let missing = text(&batch(folder, &["--list", "--shard", "3/3"])?, 0);
    let missing = missing
        .lines()
        .filter_map(|line| Some(format!("{}: missing", line.rsplit('\t').next()?)));
    let missing: Vec<String> = missing.collect();
    assert!(text(&output, 1).contains(&format!(
        "{} of {ITEMS} are missing or failed",
        missing.len()
    )));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(said.lines().collect::<Vec<_>>(), missing);
    assert!(!folder.join("all").exists());

    text(&batch(folder, &["--out", "b", "--shard", "3/3"])?, 0);
    text(&merge(&["a", "b", "--out", "all", "--no-timings"])?, 0);
    text(&merge(&["whole", "--out", "one", "--no-timings"])?, 0);
    assert_eq!(
        fs::read(folder.join("all/results.json"))?,
        fs::read(folder.join("one/results.json"))?
    );
    text(&merge(&["whole"])?, 0);
    let whole = json(&folder.join("whole/results.json"))?;
    assert_eq!(
        (&whole["items"], &whole["failures"][0]["kind"]),
        (&ITEMS.into(), &"unsupported".into())
    );
    let images = whole["images"].as_array().ok_or("no images")?;
    assert_eq!(images.len(), ITEMS - 1);
    assert!(
        images
            .iter()
            .all(|entry| entry["frame_ms"]["median"].as_f64() > Some(0.0))
    );
    assert_eq!(images[3]["item"], "walk/figure.hard/0003");
    assert_eq!(images[3]["files"][0]["path"], "walk/figure.hard/0003.png");
    let page = fs::read_to_string(folder.join("all/report.html"))?;
    let sources = page
        .split("src=\"")
        .skip(1)
        .filter_map(|rest| rest.split('"').next());
    let sources: Vec<&str> = sources.collect();
    assert!(
        sources.len() > 8 && sources.iter().any(|src| src.starts_with("../b/")),
        "{sources:?}"
    );
    assert!(
        sources
            .iter()
            .all(|src| folder.join("all").join(src.replace("%3D", "=")).exists())
    );

    // A file that is broken, and jobs that are others.
    fs::write(
        folder.join("whole/walk/figure.hard/0005.png"),
        b"no picture",
    )?;
    let error = text(&merge(&["whole"])?, 1);
    assert!(
        error.contains("1 of 18") && error.contains("0005.png is missing or broken"),
        "{error}"
    );
    let others = JOBS.replace("0..12", "0..1");
    fs::write(folder.join("jobs.toml"), others)?;
    text(&batch(folder, &["--out", "others", "--shard", "1/9"])?, 0);
    assert!(text(&merge(&["a", "others"])?, 1).contains("different jobs"));
    assert!(text(&merge(&["cache"])?, 1).contains("no list of items there"));
    Ok(())
}

#[test]
fn shards_of_a_benchmark_merge_into_one() -> Result {
    let folder = folder(JOBS)?;
    let folder = folder.path();
    let bench = |out: &str, shard: &str| -> Result<Output> {
        let fixed = [
            "bench",
            "sphere_over_plane.gltf",
            "tube.gltf",
            "--techniques",
            "hard,rays:2",
        ];
        let more = [
            "--size",
            "32x32",
            "--samples",
            "16",
            "--repeat",
            "1",
            "--out",
            out,
            "--shard",
            shard,
        ];
        Ok(program(folder, &[&fixed[..], &more].concat()).output()?)
    };
    let merge = |args: &[&str]| -> Result<Output> {
        Ok(program(folder, &[&["merge"], args].concat()).output()?)
    };
    text(&bench("whole", "1/1")?, 0);
    text(&bench("parts", "1/2")?, 0);
    let output = merge(&["parts"])?;
    assert!(text(&output, 1).contains("tube.gltf, light 0: missing"));
    text(&bench("parts", "2/2")?, 0);
    text(&merge(&["parts", "--no-timings"])?, 0);
    text(&merge(&["whole", "--out", "one", "--no-timings"])?, 0);
    assert_eq!(
        fs::read(folder.join("parts/results.json"))?,
        fs::read(folder.join("one/results.json"))?
    );
    assert_eq!(
        images(&folder.join("parts"))?,
        images(&folder.join("whole"))?
    );
    let results = json(&folder.join("parts/results.json"))?;
    assert_eq!(results["images"].as_array().map(Vec::len), Some(4));
    assert!(fs::read_to_string(folder.join("parts/report.html"))?.contains("data:image/png"));
    Ok(())
}

#[test]
fn schedulers_say_which_shard() -> Result {
    let folder = folder(JOBS)?;
    let told = |variables: &[(&str, &str)], args: &[&str]| -> Result<Output> {
        let all = [&["batch", "jobs.toml", "--list"], args].concat();
        let mut command = program(folder.path(), &all);
        Ok(command.envs(variables.iter().copied()).output()?)
    };
    let slurm = [
        ("SLURM_ARRAY_TASK_ID", "4"),
        ("SLURM_ARRAY_TASK_MIN", "0"),
        ("SLURM_ARRAY_TASK_MAX", "8"),
        ("SLURM_ARRAY_TASK_STEP", "4"),
    ];
    let second = text(&batch(folder.path(), &["--list", "--shard", "2/3"])?, 0);
    assert!(!second.is_empty());
    assert_eq!(text(&told(&slurm, &[])?, 0), second);
    let example = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/cluster/jobs.toml");
    let listed = text(
        &program(folder.path(), &["batch", example, "--list"]).output()?,
        0,
    );
    assert!(listed.contains("walk/figure.pcss_taps=64/0047"), "{listed}");
    assert_eq!(
        text(
            &told(&[("JOB_COMPLETION_INDEX", "1")], &["--shards", "3"])?,
            0
        ),
        second
    );
    // What is given wins.
    assert_eq!(
        text(&told(&slurm, &["--shard", "1/1"])?, 0).lines().count(),
        ITEMS
    );
    let error = text(&told(&[("JOB_COMPLETION_INDEX", "1")], &[])?, 2);
    assert!(error.contains("--shards N"), "{error}");
    let error = text(&told(&slurm[..1], &[])?, 2);
    assert!(error.contains("SLURM_ARRAY_TASK_MIN is missing"), "{error}");
    let error = text(&told(&[], &["--shards", "3"])?, 2);
    assert!(error.contains("--shard K/3"), "{error}");
    Ok(())
}

#[test]
fn killed_and_doubled_tasks_do_no_harm() -> Result {
    let frames = |count: u32| JOBS.replace("0..12", &format!("0..{count}"));
    let folder = folder(&frames(30))?;
    let folder = folder.path();
    let begin = |out: &str| {
        let mut command = program(folder, &["batch", "jobs.toml", "--out", out]);
        command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn()
    };
    let record = |out: &str, frame: u32| {
        folder
            .join(out)
            .join(format!("walk/figure.hard/{frame:04}.json"))
    };
    let kill = |signal: &str, first: u32| -> Result<Option<i32>> {
        let child = begin("killed")?;
        let begun = Instant::now();
        while !record("killed", first).exists() {
            assert!(begun.elapsed() < Duration::from_secs(60));
            std::thread::sleep(Duration::from_millis(3));
        }
        let status = Command::new("kill")
            .args([signal, &child.id().to_string()])
            .status()?;
        assert!(status.success());
        let output = child.wait_with_output()?;
        assert_eq!(String::from_utf8_lossy(&output.stderr), "");
        Ok(output.status.code())
    };
    assert_eq!(kill("-TERM", 2)?, Some(143));
    images(&folder.join("killed"))?;
    let kept = fs::metadata(record("killed", 1))?.modified()?;
    assert_eq!(kill("-KILL", 9)?, None);
    // What a process left that was killed while it wrote goes, once nobody can be at it.
    let sequence = folder.join("killed/walk/figure.hard");
    for entry in fs::read_dir(&sequence)? {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == "part") {
            fs::remove_file(path)?;
        }
    }
    let left = sequence.join(".antumbra-x.part");
    let old = fs::File::create(&left)?;
    old.set_modified(SystemTime::now() - Duration::from_secs(7200))?;

    // The rest, by two at once.
    let both = [begin("killed")?, begin("killed")?];
    for child in both {
        assert_eq!(child.wait_with_output()?.status.code(), Some(0));
    }
    assert!(!left.exists());
    assert_eq!(
        fs::metadata(record("killed", 1))?.modified()?,
        kept,
        "it was finished"
    );
    let whole = text(&batch(folder, &["--out", "whole"])?, 0);
    assert!(whole.contains("35 rendered"), "{whole}");
    assert_eq!(
        images(&folder.join("killed"))?,
        images(&folder.join("whole"))?
    );
    Ok(())
}

#[test]
fn an_item_that_fails_is_named_and_the_rest_goes_on() -> Result {
    let jobs = "[[job]]\nname = \"a\"\nscenes = [\"none.glb\", \"tube.gltf\"]\nsize = \"16x16\"\ntechniques = [\"hard\"]\n\
        cameras = [0, \"nobody\"]\n";
    let folder = folder(jobs)?;
    let error = text(&batch(folder.path(), &["--out", "out"])?, 1);
    assert!(error.starts_with("error: 3 of 4 items failed, the first: a/none.0.hard/0000: "));
    assert_eq!(images(&folder.path().join("out"))?.len(), 1);
    let record = fs::read_to_string(folder.path().join("out/a/tube.nobody.hard/0000.json"))?;
    assert!(
        record.contains("nobody") && record.contains("\"kind\":\"failed\""),
        "{record}"
    );
    // It is tried again, and what was done is not.
    fs::copy(
        folder.path().join("tube.gltf"),
        folder.path().join("none.glb"),
    )?;
    let error = text(&batch(folder.path(), &["--out", "out"])?, 1);
    assert!(error.starts_with("error: 2 of 4 items failed"), "{error}");
    for (args, code, part) in [
        (&["--out", "out", "--shard", "5/4"][..], 2, "K from 1 to N"),
        (&[][..], 2, "--out"),
        (&["--out", "jobs.toml"][..], 1, "cannot make the folder"),
        (
            &["--out", "new", "--device", "no such device"][..],
            2,
            "no such device",
        ),
    ] {
        let error = text(&batch(folder.path(), args)?, code);
        assert!(error.contains(part), "{args:?}: {error}");
    }
    Ok(())
}

#[test]
fn captures_are_cut_by_frames() -> Result {
    let folder = folder(JOBS)?;
    let folder = folder.path();
    let capture = |out: &str, args: &[&str]| -> Result<Output> {
        fs::create_dir_all(folder.join(out))?;
        let name = format!("{out}/{{frame}}.png");
        let fixed = [
            "capture",
            "figure.glb",
            "--size",
            "32x32",
            "--fps",
            "8",
            "-o",
            &name,
        ];
        Ok(program(folder, &[&fixed, args].concat()).output()?)
    };
    text(&capture("whole", &["--frames", "3..8"])?, 0);
    for (shard, count) in [("1/3", 2), ("2/3", 2), ("3/3", 1)] {
        let said = text(
            &capture("parts", &["--frames", "3..8", "--shard", shard])?,
            0,
        );
        let line = format!("shard      {shard} from --shard: {count} frames\n");
        assert!(said.starts_with(&line), "{said}");
    }
    assert_eq!(
        images(&folder.join("parts"))?,
        images(&folder.join("whole"))?
    );
    let said = text(
        &capture("none", &["--frames", "3..4", "--shard", "2/2"])?,
        0,
    );
    assert!(said.contains("0 frames"), "{said}");
    text(&capture("none", &["--shard", "1/2"])?, 2);
    let report = ["--frames", "0..4", "--shard", "1/2", "--report", "r.json"];
    assert!(text(&capture("none", &report)?, 2).contains("every shard would write"));
    assert!(images(&folder.join("none"))?.is_empty());
    Ok(())
}
