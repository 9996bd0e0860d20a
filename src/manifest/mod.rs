//! The manifest: a table that describes the kernels in `cl/` for the host, by family.
//!
//! A [`Family`] is a set of kernels that casts a frame. The table has a row for each family. A family's row
//! names the family's kernels with their parameters, the defines for compilation, and the values of axes that
//! the family supports. A family's row also names one file, which includes all other files of the family. A
//! family's row determines which source is compiled and hashed, how arguments are bound, which kernel's
//! registers are reported and which strategies are allowed.

mod constants;
mod define_lists;
mod families;
mod kernels;
#[cfg(test)]
mod labels;
mod parameters;
#[cfg(test)]
mod tests;

pub use constants::{
    AREA_LIGHT_FLOATS, GROUP_LANES, HALF_LIGHT_SHARPNESS, INTERLEAVED, LIGHT_FLOATS, NO_HIT, ROUGH_STEPS,
    ROW_FLOATS, SAMPLED_BLOCK, SOFT_HEAD_FLOATS, TEXTURE_HEAD_WORDS, TILE_TRIANGLES, WORKING_VECTORS,
    soup_floats,
};
pub use families::{BVH, EXHAUSTIVE, FAMILIES, RASTER, TILE_CPU, TILE_GPU};
pub use parameters::{CAMERA, PROBE_LANES, Parameter, parameter_macro};

/// A condition that decides whether a kernel has a parameter, or whether a program has a kernel or a define. Most
/// conditions are properties of a strategy, a scene or a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fact {
    /// A condition that is true of every strategy.
    Always,
    /// Each triangle has its own copies of its vertices (`layout = soup`).
    Soup,
    /// Triangles have indices into common sets of positions, normals and materials.
    Indexed,
    /// Work-groups copy the triangles into `__local` memory, `TILE_TRIANGLES` at a time.
    Tiled,
    /// Rays walk a tree.
    Tree,
    /// Planes of each triangle are prepared for the eye and each light.
    Planes,
    /// For each triangle, a record with data for the ray-triangle test is prepared before the first frame.
    Records,
    /// Working vectors lie in a scratch buffer.
    Scratch,
    /// Working vectors lie in a pool with an allocator.
    Heap,
    /// The scene has textures: a property of the scene, not of the strategy.
    Textured,
    /// The corners of triangles have colours: a property of the scene.
    CornerColours,
    /// Surfaces emit light: a property of the scene.
    Emissive,
    /// The scene has a sky, or lights with a radius or an area that are sampled: a property of the scene.
    Soft,
    /// Hits are lit as if they lay on a smooth surface above their triangles (smooth shadows): a property of
    /// the scene.
    SmoothShadows,
    /// The scene has area lights (rectangles or discs), whether they are sampled or treated as points: a
    /// property of the scene.
    AreaLights,
    /// Pixels get several samples: a property of the picture.
    Sampled,
    /// The scene has cut-outs (triangles with holes): a property of the scene.
    CutOut,
    /// The sky is a picture: a property of the scene.
    Environment,
    /// Soft light is cast at half resolution: a property of the picture.
    HalfLight,
    /// The kernel for primary rays also casts shadow rays and, unless work-items share tiles, shades the
    /// hits.
    Fused,
    /// The kernel for primary rays only finds the nearest hits.
    Separate,
    /// The program has a kernel for leftover shadow rays alone, because the shading kernel does not always
    /// cast these rays.
    Leftover,
    /// The caller provides rays. A separate kernel casts these rays; no frame needs this kernel.
    GivenRays,
}

/// The role of a kernel: the part of a frame's work that the kernel does, or its work outside of frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Prepares the planes of each triangle for the eye and the lights.
    Prepare,
    /// Casts primary rays and shadow rays and, unless work-items share tiles, shades the hits.
    Frame,
    /// Finds the nearest hits of primary rays. If several kernels find the hits together, only the first of
    /// these kernels has the role `Primary`.
    Primary,
    /// Finds the triangle at the nearest depth of each pixel, if the primary kernel finds only this depth.
    Resolve,
    /// Casts shadow rays.
    Shadow,
    /// Casts leftover shadow rays.
    Leftover,
    /// Shades the nearest hits. If no kernel has the role `Shadow`, the kernel with the role `Shade` also
    /// casts shadow rays.
    Shade,
    /// Shows the sky's picture where rays have hit nothing.
    Background,
    /// Casts rays that the caller provides; not part of a frame.
    Rays,
    /// Prepares records of triangles before the first frame; not part of a frame.
    Records,
    /// Decides which pixels get more samples; runs between a picture's frames.
    Mark,
    /// Filters the ratio of the two half pictures (half the width and height) of soft light; runs after a picture's
    /// frames.
    FilterLight,
    /// Multiplies the whole picture by the filtered ratio.
    ApplyLight,
}

impl Role {
    /// Returns what a kernel of this role does, as words that follow "a kernel that".
    pub fn work(self) -> &'static str {
        match self {
            Self::Prepare => "prepares the planes of triangles",
            Self::Frame => "casts a whole frame",
            Self::Primary => "casts primary rays",
            Self::Resolve => "finds the triangles at the nearest depths",
            Self::Shadow => "casts shadow rays",
            Self::Leftover => "casts leftover shadow rays",
            Self::Shade => "shades the nearest hits",
            Self::Background => "shows the sky",
            Self::Rays => "casts arbitrary rays",
            Self::Records => "prepares records of triangles",
            Self::Mark => "decides which pixels get more samples",
            Self::FilterLight => "filters soft light",
            Self::ApplyLight => "applies filtered soft light",
        }
    }
}

