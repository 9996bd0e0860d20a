//! How a strategy divides a frame's rays among work-items: blocks of pixels, tiles and local sizes.

use super::{Strategy, Width};
use crate::device::{Builtins, DeviceLimits, LaneOperations};
use crate::manifest::GROUP_LANES;

impl Strategy {
    /// Returns the block of pixels whose rays a work-item casts side by side: (across, down). The block is
    /// nearly square, so that its rays mostly hit the same triangles. If the ray-triangle test uses planes that
    /// are linear in the pixel's coordinates, blocks of 16 rays are wider and lower instead, because the rays
    /// of a row of pixels share terms.
    pub fn block(&self) -> (usize, usize) {
        let across = match self.width {
            Width::W1 => 1,
            Width::W2 | Width::W4 => 2,
            Width::W8 => 4,
            Width::W16 if self.intersector.counts_in_pixels() => 8,
            Width::W16 => 4,
        };
        (across, self.width.rays() / across)
    }

    /// Returns true if 32 work-items share a tile. In other strategies with tiles, one work-item casts a
    /// whole tile, with the tile's rays in vectors.
    pub fn shares_tiles(&self) -> bool {
        self.traversal.casts_tiles() && self.width == Width::W1
    }

    /// Returns the numbers of rays across and down in a tile that 32 work-items share; `None` if work-items share no
    /// tiles.
    pub fn shared_tile(&self) -> Option<[usize; 2]> {
        self.shares_tiles().then(|| self.tile.pixels().into())
    }

    /// Returns the largest number of lights in a round of lights (the lights whose shadow rays one run of a
    /// kernel casts, if work-items share tiles). Each work-item stores one bit for each pair of a ray of its
    /// own and a light of the round. These bits must fit into a word of 32 bits, so the number of lights in a
    /// round is limited. Bit 31 is reserved to mark leftover shadow rays.
    pub fn lights_of_round(&self) -> usize {
        let (across, down) = self.tile.pixels();
        let rays = across * down / GROUP_LANES as usize;
        (u32::BITS as usize - 1) / rays.max(1)
    }

    /// Returns a local size for the strategy on a device with these limits. If 32 work-items share a tile,
    /// the local size is 32 x N, where N is the number of tiles per work-group with which kernels are fastest
    /// ([`LaneOperations::usual_groups`]). If work-items share no tiles, the local size is `other` or, if the
    /// device does not allow `other`, a smaller size ([`DeviceLimits::fitting`]).
    pub fn local_size(&self, limits: &DeviceLimits, other: [u32; 2]) -> [u32; 2] {
        let groups = limits.lane_operations.usual_groups();
        if self.shares_tiles() { [GROUP_LANES, groups] } else { limits.fitting(other) }
    }

    /// Returns the local size with which the strategy is cast if no other is chosen. With the traversal `tile`, one
    /// work-item may cast a whole tile of rays, so a work-group of one work-item has enough work. In other traversals,
    /// a work-group has 8 x 8 work-items if the device allows so many.
    pub fn usual_local_size(&self, limits: &DeviceLimits) -> [u32; 2] {
        let tiles = self.traversal.casts_tiles();
        self.local_size(limits, if tiles { [1, 1] } else { [8, 8] })
    }

    /// Returns how the strategy's work-items exchange values on a device with these built-in functions. If no
    /// work-items share tiles, no values are exchanged, and the function returns barriers.
    pub fn lane_operations(&self, builtins: Builtins) -> LaneOperations {
        if self.shares_tiles() { builtins.lanes } else { LaneOperations::Barriers }
    }
}

#[cfg(test)]
mod tests {
    use crate::strategy::preset;

    #[test]
    fn a_block_is_square_or_for_pixel_linear_planes_wide_and_low() {
        let block = |name| preset(name).unwrap_or_else(|error| panic!("{error}")).strategy.block();
        assert_eq!([block("wide"), block("wide-pixel-linear")], [(4, 4), (8, 2)]);
    }

    /// A word of 32 bits has one bit for each pair of a light and a ray of the lane. Bit 31 is reserved for leftover
    /// shadow rays.
    #[test]
    fn the_lights_of_a_round_and_a_lanes_rays_fit_into_31_bits() {
        let lights = |tile: &str| {
            let mut strategy = preset("tile-group").unwrap_or_else(|error| panic!("{error}")).strategy;
            strategy.set("tile", tile).unwrap_or_else(|error| panic!("{error}"));
            strategy.lights_of_round()
        };
        // Tiles of 32, 64, 128, 256 and 512 pixels have 1, 2, 4, 8 and 16 rays for each of 32 lanes.
        assert_eq!(["8x4", "8x8", "16x8", "16x16", "32x16"].map(lights), [31, 15, 7, 3, 1]);
    }
}
