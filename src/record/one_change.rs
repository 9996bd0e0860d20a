//! Compares strategies that differ in a single axis.

mod column;
mod pairs;

use super::ranking::TIE;
use super::summary::Group;
use super::types::{HOST, Record};
use crate::entry::entry;
use crate::measure::Interval;
use crate::numbers::{by, significant};
use crate::words::counted_are;
use column::Column;
use pairs::{Pair, pairs};

/// The largest number of changes of a single axis (pairs of strategies) that are shown for a device.
const MOST: usize = 40;

/// The explanation of the tables of changes, for every page that has such tables.
pub(crate) const HOW_TO_READ_CHANGES: &str = "Each row compares two strategies that differ in a single axis. \
    A cell says how many times as fast the second strategy is as the first, with the ratio's 95% interval. Each \
    strategy has the local size at which it is fastest; the cell names both sizes if they differ. \"Tie\" means \
    that the samples do not show that one of the two takes more than 1% longer; \"-\" means that there is no ratio. \
    The changes with the largest effects come first. About one of twenty intervals misses the true ratio.";

/// The comparisons, on one device, of strategies that differ in a single axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Changes<'a> {
    /// The device's name.
    pub device: &'a str,
    /// The scenes with their image sizes in pixels (across, down). [`Change::results`] has a result for each
    /// of these columns.
    pub columns: Vec<(&'a str, [u32; 2])>,
    /// At most `MOST` changes, those with the largest effects, sorted by effect from the largest down.
    pub rows: Vec<Change<'a>>,
    /// The number of further changes, which `rows` does not contain.
    pub left_out: usize,
}

/// A change of a single axis: two strategies that are equal in all other axes, in the order of the records.
#[derive(Clone, Debug, PartialEq)]
pub struct Change<'a> {
    /// The axis whose value changes.
    pub axis: &'a str,
    /// The value that the axis has in each of the two strategies.
    pub values: [&'a str; 2],
    /// The names of the two strategies, in the order of the records.
    pub names: [&'a str; 2],
    /// The result of the change for each scene and image size.
    pub results: Vec<Compared>,
}

/// The result of comparing two strategies in a group of points (one scene at one image size on one device).
#[derive(Clone, Debug, PartialEq)]
pub enum Compared {
    /// The ratio of the strategies' times is known, since both strategies have a point with a rank.
    Times {
        /// The first strategy's time divided by the second strategy's time: how many times as fast the second
        /// strategy is as the first.
        ratio: Interval,
        /// What the ratio shows about the second strategy.
        effect: Effect,
        /// The local size at which each of the two strategies is fastest.
        local_sizes: [Option<[u32; 2]>; 2],
    },
    /// The ratio of the strategies' times is unknown.
    Nothing {
        /// The reason why the ratio of the strategies' times is unknown.
        why: String,
    },
}

/// What the ratio of two times shows about the second strategy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// The second strategy is faster: the first strategy takes more than 1% longer.
    Faster,
    /// The second strategy is slower: it takes more than 1% longer than the first strategy.
    Slower,
    /// The samples do not show that either strategy takes more than 1% longer.
    Tie,
}

impl Effect {
    /// Decides what the ratio of the first strategy's time to the second strategy's time shows. Two
    /// strategies tie by the same rule by which points tie with the fastest point of a group.
    fn of(ratio: Interval) -> Self {
        if ratio.low > 1.0 + TIE {
            Self::Faster
        } else if ratio.high < 1.0 / (1.0 + TIE) {
            Self::Slower
        } else {
            Self::Tie
        }
    }

    /// Returns the effect as a word, such as "faster" or "tie".
    pub fn name(self) -> &'static str {
        match self {
            Self::Faster => "faster",
            Self::Slower => "slower",
            Self::Tie => "tie",
        }
    }
}

impl Changes<'_> {
    /// Returns the image size of all columns; `None` if the columns have several image sizes, or if there are no
    /// columns.
    pub fn image_size(&self) -> Option<[u32; 2]> {
        let (_, first) = *self.columns.first()?;
        self.columns.iter().all(|(_, size)| *size == first).then_some(first)
    }

    /// Returns the columns' names: the scene and, if the columns have several image sizes, the image size.
    pub fn column_names(&self) -> Vec<String> {
        let is_one_size = self.image_size().is_some();
        let name = |(scene, [across, down]): &(&str, [u32; 2])| match is_one_size {
            true => (*scene).to_owned(),
            false => format!("{scene} {across}x{down}"),
        };
        self.columns.iter().map(name).collect()
    }

    /// Returns a sentence that says how many changes are left out of the table; `None` if the table has all
    /// changes.
    pub fn note(&self) -> Option<String> {
        let are = counted_are(self.left_out, "further change");
        let note = || format!("{are} left out: only the {MOST} with the largest effects are shown.");
        (self.left_out > 0).then(note)
    }
}

