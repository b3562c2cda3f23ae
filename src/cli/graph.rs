//! `antumbra graph`: the plan of a frame, made without a device.

use clap::{Args, ValueEnum};

use super::args::ViewArgs;
use super::error::CliError;
use super::print_text;
use crate::capture::plan_frame;

const EXAMPLES: &str = "\
Examples:
  antumbra graph scene.glb
  antumbra graph scene.glb --technique hard --format dot | dot -Tsvg -o frame.svg
  antumbra graph scene.glb --light lamp --size 1280x720 --format json

The names of images are those that `antumbra capture --dump NAME=FILE` takes. No device is used; a driver may ask for somewhat more memory than this says.";

/// Print a frame's passes, barriers and memory, and what was skipped and why
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct GraphArgs {
    /// Text to read, a Graphviz digraph, or all of the plan as JSON
    #[arg(long, value_enum, default_value = "text")]
    format: GraphFormat,

    #[command(flatten)]
    view: ViewArgs,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum GraphFormat {
    Text,
    Dot,
    Json,
}

pub(super) fn run(args: &GraphArgs) -> Result<(), CliError> {
    let view = args.view.load()?;
    let plan = plan_frame(&view.scene, &view.request)?;
    let text = match args.format {
        GraphFormat::Text => plan.to_string(),
        GraphFormat::Dot => plan.to_dot(),
        GraphFormat::Json => format!("{:#}\n", plan.to_json()),
    };
    print_text(&text)
}
