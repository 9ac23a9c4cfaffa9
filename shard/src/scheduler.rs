//! Which shard a process is: as it is told, or as the scheduler says that started it.

use std::str::FromStr;

use thiserror::Error;

use crate::{NoShard, Shard};

/// Which shard is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShardChoice {
    /// This one.
    Of(Shard),
    /// The one that the scheduler says, of so many; of as many as it says, if none are said.
    Scheduled(Option<u32>),
}

/// A scheduler that does not say which shard this is.
#[derive(Debug, Error, PartialEq, Eq)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum SchedulerError {
    #[error(
        "no scheduler says which shard this is: none of HQ_TASK_ID, JOB_COMPLETION_INDEX and SLURM_ARRAY_TASK_ID is set\nhint: --shard I/N says it"
    )]
    NoScheduler,
    #[error("{0} and {1} are both set, and each means a shard\nhint: --shard I/N says which this is")]
    Several(&'static str, &'static str),
    #[error("{variable} is {value:?}, and shards are numbered\nhint: --shard I/N says which this is")]
    NoNumber { variable: &'static str, value: String },
    #[error("{variable} does not say how many shards there are\nhint: --shard auto/N says it")]
    NoCount { variable: &'static str },
    #[error(
        "this is an array of {count} tasks from {first} to {last}, and not from 0 or 1 without gaps: how many shards there are is not clear\nhint: --shard auto/N says it, and tasks count from 1 then"
    )]
    SomeTasks { first: i64, last: i64, count: i64 },
    #[error("{variable} makes this shard {number} of {of}\nhint: {hint}")]
    Outside { variable: &'static str, number: i64, of: u32, hint: &'static str },
}

/// What a scheduler sets, and how it counts.
struct Scheduler {
    /// The variable that has the task's number.
    id: &'static str,
    /// The first task's number, where nothing else says it.
    first: i64,
    /// The variables that have the numbers of the first and the last task, and how many there are, where it sets them.
    array: Option<[&'static str; 3]>,
    /// What to do where the numbers do not fit.
    hint: &'static str,
}

const SCHEDULERS: [Scheduler; 3] = [
    Scheduler { id: "HQ_TASK_ID", first: 1, array: None, hint: "hq submit --array 1-N" },
    Scheduler {
        id: "JOB_COMPLETION_INDEX",
        first: 0,
        array: None,
        hint: "completions of the Kubernetes job must be the number of shards",
    },
    Scheduler {
        id: "SLURM_ARRAY_TASK_ID",
        first: 1,
        array: Some(["SLURM_ARRAY_TASK_MIN", "SLURM_ARRAY_TASK_MAX", "SLURM_ARRAY_TASK_COUNT"]),
        hint: "sbatch --array=1-N",
    },
];

impl ShardChoice {
    /// The shard, by the environment of this process.
    ///
    /// # Errors
    /// [`SchedulerError`].
    pub fn of_this_process(self) -> Result<Shard, SchedulerError> {
        self.resolve(|name| std::env::var(name).ok())
    }

    /// The shard, where `variable` gives what the environment holds.
    ///
    /// # Errors
    /// [`SchedulerError`].
    fn resolve(self, variable: impl Fn(&'static str) -> Option<String>) -> Result<Shard, SchedulerError> {
        let of = match self {
            Self::Of(shard) => return Ok(shard),
            Self::Scheduled(of) => of,
        };
        let mut set = SCHEDULERS.iter().filter_map(|scheduler| Some((scheduler, variable(scheduler.id)?)));
        let (scheduler, value) = set.next().ok_or(SchedulerError::NoScheduler)?;
        if let Some((other, _)) = set.next() {
            return Err(SchedulerError::Several(scheduler.id, other.id));
        }
        let number = |variable, value: String| match value.trim().parse::<i64>() {
            Ok(number) => Ok(number),
            Err(_) => Err(SchedulerError::NoNumber { variable, value }),
        };
        let id = number(scheduler.id, value)?;
        let (first, of) = match (of, scheduler.array) {
            (Some(of), _) => (scheduler.first, of),
            (None, None) => return Err(SchedulerError::NoCount { variable: scheduler.id }),
            (None, Some(names)) => {
                let of_array = |name| number(name, variable(name).ok_or(SchedulerError::NoCount { variable: name })?);
                let [first, last, count] = [of_array(names[0])?, of_array(names[1])?, of_array(names[2])?];
                // Some tasks of an array, submitted again: their count is not that of the shards.
                let is_whole = matches!(first, 0 | 1) && last.checked_sub(first) == count.checked_sub(1);
                let of = u32::try_from(count).ok().filter(|_| is_whole);
                (first, of.ok_or(SchedulerError::SomeTasks { first, last, count })?)
            }
        };
        let (variable, hint) = (scheduler.id, scheduler.hint);
        let number = id.saturating_sub(first).saturating_add(1);
        let shard = u32::try_from(number).ok().and_then(|number| Shard::new(number, of).ok());
        shard.ok_or(SchedulerError::Outside { variable, number, of, hint })
    }
}

impl FromStr for ShardChoice {
    type Err = NoShard;

