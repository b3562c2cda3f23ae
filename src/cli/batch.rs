//! `antumbra batch`: the items of a file of jobs, or a shard of them.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use serde_json::json;

use super::batch_run::{Counts, Runner};
use super::error::CliError;
use super::print_text;
use super::progress::Progress;
use super::shard::{self, ShardArgs};
use crate::batch::{JobFile, JobsError, List, Shard, record};
use crate::capture::output::Output;

const EXAMPLES: &str = "\
Examples:
  antumbra batch jobs.toml --list
  antumbra batch jobs.toml --out results
  antumbra batch jobs.toml --out results --shard 3/32
  sbatch --array=1-32 --wrap 'antumbra batch jobs.toml --out /shared/results'
  antumbra merge /shared/results

A file of jobs:
  [[job]]
  name = \"walk\"                            # folder of its images
  scenes = [\"walk.glb\", \"more\"]            # files and folders, from the folder of this file
  techniques = [\"hard\", \"pcss:taps=64\"]    # default: hard
  lights = [\"lamp\", { name = \"lamp\", size = \"0.5\" }]   # or \"each\"; default: all in one frame
  cameras = [\"front\", 1]                   # or \"each\"; default: the first
  frames = \"0..48\"                         # with fps = 30 and time = 0; default: one frame
  size = \"512x512\"
  picture = \"png\"                          # png, exr or none
  visibility = \"exr\"                       # exr, png or none; default: none

An item that is finished is skipped: beside its files JOB/SCENE.../FRAME.* in DIR stands a record
with the digest of scene, options and program. It may be run again at any time, by several processes
at once, on a shared folder.";

/// Render the frames of a file of jobs, or a part of them
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct BatchArgs {
    /// Scenes x techniques x lights x cameras x frames
    #[arg(value_name = "JOBS.toml")]
    jobs: PathBuf,

    /// Folder for the images; made if it is not there
    #[arg(long, value_name = "DIR", required_unless_present = "list")]
    out: Option<PathBuf>,

    /// Print the items and render nothing: number, shard of the whole, estimated cost, name
    #[arg(long)]
    list: bool,

    #[command(flatten)]
    shard: ShardArgs,

    /// Vulkan device, by part of its name or by its index in `antumbra info`
    #[arg(long, value_name = "NAME|INDEX")]
    device: Option<String>,
}

/// What ends a batch.
#[derive(Debug, thiserror::Error)]
enum BatchError {
    #[error("{}: cannot make the folder: {source}", path.display())]
    Create {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("cannot read the program's own file: {0}")]
    Program(std::io::Error),
    #[error("{failed} of {all} items failed, the first: {first}")]
    Items {
        failed: usize,
        all: usize,
        first: String,
    },
}

impl From<BatchError> for CliError {
    fn from(error: BatchError) -> Self {
        Self::Other(Box::new(error))
    }
}

impl From<JobsError> for CliError {
    fn from(error: JobsError) -> Self {
        match error {
            JobsError::Read { .. } | JobsError::Folder { .. } => Self::Other(Box::new(error)),
            JobsError::Scene(error) => Self::Scene(error),
            error => Self::Usage(error.to_string()),
        }
    }
}

pub(super) fn run(args: &BatchArgs) -> Result<(), CliError> {
    let begun = Instant::now();
    let told = args.shard.settle()?;
    let list = List::new(&JobFile::read(&args.jobs)?, &args.jobs)?;
    let shard = told.as_ref().map_or(Shard::WHOLE, |(shard, _)| *shard);
    let numbers = list.of_shard(shard);
    if args.list {
        return print_list(&list, shard);
    }
    if let Some(told) = &told {
        print_text(&shard::line(told, numbers.len(), "items"))?;
    }
    let out = args.out.clone().unwrap_or_default();
    let shards = out.join("shards");
    let created = std::fs::create_dir_all(&shards);
    created.map_err(|source| BatchError::Create {
        path: shards.clone(),
        source,
    })?;
    Output::File(out.join("list.json")).write(&contents(&list)?)?;

    let program = record::program().map_err(BatchError::Program)?;
    let progress = Progress::new(numbers.len() as u64);
    let mut runner = Runner::new(&out, program, args.device.as_deref());
    let ran = runner.run(&list, numbers.clone(), &progress);
    drop(progress);
    let counts = runner.finish()?;
    ran?;
    let seconds = begun.elapsed().as_secs_f64();
    let all = numbers.len();
    let log = log(
        shard,
        told.as_ref().map(|(_, source)| source.as_str()),
        &counts,
        seconds,
    );
    Output::File(shards.join(format!("{}.json", shard.file_stem()))).write(&log?)?;
    print_text(&summary(&counts, seconds))?;
    match counts.failures.first() {
        Some(first) => Err(BatchError::Items {
            failed: counts.failures.len(),
            all,
            first: first.clone(),
        }
        .into()),
        None => Ok(()),
    }
}

/// One line an item, of all or of a shard.
fn print_list(list: &List, shard: Shard) -> Result<(), CliError> {
    let numbers = list.of_shard(shard);
    let mut text = String::new();
    for (number, item) in numbers.clone().zip(list.items(numbers)) {
        let cost = item.sequence.cost().item;
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{number}\t{cost}\t{}", item.id());
        if text.len() > 1 << 16 {
            print_text(&std::mem::take(&mut text))?;
        }
    }
    print_text(&text)
}

/// `list.json`: what there should be in the end. Every shard writes the same.
fn contents(list: &List) -> Result<Vec<u8>, serde_json::Error> {
    let sequences = list.sequences().iter().map(|sequence| {
        let frames = [sequence.frames.start, sequence.frames.end];
        json!({ "name": sequence.name, "scene": sequence.scene, "frames": frames })
    });
    let sequences: Vec<_> = sequences.collect();
    let json = json!({ "schema": 1, "kind": "batch", "items": list.len(), "sequences": sequences });
    let mut bytes = serde_json::to_vec_pretty(&json)?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// What a shard did and how long it took.
fn log(
    shard: Shard,
    source: Option<&str>,
    counts: &Counts,
    seconds: f64,
) -> Result<Vec<u8>, serde_json::Error> {
    let json = json!({
        "schema": 1,
        "shard": shard.index(),
        "of": shard.count(),
        "source": source,
        "rendered": counts.rendered,
        "skipped": counts.skipped,
        "unsupported": counts.unsupported,
        "failed": counts.failures.len(),
        "scenes_loaded": counts.scenes_loaded,
        "ready_s": counts.ready_s,
        "seconds": seconds,
    });
    let mut bytes = serde_json::to_vec_pretty(&json)?;
    bytes.push(b'\n');
    Ok(bytes)
}

fn summary(counts: &Counts, seconds: f64) -> String {
    let mut text = format!(
        "items      {} rendered, {} skipped as finished, {} unsupported, {} failed\n",
        counts.rendered,
        counts.skipped,
        counts.unsupported,
        counts.failures.len()
    );
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "time       {seconds:.2} s, of which {:.2} s for the device and {} scene(s); {:.2} items/s",
        counts.ready_s,
        counts.scenes_loaded,
        counts.rendered as f64 / seconds.max(1e-9)
    );
    text
}
