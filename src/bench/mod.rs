//! Run time against error: techniques and ray tracing rivals, measured over scenes and lights.
//!
//! One [`Job`] is one scene under one light, with all contenders. [`group::run`] casts the truth
//! and measures the cells in turn; [`session::Session`] goes through all jobs, keeps what is done
//! and survives jobs that die; [`report`] turns the [`Results`] into a page. A [`study`] is a file of
//! tables, each with benchmarks of its own.
//!
//! # `results.json`, schema 1
//!
//! | field | what |
//! |---|---|
//! | `schema` | 1; raised whenever a field changes its meaning or goes |
//! | `program` | name and version |
//! | `machine` | `cpu`, `threads`, `os` |
//! | `driver` | Vulkan device and driver; `null` if no technique ran |
//! | `settings` | `techniques` (labels in order), `width`, `height`, `repeat`, `samples`, `cell_seconds`, `device`, `light_scale` (factor on the lights' sizes) |
//! | `references` | one entry a scene and light: `scene`, `light`, `light_index`, `light_shape`, `width`, `height`, `samples`, `standard_error` (`rms`, `max` over partly lit pixels), `valid_pixels`, `penumbra_pixels`, `rays`, `cast_ms` (`null` if kept from an earlier run), `image`, `valid_image` (files beside `results.json`, 8-bit grey) |
//! | `images` | one entry a cell: [`Entry`], the fields of `capture`'s report and more |
//! | `failures` | the cells without a result once more: `scene`, `light`, `light_index`, `label`, `kind` (`unsupported`, `failed` or `crashed`), `reason` |
//!
//! There is no date in it. Times are milliseconds, memory bytes, visibility and its errors 0 to 1.
//! Every time is a [`Spread`] over the measured rounds. `visibility_ms` of a technique adds up the
//! device's timestamps of the passes that make one light's visibility, without G-buffer and
//! shading; `frame_ms` is the host's wall clock of the whole frame with this light alone. A rival's
//! `visibility_ms` is the wall clock of its casting on all cores (of `rays` primary rays included), with
//! its hierarchy built beforehand; it has neither `frame_ms` nor `passes`.

pub mod contender;
pub mod gather;
pub mod group;
pub mod pictures;
pub mod report;
pub mod results;
pub mod rival;
pub mod session;
pub mod study;
pub mod table;

mod cell;

pub use contender::{Contender, ContenderError, parse_list};
pub use group::{GroupError, GroupResult, Job};
pub use results::{Entry, Failure, FailureKind, Results, ResultsError, Spread};
pub use session::{Outcome, Session};
pub use study::{Study, StudyError};
