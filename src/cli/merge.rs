//! `antumbra merge`: what the shards made, as one.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;

use super::error::CliError;
use super::print_text;
use crate::batch::gather::{self, GatherError, Gathered};
use crate::batch::page;
use crate::bench;
use crate::capture::output::Output;

const EXAMPLES: &str = "\
Examples:
  antumbra merge results
  antumbra merge node-a/results node-b/results --out all
  antumbra merge results --no-timings

Every item of a batch has to be there, with files that are what its record says; every cell of a
benchmark has to be measured. Else those that are missing or failed are printed, one a line, nothing
is written, and the exit code is 1.";

/// Make one results.json and report.html of the shards of `batch` or `bench`
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct MergeArgs {
    /// Folders that shards wrote to with --out
    #[arg(value_name = "DIR", required = true)]
    folders: Vec<PathBuf>,

    /// Folder for results.json and report.html; the first DIR by default
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Leave out times, memory and what else depends on the run: the same items then give the same
    /// bytes, however they were cut into shards
    #[arg(long)]
    no_timings: bool,
}

/// What ends a merge.
#[derive(Debug, thiserror::Error)]
enum MergeError {
    #[error(transparent)]
    Batch(#[from] GatherError),
    #[error(transparent)]
    Bench(#[from] bench::gather::GatherError),
    #[error("{}: cannot copy the image from {}: {source}", to.display(), from.display())]
    Copy {
        from: PathBuf,
        to: PathBuf,
        source: std::io::Error,
    },
}

impl From<MergeError> for CliError {
    fn from(error: MergeError) -> Self {
        Self::Other(Box::new(error))
    }
}

pub(super) fn run(args: &MergeArgs) -> Result<(), CliError> {
    let out = match &args.out {
        Some(out) => out.clone(),
        None => args.folders.first().cloned().unwrap_or_default(),
    };
    let shards = args
        .folders
        .iter()
        .flat_map(|folder| bench::gather::shards_in(folder));
    let shards: Vec<_> = shards.collect();
    let (mut results, page, what) = if shards.is_empty() {
        let gathered = Gathered::new(&args.folders);
        if let Err(GatherError::Faults { faults, .. }) = &gathered {
            print_faults(faults)?;
        }
        let gathered = gathered.map_err(MergeError::from)?;
        // Where it is has to be known for the way from there to the pictures.
        make(&out)?;
        let page = page::page(&gathered, &args.folders, &out, !args.no_timings);
        let what = format!("{} items", gathered.items.len());
        (gathered.results(), page, what)
    } else {
        let gathered = bench::gather::gather(&shards);
        if let Err(bench::gather::GatherError::Faults { faults }) = &gathered {
            print_faults(faults)?;
        }
        let gathered = gathered.map_err(MergeError::from)?;
        make(&out)?;
        for folder in &args.folders {
            copy_images(folder, &out)?;
        }
        let what = format!("{} cells", gathered.images.len());
        let value = serde_json::to_value(&gathered)?;
        let plot = Output::File(out.join("plot.svg"));
        plot.write(bench::report::plot(&gathered).as_bytes())?;
        let matrix = Output::File(out.join("matrix.md"));
        matrix.write(bench::report::matrix(&gathered).as_bytes())?;
        (value, bench::report::page(&gathered, &out), what)
    };
    if args.no_timings {
        gather::without_timings(&mut results);
    }
    let mut bytes = serde_json::to_vec_pretty(&results)?;
    bytes.push(b'\n');
    let (file, report) = (out.join("results.json"), out.join("report.html"));
    Output::File(file.clone()).write(&bytes)?;
    Output::File(report.clone()).write(page.as_bytes())?;
    print_text(&format!(
        "{}: {what}\n{}\n",
        file.display(),
        report.display()
    ))
}

fn make(out: &Path) -> Result<(), CliError> {
    // Why it could not be made, the first file in it tells.
    let _ = fs::create_dir_all(out);
    Ok(Output::File(out.join("results.json")).check()?)
}

fn print_faults(faults: &[String]) -> Result<(), CliError> {
    let lines = faults
        .iter()
        .map(|fault| crate::message::one_line(fault) + "\n");
    print_text(&lines.collect::<String>())
}

/// A benchmark's images belong beside its results.
fn copy_images(folder: &Path, out: &Path) -> Result<(), CliError> {
    let images = folder.join("images");
    let is_same = match (folder.canonicalize(), out.canonicalize()) {
        (Ok(folder), Ok(out)) => folder == out,
        _ => false,
    };
    if is_same {
        return Ok(());
    }
    // Nobody writes images that is not a benchmark.
    for entry in fs::read_dir(&images).into_iter().flatten().flatten() {
        let (from, to) = (entry.path(), out.join("images").join(entry.file_name()));
        let name = entry.file_name();
        if name.to_string_lossy().starts_with('.') {
            continue;
        }
        let copied = fs::create_dir_all(out.join("images")).and_then(|()| fs::copy(&from, &to));
        copied.map_err(|source| MergeError::Copy { from, to, source })?;
    }
    Ok(())
}
