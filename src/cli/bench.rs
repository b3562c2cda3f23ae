//! `antumbra bench`: run time against error, over scenes and techniques.
//!
//! Each scene and light is measured in a process of its own, this program with the hidden
//! `--worker`. It reads its job from standard input and prints lines: `step LABEL` before it
//! touches a cell, at last `result JSON` or `failed TEXT`. It ends when its standard input closes,
//! so that it never outlives its parent.

use std::fmt::Write as _;
use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};

use clap::{Args, value_parser};
use serde_json::{Value, json};

use super::args::Size;
use super::error::CliError;
use super::progress::Progress;
use super::shard::{self, ShardArgs};
use super::{pipeline_cache, print_text};
use crate::batch::scene_file::scenes_in;
use crate::batch::{Cost, SceneFacts, Shard, bench_cost, run_of};
use crate::bench::contender::Method;
use crate::bench::results::{FailureKind, Results, ResultsError, Settings};
use crate::bench::{Contender, GroupResult, Job, Outcome, Session, group, parse_list, report};
use crate::capture::output::Output;
use crate::gpu::Gpu;
use crate::reference::MAX_SAMPLES;
use crate::stress;

const EXAMPLES: &str = "\
Examples:
  antumbra bench scene.glb --out results
  antumbra bench assets --techniques hard,pcss,rays:16 --size 256x256 --out results
  antumbra bench a.glb b.glb --techniques 'pcss:taps=16,search=8;pcss:taps=64' --out results
  antumbra bench assets --out results --resume

Techniques are those of `antumbra techniques`, and CPU ray tracing on all cores as a rival: rays:N
with N rays a pixel, rays:N+M with M more where a 3x3 neighbourhood disagrees. They are separated by
, or ; and --techniques may be given several times; after a comma `key=value` is a further option of
the technique before it.

Every light of every scene is measured, each in a process of its own, all techniques in turn. A
technique that fails or crashes is recorded in the results and the rest goes on; the exit code is
then 1 at the end. DIR/results.json has all numbers, DIR/report.html shows them; the page needs
nothing else.";

/// Measure run time against error over scenes and techniques
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct BenchArgs {
    /// Scenes, glTF 2.0 files, or folders of them
    #[arg(value_name = "SCENE", required_unless_present_any = ["suite", "worker"])]
    scenes: Vec<PathBuf>,

    /// Techniques with their options and rivals, or all
    #[arg(long, value_name = "LIST", default_value = "all", value_parser = check_list)]
    techniques: Vec<String>,

    /// Scenes of a suite: assets (all in the folder `assets`) or stress (hard cases, made by rule)
    #[arg(long, value_name = "NAME")]
    suite: Option<Suite>,

    /// Picture size in pixels
    #[arg(long, value_name = "WxH", default_value = "512x512")]
    size: Size,

    /// Camera of each scene; the first one by default
    #[arg(long, value_name = "NAME|INDEX")]
    camera: Option<String>,

    /// Measured rounds
    #[arg(long, value_name = "N", default_value = "7", value_parser = value_parser!(u32).range(1..=100_000))]
    repeat: u32,

    /// A technique is not measured again once its rounds took this many seconds together
    #[arg(long, value_name = "S", default_value = "20", value_parser = parse_seconds)]
    cell_seconds: f64,

    /// Light samples a pixel of the ray-traced truth
    #[arg(
        long, value_name = "N", default_value = "1024",
        value_parser = value_parser!(u32).range(16..=i64::from(MAX_SAMPLES))
    )]
    samples: u32,

    /// Vulkan device, by part of its name or by its index in `antumbra info`
    #[arg(long, value_name = "NAME|INDEX")]
    device: Option<String>,

    /// Folder for results.json, report.html and images; made if it is not there
    #[arg(long, value_name = "DIR", required_unless_present = "worker")]
    out: Option<PathBuf>,

    /// Keep what is finished in DIR/results.json and measure the rest
    #[arg(long)]
    resume: bool,

    #[command(flatten)]
    shard: ShardArgs,

    /// Read one job from standard input and measure it
    #[arg(long, hide = true)]
    worker: bool,
}

/// A named set of scenes.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Suite {
    /// Those in the folder `assets`.
    Assets,
    /// The hard cases of [`stress::suite`].
    Stress,
}

fn check_list(text: &str) -> Result<String, String> {
    parse_list(text).map_err(|error| error.to_string())?;
    Ok(text.into())
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok();
    let seconds = seconds.filter(|seconds: &f64| *seconds >= 0.0 && seconds.is_finite());
    seconds.ok_or_else(|| "give seconds, 0 or more".into())
}

