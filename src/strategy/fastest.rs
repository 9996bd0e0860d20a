//! The strategy to use when none is named.

use super::{Axis, Strategy, TileSize, Width, preset};
use crate::device::{DeviceLimits, LaneOperations};
use crate::error::Result;

/// From this many triangles on, a tree walked by single rays or packets beats testing them all.
const TREE_TRIANGLES: usize = 200;
/// The same for tiles on a CPU: at 50 triangles 4.6 ms per frame against 7.7, at 6 no difference that lasts (PoCL,
/// 2 cores under load, 800 x 500, 2026-11-20).
const TREE_TRIANGLES_OF_TILES: usize = 50;
/// From so many triangles per pixel on, rays of a tile share too little: packets beat tiles on a CPU, single rays on a GPU.
/// Between what was measured: on terrain at 12 per pixel 37 against 70 ms, at 25 131 against 150, at 47 50 against 30, on a dragon
/// in a quarter of the picture at 13 11 against 9, at 22 9 against 4.5 (PoCL); on terrain at 1.4 per pixel 1.21 against 1.33 ms, at
/// 4.8 2.59 against 1.71 (NVIDIA H200; all 2026-11-20).
const TRIANGLES_A_PIXEL_OF_TILES: [usize; 2] = [13, 2];

/// From so many pixels on, and so many for each triangle, tiles of 16 x 8 beat those of 8 x 8 on a GPU: there are enough of
/// them to keep it busy, and rays share more. At 3.7 million that took 20% less to 17% more time, at 8.3 million 20% less to
/// 4% more, at 14.7 million 2 to 22% less (six scenes of 10 thousand to 300 thousand triangles); with a million triangles at
/// 8.3 million pixels 13% more, at 20.7 pixels per triangle (of 16.8 million) 11% more, at 33.6 5% less (NVIDIA H200, 2026-11-20).
const PIXELS_OF_LARGE_TILES: usize = 6_000_000;
const PIXELS_A_TRIANGLE_OF_LARGE_TILES: usize = 25;

/// The fastest strategy measured on devices of this kind for a scene of so many triangles, and its local size
/// (docs/log.md has the figures). Small scenes are tested exhaustively: on a CPU as many rays per work-item as
/// its vectors hold, on a GPU a few, with triangles streamed through `__local` memory. Larger ones have a tree, which
/// tiles of rays walk together: on a CPU in vectors, on a GPU where 32 work-items can share one by the lane operations that
/// were timed. Where triangles are much smaller than pixels, the rays of a tile go apart.
pub fn fastest(limits: &DeviceLimits, triangles: usize, pixels: usize) -> Result<(Strategy, [u32; 2])> {
    let width = widest(limits.native_width);
    let [of_cpu, of_gpu] = TRIANGLES_A_PIXEL_OF_TILES.map(|most| triangles < most.saturating_mul(pixels));
    let tiles = limits.is_cpu && width == Width::W16;
    let tree = triangles >= if tiles { TREE_TRIANGLES_OF_TILES } else { TREE_TRIANGLES };
    Ok(match (limits.is_cpu, tree) {
        (true, true) if tiles && of_cpu => (preset("tile")?.strategy, [1, 1]),
        (true, true) => (Strategy { width, ..preset("bvh-packet")?.strategy }, [4, 4]),
        (true, false) => (Strategy { width, ..preset("wide-common-origin")?.strategy }, [4, 4]),
        (false, true) if limits.lane_operations >= LaneOperations::PtxShuffles && of_gpu => {
            let mut strategy = preset("tile-group")?.strategy;
            let a_triangle = pixels / triangles.max(1);
            if pixels >= PIXELS_OF_LARGE_TILES && a_triangle >= PIXELS_A_TRIANGLE_OF_LARGE_TILES {
                strategy.tile = TileSize::T16x8;
            }
            (strategy, strategy.local_size(limits, [8, 8]))
        }
        (false, true) => (preset("bvh")?.strategy, [8, 8]),
        (false, false) => (preset("tiled-common-origin")?.strategy, [16, 8]),
    })
}

/// The largest width that the hardware's vectors hold.
fn widest(native: u32) -> Width {
    let holds = |width: &Width| width.rays() <= native.max(1) as usize;
    Width::all().into_iter().rfind(holds).unwrap_or(Width::W1)
}

