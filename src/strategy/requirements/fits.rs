//! Whether work-groups and indices are such as a device, a family and a layout take, whatever their bytes.

use crate::accel::WideBvh;
use crate::device::{DeviceLimits, LaneOperations};
use crate::manifest::{Fact, GROUP_LANES};
use crate::strategy::{Infeasible, Strategy, Workload};

/// Whether a work-group of this shape exists on the device at all.
pub fn shape(workload: &Workload, limits: &DeviceLimits) -> Result<(), Infeasible> {
    let [x, y] = workload.local_size;
    let items = workload.work_group_items();
    if items > limits.work_group_size as u64 {
        let reason =
            format!("work-group: {x} x {y} = {items} work-items > the device's {}", limits.work_group_size);
        return Err(Infeasible { reason });
    }
    let sizes = limits.work_item_sizes;
    if x as usize > sizes[0] || y as usize > sizes[1] {
        let reason = format!("work-group: {x} x {y} work-items > the device's {} x {}", sizes[0], sizes[1]);
        return Err(Infeasible { reason });
    }
    Ok(())
}

/// Whether a work-group consists of groups that can share tiles.
pub fn groups(strategy: &Strategy, workload: &Workload, limits: &DeviceLimits) -> Result<(), Infeasible> {
    let [x, y] = workload.local_size;
    if !strategy.shares_tiles() {
        return Ok(());
    }
    if x != GROUP_LANES {
        let reason = format!(
            "work-group: {x} x {y}, but traversal = tile with width = 1 shares a tile among {GROUP_LANES} work-items across: 32 x 1 to 32 x 8"
        );
        return Err(Infeasible { reason });
    }
    if y > 1 && limits.lane_operations == LaneOperations::Barriers {
        let reason = format!(
            "work-group: {x} x {y}, but this device has only barriers to share a tile by, one tile per work-group: 32 x 1"
        );
        return Err(Infeasible { reason });
    }
    Ok(())
}

/// Whether 16-bit indices reach every entry, and the words of a tree every triangle.
pub fn indices(strategy: &Strategy, workload: &Workload) -> Result<(), Infeasible> {
    let largest = workload.positions.max(workload.normals).max(workload.materials);
    if strategy.layout.index_bits() == Some(16) && largest > 1 << 16 {
        let reason = format!("16-bit indices: {largest} entries > {}", 1 << 16);
        return Err(Infeasible { reason });
    }
    let (triangles, most) = (workload.triangles, WideBvh::MAX_INDEX);
    if strategy.needs_tree() && triangles > most {
        return Err(Infeasible { reason: format!("a tree's leaves: {triangles} triangles > {most}") });
    }
    Ok(())
}

/// Whether a family samples soft lights or a sky where the scene has some.
pub fn soft(strategy: &Strategy, workload: &Workload) -> Result<(), Infeasible> {
    let family = strategy.family();
    if !workload.is_soft() || family.takes(Fact::Soft) {
        return Ok(());
    }
    let (has, remedy) = match workload.sky {
        true => ("sky", "a scene without [sky], or a bare mesh with --plain, can be cast"),
        false => ("lights with a radius", "--samples 1 takes them as points"),
    };
    Err(Infeasible { reason: format!("{} has no {has}, which the scene has: {remedy}", family.label) })
}

/// Whether a family colours triangles by textures where the scene has some.
pub fn textures(strategy: &Strategy, workload: &Workload) -> Result<(), Infeasible> {
    let family = strategy.family();
    if !workload.is_textured() || family.takes(Fact::Textured) {
        return Ok(());
    }
    let label = family.label;
    let reason = format!("{label} has no textures, which the scene has: textures = false leaves them out");
    Err(Infeasible { reason })
}
