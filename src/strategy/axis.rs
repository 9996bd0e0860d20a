//! The axes of a strategy (the choices of which a way to cast rays consists), and their values. Some values are kernel
//! files. Such a value has a file in one or more folders under `cl/`: in several folders if kernel families need
//! different code for the value. The value is described by the header of the file whose folder comes first in `FOLDERS`
//! (`values/folders.rs`). All values without a kernel file are listed here, with their names and descriptions.

use super::header::Header;
use super::values::{header_of, values_of};
use crate::error::{Error, Result, meant};

/// The description of an axis (one choice within a strategy): its name, its meaning, and its values without a
/// kernel file of their own.
#[derive(Clone, Copy, Debug)]
pub struct AxisInfo {
    /// The axis's name in configs.
    pub name: &'static str,
    /// What the axis decides, in a few words.
    pub about: &'static str,
    /// The name and the meaning of each value that has no kernel file of its own.
    pub listed: &'static [(&'static str, &'static str)],
}

impl AxisInfo {
    /// Returns the name and the meaning of each value of the axis.
    pub fn values(&self) -> Vec<(&'static str, &'static str)> {
        let files = values_of(self.name).map(|header| (header.name.as_str(), header.meaning.as_str()));
        self.listed.iter().copied().chain(files).collect()
    }
}

/// A type whose values are the values of one axis.
pub trait Axis: Sized + Copy + Eq + 'static {
    /// The name, the meaning and the listed values of the axis.
    const INFO: AxisInfo;

    /// Returns every value of the axis.
    fn all() -> Vec<Self>;

    /// Returns the value's name in configs and records.
    fn name(self) -> &'static str;

    /// Returns the value with this name. If there is none, returns an error whose advice is the most similar
    /// name or, if no name is similar, the command `raycl strategies`.
    fn parse(name: &str) -> Result<Self> {
        Self::all().into_iter().find(|value| value.name() == name).ok_or_else(|| {
            let names: Vec<_> = Self::all().into_iter().map(Self::name).collect();
            let error = Error::input(format!(
                "'{name}' is not a value of the axis '{}'; expected one of {}",
                Self::INFO.name,
                names.join(", ")
            ));
            error.with_help(meant(name, names).unwrap_or_else(|| {
                let are_files = Self::INFO.listed.is_empty();
                let more = if are_files { "; with --cl-dir DIR, DIR's files are values too" } else { "" };
                format!("`raycl strategies` explains each value{more}")
            }))
        })
    }
}

macro_rules! axis {
    ($(#[$doc:meta])* $type:ident $axis:literal $about:literal {
        $($value:ident $name:literal $meaning:literal,)+
    }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum $type {
            $(#[doc = $meaning] $value,)+
        }
        impl Axis for $type {
            const INFO: AxisInfo = AxisInfo {
                name: $axis,
                about: $about,
                listed: &[$(($name, $meaning)),+],
            };

            fn all() -> Vec<Self> {
                vec![$(Self::$value),+]
            }

            fn name(self) -> &'static str {
                match self {
                    $(Self::$value => $name,)+
                }
            }
        }
    };
}

/// Declares an axis whose values are files. In the declared type, a value consists only of its name, so that
/// strategies can be constants and can be copied. All other properties of a value are stated in the header of
/// the value's file. The type's constants are the values that presets use.
macro_rules! file_axis {
    ($(#[$doc:meta])* $type:ident $axis:literal $about:literal {
        $($value:ident $name:literal,)+
    }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub struct $type(&'static str);

        impl $type {
            $(#[doc = concat!("`", $name, "`")] pub const $value: Self = Self($name);)+

            /// Returns the header of the kernel file that defines this value of the axis.
            pub(super) fn header(self) -> &'static Header {
                header_of($axis, self.0)
            }
        }

        impl Axis for $type {
            const INFO: AxisInfo = AxisInfo { name: $axis, about: $about, listed: &[] };

            fn all() -> Vec<Self> {
                values_of($axis).map(|header| Self(&header.name)).collect()
            }

            fn name(self) -> &'static str {
                self.0
            }
        }
    };
}

