//! Chooses the fastest strategy if the user names none.

use super::{Axis as _, Intersector, Passes, Strategy, TileSize, Width, constants, preset};
use crate::device::{DeviceLimits, LaneOperations};
use crate::error::Result;
use crate::scene::Scene;
use serde::{Deserialize, Serialize};

/// The properties of a picture that affect which strategy is fastest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Task {
    /// Number of triangles in the scene.
    pub triangles: usize,
    /// Number of pixels in the picture.
    pub pixels: usize,
    /// Number of pixels in those parts of the picture that triangles may cover.
    pub covered_pixels: usize,
    /// True if surfaces lie all around the eye.
    pub inside: bool,
    /// True if no ray may slip through between triangles at edges and vertices.
    pub watertight: bool,
    /// True if shadow rays go to random points of the sky or of lights with a radius or an area.
    #[serde(default)]
    pub soft: bool,
}

impl Task {
    /// Describes the work of casting a scene at this image size, with one sample per pixel.
    pub fn of(scene: &Scene, size: [u32; 2], watertight: bool) -> Self {
        let pixels = size[0] as usize * size[1] as usize;
        Self {
            triangles: scene.mesh.triangles.len(),
            pixels,
            covered_pixels: (pixels as f64 * scene.covered_share(size)).ceil() as usize,
            inside: scene.encloses_eye(),
            watertight,
            soft: scene.sky.is_some(),
        }
    }

    /// Returns the task of casting the same picture with `samples` samples per pixel. With more than one
    /// sample, lights with a radius or an area make the task's field `soft` true. With one sample, such lights
    /// count as points.
    #[must_use]
    pub fn sampled(self, scene: &Scene, samples: u32) -> Self {
        let soft_lights = samples > 1 && scene.has_soft_lights();
        Self { soft: self.soft || soft_lights, ..self }
    }
}

#[cfg(test)]
impl Task {
    /// Returns the task of casting a picture in which triangles cover every pixel. The eye is outside the
    /// scene.
    pub fn covering(triangles: usize, pixels: usize) -> Self {
        Self { triangles, pixels, covered_pixels: pixels, ..Self::default() }
    }
}

/// A way to cast a picture. raycl chooses the fastest of several candidates. The preset (named strategy) of a
/// candidate depends on the device ([`Candidate::strategy`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Candidate {
    /// Without a tree, each ray is tested against one triangle after another.
    Exhaustive,
    /// Single rays traverse a tree. On a CPU with vectors, packets of rays traverse the tree instead.
    Single,
    /// Tiles of rays traverse a tree together.
    Tiles {
        /// On a GPU, true for tiles of 16 x 8 pixels, and false for tiles of 8 x 8 pixels; false on a CPU.
        large: bool,
        /// True if passes are separate: shadow rays are cast after all rays from the eye.
        separate: bool,
    },
}

/// A class of devices. On all devices of a class, raycl chooses among the same candidates, by the same limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// A CPU whose vectors hold at least 16 rays, the vector width of tiles.
    TilesInVectors,
    /// A CPU with narrower vectors. For such a CPU, the compiler splits the vectors of 16 rays that tiles
    /// use.
    TilesInNarrowVectors,
    /// A GPU whose work-items exchange values by PTX's lane operations. On such a GPU, 32 work-items share each
    /// tile.
    SharedTiles,
    /// A GPU without PTX's lane operations, or a CPU whose driver reports no vectors. On these devices, raycl
    /// chooses no tiles. Mesa's driver for CPUs reports no vectors: like a GPU, it executes several work-items
    /// in the lanes of a vector.
    SingleRays,
}

/// From this number of triangles on, devices of the class [`Class::SingleRays`] traverse a tree with single
/// rays. With fewer triangles than `TREE_TRIANGLES`, testing all triangles is faster than a tree in some
/// pictures. `TREE_TRIANGLES` was measured on an H200 (`single` and `exhaustive` in
/// docs/results/rule/h200.json).
const TREE_TRIANGLES: usize = 10;

