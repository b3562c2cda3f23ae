//! `--shard` and `--shards`, or what a scheduler says instead.

use clap::{Args, value_parser};

use super::error::CliError;
use crate::batch::shard::MAX_SHARDS;
use crate::batch::{Shard, ShardError};

/// Which part of the work this process does.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(super) struct ShardArgs {
    /// Part K of N of the work, K from 1. By default what the scheduler says: SLURM_ARRAY_TASK_ID
    /// with _MIN, _MAX and _STEP, or JOB_COMPLETION_INDEX with --shards; else all of it
    #[arg(long, value_name = "K/N", conflicts_with = "shards")]
    shard: Option<Shard>,

    /// Number of parts, where the scheduler tells only which one this is
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..=i64::from(MAX_SHARDS)))]
    shards: Option<u32>,
}

impl From<ShardError> for CliError {
    fn from(error: ShardError) -> Self {
        Self::Usage(error.to_string())
    }
}

impl ShardArgs {
    /// Asked for on the command line.
    pub(super) fn is_given(self) -> bool {
        self.shard.is_some() || self.shards.is_some()
    }

    /// The shard and who said so; `None` if nobody did.
    pub(super) fn settle(self) -> Result<Option<(Shard, String)>, CliError> {
        if let Some(shard) = self.shard {
            return Ok(Some((shard, "--shard".into())));
        }
        // A value that is no text is no number either.
        let variable = |name: &str| {
            let value = std::env::var_os(name)?;
            Some(value.to_string_lossy().into_owned())
        };
        let told = Shard::of_scheduler(&variable, self.shards)?;
        match (told, self.shards) {
            (None, Some(count)) if count > 1 => Err(CliError::Usage(format!(
                "--shards {count} and no scheduler that says which one; give --shard K/{count}"
            ))),
            (told, _) => Ok(told),
        }
    }
}

/// The line that says which part is done and why.
pub(super) fn line(told: &(Shard, String), count: usize, what: &str) -> String {
    let (shard, source) = told;
    format!("shard      {shard} from {source}: {count} {what}\n")
}
