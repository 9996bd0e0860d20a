//! Properties of axis values, which the headers of kernel files state.

use super::{Intersector, Layout, Shading, Triangles, Vectors};

/// The memory in which a ray's working vectors (origin, direction, normal and others) are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkingMemory {
    /// The private memory of a work-item.
    Private,
    /// The `__local` memory of a work-group.
    Local,
    /// A buffer in global memory that the host allocates for the working vectors of all work-items.
    Scratch,
    /// The heap: a buffer in global memory from which each work-item of the kernel allocates its working
    /// vectors.
    Heap,
}

impl Vectors {
    /// Returns the memory in which a ray's nine working vectors are.
    pub fn memory(self) -> WorkingMemory {
        match self.header().word("memory") {
            "local" => WorkingMemory::Local,
            "scratch" => WorkingMemory::Scratch,
            "heap" => WorkingMemory::Heap,
            _ => WorkingMemory::Private,
        }
    }

    /// Returns the bytes of a ray's working vectors.
    pub fn bytes_per_ray(self) -> u64 {
        self.header().number("bytes_per_ray").unwrap_or(0).into()
    }
}

/// The data that a work-group copies to `__local` memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Copied {
    /// The work-group copies nothing: triangles are read from the memory in which the host put them.
    Nothing,
    /// The whole scene: positions, normals and materials.
    Scene,
    /// The mesh's positions.
    Vertices,
    /// The mesh's normals.
    Normals,
    /// Rows (a row is the data that the ray-triangle test reads of one triangle). The work-group copies the rows of one
    /// tile of triangles at a time.
    Rows,
}

impl Triangles {
    /// Returns the data that each work-group copies to `__local` memory.
    pub fn copied(self) -> Copied {
        match self.header().word("copied") {
            "scene" => Copied::Scene,
            "vertices" => Copied::Vertices,
            "normals" => Copied::Normals,
            "rows" => Copied::Rows,
            _ => Copied::Nothing,
        }
    }

    /// Returns true if kernels read triangles from `__constant` memory.
    pub fn are_constant(self) -> bool {
        self.header().word("read_from") == "constant"
    }

    /// Returns true if all triangles, or only their positions or their normals, are copied to `__local`
    /// memory in one step.
    pub fn are_staged(self) -> bool {
        matches!(self.copied(), Copied::Scene | Copied::Vertices | Copied::Normals)
    }

    /// Returns true if the ray-triangle test can read the data of each triangle from a table in global
    /// memory. The test reads the table directly, or a work-group first copies the rows of one tile of
    /// triangles from the table to `__local` memory.
    pub fn take_tables(self) -> bool {
        !self.are_constant() && !self.are_staged()
    }
}

impl Layout {
    /// Returns the number of bits of an index; `None` if the layout has no indices.
    pub fn index_bits(self) -> Option<u32> {
        self.header().word("index_bits").parse().ok()
    }
}

impl Shading {
    /// Returns true if each hit that is nearer than all earlier hits of the ray is shaded at once. Returns
    /// false if only the ray's nearest hit is shaded, after the search.
    pub fn is_eager(self) -> bool {
        self.header().word("shades") == "each-nearer-hit"
    }
}

impl Intersector {
    /// Returns the number of floats in a triangle's row (the numbers that the ray-triangle test reads of the
    /// triangle).
    pub fn record_floats(self) -> usize {
        self.header().number("record_floats").unwrap_or(0) as usize
    }

    /// Returns true if the ray-triangle test reads planes of each triangle that were prepared for the eye and
    /// each light.
    pub fn prepares_planes(self) -> bool {
        matches!(self.header().word("prepared_for"), "origin" | "pixels")
    }

    /// Returns true if the directions of primary rays are given in pixel coordinates. The planes for primary
    /// rays are then stored as linear functions of these coordinates, and the t of a hit is its depth.
    pub fn counts_in_pixels(self) -> bool {
        self.header().word("prepared_for") == "pixels"
    }

    /// Returns true if the ray-triangle test needs the exact signs of computed values, which `math = fast`
    /// does not preserve.
    pub fn needs_exact_signs(self) -> bool {
        self.header().word("exact_signs") == "yes"
    }

    /// Returns how many operations the ray-triangle test takes to show that a ray misses a triangle; `None` if the
    /// header of the test's file does not state this number.
    pub fn operations(self) -> Option<u32> {
        self.header().number("operations")
    }
}
