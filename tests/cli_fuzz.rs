//! Command lines and scenes put together at random: the program ends in time with 0, 1 or 2, with nothing or
//! one `error:` line on standard error, and without a file of a command that failed.
#![cfg(feature = "cli")]

#[path = "cli/program.rs"]
mod program;

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use antumbra::shadow::Technique;
use program::{COURT, SPHERE, antumbra, names};
use proptest::prelude::*;
use proptest::sample::{Index, select};
use serde_json::{Value, json};

/// Far above what any of these commands takes, also on a busy machine under the validation layer.
const LIMIT: Duration = Duration::from_secs(120);

fn cases(default: u32) -> ProptestConfig {
    let given = std::env::var("PROPTEST_CASES").ok();
    ProptestConfig {
        cases: given
            .and_then(|cases| cases.parse().ok())
            .unwrap_or(default),
        failure_persistence: None,
        max_shrink_iters: 200,
        ..ProptestConfig::default()
    }
}

/// Runs to the end, or kills it at the limit.
fn finish(command: &mut Command, folder: &Path) -> Result<Output, TestCaseError> {
    let file = |name: &str| fs::File::create(folder.join(name));
    let failed = |error: std::io::Error| TestCaseError::fail(error.to_string());
    let mut child = command
        .stdout(file("out").map_err(failed)?)
        .stderr(file("err").map_err(failed)?)
        .stdin(Stdio::null())
        .spawn()
        .map_err(failed)?;
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().map_err(failed)? {
            break status;
        }
        if begin.elapsed() > LIMIT {
            child.kill().map_err(failed)?;
            return Err(TestCaseError::fail("it does not end"));
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let read = |name: &str| fs::read(folder.join(name)).map_err(failed);
    Ok(Output {
        status,
        stdout: read("out")?,
        stderr: read("err")?,
    })
}

/// What every end of the program has to be like. `folder` is where its files go.
fn check(command: &mut Command, folder: &Path) -> Result<i32, TestCaseError> {
    let streams = tempfile::tempdir().map_err(|error| TestCaseError::fail(error.to_string()))?;
    let output = finish(command, streams.path())?;
    let stderr = String::from_utf8_lossy(&output.stderr);
    let code = output.status.code();
    let title = format!("{command:?} ended with {code:?}: {stderr:?}");
    prop_assert!(matches!(code, Some(0..=2)), "{title}");
    prop_assert!(!stderr.contains("panicked"), "{title}");
    if code == Some(0) {
        prop_assert!(stderr.is_empty(), "{title}");
        return Ok(0);
    }
    let one_line = stderr.lines().count() == 1 && stderr.ends_with('\n');
    prop_assert!(one_line && stderr.starts_with("error: "), "{title}");
    prop_assert!(
        !stderr.chars().any(|c| c.is_control() && c != '\n'),
        "{title}"
    );
    prop_assert!(output.stdout.is_empty(), "{title}");
    let left = names(folder).unwrap_or_default();
    prop_assert!(left.is_empty(), "{title}: left {left:?}");
    Ok(code.unwrap_or_default())
}

/// Values that no flag takes, or that are at an end of what it takes.
fn odd() -> impl Strategy<Value = String> {
    let known = [
        "",
        " ",
        "-",
        "--",
        "0",
        "-0",
        "-1",
        "1e-30",
        "1e39",
        "nan",
        "inf",
        "-inf",
        "0x10",
        "x",
        "1x",
        "x1",
        "16384x16385",
        "4294967296",
        "18446744073709551616",
        "..",
        "0..0",
        "5..1",
        "{frame}",
        "{light}",
        "{",
        "a{frame:04}.png",
        "=",
        ":",
        ",",
        "a,b",
        "\n",
        "\u{1b}[31m",
        "ä",
        "日本",
        "\u{202e}",
        "'",
        "\"",
        "%s",
        "~",
        "/dev/null",
        "/",
        ".",
        "no/such/folder/a.png",
        "a.exr",
        "NULL",
        "true",
    ];
    prop_oneof![
        3 => select(known.map(String::from).to_vec()),
        1 => "[ -~]{0,12}".prop_filter("not a size of its own", |text| !text.contains('x')),
    ]
}

/// A technique with options, or something like it.
fn technique() -> impl Strategy<Value = String> {
    let named = Technique::ALL.iter().flat_map(|technique| {
        let name = technique.name();
        let options = technique.options().iter();
        let with_options = options.flat_map(move |option| {
            let own = format!("{name}:{}={}", option.name, option.default);
            let wrong = ["", "0", "-1", "nan", "1e9", "4294967296", "yes"];
            let wrong = wrong.map(|value| format!("{name}:{}={value}", option.name));
            std::iter::once(own).chain(wrong)
        });
        std::iter::once(name.to_owned())
            .chain(with_options)
            .collect::<Vec<_>>()
    });
    let named: Vec<String> = named.collect();
    prop_oneof![4 => select(named), 1 => odd()]
}

/// A flag with its value, right or wrong. Right sizes are small and right counts few.
fn flag() -> impl Strategy<Value = Vec<String>> {
    let right: &[(&str, &[&str])] = &[
        ("--size", &["8x8", "1x1", "16x9", "3x40"]),
        ("--light", &["0", "lamp", "sun"]),
        ("--camera", &["0", "camera"]),
        ("--time", &["0", "-1.5", "1e9"]),
        (
            "--light-shape",
            &["point", "disk", "rect", "sphere", "line"],
        ),
        ("--light-size", &["0.5", "1x2", "1e-9", "1e9"]),
        ("--light-scale", &["0.1", "1e6", "1e-6"]),
        ("--sun-angle", &["0", "0.5", "179.9"]),
        ("--light-profile", &["0.2,1", "0,0", "1,2,3,4,5,6,7,8"]),
        ("--visibility", &["v.exr", "v.png", "v_{light}.exr"]),
        ("--visibility-bound", &["b.exr"]),
        ("-o", &["a.png", "a.exr"]),
        (
            "--dump",
            &[
                "depth=d.exr",
                "normal=n.png",
                "visibility[0]=l.exr",
                "depth[1]=m.exr",
            ],
        ),
        ("--frames", &["0..2", "1..2"]),
        ("--fps", &["24", "0.1"]),
        ("--shard", &["1/1", "2/3"]),
        ("--report", &["r.json"]),
        ("--repeat", &["1", "2"]),
        ("--target-error", &["0.1", "none"]),
        ("--bound", &["0.5"]),
        ("--budget-ms", &["1"]),
        ("--budget-work", &["0", "10"]),
        ("--device", &["0"]),
        ("--format", &["text", "dot", "json"]),
    ];
    let right: Vec<(String, Vec<String>)> = (right.iter())
        .map(|(flag, values)| ((*flag).into(), values.iter().map(|v| (*v).into()).collect()))
        .collect();
    let flags: Vec<String> = right.iter().map(|(flag, _)| flag.clone()).collect();
    prop_oneof![
        6 => select(right).prop_flat_map(|(flag, values)| {
            select(values).prop_map(move |value| vec![flag.clone(), value])
        }),
        2 => (select(flags), odd()).prop_map(|(flag, value)| vec![flag, value]),
        2 => technique().prop_map(|technique| vec!["--technique".into(), technique]),
        1 => Just(vec!["--allow-uniform".into()]),
        1 => odd().prop_map(|stray| vec![stray]),
    ]
}

fn command_line() -> impl Strategy<Value = Vec<String>> {
    let command = prop_oneof![
        8 => Just("capture"), 3 => Just("graph"), 1 => Just("techniques"), 1 => Just("compare"),
        1 => Just("reference"), 1 => Just("batch"), 1 => Just("merge"), 1 => Just("bench"), 1 => Just(""),
    ];
    let scene = prop_oneof![
        6 => Just(SPHERE.to_owned()),
        3 => Just(COURT.to_owned()),
        1 => odd(),
    ];
    (command, scene, prop::collection::vec(flag(), 0..6)).prop_map(|(command, scene, flags)| {
        // Small if no other flag says so.
        let flags: Vec<String> = flags.into_iter().flatten().collect();
        let small = matches!(command, "capture" | "reference") && !flags.contains(&"--size".into());
        let size = ["--size", "8x8"]
            .map(String::from)
            .into_iter()
            .filter(|_| small);
        [command.to_owned(), scene]
            .into_iter()
            .chain(size)
            .chain(flags)
            .collect()
    })
}

proptest! {
    #![proptest_config(cases(60))]

    #[test]
    fn command_lines_end_as_they_should(arguments in command_line()) {
        let folder = tempfile::tempdir().map_err(|error| TestCaseError::fail(error.to_string()))?;
        let mut command = antumbra();
        command.args(&arguments).current_dir(folder.path());
        check(&mut command, folder.path())?;
    }
}

/// Pointers to all values of a document, but for long texts.
fn pointers(value: &Value, at: &str, found: &mut Vec<String>) {
    found.push(at.to_owned());
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                let key = key.replace('~', "~0").replace('/', "~1");
                pointers(value, &format!("{at}/{key}"), found);
            }
        }
        Value::Array(list) => {
            for (index, value) in list.iter().enumerate() {
                pointers(value, &format!("{at}/{index}"), found);
            }
        }
        _ => {}
    }
}

