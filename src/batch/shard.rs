//! Which part of a list of work is this process's: `K/N`, given or told by a scheduler.

use std::fmt;
use std::str::FromStr;

/// Most parts that a list is cut into.
pub const MAX_SHARDS: u32 = 1_000_000;

/// Part `index` of `count`, both from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: u32,
    count: u32,
}

/// Why there is no shard.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ShardError {
    /// Not of the form `K/N`, or out of range.
    #[error("give K/N with K from 1 to N, such as 3/32, and N at most {MAX_SHARDS}")]
    Form,
    /// A scheduler's variable is no number.
    #[error("{variable} is `{value}`, no number of a task; give --shard K/N")]
    Variable {
        /// Its name.
        variable: &'static str,
        /// What it holds.
        value: String,
    },
    /// A scheduler's variable is missing or does not go with the others.
    #[error("{0}; give --shard K/N")]
    Array(String),
    /// Kubernetes tells a pod its index, but not of how many.
    #[error(
        "JOB_COMPLETION_INDEX is {index}, but not of how many; give --shards N as in the Job's completions"
    )]
    Completions {
        /// The pod's index, from 0.
        index: u32,
    },
}

impl Shard {
    /// All of the list.
    pub const WHOLE: Self = Self { index: 1, count: 1 };

    /// Part `index` of `count`; `None` unless `index` is from 1 to `count`, and `count` at most
    /// [`MAX_SHARDS`].
    pub fn new(index: u32, count: u32) -> Option<Self> {
        let is_right = (1..=count).contains(&index) && count <= MAX_SHARDS;
        is_right.then_some(Self { index, count })
    }

    /// From 1.
    pub fn index(self) -> u32 {
        self.index
    }

    /// Number of parts.
    pub fn count(self) -> u32 {
        self.count
    }

    /// For names of files that sort by number.
    pub fn file_stem(self) -> String {
        format!("{:04}-of-{:04}", self.index, self.count)
    }

    /// What the scheduler around this process says, by its environment `variable`s, and where it
    /// says so: an array of Slurm, an indexed Job of Kubernetes (of `count` parts), or neither.
    ///
    /// # Errors
    /// The variables are no numbers, some are missing, or the array has holes.
    pub fn of_scheduler(
        variable: &dyn Fn(&str) -> Option<String>,
        count: Option<u32>,
    ) -> Result<Option<(Self, String)>, ShardError> {
        if let Some(task) = number(variable, "SLURM_ARRAY_TASK_ID")? {
            return of_slurm(variable, task, count).map(Some);
        }
        let Some(index) = number(variable, "JOB_COMPLETION_INDEX")? else {
            return Ok(None);
        };
        let Some(count) = count else {
            return Err(ShardError::Completions { index });
        };
        let shard = index
            .checked_add(1)
            .and_then(|index| Self::new(index, count));
        let shard = shard.ok_or_else(|| {
            ShardError::Array(format!(
                "JOB_COMPLETION_INDEX is {index}, too high for {count} shards"
            ))
        })?;
        Ok(Some((shard, format!("JOB_COMPLETION_INDEX={index}"))))
    }
}

fn of_slurm(
    variable: &dyn Fn(&str) -> Option<String>,
    task: u32,
    count: Option<u32>,
) -> Result<(Shard, String), ShardError> {
    let required = |name: &'static str| {
        number(variable, name)?.ok_or_else(|| {
            ShardError::Array(format!(
                "SLURM_ARRAY_TASK_ID is {task} and {name} is missing"
            ))
        })
    };
    let (least, most) = (
        required("SLURM_ARRAY_TASK_MIN")?,
        required("SLURM_ARRAY_TASK_MAX")?,
    );
    let step = number(variable, "SLURM_ARRAY_TASK_STEP")?
        .unwrap_or(1)
        .max(1);
    let said = format!("SLURM_ARRAY_TASK_ID={task} of {least}-{most}:{step}");
    let wrong = |what: String| ShardError::Array(format!("{said}: {what}"));
    if !(least..=most).contains(&task) || !(task - least).is_multiple_of(step) {
        return Err(wrong("the task is none of the array's".into()));
    }
    let tasks = (most - least) / step + 1;
    // Arrays such as 1,3,7 or 1-4,9: how many shards the work was cut into cannot be told from them.
    if let Some(real) = number(variable, "SLURM_ARRAY_TASK_COUNT")?
        && real != tasks
    {
        return Err(wrong(format!(
            "the array has {real} tasks, not all {tasks} of that range"
        )));
    }
    if let Some(count) = count
        && count != tasks
    {
        return Err(wrong(format!(
            "the array has {tasks} tasks, and --shards says {count}"
        )));
    }
    let shard = Shard::new((task - least) / step + 1, tasks);
    let shard = shard.ok_or_else(|| wrong(format!("more than {MAX_SHARDS} tasks")))?;
    Ok((shard, said))
}