/// The limits at which another candidate becomes the fastest, for one class of devices, with or without the
/// watertight test. Only classes on which raycl may choose tiles have such limits. Some limits are compared
/// with the number of pixels multiplied or divided by a root of the number of triangles. For each of these
/// limits, the root (square or fourth) was chosen by the times of 346 pictures on an H200
/// (docs/results/rule/h200.json).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants {
    /// With fewer triangles than this limit, the rays are cast without a tree.
    pub tree_triangles: f64,
    /// From this number of triangles per covered pixel on, the rays of a tile share too little work, and
    /// [`Candidate::Single`] is faster.
    pub single_triangles_a_pixel: f64,
    /// The limit that is used in place of `single_triangles_a_pixel` if surfaces lie all around the eye. In
    /// scenes with surfaces all around the eye, more triangles lie behind each other than in other scenes.
    pub single_triangles_a_pixel_inside: f64,
    /// A limit for the number of covered pixels per compute unit, divided by the square root of the number of
    /// triangles. Below `single_pixels_a_unit`, there are too few tiles to keep a compute unit busy until the
    /// slowest tile is finished, and single rays are faster.
    pub single_pixels_a_unit: f64,
    /// With fewer triangles than this limit, the rays of a tile have little work to share. With so few
    /// triangles, single rays are faster in small pictures (below `few_pixels_a_unit`).
    pub few_triangles: f64,
    /// A limit for a product: the number of pixels per compute unit, times the fourth root of the number of
    /// triangles. Below `few_pixels_a_unit`, a picture with fewer than `few_triangles` triangles counts as
    /// small.
    pub few_pixels_a_unit: f64,
    /// A limit for a quotient: the mean number of pixels per compute unit, divided by the fourth root of the
    /// number of triangles. The mean is the geometric mean of the number of all pixels and the number of
    /// covered pixels. Large tiles share more work, but the slowest tile takes longer, in particular if there
    /// are many triangles. From `large_pixels_a_unit` on, there are enough large tiles to keep a compute unit
    /// busy until the slowest tile is finished, and large tiles are faster.
    pub large_pixels_a_unit: f64,
    /// From this number of covered pixels on, primary rays and shadow rays are cast in separate passes.
    pub separate_pixels: f64,
    /// The limit that is used in place of `separate_pixels` if surfaces lie all around the eye.
    pub separate_pixels_inside: f64,
}

impl Constants {
    /// Returns each limit's name, the limit itself, and the task's value that is compared with the limit.
    /// `units` is the device's number of compute units.
    pub fn of(&mut self, task: &Task, units: u32) -> [(&'static str, &mut f64, f64); 9] {
        let [triangles, pixels, covered] =
            [task.triangles, task.pixels, task.covered_pixels].map(|number| number.max(1) as f64);
        let a_unit = |pixels: f64| pixels / f64::from(units.max(1));
        let (root, mean) = (triangles.sqrt(), (pixels * covered).sqrt());
        [
            ("tree_triangles", &mut self.tree_triangles, triangles),
            ("single_triangles_a_pixel", &mut self.single_triangles_a_pixel, triangles / covered),
            (
                "single_triangles_a_pixel_inside",
                &mut self.single_triangles_a_pixel_inside,
                triangles / covered,
            ),
            ("single_pixels_a_unit", &mut self.single_pixels_a_unit, a_unit(covered) / root),
            ("few_triangles", &mut self.few_triangles, triangles),
            ("few_pixels_a_unit", &mut self.few_pixels_a_unit, a_unit(pixels) * root.sqrt()),
            ("large_pixels_a_unit", &mut self.large_pixels_a_unit, a_unit(mean) / root.sqrt()),
            ("separate_pixels", &mut self.separate_pixels, covered),
            ("separate_pixels_inside", &mut self.separate_pixels_inside, covered),
        ]
    }

    /// Returns the candidate that is fastest according to these limits. `units` is the device's number of
    /// compute units.
    pub fn choice(mut self, task: &Task, units: u32) -> Candidate {
        let inside = task.inside;
        let [tree, dense, dense_inside, unit, many, few_pixels, large, separate, separate_inside] =
            self.of(task, units).map(|(_, least, value)| value >= *least);
        let dense = if inside { dense_inside } else { dense };
        let small = !unit || !many && !few_pixels;
        // A scene without triangles has no tree.
        let tree = tree && task.triangles > 0;
        match (tree, dense || small) {
            (false, _) => Candidate::Exhaustive,
            (true, true) => Candidate::Single,
            (true, false) => {
                Candidate::Tiles { large, separate: if inside { separate_inside } else { separate } }
            }
        }
    }
}

impl Class {
    /// Returns the class of a device with these limits.
    pub fn of(limits: &DeviceLimits) -> Self {
        match (limits.is_cpu, widest(limits.native_width)) {
            (true, Width::W16) => Self::TilesInVectors,
            (true, Width::W1) => Self::SingleRays,
            (true, _) => Self::TilesInNarrowVectors,
            (false, _) if limits.lane_operations >= LaneOperations::PtxShuffles => Self::SharedTiles,
            (false, _) => Self::SingleRays,
        }
    }

