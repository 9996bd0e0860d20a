//! The strategy to use when none is named.

use super::{Axis, Strategy, Width, preset};
use crate::device::DeviceLimits;
use crate::error::Result;

/// The fastest exhaustive strategy measured on devices of this kind, and its local size
/// (docs/performance.md has the figures): on a CPU as many rays a work-item as its vectors hold, on a GPU
/// a few, with triangles streamed through `__local` memory.
pub fn fastest(limits: &DeviceLimits) -> Result<(Strategy, [u32; 2])> {
    if limits.is_cpu {
        let mut strategy = preset("wide-common-origin")?.strategy;
        strategy.width = widest(limits.native_width);
        return Ok((strategy, [4, 4]));
    }
    Ok((preset("tiled-common-origin")?.strategy, [16, 8]))
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
