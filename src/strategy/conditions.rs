//! The conditions under which a kernel, a parameter or a define is part of a strategy's program.

use super::{Copied, Passes, Records, Strategy, Traversal, Width, WorkingMemory, Workload};
use crate::manifest::{BVH, EXHAUSTIVE, Fact, Family, RASTER, TILE_CPU, TILE_GPU};

impl Strategy {
    /// Returns the family of kernels that casts the strategy's rays.
    pub fn family(&self) -> &'static Family {
        match self.traversal {
            Traversal::Exhaustive => &EXHAUSTIVE,
            Traversal::Bvh => &BVH,
            Traversal::Raster => &RASTER,
            Traversal::Tile if self.width == Width::W1 => &TILE_GPU,
            Traversal::Tile => &TILE_CPU,
        }
    }

    /// Returns true if the kernel for primary rays also casts shadow rays and, unless work-items share tiles,
    /// shades the hits. A scene with neither lights nor a sky has no shadow rays. If work-items share tiles,
    /// the passes for such a scene are separate, even if the strategy has `passes = fused`.
    pub fn fuses(&self, workload: &Workload) -> bool {
        let casts_shadows = workload.lights > 0 || workload.sky;
        self.passes == Passes::Fused && (casts_shadows || !self.shares_tiles())
    }

    /// Returns true if the strategy has the property `fact`, such as [`Fact::Tree`], with the workload of a cube: a
    /// scene with a light but without textures or soft light, one sample per pixel, and no rays that the caller
    /// provides.
    pub fn holds(&self, fact: Fact) -> bool {
        self.holds_of(fact, &Workload::CUBE)
    }

    /// Returns true if the strategy with this workload has the property `fact`. In the manifest (the table of kernels),
    /// such properties of strategies are conditions for kernels, parameters and defines. A scene's textures, cut-outs,
    /// soft light and picture of the sky are ignored if the strategy's family does not support them.
    pub fn holds_of(&self, fact: Fact, workload: &Workload) -> bool {
        let supports = |property| self.family().takes(property);
        match fact {
            Fact::Always => true,
            Fact::Soup => self.layout.index_bits().is_none(),
            Fact::Indexed => self.layout.index_bits().is_some(),
            Fact::Tiled => self.triangles.copied() == Copied::Rows,
            Fact::Tree => self.needs_tree(),
            Fact::Planes => self.intersector.prepares_planes(),
            Fact::Records => self.records == Records::Once,
            Fact::Scratch => self.vectors.memory() == WorkingMemory::Scratch,
            Fact::Heap => self.vectors.memory() == WorkingMemory::Heap,
            Fact::Textured => workload.is_textured() && supports(Fact::Textured),
            Fact::CutOut => workload.cut_outs && supports(Fact::Textured),
            Fact::CornerColours => workload.corner_colours,
            Fact::Emissive => workload.emissive,
            Fact::Environment => workload.sky_texels > 0 && supports(Fact::Soft),
            Fact::Soft => workload.is_soft() && supports(Fact::Soft),
            Fact::SmoothShadows => workload.smooth_shadows,
            Fact::AreaLights => workload.area_lights,
            Fact::Sampled => workload.many_samples,
            Fact::HalfLight => workload.half_light && supports(Fact::Soft),
            Fact::GivenRays => workload.given_rays,
            Fact::Fused => self.fuses(workload),
            Fact::Separate => !self.fuses(workload),
            // The shading kernel casts leftover shadow rays only if the passes are fused, and if one ray from
            // the eye is cast per pixel at a time. If the passes are separate, or several rays per pixel are
            // cast at a time, a separate kernel casts the leftover shadow rays (the rays that tiles do not
            // finish). Even with many samples, two kinds of pictures have one ray per pixel at a time:
            // pictures with soft light, and pictures of more than 2^23 pixels (see
            // `Workload::shared_subpixel_bits`). For pictures of more than 2^23 pixels with several samples
            // per pixel, the program contains the separate kernel for leftover shadow rays even if the passes
            // are fused, but frames with fused passes do not run this kernel.
            Fact::Leftover => !self.fuses(workload) || (workload.many_samples && !workload.is_soft()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::preset;

    #[test]
    fn light_is_soft_if_the_scene_has_soft_light_and_the_kernels_sample_it() {
        let is_soft = |name: &str, soft_lights: bool, sky: bool| {
            let workload = Workload { soft_lights, sky, ..Workload::CUBE };
            preset(name).unwrap().strategy.holds_of(Fact::Soft, &workload)
        };
        for name in ["bvh", "tile", "tile-group"] {
            let actual =
                [[false, false], [true, false], [false, true]].map(|[lit, sky]| is_soft(name, lit, sky));
            assert_eq!(actual, [false, true, true], "{name}");
        }
        assert!(!is_soft("raster", true, true));
    }

    #[test]
    fn textures_and_cut_outs_count_only_in_families_that_support_textures() {
        let workload = Workload { texture_words: 1, cut_outs: true, ..Workload::CUBE };
        for (name, supported) in [("naive", true), ("bvh", true), ("tile", true), ("raster", false)] {
            let strategy = preset(name).unwrap().strategy;
            let facts = [Fact::Textured, Fact::CutOut];
            assert_eq!(facts.map(|fact| strategy.holds_of(fact, &workload)), [supported; 2], "{name}");
            assert_eq!(facts.map(|fact| strategy.holds(fact)), [false; 2], "{name}");
        }
    }

    #[test]
    fn a_picture_of_the_sky_and_half_pictures_count_only_in_families_that_sample_soft_light() {
        let workload = Workload { sky: true, sky_texels: 8, half_light: true, ..Workload::CUBE };
        for (name, supported) in [("bvh", true), ("tile", true), ("raster", false)] {
            let strategy = preset(name).unwrap().strategy;
            let facts = [Fact::Environment, Fact::HalfLight];
            assert_eq!(facts.map(|fact| strategy.holds_of(fact, &workload)), [supported; 2], "{name}");
            assert_eq!(facts.map(|fact| strategy.holds(fact)), [false; 2], "{name}");
        }
    }

    #[test]
    fn tiles_that_work_items_share_have_separate_passes_in_the_dark() {
        let fuses = |name: &str, lights, sky| {
            let strategy = preset(name).unwrap().strategy;
            let workload = Workload { lights, sky, ..Workload::CUBE };
            let facts = [Fact::Fused, Fact::Separate].map(|fact| strategy.holds_of(fact, &workload));
            assert_ne!(facts[0], facts[1]);
            facts[0]
        };
        for (name, in_the_dark) in [("naive", true), ("tile", true), ("tile-group", false)] {
            assert_eq!(fuses(name, 0, false), in_the_dark, "{name}");
            assert!(fuses(name, 1, false) && fuses(name, 0, true), "{name}");
        }
        assert!(!fuses("bvh", 1, true) && !fuses("tile-group-watertight", 1, true));
    }

    #[test]
    fn leftover_shadow_rays_have_a_kernel_of_their_own_if_the_shading_kernel_casts_none() {
        let has_kernel = |name: &str, lights, sky, many_samples| {
            let workload = Workload { lights, sky, many_samples, ..Workload::CUBE };
            preset(name).unwrap().strategy.holds_of(Fact::Leftover, &workload)
        };
        assert!(!has_kernel("tile-group", 1, false, false), "one ray per pixel");
        assert!(has_kernel("tile-group", 1, false, true), "several rays per pixel at a time");
        assert!(!has_kernel("tile-group", 1, true, true), "soft light is cast for one sample at a time");
        assert!(
            has_kernel("tile-group", 0, false, false) && has_kernel("tile-group-watertight", 1, true, false)
        );
    }
}
