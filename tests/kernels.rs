//! Every preset at every local size, and a pairwise cover of all axes, against the reference on PoCL.
#![allow(missing_docs, reason = "a test binary has no documentation")]

mod common;

use common::cover::pairwise_cover;
use common::{Stand, scene};
use raycl::strategy::{PRESETS, Strategy, Traversal, Vectors, Width, preset};

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
    // Shared tiles have one local size, whatever is wished.
    let strategies: Vec<_> =
        PRESETS.iter().map(|preset| preset.strategy).filter(|strategy| !strategy.shares_tiles()).collect();
    let points = strategies.iter().flat_map(|&s| local_sizes.iter().map(move |&local| (s, local)));
    let checked = all_agree(&mut stand, points.clone());
    // One scene of six triangles fits any device; only vectors in __local memory at 32x32 may not, and the rays of
    // more than 64 tiles, of 60 KiB each, on the stack of a thread.
    let may_not_fit = |(strategy, [x, y]): &(Strategy, [u32; 2])| match strategy.traversal {
        Traversal::Tile => x * y > 64,
        _ => strategy.vectors == Vectors::Local && x * y == 1024,
    };
    assert!(checked >= points.filter(|point| !may_not_fit(point)).count(), "{checked}");
}

/// As on a GPU, whose vectors are made of scalars: edges are asked one by one, masks reduced by trees of operations.
#[test]
fn presets_of_vectors_that_no_built_in_reduces() {
    let mut stand = Stand::new(scene("still-life.toml"), SIZE);
    stand.builtins.reduce = false;
    let vectors = PRESETS.iter().map(|preset| preset.strategy);
    let vectors = vectors.filter(|s| s.tests_every_triangle() && s.width != Width::W1);
    let checked = all_agree(&mut stand, vectors.clone().map(|strategy| (strategy, [4, 2])));
    assert_eq!(checked, vectors.count());
    assert_eq!(checked, 6);
}

#[test]
fn presets_that_share_tiles() {
    let mut stand = Stand::new(scene("terrain.toml"), SIZE);
    let shared = || PRESETS.iter().map(|preset| preset.strategy).filter(Strategy::shares_tiles);
    let checked = all_agree(&mut stand, shared().map(|strategy| (strategy, [32, 1])));
    assert_eq!(checked, shared().count());
    assert_eq!(checked, 2);
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