#[cfg(test)]
mod tests {
    use super::super::Traversal;
    use super::*;

    const PIXELS: usize = 1920 * 1080;

    fn choice(is_cpu: bool, native_width: u32, triangles: usize) -> (Strategy, [u32; 2]) {
        let limits = DeviceLimits { native_width, is_cpu, ..crate::device::EXAMPLE_LIMITS };
        fastest(&limits, triangles, PIXELS).unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn the_number_of_triangles_and_the_device_decide() {
        let named = |name: &str| preset(name).map(|preset| preset.strategy).ok();
        for (is_cpu, native_width, first_tree, small, large) in [
            (true, 16, TREE_TRIANGLES_OF_TILES, "wide-common-origin", "tile"),
            (false, 1, TREE_TRIANGLES, "tiled-common-origin", "bvh"),
        ] {
            let of = |triangles| Some(choice(is_cpu, native_width, triangles).0);
            assert_eq!([of(1), of(first_tree - 1)], [named(small), named(small)]);
            assert_eq!([of(first_tree), of(10_000_000)], [named(large), named(large)]);
        }
    }

    #[test]
    fn a_gpu_whose_work_items_can_share_tiles_does() {
        let limits = |lane_operations| DeviceLimits {
            lane_operations,
            is_cpu: false,
            native_width: 1,
            ..crate::device::EXAMPLE_LIMITS
        };
        let of = |lanes| {
            fastest(&limits(lanes), 10_000, PIXELS)
                .map(|(strategy, local)| (strategy.shares_tiles(), local))
                .ok()
        };
        assert_eq!(of(LaneOperations::Ptx), Some((true, [32, 4])));
        assert_eq!(of(LaneOperations::Barriers), Some((false, [8, 8])));
        assert_eq!(
            fastest(&limits(LaneOperations::Ptx), 10, PIXELS).map(|(s, _)| s.needs_tree()).ok(),
            Some(false)
        );
    }

    #[test]
    fn triangles_much_smaller_than_pixels_are_for_packets_and_single_rays() {
        let cpu = DeviceLimits { native_width: 16, is_cpu: true, ..crate::device::EXAMPLE_LIMITS };
        let gpu = DeviceLimits { lane_operations: LaneOperations::Ptx, is_cpu: false, ..cpu };
        let tiles = |limits: &DeviceLimits, triangles| {
            fastest(limits, triangles, 100_000)
                .map(|(strategy, _)| strategy.traversal == Traversal::Tile)
                .ok()
        };
        assert_eq!([tiles(&cpu, 1_299_999), tiles(&cpu, 1_300_000)], [Some(true), Some(false)]);
        assert_eq!([tiles(&gpu, 199_999), tiles(&gpu, 200_000)], [Some(true), Some(false)]);
        assert_eq!(fastest(&cpu, 1_300_000, 100_000).map(|(s, _)| s.width).ok(), Some(Width::W16));
    }

    #[test]
    fn many_pixels_are_for_large_tiles() {
        let limits = DeviceLimits {
            lane_operations: LaneOperations::Ptx,
            is_cpu: false,
            ..crate::device::EXAMPLE_LIMITS
        };
        let tile =
            |triangles, pixels| fastest(&limits, triangles, pixels).map(|(strategy, _)| strategy.tile).ok();
        let (small, large) = (Some(TileSize::T8x8), Some(TileSize::T16x8));
        assert_eq!([tile(10_000, 5_999_999), tile(10_000, 6_000_000)], [small, large]);
        assert_eq!([tile(240_000, 6_000_000), tile(240_001, 6_000_000)], [large, small]);
    }

    #[test]
    fn a_cpu_with_narrower_vectors_casts_packets_of_their_width() {
        let (strategy, local_size) = choice(true, 8, 10_000);
        assert_eq!((strategy.traversal, strategy.width), (Traversal::Bvh, Width::W8));
        assert!(!choice(true, 8, TREE_TRIANGLES - 1).0.needs_tree());
        assert_eq!(local_size, [4, 4]);
    }

    #[test]
    fn every_choice_makes_sense() {
        for (is_cpu, width) in [(true, 1), (true, 4), (true, 16), (false, 1)] {
            for triangles in [0, 1, 49, 50, 199, 200, 10_000_000] {
                assert_eq!(choice(is_cpu, width, triangles).0.contradiction(), None);
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
}
