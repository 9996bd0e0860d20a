//! What the host must know of values that are files: of each value here, and nowhere else.

use super::{Intersector, Layout, Strategy, Traversal, Triangles, Vectors, Width};
use crate::manifest::{BVH, EXHAUSTIVE, Fact, Family, RASTER, TILE_CPU, TILE_GPU};

/// Where working vectors live.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkingMemory {
    /// Private memory.
    Private,
    /// `__local` memory.
    Local,
    /// A buffer that the host allocates for all work-items.
    Scratch,
    /// A pool that the kernel allocates from.
    Heap,
}

impl Vectors {
    /// Where they live.
    pub fn memory(self) -> WorkingMemory {
        match self {
            Self::Private => WorkingMemory::Private,
            Self::Local => WorkingMemory::Local,
            Self::Global => WorkingMemory::Scratch,
            Self::Heap => WorkingMemory::Heap,
        }
    }
}

impl Triangles {
    /// Whether triangles, or parts of each, are copied to `__local` memory whole.
    pub fn are_staged(self) -> bool {
        matches!(self, Self::Local | Self::SplitVertices | Self::SplitNormals)
    }

    /// Whether they are read from where the host put them.
    pub fn are_in_place(self) -> bool {
        matches!(self, Self::Global | Self::Constant)
    }
}

impl Layout {
    /// Bits of an index, where there are indices.
    pub fn index_bits(self) -> Option<u32> {
        match self {
            Self::Soup => None,
            Self::Indexed16 => Some(16),
            Self::Indexed32 => Some(32),
        }
    }
}

impl Intersector {
    /// Whether a row a triangle is prepared for the eye and each light.
    pub fn prepares_planes(self) -> bool {
        matches!(self, Self::CommonOrigin | Self::PixelLinear)
    }

    /// Whether primary rays are counted in pixels: their planes are linear in the pixel, and t is depth.
    pub fn counts_in_pixels(self) -> bool {
        self == Self::PixelLinear
    }

    /// Whether it needs exact signs, which math = fast does not keep.
    pub fn needs_exact_signs(self) -> bool {
        self == Self::Watertight
    }

    /// Whether it knows the paper's epsilons.
    pub fn has_paper_epsilons(self) -> bool {
        self == Self::MollerTrumbore
    }
}

impl Strategy {
    /// The kernels it is cast with.
    pub fn family(&self) -> &'static Family {
        match self.traversal {
            Traversal::Exhaustive => &EXHAUSTIVE,
            Traversal::Bvh => &BVH,
            Traversal::Raster => &RASTER,
            Traversal::Tile if self.width == Width::W1 => &TILE_GPU,
            Traversal::Tile => &TILE_CPU,
        }
    }

    /// Whether a fact of the manifest is true of it.
    pub fn holds(&self, fact: Fact) -> bool {
        match fact {
            Fact::Always => true,
            Fact::Soup => self.layout.index_bits().is_none(),
            Fact::Indexed => self.layout.index_bits().is_some(),
            Fact::Tiled => self.triangles == Triangles::Tiled,
            Fact::Tree => self.needs_tree(),
            Fact::Planes => self.intersector.prepares_planes(),
            Fact::Scratch => self.vectors.memory() == WorkingMemory::Scratch,
            Fact::Heap => self.vectors.memory() == WorkingMemory::Heap,
        }
    }
}
