//! Determines which kernels of a program a frame can run.

use crate::manifest::Role;
use crate::strategy::Strategy;

/// Returns the kernels that a frame can run, in the order in which they first run. Assumes that the scene has lights,
/// and that the frame casts one sample per pixel.
pub fn frame_kernels(strategy: &Strategy) -> Vec<&'static str> {
    let kernels = strategy.family().kernels.iter();
    let run = kernels.filter(|kernel| strategy.holds(kernel.when) && takes_part(kernel.role));
    run.map(|kernel| kernel.name).collect()
}

/// Returns whether kernels of a role take part in a frame with lights and one sample per pixel.
fn takes_part(role: Role) -> bool {
    match role {
        Role::Prepare | Role::Frame | Role::Primary | Role::Resolve => true,
        Role::Shadow | Role::LeftOver | Role::Shade => true,
        Role::Background | Role::Rays | Role::Records => false,
        Role::Mark | Role::FilterLight | Role::ApplyLight => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::{Passes, preset};

    fn kernels(name: &str, passes: Passes) -> Vec<&'static str> {
        let strategy = preset(name).unwrap_or_else(|error| panic!("{error}")).strategy;
        frame_kernels(&Strategy { passes, ..strategy })
    }

    #[test]
    fn a_frame_runs_what_its_passes_need_in_order() {
        let fused = Passes::Fused;
        assert_eq!(kernels("naive", fused), ["cast_frame"]);
        assert_eq!(kernels("tile", fused), ["tile_frame"]);
        assert_eq!(kernels("tile-group", fused), ["tile_prepare", "tile_cast", "tile_shadow", "tile_shade"]);
        let separate = Passes::Separate;
        assert_eq!(kernels("bvh", separate), ["cast_primary", "shade_nearest"]);
        assert_eq!(kernels("tile", separate), ["tile_primary", "tile_shade"]);
        assert_eq!(kernels("raster", separate), ["raster_depth", "raster_nearest", "shade_nearest"]);
        assert_eq!(
            kernels("tile-group-watertight", separate),
            ["tile_primary", "tile_shadow", "tile_left_over", "tile_shade"]
        );
    }
}
