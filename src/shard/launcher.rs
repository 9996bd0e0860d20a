//! Reads the number that a launcher (a scheduler, or a program such as `mpirun` that starts processes) assigned to
//! this process. Each launcher in this file sets environment variables with names of its own. The lowest number that a
//! launcher assigns differs, too: it is 0, 1 or, in a Slurm array, any number.

use super::Shard;
use crate::error::{Error, Result};

/// A function that reads an environment variable.
type Variable<'a> = &'a dyn Fn(&str) -> Option<String>;

/// The numbers that a launcher assigned to this process.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Assignment {
    /// The name of the launcher, and the environment variable with the process's number, for messages.
    launcher: &'static str,
    /// The process's number, from 0. If `number` is not `None`, raycl uses `number` instead of `rank`.
    rank: u32,
    /// The number of processes that the launcher started; `None` if the launcher does not set this number.
    count: Option<u32>,
    /// The number of the process's element in a Slurm array, if the user gives the number of shards. The number of the
    /// element is then the number of the shard. `None` if the process belongs to no Slurm array, or if the user does
    /// not give the number of shards.
    number: Option<u32>,
}

/// A launcher. One environment variable numbers the launcher's processes from 0 or 1 (`origin`). Some
/// launchers set a second variable, the number of processes.
struct Ranks {
    launcher: &'static str,
    rank: &'static str,
    count: Option<&'static str>,
    origin: u32,
    /// If the variable `only_with` is not set, raycl ignores the launcher's other variables.
    only_with: Option<&'static str>,
}

/// Launchers that number the processes of one job. Each launcher in this list comes before the launchers that may have
/// started it, so the innermost launcher is found first. MPI, for example, may run in a step of Slurm. Slurm sets
/// `SLURM_PROCID` in the tasks of a step, and also in a batch script. In a batch script, the value of `SLURM_PROCID` is
/// not the number of a task. raycl therefore reads `SLURM_PROCID` only if `SLURM_STEP_ID` is set, which Slurm sets only
/// in steps.
const INNER: [Ranks; 3] = [
    Ranks {
        launcher: "Open MPI (OMPI_COMM_WORLD_RANK)",
        rank: "OMPI_COMM_WORLD_RANK",
        count: Some("OMPI_COMM_WORLD_SIZE"),
        origin: 0,
        only_with: None,
    },
    Ranks {
        launcher: "MPI (PMI_RANK)",
        rank: "PMI_RANK",
        count: Some("PMI_SIZE"),
        origin: 0,
        only_with: None,
    },
    Ranks {
        launcher: "a step of Slurm (SLURM_PROCID)",
        rank: "SLURM_PROCID",
        count: Some("SLURM_STEP_NUM_TASKS"),
        origin: 0,
        only_with: Some("SLURM_STEP_ID"),
    },
];

/// Launchers that give one number to a whole GitLab job, Kubernetes pod or HyperQueue task, and not to each process
/// in it. Slurm's arrays, which [`array()`] reads, are not in this table. The user chooses the numbers of a
/// HyperQueue array; raycl needs numbers that begin at 1.
const OUTER: [Ranks; 3] = [
    Ranks {
        launcher: "GitLab (CI_NODE_INDEX)",
        rank: "CI_NODE_INDEX",
        count: Some("CI_NODE_TOTAL"),
        origin: 1,
        only_with: None,
    },
    Ranks {
        launcher: "Kubernetes (JOB_COMPLETION_INDEX)",
        rank: "JOB_COMPLETION_INDEX",
        count: None,
        origin: 0,
        only_with: None,
    },
    Ranks {
        launcher: "HyperQueue (HQ_TASK_ID)",
        rank: "HQ_TASK_ID",
        count: None,
        origin: 1,
        only_with: None,
    },
];