axis! {
    /// How the triangles that a ray may hit are found.
    Traversal "traversal" "how the triangles that a ray may hit are found" {
        Exhaustive "exhaustive" "no tree: each ray is tested against one triangle after another, as in the paper",
        Raster "raster" "one work-item per triangle, depth resolved by atomics, then a shading pass",
        Bvh "bvh" "every ray, or packet of rays, walks a tree of boxes",
        Tile "tile" "the rays of a tile, which have a common origin, walk the tree together",
    }
}
file_axis! {
    /// The memory of a work-item's nine working vectors.
    Vectors "vectors" "the memory that holds a work-item's nine working vectors" {
        PRIVATE "private",
        GLOBAL "global",
        HEAP "heap",
        LOCAL "local",
    }
}
file_axis! {
    /// The memory from which triangles are read.
    Triangles "triangles" "the memory from which kernels read triangles" {
        GLOBAL "global",
        CONSTANT "constant",
        LOCAL "local",
        TILED "tiled",
        SPLIT_VERTICES "split-vertices",
        SPLIT_NORMALS "split-normals",
    }
}
file_axis! {
    /// The layout of triangles in memory.
    Layout "layout" "how triangles are laid out in memory" {
        SOUP "soup",
        INDEXED_16 "indexed16",
        INDEXED_32 "indexed32",
    }
}
file_axis! {
    /// When hits are shaded.
    Shading "shading" "when a hit is shaded" {
        EAGER "eager",
        DEFERRED "deferred",
    }
}
axis! {
    /// Whether one kernel casts primary rays and shadow rays, or primary rays have a kernel of their own.
    Passes "passes" "whether one kernel casts the whole frame, or primary rays have a kernel of their own" {
        Fused "fused" "one kernel casts primary rays, shades and casts shadow rays; if work-items share tiles, a second kernel shades",
        Separate "separate" "one kernel finds the nearest hits, another shades them; the kernels are timed separately",
    }
}
file_axis! {
    /// The ray-triangle test.
    Intersector "intersector" "the ray-triangle test" {
        MOLLER_TRUMBORE "moller-trumbore",
        FIVE_VECTORS "five-vectors",
        WATERTIGHT "watertight",
        COMMON_ORIGIN "common-origin",
        PIXEL_LINEAR "pixel-linear",
        EDGE_PLANES "edge-planes",
    }
}
axis! {
    /// The time at which a triangle's data for the ray-triangle test is computed.
    Records "records" "when the data for a ray-triangle test is computed from the triangle" {
        EachTest "each-test" "at each test, from the triangle's corners; with triangles = tiled, whenever a work-group copies the triangle to __local memory; tests with planes, and tiles of rays, compute the data at other times",
        Once "once" "once per scene, by a kernel of its own, which writes a record per triangle to global memory",
    }
}
axis! {
    /// Whether rays hit the back faces of triangles.
    Culling "culling" "whether rays hit the back faces of triangles, or pass through them" {
        None "none" "rays hit both sides of a triangle, as the paper's figures need",
        Back "back" "rays hit only front faces, as in the book's code",
    }
}
axis! {
    /// When the ray-triangle test counts a ray as parallel to a triangle, or as passing outside the triangle.
    Epsilons "epsilons" "when a ray-triangle test counts a ray as parallel to the triangle, or as passing outside it" {
        Paper "paper" "the paper's absolute numbers: |determinant| <= 1e-7, weights < -1e-10",
        Relative "relative" "tolerances relative to the triangle, independent of the scene's scale",
    }
}
axis! {
    /// The number of rays that a work-item casts side by side.
    Width "width" "the number of rays that a work-item casts side by side, in vector types" {
        W1 "1" "one ray, as in the paper",
        W2 "2" "the rays of 2 x 1 pixels",
        W4 "4" "the rays of 2 x 2 pixels",
        W8 "8" "the rays of 4 x 2 pixels",
        W16 "16" "the rays of 4 x 4 pixels (8 x 2 for pixel-linear): a CPU's widest vectors",
    }
}
axis! {
    /// The largest number of children of a tree node.
    NodeWidth "node_width" "the largest number of children of a tree node" {
        N2 "2" "two children",
        N4 "4" "four children: the fastest for single rays on a GPU",
        N8 "8" "eight children, which a CPU tests at once for a single ray, in vectors of 8 numbers",
        N16 "16" "sixteen children, which a CPU tests at once for a single ray, in vectors of 16 numbers",
        N32 "32" "thirty-two children: with traversal = tile on a GPU, each of the 32 work-items that share a tile tests one child",
    }
}
axis! {
    /// The largest number of triangles in a leaf.
    LeafSize "leaf_size" "the largest number of triangles in a leaf of the tree" {
        L4 "4" "at most 4 triangles: good for single rays, each of which is tested against every triangle of a leaf",
        L8 "8" "at most 8 triangles",
        L16 "16" "at most 16 triangles",
        L32 "32" "at most 32 triangles: good for tiles, whose rays share the preparation of a leaf's triangles",
    }
}
axis! {
    /// The size of a tile of rays that traverse a tree together.
    TileSize "tile" "the size of a tile, a rectangle of pixels whose rays walk the tree together" {
        T8x4 "8x4" "32 rays",
        T8x8 "8x8" "64 rays",
        T16x8 "16x8" "128 rays",
        T16x16 "16x16" "256 rays",
        T32x16 "32x16" "512 rays",
    }
}
axis! {
    /// How the compiler may change arithmetic.
    Math "math" "how the compiler may change arithmetic" {
        Strict "strict" "IEEE single precision as OpenCL C defines it",
        Fast "fast" "-cl-fast-relaxed-math",
    }
}

