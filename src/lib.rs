//! Area-light soft shadows for Vulkan.
//!
//! A frame is a [`graph`] of passes: [`geometry`] declares those that find the surface at each pixel,
//! [`shadow`] those of the shadow technique, [`renderer`] whole frames, and the graph plans and records them on a [`gpu::Gpu`], whether
//! that owns its device or was given a host's. [`scene`] and [`light`] hold what is to be seen;
//! [`capture`] brings frames back to memory and to files.
//!
//! # Embedding
//!
//! A host that has a device of its own creates it with what [`gpu::requirements`] lists, lends it
//! through [`gpu::HostDevice`], and records frames into its own command buffers:
//!
//! ```no_run
//! use antumbra::ash::vk;
//! use antumbra::gpu::{Gpu, GpuError, HostDevice};
//! use antumbra::graph::{FrameCache, Graph};
//!
//! # fn frame(host: HostDevice, cmd: vk::CommandBuffer) -> Result<(), Box<dyn std::error::Error>> {
//! let mut gpu = Gpu::from_host(host)?;
//! let mut cache = FrameCache::new();
//!
//! gpu.begin_frame()?;
//! let mut graph = Graph::continuing(cache.history());
//! // Import the host's images, declare passes ...
//! graph.compile(&gpu)?.record(&mut gpu, &mut cache, cmd)?;
//! // The host submits and waits; nothing is submitted or waited for on its behalf.
//!
//! cache.destroy(&mut gpu);
//! gpu.destroy()?;
//! # Ok(())
//! # }
//! ```
//!
//! | antumbra | ash | gpu-allocator |
//! |---|---|---|
//! | 0.1 | 0.38 | 0.28 |

#![warn(missing_docs)]

// The README's example is compiled as a test.
#[cfg(all(doctest, feature = "cli"))]
#[doc = include_str!("../README.md")]
struct Readme;

pub use ash;

#[cfg(feature = "cli")]
pub mod batch;
#[cfg(feature = "cli")]
pub mod bench;
pub mod capture;
#[cfg(feature = "cli")]
pub mod cli;
pub mod geometry;
pub mod gpu;
pub mod graph;
pub mod light;
#[cfg(feature = "cli")]
pub mod measure;
#[cfg(feature = "cli")]
mod message;
#[cfg(feature = "cli")]
pub mod reference;
pub mod renderer;
#[cfg(feature = "cli")]
pub mod rival;
pub mod scene;
pub mod shadow;
#[cfg(feature = "cli")]
pub mod stress;
