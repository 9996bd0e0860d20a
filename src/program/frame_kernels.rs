//! Which kernels of a program a frame runs.

use crate::strategy::{Passes, Strategy, Traversal};

/// The kernels that cast a frame of a scene with lights, in the order they first run.
pub fn frame_kernels(strategy: &Strategy) -> Vec<&'static str> {
    let fused = strategy.passes == Passes::Fused;
    if strategy.shares_tiles() {
        let own: &[_] = match fused {
            true => &["tile_cast", "tile_shadow", "tile_shade"],
            false => &["tile_primary", "tile_shadow", "tile_left_over", "tile_shade"],
        };
        let prepared = strategy.intersector.prepares_planes().then_some("tile_prepare");
        return prepared.into_iter().chain(own.iter().copied()).collect();
    }
    let own: &[_] = match (strategy.traversal, fused) {
        (Traversal::Tile, true) => &["tile_frame"],
        (Traversal::Tile, false) => &["tile_primary", "tile_shade"],
        (Traversal::Raster, _) => &["raster_depth", "raster_nearest", "shade_nearest"],
        (_, true) => &["cast_frame"],
        (_, false) => &["cast_primary", "shade_nearest"],
    };
    let prepared = strategy.intersector.prepares_planes().then_some("prepare_origins");
    prepared.into_iter().chain(own.iter().copied()).collect()
}