/// Returns the shard that a launcher assigned to this process. If several launchers set numbers, the numbers of one
/// launcher decide which shard is returned. The order of precedence is: the innermost launcher that started several
/// processes, a Slurm array, a launcher in `OUTER`, a launcher that started a single process. The number of shards is
/// `of` or, if `of` is `None`, the launcher's count. Returns an error if no launcher sets a number, if a variable has
/// a value that is not allowed, or if the number of shards is unknown. Also returns an error if the number of shards
/// contradicts the launcher's numbers, or if both a Slurm array of several elements and an inner launcher of several
/// processes set numbers. A batch script of several tasks that starts raycl without `srun` is also an error, unless an
/// inner launcher started several processes.
pub fn shard(of: Option<u32>, variable: Variable<'_>) -> Result<Shard> {
    let inner = INNER
        .iter()
        .filter_map(|ranks| ranks.assignment(variable).transpose())
        .collect::<Result<Vec<_>>>()?;
    let array = array(of.is_some(), variable)?;
    // A launcher that started a single process decides the process's shard only if no launcher of several processes,
    // no array and no launcher in `OUTER` sets a number. For example, the process may be the only task of a Slurm
    // step, and the step may belong to an element of a Slurm array. The element's number then decides the shard.
    let numbered = inner.into_iter().find(|assignment| assignment.count != Some(1));
    if let (Some(inner), Some(array)) = (&numbered, array.as_ref().filter(|array| array.count != Some(1))) {
        return Err(twice(array, inner));
    }
    if let (None, Some(error)) = (&numbered, outside_of_a_step(variable)) {
        return Err(error);
    }
    let outer = || OUTER.iter().find_map(|ranks| ranks.assignment(variable).transpose()).transpose();
    let alone = || INNER.iter().find_map(|ranks| ranks.assignment(variable).transpose()).transpose();
    match numbered
        .or(array)
        .map_or_else(outer, |assignment| Ok(Some(assignment)))?
        .map_or_else(alone, |assignment| Ok(Some(assignment)))?
    {
        Some(assignment) => assignment.shard(of),
        None => Err(nobody()),
    }
}

impl Ranks {
    fn assignment(&self, variable: Variable<'_>) -> Result<Option<Assignment>> {
        if self.only_with.is_some_and(|name| variable(name).is_none()) {
            return Ok(None);
        }
        let Some(rank) = number(self.rank, variable)? else { return Ok(None) };
        let count = self.count.map_or(Ok(None), |name| number(name, variable))?;
        let rank = rank.checked_sub(self.origin).ok_or_else(|| {
            Error::input(format!("{} is {rank}, but its values must start at {}", self.rank, self.origin))
                .with_help("number the tasks from 1, or give the shard's number, for example --shard 3/16")
        })?;
        Ok(Some(Assignment { launcher: self.launcher, rank, count, number: None }))
    }
}

/// Reads the number of this process's element in a Slurm array. If the user gives the number of shards, the number of
/// the array's element is the shard's number, so that a part of the array can be started again. Returns `None` if the
/// process belongs to no Slurm array. If the user does not give the number of shards, an array with irregular gaps,
/// or of unknown length, is an error.
fn array(count_is_given: bool, variable: Variable<'_>) -> Result<Option<Assignment>> {
    let Some(task) = number("SLURM_ARRAY_TASK_ID", variable)? else { return Ok(None) };
    let launcher = "a Slurm array (SLURM_ARRAY_TASK_ID)";
    let of = |name| number(name, variable);
    if count_is_given {
        // The array's number of elements is read because an array of one element may contain a launcher of
        // several processes, which then decides the shard.
        let count = of("SLURM_ARRAY_TASK_COUNT")?;
        return Ok(Some(Assignment { launcher, rank: 0, count, number: Some(task) }));
    }
    let (least, most) = (of("SLURM_ARRAY_TASK_MIN")?, of("SLURM_ARRAY_TASK_MAX")?);
    let (step, count) = (of("SLURM_ARRAY_TASK_STEP")?.unwrap_or(1).max(1), of("SLURM_ARRAY_TASK_COUNT")?);
    let (Some(least), Some(count)) = (least, count) else { return Err(no_count(launcher)) };
    let rank = task.checked_sub(least).filter(|above| above % step == 0).map(|above| above / step);
    let whole = most.is_none_or(|most| {
        u64::from(least) + u64::from(step) * u64::from(count.max(1) - 1) == u64::from(most)
    });
    match rank.filter(|rank| whole && *rank < count) {
        Some(rank) => Ok(Some(Assignment { launcher, rank, count: Some(count), number: None })),
        None => Err(Error::input(format!(
            "a Slurm array of {count} elements has irregular gaps, so raycl cannot determine the shard of \
             element {task}"
        ))
        .with_help("with --shard auto/16, each element's number is its shard's number and must be 1 to 16")),
    }
}

