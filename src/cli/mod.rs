//! The command line: arguments in, files and text out.
//!
//! Exit codes: 0 done, 1 failed, 2 the command line is wrong, by itself or for the scene or machine
//! at hand, 143 ended by SIGTERM. Every failure prints exactly one line, `error: ..`, to standard error.

mod args;
mod batch;
mod batch_run;
mod bench;
mod bench_study;
mod bench_worker;
mod capture;
mod compare;
mod error;
mod frames;
mod graph;
mod info;
mod merge;
mod outputs;
mod pipeline_cache;
mod progress;
mod reference;
mod report;
mod shard;
mod shot;
mod signals;
mod summary;
mod techniques;
mod template;

use std::ffi::OsString;
use std::io::{self, Write as _};
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{Parser, Subcommand};

use crate::capture::output::{Output, OutputError};
use error::{CliError, USAGE};

const EXAMPLES: &str = "\
Examples:
  antumbra capture scene.glb -o picture.png
  antumbra capture scene.glb --visibility vis.exr --light lamp --light-size 0.5
  antumbra capture scene.glb -o walk_{frame:04}.png --frames 0..48 --fps 24
  antumbra graph scene.glb --format dot | dot -Tsvg -o frame.svg
  antumbra batch jobs.toml --out results --shard 3/32
  antumbra info

Exit codes: 0 done, 1 failed, 2 wrong usage, 143 ended by SIGTERM.";

/// Area-light soft shadows for Vulkan: glTF scenes in, pictures and visibility images out.
#[derive(Debug, Parser)]
#[command(name = "antumbra", version, about, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Capture(Box<capture::CaptureArgs>),
    Info(info::InfoArgs),
    Techniques(techniques::TechniquesArgs),
    Graph(graph::GraphArgs),
    Reference(Box<reference::ReferenceArgs>),
    Compare(compare::CompareArgs),
    Bench(Box<bench::BenchArgs>),
    Batch(batch::BatchArgs),
    Merge(merge::MergeArgs),
}

/// Runs the program with `arguments`, of which the first is its own name, and returns its exit
/// code. Prints to standard output and standard error, and ends the process at SIGTERM.
pub fn run(arguments: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> ExitCode {
    signals::handle_termination();
    let result = match Cli::try_parse_from(arguments) {
        Ok(cli) => match cli.command {
            Command::Capture(args) => capture::run(*args),
            Command::Info(args) => info::run(&args),
            Command::Techniques(args) => techniques::run(&args),
            Command::Graph(args) => graph::run(&args),
            Command::Reference(args) => reference::run(&args),
            Command::Compare(args) => compare::run(&args),
            Command::Bench(args) => bench::run(&args),
            Command::Batch(args) => batch::run(&args),
            Command::Merge(args) => merge::run(&args),
        },
        Err(error) => match error.kind() {
            ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
                print_text(&error.render().to_string())
            }
            ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
                return fail("no command given; see `antumbra --help`", USAGE);
            }
            _ => return fail(&error::usage_line(&error), USAGE),
        },
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => fail(&crate::message::line(&error), error.exit_code()),
    }
}

fn fail(line: &str, code: u8) -> ExitCode {
    // Nobody is left to be told that standard error is closed.
    let _ = writeln!(io::stderr(), "error: {line}");
    ExitCode::from(code)
}

/// Prints to standard output. A reader that has seen enough, as `head` does, is no failure.
fn print_text(text: &str) -> Result<(), CliError> {
    match Output::Stdout.write(text.as_bytes()) {
        Err(OutputError::Write { source, .. }) if source.kind() == io::ErrorKind::BrokenPipe => {
            Ok(())
        }
        other => Ok(other?),
    }
}
