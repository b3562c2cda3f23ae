//! `antumbra bench`: run time against error, over scenes and techniques.
//!
//! Each scene and light is measured in a process of its own ([`bench_worker`]).

use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

use clap::{Args, value_parser};
use serde_json::{Value, json};

use super::args::Size;
use super::error::CliError;
use super::progress::Progress;
use super::shard::{self, ShardArgs};
use super::{bench_study, bench_worker, print_text};
use crate::batch::scene_file::scenes_in;
use crate::batch::{Cost, SceneFacts, Shard, bench_cost, run_of};
use crate::bench::contender::Method;
use crate::bench::results::{FailureKind, Results, ResultsError, Settings};
use crate::bench::{
    Contender, Job, Outcome, Session, StudyError, group, parse_list, report, table,
};
use crate::capture::output::Output;
use crate::reference::MAX_SAMPLES;
use crate::shadow::auto::Table;
use crate::stress;

const EXAMPLES: &str = "\
Examples:
  antumbra bench scene.glb --out results
  antumbra bench assets --techniques hard,pcss,rays:16 --size 256x256 --out results
  antumbra bench a.glb b.glb --techniques 'pcss:taps=16,search=8;pcss:taps=64' --out results
  antumbra bench assets --out results --resume
  antumbra bench --study benches/studies/occlusion-textures.toml --out results

Techniques are those of `antumbra techniques`, and CPU ray tracing on all cores as a rival: rays:N
with N rays a pixel, rays:N+M with M more where a 3x3 neighbourhood disagrees. They are separated by
, or ; and --techniques may be given several times; after a comma `key=value` is a further option of
the technique before it.

Every light of every scene is measured, each in a process of its own, all techniques in turn. A
technique that fails or crashes is recorded in the results and the rest goes on; the exit code is
then 1 at the end. DIR/results.json has all numbers, DIR/report.html shows them and needs nothing
else, DIR/plot.svg is its plot over all scenes.

A study is a TOML file of tables: scenes, techniques, light scales, sizes and columns of each. Its
tables go to DIR/study.md, the benchmarks that they are made of to DIR/TABLE/SIZE. --size, --samples,
--repeat and --cell-seconds hold for all tables then.";

const DEFAULT_SIZE: [u32; 2] = [512, 512];
const DEFAULT_SAMPLES: u32 = 1024;

/// Measure run time against error over scenes and techniques
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct BenchArgs {
    /// Scenes, glTF 2.0 files, or folders of them
    #[arg(value_name = "SCENE", required_unless_present_any = ["suite", "study", "worker"])]
    scenes: Vec<PathBuf>,

    /// Techniques with their options and rivals, or all
    #[arg(long, value_name = "LIST", default_value = "all", value_parser = check_list)]
    techniques: Vec<String>,

    /// Scenes of a suite: assets (all in the folder `assets`) or stress (hard cases, made by rule)
    #[arg(long, value_name = "NAME")]
    suite: Option<Suite>,

    /// Measure the tables of a TOML file instead
    #[arg(
        long, value_name = "FILE",
        conflicts_with_all = ["scenes", "suite", "techniques", "camera", "shard", "shards"]
    )]
    study: Option<PathBuf>,

    /// Picture size in pixels; 512x512 by default
    #[arg(long, value_name = "WxH")]
    pub(super) size: Option<Size>,

    /// Camera of each scene; the first one by default
    #[arg(long, value_name = "NAME|INDEX")]
    camera: Option<String>,

    /// Measured rounds
    #[arg(long, value_name = "N", default_value = "7", value_parser = value_parser!(u32).range(1..=100_000))]
    repeat: u32,

    /// A technique is not measured again once its rounds took this many seconds together
    #[arg(long, value_name = "S", default_value = "20", value_parser = parse_seconds)]
    cell_seconds: f64,

    /// Light samples a pixel of the ray-traced truth; 1024 by default
    #[arg(
        long, value_name = "N",
        value_parser = value_parser!(u32).range(16..=i64::from(MAX_SAMPLES))
    )]
    pub(super) samples: Option<u32>,

    /// Vulkan device, by part of its name or by its index in `antumbra info`
    #[arg(long, value_name = "NAME|INDEX")]
    device: Option<String>,

    /// Folder for results.json, report.html, plot.svg, matrix.md and images; made if it is not there
    #[arg(long, value_name = "DIR", required_unless_present = "worker")]
    pub(super) out: Option<PathBuf>,

    /// Write the table of times and errors that `auto` chooses by, and print what its choices are worth on
    /// scenes left out of it
    #[arg(long, value_name = "FILE", conflicts_with_all = ["shards", "worker"])]
    pub(super) table: Option<PathBuf>,

    /// Keep what is finished in DIR/results.json and measure the rest
    #[arg(long)]
    pub(super) resume: bool,

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
pub(super) enum BenchError {
    #[error("{}: cannot make the folder: {source}", path.display())]
    Create { path: PathBuf, source: io::Error },
    #[error("cannot start the program for a measurement: {0}")]
    Start(io::Error),
    #[error("no job on standard input: {0}")]
    Job(String),
    #[error(transparent)]
    Results(#[from] ResultsError),
    #[error(transparent)]
    Study(#[from] StudyError),
    #[error("{}: table `{table}`: {scene} has no light `{light}`; it has {have}", path.display())]
    NoLight {
        path: PathBuf,
        table: String,
        scene: String,
        light: String,
        have: String,
    },
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
            BenchError::Results(ResultsError::Settings { .. }) | BenchError::NoLight { .. } => {
                Self::Usage(error.to_string())
            }
            BenchError::Study(StudyError::Form { .. } | StudyError::Table { .. }) => {
                Self::Usage(error.to_string())
            }
            error => Self::Other(Box::new(error)),
        }
    }
}

