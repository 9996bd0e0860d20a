//! Moves a node's primitives to their side of a cut, from one buffer to the other.

use super::bins::{Bins, Cut, Slicer};
use super::bounds::Primitive;
use rayon::prelude::*;

/// Moves primitives left of the cut to the front of `target`, and all other primitives to the back.
pub(super) fn partition<const N: usize>(
    source: &[Primitive],
    target: &mut [Primitive],
    slicer: &Slicer<N>,
    cut: &Cut,
) {
    match cut.axis {
        0 => partition_on::<N, 0>(source, target, slicer, cut.slice),
        1 => partition_on::<N, 1>(source, target, slicer, cut.slice),
        _ => partition_on::<N, 2>(source, target, slicer, cut.slice),
    }
}

/// Writes each primitive to both ends of the free part of `target`, then shortens this part at one end. Writing to both
/// ends needs no branch; a branch would often be mispredicted.
fn partition_on<const N: usize, const AXIS: usize>(
    source: &[Primitive],
    target: &mut [Primitive],
    slicer: &Slicer<N>,
    slice: usize,
) {
    let (mut front, mut back) = (0, target.len());
    for primitive in source {
        let is_left = slicer.slice::<AXIS>(primitive) < slice;
        target[front] = *primitive;
        target[back - 1] = *primitive;
        front += usize::from(is_left);
        back -= usize::from(!is_left);
    }
}

/// Moves the primitives of each chunk to their side of the cut, on all cores. `chunks` are pieces of the source, each
/// with its bins. The bins determine how many primitives of a piece go to each side.
pub(super) fn partition_chunks<const N: usize>(
    chunks: &[(&[Primitive], Bins<N>)],
    target: &mut [Primitive],
    slicer: &Slicer<N>,
    cut: &Cut,
) {
    let (mut left, mut right) = target.split_at_mut(cut.left_count);
    let mut moves = Vec::with_capacity(chunks.len());
    for (source, bins) in chunks {
        let left_count = bins.count_below(cut.axis, cut.slice);
        let (to_left, rest) = left.split_at_mut(left_count);
        let (to_right, rest_right) = right.split_at_mut(source.len() - left_count);
        (left, right) = (rest, rest_right);
        moves.push((*source, to_left, to_right));
    }
    moves.into_par_iter().for_each(|(source, to_left, to_right)| match cut.axis {
        0 => scatter::<N, 0>(source, to_left, to_right, slicer, cut.slice),
        1 => scatter::<N, 1>(source, to_left, to_right, slicer, cut.slice),
        _ => scatter::<N, 2>(source, to_left, to_right, slicer, cut.slice),
    });
}

fn scatter<const N: usize, const AXIS: usize>(
    source: &[Primitive],
    left: &mut [Primitive],
    right: &mut [Primitive],
    slicer: &Slicer<N>,
    slice: usize,
) {
    let (mut left, mut right) = (left.iter_mut(), right.iter_mut());
    for primitive in source {
        let side = if slicer.slice::<AXIS>(primitive) < slice { &mut left } else { &mut right };
        if let Some(place) = side.next() {
            *place = *primitive;
        }
    }
}
