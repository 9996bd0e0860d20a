//! Strategies: ways to cast rays. A strategy has one value on every axis (one choice, such as the layout of
//! triangles). Presets are named strategies, among them those of the student paper that raycl reproduces.

mod axis;
mod conditions;
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
mod tiles;
mod values;
mod workload;

pub use axis::{
    Axis, AxisInfo, Culling, Epsilons, Intersector, Layout, LeafSize, Math, NodeWidth, Passes, Records,
    Shading, TileSize, Traversal, Triangles, Vectors, Width,
};
pub use facts::{Copied, WorkingMemory};
pub use fastest::{Candidate, Class, Constants, Task, fastest};
pub use header::{Contradiction, Header};
pub use host::{Afterwards, HostNeeds, REFERENCE_BYTES};
pub use infeasible::{Cause, Infeasible};
pub use presets::{PRESETS, Preset, preset, preset_names, preset_of, short_name};
pub use requirements::Requirements;
pub use values::{FOLDERS, Values};
pub use workload::{MOST_SUBPIXEL_BITS, Workload};

use crate::error::{Error, Result, meant};

/// Declares [`Strategy`], [`AXES`] and the functions that go through all axes.
macro_rules! strategy {
    ($($(#[$doc:meta])* $field:ident: $type:ident,)+) => {
        /// A strategy, or way to cast rays: one value on every axis.
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
    /// The memory of a ray's nine working vectors (origin, direction, normal, ...).
    vectors: Vectors,
    /// The memory from which triangles are read.
    triangles: Triangles,
    /// The layout of the triangles in memory.
    layout: Layout,
    /// When hits are shaded.
    shading: Shading,
    /// Whether one kernel casts primary rays and shadow rays, or primary rays have a kernel of their own.
    passes: Passes,
    /// The ray-triangle test.
    intersector: Intersector,
    /// The time at which a triangle's data for the ray-triangle test is computed.
    records: Records,
    /// Whether rays hit the back faces of triangles.
    culling: Culling,
    /// When the ray-triangle test counts a ray as parallel to a triangle, or as passing outside the triangle.
    epsilons: Epsilons,
    /// The number of rays that a work-item casts side by side.
    width: Width,
    /// The largest number of children of a tree node.
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
    /// tiles read corners only from the tree. For kernels that cast rays in tiles, the strategy's layout of
    /// triangles decides only where normals are read.
    pub fn reads_mesh(&self) -> bool {
        !self.traversal.casts_tiles()
    }

    /// Returns true if the strategy's kernels read lists of the mesh: its normals, and its triangles, which
    /// contain the normals' indices. Only kernels that cast rays in tiles and read indexed normals read lists
    /// of the mesh. A device that shares the host's memory reads the lists in place, without a copy.
    pub fn reads_lists_of_mesh(&self) -> bool {
        self.traversal.casts_tiles() && self.layout.index_bits().is_some()
    }
}