    /// Returns true for CPUs with vectors. On such a CPU, each vector holds several rays of a packet or of a
    /// tile.
    pub fn is_in_vectors(self) -> bool {
        matches!(self, Self::TilesInVectors | Self::TilesInNarrowVectors)
    }

    /// Returns the limits that decide between the candidates of the class; `None` if the class has no candidates with
    /// tiles.
    pub fn constants(self, watertight: bool) -> Option<Constants> {
        match (self, watertight) {
            (Self::TilesInVectors, false) => Some(constants::CPU),
            (Self::TilesInVectors, true) => Some(constants::CPU_WATERTIGHT),
            (Self::TilesInNarrowVectors, false) => Some(constants::NARROW_CPU),
            (Self::TilesInNarrowVectors, true) => Some(constants::NARROW_CPU_WATERTIGHT),
            (Self::SharedTiles, false) => Some(constants::GPU),
            (Self::SharedTiles, true) => Some(constants::GPU_WATERTIGHT),
            (Self::SingleRays, _) => None,
        }
    }

    /// Returns the candidate that is fastest for a task. `units` is the device's number of compute units. In
    /// soft light, neighbouring shadow rays have different directions, so that the rays of a tile share
    /// little. On a GPU with soft light, single rays are up to 19 times as fast as tiles (measured on an H200,
    /// docs/log.md, 2026-11-24).
    pub fn choice(self, task: &Task, units: u32) -> Candidate {
        if task.soft && !self.is_in_vectors() {
            return Candidate::Single;
        }
        match self.constants(task.watertight) {
            Some(constants) => constants.choice(task, units),
            None if task.triangles < TREE_TRIANGLES => Candidate::Exhaustive,
            None => Candidate::Single,
        }
    }

    /// Returns the ways to cast among which raycl chooses on devices of this class.
    pub fn candidates(self) -> Vec<Candidate> {
        let tiles = |large, separate| Candidate::Tiles { large, separate };
        let tiles = match self {
            Self::TilesInVectors | Self::TilesInNarrowVectors => vec![Candidate::TILES],
            Self::SharedTiles => {
                vec![Candidate::TILES, tiles(true, false), tiles(false, true), tiles(true, true)]
            }
            Self::SingleRays => Vec::new(),
        };
        [Candidate::Exhaustive, Candidate::Single].into_iter().chain(tiles).collect()
    }
}

impl Candidate {
    /// The way to cast a picture with tiles on a CPU. On a GPU, this candidate has the smaller tiles (8 x 8
    /// pixels) and fused passes.
    pub const TILES: Self = Self::Tiles { large: false, separate: false };

    /// Returns the candidate's name in the files of stored sweeps (measured times of candidates on a device).
    pub fn name(self) -> &'static str {
        match self {
            Self::Exhaustive => "exhaustive",
            Self::Single => "single",
            Self::Tiles { large: false, separate: false } => "tiles",
            Self::Tiles { large: true, separate: false } => "large-tiles",
            Self::Tiles { large: false, separate: true } => "separate-tiles",
            Self::Tiles { large: true, separate: true } => "large-separate-tiles",
        }
    }

    /// Returns the fastest candidate for a task on a device with these limits.
    pub fn fastest(limits: &DeviceLimits, task: &Task) -> Self {
        Class::of(limits).choice(task, limits.compute_units)
    }

