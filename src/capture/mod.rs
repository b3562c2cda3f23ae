//! Frames to files.

mod dump;
mod frame;
mod kept;
mod kept_edges;
mod render;

#[cfg(feature = "cli")]
pub mod dump_file;
#[cfg(feature = "cli")]
pub mod exr;
#[cfg(feature = "cli")]
pub mod output;
#[cfg(feature = "cli")]
pub mod png;

pub use dump::{CapturedImage, FRIENDLY_NAMES, ImageContent, Samples};
pub use frame::{CaptureError, CapturedFrame, CapturedLight, FrameRequest, exposure, plan_frame};
pub use render::FrameRenderer;
