//! Divides the triangles of a large mesh among the cells of a regular grid. If the mesh's tree is for one
//! frame only, the upper levels of the tree are built over these grid cells, not over single triangles. With
//! single triangles, building each upper level would read and move the boxes of all triangles, which do not
//! fit into the processor's caches.

use super::bins::Boxed;
use super::bounds::{Bounds, Primitive};
use super::build::{CHUNK, boxes_of};
use crate::scene::Mesh;
use glam::{DVec3, Vec4};
use rayon::prelude::*;
use std::ops::Range;

/// The grid has at most one cell per this many triangles of the mesh. Most cells of a grid around a surface
/// are empty, so the cells that are not empty have several times this number of triangles on average.
const TRIANGLES_PER_CELL: usize = 256;
/// The largest number of cells, because a cell's number is stored in 16 bits.
const MOST_CELLS: usize = 1 << 16;
/// With more threads than this, the shares into which `order_by_cell` divides the triangles do not become smaller.
/// Smaller shares would gain little, because the cell numbers of all triangles are read for each share.
const MOST_READERS: usize = 16;

/// Returns the largest number of cells for a mesh with this number of triangles.
pub(super) fn most_cells(triangles: usize) -> usize {
    (triangles / TRIANGLES_PER_CELL).clamp(1, MOST_CELLS)
}

/// A cell of the grid over the mesh, and the triangles in the cell (at least one).
pub(super) struct Cell<'a> {
    pub primitives: &'a mut [Primitive],
    /// The box around all boxes of `primitives`, stored as a `Primitive` whose triangle number has no
    /// meaning.
    bounds: Primitive,
    /// The box around the doubled centres of `primitives` (see `Primitive::centre`).
    pub region: Bounds,
}

impl<'a> Cell<'a> {
    fn of(primitives: &'a mut [Primitive]) -> Self {
        let (bounds, region) = boxes_of(primitives);
        Self { bounds: Primitive(bounds), region, primitives }
    }
}

impl Boxed for Cell<'_> {
    fn primitive(&self) -> &Primitive {
        &self.bounds
    }

    fn count(&self) -> u32 {
        self.primitives.len() as u32
    }
}

/// The primitives (box and number) of a mesh's triangles, ordered by the cells of a grid.
pub(super) struct Sorted {
    primitives: Vec<Primitive>,
    /// Number of primitives in each cell that is not empty.
    counts: Vec<usize>,
}

impl Sorted {
    /// Makes the primitives of a mesh's triangles, and orders them by the cells in which their centres lie. Within a
    /// cell, the triangles keep their order. The grid has at most `most` cells.
    pub fn of(mesh: &Mesh, most: usize) -> Self {
        let primitive = |index: usize| Primitive::new(mesh.corners(&mesh.triangles[index]), index as u32);
        let centres =
            (0..mesh.triangles.len()).into_par_iter().with_min_len(CHUNK).map(|i| primitive(i).centre());
        let region = centres.clone().map(Bounds::point).reduce(|| Bounds::EMPTY, Bounds::union);
        let grid = Grid::new(region, most);
        let mut cells: Vec<u16> = Vec::new();
        centres.map(|centre| grid.cell(centre)).collect_into_vec(&mut cells);
        let mut counts = vec![0; grid.cells()];
        cells.iter().for_each(|&cell| counts[usize::from(cell)] += 1);
        let order = order_by_cell(&cells, &counts);
        drop(cells);
        let mut primitives = Vec::new();
        let made = order.par_iter().with_min_len(CHUNK).map(|&index| primitive(index as usize));
        made.collect_into_vec(&mut primitives);
        counts.retain(|&count| count > 0);
        Self { primitives, counts }
    }

    /// Returns the grid's cells that contain at least one triangle.
    pub fn cells(&mut self) -> Vec<Cell<'_>> {
        let mut rest = self.primitives.as_mut_slice();
        let mut parts = Vec::with_capacity(self.counts.len());
        for &count in &self.counts {
            let (part, after) = rest.split_at_mut(count);
            parts.push(part);
            rest = after;
        }
        parts.into_par_iter().map(Cell::of).collect()
    }
}

