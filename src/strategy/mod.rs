//! A strategy: one value of every axis. Presets name the paper's rows.

mod axis;
mod fastest;
mod host;
mod presets;
mod requirements;
mod sum;
mod workload;

pub use axis::{
    Axis, AxisInfo, Culling, Epsilons, Intersector, Layout, LeafSize, Math, NodeWidth, Passes, Shading,
    TileSize, Traversal, Triangles, Vectors, Width,
};
pub use fastest::fastest;
pub use host::HostNeeds;
pub use presets::{PRESETS, Preset, preset};
pub use requirements::{GROUP_LANES, Infeasible, Requirements, TILE_TRIANGLES};
pub use workload::Workload;

use crate::device::DeviceLimits;
use crate::error::{Error, Result, nearest};

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
    /// Which faces are seen.
    culling: Culling,
    /// When a test counts as parallel or outside.
    epsilons: Epsilons,
    /// Rays a work-item.
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

fn unknown_axis(axis: &str) -> Error {
    let names: Vec<_> = AXES.iter().map(|info| info.name).collect();
    let error = Error::input(format!("'{axis}' is not an axis; the axes are {}", names.join(", ")));
    match nearest(axis, names) {
        Some(meant) => error.with_help(format!("did you mean '{meant}'?")),
        None => error,
    }
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
            Width::W16 if self.intersector == Intersector::PixelLinear => 8,
            Width::W16 => 4,
        };
        (across, self.width.rays() / across)
    }

    /// Whether 32 work-items share a tile, not one work-item has it in vectors.
    pub fn shares_tiles(&self) -> bool {
        self.traversal == Traversal::Tile && self.width == Width::W1
    }

    /// Lights whose shadow rays work-items that share a tile cast at a time: a word has a bit for each of them and of a
    /// work-item's rays, and one more. LIGHTS_OF_ROUND in the kernels.
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

    /// Refuses combinations that make no sense on any device, with the reason.
    pub fn check(&self) -> Result<()> {
        match self.contradiction() {
            Some(reason) => Err(Error::input(format!("this strategy makes no sense: {reason}"))
                .with_help("change one of these axes; `raycl strategies` lists the values of each")),
            None => Ok(()),
        }
    }

    /// Why this combination makes no sense on any device, if so.
    pub fn contradiction(&self) -> Option<&'static str> {
        let raster = self.traversal == Traversal::Raster;
        let tile = self.traversal == Traversal::Tile;
        let shared = self.shares_tiles();
        let large = matches!(self.tile, TileSize::T32x16);
        let eager = self.shading == Shading::Eager;
        let tiled = self.triangles == Triangles::Tiled;
        let in_place = matches!(self.triangles, Triangles::Global | Triangles::Constant);
        let planes = self.intersector.prepares_planes();
        let rules = [
            (eager && tiled, "shading = eager with triangles = tiled would put a barrier in divergent flow"),
            (
                eager && self.passes == Passes::Separate,
                "shading = eager shades inside the traversal, so passes must be fused",
            ),
            (
                raster && (eager || self.passes == Passes::Fused),
                "traversal = raster resolves depth before it shades: shading = deferred, passes = separate",
            ),
            (
                raster && !in_place,
                "traversal = raster reads each triangle once, so there is nothing to keep in __local memory: triangles = global or constant",
            ),
            (
                raster && self.intersector != Intersector::MollerTrumbore,
                "traversal = raster has its own edge functions for primary rays and moller-trumbore for shadow rays",
            ),
            (
                self.needs_tree() && (self.triangles != Triangles::Global || self.layout != Layout::Soup),
                "traversal = bvh and tile read triangles in the order of their tree: triangles = global, layout = soup",
            ),
            (
                self.needs_tree() && planes && !(shared && self.intersector == Intersector::CommonOrigin),
                "traversal = bvh and tile prepare what rays of a common origin share themselves: another intersector (common-origin with traversal = tile and width = 1)",
            ),
            (
                tile && (eager || self.vectors != Vectors::Private),
                "traversal = tile keeps a tile's rays in private memory and shades them once: vectors = private, shading = deferred",
            ),
            (
                tile && self.epsilons == Epsilons::Paper,
                "traversal = tile has edge functions of its own: epsilons = relative",
            ),
            (
                tile && !shared && self.width != Width::W16,
                "traversal = tile casts vectors of 16 rays, or one ray a work-item: width = 16 or 1",
            ),
            (
                tile && !shared && !matches!(self.node_width, NodeWidth::N8 | NodeWidth::N16),
                "traversal = tile with width = 16 tests a node's children as one vector: node_width = 8 or 16",
            ),
            (
                tile && !shared && self.tile == TileSize::T8x4,
                "traversal = tile with width = 16 has work for a work-item from tile = 8x8 on",
            ),
            (
                shared && self.node_width != NodeWidth::N32,
                "traversal = tile with width = 1 tests a child of a node with each of 32 work-items: node_width = 32",
            ),
            (
                shared && large,
                "traversal = tile with width = 1 keeps a tile in the registers of 32 work-items: tile = 16x16 at most",
            ),
            (
                self.math == Math::Fast && self.intersector == Intersector::Watertight,
                "intersector = watertight needs exact signs, which math = fast does not keep",
            ),
            (
                self.epsilons == Epsilons::Paper && self.intersector != Intersector::MollerTrumbore,
                "epsilons = paper are numbers of the moller-trumbore test",
            ),
            (
                planes && self.layout != Layout::Soup,
                "intersector = common-origin and pixel-linear read a table of their own, a row a triangle: layout = soup",
            ),
            (
                planes && !(self.triangles == Triangles::Global || tiled),
                "intersector = common-origin and pixel-linear read a table that differs between the eye and each light: triangles = global or tiled",
            ),
            (
                eager && self.intersector == Intersector::PixelLinear,
                "intersector = pixel-linear looks for the nearest hit along depths, not distances, and shades there: shading = deferred",
            ),
        ];
        rules.into_iter().find(|(broken, _)| *broken).map(|(_, reason)| reason)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trees_keep_the_defaults_of_triangles_and_layout_and_say_why() {
        for name in ["bvh", "bvh-packet", "tile"] {
            let base = preset(name).map(|preset| preset.strategy).unwrap_or_else(|error| panic!("{error}"));
            let of = |axis: &str, value: &str| {
                let mut strategy = base;
                strategy.set(axis, value).unwrap_or_else(|error| panic!("{error}"));
                strategy.contradiction()
            };
            let others = |all: &'static [(&str, &str)], own: &'static str| {
                all.iter().map(|(value, _)| *value).filter(move |value| *value != own)
            };
            for value in others(Triangles::INFO.values, "global") {
                let reason = of("triangles", value).unwrap_or_default();
                assert!(reason.contains("order of their tree"), "{name} triangles={value}: {reason}");
            }
            for value in others(Layout::INFO.values, "soup") {
                let reason = of("layout", value).unwrap_or_default();
                assert!(reason.contains("order of their tree"), "{name} layout={value}: {reason}");
            }
            assert!(of("intersector", "common-origin").is_some(), "{name}");
        }
    }

    #[test]
    fn tiles_keep_the_defaults_of_vectors_shading_and_width() {
        for (axis, value) in [("vectors", "local"), ("shading", "eager"), ("width", "8")] {
            let mut tile =
                preset("tile").map(|preset| preset.strategy).unwrap_or_else(|error| panic!("{error}"));
            tile.set(axis, value).unwrap_or_else(|error| panic!("{error}"));
            assert!(tile.contradiction().is_some(), "{axis}={value}");
        }
    }
}
