//! Checks whether a strategy can cast a scene on a device, apart from the bytes of memory: work-groups,
//! indices, counters, and features of the scene.

use crate::accel::WideBvh;
use crate::device::{DeviceLimits, LaneOperations};
use crate::manifest::{Fact, GROUP_LANES};
use crate::strategy::{Infeasible, Strategy, WorkingMemory, Workload};

/// The largest number to which the counters in kernels can count. The counters have the type `uint`.
const MOST_COUNTED: u128 = u32::MAX as u128;

/// Checks that the device supports a work-group of this shape.
pub fn shape(workload: &Workload, limits: &DeviceLimits) -> Result<(), Infeasible> {
    let [x, y] = workload.local_size;
    let items = workload.work_group_items();
    if items > limits.work_group_size as u64 {
        let reason = format!(
            "work-group: {x} x {y} = {items} work-items > the device's limit of {}",
            limits.work_group_size
        );
        return Err(Infeasible::work_group(reason));
    }
    let sizes = limits.work_item_sizes;
    if x as usize > sizes[0] || y as usize > sizes[1] {
        let reason =
            format!("work-group: {x} x {y} work-items > the device's limit of {} x {}", sizes[0], sizes[1]);
        return Err(Infeasible::work_group(reason));
    }
    Ok(())
}

/// Checks the local size for a strategy whose work-items share tiles. Each row of a work-group must have 32 work-items,
/// which share a tile. If work-items exchange values with barriers, a work-group can have only one row.
pub fn groups(strategy: &Strategy, workload: &Workload, limits: &DeviceLimits) -> Result<(), Infeasible> {
    let [x, y] = workload.local_size;
    if !strategy.shares_tiles() {
        return Ok(());
    }
    let by_barriers = limits.lane_operations == LaneOperations::Barriers;
    if x != GROUP_LANES {
        let sizes = if by_barriers { "32 x 1" } else { "32 x 1 to 32 x 8" };
        let reason = format!(
            "work-group: {x} x {y}, but with traversal = tile and width = 1, each row of a work-group must have {GROUP_LANES} work-items, which share a tile; use {sizes}"
        );
        return Err(Infeasible::work_group(reason));
    }
    if y > 1 && by_barriers {
        let reason = format!(
            "work-group: {x} x {y}, but on this device, the work-items of a tile can exchange values only with barriers, so a work-group can cast only one tile at a time; use 32 x 1"
        );
        return Err(Infeasible::work_group(reason));
    }
    Ok(())
}

/// If the layout uses 16-bit indices, checks that 16 bits can index every position, normal and material of the mesh. If
/// the strategy uses a tree, also checks that the words in the tree's nodes can index every triangle.
pub fn indices(strategy: &Strategy, workload: &Workload) -> Result<(), Infeasible> {
    let largest = workload.positions.max(workload.normals).max(workload.materials);
    if strategy.layout.index_bits() == Some(16) && largest > 1 << 16 {
        let reason = format!(
            "16-bit indices: {largest} positions, normals or materials in the scene > {} of each that 16 bits can index; use layout = indexed32",
            1 << 16
        );
        return Err(Infeasible::beyond(reason));
    }
    let (triangles, most) = (workload.triangles, WideBvh::MAX_INDEX);
    if strategy.needs_tree() && triangles > most {
        return Err(Infeasible::beyond(format!(
            "a tree's leaves: {triangles} triangles > the {most} triangles that leaves can index"
        )));
    }
    Ok(())
}

/// If the strategy has a heap for working vectors or a queue of leftover shadow rays, checks that kernels can count the
/// heap's values and the queue's entries. A counter that overflows would give two work-items the same element.
pub fn counters(strategy: &Strategy, workload: &Workload) -> Result<(), Infeasible> {
    let [across, down] = workload.global_size(strategy).map(|items| items as u128);
    let each = u128::from(strategy.vectors.bytes_per_ray() / 4);
    let values = each * across * down;
    if strategy.vectors.memory() == WorkingMemory::Heap && values > MOST_COUNTED {
        return Err(Infeasible::beyond(format!(
            "heap: {each} values x {across} x {down} work-items = {values} > {MOST_COUNTED}, the largest number that kernels can count"
        )));
    }
    let rays = workload.shared_rays(strategy) as u128;
    if strategy.shares_tiles() && rays > MOST_COUNTED {
        return Err(Infeasible::beyond(format!(
            "queue of leftover shadow rays: {rays} rays from the eye > {MOST_COUNTED}, the largest number that kernels can count"
        )));
    }
    Ok(())
}

/// Checks that the family supports soft lights and a sky, if the scene has them.
pub fn soft(strategy: &Strategy, workload: &Workload) -> Result<(), Infeasible> {
    let family = strategy.family();
    if !workload.is_soft() || family.takes(Fact::Soft) {
        return Ok(());
    }
    let (has, remedy) = match workload.sky {
        true => (
            "a sky",
            "remove [sky] and any `radius` and `edges` of a light from the scene (for a bare mesh, give --plain instead)",
        ),
        false => (
            "lights with a radius or edges",
            "with one sample per pixel (samples = 1, or --samples 1), these lights are points",
        ),
    };
    Err(Infeasible::lacking(format!(
        "{} does not support {has}, which the scene has: {remedy}",
        family.label
    )))
}

/// Checks that the family supports textures, if the scene has them.
pub fn textures(strategy: &Strategy, workload: &Workload) -> Result<(), Infeasible> {
    let family = strategy.family();
    if !workload.is_textured() || family.takes(Fact::Textured) {
        return Ok(());
    }
    let label = family.label;
    let reason = format!(
        "{label} does not support textures, which the scene has: textures = false in the scene leaves them out"
    );
    Err(Infeasible::lacking(reason))
}
