//! Chooses where to cut a node in two, by the binned surface-area heuristic. A node of the tree is divided into slices
//! along each of the three axes, and a cut lies between two slices. The cost of a cut is a sum over the cut's two
//! sides: half the surface area of the side's box, times the number of triangles on the side. A node is a list of
//! primitives; a primitive is a triangle's box and number. If a large tree is built for one frame, the nodes in its
//! upper part are lists of grid cells instead, and each cell contains primitives.
//!
//! Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007.

use super::bounds::{Bounds, Primitive};
use glam::Vec4;

/// An item of a node: a primitive, or a grid cell that contains primitives. Only the upper part of a large tree for one
/// frame has nodes of cells.
pub(super) trait Boxed {
    /// The item's box, as a primitive. If the item is a cell, the triangle number in this primitive has no
    /// meaning.
    fn primitive(&self) -> &Primitive;
    /// Number of triangles in the item: 1 for a primitive.
    fn count(&self) -> u32;
}

impl Boxed for Primitive {
    #[inline(always)]
    fn primitive(&self) -> &Primitive {
        self
    }

    #[inline(always)]
    fn count(&self) -> u32 {
        1
    }
}

/// Finds in which slice of a node the centre of a primitive lies, along each axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slicer<const N: usize> {
    low: Vec4,
    scale: Vec4,
}

/// If a float in `0..2^22` is added to this number, the sum's low bits are the integer nearest to the float.
/// Rounding by this addition is cheaper than Rust's saturating conversion to an integer.
const ROUND: f32 = 8_388_608.0;

impl<const N: usize> Slicer<N> {
    /// Cuts `region` into slices along each axis. The region should contain the doubled centre of each
    /// primitive (the sum of the corners of its box, which `Primitive::centre` returns). A primitive whose
    /// doubled centre lies outside the region belongs to the first or last slice.
    pub fn new(region: Bounds) -> Self {
        let scale = Vec4::splat(N as f32) / (region.high - region.low);
        // An axis has only one slice if the region's extent along this axis is zero, infinite or too small for
        // the division.
        let usable = scale.cmpgt(Vec4::ZERO) & scale.cmplt(Vec4::INFINITY);
        Self { low: region.low, scale: Vec4::select(usable, scale, Vec4::ZERO) }
    }

    /// Returns, for each axis, the number of the slice in which a primitive's centre lies. Each number is
    /// below `N`.
    #[inline(always)]
    fn slices(&self, primitive: &Primitive) -> [usize; 3] {
        let position = (primitive.centre() - self.low) * self.scale - Vec4::splat(0.5);
        let slice = position.max(Vec4::ZERO).min(Vec4::splat((N - 1) as f32)) + Vec4::splat(ROUND);
        [slice.x, slice.y, slice.z].map(|s| s.to_bits() as usize & (N - 1))
    }

    /// Returns the number of the slice in which a primitive's centre lies, along one axis. The arithmetic is
    /// the same as in `slices`, so `slice` and `slices` agree.
    #[inline(always)]
    pub fn slice<const AXIS: usize>(&self, primitive: &Primitive) -> usize {
        let centre = primitive.0.low[AXIS] + primitive.0.high[AXIS];
        let position = (centre - self.low[AXIS]) * self.scale[AXIS] - 0.5;
        // Like the vector operations `max` and `min` in `slices`, the following two comparisons send a NaN to
        // slice 0.
        let position = if position > 0.0 { position } else { 0.0 };
        let position = if position < (N - 1) as f32 { position } else { (N - 1) as f32 };
        (position + ROUND).to_bits() as usize & (N - 1)
    }

    /// Returns the position of the plane at the lower end of a slice. The position is doubled, like the
    /// centres that `Primitive::centre` returns.
    fn plane(&self, axis: usize, slice: usize) -> f32 {
        self.low[axis] + slice as f32 / self.scale[axis]
    }
}

/// A cut of a node: the cut's axis and position, and the node's two children.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cut {
    pub axis: usize,
    /// The first slice along `axis` whose triangles belong to the right child; the cut lies before this
    /// slice.
    pub slice: usize,
    /// Number of triangles in the left child.
    pub left_count: usize,
    /// The bounding boxes of the two children into which the cut divides the node.
    pub bounds: [Bounds; 2],
    /// For each child, a box around the doubled centres of the child's primitives. A primitive's doubled
    /// centre is the sum of the lowest and the highest corner of its box. Because of rounding, some doubled
    /// centres may lie slightly outside their child's region.
    pub regions: [Bounds; 2],
}