    /// Returns the candidate's strategy on a device with these limits, and the local size for it.
    pub fn strategy(self, limits: &DeviceLimits, watertight: bool) -> Result<(Strategy, [u32; 2])> {
        let width = widest(limits.native_width);
        let of = |name: &str| preset(name).map(|preset| preset.strategy);
        // If work-items share a tile, the value of `local_size` has no effect: `Strategy::local_size` returns
        // another local size.
        let (mut strategy, local_size) = match (Class::of(limits).is_in_vectors(), self) {
            (true, Self::Exhaustive) if watertight => (Strategy { width, ..of("wide")? }, [4, 4]),
            (true, Self::Exhaustive) => (Strategy { width, ..of("wide-common-origin")? }, [4, 4]),
            (true, Self::Single) => (Strategy { width, ..of("bvh-packet")? }, [4, 4]),
            (true, Self::Tiles { .. }) if watertight => (of("tile-watertight")?, [1, 1]),
            (true, Self::Tiles { .. }) => (of("tile")?, [1, 1]),
            (false, Self::Exhaustive) if watertight => (of("tiled-wide")?, [16, 8]),
            (false, Self::Exhaustive) => (of("tiled-common-origin")?, [16, 8]),
            (false, Self::Single) => (of("bvh")?, [8, 8]),
            (false, Self::Tiles { large, separate }) => {
                let mut strategy = of("tile-group")?;
                strategy.tile = if large { TileSize::T16x8 } else { strategy.tile };
                strategy.passes = if separate { Passes::Separate } else { Passes::Fused };
                (strategy, [8, 8])
            }
        };
        if watertight {
            strategy.intersector = Intersector::WATERTIGHT;
        }
        Ok((strategy, strategy.local_size(limits, local_size)))
    }
}

/// Returns the fastest strategy for a task on a device with these limits, according to measurements, and its local
/// size.
///
/// Scenes with fewer triangles than [`Constants::tree_triangles`] are cast exhaustively; if this limit is 0, only
/// scenes without triangles are cast exhaustively. In exhaustive casting, a CPU casts as many rays per work-item as its
/// vectors hold; a GPU casts a few rays per work-item, and streams triangles through `__local` memory.
///
/// In larger scenes, tiles of rays traverse a tree together. On a CPU with vectors, the rays of a tile are in
/// vectors of rays. On a GPU, 32 work-items share a tile, and exchange values by PTX's lane operations. A GPU
/// without PTX's lane operations casts single rays, because tiles have not been measured on such GPUs. On such
/// a GPU, scenes with fewer than `TREE_TRIANGLES` triangles are cast exhaustively. A CPU that reports no
/// vectors casts in the same way as a GPU without PTX's lane operations. In soft light, every GPU, and every
/// CPU that reports no vectors, casts single rays. If triangles are much smaller than pixels, single rays (on a
/// CPU with vectors, packets of rays) are faster, since the rays of a tile take different paths. On a GPU,
/// single rays are also faster in small pictures, which have too few tiles to keep the device busy.
pub fn fastest(limits: &DeviceLimits, task: &Task) -> Result<(Strategy, [u32; 2])> {
    Candidate::fastest(limits, task).strategy(limits, task.watertight)
}

/// Returns the largest width (number of rays per work-item) that fits into one vector of the hardware.
/// `native` is the number of rays that a vector of the hardware holds.
fn widest(native: u32) -> Width {
    let holds = |width: &Width| width.rays() <= native.max(1) as usize;
    Width::all().into_iter().rfind(holds).unwrap_or(Width::W1)
}

#[cfg(test)]
mod tests {
    use super::super::Traversal;
    use super::*;
    use crate::scene::load_scene;
    use std::path::Path;

    const PIXELS: usize = 1920 * 1080;
    const TILES: Candidate = Candidate::TILES;

    /// Constants that do not come from sweeps (measured times), so that new sweeps do not break these tests.
    const EXAMPLE: Constants = Constants {
        tree_triangles: 50.0,
        few_triangles: 100.0,
        few_pixels_a_unit: 3e4,
        single_pixels_a_unit: 40.0,
        single_triangles_a_pixel: 2.0,
        single_triangles_a_pixel_inside: 1.0,
        large_pixels_a_unit: 1e5,
        separate_pixels: f64::INFINITY,
        separate_pixels_inside: 1e7,
    };

    fn limits(is_cpu: bool, native_width: u32, lane_operations: LaneOperations) -> DeviceLimits {
        DeviceLimits { native_width, is_cpu, lane_operations, ..crate::device::EXAMPLE_LIMITS }
    }

