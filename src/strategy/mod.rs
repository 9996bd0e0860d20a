//! A strategy: one value of every axis. Presets name the paper's rows.

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
pub use fastest::{Class, Constants, Task, Way, fastest};
pub use header::{Contradiction, Header};
pub use host::HostNeeds;
pub use infeasible::Infeasible;
pub use presets::{PRESETS, Preset, preset, preset_of};
pub use requirements::Requirements;
pub use values::{FOLDERS, values_of};
pub use workload::Workload;

use crate::device::{Builtins, DeviceLimits, LaneOperations};
use crate::error::{Error, Result, nearest};
use crate::manifest::GROUP_LANES;

/// Declares [`Strategy`] and everything that must name each of its axes once.
macro_rules! strategy {
    ($($(#[$doc:meta])* $field:ident: $type:ident,)+) => {
        /// One value of every axis.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub struct Strategy {
            $($(#[$doc])* pub $field: $type,)+
        }

        /// Every axis, in the order a strategy is spelled out.
        pub const AXES: &[AxisInfo] = &[$($type::INFO),+];

        impl Strategy {
            /// Changes one axis by name. An unknown name or value is the user's mistake.
            pub fn set(&mut self, axis: &str, value: &str) -> Result<()> {
                match axis {
                    $(stringify!($field) => self.$field = $type::parse(value)?,)+
                    _ => return Err(unknown_axis(axis)),
                }
                Ok(())
            }

            /// Each axis's name and this strategy's value of it.
            pub fn axes(&self) -> Vec<(&'static str, &'static str)> {
                vec![$((stringify!($field), self.$field.name())),+]
            }
        }
    };
}

strategy! {
    /// How the triangles that a ray may hit are found.
    traversal: Traversal,
    /// Where the nine working vectors live.
    vectors: Vectors,
    /// Where triangles are read from.
    triangles: Triangles,
    /// How triangles are laid out.
    layout: Layout,
    /// When a hit is shaded.
    shading: Shading,
    /// How many kernels a frame takes.
    passes: Passes,
    /// The ray-triangle test.
    intersector: Intersector,
    /// When what the test reads of a triangle is prepared.
    records: Records,
    /// Which faces are seen.
    culling: Culling,
    /// When a test counts as parallel or outside.
    epsilons: Epsilons,
    /// Rays per work-item.
    width: Width,
    /// Children of a tree's node.
    node_width: NodeWidth,
    /// Triangles a leaf holds at most.
    leaf_size: LeafSize,
    /// The tile of rays that walks a tree together.
    tile: TileSize,
    /// What the compiler may do to arithmetic.
    math: Math,
}

/// Where every name is that a strategy may be made of.
const LISTED: &str = "`raycl strategies` lists every axis, its values and the presets";

fn unknown_axis(axis: &str) -> Error {
    let names: Vec<_> = AXES.iter().map(|info| info.name).collect();
    let error = Error::input(format!("'{axis}' is not an axis; the axes are {}", names.join(", ")));
    error.with_help(match nearest(axis, names) {
        Some(meant) => format!("did you mean '{meant}'?"),
        None => "`raycl strategies` says what each decides".to_owned(),
    })
}

impl std::fmt::Display for Strategy {
    /// All axes spelled out: `traversal=exhaustive vectors=private ...`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let axes: Vec<_> = self.axes().iter().map(|(axis, value)| format!("{axis}={value}")).collect();
        f.write_str(&axes.join(" "))
    }
}

impl Strategy {
    /// Whether each primary ray is tested against every triangle, so that tests can be counted.
    pub fn tests_every_triangle(&self) -> bool {
        self.traversal == Traversal::Exhaustive
    }

    /// Whether rays walk a tree.
    pub fn needs_tree(&self) -> bool {
        matches!(self.traversal, Traversal::Bvh | Traversal::Tile)
    }

    /// Whether its kernels read the mesh in its layout; tiles read the rows of their tree and nothing else.
    pub fn reads_mesh(&self) -> bool {
        self.traversal != Traversal::Tile
    }

    /// The block of pixels whose rays a work-item casts side by side: (across, down). About square, so that they agree in
    /// what they hit; but planes that are linear in the pixel have terms that a row shares, which a longer row saves.
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

    /// Whether 32 work-items share a tile, not one work-item has it in vectors.
    pub fn shares_tiles(&self) -> bool {
        self.traversal == Traversal::Tile && self.width == Width::W1
    }

    /// Lights whose shadow rays work-items that share a tile cast at a time: a word has a bit for each of them and of a
    /// work-item's rays, and one more.
    pub fn lights_of_round(&self) -> usize {
        let (across, down) = self.tile.pixels();
        let rays = across * down / GROUP_LANES as usize;
        (u32::BITS as usize - 1) / rays.max(1)
    }

    /// `other`, or the local size that a device with these limits does best with where the strategy leaves no choice: groups
    /// of 32 that share tiles.
    pub fn local_size(&self, limits: &DeviceLimits, other: [u32; 2]) -> [u32; 2] {
        // A CPU's work-group is one thread's loop: several tiles in it gain nothing, and PoCL 6.0 crashes on several sub-groups.
        let groups = if limits.is_cpu { 1 } else { limits.lane_operations.usual_groups() };
        if self.shares_tiles() { [GROUP_LANES, groups] } else { other }
    }

    /// How its work-items tell each other things on a device with these built-ins.
    pub fn lane_operations(&self, builtins: Builtins) -> LaneOperations {
        if self.shares_tiles() { builtins.lanes } else { LaneOperations::Barriers }
    }
}