/// For each of `N` slices (a power of two) along each axis: the box around the items in the slice, and the
/// number of these items' triangles.
#[derive(Clone, Debug)]
pub(super) struct Bins<const N: usize> {
    bounds: [[Bounds; N]; 3],
    counts: [[u32; N]; 3],
}

impl<const N: usize> Bins<N> {
    /// Counts the triangles of each slice's items, and computes the box around the items of each slice.
    pub fn of(items: &[impl Boxed], slicer: &Slicer<N>) -> Self {
        let mut bins = Self { bounds: [[Bounds::EMPTY; N]; 3], counts: [[0; N]; 3] };
        for item in items {
            let slices = slicer.slices(item.primitive());
            for (axis, slice) in slices.into_iter().enumerate() {
                let bin = &mut bins.bounds[axis][slice];
                *bin = bin.union(item.primitive().0);
                bins.counts[axis][slice] += item.count();
            }
        }
        bins
    }

    /// Adds the counts and the boxes of `other`, the bins of other primitives, to these bins. `other` must have
    /// the same slices as these bins.
    pub fn merge(mut self, other: &Self) -> Self {
        for axis in 0..3 {
            for slice in 0..N {
                let bin = &mut self.bounds[axis][slice];
                *bin = bin.union(other.bounds[axis][slice]);
                self.counts[axis][slice] += other.counts[axis][slice];
            }
        }
        self
    }

    /// Returns the number of triangles in all slices below `slice`, along one axis.
    pub fn count_below(&self, axis: usize, slice: usize) -> usize {
        self.counts[axis][..slice].iter().sum::<u32>() as usize
    }

    /// Returns the cut of least cost, or `None` if every cut leaves one side empty or has an infinite cost.
    pub fn best_cut(&self, slicer: &Slicer<N>, region: Bounds) -> Option<Cut> {
        let mut best = (f32::INFINITY, 0, 0);
        for axis in 0..3 {
            best = self.best_on_axis(axis, best);
        }
        let (cost, axis, slice) = best;
        (cost < f32::INFINITY).then(|| self.cut(axis, slice, slicer, region))
    }

    /// Returns the better of `best` and the best cut along one axis. A cut is given as a tuple of its cost, its axis
    /// and the first slice of its right side. An empty side has an infinite area and no triangles, so the cost of a cut
    /// with an empty side is NaN. NaN is not less than any cost, so such a cut is never chosen.
    #[inline(always)]
    fn best_on_axis(&self, axis: usize, mut best: (f32, usize, usize)) -> (f32, usize, usize) {
        let (bounds, counts) = (&self.bounds[axis], &self.counts[axis]);
        let mut right_cost = [0.0; N];
        let (mut side, mut count) = (Bounds::EMPTY, 0);
        for slice in (1..N).rev() {
            side = side.union(bounds[slice]);
            count += counts[slice];
            right_cost[slice] = side.half_area() * count as f32;
        }
        (side, count) = (Bounds::EMPTY, 0);
        for slice in 1..N {
            side = side.union(bounds[slice - 1]);
            count += counts[slice - 1];
            let cost = side.half_area() * count as f32 + right_cost[slice];
            if cost < best.0 {
                best = (cost, axis, slice);
            }
        }
        best
    }

    fn cut(&self, axis: usize, slice: usize, slicer: &Slicer<N>, region: Bounds) -> Cut {
        let join = |bins: &[Bounds]| bins.iter().copied().fold(Bounds::EMPTY, Bounds::union);
        let (below, above) = self.bounds[axis].split_at(slice);
        let bounds = [join(below), join(above)];
        let plane = slicer.plane(axis, slice);
        let mut regions =
            bounds.map(|b| region.intersection(Bounds { low: b.low * 2.0, high: b.high * 2.0 }));
        regions[0].high[axis] = regions[0].high[axis].min(plane);
        regions[1].low[axis] = regions[1].low[axis].max(plane);
        Cut { axis, slice, left_count: self.count_below(axis, slice), bounds, regions }
    }
}
