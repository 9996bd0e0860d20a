//! The sizes and features of a scene, an image and a work-group.

use super::Strategy;
use crate::manifest::{GROUP_LANES, SAMPLED_BLOCK};
use crate::scene::{Mapped, Sampling, Scene};
use serde::{Deserialize, Serialize};

/// The base-2 logarithm of the largest number of sub-pixels into which a pixel is divided, across as well as down. A
/// pixel thus has at most 16 sub-pixels (4 x 4), as many as a vector has rays.
pub const MOST_SUBPIXEL_BITS: u32 = 2;

/// The largest number of rays in a frame with sub-pixels in which work-items share tiles. Each ray takes 16
/// bytes in the buffers that pass data between kernels, so these buffers take at most 512 MiB.
/// `MOST_SHARED_RAYS` is enough for 16 samples of each of 1920 x 1080 pixels.
const MOST_SHARED_RAYS: u64 = 1 << 25;

/// The properties of a scene, an image and a work-group that determine which program and how much memory a strategy
/// needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Workload {
    /// Number of triangles in the scene.
    pub triangles: usize,
    /// Number of entries in the mesh's set of positions.
    pub positions: usize,
    /// Number of entries in the mesh's set of normals.
    pub normals: usize,
    /// Number of entries in the mesh's set of materials.
    pub materials: usize,
    /// Number of lights in the scene.
    pub lights: usize,
    /// Number of words of all textures; 0 without textures.
    pub texture_words: usize,
    /// True if textures have mip levels.
    pub mip_levels: bool,
    /// True if masks (usually the alpha channels of textures) make holes in triangles (cut-outs).
    pub cut_outs: bool,
    /// True if the corners of triangles have colours.
    #[serde(default)]
    pub corner_colours: bool,
    /// True if surfaces emit light.
    #[serde(default)]
    pub emissive: bool,
    /// True if lights with a radius or an area are sampled.
    pub soft_lights: bool,
    /// True if a light has an area.
    #[serde(default)]
    pub area_lights: bool,
    /// True if the scene has a sky (light from all directions).
    pub sky: bool,
    /// True if a hit is lit as if it lay on a smooth surface above its triangle, rather than on the triangle.
    #[serde(default)]
    pub smooth_shadows: bool,
    /// True if pixels get several samples.
    pub many_samples: bool,
    /// True if soft light is cast at half resolution.
    #[serde(default)]
    pub half_light: bool,
    /// True if the program can also cast rays that the caller provides, not only a camera's.
    #[serde(default)]
    pub given_rays: bool,
    /// Number of texels of the sky's picture; 0 if the sky has no picture.
    pub sky_texels: usize,
    /// Number of entries of a traversal's stack; 0 without a tree, or before the tree is built.
    pub stack_size: usize,
    /// Image size in pixels: across, down.
    pub image_size: [u32; 2],
    /// Local size: work-items of a work-group, across and down.
    pub local_size: [u32; 2],
}

impl Workload {
    /// The workload of a cube and its tree. If the user names no scene, raycl makes programs for the workload
    /// `CUBE`. The image size does not affect the compiled code.
    pub const CUBE: Self = Self {
        triangles: 12,
        positions: 8,
        normals: 6,
        materials: 1,
        lights: 1,
        texture_words: 0,
        mip_levels: false,
        cut_outs: false,
        corner_colours: false,
        emissive: false,
        soft_lights: false,
        area_lights: false,
        sky: false,
        smooth_shadows: false,
        many_samples: false,
        half_light: false,
        given_rays: false,
        sky_texels: 0,
        stack_size: 32,
        image_size: [64, 64],
        local_size: [8, 8],
    };

    /// Returns the workload of casting `scene` at an image size and a local size, with one sample per pixel.
    pub fn of(scene: &Scene, image_size: [u32; 2], local_size: [u32; 2]) -> Self {
        Self {
            triangles: scene.mesh.triangles.len(),
            positions: scene.mesh.positions.len(),
            normals: scene.mesh.normals.len(),
            materials: scene.mesh.materials.len(),
            lights: scene.lights.len(),
            texture_words: scene.mesh.textures.word_count(),
            mip_levels: scene.mesh.textures.have_levels(),
            cut_outs: scene.mesh.textures.have_holes(),
            corner_colours: !scene.mesh.corner_colours.is_empty(),
            emissive: scene.mesh.is_emissive(),
            soft_lights: false,
            area_lights: scene.has_area_lights(),
            sky: scene.sky.is_some(),
            smooth_shadows: scene.smooth_shadows,
            many_samples: false,
            half_light: false,
            given_rays: false,
            sky_texels: scene.sky.as_ref().and_then(|sky| sky.picture.as_ref()).map_or(0, |p| p.texels.len()),
            stack_size: 0,
            image_size,
            local_size,
        }
    }