    fn choice(limits: &DeviceLimits, task: &Task) -> (Strategy, [u32; 2]) {
        fastest(limits, task).unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn a_task_counts_the_pixels_that_triangles_may_cover() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/triangle.toml");
        let mut scene = load_scene(&path).unwrap().scene;
        let task = Task::of(&scene, [64, 64], false);
        assert_eq!((task.triangles, task.pixels), (1, 4096));
        // The picture is divided into 16 columns and 16 rows of cells. A cell has 16 pixels. The triangle's
        // bounding rectangle reaches from column 0 to column 14, and from row 4 to the upper edge of row 12, so
        // that row 12 counts too.
        assert_eq!(task.covered_pixels, 15 * 9 * 16);
        scene.camera.forward = -scene.camera.forward;
        assert_eq!(Task::of(&scene, [64, 64], false).covered_pixels, 0, "the triangle is behind the eye");
    }

    #[test]
    fn each_constant_decides_between_two_candidates() {
        let of = |triangles, pixels| EXAMPLE.choice(&Task::covering(triangles, pixels), 10);
        assert_eq!([of(49, PIXELS), of(50, PIXELS)], [Candidate::Exhaustive, TILES]);
        assert_eq!([of(1_999_999, 1_000_000), of(2_000_000, 1_000_000)], [TILES, Candidate::Single]);
        // The fourth root of 81 is 3, and the fourth root of 625 is 5.
        assert_eq!([of(81, 99_999), of(81, 100_000), of(100, 90_000)], [Candidate::Single, TILES, TILES]);
        assert_eq!([of(625, 9_999), of(625, 10_000)], [Candidate::Single, TILES]);
        let large = Candidate::Tiles { large: true, separate: false };
        assert_eq!([of(625, 4_999_999), of(625, 5_000_000)], [TILES, large]);
        assert_eq!([of(10_000, 9_999_999), of(10_000, 10_000_000)], [TILES, large]);
        let inside = |pixels| EXAMPLE.choice(&Task { inside: true, ..Task::covering(400_001, pixels) }, 10);
        assert_eq!([inside(400_001), inside(400_002), inside(9_999_999)], [Candidate::Single, TILES, TILES]);
        assert_eq!(
            Constants { tree_triangles: 0.0, ..EXAMPLE }.choice(&Task::default(), 10),
            Candidate::Exhaustive
        );
        assert_eq!(inside(10_000_000), Candidate::Tiles { large: false, separate: true });
    }

    #[test]
    fn pixels_that_no_triangle_covers_make_little_work() {
        let of = |triangles, pixels, covered_pixels, inside| {
            EXAMPLE.choice(&Task { covered_pixels, inside, ..Task::covering(triangles, pixels) }, 10)
        };
        let large = Candidate::Tiles { large: true, separate: false };
        // Checks the limit for the number of triangles per covered pixel.
        assert_eq!(
            [1_000_001, 1_000_000].map(|covered| of(2_000_000, 4_000_000, covered, false)),
            [TILES, Candidate::Single]
        );
        assert_eq!(
            [10_000, 9_999].map(|covered| of(625, 40_000, covered, false)),
            [TILES, Candidate::Single]
        );
        // In the two cases, the geometric means of the number of all pixels and the number of covered pixels
        // are 5,000,000 and 4,999,990.
        assert_eq!([1_250_000, 1_249_995].map(|covered| of(625, 20_000_000, covered, false)), [large, TILES]);
        // A picture of few triangles counts as small if it has few pixels, whether triangles cover them or
        // not.
        assert_eq!([99_999, 100_000].map(|pixels| of(81, pixels, 5_000, false)), [Candidate::Single, TILES]);
        let separate =
            |covered| matches!(of(100, 1 << 30, covered, true), Candidate::Tiles { separate: true, .. });
        assert_eq!([9_999_999, 10_000_000].map(separate), [false, true]);
    }

    #[test]
    fn a_gpu_casts_soft_light_with_single_rays_and_a_cpu_with_tiles() {
        let [hard, soft] = [false, true].map(|soft| Task { soft, ..Task::covering(10_000, PIXELS) });
        let (cpu, gpu) = (limits(true, 16, LaneOperations::Barriers), limits(false, 1, LaneOperations::Ptx));
        let is_tiles = |limits, task| matches!(Candidate::fastest(limits, task), Candidate::Tiles { .. });
        assert!(is_tiles(&gpu, &hard) && is_tiles(&cpu, &hard) && is_tiles(&cpu, &soft));
        assert_eq!(Candidate::fastest(&gpu, &soft), Candidate::Single);
    }

