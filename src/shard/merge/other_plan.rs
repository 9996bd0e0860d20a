//! Reports attempts whose plan differs from the plan of the folder. Attempts have different plans if the
//! folders of several machines, each with its own plan, were copied together. The plans of two machines may
//! differ, since a plan depends on the times that its machine measured earlier.

use crate::error::Result;
use crate::record::journals::SHARDS;
use crate::shard::{Attempt, ShardPlan};
use crate::words::{counted, few};

/// Returns a note that names the attempts with another plan; `None` if there are none. Attempts of earlier versions do
/// not say which plan they had.
pub fn other_plan(plan: &ShardPlan, attempts: &[Attempt]) -> Result<Option<String>> {
    let own = plan.hash()?;
    let mut names: Vec<&str> = Vec::new();
    for attempt in attempts {
        let plan = attempt.about()?.and_then(|about| about.plan);
        names.extend(plan.filter(|plan| *plan != own).map(|_| attempt.name.as_str()));
    }
    Ok((!names.is_empty()).then(|| {
        format!(
            "The plan in {SHARDS} is not that of {} ({}). Blocks of different plans may have different control points, or none. Points of blocks without a common control point are compared by their times alone.",
            counted(names.len(), "attempt"),
            few(&names)
        )
    }))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::experiment::Block;
    use crate::shard::About;

    #[test]
    fn attempts_with_another_division_into_blocks_are_named() {
        let out = tempfile::tempdir().unwrap();
        let plan = |points: &[usize]| {
            let block = Block { number: 1, shard: 1, points: points.to_vec(), control: None };
            ShardPlan { blocks: vec![block], ..ShardPlan::default() }
        };
        let begin = |host: &str, plan: Option<ShardPlan>| {
            let plan = plan.map(|plan| plan.hash().unwrap());
            let about = About { shard: 1, of: 1, host: host.into(), plan, ..About::default() };
            Attempt::begin(out.path(), &about).unwrap();
        };
        let note = || other_plan(&plan(&[0, 1]), &Attempt::all(out.path()).unwrap()).unwrap();
        begin("n1", Some(plan(&[0, 1])));
        begin("n2", None);
        assert_eq!(note(), None);
        begin("n3", Some(plan(&[1, 0])));
        let text = note().unwrap();
        let beginning = "The plan in shards.json is not that of 1 attempt (shard-00001.n3..r00). ";
        assert!(text.starts_with(beginning), "{text}");
    }
}
