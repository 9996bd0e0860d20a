//! Cuts a plan (the list of an experiment's points) into blocks, and assigns the blocks to shards. The work is divided
//! among the shards as evenly as the blocks allow. Points that are compared with each other stay in one block, unless
//! a cut into several blocks noticeably shortens the time of the shard that takes longest.

use serde::{Deserialize, Serialize};
use std::collections::{HashMap, HashSet};

/// Points of an experiment that one shard measures together.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Block {
    /// The block's number, counted from 1.
    pub number: u32,
    /// The number of the shard that measures the block, from 1.
    pub shard: u32,
    /// The block's points, as indices into the plan.
    pub points: Vec<usize>,
    /// The control point of the group that was cut into blocks: all blocks of the group measure this point,
    /// so that the blocks can be compared. The control point itself belongs to one block of the group. `None`
    /// if the group is not cut into blocks.
    pub control: Option<usize>,
}

impl Block {
    /// Returns true if the block measures the control point only for comparison, since the control point
    /// belongs to another block.
    pub fn borrows_control(&self) -> bool {
        self.control.is_some_and(|control| !self.points.contains(&control))
    }

    /// Returns the block's expected time in milliseconds. `costs` has the cost of each point of the plan, by
    /// the point's index.
    pub fn expected_ms(&self, costs: &HashMap<usize, Cost>) -> f64 {
        let borrowed = self.control.filter(|_| self.borrows_control());
        let points = self.points.iter().chain(&borrowed);
        whole_ms(&points.filter_map(|point| costs.get(point).copied()).collect::<Vec<_>>())
    }
}

/// Returns true if the blocks contain each point of a plan with `points` points exactly once.
pub fn contain_each_once(blocks: &[Block], points: usize) -> bool {
    let mut contained: Vec<usize> = blocks.iter().flat_map(|block| block.points.iter().copied()).collect();
    contained.sort_unstable();
    contained.into_iter().eq(0..points)
}

/// A point of the experiment that is to be assigned to a block, with its expected time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// The point's index in the plan.
    pub point: usize,
    /// The point's expected time in milliseconds, summed over all devices that measure the point, without the start of
    /// workers. Only the ratios of times affect how the points are divided into blocks.
    pub ms: f64,
    /// The expected time in milliseconds to start the workers that measure the point. The points of a block
    /// have the same workers, so a block takes this time once, and not once for each of its points.
    pub start_ms: f64,
    /// True if the point is suitable as a control point: as far as is known, every device can measure the
    /// point.
    pub may_control: bool,
}

/// The expected time of a block in milliseconds, and the block.
type Priced = (f64, Block);

/// The factors that [`cut`] tries, largest first. A factor times the mean time per shard is the target for the expected
/// time of a piece of a group: no piece should take much longer. With the first factor, infinity, no group is cut.
const GRAINS: [f64; 5] = [f64::INFINITY, 1.0, 0.5, 0.34, 0.25];
/// If a group of points is cut into pieces, each piece measures one common point (the control point), so that
/// the pieces can be compared. Smaller pieces mean that control points are measured more often. Groups are
/// cut into smaller pieces only if this shortens the time of the shard that takes longest by more than the
/// fraction `WORTHWHILE`.
const WORTHWHILE: f64 = 0.05;

