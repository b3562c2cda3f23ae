//! Frames to files.

#[cfg(feature = "cli")]
pub mod exr;
#[cfg(feature = "cli")]
pub mod output;
#[cfg(feature = "cli")]
pub mod png;