impl Change<'_> {
    /// Returns the axis and its two values, such as "vectors: heap → local".
    pub fn what(&self) -> String {
        let [from, to] = self.values;
        format!("{}: {from} → {to}", self.axis)
    }

    /// Returns the names of the two strategies, such as "naive → local-vectors".
    pub fn whose(&self) -> String {
        self.names.join(" → ")
    }

    /// Returns the largest effect that this change of an axis has in any group of points. The effect is the
    /// absolute value of the ratio's logarithm; for a tie or an unknown ratio, the effect is 0.
    fn largest_effect(&self) -> f64 {
        let effect = |result: &Compared| match result {
            Compared::Times { effect: Effect::Tie, .. } | Compared::Nothing { .. } => 0.0,
            Compared::Times { ratio, .. } => ratio.middle.ln().abs(),
        };
        self.results.iter().map(effect).fold(0.0, f64::max)
    }
}

/// Formats the local sizes of two points: "8 x 8 → 4 x 4" if the sizes differ, and "8 x 8" if the sizes are equal or
/// only one point has a local size. Returns an empty text if neither point has a local size.
pub(crate) fn both_sizes([first, second]: [Option<[u32; 2]>; 2]) -> String {
    match (first, second) {
        (Some(first), Some(second)) if first != second => format!("{} → {}", by(first), by(second)),
        (first, second) => first.or(second).map_or(String::new(), by),
    }
}

/// Formats a ratio with its 95% interval, such as "1.32 (1.21 to 1.44)".
pub(crate) fn with_interval(ratio: Interval) -> String {
    let [middle, low, high] = [ratio.middle, ratio.low, ratio.high].map(|part| significant(part, 3));
    format!("{middle} ({low} to {high})")
}

/// Returns, for each device, the changes from one strategy to another that differs in a single axis. A change is
/// returned only if both strategies have times in at least one group of the device. Devices without changes, and the
/// host, are left out. `groups` are the groups of `records`. The order of `records` decides which of the two strategies
/// of a change comes first.
pub(crate) fn changes<'a>(records: &'a [Record], groups: &[Group<'a>]) -> Vec<Changes<'a>> {
    let pairs = pairs(records);
    if pairs.is_empty() {
        return Vec::new();
    }
    let mut devices: Vec<(&'a str, Vec<Column<'a>>)> = Vec::new();
    for group in groups.iter().filter(|group| group.device != HOST) {
        let new = || (group.device, Vec::new());
        entry(&mut devices, |(device, _)| *device == group.device, new).1.push(Column::of(group));
    }
    devices.iter().filter_map(|(device, columns)| on_device(device, columns, &pairs)).collect()
}

fn on_device<'a>(device: &'a str, columns: &[Column<'a>], pairs: &[Pair<'a>]) -> Option<Changes<'a>> {
    let timed = pairs.iter().filter(|pair| columns.iter().any(|column| column.has_times_of(pair)));
    let mut rows: Vec<Change<'a>> = timed.map(|pair| change(pair, columns)).collect();
    // The sort is stable, so changes with equal effects stay in the order of the records.
    rows.sort_by(|one, other| other.largest_effect().total_cmp(&one.largest_effect()));
    let left_out = rows.len().saturating_sub(MOST);
    rows.truncate(MOST);
    let columns = columns.iter().map(|column| (column.scene, column.image_size)).collect();
    (!rows.is_empty()).then_some(Changes { device, columns, rows, left_out })
}

fn change<'a>(pair: &Pair<'a>, columns: &[Column<'a>]) -> Change<'a> {
    Change {
        axis: pair.axis,
        values: pair.values,
        names: pair.strategies.each_ref().map(|strategy| strategy.name),
        results: columns.iter().map(|column| column.compare(pair)).collect(),
    }
}

#[cfg(test)]
mod tests;