    fn from_str(text: &str) -> Result<Self, NoShard> {
        let no_shard = || NoShard(text.to_owned());
        match text.strip_prefix("auto") {
            None => Ok(Self::Of(text.parse()?)),
            Some("") => Ok(Self::Scheduled(None)),
            Some(of) => {
                let of = of.strip_prefix('/').and_then(|of| of.parse().ok()).filter(|of| *of > 0);
                Ok(Self::Scheduled(Some(of.ok_or_else(no_shard)?)))
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn resolve(choice: &str, environment: &[(&'static str, &str)]) -> Result<String, SchedulerError> {
        let variable = |name| environment.iter().find(|(set, _)| *set == name).map(|(_, value)| (*value).to_owned());
        choice.parse::<ShardChoice>().unwrap().resolve(variable).map(|shard| shard.to_string())
    }

    #[test]
    fn each_scheduler_counts_in_its_own_way() {
        let slurm = |id, min, max, count| {
            let array =
                [("SLURM_ARRAY_TASK_MIN", min), ("SLURM_ARRAY_TASK_MAX", max), ("SLURM_ARRAY_TASK_COUNT", count)];
            [("SLURM_ARRAY_TASK_ID", id), array[0], array[1], array[2]]
        };
        let all = [
            resolve("3/8", &[("HQ_TASK_ID", "5")]),
            resolve("auto/8", &[("HQ_TASK_ID", "3")]),
            resolve("auto/8", &[("JOB_COMPLETION_INDEX", "2")]),
            resolve("auto", &slurm("2", "0", "7", "8")),
            resolve("auto", &slurm("3", "1", "8", "8")),
            // Task 3 alone, submitted again.
            resolve("auto/8", &slurm("3", "3", "3", "1")),
        ];
        assert!(all.iter().all(|shard| shard.as_deref() == Ok("3/8")), "{all:?}");
        for some in [slurm("3", "3", "3", "1"), slurm("3", "1", "5", "3")] {
            assert!(matches!(resolve("auto", &some), Err(SchedulerError::SomeTasks { .. })), "{some:?}");
        }
    }

    #[test]
    fn numbers_that_are_no_shard_are_told_with_what_to_do() {
        let told = |choice, environment: &[_]| resolve(choice, environment).unwrap_err().to_string();
        assert_eq!(resolve("auto", &[]), Err(SchedulerError::NoScheduler));
        insta::assert_snapshot!(told("auto", &[("HQ_TASK_ID", "1")]), @"
        HQ_TASK_ID does not say how many shards there are
        hint: --shard auto/N says it
        ");
        insta::assert_snapshot!(told("auto/8", &[("HQ_TASK_ID", "0")]), @"
        HQ_TASK_ID makes this shard 0 of 8
        hint: hq submit --array 1-N
        ");
        insta::assert_snapshot!(told("auto/8", &[("JOB_COMPLETION_INDEX", "8")]), @"
        JOB_COMPLETION_INDEX makes this shard 9 of 8
        hint: completions of the Kubernetes job must be the number of shards
        ");
        insta::assert_snapshot!(told("auto/8", &[("HQ_TASK_ID", "one")]), @r#"
        HQ_TASK_ID is "one", and shards are numbered
        hint: --shard I/N says which this is
        "#);
        let both = [("HQ_TASK_ID", "1"), ("SLURM_ARRAY_TASK_ID", "1")];
        assert!(matches!(resolve("auto/8", &both), Err(SchedulerError::Several(..))));
        assert!(
            ["auto/", "auto/0", "auto/x", "automatic", "8"].iter().all(|text| text.parse::<ShardChoice>().is_err())
        );
    }
}
