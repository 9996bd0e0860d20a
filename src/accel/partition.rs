//! Sorts a node's primitives in place, by the side of a cut on which they lie. A second buffer would take 32
//! more bytes per triangle while a tree is built.

use super::bins::{Bins, Boxed, Cut, Slicer};
use super::bounds::Primitive;
use rayon::prelude::*;
use std::ops::Range;

/// Moves the items left of the cut before all other items, and returns the number of items left of the cut.
pub(super) fn partition<const N: usize>(items: &mut [impl Boxed], slicer: &Slicer<N>, cut: &Cut) -> usize {
    match cut.axis {
        0 => partition_on::<N, 0>(items, slicer, cut.slice),
        1 => partition_on::<N, 1>(items, slicer, cut.slice),
        _ => partition_on::<N, 2>(items, slicer, cut.slice),
    }
}

/// Moves the items on the left side of the cut to the front, and returns their number. The function takes one item
/// after another, the item `at`. It exchanges this item with the item `left`, the first of the previous items that lies
/// on the right side of the cut. If the item `at` lies on the right side, too, the exchange reorders only items on the
/// right side. The function does not skip the items on the right side, because the processor would often mispredict a
/// branch that skips items.
///
/// ```text
///   0         left        at            the end
///   | left side | right side | not yet seen |
/// ```
fn partition_on<const N: usize, const AXIS: usize>(
    items: &mut [impl Boxed],
    slicer: &Slicer<N>,
    slice: usize,
) -> usize {
    let mut left = 0;
    for at in 0..items.len() {
        let is_left = slicer.slice::<AXIS>(items[at].primitive()) < slice;
        items.swap(left, at);
        left += usize::from(is_left);
    }
    left
}

/// Moves the primitives left of the cut to the front, like [`partition`], but on all cores. First, each chunk
/// of `chunk` primitives is partitioned by itself. `bins` has the bins of each chunk, which say how many of
/// the chunk's primitives lie left of the cut. After all chunks are partitioned, primitives that lie on the
/// wrong side of the whole node's cut exchange their positions.
///
/// ```text
///   chunk 0    chunk 1     chunk 2
///   L L L R R  L L R R R | L L L L L    L, R: belongs to the left or the right side; |: the cut
///         ^ ^      ^ ^ ^   ^ ^ ^ ^ ^    the two R and the three R exchange their positions with the five L
/// ```
pub(super) fn partition_chunks<const N: usize>(
    primitives: &mut [Primitive],
    chunk: usize,
    bins: &[Bins<N>],
    slicer: &Slicer<N>,
    cut: &Cut,
) {
    primitives.par_chunks_mut(chunk).for_each(|primitives| {
        partition(primitives, slicer, cut);
    });
    let (mut rights, mut lefts) = (Vec::new(), Vec::new());
    for (number, bins) in bins.iter().enumerate() {
        let start = number * chunk;
        let end = primitives.len().min(start + chunk);
        let middle = start + bins.count_below(cut.axis, cut.slice);
        rights.push(middle.min(cut.left_count)..end.min(cut.left_count));
        lefts.push(start.max(cut.left_count)..middle.max(cut.left_count));
    }
    let (before, after) = primitives.split_at_mut(cut.left_count);
    let [rights, lefts] = [pieces(before, 0, &rights), pieces(after, cut.left_count, &lefts)];
    pairs(rights, lefts).into_par_iter().for_each(|[right, left]| right.swap_with_slice(left));
}

/// Returns the parts of `primitives` that lie in `ranges`. The ranges consist of indices in the whole node,
/// and are in ascending order. `first` is the index of the first element of `primitives` in the whole node.
fn pieces<'a>(
    mut primitives: &'a mut [Primitive],
    first: usize,
    ranges: &[Range<usize>],
) -> Vec<&'a mut [Primitive]> {
    let mut index = first;
    let mut pieces = Vec::new();
    for range in ranges.iter().filter(|range| !range.is_empty()) {
        let (piece, rest) = primitives.split_at_mut(range.start - index).1.split_at_mut(range.len());
        pieces.push(piece);
        (primitives, index) = (rest, range.end);
    }
    pieces
}

/// Cuts two lists of pieces, whose total lengths are equal, into pairs. The two pieces of a pair are equally long.
fn pairs<'a>(
    one: Vec<&'a mut [Primitive]>,
    other: Vec<&'a mut [Primitive]>,
) -> Vec<[&'a mut [Primitive]; 2]> {
    let (mut one, mut other) = (one.into_iter(), other.into_iter());
    let (mut left, mut right): (&mut [Primitive], &mut [Primitive]) = (&mut [], &mut []);
    let mut pairs = Vec::new();
    loop {
        if left.is_empty() {
            let Some(next) = one.next() else { return pairs };
            left = next;
        }
        if right.is_empty() {
            let Some(next) = other.next() else { return pairs };
            right = next;
        }
        let len = left.len().min(right.len());
        let (a, rest_of_left) = left.split_at_mut(len);
        let (b, rest_of_right) = right.split_at_mut(len);
        pairs.push([a, b]);
        (left, right) = (rest_of_left, rest_of_right);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use glam::Vec3;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    /// Returns the triangle numbers of primitives, in ascending order.
    fn numbers(primitives: &[Primitive]) -> Vec<u32> {
        let mut numbers: Vec<u32> = primitives.iter().map(|primitive| primitive.triangle()).collect();
        numbers.sort_unstable();
        numbers
    }

    #[test]
    fn chunks_of_any_length_give_the_sides_of_one_partition() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for chunk in 1..=9 {
            let point = |_| Vec3::new(rng.random(), rng.random(), rng.random());
            let points: Vec<Vec3> = (0..50).map(point).collect();
            let mut primitives: Vec<_> =
                points.iter().enumerate().map(|(i, point)| Primitive::new([*point; 3], i as u32)).collect();
            let region = Primitive::centre_bounds(&primitives);
            let slicer = Slicer::<8>::new(region);
            let bins: Vec<_> = primitives.chunks(chunk).map(|chunk| Bins::of(chunk, &slicer)).collect();
            let cut = Bins::of(&primitives, &slicer).best_cut(&slicer, region).unwrap();
            let mut alone = primitives.clone();
            partition(&mut alone, &slicer, &cut);
            partition_chunks(&mut primitives, chunk, &bins, &slicer, &cut);
            let sides = |primitives: &[Primitive]| {
                let (left, right) = primitives.split_at(cut.left_count);
                [left, right].map(numbers)
            };
            assert_eq!(sides(&primitives), sides(&alone));
            let (left, right) = primitives.split_at(cut.left_count);
            let [left, right] = [left, right].map(Primitive::centre_bounds);
            assert!(
                left.high[cut.axis] <= right.low[cut.axis],
                "no plane separates the sides (chunks of {chunk})"
            );
            assert_eq!(numbers(&primitives), (0..50).collect::<Vec<_>>());
        }
    }
}
