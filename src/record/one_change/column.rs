//! Compares two strategies in a group of points, which is one scene at one image size on one device.

use super::pairs::{Identity, Pair};
use super::{Compared, Effect};
use crate::record::point_times::median;
use crate::record::ratios::ratio;
use crate::record::summary::{Group, first_line, not_enough};
use crate::record::types::Record;
use std::collections::HashMap;

/// The points of a group (one scene at one image size on one device), by strategy.
pub(super) struct Column<'a> {
    /// The scene's name.
    pub(super) scene: &'a str,
    /// Image size in pixels: across, down.
    pub(super) image_size: [u32; 2],
    /// The fastest point of each strategy that has a point with a rank.
    ranked: HashMap<Identity<'a>, &'a Record>,
    /// For each strategy that has points without a rank, one of these points; if possible, a point with a
    /// time.
    others: HashMap<Identity<'a>, &'a Record>,
}

impl<'a> Column<'a> {
    /// Ranks the points of a group. For each strategy, finds the fastest point with a rank, and a point without a rank
    /// (if possible, one with a time).
    pub(super) fn of(group: &Group<'a>) -> Self {
        let ranking = group.ranking();
        let failed = group.failures().into_iter().map(|(record, _)| record);
        let mut ranked: HashMap<Identity<'a>, &'a Record> = HashMap::new();
        let mut others: HashMap<Identity<'a>, &'a Record> = HashMap::new();
        for record in ranking.ranked.iter().copied() {
            ranked.entry(Identity::of(record)).or_insert(record);
        }
        for record in ranking.unranked.iter().copied().chain(failed) {
            others.entry(Identity::of(record)).or_insert(record);
        }
        Self { scene: group.scene, image_size: group.image_size, ranked, others }
    }

    /// Returns true if both strategies have a time, with or without a rank.
    pub(super) fn has_times_of(&self, pair: &Pair<'a>) -> bool {
        let has_time = |strategy| {
            let point = self.ranked.get(strategy).or_else(|| self.others.get(strategy));
            point.is_some_and(|record| median(record).is_some())
        };
        pair.strategies.iter().all(has_time)
    }

    /// Compares two strategies, each at the local size at which it is fastest.
    pub(super) fn compare(&self, pair: &Pair<'a>) -> Compared {
        let [first, second] = [0, 1].map(|index| self.ranked.get(&pair.strategies[index]));
        let known =
            first.zip(second).and_then(|(first, second)| Some((ratio(first, second)?, first, second)));
        match known {
            Some((ratio, first, second)) => {
                let local_sizes = [first.local_size, second.local_size];
                Compared::Times { ratio, effect: Effect::of(ratio), local_sizes }
            }
            None => Compared::Nothing { why: self.why_nothing(pair) },
        }
    }

    /// Returns the reason why the ratio of two strategies' times cannot be computed.
    fn why_nothing(&self, pair: &Pair<'a>) -> String {
        match pair.strategies.iter().find(|strategy| !self.ranked.contains_key(*strategy)) {
            Some(strategy) => match self.others.get(strategy) {
                Some(record) => why_unranked(record),
                None => format!("there is no point of {}", strategy.name),
            },
            None => "the times of the two strategies cannot be compared".to_owned(),
        }
    }
}

/// Returns a point's title and the reason why it has no rank.
fn why_unranked(record: &Record) -> String {
    let failed = || format!("{}: {}", record.outcome.name(), first_line(record));
    let why = not_enough(record).unwrap_or_else(failed);
    format!("{}{}: {why}", record.name, record.at_local_size())
}
