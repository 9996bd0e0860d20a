//! What the host asks of values that are files: their headers answer.

use super::{
    Intersector, Layout, Records, Shading, Strategy, Traversal, Triangles, Vectors, Width, Workload,
};
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
        match self.header().word("memory") {
            "local" => WorkingMemory::Local,
            "scratch" => WorkingMemory::Scratch,
            "heap" => WorkingMemory::Heap,
            _ => WorkingMemory::Private,
        }
    }

    /// Bytes of a ray's.
    pub fn bytes_per_ray(self) -> u64 {
        self.header().number("bytes_per_ray").unwrap_or(0).into()
    }
}

/// What a work-group copies to `__local` memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Copied {
    /// Nothing: triangles are read from where the host put them.
    Nothing,
    /// All of the scene.
    Scene,
    /// Positions.
    Vertices,
    /// Normals.
    Normals,
    /// What a test reads, a tile of triangles at a time.
    Rows,
}

impl Triangles {
    /// What is copied to `__local` memory.
    pub fn copied(self) -> Copied {
        match self.header().word("copied") {
            "scene" => Copied::Scene,
            "vertices" => Copied::Vertices,
            "normals" => Copied::Normals,
            "rows" => Copied::Rows,
            _ => Copied::Nothing,
        }
    }

    /// Whether the host puts them in `__constant` memory.
    pub fn are_constant(self) -> bool {
        self.header().word("read_from") == "constant"
    }

    /// Whether triangles, or parts of each, are copied to `__local` memory whole.
    pub fn are_staged(self) -> bool {
        matches!(self.copied(), Copied::Scene | Copied::Vertices | Copied::Normals)
    }

    /// Whether what a test reads can come from a table in global memory: at once, or a tile at a time.
    pub fn take_tables(self) -> bool {
        !self.are_constant() && !self.are_staged()
    }
}

impl Layout {
    /// Bits of an index, where there are indices.
    pub fn index_bits(self) -> Option<u32> {
        self.header().word("index_bits").parse().ok()
    }
}

impl Shading {
    /// Whether every hit is shaded that is nearer than the best so far.
    pub fn is_eager(self) -> bool {
        self.header().word("shades") == "each-nearer-hit"
    }
}

impl Intersector {
    /// Floats of a triangle that is prepared for the test.
    pub fn record_floats(self) -> usize {
        self.header().number("record_floats").unwrap_or(0) as usize
    }

    /// Whether a row per triangle is prepared for the eye and each light.
    pub fn prepares_planes(self) -> bool {
        matches!(self.header().word("prepared_for"), "origin" | "pixels")
    }

    /// Whether primary rays are counted in pixels: their planes are linear in the pixel, and t is depth.
    pub fn counts_in_pixels(self) -> bool {
        self.header().word("prepared_for") == "pixels"
    }

    /// Whether it needs exact signs, which math = fast does not keep.
    pub fn needs_exact_signs(self) -> bool {
        self.header().word("exact_signs") == "yes"
    }

    /// Operations of a test up to the first proof of a miss, where its file counts them.
    pub fn operations(self) -> Option<u32> {
        self.header().number("operations")
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
            Fact::Tiled => self.triangles.copied() == Copied::Rows,
            Fact::Tree => self.needs_tree(),
            Fact::Planes => self.intersector.prepares_planes(),
            Fact::Records => self.records == Records::Once,
            Fact::Scratch => self.vectors.memory() == WorkingMemory::Scratch,
            Fact::Heap => self.vectors.memory() == WorkingMemory::Heap,
            Fact::Textured | Fact::Soft => false,
        }
    }

    /// The same of it and of what it casts.
    pub fn holds_of(&self, fact: Fact, workload: &Workload) -> bool {
        match fact {
            Fact::Textured => workload.is_textured(),
            Fact::Soft => workload.is_soft() && self.family().takes(Fact::Soft),
            of_strategy => self.holds(of_strategy),
        }
    }
}