    #[test]
    fn the_device_decides_the_strategy_of_a_candidate() {
        let named = |name: &str| preset(name).map(|preset| preset.strategy).ok();
        let of = |limits: &DeviceLimits, candidate: Candidate, watertight| {
            candidate.strategy(limits, watertight).ok().map(|(s, _)| s)
        };
        let (cpu, gpu) = (limits(true, 16, LaneOperations::Barriers), limits(false, 1, LaneOperations::Ptx));
        assert_eq!(of(&cpu, Candidate::Exhaustive, false), named("wide-common-origin"));
        assert_eq!(of(&cpu, Candidate::Single, false), named("bvh-packet"));
        assert_eq!(
            [of(&cpu, TILES, false), of(&cpu, TILES, true)],
            [named("tile"), named("tile-watertight")]
        );
        let size = |candidate: Candidate, watertight| {
            candidate.strategy(&cpu, watertight).ok().map(|(_, size)| size)
        };
        assert_eq!(
            [
                size(Candidate::Exhaustive, false),
                size(Candidate::Exhaustive, true),
                size(Candidate::Single, false)
            ],
            [Some([4, 4]); 3]
        );
        assert_eq!(of(&gpu, Candidate::Exhaustive, false), named("tiled-common-origin"));
        assert_eq!(
            [of(&gpu, Candidate::Single, false), of(&gpu, Candidate::Single, true)],
            [named("bvh"); 2]
        );
        let separate = Candidate::Tiles { large: false, separate: true };
        assert_eq!(
            [of(&gpu, TILES, false), of(&gpu, separate, true)],
            [named("tile-group"), named("tile-group-watertight")]
        );
    }

    #[test]
    fn a_gpus_candidates_have_local_sizes_of_their_own_and_large_tiles_only_where_asked_for() {
        let gpu = limits(false, 1, LaneOperations::Ptx);
        let of = |candidate: Candidate, watertight| candidate.strategy(&gpu, watertight).unwrap();
        assert_eq!([of(Candidate::Exhaustive, false).1, of(Candidate::Exhaustive, true).1], [[16, 8]; 2]);
        let tight = of(Candidate::Exhaustive, true).0;
        let wide = preset("tiled-wide").unwrap().strategy;
        assert_eq!(tight, Strategy { intersector: Intersector::WATERTIGHT, ..wide });
        assert_eq!(of(Candidate::Single, false).1, [8, 8]);
        let group = preset("tile-group").unwrap().strategy;
        for (large, separate) in [(false, false), (true, false), (false, true), (true, true)] {
            let (strategy, local_size) = of(Candidate::Tiles { large, separate }, false);
            assert_eq!(
                (strategy.tile == TileSize::T16x8, strategy.passes == Passes::Separate),
                (large, separate)
            );
            assert_eq!(local_size, group.local_size(&gpu, [8, 8]));
            assert_eq!(Strategy { tile: group.tile, passes: group.passes, ..strategy }, group);
        }
    }

    #[test]
    fn no_candidate_has_larger_work_groups_than_the_device_allows() {
        for (is_cpu, most) in [(true, 8), (false, 64), (false, 16)] {
            let lanes = LaneOperations::Barriers;
            let limits = DeviceLimits { work_group_size: most, ..limits(is_cpu, 8, lanes) };
            for candidate in [Candidate::Exhaustive, Candidate::Single] {
                let [across, down] = candidate.strategy(&limits, false).unwrap().1;
                assert_eq!((across * down) as usize, most, "{candidate:?}");
            }
        }
    }

    #[test]
    fn each_class_has_its_own_limits_and_candidates() {
        use Class::{SharedTiles, SingleRays, TilesInNarrowVectors, TilesInVectors};
        let of = |class: Class| [false, true].map(|watertight| class.constants(watertight));
        assert_eq!(of(TilesInVectors), [constants::CPU, constants::CPU_WATERTIGHT].map(Some));
        assert_eq!(
            of(TilesInNarrowVectors),
            [constants::NARROW_CPU, constants::NARROW_CPU_WATERTIGHT].map(Some)
        );
        assert_eq!(of(SharedTiles), [constants::GPU, constants::GPU_WATERTIGHT].map(Some));
        assert_eq!(of(SingleRays), [None, None]);
        let counts = [TilesInVectors, TilesInNarrowVectors, SharedTiles, SingleRays]
            .map(|class| class.candidates().len());
        assert_eq!(counts, [3, 3, 6, 2]);
    }

