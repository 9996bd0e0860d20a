//! The strategy to use when none is named.

use super::{Axis, Strategy, Width, preset};
use crate::device::{DeviceLimits, LaneOperations};
use crate::error::Result;

/// From this many triangles on, a tree beats testing them all.
const TREE_TRIANGLES: usize = 200;
/// From this many triangles on, a tile of rays on a GPU shares enough of its way down a tree.
const SHARED_TRIANGLES: usize = 4000;

/// The fastest strategy measured on devices of this kind for a scene of so many triangles, and its local size
/// (docs/performance.md has the figures). Small scenes are tested exhaustively: on a CPU as many rays a work-item as
/// its vectors hold, on a GPU a few, with triangles streamed through `__local` memory. Larger ones have a tree, which
/// on a CPU tiles of rays walk together; so they do on a GPU whose work-items can tell each other things without barriers
/// (by an earlier probe's figures: that form is not timed yet).
pub fn fastest(limits: &DeviceLimits, triangles: usize) -> Result<(Strategy, [u32; 2])> {
    let tree = triangles >= TREE_TRIANGLES;
    let width = widest(limits.native_width);
    Ok(match (limits.is_cpu, tree) {
        (true, true) if width == Width::W16 => (preset("tile")?.strategy, [1, 1]),
        (true, true) => (Strategy { width, ..preset("bvh-packet")?.strategy }, [4, 4]),
        (true, false) => (Strategy { width, ..preset("wide-common-origin")?.strategy }, [4, 4]),
        (false, true)
            if triangles >= SHARED_TRIANGLES && limits.lane_operations != LaneOperations::Barriers =>
        {
            let strategy = preset("tile-group")?.strategy;
            (strategy, strategy.local_size(limits, [8, 8]))
        }
        (false, true) => (preset("bvh")?.strategy, [8, 8]),
        (false, false) => (preset("tiled-common-origin")?.strategy, [16, 8]),
    })
}

/// The largest width that the hardware's vectors hold.
fn widest(native: u32) -> Width {
    let holds = |width: &&Width| width.rays() <= native.max(1) as usize;
    Width::ALL.iter().rfind(holds).copied().unwrap_or(Width::W1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_are_shared_where_that_needs_no_barriers() -> Result<()> {
        let gpu = |lane_operations| DeviceLimits { lane_operations, ..crate::device::EXAMPLE_LIMITS };
        assert_eq!(fastest(&gpu(LaneOperations::Ptx), 69_451)?, (preset("tile-group")?.strategy, [32, 4]));
        assert_eq!(fastest(&gpu(LaneOperations::Barriers), 69_451)?.0, preset("bvh")?.strategy);
        assert_eq!(fastest(&gpu(LaneOperations::Ptx), 1000)?.0, preset("bvh")?.strategy);
        Ok(())
    }

    #[test]
    fn width_follows_the_hardware() {
        assert_eq!(widest(16), Width::W16);
        assert_eq!(widest(4), Width::W4);
        assert_eq!(widest(3), Width::W2);
        assert_eq!(widest(0), Width::W1);
        assert_eq!(widest(64), Width::W16);
    }
}
