//! The strategy to use when none is named.

use super::{Axis, Strategy, Width, preset};
use crate::device::DeviceLimits;
use crate::error::Result;

/// From this many triangles on, a tree beats testing them all.
const TREE_TRIANGLES: usize = 200;

/// The fastest strategy measured on devices of this kind for a scene of so many triangles, and its local size
/// (docs/performance.md has the figures). Small scenes are tested exhaustively: on a CPU as many rays a work-item as
/// its vectors hold, on a GPU a few, with triangles streamed through `__local` memory. Larger ones have a tree, which
/// on a CPU tiles of rays walk together.
pub fn fastest(limits: &DeviceLimits, triangles: usize) -> Result<(Strategy, [u32; 2])> {
    let tree = triangles >= TREE_TRIANGLES;
    let width = widest(limits.native_width);
    Ok(match (limits.is_cpu, tree) {
        (true, true) if width == Width::W16 => (preset("tile")?.strategy, [1, 1]),
        (true, true) => (Strategy { width, ..preset("bvh-packet")?.strategy }, [4, 4]),
        (true, false) => (Strategy { width, ..preset("wide-common-origin")?.strategy }, [4, 4]),
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
    fn width_follows_the_hardware() {
        assert_eq!(widest(16), Width::W16);
        assert_eq!(widest(4), Width::W4);
        assert_eq!(widest(3), Width::W2);
        assert_eq!(widest(0), Width::W1);
        assert_eq!(widest(64), Width::W16);
    }
}
