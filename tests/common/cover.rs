//! A pairwise cover: strategies that together have every pair of values of two axes.

use raycl::strategy::{AXES, PRESETS, Strategy};
use std::collections::HashSet;

/// Two values of different axes that at least one strategy must have, each as (axis, value).
type Pair = ((&'static str, &'static str), (&'static str, &'static str));

fn pairs(strategy: &Strategy) -> HashSet<Pair> {
    let axes = strategy.axes();
    let pair = |i: usize| axes[i + 1..].iter().map(move |&other| (i, other));
    (0..axes.len()).flat_map(pair).map(|(i, other)| (axes[i], other)).collect()
}

/// Returns every strategy that differs from a preset in at most two values, except strategies with values that exclude
/// each other.
fn candidates() -> Vec<Strategy> {
    let mut all: HashSet<Strategy> = PRESETS.iter().map(|preset| preset.strategy).collect();
    for _ in 0..2 {
        for strategy in all.clone() {
            for axis in AXES {
                for (value, _) in axis.values() {
                    let mut changed = strategy;
                    changed.set(axis.name, value).expect("a value of an axis");
                    if changed.contradiction().is_none() {
                        all.insert(changed);
                    }
                }
            }
        }
    }
    let mut sorted: Vec<Strategy> = all.into_iter().collect();
    sorted.sort_by_key(|strategy| strategy.to_string());
    sorted
}

/// Returns strategies that together have every pair of values that occurs in a candidate. Adds, again and again, the
/// candidate with the most new pairs.
pub fn pairwise_cover() -> Vec<Strategy> {
    let candidates: Vec<_> = candidates().into_iter().map(|strategy| (strategy, pairs(&strategy))).collect();
    let mut open: HashSet<Pair> = candidates.iter().flat_map(|(_, pairs)| pairs.iter().copied()).collect();
    let mut cover = Vec::new();
    while !open.is_empty() {
        let most = |(_, pairs): &&(Strategy, HashSet<Pair>)| pairs.intersection(&open).count();
        let Some((strategy, pairs)) = candidates.iter().max_by_key(most) else { break };
        cover.push(*strategy);
        open.retain(|pair| !pairs.contains(pair));
    }
    cover
}
