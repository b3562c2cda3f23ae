//! `antumbra techniques`: what there is to choose from.

use std::fmt::Write as _;

use clap::Args;
use serde_json::{Value, json};

use super::error::CliError;
use super::print_text;
use crate::shadow::Technique;

const EXAMPLES: &str = "\
Examples:
  antumbra techniques
  antumbra techniques --json | jq -r '.techniques[].name'";

/// List every technique with its light shapes, options, defaults and paper
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct TechniquesArgs {
    /// As JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &TechniquesArgs) -> Result<(), CliError> {
    print_text(&if args.json {
        format!("{:#}\n", to_json())
    } else {
        to_text()
    })
}

fn shapes(technique: Technique) -> Vec<&'static str> {
    (technique.shapes().iter())
        .map(|kind| kind.name())
        .collect()
}

fn to_text() -> String {
    let mut text = String::new();
    for (at, &technique) in Technique::ALL.iter().enumerate() {
        let mut line = |line: String| {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{line}");
        };
        if at > 0 {
            line(String::new());
        }
        line(format!("{}: {}", technique.name(), technique.summary()));
        line(format!("  lights   {}", shapes(technique).join(", ")));
        for option in technique.options() {
            line(format!(
                "  option   {}={} ({}): {}",
                option.name, option.default, option.values, option.what
            ));
        }
        if let Some(paper) = technique.paper() {
            line(format!("  paper    {paper}"));
        }
    }
    text
}

fn to_json() -> Value {
    let techniques = Technique::ALL.iter().map(|&technique| {
        let options = technique.options().iter().map(|option| {
            json!({
                "name": option.name,
                "default": option.default,
                "values": option.values,
                "what": option.what,
            })
        });
        json!({
            "name": technique.name(),
            "summary": technique.summary(),
            "shapes": shapes(technique),
            "options": options.collect::<Vec<_>>(),
            "paper": technique.paper(),
        })
    });
    json!({ "schema": 1, "techniques": techniques.collect::<Vec<_>>() })
}