/// Cuts groups of comparable points into blocks for `shards` shards. Equal arguments always result in equal
/// blocks.
pub fn cut(groups: &[Vec<Cost>], shards: u32) -> Vec<Block> {
    let shards = shards.max(1);
    let all: f64 = groups.iter().map(|group| whole_ms(group)).sum();
    let fair = all / f64::from(shards);
    let alone = groups.iter().flatten().map(|cost| (cost.point, cost.start_ms + cost.ms));
    let alone: HashMap<usize, f64> = alone.collect();
    let alone_ms = |point: usize| alone.get(&point).copied().unwrap_or_default();
    let mut best: Option<(f64, Vec<Priced>)> = None;
    for grain in GRAINS {
        let mut blocks: Vec<Priced> = groups.iter().flat_map(|group| pieces(group, grain * fair)).collect();
        let longest = deal(&mut blocks, shards, alone_ms);
        if best.as_ref().is_none_or(|(known, _)| longest < (1.0 - WORTHWHILE) * known) {
            best = Some((longest, blocks));
        }
    }
    let blocks = best.map_or_else(Vec::new, |(_, blocks)| blocks);
    let mut blocks = joined(blocks.into_iter().map(|(_, block)| block).collect());
    for (block, number) in blocks.iter_mut().zip(1..) {
        block.number = number;
    }
    blocks
}

/// Returns the expected time in milliseconds of points that the same workers measure.
fn whole_ms(points: &[Cost]) -> f64 {
    start_ms(points) + points.iter().map(|cost| cost.ms).sum::<f64>()
}

/// Returns the expected time in milliseconds to start the workers that measure these points.
fn start_ms(points: &[Cost]) -> f64 {
    points.iter().map(|cost| cost.start_ms).fold(0.0, f64::max)
}

/// Returns the group as one piece or, if the group's expected time exceeds `most`, as several pieces of
/// neighbouring points. The expected time of each piece includes a start of workers.
fn pieces(group: &[Cost], most: f64) -> Vec<Priced> {
    let (whole, start) = (whole_ms(group), start_ms(group));
    // Pieces may take slightly longer than `most`, since each additional piece also has to measure the control point. A
    // group has at most half as many pieces as points (rounded up). For a piece with a single point, it would not be
    // worthwhile to measure the control point too.
    let wanted = (whole / (1.1 * most).max(f64::MIN_POSITIVE)).ceil();
    let count = (wanted as usize).clamp(1, group.len().div_ceil(2).max(1));
    let control = control(group).filter(|_| count > 1);
    let mut pieces = vec![(start, Block::default()); count];
    let mut before = 0.0;
    for Cost { point, ms: cost, .. } in group {
        // The points' times, laid end to end, fill the time of the group after the start of its workers. This
        // time is divided into equal intervals, one for each piece of the group. A point goes to the piece of
        // the group whose interval contains the middle of the point's time.
        let part = (before + 0.5 * cost) / (whole - start).max(f64::MIN_POSITIVE);
        let piece = ((part * count as f64) as usize).min(count - 1);
        pieces[piece].0 += cost;
        pieces[piece].1.points.push(*point);
        before += cost;
    }
    pieces.retain(|(_, block)| !block.points.is_empty());
    let is_cut = pieces.len() > 1;
    for (cost, block) in &mut pieces {
        block.control = control.map(|control| control.point).filter(|_| is_cut);
        if let Some(own) = control.filter(|_| block.borrows_control()) {
            *cost += own.ms;
        }
    }
    pieces
}

/// Returns the fastest point among the points that every device can measure. If there is no such point, returns the
/// fastest of the points whose expected time is above 0. (A point that no device can measure has the expected time
/// 0.) If all expected times are 0, returns the first point; `None` if there is no point.
fn control(group: &[Cost]) -> Option<&Cost> {
    let fastest = |suits: fn(&&Cost) -> bool| {
        group.iter().filter(suits).min_by(|one, other| one.ms.total_cmp(&other.ms))
    };
    fastest(|cost| cost.may_control).or_else(|| fastest(|cost| cost.ms > 0.0)).or(group.first())
}