/// Returns the triangles' numbers, ordered by cell. `cells` contains the cell of each triangle, and `counts`
/// the number of triangles in each cell.
fn order_by_cell(cells: &[u16], counts: &[usize]) -> Vec<u32> {
    let mut order = vec![0; cells.len()];
    // Each thread reads the cell numbers of all triangles, and writes the triangles of a share of the cells. One
    // thread writes all triangles of a cell, in the mesh's order, so the result does not depend on the number
    // of threads.
    let most = cells.len().div_ceil(rayon::current_num_threads().min(MOST_READERS));
    let shares = shares_of(&mut order, counts, most);
    shares.into_par_iter().for_each(|(own, part)| write_share(part, own.start, &counts[own], cells));
    order
}

/// Divides `order`, in which triangles will be ordered by cell, into shares. One thread writes a share. A share
/// has the triangles of cells with consecutive numbers: at most `most` triangles, or those of a single cell.
/// Returns, for each share, the range of its cells, and the part of `order` for the triangles of these cells.
fn shares_of<'a>(
    mut order: &'a mut [u32],
    counts: &[usize],
    most: usize,
) -> Vec<(Range<usize>, &'a mut [u32])> {
    let (mut shares, mut first) = (Vec::new(), 0);
    while first < counts.len() {
        let (mut end, mut triangles) = (first + 1, counts[first]);
        while end < counts.len() && triangles + counts[end] <= most {
            triangles += counts[end];
            end += 1;
        }
        let (part, rest) = order.split_at_mut(triangles);
        shares.push((first..end, part));
        (order, first) = (rest, end);
    }
    shares
}

/// Writes the numbers of all triangles in one share of the cells to `part`, ordered by cell. The share begins
/// with the cell `first`; `counts` has the number of triangles in each cell of the share, and `cells` the cell
/// of each triangle.
fn write_share(part: &mut [u32], first: usize, counts: &[usize], cells: &[u16]) {
    // For each cell, `next` has the index in `part` at which the cell's next triangle is written. At first,
    // `next` has the index at which the cell's triangles begin.
    let begin = |next: &mut usize, count: &usize| Some(std::mem::replace(next, *next + count));
    let mut next: Vec<usize> = counts.iter().scan(0, begin).collect();
    for (triangle, cell) in (0..).zip(cells) {
        // If the cell's number is below `first`, `cell - first` wraps around to a large number, which is no
        // index of `next`.
        if let Some(next) = next.get_mut(usize::from(*cell).wrapping_sub(first)) {
            part[*next] = triangle;
            *next += 1;
        }
    }
}

/// A regular grid of cells. The cells are nearly cubes, but may be shorter along an axis on which the grid has
/// only a few cells.
#[derive(Clone, Copy, Debug)]
struct Grid {
    low: Vec4,
    /// Number of cells per unit of length along each axis; 0 along an axis whose extent is zero, infinite or too
    /// small for the division. If the scale is 0, all points lie in the first cell along the axis.
    scale: Vec4,
    /// Number of cells along each axis.
    steps: [u32; 3],
}

impl Grid {
    /// Divides the box `region` into a grid of at most `most` cells.
    fn new(region: Bounds, most: usize) -> Self {
        let extent = (region.high - region.low).truncate().as_dvec3();
        let steps_of = |side: f64| {
            // The conversion to u32 turns NaN, the quotient of two zeros or of two infinities, into 0.
            let steps = |extent: f64| ((extent / side).ceil() as u32).clamp(1, most as u32);
            extent.to_array().map(steps)
        };
        let cells = |steps: [u32; 3]| steps.map(f64::from).iter().product::<f64>();
        // The search for the length of a cell's side starts with a length that is usually too short: with this length,
        // the grid has too many cells, unless the box is a point or almost a line.
        let mut side = extent.max_element() / most as f64;
        while cells(steps_of(side)) > most as f64 {
            side *= 1.02;
        }
        let steps = steps_of(side);
        let scale = (DVec3::from_array(steps.map(f64::from)) / extent).as_vec3().extend(0.0);
        let usable = scale.cmpgt(Vec4::ZERO) & scale.cmplt(Vec4::INFINITY);
        Self { low: region.low, scale: Vec4::select(usable, scale, Vec4::ZERO), steps }
    }

