//! What ends a command, its exit code and its one line.

use std::error::Error;

use crate::capture::CaptureError;
use crate::capture::output::OutputError;
use crate::gpu::{GpuError, ValidationMessage};
use crate::scene::SceneError;

/// Exit code for a wrong command line.
pub(super) const USAGE: u8 = 2;
const FAILED: u8 = 1;

/// A command that failed.
#[derive(Debug, thiserror::Error)]
pub(super) enum CliError {
    /// The scene file is missing or bad.
    #[error(transparent)]
    Scene(SceneError),
    /// The command line asks for what the scene does not have.
    #[error(transparent)]
    Request(SceneError),
    /// The command line contradicts itself, the scene or the technique.
    #[error("{0}")]
    Usage(String),
    #[error(transparent)]
    Gpu(#[from] GpuError),
    #[error(transparent)]
    Capture(Box<CaptureError>),
    #[error(transparent)]
    Output(#[from] OutputError),
    #[error("cannot write the report: {0}")]
    Report(#[from] serde_json::Error),
    #[error("the validation layer has {count} message(s); the first: {first}")]
    Validation {
        count: usize,
        first: ValidationMessage,
    },
    #[error(
        "every pixel of the picture is {value:?}; check camera and lights, or pass --allow-uniform"
    )]
    Uniform { value: [f32; 3] },
}

impl From<CaptureError> for CliError {
    fn from(error: CaptureError) -> Self {
        Self::Capture(Box::new(error))
    }
}

impl CliError {
    pub(super) fn exit_code(&self) -> u8 {
        match self {
            Self::Request(_) | Self::Usage(_) | Self::Gpu(GpuError::NoDevice { .. }) => USAGE,
            _ => FAILED,
        }
    }
}

/// The error and its sources on one line. Messages that quote their source already are not given
/// it twice.
pub(super) fn line(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(error) = source {
        let cause = error.to_string();
        if !text.contains(&cause) {
            text.push_str(": ");
            text.push_str(&cause);
        }
        source = error.source();
    }
    one_line(&text)
}

/// What clap has to say, on one line: without the usage and the pointer to the help.
pub(super) fn usage_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let mut line = String::new();
    let text = text.strip_prefix("error: ").unwrap_or(&text);
    for part in text.lines().map(str::trim).filter(|part| !part.is_empty()) {
        if part.starts_with("Usage:") || part.starts_with("For more information") {
            break;
        }
        // Offered for every unknown flag, and never what was meant.
        if part.starts_with("tip: to pass") {
            continue;
        }
        if !line.is_empty() {
            let joined = line.ends_with([':', ',']) || part.starts_with('[');
            line.push_str(if joined { " " } else { "; " });
        }
        line.push_str(part);
    }
    one_line(&line)
}

/// Line breaks become spaces and other control characters `?`, whatever files are called.
fn one_line(text: &str) -> String {
    let parts: Vec<&str> = text.split(['\n', '\r']).map(str::trim).collect();
    let joined = parts
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(" ");
    joined.replace(char::is_control, "?")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("{text}")]
    struct Step {
        text: &'static str,
        source: Option<Box<Step>>,
    }

    #[test]
    fn sources_follow_once_each_on_one_line() {
        let step = |text, source| Step {
            text,
            source: Some(Box::new(source)),
        };
        let end = Step {
            text: "disk\tfull\n",
            source: None,
        };
        let error = step("a: b", step("b", step("c\r\n  d", end)));
        assert_eq!(line(&error), "a: b: c d: disk?full");
    }
}