/// Assigns blocks to shards, in descending order of the blocks' expected times. Each block goes to the shard whose
/// blocks so far have the least total expected time. Returns the expected time of the shard that takes longest.
/// `alone_ms` returns the expected time of a point with the start of its workers. The expected time of each piece of a
/// group includes the control point and a start of workers. But a shard with several pieces of a group starts workers
/// and measures the control point only once (see [`joined`]). The time for the start and the control point is therefore
/// subtracted for every further piece.
fn deal(blocks: &mut [Priced], shards: u32, alone_ms: impl Fn(usize) -> f64) -> f64 {
    let mut order: Vec<usize> = (0..blocks.len()).collect();
    order.sort_by(|one, other| blocks[*other].0.total_cmp(&blocks[*one].0).then(one.cmp(other)));
    let mut loads = vec![0.0_f64; shards as usize];
    let mut controls = HashSet::new();
    for index in order {
        let least = (0..loads.len()).min_by(|one, other| loads[*one].total_cmp(&loads[*other])).unwrap_or(0);
        let (ms, block) = &mut blocks[index];
        let repeated = block.control.filter(|control| !controls.insert((least, *control)));
        loads[least] += *ms - repeated.map_or(0.0, &alone_ms);
        block.shard = least as u32 + 1;
    }
    loads.into_iter().fold(0.0, f64::max)
}

