//! Frames to files.

mod frame;

#[cfg(feature = "cli")]
pub mod exr;
#[cfg(feature = "cli")]
pub mod output;
#[cfg(feature = "cli")]
pub mod png;

pub use frame::{
    CaptureError, CapturedFrame, CapturedLight, FrameRenderer, FrameRequest, exposure, plan_frame,
};
