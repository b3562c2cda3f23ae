//! A disk that is full, and an end in the middle of writing: whole files or none, and the next run is as any.

use std::fs;
use std::os::unix::process::ExitStatusExt as _;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use antumbra::capture::exr;

use super::program::{Result, SPHERE, assert_fails, capture_command, names};

/// The captures of the tests, to `folder`, behind a shell that runs `before` first.
fn limited(before: &str, folder: &Path, args: &[&str]) -> Command {
    let capture = capture_command(SPHERE, "256x256");
    let mut command = Command::new("sh");
    command
        .arg("-c")
        .arg(format!("{before}; exec \"$@\""))
        .arg("sh")
        .arg(capture.get_program())
        .args(capture.get_args())
        .args(args)
        .current_dir(folder);
    for (name, value) in capture.get_envs() {
        match value {
            Some(value) => command.env(name, value),
            None => command.env_remove(name),
        };
    }
    command
}

const OUTPUTS: [&str; 6] = [
    "-o",
    "picture.png",
    "--visibility",
    "visibility.exr",
    "--report",
    "report.json",
];

/// The shell counts in 512 bytes; the picture takes 20 kB.
#[test]
fn a_disk_that_is_full_is_one_line_and_leaves_no_file() -> Result {
    let folder = tempfile::tempdir()?;
    let picture = folder.path().join("picture.png");
    fs::write(&picture, "of an earlier run")?;
    let output = limited("trap '' XFSZ; ulimit -f 8", folder.path(), &OUTPUTS).output()?;
    assert_fails(&output, 1, &["picture.png", "cannot write", "too large"]);
    assert_eq!(names(folder.path())?, ["picture.png"]);
    assert_eq!(fs::read(&picture)?, b"of an earlier run");
    let output = limited(":", folder.path(), &OUTPUTS).output()?;
    assert_eq!(output.status.code(), Some(0));
    let all = ["picture.png", "report.json", "visibility.exr"];
    assert_eq!(names(folder.path())?, all);
    Ok(())
}

/// The limit's signal ends the process in the middle of a `write`.
#[test]
fn an_end_in_the_middle_of_a_file_leaves_no_half_of_it() -> Result {
    let folder = tempfile::tempdir()?;
    let visibility = folder.path().join("visibility.exr");
    fs::write(&visibility, "of an earlier run")?;
    let output = limited("ulimit -c 0; ulimit -f 8", folder.path(), &OUTPUTS).output()?;
    assert!(output.status.signal().is_some(), "{:?}", output.status);
    assert_eq!(fs::read(&visibility)?, b"of an earlier run");
    let left: Vec<String> = names(folder.path())?;
    let half = |name: &&String| name.starts_with(".antumbra-") && name.ends_with(".part");
    assert_eq!(left.iter().filter(half).count(), left.len() - 1, "{left:?}");
    let output = limited(":", folder.path(), &OUTPUTS).output()?;
    assert_eq!(output.status.code(), Some(0));
    let (width, height, values) = exr::read_channel(&visibility, "Y")?;
    assert_eq!((width, height, values.len()), (256, 256, 1 << 16));
    Ok(())
}

/// Killed at any moment of a run of many frames: each file that is there is whole, and the next run makes
/// what was missing.
#[test]
fn a_kill_leaves_whole_files() -> Result {
    let folder = tempfile::tempdir()?;
    let capture = |folder: &Path| {
        let mut command = capture_command(SPHERE, "64x64");
        command
            .args(["--frames", "0..12", "--visibility"])
            .arg(folder.join("{frame:02}.exr"))
            .stdout(std::process::Stdio::null());
        command
    };
    let files = || -> Result<Vec<String>> {
        let all = names(folder.path())?.into_iter();
        Ok(all.filter(|name| !name.starts_with('.')).collect())
    };
    let mut cut_off = 0;
    for wanted in [1, 4, 9] {
        let mut child = capture(folder.path()).spawn()?;
        let begin = Instant::now();
        while files()?.len() < wanted && begin.elapsed() < Duration::from_secs(120) {
            std::thread::sleep(Duration::from_millis(1));
        }
        child.kill()?;
        cut_off += usize::from(child.wait()?.signal() == Some(9));
        for name in files()? {
            let (width, height, _) = exr::read_channel(folder.path().join(&name), "Y")?;
            assert_eq!((width, height), (64, 64), "{name}");
        }
        for name in names(folder.path())? {
            fs::remove_file(folder.path().join(name))?;
        }
    }
    assert!(cut_off > 0, "no run was cut off");
    let output = capture(folder.path()).output()?;
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(names(folder.path())?.len(), 12);
    Ok(())
}