pub(super) fn run(args: &BenchArgs) -> Result<(), CliError> {
    if args.worker {
        return bench_worker::work();
    }
    if let Some(file) = &args.study {
        return bench_study::run(args, file);
    }
    let contenders = parse_list(&args.techniques.join(";"));
    let contenders = contenders.map_err(|error| CliError::Usage(error.to_string()))?;
    let told = args.shard.settle()?;
    let out = folder(args, told.as_ref().map(|(shard, _)| *shard));
    // Images of all shards go into one folder: their names tell scenes and lights apart.
    let shared = args.out.clone().unwrap_or_default();
    let size = args.size.map_or(DEFAULT_SIZE, |size| size.0);
    let samples = args.samples.unwrap_or(DEFAULT_SAMPLES);
    let blank = blank_job(args, labels(&contenders), size, samples, 1.0, &shared);
    let mut jobs = jobs(args, &blank)?;
    let all = groups(&jobs);
    if let Some(told) = &told {
        jobs = jobs[run_of(&costs(args, &contenders, &jobs), told.0)].to_vec();
        print_text(&shard::line(told, jobs.len(), "scenes and lights"))?;
    }
    create(&shared.join("images"))?;
    create(&out)?;
    let page = Output::File(out.join("report.html"));
    page.check()?;
    let shard = told.map_or(Shard::WHOLE, |(shard, _)| shard);
    Output::File(out.join("list.json")).write(&contents(shard, &all)?)?;

    let mut session = open(args, &blank, &out)?;
    measure(&mut session, &jobs, &Progress::new(jobs.len() as u64))?;
    page.write(report::page(session.results(), &shared).as_bytes())?;
    let plot = Output::File(out.join("plot.svg"));
    plot.write(report::plot(session.results()).as_bytes())?;
    let matrix = Output::File(out.join("matrix.md"));
    matrix.write(report::matrix(session.results()).as_bytes())?;
    write_table(args, [session.results()])?;
    print_text(&summary(session.results(), &session.file(), &page))?;
    judge([session.results()], session.file())
}

/// Writes the table of `--table`.
pub(super) fn write_table<'r>(
    args: &BenchArgs,
    results: impl IntoIterator<Item = &'r Results>,
) -> Result<(), CliError> {
    let Some(file) = &args.table else {
        return Ok(());
    };
    let table = Table::new(results.into_iter().flat_map(table::rows).collect());
    Output::File(file.clone()).write(table.to_string().as_bytes())?;
    print_text(&table::verdict(&table))
}

/// Makes a folder and those above it.
pub(super) fn create(folder: &Path) -> Result<(), BenchError> {
    std::fs::create_dir_all(folder).map_err(|source| BenchError::Create {
        path: folder.into(),
        source,
    })
}

/// The results in `out`, or none so far.
pub(super) fn open(args: &BenchArgs, blank: &Job, out: &Path) -> Result<Session, BenchError> {
    let settings = Settings {
        techniques: blank.contenders.clone(),
        width: blank.size[0],
        height: blank.size[1],
        repeat: blank.repeat,
        samples: blank.samples,
        cell_seconds: blank.cell_seconds,
        device: blank.device.clone(),
        light_scale: blank.light_scale,
    };
    match args.resume {
        true => Ok(Session::resume(out, settings)?),
        false => Ok(Session::new(out, settings)),
    }
}

/// Measures what is not done yet.
pub(super) fn measure(
    session: &mut Session,
    jobs: &[Job],
    progress: &Progress,
) -> Result<(), BenchError> {
    let mut fault = None;
    session.run(jobs, &mut |job| {
        bench_worker::run_in_process(job, progress).unwrap_or_else(|error| {
            let reason = error.to_string();
            fault.get_or_insert(error);
            Outcome::Failed(reason)
        })
    })?;
    match fault {
        Some(fault) => Err(fault),
        None => Ok(()),
    }
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
        let (size, samples, rounds) = (job.size, job.samples, args.repeat);
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

/// A job without its scene and light.
pub(super) fn blank_job(
    args: &BenchArgs,
    contenders: Vec<String>,
    size: [u32; 2],
    samples: u32,
    light_scale: f32,
    out: &Path,
) -> Job {
    Job {
        scene: PathBuf::new(),
        case: None,
        light: 0,
        light_name: String::new(),
        light_scale,
        camera: args.camera.clone(),
        contenders,
        size,
        repeat: args.repeat,
        samples,
        cell_seconds: args.cell_seconds,
        device: args.device.clone(),
        out: out.into(),
        dead: Vec::new(),
    }
}

/// One job for each light of each scene. All scenes are read before the first is measured.
fn jobs(args: &BenchArgs, blank: &Job) -> Result<Vec<Job>, CliError> {
    let job = |scene: &Path, case: Option<usize>, light: usize, light_name: String| Job {
        scene: scene.into(),
        case,
        light,
        light_name,
        ..blank.clone()
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
pub(super) fn judge<'r>(
    all: impl IntoIterator<Item = &'r Results>,
    file: PathBuf,
) -> Result<(), CliError> {
    let (mut failed, mut cells) = (Vec::new(), 0);
    for results in all {
        let faults = results.failures.iter();
        failed.extend(faults.filter(|cell| cell.failure.kind != FailureKind::Unsupported));
        cells += results.images.len();
    }
    let Some(first) = failed.first() else {
        return Ok(());
    };
    let first = format!(
        "{}, light {} `{}`, {}: {}",
        first.scene, first.light_index, first.light, first.label, first.failure.reason
    );
    Err(BenchError::Cells {
        failed: failed.len(),
        all: cells,
        first,
        file,
    }
    .into())
}