fn odd_value() -> impl Strategy<Value = Value> {
    select(vec![
        json!(null),
        json!(0),
        json!(-1),
        json!(1),
        json!(7),
        json!(1e-30),
        json!(1e38),
        json!(-1e38),
        json!(1e300),
        json!(4_294_967_295_u32),
        json!(u64::MAX),
        json!(""),
        json!("MASK"),
        json!([]),
        json!({}),
        json!([0, 0, 0]),
        json!([1e38, 1e38, 1e38]),
        json!([0, 0, 0, 0]),
        json!(true),
        json!("VEC4"),
        json!(5126),
        json!(0.5),
    ])
}

proptest! {
    #![proptest_config(cases(30))]

    /// Whatever of such a scene still can be read is drawn, by some technique.
    #[test]
    fn changed_scenes_end_as_they_should(
        technique in select(Technique::ALL.to_vec()),
        values in prop::collection::vec((any::<Index>(), odd_value()), 0..3),
        bytes in prop::collection::vec((any::<Index>(), any::<u8>()), 0..3),
        cut in prop::option::weighted(0.1, any::<Index>()),
        binary in any::<bool>(),
    ) {
        let folder = tempfile::tempdir().map_err(|error| TestCaseError::fail(error.to_string()))?;
        let outputs = tempfile::tempdir().map_err(|error| TestCaseError::fail(error.to_string()))?;
        let read = |path: &str| fs::read(path).map_err(|error| TestCaseError::fail(error.to_string()));
        let mut file = if binary {
            read(COURT)?
        } else {
            let text = read(SPHERE)?;
            let mut document: Value = serde_json::from_slice(&text)
                .map_err(|error| TestCaseError::fail(error.to_string()))?;
            let mut all = Vec::new();
            pointers(&document, "", &mut all);
            for (at, value) in values {
                if let Some(target) = document.pointer_mut(&all[at.index(all.len())]) {
                    *target = value;
                }
            }
            document.to_string().into_bytes()
        };
        for (at, byte) in bytes {
            let at = at.index(file.len());
            file[at] = byte;
        }
        if let Some(cut) = cut {
            file.truncate(cut.index(file.len()));
        }
        let path = folder.path().join(if binary { "scene.glb" } else { "scene.gltf" });
        fs::write(&path, file).map_err(|error| TestCaseError::fail(error.to_string()))?;
        let mut command = antumbra();
        command.arg("capture").arg(&path).args(["--size", "8x8", "--technique", technique.name()]);
        if let Some(device) = std::env::var_os("ANTUMBRA_DEVICE") {
            command.arg("--device").arg(device);
        }
        command.args(["-o", "a.png", "--visibility", "v.exr"]).current_dir(outputs.path());
        if check(&mut command, outputs.path())? == 0 {
            prop_assert_eq!(names(outputs.path()).unwrap_or_default(), ["a.png", "v.exr"]);
        }
    }
}
