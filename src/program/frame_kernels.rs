//! Determines which kernels of a program a frame runs.

use crate::manifest::{Family, Role};
use crate::strategy::{Passes, Strategy};

/// Returns the kernels that cast a frame of a scene with lights, in the order in which they first run. The frame has
/// one sample per pixel.
pub fn frame_kernels(strategy: &Strategy) -> Vec<&'static str> {
    let family = strategy.family();
    let runs = runs(family, strategy.passes == Passes::Fused);
    let kernels = family.kernels.iter().filter(|kernel| strategy.holds(kernel.when) && runs(kernel.role));
    kernels.map(|kernel| kernel.name).collect()
}

/// Returns whether kernels of a role take part in a frame. With fused passes, the kernel of the role `Frame` does the
/// work of as many other kernels as possible. This kernel also shades, unless the family has a separate kernel for
/// shadow rays.
fn runs(family: &Family, fused: bool) -> impl Fn(Role) -> bool {
    let shades_apart = family.kernel(Role::Shadow).is_some();
    move |role| match role {
        Role::Prepare | Role::Shadow => true,
        Role::Frame => fused,
        Role::Primary | Role::Resolve | Role::LeftOver => !fused,
        Role::Shade => !fused || shades_apart,
        Role::Background | Role::Rays | Role::Records => false,
        Role::Mark | Role::FilterLight | Role::ApplyLight => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::preset;

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
