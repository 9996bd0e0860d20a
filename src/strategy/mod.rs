//! Strategies. A strategy is one value of every axis. Presets are named strategies, among them the paper's.

mod axis;
mod constants;
mod facts;
mod fastest;
mod header;
mod host;
mod infeasible;
mod keys;
mod presets;
mod requirements;
mod rules;
mod sum;
mod values;
mod workload;

pub use axis::{
    Axis, AxisInfo, Culling, Epsilons, Intersector, Layout, LeafSize, Math, NodeWidth, Passes, Records,
    Shading, TileSize, Traversal, Triangles, Vectors, Width,
};
pub use facts::{Copied, WorkingMemory};
pub use fastest::{Candidate, Class, Constants, Task, fastest};
pub use header::{Contradiction, Header};
pub use host::{Afterwards, HostNeeds};
pub use infeasible::{Cause, Infeasible};
pub use presets::{PRESETS, Preset, preset, preset_names, preset_of};
pub use requirements::Requirements;
pub use values::{FOLDERS, Values};
pub use workload::{MOST_SUBPIXEL_BITS, Workload};

use crate::device::{Builtins, DeviceLimits, LaneOperations};
use crate::error::{Error, Result, meant};
use crate::manifest::GROUP_LANES;

/// Declares [`Strategy`], [`AXES`] and the functions that go through all axes.
macro_rules! strategy {
    ($($(#[$doc:meta])* $field:ident: $type:ident,)+) => {
        /// One value of every axis.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub struct Strategy {
            $($(#[$doc])* pub $field: $type,)+
        }

        /// Every axis, in the order in which a strategy is written.
        pub const AXES: &[AxisInfo] = &[$($type::INFO),+];

        impl Strategy {
            /// Sets the axis with the name `axis` to the value with the name `value`. Returns an error about
            /// the user's input if there is no such axis or value.
            pub fn set(&mut self, axis: &str, value: &str) -> Result<()> {
                match axis {
                    $(stringify!($field) => self.$field = $type::parse(value)?,)+
                    _ => return Err(unknown_axis(axis)),
                }
                Ok(())
            }

            /// Returns the name of each axis, and the name of this strategy's value on the axis.
            pub fn axes(&self) -> Vec<(&'static str, &'static str)> {
                vec![$((stringify!($field), self.$field.name())),+]
            }
        }
    };
}

strategy! {
    /// How the triangles that a ray may hit are found.
    traversal: Traversal,
    /// The memory of the nine working vectors.
    vectors: Vectors,
    /// The memory from which triangles are read.
    triangles: Triangles,
    /// The layout of triangles.
    layout: Layout,
    /// When hits are shaded.
    shading: Shading,
    /// Whether one kernel does a whole frame, or each pass has its own kernel.
    passes: Passes,
    /// The ray-triangle test.
    intersector: Intersector,
    /// The time at which a triangle's data for the ray-triangle test is computed.
    records: Records,
    /// Which faces are visible.
    culling: Culling,
    /// When a ray counts as parallel to a triangle or outside it in the ray-triangle test.
    epsilons: Epsilons,
    /// Rays per work-item.
    width: Width,
    /// The number of children of a tree node.
    node_width: NodeWidth,
    /// The largest number of triangles in a leaf.
    leaf_size: LeafSize,
    /// The size of a tile of rays that traverse a tree together.
    tile: TileSize,
    /// How the compiler may change arithmetic.
    math: Math,
}

/// The help in an error about an unknown preset.
const LISTED: &str = "`raycl strategies` lists every axis, its values and the presets";

fn unknown_axis(axis: &str) -> Error {
    let names: Vec<_> = AXES.iter().map(|info| info.name).collect();
    let error = Error::input(format!("'{axis}' is not an axis; the axes are {}", names.join(", ")));
    let explained = || "`raycl strategies` explains each axis".to_owned();
    error.with_help(meant(axis, names).unwrap_or_else(explained))
}

impl std::fmt::Display for Strategy {
    /// Writes all axes: `traversal=exhaustive vectors=private ...`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let axes: Vec<_> = self.axes().iter().map(|(axis, value)| format!("{axis}={value}")).collect();
        f.write_str(&axes.join(" "))
    }
}

impl Strategy {
    /// Returns true if each primary ray is tested against every triangle, so that the number of tests is
    /// known.
    pub fn tests_every_triangle(&self) -> bool {
        self.traversal.tests_every_triangle()
    }

    /// Returns true if rays traverse a tree.
    pub fn needs_tree(&self) -> bool {
        self.traversal.walks_tree()
    }

    /// Returns true if the strategy's kernels read whole triangles in the strategy's layout. Kernels for
    /// tiles read corners only from the tree. For these kernels, the layout decides only where normals are
    /// read.
    pub fn reads_mesh(&self) -> bool {
        !self.traversal.casts_tiles()
    }

    /// Returns true if the strategy's kernels read lists of the mesh: its normals, and its triangles, which
    /// contain the normals' indices. Only kernels that cast tiles and read indexed normals do so. A device
    /// that shares the host's memory reads these lists in place.
    pub fn reads_lists_of_mesh(&self) -> bool {
        self.traversal.casts_tiles() && self.layout.index_bits().is_some()
    }

    /// Returns the block of pixels whose rays a work-item casts side by side: (across, down). The block is nearly
    /// square, so that its rays hit the same triangles. There is one exception: if the ray-triangle test uses
    /// planes that are linear in the pixel's coordinates, the rays of a row share terms. Blocks of 16 rays
    /// are then wider and lower.
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

    /// Returns the number of lights in a round. Work-items that share a tile cast the shadow rays to all
    /// lights of a round at the same time. The number is limited because each work-item stores its results in
    /// a word of 32 bits. Each pair of a light and a ray of the work-item has one bit. Bit 31 is reserved to
    /// mark leftover shadow rays.
    pub fn lights_of_round(&self) -> usize {
        let (across, down) = self.tile.pixels();
        let rays = across * down / GROUP_LANES as usize;
        (u32::BITS as usize - 1) / rays.max(1)
    }

    /// Returns the local size of the strategy. If 32 work-items share a tile, this is the usual local size
    /// for shared tiles on a device with these limits. Otherwise, it is `other`, or as much of `other` as the
    /// device allows.
    pub fn local_size(&self, limits: &DeviceLimits, other: [u32; 2]) -> [u32; 2] {
        let groups = limits.lane_operations.usual_groups();
        if self.shares_tiles() { [GROUP_LANES, groups] } else { limits.fitting(other) }
    }

    /// Returns the local size with which the strategy is cast if no other is chosen. With the traversal `tile`, one
    /// work-item may cast a whole tile of rays, so a work-group of one work-item has enough work.
    pub fn usual_local_size(&self, limits: &DeviceLimits) -> [u32; 2] {
        let tiles = self.traversal.casts_tiles();
        self.local_size(limits, if tiles { [1, 1] } else { [8, 8] })
    }

    /// Returns how the strategy's work-items exchange values on a device with these built-in functions.
    pub fn lane_operations(&self, builtins: Builtins) -> LaneOperations {
        if self.shares_tiles() { builtins.lanes } else { LaneOperations::Barriers }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