/// Joins the pieces of a group that are assigned to the same shard into one block, so that the shard measures
/// these pieces together.
fn joined(blocks: Vec<Block>) -> Vec<Block> {
    let mut joined: Vec<Block> = Vec::new();
    for block in blocks {
        let same = |known: &&mut Block| {
            known.control.is_some() && known.control == block.control && known.shard == block.shard
        };
        match joined.iter_mut().find(same) {
            Some(known) => known.points.extend(block.points),
            None => joined.push(block),
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn groups(costs: &[Vec<f64>]) -> Vec<Vec<Cost>> {
        started_groups(costs, 0.0)
    }

    #[test]
    fn blocks_contain_each_point_once_if_none_is_left_out_or_repeated() {
        let contain = |all: &[Vec<usize>], points| {
            let block = |points: &Vec<usize>| Block { points: points.clone(), ..Block::default() };
            contain_each_once(&all.iter().map(block).collect::<Vec<_>>(), points)
        };
        assert!(contain(&[vec![2, 0], vec![1]], 3) && contain(&[], 0));
        for wrong in [vec![vec![2, 0]], vec![vec![2, 0], vec![0]], vec![vec![0, 1, 2], vec![3]]] {
            assert!(!contain(&wrong, 3), "{wrong:?}");
        }
    }

    /// Returns groups of points with these expected times. The workers of each group take `start_ms` to start.
    fn started_groups(costs: &[Vec<f64>], start_ms: f64) -> Vec<Vec<Cost>> {
        let mut points = 0..;
        let mut cost =
            |ms: &f64| Cost { point: points.next().unwrap_or(0), ms: *ms, start_ms, may_control: true };
        costs.iter().map(|group| group.iter().map(&mut cost).collect()).collect()
    }

    /// Returns the expected time of each shard. This time includes the control points that blocks of the
    /// shard measure only for comparison with other blocks.
    fn loads(costs: &[Vec<f64>], blocks: &[Block], shards: u32) -> Vec<f64> {
        let costs: Vec<f64> = costs.concat();
        let of = |block: &Block| {
            let borrowed = block.control.filter(|_| block.borrows_control());
            block.points.iter().chain(&borrowed).map(|point| costs[*point]).sum::<f64>()
        };
        (1..=shards).map(|shard| blocks.iter().filter(|block| block.shard == shard).map(of).sum()).collect()
    }

    proptest! {
        #[test]
        fn every_point_is_in_one_block_and_pieces_share_a_control(
            costs in prop::collection::vec(prop::collection::vec(0.01f64..10.0, 1..40), 1..12), shards in 1u32..20,
        ) {
            let groups = groups(&costs);
            let blocks = cut(&groups, shards);
            let mut points: Vec<usize> = blocks.iter().flat_map(|block| block.points.clone()).collect();
            points.sort_unstable();
            prop_assert_eq!(points, (0..costs.concat().len()).collect::<Vec<_>>());
            prop_assert!(blocks.iter().all(|block| (1..=shards).contains(&block.shard)));
            for group in &groups {
                let own: Vec<&Block> = blocks.iter().filter(|block| group.iter().any(|cost| block.points.contains(&cost.point))).collect();
                prop_assert!(own.iter().all(|block| block.control == own[0].control));
                let homes = own.iter().filter(|block| block.control.is_some() && !block.borrows_control()).count();
                prop_assert_eq!(homes, usize::from(own[0].control.is_some()));
                prop_assert!(own.len() == 1 || own[0].control.is_some());
            }
            prop_assert_eq!(&blocks, &cut(&groups, shards), "the same numbers make the same blocks");
        }
    }

    #[test]
    fn shards_have_about_as_much_to_do() {
        let costs: Vec<Vec<f64>> = vec![vec![1.0; 40], vec![0.5; 20], vec![2.0; 8], vec![0.1; 50]];
        let blocks = cut(&groups(&costs), 8);
        let loads = loads(&costs, &blocks, 8);
        let most = loads.iter().copied().fold(0.0, f64::max);
        assert!(most < 1.5 * costs.concat().iter().sum::<f64>() / 8.0, "{loads:?}");
        let six: Vec<Vec<f64>> = vec![vec![1.0; 10]; 6];
        let most = self::loads(&six, &cut(&groups(&six), 4), 4).into_iter().fold(0.0, f64::max);
        assert!(most <= 18.0, "with undivided groups, the largest load would be 20: {most}");
        let three = [vec![1.0], vec![1.0], vec![2.0]];
        let loads = self::loads(&three, &cut(&groups(&three), 2), 2);
        assert_eq!(loads, [2.0, 2.0], "the longest group is assigned first");
        let whole = cut(&groups(&vec![vec![1.0; 8]; 4]), 4);
        assert!(whole.len() == 4 && whole.iter().all(|block| block.control.is_none()), "{whole:?}");
        assert_eq!(whole.iter().map(|block| block.shard).collect::<Vec<_>>(), [1, 2, 3, 4]);
    }

    #[test]
    fn a_gain_of_less_than_a_twentieth_cuts_no_group() {
        // If the groups stay whole, the shard that takes longest takes 52.01 ms. If both groups of points are
        // cut into two, three or four pieces each, each shard takes 51.02 ms, about 2% less than the longest
        // shard with whole groups.
        let costs = [52, 50].map(|many| [vec![0.01], vec![1.0; many]].concat());
        let blocks = cut(&groups(&costs), 2);
        assert!(blocks.len() == 2 && blocks.iter().all(|block| block.control.is_none()), "{blocks:?}");
    }

    #[test]
    fn blocks_are_compared_by_a_point_that_every_device_can_measure() {
        let mut groups = groups(&[vec![0.1, 2.0, 1.0, 1.5]]);
        let control = |groups: &[Vec<Cost>]| cut(groups, 2)[0].control;
        assert_eq!(control(&groups), Some(0));
        groups[0][0].may_control = false;
        assert_eq!(control(&groups), Some(2));
        groups[0].iter_mut().for_each(|cost| cost.may_control = false);
        assert_eq!(
            control(&groups),
            Some(0),
            "a control point that some devices cannot measure is better than none"
        );
        groups[0][0].ms = 0.0;
        assert_eq!(control(&groups), Some(2), "no device can measure a point that takes no time");
    }

    #[test]
    fn more_shards_than_points_leave_some_with_nothing() {
        let blocks = cut(&groups(&[vec![1.0; 3]]), 16);
        assert_eq!(blocks.iter().map(|block| block.points.len()).sum::<usize>(), 3);
        assert!(blocks.len() <= 2, "a block of one point would also measure the control point: {blocks:?}");
        assert!(cut(&[], 4).is_empty());
    }

    #[test]
    fn a_point_goes_where_most_of_it_lies_and_a_borrowed_control_costs() {
        let group = &groups(&[vec![3.0, 4.0, 3.0]])[0];
        let pieces = pieces(group, 5.0);
        let points: Vec<_> = pieces.iter().map(|(_, block)| block.points.clone()).collect();
        assert_eq!(points, [vec![0], vec![1, 2]]);
        // The group's control point, with cost 3, belongs to the first piece of the group. The second piece
        // of the group measures the group's control point too, which adds 3 to the cost of the second piece.
        assert_eq!(pieces.iter().map(|(cost, _)| *cost).collect::<Vec<_>>(), [3.0, 10.0]);
    }

    #[test]
    fn pieces_of_a_group_in_one_shard_cost_the_control_point_once() {
        let costs = vec![1.0; 8];
        let mut pieces = pieces(&groups(std::slice::from_ref(&costs))[0], 2.0);
        assert_eq!(pieces.iter().map(|(cost, _)| *cost).collect::<Vec<_>>(), [2.0, 3.0, 3.0, 3.0]);
        let longest = deal(&mut pieces, 2, |point| costs[point]);
        let blocks = joined(pieces.into_iter().map(|(_, block)| block).collect());
        assert_eq!((loads(std::slice::from_ref(&costs), &blocks, 2), longest), (vec![5.0, 4.0], 5.0));
    }

    #[test]
    fn a_block_starts_its_workers_once() {
        let groups = started_groups(&[vec![1.0; 4]], 10.0);
        let mut pieces = pieces(&groups[0], 7.0);
        assert_eq!(pieces.iter().map(|(cost, _)| *cost).collect::<Vec<_>>(), [12.0, 13.0]);
        // One shard measures both pieces of the group, so it starts workers once.
        assert_eq!(deal(&mut pieces, 1, |_| 11.0), 14.0);
        let costs: HashMap<usize, Cost> = groups[0].iter().map(|cost| (cost.point, *cost)).collect();
        let expected_ms = |points: &[usize]| {
            Block { points: points.to_vec(), control: Some(0), ..Block::default() }.expected_ms(&costs)
        };
        assert_eq!([expected_ms(&[0, 1, 2, 3]), expected_ms(&[2, 3])], [14.0, 13.0]);
    }

    #[test]
    fn groups_whose_pieces_would_mainly_start_workers_are_not_cut() {
        let are_cut = |start_ms: f64| {
            let blocks = cut(&started_groups(&vec![vec![100.0; 30]; 2], start_ms), 3);
            blocks.iter().any(|block| block.control.is_some())
        };
        // If starting workers takes no time, the shard that takes longest takes 3000 ms with whole groups, and 2200 ms
        // with three pieces per group. If starting workers takes 2000 ms, the shard that takes longest takes 5000 ms
        // with whole groups, and at least 6200 ms with pieces.
        assert_eq!([are_cut(0.0), are_cut(2000.0)], [true, false]);
    }

    #[test]
    fn a_little_more_than_a_share_is_not_cut() {
        let group = &groups(&[vec![1.0; 4]])[0];
        assert_eq!((pieces(group, 3.7).len(), pieces(group, 3.5).len()), (1, 2));
    }

    #[test]
    fn whole_groups_of_one_shard_are_blocks_of_their_own() {
        let blocks = cut(&groups(&[vec![1.0; 2], vec![1.0; 2]]), 1);
        let points: Vec<_> = blocks.iter().map(|block| block.points.clone()).collect();
        assert_eq!(points, [vec![0, 1], vec![2, 3]]);
    }

    #[test]
    fn points_that_all_lie_in_one_piece_have_no_control_point() {
        let pieces = pieces(&groups(&[vec![10.0, 0.0, 0.0]])[0], 5.0);
        let blocks: Vec<_> = pieces.iter().map(|(_, block)| (block.points.clone(), block.control)).collect();
        assert_eq!(blocks, [(vec![0, 1, 2], None)]);
    }
}
