//! What ends a command, its exit code and its one line.

use std::error::Error;

use ash::vk;

use crate::capture::CaptureError;
use crate::capture::output::OutputError;
use crate::gpu::{GpuError, ValidationMessage};
use crate::message::one_line;
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
    /// The device has not enough memory for pictures of that size.
    #[error("{0}; a smaller --size needs less")]
    Memory(Box<CaptureError>),
    /// One frame of several; those before it are done.
    #[error("frame {number}: {source}")]
    Frame { number: u32, source: Box<CliError> },
    #[error(transparent)]
    Output(#[from] OutputError),
    /// What another area has to say.
    #[error(transparent)]
    Other(Box<dyn Error + Send + Sync>),
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
    /// The technique's samples do not go as far as the bound asked for.
    #[error(
        "light `{light}`: a pixel's error is proven to be at most {reached}, not {asked} as asked for with bound; \
         --visibility-bound without --bound shows where"
    )]
    Bound {
        light: String,
        asked: f32,
        reached: f32,
    },
}

impl From<CaptureError> for CliError {
    fn from(error: CaptureError) -> Self {
        let memory = match &error {
            CaptureError::Gpu(GpuError::Allocation { .. }) => true,
            CaptureError::Gpu(GpuError::Call { result, .. }) => matches!(
                *result,
                vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY
            ),
            _ => false,
        };
        match memory {
            true => Self::Memory(Box::new(error)),
            false => Self::Capture(Box::new(error)),
        }
    }
}

impl CliError {
    pub(super) fn exit_code(&self) -> u8 {
        match self {
            Self::Request(_) | Self::Usage(_) | Self::Gpu(GpuError::NoDevice { .. }) => USAGE,
            Self::Capture(error) => match **error {
                CaptureError::NoSuchImage { .. }
                | CaptureError::NoSuchPart { .. }
                | CaptureError::DumpFormat { .. } => USAGE,
                _ => FAILED,
            },
            Self::Frame { source, .. } => source.exit_code(),
            _ => FAILED,
        }
    }

    /// Says which frame failed.
    pub(super) fn in_frame(self, number: u32) -> Self {
        Self::Frame {
            number,
            source: Box::new(self),
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::line;

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

    #[test]
    fn devices_that_do_not_do_fail_in_one_line() {
        let lacks = |what: &str| vec![what.to_string()];
        let (device, devices) = ("Old\nThing".into(), lacks("0: A lacks Vulkan 1.3"));
        let what = lacks("synchronization2 (barriers)");
        for (error, code, part) in [
            (GpuError::NoDriver, FAILED, "install"),
            (GpuError::NoneFits { devices }, FAILED, "A lacks Vulkan 1.3"),
            (
                GpuError::Missing { device, what },
                FAILED,
                "\"Old Thing\" lacks synchronization2",
            ),
        ] {
            let error = CliError::from(error);
            let line = line(&error);
            assert!(line.contains(part) && !line.contains('\n'), "{line}");
            assert_eq!(error.exit_code(), code, "{line}");
        }
    }

    #[test]
    fn memory_that_runs_out_names_the_remedy_and_the_frame() {
        let call = GpuError::Call {
            call: "vkAllocateMemory",
            object: "picture".into(),
            result: vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
        };
        let error = CliError::from(CaptureError::Gpu(call)).in_frame(7);
        let wanted = "frame 7: vkAllocateMemory failed for picture: ERROR_OUT_OF_DEVICE_MEMORY; a \
                      smaller --size needs less";
        assert_eq!(line(&error), wanted);
        assert_eq!(error.exit_code(), FAILED);
        let usage = CliError::Usage("wrong".into()).in_frame(1);
        assert_eq!(usage.exit_code(), USAGE);
    }
}