    /// Returns this workload with the properties that depend on `sampling`: whether pixels get several samples, whether
    /// lights with a radius or an area are sampled, and whether soft light is cast at half resolution.
    #[must_use]
    pub fn sampled(self, scene: &Scene, sampling: &Sampling) -> Self {
        let many_samples = sampling.most > 1;
        let soft_lights = many_samples && scene.has_soft_lights();
        let half_light = many_samples && sampling.half_light > 0;
        Self { soft_lights, many_samples, half_light, ..self }
    }

    /// Returns true if triangles have textures.
    pub fn is_textured(&self) -> bool {
        self.texture_words > 0
    }

    /// Returns the number of bytes that describe where a triangle lies in its texture.
    pub fn texture_row_bytes(&self) -> u64 {
        4 * Mapped::floats(self.mip_levels) as u64
    }

    /// Returns the number of pixels of the image.
    pub fn pixels(&self) -> u64 {
        u64::from(self.image_size[0]) * u64::from(self.image_size[1])
    }

    /// Returns true if light is soft: each pixel samples points of lights with an extent, or directions to the
    /// sky.
    pub fn is_soft(&self) -> bool {
        self.soft_lights || self.sky
    }

    /// Returns the numbers of blocks of pixels across and down the picture. All pixels of a block get the
    /// same number of samples.
    pub fn sampled_blocks(&self) -> [u32; 2] {
        self.image_size.map(|pixels| pixels.div_ceil(SAMPLED_BLOCK))
    }

    /// Returns the workload of a half picture: a picture of half the width and height, in which soft light is
    /// cast. A half picture has no half pictures of its own, so its workload's `half_light` is false.
    #[must_use]
    pub fn halved(&self) -> Self {
        Self { image_size: self.image_size.map(|pixels| pixels.div_ceil(2)), half_light: false, ..*self }
    }

    /// Returns the number of work-items across and down, rounded up to whole work-groups. If work-items share
    /// tiles, there are 32 work-items for each tile. If work-items share no tiles, there is one work-item for
    /// each block of pixels.
    pub fn global_size(&self, strategy: &Strategy) -> [usize; 2] {
        if strategy.shares_tiles() {
            let (across, down) = strategy.tile.pixels();
            let [tiles_across, tiles_down] = self.tiles_of_group();
            let groups = |pixels: u32, tile: usize, tiles: usize| (pixels as usize).div_ceil(tile * tiles);
            return [
                groups(self.image_size[0], across, tiles_across) * GROUP_LANES as usize,
                groups(self.image_size[1], down, tiles_down) * self.local_size[1] as usize,
            ];
        }
        let block = block(strategy);
        let across = |pixels: u32, block: usize, local: u32| {
            (pixels as usize).div_ceil(block).next_multiple_of(local as usize)
        };
        [
            across(self.image_size[0], block.0, self.local_size[0]),
            across(self.image_size[1], block.1, self.local_size[1]),
        ]
    }

    /// Returns the number of values that the kernel for primary rays stores for a separate shading kernel: one per ray
    /// from the eye if work-items share tiles, otherwise one per pixel. For tiles with vectors of rays, the number of
    /// pixels is rounded up to whole work-groups.
    pub fn nearest_count(&self, strategy: &Strategy) -> usize {
        if strategy.shares_tiles() {
            self.shared_rays(strategy)
        } else if strategy.traversal.casts_tiles() {
            let (across, down) = strategy.tile.pixels();
            self.global_size(strategy).iter().product::<usize>() * across * down
        } else {
            self.pixels() as usize
        }
    }

    /// Returns the number of sub-pixels across a pixel, as a base-2 logarithm. The number is for frames in
    /// which 32 work-items share each tile. With several sub-pixels, several samples of each pixel are cast
    /// at the same time. The number of sub-pixels is limited, since each of their rays needs its own entry in
    /// the buffers that pass data between kernels. With soft light or a sky, the returned logarithm is 0:
    /// soft light is cast for one sample at a time, and the kernel that adds the picture of a sky does not
    /// support sub-pixels.
    pub fn shared_subpixel_bits(&self, strategy: &Strategy) -> u32 {
        if !self.many_samples || !strategy.shares_tiles() || self.is_soft() {
            return 0;
        }
        let pixels = self.pixels();
        (0..=MOST_SUBPIXEL_BITS).rev().find(|bits| pixels << (2 * bits) <= MOST_SHARED_RAYS).unwrap_or(0)
    }