    /// Returns the number of cells of the grid.
    fn cells(&self) -> usize {
        self.steps.iter().map(|&steps| steps as usize).product()
    }

    /// Returns the number of the cell that contains a point. A point outside the grid belongs to a cell at its border.
    fn cell(&self, point: Vec4) -> u16 {
        let at = (point - self.low) * self.scale;
        // The conversions to u32 turn negative numbers and NaN into 0.
        let [x, y, z] = [0, 1, 2].map(|axis| (at[axis] as u32).min(self.steps[axis] - 1));
        ((z * self.steps[1] + y) * self.steps[0] + x) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn grid(low: [f32; 3], high: [f32; 3], most: usize) -> Grid {
        let [low, high] = [low, high].map(|corner| Vec3::from_array(corner).extend(0.0));
        Grid::new(Bounds { low, high }, most)
    }

    #[test]
    fn cells_are_nearly_cubes_and_not_too_many() {
        assert_eq!(grid([0.0; 3], [1.0; 3], 1000).steps, [10, 10, 10]);
        assert_eq!(grid([-5.0, 0.0, 2.0], [5.0, 0.0, 12.0], 10_000).steps, [100, 1, 100]);
        assert_eq!(grid([0.0; 3], [0.0, 7.0, 0.0], 512).steps, [1, 512, 1]);
        for most in [1, 2, 3, 100, 40_000, MOST_CELLS] {
            let usual = [[1.0, 2.0, 3.0], [1e-30, 1.0, 1e30], [0.0; 3], [1e-45; 3], [f32::MAX, 1.0, 0.0]];
            let odd = [[f32::INFINITY, 1.0, 0.0], [f32::INFINITY, f32::INFINITY, 1.0], [f32::NAN; 3]];
            for extent in usual.into_iter().chain(odd) {
                let cells = grid([0.0; 3], extent, most).cells();
                assert!((1..=most).contains(&cells), "{extent:?}: {cells} of {most}");
            }
        }
    }

    #[test]
    fn a_large_mesh_has_more_cells_but_no_more_than_16_bits_can_number() {
        assert_eq!([100, 1 << 20, 100_000_000].map(most_cells), [1, 4096, 65_536]);
        assert_eq!(grid([0.0; 3], [1.0, 0.0, 0.0], MOST_CELLS).cell(Vec4::ONE), u16::MAX);
    }

    #[test]
    fn a_point_is_in_the_cell_around_it_or_at_the_border() {
        let grid = grid([-1.0, 0.0, 5.0], [1.0, 3.0, 9.0], 24);
        assert_eq!(grid.steps, [2, 3, 4]);
        let cell = |x: f32, y: f32, z: f32| grid.cell(Vec4::new(x, y, z, f32::NAN));
        assert_eq!(cell(-1.0, 0.0, 5.0), 0);
        assert_eq!(cell(0.5, 0.5, 5.5), 1);
        assert_eq!(cell(-0.5, 2.5, 5.5), 4);
        assert_eq!(cell(0.5, 1.5, 8.5), 3 * 6 + 2 + 1);
        assert_eq!(cell(1.0, 3.0, 9.0), 23);
        assert_eq!((cell(-9.0, -9.0, -9.0), cell(9.0, 9.0, f32::INFINITY)), (0, 23));
        assert_eq!(cell(f32::NAN, f32::NAN, f32::NAN), 0);
    }

    #[test]
    fn triangles_are_ordered_by_cell_and_keep_their_order_within_a_cell() {
        let cells: Vec<u16> = (0..10_000_u32).map(|i| (i * i % 7 * 3) as u16).collect();
        let mut counts = vec![0; 20];
        cells.iter().for_each(|&cell| counts[usize::from(cell)] += 1);
        let mut expected: Vec<u32> = (0..10_000).collect();
        expected.sort_by_key(|&triangle| cells[triangle as usize]);
        for threads in [1, 2, 5, 64] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            assert_eq!(pool.install(|| order_by_cell(&cells, &counts)), expected, "{threads} threads");
        }
    }
}
