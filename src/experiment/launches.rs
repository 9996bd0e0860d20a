//! The order in which a run measures the launches of its groups of points. A *visit* of a group of points measures one
//! launch of the group. No worker process measures two launches of a group. Of the unfinished groups that may be
//! measured on a device, one with the fewest visits is visited next. The first visits follow the plan's order; the
//! order of later visits is random.

use super::Run;
use super::group::OpenGroup;
use super::result_sink::ResultSink;
use super::supervisor::Supervisor;
use crate::error::Result;
use crate::measure::round_order;
use crate::threads::locked;
use std::sync::Mutex;

/// Groups that still have to be visited; a visit measures one launch of a group.
pub struct Waiting {
    groups: Mutex<Vec<OpenGroup>>,
    seed: u64,
}

impl Waiting {
    /// Collects the unfinished groups of a run.
    pub fn new(groups: Vec<OpenGroup>, seed: u64) -> Self {
        let groups = groups.into_iter().filter(|group| !group.is_finished()).collect();
        Self { groups: Mutex::new(groups), seed }
    }

    /// Takes the next group for a device, or for any device if `device` is `None`. Chooses at random among
    /// the groups that were visited (measured in a launch) least often. Groups that were not visited yet are
    /// chosen in the plan's order. Returns `None` if no group that may be measured on the device is waiting.
    fn take(&self, device: Option<usize>) -> Option<OpenGroup> {
        let mut groups = locked(&self.groups);
        let may = |group: &OpenGroup| device.is_none_or(|device| group.may_go_to(device));
        let visits = groups.iter().filter(|group| may(group)).map(OpenGroup::visits).min()?;
        let next: Vec<usize> = (0..groups.len())
            .filter(|index| may(&groups[*index]) && groups[*index].visits() == visits)
            .collect();
        let turn = u64::from(visits) << 32 | next.len() as u64;
        let chosen = if visits == 0 { 0 } else { round_order(next.len(), turn, self.seed)[0] };
        // `remove` keeps the order of the remaining groups, so groups are visited for the first time in the
        // plan's order.
        Some(groups.remove(next[chosen]))
    }

    fn put_back(&self, group: OpenGroup) {
        if !group.is_finished() {
            locked(&self.groups).push(group);
        }
    }
}

/// Visits groups until they are finished. Each visit of a group of points measures one launch of the group.
/// If `device` is `None`, all groups are visited. If `device` is not `None`, only groups that may be measured
/// on this device are visited. After an error, no other group is visited.
pub fn serve(
    run: &Run<'_>,
    waiting: &Waiting,
    device: Option<usize>,
    supervisor: &mut Supervisor<'_>,
    sink: &mut impl ResultSink,
) -> Result<()> {
    while let Some(mut group) = waiting.take(device) {
        device.into_iter().for_each(|device| group.settle(device));
        group.visit(run, supervisor, sink).inspect_err(|_| locked(&waiting.groups).clear())?;
        waiting.put_back(group);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::pending::PendingPoint;
    use super::*;
    use crate::record::Record;

    #[test]
    fn between_two_visits_of_a_group_all_others_have_their_turn() {
        let group = |(point, visits): (usize, u32)| {
            let pending = PendingPoint::new([point, 0, 0], String::new(), Record::default());
            OpenGroup::visited(visits, vec![pending])
        };
        for seed in 0..8 {
            let waiting = Waiting::new([(0, 2), (1, 1), (2, 1), (3, 2)].map(group).into(), seed);
            let taken = || waiting.take(None).map(|group| group.points()[0].point);
            let mut order: Vec<usize> = std::iter::from_fn(taken).collect();
            order[..2].sort_unstable();
            order[2..].sort_unstable();
            assert_eq!(order, [1, 2, 0, 3], "seed {seed}");
        }
    }

    #[test]
    fn groups_are_first_visited_in_the_plans_order_and_a_finished_one_not_at_all() {
        let pending = |point| PendingPoint::new([point, 0, 0], String::new(), Record::default());
        let groups = [vec![pending(0)], Vec::new(), vec![pending(2)]].map(OpenGroup::new);
        let waiting = Waiting::new(groups.into(), 1);
        let taken = || waiting.take(Some(0)).map(|group| group.points()[0].point);
        assert_eq!([taken(), taken(), taken()], [Some(0), Some(2), None]);
    }

    #[test]
    fn a_device_takes_no_group_of_another_device() {
        // The groups that are bound to the first device were visited as often as the groups of the other
        // device, or more often.
        for (seed, visits) in (0..8).flat_map(|seed| [(seed, 1), (seed, 2)]) {
            let group = |(point, device): (usize, usize)| {
                let pending = PendingPoint::new([point, 0, 0], String::new(), Record::default());
                let mut group = OpenGroup::visited([visits, 1][device], vec![pending]);
                group.settle(device);
                group
            };
            let waiting = Waiting::new([(0, 1), (1, 0), (2, 1), (3, 0)].map(group).into(), seed);
            let taken = |device| waiting.take(Some(device)).map(|group| group.points()[0].point);
            let mut of_first: Vec<usize> = std::iter::from_fn(|| taken(0)).collect();
            of_first.sort_unstable();
            assert_eq!((of_first, locked(&waiting.groups).len()), (vec![1, 3], 2), "seed {seed}");
        }
    }
}