/// Each method of this block has a `match` that names every traversal. If a traversal is added, the compiler
/// therefore reports each method that does not handle the new traversal.
impl Traversal {
    /// Returns true if each primary ray is tested against every triangle.
    pub fn tests_every_triangle(self) -> bool {
        match self {
            Self::Exhaustive => true,
            Self::Raster | Self::Bvh | Self::Tile => false,
        }
    }

    /// Returns true if rays walk a tree, each separately or together in a packet or a tile.
    pub fn walks_tree(self) -> bool {
        match self {
            Self::Bvh | Self::Tile => true,
            Self::Exhaustive | Self::Raster => false,
        }
    }

    /// Returns true if rays are cast in tiles. The kernels for tiles read corners only from the tree.
    pub fn casts_tiles(self) -> bool {
        match self {
            Self::Tile => true,
            Self::Exhaustive | Self::Raster | Self::Bvh => false,
        }
    }

    /// Returns true if a rasteriser takes the place of primary rays: for each triangle, one work-item finds the
    /// pixels that the triangle covers.
    pub fn rasterises(self) -> bool {
        match self {
            Self::Raster => true,
            Self::Exhaustive | Self::Bvh | Self::Tile => false,
        }
    }
}

impl NodeWidth {
    /// Returns the largest number of children of a tree node.
    pub fn children(self) -> usize {
        2 << (self as usize)
    }
}

impl LeafSize {
    /// Returns the largest number of triangles in a leaf.
    pub fn triangles(self) -> usize {
        4 << (self as usize)
    }
}

impl TileSize {
    /// Returns the number of pixels of a tile, across and down.
    pub fn pixels(self) -> (usize, usize) {
        match self {
            Self::T8x4 => (8, 4),
            Self::T8x8 => (8, 8),
            Self::T16x8 => (16, 8),
            Self::T16x16 => (16, 16),
            Self::T32x16 => (32, 16),
        }
    }
}

impl Width {
    /// Returns the number of rays that a work-item casts side by side.
    pub fn rays(self) -> usize {
        1 << (self as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_axis_of_files_is_said_to_get_values_from_a_folder() {
        let remedies = [Layout::parse("qqqqqqqq").err(), Traversal::parse("qqqqqqqq").err()]
            .map(|error| error.expect("no such value").remedy().to_owned());
        let usual = "`raycl strategies` explains each value";
        let of_files = format!("{usual}; with --cl-dir DIR, DIR's files are values too");
        assert_eq!(remedies, [of_files, usual.to_owned()]);
    }
}
