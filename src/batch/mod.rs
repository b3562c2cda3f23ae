//! Many frames as data: what is to be rendered, which part of it is this process's, and what was
//! made of it.
//!
//! A [`JobFile`] describes jobs, a [`List`] has their items in an order that depends on nothing
//! else. [`run_of`] cuts the list for shards; a [`Record`] beside an item's files says what they
//! are and what they were made from, and [`gather`] checks and collects the records.

pub mod balance;
pub mod gather;
pub mod jobs;
pub mod list;
pub mod page;
pub mod record;
pub mod scene_file;
pub mod shard;

mod cost;

pub use balance::{Cost, run_of};
pub use cost::{bench_cost, equal_frames};
pub use jobs::{JobFile, JobsError};
pub use list::{Item, List, Sequence};
pub use record::{FileEntry, Record};
pub use scene_file::SceneFacts;
pub use shard::{Shard, ShardError};
