//! A process for each scene and light of a benchmark: this program with the hidden `--worker`.
//!
//! It reads its job from standard input and prints lines: `step LABEL` before it touches a cell, at
//! last `result JSON` or `failed TEXT`. It ends when its standard input closes, so that it never
//! outlives its parent.

use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::process::{Child, Command, ExitStatus, Stdio};

use super::bench::BenchError;
use super::error::CliError;
use super::progress::Progress;
use super::{pipeline_cache, print_text};
use crate::bench::{GroupResult, Job, Outcome, group};
use crate::gpu::Gpu;

/// Ends the process when it goes out of use.
struct Worker(Child);

impl Drop for Worker {
    fn drop(&mut self) {
        // Neither does anything to a process that has ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Measures a job in a process of its own.
pub(super) fn run_in_process(job: &Job, progress: &Progress) -> Result<Outcome, BenchError> {
    let program = std::env::current_exe().map_err(BenchError::Start)?;
    let text = serde_json::to_string(job).map_err(|error| BenchError::Job(error.to_string()))?;
    let mut command = Command::new(program);
    command.args(["bench", "--worker"]);
    command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut worker = Worker(command.spawn().map_err(BenchError::Start)?);
    let (mut stdin, stdout, stderr) = (
        worker.0.stdin.take(),
        worker.0.stdout.take(),
        worker.0.stderr.take(),
    );
    let said = std::thread::spawn(move || {
        let mut said = Vec::new();
        if let Some(mut stderr) = stderr {
            // What there is of it will do.
            let _ = stderr.read_to_end(&mut said);
        }
        String::from_utf8_lossy(&said).into_owned()
    });
    if let Some(stdin) = &mut stdin {
        // A worker that does not read has died; its exit tells.
        let _ = writeln!(stdin, "{text}").and_then(|()| stdin.flush());
    }
    let scene = job.scene.display();
    progress.say(format!("{scene}, {}: truth", job.light_name));
    let (mut label, mut outcome) = (None, None);
    let lines = stdout.map(|stdout| BufReader::new(stdout).lines());
    for line in lines.into_iter().flatten().map_while(Result::ok) {
        match line.split_once(' ') {
            Some(("step", rest)) => {
                progress.say(format!("{scene}, {}: {rest}", job.light_name));
                label = Some(rest.to_string());
            }
            Some(("result", rest)) => {
                let group = serde_json::from_str::<GroupResult>(rest).ok();
                outcome = group.map(|group| Outcome::Done(Box::new(group)));
            }
            Some(("failed", rest)) => outcome = Some(Outcome::Failed(rest.into())),
            _ => {}
        }
    }
    progress.step();
    let status = worker.0.wait().map_err(BenchError::Start)?;
    drop(stdin);
    let said = said.join().unwrap_or_default();
    Ok(outcome.unwrap_or_else(|| Outcome::Died {
        label,
        reason: death(status, &said),
    }))
}

/// How a process ended, and the last it said.
fn death(status: ExitStatus, said: &str) -> String {
    let last = said.lines().map(str::trim).rfind(|line| !line.is_empty());
    match last {
        Some(last) => format!("the process ended with {status}: {last}"),
        None => format!("the process ended with {status}"),
    }
}

/// The other side of [`run_in_process`].
pub(super) fn work() -> Result<(), CliError> {
    let fault = |reason: String| CliError::from(BenchError::Job(reason));
    let mut line = String::new();
    let read = io::stdin().read_line(&mut line);
    read.map_err(|error| fault(error.to_string()))?;
    let job: Job = serde_json::from_str(&line).map_err(|error| fault(error.to_string()))?;
    std::thread::spawn(|| {
        // Nothing more is said; this returns once the parent is gone.
        let _ = io::copy(&mut io::stdin().lock(), &mut io::sink());
        // Not `std::process::exit`: it does not go together with drivers' threads.
        signal_hook::low_level::exit(1);
    });
    let say = |what: &str, text: &str| print_text(&format!("{what} {text}\n"));
    let on_step = |label: &str| {
        // Without a reader there is no parent.
        let _ = say("step", label);
    };
    let on_device = |gpu: &mut Gpu| {
        if let Some(file) = pipeline_cache::file(gpu.info()) {
            gpu.use_pipeline_cache(file);
        }
    };
    match group::run(&job, &on_step, &on_device) {
        Ok(group) => say("result", &serde_json::to_string(&group)?),
        Err(error) => say("failed", &crate::message::line(&error)),
    }
}
