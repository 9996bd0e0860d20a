//! A pairwise cover: strategies that together have every pair of values of two axes (such as a layout and a
//! ray-triangle test).

use raycl::strategy::{AXES, PRESETS, Strategy};
use std::collections::HashSet;

/// A value of a strategy's axis: the names of the axis and of the value.
type Value = (&'static str, &'static str);

/// Returns every value of every axis of strategies. A value's number is its position in this list.
fn values() -> Vec<Value> {
    let of_axis = AXES.iter().flat_map(|axis| axis.values().into_iter().map(|(value, _)| (axis.name, value)));
    of_axis.collect()
}

/// Returns all pairs of a strategy's values on two of its axes. Each pair is a number below the square of the
/// number of `values`, so that the search for a cover compares numbers instead of names.
fn pairs(strategy: &Strategy, values: &[Value]) -> Vec<usize> {
    let number = |own: Value| values.iter().position(|value| *value == own).expect("a value of an axis");
    let own: Vec<usize> = strategy.axes().into_iter().map(number).collect();
    let pairs_of = |i: usize| {
        let first = own[i] * values.len();
        own[i + 1..].iter().map(move |second| first + second)
    };
    (0..own.len()).flat_map(pairs_of).collect()
}

/// Returns every strategy that differs from a preset in at most two values, except strategies with values that exclude
/// each other.
fn candidates(values: &[Value]) -> Vec<Strategy> {
    let mut all: HashSet<Strategy> = PRESETS.iter().map(|preset| preset.strategy).collect();
    // `tried` has the strategies that need no second look: two changes lead to the same strategy in either
    // order, and it takes long to find out whether a strategy's values exclude each other.
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

/// Returns strategies that together have every pair of values that occurs in a candidate. Adds, again and again, the
/// candidate with the most new pairs.
pub fn pairwise_cover() -> Vec<Strategy> {
    let values = values();
    let candidates = candidates(&values).into_iter().map(|strategy| (strategy, pairs(&strategy, &values)));
    let candidates: Vec<(Strategy, Vec<usize>)> = candidates.collect();
    // For each pair of values, true if a candidate has the pair, and no strategy of the cover has it yet.
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
