//! Finds the strategies that differ in a single axis.

use crate::record::axes::axes;
use crate::record::types::Record;
use std::collections::{BTreeMap, HashSet};

/// What distinguishes the strategies of records.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Identity<'a> {
    /// The strategy's name.
    pub(super) name: &'a str,
    /// The strategy's axes with their values, as text.
    strategy: &'a str,
    /// The folder of the strategy's kernels, if two folders of kernels are compared.
    kernels_of: Option<&'a str>,
}

impl<'a> Identity<'a> {
    /// Returns the identity of a record's strategy.
    pub(super) fn of(record: &'a Record) -> Self {
        Self { name: &record.name, strategy: &record.strategy, kernels_of: record.kernels_of.as_deref() }
    }
}

/// A strategy, and the value of each of its axes.
type Strategy<'a> = (Identity<'a>, BTreeMap<&'a str, &'a str>);

/// Two strategies that differ in a single axis.
pub(super) struct Pair<'a> {
    /// The axis.
    pub(super) axis: &'a str,
    /// The axis's value in each strategy.
    pub(super) values: [&'a str; 2],
    /// The strategies.
    pub(super) strategies: [Identity<'a>; 2],
}

/// Returns each pair of strategies that differ in a single axis and have kernels of the same folder. In a pair, and
/// among the pairs, the strategies have the order of their first records.
pub(super) fn pairs(records: &[Record]) -> Vec<Pair<'_>> {
    let mut seen = HashSet::new();
    let mut strategies: Vec<Strategy<'_>> = Vec::new();
    for record in records.iter().filter(|record| !record.is_baseline()) {
        let identity = Identity::of(record);
        if seen.insert(identity) {
            strategies.push((identity, axes(&record.strategy).collect()));
        }
    }
    let mut pairs = Vec::new();
    for (index, first) in strategies.iter().enumerate() {
        pairs.extend(strategies[index + 1..].iter().filter_map(|second| Pair::of(first, second)));
    }
    pairs
}

impl<'a> Pair<'a> {
    /// Returns `None` if the strategies do not differ in exactly one axis, or if their kernels' folders differ.
    fn of((first, before): &Strategy<'a>, (second, after): &Strategy<'a>) -> Option<Self> {
        if first.kernels_of != second.kernels_of || !before.keys().eq(after.keys()) {
            return None;
        }
        let both = before.iter().zip(after.values());
        let mut different = both.filter(|((_, from), to)| from != to);
        let ((&axis, &from), &to) = different.next()?;
        let is_only_one = different.next().is_none();
        is_only_one.then_some(Self { axis, values: [from, to], strategies: [*first, *second] })
    }
}
