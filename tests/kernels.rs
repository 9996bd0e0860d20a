//! Every preset at every local size, and a pairwise cover of all axes, against the reference on PoCL.
#![allow(missing_docs, reason = "a test binary has no documentation")]

mod common;

use common::{Stand, scene};
use raycl::strategy::{AXES, PRESETS, Strategy, preset};
use std::collections::HashSet;

/// The paper's local sizes and some that divide nothing.
const LOCAL_SIZES: [[u32; 2]; 13] = [
    [1, 1],
    [2, 2],
    [4, 4],
    [6, 6],
    [8, 8],
    [10, 10],
    [12, 12],
    [14, 14],
    [16, 16],
    [32, 32],
    [64, 1],
    [32, 2],
    [3, 5],
];

/// Neither side is a multiple of a local size or of a block of rays.
const SIZE: [u32; 2] = [45, 29];

/// Checks strategies and panics with every one that is wrong, not only the first.
fn all_agree(stand: &mut Stand, points: impl IntoIterator<Item = (Strategy, [u32; 2])>) -> usize {
    let mut wrong = Vec::new();
    let mut checked = 0;
    for (strategy, local_size) in points {
        match stand.check(&strategy, local_size) {
            Ok(verdict) if verdict.ok => checked += 1,
            Ok(verdict) => wrong.push(format!("{strategy} at {local_size:?}: {:?}", verdict.reason)),
            Err(infeasible) => assert!(infeasible.contains('>'), "no arithmetic in '{infeasible}'"),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    checked
}

fn presets_agree_at(local_sizes: &[[u32; 2]]) {
    let mut stand = Stand::new(scene("pyramid-lower.toml"), SIZE);
    let points = PRESETS.iter().flat_map(|p| local_sizes.iter().map(|&local| (p.strategy, local)));
    let checked = all_agree(&mut stand, points);
    // One scene of six triangles fits any device; only vectors in __local memory at 32x32 may not.
    assert!(checked + 4 >= PRESETS.len() * local_sizes.len(), "{checked}");
}

#[test]
fn every_preset_at_small_local_sizes() {
    presets_agree_at(&LOCAL_SIZES[..4]);
}

#[test]
fn every_preset_at_middling_local_sizes() {
    presets_agree_at(&LOCAL_SIZES[4..8]);
}

#[test]
fn every_preset_at_large_and_odd_local_sizes() {
    presets_agree_at(&LOCAL_SIZES[8..]);
}

/// A pair of axis values that some strategy must have.
type Pair = ((&'static str, &'static str), (&'static str, &'static str));

fn pairs(strategy: &Strategy) -> HashSet<Pair> {
    let axes = strategy.axes();
    let pair = |i: usize| axes[i + 1..].iter().map(move |&other| (i, other));
    (0..axes.len()).flat_map(pair).map(|(i, other)| (axes[i], other)).collect()
}

/// Every strategy that is one or two values away from a preset and makes sense.
fn candidates() -> Vec<Strategy> {
    let mut all: HashSet<Strategy> = PRESETS.iter().map(|preset| preset.strategy).collect();
    for _ in 0..2 {
        for strategy in all.clone() {
            for axis in AXES {
                for (value, _) in axis.values {
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

/// Strategies that together have every pair of values that any candidate has: greedily the one with most new pairs.
fn pairwise_cover() -> Vec<Strategy> {
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

#[test]
fn a_pairwise_cover_of_all_axes() {
    let cover = pairwise_cover();
    assert!(cover.len() > 30, "only {} strategies", cover.len());
    let mut stand = Stand::new(scene("still-life.toml"), SIZE);
    let locals = [[4, 4], [8, 2], [5, 3], [16, 1]];
    let points = cover.iter().enumerate().map(|(i, &strategy)| (strategy, locals[i % locals.len()]));
    let checked = all_agree(&mut stand, points);
    assert_eq!(checked, cover.len());
}

#[test]
fn local_size_and_memory_change_no_bit_of_the_papers_kernel() {
    let stand = Stand::new(scene("figure-4.toml"), SIZE);
    let naive = preset("naive").expect("a preset").strategy;
    let expected = stand.cast(&naive, [8, 8]).expect("an image");
    for name in ["naive-scratch", "private", "local-vectors", "local-triangles", "compounded"] {
        let strategy = preset(name).expect("a preset").strategy;
        for local_size in [[1, 1], [7, 3], [16, 16]] {
            assert_eq!(stand.cast(&strategy, local_size).as_ref(), Ok(&expected), "{name} at {local_size:?}");
        }
    }
}