impl Assignment {
    fn shard(&self, of: Option<u32>) -> Result<Shard> {
        let launcher = self.launcher;
        // If `number` is set, the number of an array's element is the shard's number, and the array may have fewer
        // elements than there are shards.
        let count = self.count.filter(|count| self.number.is_none() && Some(*count) != of);
        if let (Some(of), Some(count)) = (of, count) {
            let message = format!("--shard auto/{of}, but {launcher} started {count} processes");
            return Err(Error::input(message)
                .with_help("start one process per shard, or omit the count: --shard auto"));
        }
        let of = of.or(self.count).ok_or_else(|| no_count(launcher))?;
        let number = self.number.unwrap_or(self.rank.saturating_add(1));
        let error = |_| {
            Error::input(format!(
                "according to {launcher}, this task is shard {number}, but the shards are 1 to {of}"
            ))
            .with_help(format!("number the tasks so that each of them matches one of the shards 1 to {of}"))
        };
        Shard::new(number, of).map_err(error)
    }
}

/// Returns the number in an environment variable; `None` if the variable is not set. A value that is not a number is an
/// error.
fn number(name: &str, variable: Variable<'_>) -> Result<Option<u32>> {
    let Some(text) = variable(name) else { return Ok(None) };
    text.trim().parse().map(Some).map_err(|_| {
        Error::input(format!("{name} is '{text}', which is not a number"))
            .with_help("give the shard's number, for example --shard 3/16")
    })
}

fn no_count(launcher: &str) -> Error {
    Error::input(format!("{launcher} does not say how many processes there are"))
        .with_help("state the number of shards: --shard auto/16")
}

fn twice(array: &Assignment, inner: &Assignment) -> Error {
    let text = |assignment: &Assignment| match assignment.number {
        Some(number) => format!("{} calls it element {number}", assignment.launcher),
        None => format!(
            "{} calls it number {} of {}, counted from 0",
            assignment.launcher,
            assignment.rank,
            assignment.count.map_or("?".to_owned(), |n| n.to_string())
        ),
    };
    Error::input(format!("two launchers number this process: {}, and {}", text(array), text(inner)))
        .with_help(
            "let each element of the array start one process, or omit the array; or give the \
            shard's number, for example --shard 3/16",
        )
}

/// Returns an error if a batch script of several tasks started raycl without `srun`: raycl then runs only once, and
/// `SLURM_PROCID` is not the number of a task.
fn outside_of_a_step(variable: Variable<'_>) -> Option<Error> {
    let rank = variable("SLURM_PROCID").filter(|_| variable("SLURM_STEP_ID").is_none())?;
    let tasks = number("SLURM_NTASKS", variable).ok().flatten().filter(|tasks| *tasks > 1)?;
    Some(
        Error::input(format!(
            "this batch script has {tasks} tasks, but it started raycl without srun, so raycl runs only once \
             (SLURM_PROCID={rank})"
        ))
        // Several commands have the option `--shard`, so the advice names none of them.
        .with_help("start raycl with srun: srun raycl ... --shard auto"),
    )
}

