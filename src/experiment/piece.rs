//! The parts into which a plan (the list of an experiment's points) is divided. The points of a part are
//! measured together. A part of the plan is a whole group of points, the points of a group on one device, or
//! a block (points that one machine or device measures together).

use super::{Block, Plan, Point};
use std::collections::HashMap;

/// Points of a plan that are measured together.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Piece {
    /// The indices of the points in the plan.
    pub points: Vec<usize>,
    /// The number of the block, if this piece of the plan is a block (points that one machine or device
    /// measures together).
    pub block: Option<u32>,
    /// The index of the control point, which all blocks (parts) of a group of points measure for comparison;
    /// `None` if the group is not cut into blocks. `points` need not contain the control point.
    pub control: Option<usize>,
}

impl Piece {
    /// Returns the indices of all points to be measured. The control point comes first, so that its record exists
    /// even if the run is interrupted while records are being written.
    pub fn point_indices(&self) -> Vec<usize> {
        let others = self.points.iter().filter(|index| Some(**index) != self.control);
        self.control.iter().chain(others).copied().collect()
    }

    /// Returns true if a point is the control point, but belongs to another block. This block then measures the point
    /// only so that the blocks of the group can be compared.
    pub fn borrows(&self, point: usize) -> bool {
        self.control == Some(point) && !self.points.contains(&point)
    }
}

impl Plan {
    /// Returns all groups of comparable points.
    pub fn whole(&self) -> Vec<Piece> {
        let mut next = 0;
        let piece = |group: &[Point]| {
            let points = (next..next + group.len()).collect();
            next += group.len();
            Piece { points, ..Piece::default() }
        };
        self.groups().map(piece).collect()
    }

    /// Returns all groups of comparable points, with separate groups for each device and for the host.
    pub fn by_device(&self) -> Vec<Piece> {
        let piece = |points| Piece { points, ..Piece::default() };
        self.groups_by_device().into_iter().map(piece).collect()
    }

    /// Returns the points of the given blocks (parts of groups of points), on each device. The blocks contain
    /// indices into a plan with only one device.
    pub fn of_blocks(&self, blocks: &[Block]) -> Vec<Piece> {
        let indices = self.indices_on_devices();
        let mut devices: Vec<Option<usize>> = self.points.iter().map(|point| point.device).collect();
        devices.sort_unstable();
        devices.dedup();
        let on = |block: &Block, device: Option<usize>| {
            let index_of = |point: &usize| indices.get(&(*point, device)).copied();
            let points: Vec<usize> = block.points.iter().filter_map(index_of).collect();
            let control = block.control.as_ref().and_then(index_of);
            (!points.is_empty()).then_some(Piece { points, block: Some(block.number), control })
        };
        blocks.iter().flat_map(|block| devices.iter().filter_map(move |device| on(block, *device))).collect()
    }

    /// Maps the points of the plan for one device to their indices in this plan. A key of the map consists of a
    /// point's index in the plan for one device, and the device that measures the point.
    pub(super) fn indices_on_devices(&self) -> HashMap<(usize, Option<usize>), usize> {
        let on_first = |point: &Point| Point { device: point.device.map(|_| 0), ..*point };
        let first: HashMap<Point, usize> = self
            .points
            .iter()
            .filter(|point| point.device.is_none_or(|device| device == 0))
            .zip(0..)
            .map(|(point, number)| (*point, number))
            .collect();
        let entry =
            |(index, point): (usize, &Point)| Some(((*first.get(&on_first(point))?, point.device), index));
        self.points.iter().enumerate().filter_map(entry).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Work;
    use super::*;
    use crate::config::Baseline;

    fn plan(devices: usize) -> Plan {
        let mut points = Vec::new();
        for scene in 0..2 {
            let point = |device, work| Point { scene, device, work, image_size: [8, 5] };
            points.push(point(None, Work::Host(Baseline::Serial)));
            for device in 0..devices {
                for side in 1..=4 {
                    points.push(point(Some(device), Work::Kernel { strategy: 0, local_size: [side, side] }));
                }
            }
        }
        Plan { points, compare_scenes: false }
    }

    fn block(number: u32, points: &[usize], control: Option<usize>) -> Block {
        Block { number, shard: 1, points: points.to_vec(), control }
    }

    #[test]
    fn blocks_are_of_the_plan_for_one_device_and_are_measured_on_each() {
        let pieces = plan(2).of_blocks(&[block(1, &[0], None), block(3, &[8, 9], Some(6))]);
        assert_eq!(pieces[0].points, [0]);
        // The second scene's points begin at index 9 if there are two devices, and at index 5 if there is one.
        let second: Vec<_> = pieces[1..].iter().map(|piece| (piece.points.clone(), piece.control)).collect();
        assert_eq!(second, [(vec![12, 13], Some(10)), (vec![16, 17], Some(14))]);
        assert!(pieces[1].borrows(10) && !pieces[1].borrows(12));
        assert_eq!(pieces[1].point_indices(), [10, 12, 13]);
    }

    #[test]
    fn a_control_point_is_measured_first_and_once() {
        let piece = Piece { points: vec![12, 10, 13], block: Some(1), control: Some(10) };
        assert_eq!(piece.point_indices(), [10, 12, 13]);
        assert!(!piece.borrows(10), "the block has its control point itself");
        let group = Piece { control: None, ..piece };
        assert!(!group.borrows(10) && !group.borrows(99), "a piece without a control point borrows none");
    }

    #[test]
    fn pieces_without_blocks_are_groups() {
        let plan = plan(2);
        assert_eq!(plan.whole().iter().map(|piece| piece.points.len()).collect::<Vec<_>>(), [9, 9]);
        let by_device: Vec<_> = plan.by_device().into_iter().map(|piece| piece.points).collect();
        assert_eq!(by_device[1..3], [vec![1, 2, 3, 4], vec![5, 6, 7, 8]]);
    }
}