    #[test]
    fn a_device_with_more_units_needs_more_pixels_for_tiles() {
        let of = |compute_units| {
            let limits = DeviceLimits { compute_units, ..limits(false, 1, LaneOperations::Ptx) };
            Candidate::fastest(&limits, &Task::covering(10_000, PIXELS))
        };
        assert!(matches!(of(1), Candidate::Tiles { .. }));
        assert_eq!(of(1 << 30), Candidate::Single);
    }

    #[test]
    fn devices_without_tiles_walk_trees_one_by_one() {
        let task = |triangles| Task::covering(triangles, PIXELS);
        let gpu = limits(false, 1, LaneOperations::Barriers);
        let (single, local_size) = choice(&gpu, &task(10_000));
        assert_eq!((single.traversal, single.width, local_size), (Traversal::Bvh, Width::W1, [8, 8]));
        assert!(!choice(&gpu, &task(TREE_TRIANGLES - 1)).0.needs_tree());
        assert!(choice(&gpu, &task(TREE_TRIANGLES)).0.needs_tree());
    }

    /// Tiles have vectors of 16 rays, which compilers split for narrower hardware.
    #[test]
    fn cpus_with_vectors_cast_tiles_whatever_the_vectors_width() {
        let task = Task::covering(10_000, PIXELS);
        for width in [2, 4, 8, 16] {
            let (strategy, local_size) = choice(&limits(true, width, LaneOperations::Barriers), &task);
            assert_eq!((strategy, local_size), (preset("tile").unwrap().strategy, [1, 1]), "{width}");
        }
        let (packets, _) =
            Candidate::Single.strategy(&limits(true, 8, LaneOperations::Barriers), false).unwrap();
        assert_eq!((packets.traversal, packets.width), (Traversal::Bvh, Width::W8));
    }

    #[test]
    fn a_cpu_without_vectors_casts_single_rays_as_a_gpu_does() {
        let [cpu, gpu] = [true, false].map(|is_cpu| limits(is_cpu, 1, LaneOperations::Barriers));
        for triangles in [2, 10_000] {
            for soft in [false, true] {
                let task = Task { soft, ..Task::covering(triangles, PIXELS) };
                assert_eq!(choice(&cpu, &task), choice(&gpu, &task), "{triangles} {soft}");
            }
        }
        assert_eq!(choice(&cpu, &Task::covering(10_000, PIXELS)).0, preset("bvh").unwrap().strategy);
    }

    #[test]
    fn every_choice_makes_sense_and_is_as_tight_as_it_is_asked_to_be() {
        let lanes = [LaneOperations::Barriers, LaneOperations::Ptx];
        let devices =
            [(true, 1), (true, 4), (true, 16), (false, 1)].map(|(is_cpu, width)| (is_cpu, width, lanes));
        for (is_cpu, width, lanes) in devices {
            for limits in lanes.map(|lanes| limits(is_cpu, width, lanes)) {
                for candidate in Class::of(&limits).candidates() {
                    for watertight in [false, true] {
                        let (strategy, _) =
                            candidate.strategy(&limits, watertight).unwrap_or_else(|error| panic!("{error}"));
                        assert_eq!(strategy.contradiction(), None, "{strategy}");
                        assert!(!watertight || strategy.intersector == Intersector::WATERTIGHT, "{strategy}");
                    }
                }
            }
        }
    }

    #[test]
    fn width_follows_the_hardware() {
        assert_eq!(widest(16), Width::W16);
        assert_eq!(widest(4), Width::W4);
        assert_eq!(widest(3), Width::W2);
        assert_eq!(widest(0), Width::W1);
        assert_eq!(widest(64), Width::W16);
    }

    #[test]
    fn the_class_of_a_device_follows_its_kind_its_vectors_and_its_lane_operations() {
        use LaneOperations::{Barriers, Ptx, PtxShuffles};
        let of = |is_cpu, width, lanes| Class::of(&limits(is_cpu, width, lanes));
        assert_eq!([16, 32].map(|width| of(true, width, Barriers)), [Class::TilesInVectors; 2]);
        assert_eq!([2, 4, 8].map(|width| of(true, width, Barriers)), [Class::TilesInNarrowVectors; 3]);
        assert_eq!(of(true, 1, Barriers), Class::SingleRays);
        assert_eq!([PtxShuffles, Ptx].map(|lanes| of(false, 1, lanes)), [Class::SharedTiles; 2]);
        assert_eq!(of(false, 1, Barriers), Class::SingleRays);
    }
}