fn number(
    variable: &dyn Fn(&str) -> Option<String>,
    name: &'static str,
) -> Result<Option<u32>, ShardError> {
    let Some(value) = variable(name) else {
        return Ok(None);
    };
    let digits = !value.is_empty() && value.bytes().all(|byte| byte.is_ascii_digit());
    match value.parse() {
        Ok(number) if digits => Ok(Some(number)),
        _ => Err(ShardError::Variable {
            variable: name,
            value,
        }),
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let number = |text: &str| {
            let digits = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
            text.parse().ok().filter(|_| digits)
        };
        let (index, count) = text.split_once('/').ok_or(ShardError::Form)?;
        let (Some(index), Some(count)) = (number(index), number(count)) else {
            return Err(ShardError::Form);
        };
        Self::new(index, count).ok_or(ShardError::Form)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(
        variables: &[(&str, &str)],
        count: Option<u32>,
    ) -> Result<Option<(String, String)>, String> {
        let variable = |name: &str| {
            let found = variables.iter().find(|(other, _)| *other == name);
            found.map(|(_, value)| value.to_string())
        };
        let told = Shard::of_scheduler(&variable, count).map_err(|error| error.to_string())?;
        Ok(told.map(|(shard, source)| (shard.to_string(), source)))
    }

    #[test]
    fn shards_are_k_of_n() {
        let shard = |text: &str| text.parse::<Shard>().map(|s| (s.index(), s.count()));
        assert_eq!(shard("1/1"), Ok((1, 1)));
        assert_eq!(shard("32/32"), Ok((32, 32)));
        for bad in [
            "",
            "/",
            "1",
            "0/4",
            "5/4",
            "1/0",
            "+1/4",
            "1/ 4",
            "a/b",
            "1/1000001",
            "1/2/3",
        ] {
            assert_eq!(shard(bad), Err(ShardError::Form), "{bad}");
        }
    }

    #[test]
    fn slurm_tells_by_least_most_and_step() {
        let array = |id, min, max, step| {
            let names = ["ID", "MIN", "MAX", "STEP"].map(|end| format!("SLURM_ARRAY_TASK_{end}"));
            let values = [id, min, max, step];
            let pairs: Vec<(&str, &str)> = names.iter().map(String::as_str).zip(values).collect();
            told(&pairs, None)
        };
        let shard = |id, min, max, step| match array(id, min, max, step) {
            Ok(Some((shard, source))) => {
                assert!(source.contains(id) && source.contains(max), "{source}");
                shard
            }
            other => format!("{other:?}"),
        };
        assert_eq!(shard("1", "1", "32", "1"), "1/32");
        assert_eq!(shard("0", "0", "31", "1"), "1/32");
        assert_eq!(shard("31", "0", "31", "1"), "32/32");
        assert_eq!(shard("10", "4", "16", "3"), "3/5");
        // The array 0-10:4 is 0, 4, 8.
        assert_eq!(shard("8", "0", "10", "4"), "3/3");
        assert!(array("5", "4", "16", "3").is_err());
        assert!(array("40", "4", "16", "3").is_err());
        assert!(array("x", "1", "2", "1").is_err_and(|e| e.contains("SLURM_ARRAY_TASK_ID is `x`")));
        let alone = told(&[("SLURM_ARRAY_TASK_ID", "1")], None);
        assert!(alone.is_err_and(|error| error.contains("SLURM_ARRAY_TASK_MIN is missing")));
    }

    #[test]
    fn arrays_with_holes_are_refused() {
        let holes = [
            ("SLURM_ARRAY_TASK_ID", "3"),
            ("SLURM_ARRAY_TASK_MIN", "1"),
            ("SLURM_ARRAY_TASK_MAX", "7"),
            ("SLURM_ARRAY_TASK_STEP", "1"),
            ("SLURM_ARRAY_TASK_COUNT", "3"),
        ];
        let refused = told(&holes, None);
        assert!(
            refused.is_err_and(|e| e.contains("3 tasks, not all 7") && e.contains("--shard K/N"))
        );
        let other = told(&holes[..4], Some(8));
        assert!(other.is_err_and(|error| error.contains("--shards says 8")));
    }

    #[test]
    fn kubernetes_tells_the_index_alone() {
        let pod = [("JOB_COMPLETION_INDEX", "7")];
        let found = told(&pod, Some(8)).ok().flatten();
        let wanted = ("8/8".to_string(), "JOB_COMPLETION_INDEX=7".to_string());
        assert_eq!(found, Some(wanted));
        assert!(told(&pod, Some(7)).is_err_and(|error| error.contains("too high for 7")));
        assert!(told(&pod, None).is_err_and(|error| error.contains("--shards N")));
        assert_eq!(told(&[], None), Ok(None));
    }
}
