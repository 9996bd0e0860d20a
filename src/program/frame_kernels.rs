//! Lists the kernels of a program that can run when a frame is cast.

use crate::manifest::Role;
use crate::strategy::{Strategy, Workload};

/// Returns the kernels that frames with one sample per pixel can need, in the order in which they first run. The list
/// includes a kernel that prepares records (precomputed rows of triangles), although such a kernel runs only once,
/// before the first frame.
pub fn frame_kernels(strategy: &Strategy, workload: &Workload) -> Vec<&'static str> {
    let has_light = workload.lights > 0 || workload.sky;
    let is_needed = |role: Role| match role {
        Role::Records | Role::Prepare | Role::Frame | Role::Primary | Role::Resolve => true,
        Role::Shadow | Role::Leftover => has_light,
        Role::Shade | Role::Background => true,
        Role::Rays | Role::Mark | Role::FilterLight | Role::ApplyLight => false,
    };
    let kernels = strategy.family().kernels.iter();
    let needed = kernels.filter(|kernel| strategy.holds_of(kernel.when, workload) && is_needed(kernel.role));
    needed.map(|kernel| kernel.name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::{Passes, Records, preset};

    fn strategy(name: &str) -> Strategy {
        preset(name).unwrap_or_else(|error| panic!("{error}")).strategy
    }

    fn kernels(name: &str, passes: Passes) -> Vec<&'static str> {
        frame_kernels(&Strategy { passes, ..strategy(name) }, &Workload::CUBE)
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

    #[test]
    fn a_frame_casts_shadow_rays_only_if_there_is_light() {
        let of = |name: &str, sky| {
            let workload = Workload { lights: 0, sky, ..Workload::CUBE };
            frame_kernels(&strategy(name), &workload)
        };
        assert_eq!(of("tile-group", false), ["tile_prepare", "tile_primary", "tile_shade"]);
        assert_eq!(of("tile-group", true), ["tile_prepare", "tile_cast", "tile_shadow", "tile_shade"]);
        assert_eq!(of("bvh", false), ["cast_primary", "shade_nearest"]);
    }

    #[test]
    fn records_and_a_picture_of_the_sky_need_kernels_of_their_own() {
        let workload = Workload { sky: true, sky_texels: 1, ..Workload::CUBE };
        let strategy = Strategy { records: Records::Once, passes: Passes::Separate, ..strategy("bvh") };
        let expected = ["prepare_records", "cast_primary", "shade_nearest", "show_sky"];
        assert_eq!(frame_kernels(&strategy, &workload), expected);
    }
}