/// A kernel of a family, as the host has to know it.
#[derive(Debug)]
pub struct Kernel {
    /// The kernel's name in the source.
    pub name: &'static str,
    /// The work that the kernel does, in a frame or outside of frames.
    pub role: Role,
    /// The condition under which a program contains the kernel.
    pub when: Fact,
    /// The kernel's parameters in order, in groups. Kernels may share a group.
    pub parameters: &'static [&'static [Parameter]],
}

impl Kernel {
    /// Returns true if the kernel casts primary rays. The registers and the occupancy of this kernel are
    /// reported for the strategy.
    pub fn is_main(&self) -> bool {
        matches!(self.role, Role::Frame | Role::Primary)
    }

    /// Returns the kernel's parameters whose condition (`when`) is true. `holds` returns true if a condition
    /// is true.
    pub fn parameters(&self, holds: impl Fn(Fact) -> bool) -> impl Iterator<Item = &'static Parameter> {
        self.parameters.iter().copied().flatten().filter(move |parameter| holds(parameter.when))
    }

    /// Returns the kernel's parameter list in OpenCL C, as a macro named after the kernel. The source of every kernel
    /// of a family has this macro in place of a parameter list.
    pub fn parameter_macro(&self, holds: impl Fn(Fact) -> bool) -> String {
        parameter_macro(self.name, self.parameters(holds))
    }
}

/// The values of a strategy's axis that a kernel family supports.
#[derive(Clone, Copy, Debug)]
pub enum Supported {
    /// The kernel family supports only the listed values of the rule's axis.
    Only(&'static [&'static str]),
    /// The kernel family supports all values of the rule's axis except the listed values.
    AllBut(&'static [&'static str]),
    /// The kernel family supports the values of the rule's axis that have a file in this folder. If a
    /// condition is given, values for which the condition is true are excluded.
    FilesIn(&'static str, Option<Fact>),
}

impl Supported {
    /// Returns true if the family supports the value `value` of the rule's axis. For a folder of kernel
    /// files, `has_file` returns true if the folder has a file for `value`. For a condition, `holds` returns
    /// true if the condition is true of a strategy with `value`.
    pub fn take(&self, value: &str, has_file: impl Fn(&str) -> bool, holds: impl Fn(Fact) -> bool) -> bool {
        match self {
            Self::Only(values) => values.contains(&value),
            Self::AllBut(values) => !values.contains(&value),
            Self::FilesIn(folder, but) => has_file(folder) && !but.is_some_and(holds),
        }
    }
}

/// An axis of strategies of which a kernel family supports only some values.
#[derive(Debug)]
pub struct Rule {
    /// The name of the strategy's axis, such as `width`.
    pub axis: &'static str,
    /// The supported values. If the strategy's axis has no effect in the family, the family supports only one
    /// value of the axis.
    pub takes: Supported,
    /// The reason why the family supports only these values. In messages, the reason follows the family's label, for
    /// example "uses its own edge functions".
    pub because: &'static str,
}

/// A family of kernels.
#[derive(Debug)]
pub struct Family {
    /// The family's name, such as `tile-cpu`.
    pub name: &'static str,
    /// The description of the family's strategies in messages.
    pub label: &'static str,
    /// The file under `cl/` that includes all other files of the kernel family.
    pub entry: &'static str,
    /// The kernels of the family. A program contains only those kernels whose condition (`when`) is true.
    pub kernels: &'static [Kernel],
    /// The names of the family's defines, in groups. Families may share a group.
    pub defines: &'static [&'static [(Fact, &'static str)]],
    /// The rules of the kernel family. A rule names an axis of strategies, and the values of the axis that
    /// the family supports.
    pub rules: &'static [Rule],
}

impl Family {
    /// Returns the family's first kernel with this role; `None` if the family has no such kernel.
    pub fn kernel(&self, role: Role) -> Option<&'static Kernel> {
        self.kernels.iter().find(|kernel| kernel.role == role)
    }

    /// Returns true if the family supports scenes with the property `fact`, such as `Textured`, or `Soft` for
    /// soft lights and a sky. The family supports such scenes if one of its kernels has a parameter with the
    /// condition `fact`.
    pub fn takes(&self, fact: Fact) -> bool {
        let parameters = self.kernels.iter().flat_map(|kernel| kernel.parameters.iter().copied().flatten());
        parameters.into_iter().any(|parameter| parameter.when == fact)
    }

    fn kernel_named(&self, name: &str) -> Option<&'static Kernel> {
        self.kernels.iter().find(|kernel| kernel.name == name)
    }

    /// Returns the names of the defines whose condition is true. `holds` returns true if a condition is true.
    pub fn defines(&self, holds: impl Fn(Fact) -> bool) -> impl Iterator<Item = &'static str> {
        self.defines.iter().copied().flatten().filter(move |(when, _)| holds(*when)).map(|(_, name)| *name)
    }
}

/// Returns true if the kernel of this name casts primary rays. The registers of this kernel are reported.
pub fn is_main(name: &str) -> bool {
    FAMILIES.iter().filter_map(|family| family.kernel_named(name)).any(Kernel::is_main)
}
