//! Compares two strategies in a group of points: a scene at an image size on a device.

use super::pairs::{Identity, Pair};
use super::{Compared, Effect};
use crate::record::point_times::median;
use crate::record::ratios::ratio;
use crate::record::summary::{Group, first_line, not_enough};
use crate::record::types::Record;
use std::collections::HashMap;

/// A group of points: a scene at an image size on a device.
pub(super) struct Column<'a> {
    /// The scene's name.
    pub(super) scene: &'a str,
    /// Image size in pixels: across, down.
    pub(super) image_size: [u32; 2],
    /// The points of each strategy: first those with a rank, the fastest first, and last those without a time.
    points: HashMap<Identity<'a>, Vec<Point<'a>>>,
}

/// A point of a group.
#[derive(Clone, Copy)]
struct Point<'a> {
    record: &'a Record,
    /// The point's place among the points of its group that have a rank, from 0 for the fastest; `None` without a rank.
    rank: Option<usize>,
}

impl<'a> Column<'a> {
    /// Ranks the points of a group, and sorts them by strategy.
    pub(super) fn of(group: &Group<'a>) -> Self {
        let ranking = group.ranking();
        let ranked = ranking.ranked.iter().copied().enumerate();
        let ranked = ranked.map(|(rank, record)| Point { record, rank: Some(rank) });
        let failed = group.failures().into_iter().map(|(record, _)| record);
        let others = ranking.unranked.iter().copied().chain(failed);
        let others = others.map(|record| Point { record, rank: None });
        let mut points: HashMap<Identity<'a>, Vec<Point<'a>>> = HashMap::new();
        for point in ranked.chain(others) {
            points.entry(Identity::of(point.record)).or_default().push(point);
        }
        Self { scene: group.scene, image_size: group.image_size, points }
    }

    /// Returns the points of both strategies at each local size that both have.
    fn at_common_sizes(&self, pair: &Pair<'a>) -> Vec<[Point<'a>; 2]> {
        let of = |strategy: Identity<'a>| self.points.get(&strategy).map(Vec::as_slice).unwrap_or_default();
        let [first, second] = pair.strategies.map(of);
        let mut both = Vec::new();
        for one in first {
            let has_its_size = |other: &&Point<'a>| other.record.local_size == one.record.local_size;
            both.extend(second.iter().find(has_its_size).map(|other| [*one, *other]));
        }
        both
    }

    /// Returns true if both strategies have a time at the same local size, with or without a rank.
    pub(super) fn has_times_of(&self, pair: &Pair<'a>) -> bool {
        let has_time = |point: &Point<'a>| median(point.record).is_some();
        self.at_common_sizes(pair).iter().any(|both| both.iter().all(has_time))
    }

    /// Compares two strategies at the same local size: of the local sizes at which both have a rank, the one at which
    /// the faster of the two is fastest.
    pub(super) fn compare(&self, pair: &Pair<'a>) -> Compared {
        let points = self.at_common_sizes(pair);
        let ranked = points.iter().filter_map(|[one, other]| Some((one.rank?.min(other.rank?), one, other)));
        let best = ranked.min_by_key(|(rank, ..)| *rank);
        let known = best.and_then(|(_, one, other)| Some((ratio(one.record, other.record)?, one.record)));
        match known {
            Some((ratio, one)) => {
                Compared::Times { ratio, effect: Effect::of(ratio), local_size: one.local_size }
            }
            None => Compared::Nothing { why: self.why_nothing(pair, &points) },
        }
    }

    /// Returns the reason why two strategies have no ratio. `points` are their points at common local sizes.
    fn why_nothing(&self, pair: &Pair<'a>, points: &[[Point<'a>; 2]]) -> String {
        let unranked = points.iter().flatten().find(|point| point.rank.is_none());
        let absent = pair.strategies.iter().find(|strategy| !self.points.contains_key(*strategy));
        match (unranked, absent) {
            (Some(point), _) => why_unranked(point.record),
            (None, Some(strategy)) => format!("there is no point of {}", strategy.name),
            (None, None) => "the two strategies have no local size in common".to_owned(),
        }
    }
}

/// Returns a point's title and the reason why it has no rank.
fn why_unranked(record: &Record) -> String {
    let failed = || format!("{}: {}", record.outcome.name(), first_line(record));
    let why = not_enough(record).unwrap_or_else(failed);
    format!("{}{}: {why}", record.name, record.at_local_size())
}
