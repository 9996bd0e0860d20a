//! Finds pairs of strategies that differ in a single axis.

use crate::record::axes::axes;
use crate::record::types::Record;
use std::collections::HashSet;

/// The properties by which the strategies of a run are told apart.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Identity<'a> {
    /// The strategy's name.
    pub(super) name: &'a str,
    /// The strategy's axes with their values, sorted. If an axis is newer than the record, `axes` contains
    /// the axis with the value that describes what raycl did before the axis existed.
    axes: Vec<(&'a str, &'a str)>,
    /// The label of the folder of the strategy's kernels, if two folders of kernels are compared.
    kernels_of: Option<&'a str>,
}

impl<'a> Identity<'a> {
    /// Returns the properties by which a record's strategy is distinguished from other strategies.
    pub(super) fn of(record: &'a Record) -> Self {
        let mut axes: Vec<_> = axes(&record.strategy).collect();
        axes.sort_unstable();
        Self { name: &record.name, axes, kernels_of: record.kernels_of.as_deref() }
    }
}

/// Two strategies that differ in a single axis.
pub(super) struct Pair<'a> {
    /// The axis in which the two strategies differ.
    pub(super) axis: &'a str,
    /// The value that the axis has in each of the two strategies.
    pub(super) values: [&'a str; 2],
    /// The two strategies.
    pub(super) strategies: [Identity<'a>; 2],
}

/// Returns each pair of strategies that differ in a single axis. In a run with two folders of kernels, both
/// strategies of a pair have the kernels of the same folder. The two strategies of a pair, and the pairs
/// themselves, are in the order of the strategies' first records.
pub(super) fn pairs(records: &[Record]) -> Vec<Pair<'_>> {
    let mut seen = HashSet::new();
    let mut strategies: Vec<Identity<'_>> = Vec::new();
    for record in records.iter().filter(|record| !record.is_baseline()) {
        let identity = Identity::of(record);
        if seen.insert(identity.clone()) {
            strategies.push(identity);
        }
    }
    let mut pairs = Vec::new();
    for (index, first) in strategies.iter().enumerate() {
        pairs.extend(strategies[index + 1..].iter().filter_map(|second| Pair::of(first, second)));
    }
    pairs
}

impl<'a> Pair<'a> {
    /// Makes a pair of two strategies. Returns `None` if the strategies differ in no axis or in several axes, or
    /// if their kernels come from different folders.
    fn of(first: &Identity<'a>, second: &Identity<'a>) -> Option<Self> {
        if first.kernels_of != second.kernels_of || first.axes.len() != second.axes.len() {
            return None;
        }
        let both = first.axes.iter().zip(&second.axes);
        let mut different = both.filter(|(before, after)| before != after);
        let (&(axis, from), &(other, to)) = different.next()?;
        let is_only_one = different.next().is_none() && axis == other;
        is_only_one.then(|| Self { axis, values: [from, to], strategies: [first.clone(), second.clone()] })
    }
}