/// What ends a benchmark.
#[derive(Debug, thiserror::Error)]
enum BenchError {
    #[error("{}: cannot make the folder: {source}", path.display())]
    Create { path: PathBuf, source: io::Error },
    #[error("cannot start the program for a measurement: {0}")]
    Start(io::Error),
    #[error("no job on standard input: {0}")]
    Job(String),
    #[error(transparent)]
    Results(#[from] ResultsError),
    #[error("{failed} of {all} cells failed, the first: {first}; all are in {}", file.display())]
    Cells {
        failed: usize,
        all: usize,
        first: String,
        file: PathBuf,
    },
}

impl From<BenchError> for CliError {
    fn from(error: BenchError) -> Self {
        match error {
            BenchError::Results(ResultsError::Settings { .. }) => Self::Usage(error.to_string()),
            error => Self::Other(Box::new(error)),
        }
    }
}

pub(super) fn run(args: &BenchArgs) -> Result<(), CliError> {
    if args.worker {
        return work();
    }
    let contenders = parse_list(&args.techniques.join(";"));
    let contenders = contenders.map_err(|error| CliError::Usage(error.to_string()))?;
    let told = args.shard.settle()?;
    let out = folder(args, told.as_ref().map(|(shard, _)| *shard));
    // Images of all shards go into one folder: their names tell scenes and lights apart.
    let shared = args.out.clone().unwrap_or_default();
    let mut jobs = jobs(args, &contenders, &shared)?;
    let all = groups(&jobs);
    if let Some(told) = &told {
        jobs = jobs[run_of(&costs(args, &contenders, &jobs), told.0)].to_vec();
        print_text(&shard::line(told, jobs.len(), "scenes and lights"))?;
    }
    let images = shared.join("images");
    let created = std::fs::create_dir_all(&images);
    created.map_err(|source| BenchError::Create {
        path: images,
        source,
    })?;
    let created = std::fs::create_dir_all(&out);
    created.map_err(|source| BenchError::Create {
        path: out.clone(),
        source,
    })?;
    let page = Output::File(out.join("report.html"));
    page.check()?;
    let shard = told.map_or(Shard::WHOLE, |(shard, _)| shard);
    Output::File(out.join("list.json")).write(&contents(shard, &all)?)?;

    let settings = Settings {
        techniques: labels(&contenders),
        width: args.size.0[0],
        height: args.size.0[1],
        repeat: args.repeat,
        samples: args.samples,
        cell_seconds: args.cell_seconds,
        device: args.device.clone(),
    };
    let mut session = match args.resume {
        true => Session::resume(&out, settings).map_err(BenchError::from)?,
        false => Session::new(&out, settings),
    };
    let progress = Progress::new(jobs.len() as u64);
    let mut fault = None;
    let ran = session.run(&jobs, &mut |job| {
        run_in_process(job, &progress).unwrap_or_else(|error| {
            let reason = error.to_string();
            fault.get_or_insert(error);
            Outcome::Failed(reason)
        })
    });
    drop(progress);
    ran.map_err(BenchError::from)?;
    if let Some(fault) = fault {
        return Err(fault.into());
    }
    page.write(report::page(session.results(), &shared).as_bytes())?;
    print_text(&summary(session.results(), &session.file(), &page))?;
    judge(session.results(), session.file())
}

/// `--out`, and in it a folder for each shard of several.
fn folder(args: &BenchArgs, shard: Option<Shard>) -> PathBuf {
    let out = args.out.clone().unwrap_or_default();
    match shard {
        Some(shard) if shard != Shard::WHOLE => out.join(format!("shard-{}", shard.file_stem())),
        _ => out,
    }
}

/// What each job costs, estimated.
fn costs(args: &BenchArgs, contenders: &[Contender], jobs: &[Job]) -> Vec<Cost> {
    let techniques: Vec<_> = (contenders.iter())
        .filter_map(|contender| match contender.method {
            Method::Technique(technique) => Some(technique),
            Method::Rival(..) => None,
        })
        .collect();
    let rivals = contenders.len() - techniques.len();
    let costs = jobs.iter().enumerate().map(|(at, job)| {
        // Scenes that are no file are small.
        let facts = SceneFacts::read(&job.scene);
        let (size, samples, rounds) = (args.size.0, args.samples, args.repeat);
        bench_cost(facts, size, samples, rounds, &techniques, rivals, at as u32)
    });
    costs.collect()
}

/// Scene and light of each job.
fn groups(jobs: &[Job]) -> Vec<Value> {
    let group =
        |job: &Job| json!({ "scene": job.scene.display().to_string(), "light_index": job.light });
    jobs.iter().map(group).collect()
}

/// `list.json`: all scenes and lights of all shards, and which shard this is.
fn contents(shard: Shard, groups: &[Value]) -> Result<Vec<u8>, CliError> {
    let (index, of) = (shard.index(), shard.count());
    let json = json!({ "schema": 1, "kind": "bench", "shard": index, "of": of, "groups": groups });
    let mut bytes = serde_json::to_vec_pretty(&json)?;
    bytes.push(b'\n');
    Ok(bytes)
}

fn labels(contenders: &[Contender]) -> Vec<String> {
    contenders.iter().map(|c| c.label.clone()).collect()
}

/// One job for each light of each scene. All scenes are read before the first is measured.
fn jobs(args: &BenchArgs, contenders: &[Contender], out: &Path) -> Result<Vec<Job>, CliError> {
    let job = |scene: &Path, case: Option<usize>, light: usize, light_name: String| Job {
        scene: scene.into(),
        case,
        light,
        light_name,
        camera: args.camera.clone(),
        contenders: labels(contenders),
        size: args.size.0,
        repeat: args.repeat,
        samples: args.samples,
        cell_seconds: args.cell_seconds,
        device: args.device.clone(),
        out: out.into(),
        dead: Vec::new(),
    };
    let mut jobs: Vec<Job> = Vec::new();
    let assets = matches!(args.suite, Some(Suite::Assets)).then(|| PathBuf::from("assets"));
    for given in args.scenes.iter().chain(&assets) {
        for scene in scenes_in(given)? {
            if jobs.iter().any(|job| job.scene == scene) {
                continue;
            }
            let lights = group::lights(&scene, args.camera.as_deref()).map_err(CliError::Scene)?;
            let lights = lights.into_iter();
            jobs.extend(lights.map(|(light, name)| job(&scene, None, light, name)));
        }
    }
    if let Some(Suite::Stress) = args.suite {
        for (at, case) in stress::suite().iter().enumerate() {
            let name = case.scene.lights[case.light].name.clone();
            let scene = Path::new("stress").join(&case.name);
            jobs.push(job(&scene, Some(at), case.light, name));
        }
    }
    Ok(jobs)
}

/// Ends the process when it goes out of use.
struct Worker(Child);

impl Drop for Worker {
    fn drop(&mut self) {
        // Neither does anything to a process that has ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn run_in_process(job: &Job, progress: &Progress) -> Result<Outcome, BenchError> {
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
fn work() -> Result<(), CliError> {
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

/// One line a cell, and the files.
fn summary(results: &Results, file: &Path, page: &Output) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let mut line = |line: String| {
        let _ = writeln!(text, "{line}");
    };
    for reference in &results.references {
        let name = format!(
            "{}, light {} `{}`",
            reference.scene, reference.light_index, reference.light
        );
        line(name.replace(char::is_control, "?"));
        for entry in results.group(reference) {
            let label = &entry.label;
            match (&entry.failure, &entry.visibility_ms, &entry.error) {
                (Some(failure), ..) => line(format!("  {label:<24} {}", failure.reason)),
                (None, Some(ms), Some(error)) => line(format!(
                    "  {label:<24} {:10.3} ms   penumbra rmse {:.5}  bias {:+.5}",
                    ms.median, error.penumbra.rmse, error.penumbra.bias
                )),
                (None, None, Some(error)) => line(format!(
                    "  {label:<24} no timestamps   penumbra rmse {:.5}  bias {:+.5}",
                    error.penumbra.rmse, error.penumbra.bias
                )),
                _ => line(format!("  {label:<24} not measured")),
            }
        }
    }
    line(format!(
        "{}: {} cells",
        file.display(),
        results.images.len()
    ));
    line(format!("{page}"));
    text
}

/// Fails if a cell did, but not for techniques that cannot do a light.
fn judge(results: &Results, file: PathBuf) -> Result<(), CliError> {
    let is_fault = |kind| kind != FailureKind::Unsupported;
    let failed = results
        .failures
        .iter()
        .filter(|cell| is_fault(cell.failure.kind));
    let failed: Vec<_> = failed.collect();
    let Some(first) = failed.first() else {
        return Ok(());
    };
    let first = format!(
        "{}, light {} `{}`, {}: {}",
        first.scene, first.light_index, first.light, first.label, first.failure.reason
    );
    Err(BenchError::Cells {
        failed: failed.len(),
        all: results.images.len(),
        first,
        file,
    }
    .into())
}
