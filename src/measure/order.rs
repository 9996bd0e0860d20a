//! The shuffled order in which the points of a group are sampled.

use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;

/// Returns the shuffled order in which `n` points are sampled in a round. The order depends only on `n`, the
/// round and the seed. The points are shuffled anew for each round, so that the drift of the machine affects
/// all points alike, and does not look like a difference between points.
pub fn round_order(n: usize, round: u64, seed: u64) -> Vec<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(round);
    let mut order: Vec<usize> = (0..n).collect();
    order.shuffle(&mut rng);
    order
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn rounds_and_seeds_differ_and_repeat() {
        let order = round_order(20, 0, 1);
        assert_eq!(order, round_order(20, 0, 1));
        assert_ne!(order, round_order(20, 1, 1));
        assert_ne!(order, round_order(20, 0, 2));
    }

    proptest! {
        #[test]
        fn every_point_comes_once(n in 0..50_usize, round: u64, seed: u64) {
            let mut order = round_order(n, round, seed);
            order.sort_unstable();
            prop_assert_eq!(order, (0..n).collect::<Vec<_>>());
        }
    }
}