    /// Returns the largest number of rays from the eye in a frame whose tiles are each shared by 32 work-items.
    pub fn shared_rays(&self, strategy: &Strategy) -> usize {
        (self.pixels() as usize) << (2 * self.shared_subpixel_bits(strategy))
    }

    /// Returns the number of origins (eye and lights) for which planes of all triangles are stored at the same
    /// time; 0 if the ray-triangle test reads no such planes.
    pub fn prepared_origins(&self, strategy: &Strategy) -> usize {
        let at_once = if strategy.shares_tiles() { strategy.lights_of_round() } else { usize::MAX };
        if strategy.intersector.prepares_planes() { 1 + self.lights.min(at_once) } else { 0 }
    }

    /// Returns the number of tiles across and down in a work-group whose work-items share tiles.
    pub fn tiles_of_group(&self) -> [usize; 2] {
        let tiles = self.local_size[1] as usize;
        let across = if tiles.is_multiple_of(2) { 2 } else { 1 };
        [across, tiles / across]
    }

    /// Returns the number of pixel rows that a row of work-groups covers.
    pub fn group_height(&self, strategy: &Strategy) -> u32 {
        if strategy.shares_tiles() {
            return (strategy.tile.pixels().1 * self.tiles_of_group()[1]) as u32;
        }
        block(strategy).1 as u32 * self.local_size[1]
    }

    pub(super) fn work_group_items(&self) -> u64 {
        u64::from(self.local_size[0]) * u64::from(self.local_size[1])
    }
}

/// Returns the size in pixels (across, down) of the block that a work-item covers.
fn block(strategy: &Strategy) -> (usize, usize) {
    if strategy.traversal.casts_tiles() { strategy.tile.pixels() } else { strategy.block() }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::strategy::{TileSize, preset};

    #[test]
    fn shared_tiles_divide_pixels_as_finely_as_their_buffers_allow() {
        let strategy = preset("tile-group").unwrap().strategy;
        let of = |image_size| Workload { image_size, many_samples: true, ..Workload::CUBE };
        let bits = |workload: Workload| workload.shared_subpixel_bits(&strategy);
        let sizes = [[1920, 1080], [3840, 2160], [16_384, 16_384]];
        assert_eq!(sizes.map(|size| bits(of(size))), [2, 1, 0]);
        assert_eq!(of([1920, 1080]).nearest_count(&strategy), 16 * 1920 * 1080);
        let full_hd = of([1920, 1080]);
        for other in [
            Workload { many_samples: false, ..full_hd },
            Workload { soft_lights: true, ..full_hd },
            Workload { sky: true, ..full_hd },
        ] {
            assert_eq!((bits(other), other.shared_rays(&strategy)), (0, 1920 * 1080));
        }
        assert_eq!(full_hd.shared_subpixel_bits(&preset("tile").unwrap().strategy), 0);
    }

    #[test]
    fn the_last_blocks_of_a_picture_may_be_partial() {
        let of = |image_size| Workload { image_size, ..Workload::CUBE }.sampled_blocks();
        assert_eq!([[8, 4], [9, 5]].map(of), [[2, 1], [3, 2]]);
    }

    #[test]
    fn a_row_of_work_groups_is_as_high_as_the_tiles_of_one() {
        let strategy = Strategy { tile: TileSize::T8x4, ..preset("tile-group").unwrap().strategy };
        let of = |tiles| Workload { local_size: [32, tiles], ..Workload::CUBE }.group_height(&strategy);
        // The tiles are four pixels high. If a work-group has an even number of tiles, they are arranged in two
        // columns, so the group covers half as many pixel rows as in one column.
        assert_eq!([1, 2, 3, 4, 8].map(of), [4, 4, 12, 8, 16]);
        let rays = Workload { local_size: [16, 2], ..Workload::CUBE };
        assert_eq!(rays.group_height(&preset("deferred").unwrap().strategy), 2);
    }

    #[test]
    fn a_textured_triangle_has_eight_numbers_and_four_more_for_mip_levels() {
        let of = |texture_words, mip_levels| {
            let workload = Workload { texture_words, mip_levels, ..Workload::CUBE };
            (workload.is_textured(), workload.texture_row_bytes())
        };
        assert_eq!([of(0, false), of(1, false), of(900, true)], [(false, 32), (true, 32), (true, 48)]);
    }
}
