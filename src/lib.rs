//! Area-light soft shadows for Vulkan.

#![warn(missing_docs)]

pub use ash;

pub mod capture;
pub mod gpu;
pub mod graph;
pub mod light;
pub mod scene;