fn nobody() -> Error {
    let known = INNER.iter().map(|ranks| ranks.launcher).chain(["a Slurm array (SLURM_ARRAY_TASK_ID)"]);
    let known: Vec<_> = known.chain(OUTER.iter().map(|ranks| ranks.launcher)).collect();
    Error::input("--shard auto needs a launcher that numbers its processes, but none was found").with_help(
        format!("give the shard's number, for example --shard 3/16. Known launchers: {}", known.join(", ")),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the shard's number and the number of shards, or the error's message.
    fn assigned(of: Option<u32>, variables: &str) -> std::result::Result<(u32, u32), String> {
        let variable = |name: &str| {
            variables.split(' ').find_map(|one| one.strip_prefix(name)?.strip_prefix('=').map(str::to_owned))
        };
        shard(of, &variable).map(|shard| (shard.number, shard.of)).map_err(|error| error.to_string())
    }

    const ARRAY: &str =
        "SLURM_ARRAY_TASK_MIN=10 SLURM_ARRAY_TASK_MAX=22 SLURM_ARRAY_TASK_STEP=4 SLURM_ARRAY_TASK_COUNT=4";
    const GAPS: &str = "SLURM_ARRAY_TASK_MIN=1 SLURM_ARRAY_TASK_MAX=7 SLURM_ARRAY_TASK_COUNT=3";
    const BATCH: &str = "SLURM_PROCID=0 SLURM_NTASKS=1";

    #[test]
    fn each_launcher_has_its_origin_and_its_step() {
        let table = [
            (None, "OMPI_COMM_WORLD_RANK=0 OMPI_COMM_WORLD_SIZE=4".to_owned(), (1, 4)),
            (Some(4), "OMPI_COMM_WORLD_RANK=3 OMPI_COMM_WORLD_SIZE=4".to_owned(), (4, 4)),
            (None, "PMI_RANK=2 PMI_SIZE=3".to_owned(), (3, 3)),
            (None, "SLURM_PROCID=1 SLURM_STEP_ID=0 SLURM_STEP_NUM_TASKS=4 SLURM_NTASKS=9".to_owned(), (2, 4)),
            (None, format!("SLURM_ARRAY_TASK_ID=18 {ARRAY} {BATCH}"), (3, 4)),
            (
                Some(16),
                "SLURM_ARRAY_TASK_ID=7 SLURM_ARRAY_TASK_MIN=3 SLURM_ARRAY_TASK_COUNT=2".to_owned(),
                (7, 16),
            ),
            (None, "CI_NODE_INDEX=1 CI_NODE_TOTAL=5".to_owned(), (1, 5)),
            (Some(8), "JOB_COMPLETION_INDEX=0".to_owned(), (1, 8)),
            (Some(8), "HQ_TASK_ID=8".to_owned(), (8, 8)),
        ];
        for (of, variables, expected) in table {
            assert_eq!(assigned(of, &variables), Ok(expected), "{variables}");
        }
    }

    #[test]
    fn the_innermost_launcher_wins() {
        let mpirun = "OMPI_COMM_WORLD_RANK=1 OMPI_COMM_WORLD_SIZE=4";
        let step = "SLURM_PROCID=0 SLURM_STEP_ID=0 SLURM_STEP_NUM_TASKS=2";
        assert_eq!(assigned(None, &format!("{step} {mpirun} PMI_RANK=0 PMI_SIZE=2")), Ok((2, 4)));
        assert_eq!(assigned(None, &format!("{step} CI_NODE_INDEX=3 CI_NODE_TOTAL=3")), Ok((1, 2)));
        let alone = "SLURM_PROCID=0 SLURM_STEP_ID=0 SLURM_STEP_NUM_TASKS=1";
        assert_eq!(
            assigned(None, &format!("SLURM_ARRAY_TASK_ID=10 {ARRAY} {alone}")),
            Ok((1, 4)),
            "a step of one task"
        );
        assert_eq!(assigned(Some(8), &format!("JOB_COMPLETION_INDEX=4 {alone}")), Ok((5, 8)));
        let single =
            "SLURM_ARRAY_TASK_ID=5 SLURM_ARRAY_TASK_MIN=5 SLURM_ARRAY_TASK_MAX=5 SLURM_ARRAY_TASK_COUNT=1";
        for of in [None, Some(4)] {
            assert_eq!(assigned(of, &format!("{single} {mpirun}")), Ok((2, 4)), "an array of one element");
        }
        assert_eq!(assigned(Some(8), &format!("{single} {alone}")), Ok((5, 8)), "both started one process");
        assert_eq!(assigned(None, alone), Ok((1, 1)));
    }

    #[test]
    fn the_advice_to_use_srun_names_no_command() {
        let variable = |name: &str| matches!(name, "SLURM_PROCID" | "SLURM_NTASKS").then(|| "4".to_owned());
        let error = shard(None, &variable).expect_err("no step");
        assert_eq!(error.remedy(), "start raycl with srun: srun raycl ... --shard auto");
    }

    #[test]
    fn what_numbers_nothing_or_twice_is_refused_with_what_was_found() {
        let step = "SLURM_PROCID=1 SLURM_STEP_ID=0 SLURM_STEP_NUM_TASKS=4";
        let table = [
            (None, String::new(), "--shard auto needs a launcher"),
            (None, format!("SLURM_ARRAY_TASK_ID=10 {ARRAY} {step}"), "two launchers number this process"),
            (
                Some(4),
                format!("SLURM_ARRAY_TASK_ID=2 {step}"),
                "calls it element 2, and a step of Slurm (SLURM_PROCID) calls it number 1 of 4, counted from 0",
            ),
            (
                None,
                "SLURM_PROCID=0 SLURM_NTASKS=4".to_owned(),
                "this batch script has 4 tasks, but it started raycl without srun",
            ),
            (
                Some(4),
                "SLURM_ARRAY_TASK_ID=2 SLURM_PROCID=0 SLURM_NTASKS=4".to_owned(),
                "this batch script has 4 tasks, but it started raycl without srun",
            ),
            (None, BATCH.to_owned(), "none was found"),
            (None, format!("SLURM_ARRAY_TASK_ID=7 {GAPS}"), "has irregular gaps"),
            (None, format!("SLURM_ARRAY_TASK_ID=1 {GAPS}"), "has irregular gaps"),
            (None, format!("SLURM_ARRAY_TASK_ID=12 {ARRAY} {BATCH}"), "has irregular gaps"),
            (None, "SLURM_ARRAY_TASK_ID=7".to_owned(), "does not say how many"),
            (None, "JOB_COMPLETION_INDEX=0".to_owned(), "does not say how many"),
            (Some(8), "JOB_COMPLETION_INDEX=8".to_owned(), "this task is shard 9, but the shards are 1 to 8"),
            (Some(8), "HQ_TASK_ID=0".to_owned(), "start at 1"),
            (Some(8), "SLURM_ARRAY_TASK_ID=0".to_owned(), "this task is shard 0, but the shards are 1 to 8"),
            (Some(8), "HQ_TASK_ID=9".to_owned(), "this task is shard 9, but the shards are 1 to 8"),
            (Some(8), "OMPI_COMM_WORLD_RANK=0 OMPI_COMM_WORLD_SIZE=4".to_owned(), "started 4 processes"),
            (None, "PMI_RANK=x PMI_SIZE=3".to_owned(), "PMI_RANK is 'x', which is not a number"),
        ];
        for (of, variables, expected) in table {
            let said = assigned(of, &variables).expect_err(&variables);
            assert!(said.contains(expected), "{variables}: {said}");
        }
    }
}
