//! A pairwise cover: strategies that together have every pair of values of two axes (such as a layout and a
//! ray-triangle test) that occurs in a preset, or in a strategy that differs from a preset by at most two values.

use raycl::strategy::{AXES, PRESETS, Strategy};
use std::collections::HashSet;

/// A value of a strategy's axis: the names of the axis and of the value.
type Value = (&'static str, &'static str);

/// Returns every value of every axis of strategies. The number of a value is its position in the returned
/// list.
fn values() -> Vec<Value> {
    let of_axis = AXES.iter().flat_map(|axis| axis.values().into_iter().map(|(value, _)| (axis.name, value)));
    of_axis.collect()
}

/// Returns all pairs of a strategy's values on two of its axes. Each pair is encoded as one number, below the
/// square of the number of `values`. The search for strategies with all pairs therefore compares numbers
/// instead of names.
fn pairs(strategy: &Strategy, values: &[Value]) -> Vec<usize> {
    let number = |own: Value| values.iter().position(|value| *value == own).expect("a value of an axis");
    let own: Vec<usize> = strategy.axes().into_iter().map(number).collect();
    let pairs_of = |i: usize| {
        let first = own[i] * values.len();
        own[i + 1..].iter().map(move |second| first + second)
    };
    (0..own.len()).flat_map(pairs_of).collect()
}

/// Returns all strategies to which at most two changes of a value lead from a preset. After each change, no values of
/// the strategy may exclude each other.
fn candidates(values: &[Value]) -> Vec<Strategy> {
    let mut all: HashSet<Strategy> = PRESETS.iter().map(|preset| preset.strategy).collect();
    // `tried` has the strategies that were already checked. Two changes lead to the same strategy in either
    // order, and it takes long to check whether a strategy's values exclude each other.
    let mut tried = all.clone();
    for _ in 0..2 {
        for strategy in all.clone() {
            for (axis, value) in values {
                let mut changed = strategy;
                changed.set(axis, value).expect("a value of an axis");
                if tried.insert(changed) && changed.contradiction().is_none() {
                    all.insert(changed);
                }
            }
        }
    }
    let mut sorted: Vec<Strategy> = all.into_iter().collect();
    sorted.sort_by_cached_key(|strategy| strategy.to_string());
    sorted
}

/// Returns a set of strategies, the cover: every pair of two axes' values that occurs in any of the
/// candidates also occurs in the cover. Each step adds the candidate with the most pairs that the cover does
/// not have yet.
pub fn pairwise_cover() -> Vec<Strategy> {
    let values = values();
    let candidates = candidates(&values).into_iter().map(|strategy| (strategy, pairs(&strategy, &values)));
    let candidates: Vec<(Strategy, Vec<usize>)> = candidates.collect();
    // An element for each pair of values: true if the pair occurs in a candidate, but not yet in the cover.
    let mut open = vec![false; values.len() * values.len()];
    candidates.iter().flat_map(|(_, pairs)| pairs).for_each(|&pair| open[pair] = true);
    let mut cover = Vec::new();
    while open.contains(&true) {
        let most = |(_, pairs): &&(Strategy, Vec<usize>)| pairs.iter().filter(|&&pair| open[pair]).count();
        let Some((strategy, pairs)) = candidates.iter().max_by_key(most) else { break };
        cover.push(*strategy);
        pairs.iter().for_each(|&pair| open[pair] = false);
    }
    cover
}
