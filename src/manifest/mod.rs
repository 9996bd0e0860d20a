//! The manifest of kernel families: one table of what the host knows of the kernels in `cl/`.
//!
//! A [`Family`] is a way to cast a frame. Its row names the file that everything else is included from, its kernels with
//! their parameters, the defines it is compiled with and the values of axes it takes. What is compiled and hashed, how
//! arguments are bound, whose registers count and which strategies are legal all follow from it.

mod constants;
mod families;
#[cfg(test)]
mod labels;
mod parameters;
#[cfg(test)]
mod tests;

pub use constants::{
    GROUP_LANES, LIGHT_FLOATS, NO_HIT, ROW_FLOATS, SOFT_HEAD_FLOATS, SOUP_FLOATS, TEXTURE_HEAD_WORDS,
    TILE_TRIANGLES, WORKING_VECTORS,
};
pub use families::{BVH, EXHAUSTIVE, FAMILIES, RASTER, TILE_CPU, TILE_GPU};
pub use parameters::{CAMERA, PROBE_LANES, Parameter, parameter_macro};

/// What a parameter, a kernel or a define is there for: a fact of a strategy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fact {
    /// True of every strategy.
    Always,
    /// Triangles are laid out as the soup.
    Soup,
    /// Triangles are laid out as the OBJ's sets with indices.
    Indexed,
    /// Triangles are streamed through `__local` memory.
    Tiled,
    /// Rays walk a tree.
    Tree,
    /// A row per triangle is prepared for the eye and each light.
    Planes,
    /// A record per triangle is prepared once per scene.
    Records,
    /// Working vectors lie in a scratch buffer.
    Scratch,
    /// Working vectors lie in a pool with an allocator.
    Heap,
    /// Triangles of the scene have textures: a fact of what is cast, not of the strategy.
    Textured,
    /// Lights with a radius or a sky are sampled: a fact of what is cast, too.
    Soft,
}

/// What a kernel is for in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Prepares triangles for the eye and the lights.
    Prepare,
    /// Casts primary rays and all, or as much as one kernel can, of what follows.
    Frame,
    /// Finds the nearest hits of primary rays; of several kernels that do, the first.
    Primary,
    /// Finishes what the primary kernel began.
    Resolve,
    /// Casts shadow rays.
    Shadow,
    /// Casts those that were left over.
    LeftOver,
    /// Shades nearest hits; where no kernel is for shadow rays, it casts them.
    Shade,
    /// Casts any rays, and is no part of a frame.
    Rays,
    /// Prepares records of triangles, once per scene: no part of a frame either.
    Records,
}

/// A kernel.
#[derive(Debug)]
pub struct Kernel {
    /// Its name in the source.
    pub name: &'static str,
    /// What it is for.
    pub role: Role,
    /// When there is such a kernel.
    pub when: Fact,
    /// Its parameters in order, in groups that kernels share.
    pub parameters: &'static [&'static [Parameter]],
}

impl Kernel {
    /// Whether its registers and its occupancy are those of the whole: it casts primary rays.
    pub fn is_main(&self) -> bool {
        matches!(self.role, Role::Frame | Role::Primary)
    }

    /// Its parameters where these facts hold.
    pub fn parameters(&self, holds: impl Fn(Fact) -> bool) -> impl Iterator<Item = &'static Parameter> {
        self.parameters.iter().copied().flatten().filter(move |parameter| holds(parameter.when))
    }

    /// Its parameter list in OpenCL C, as a macro that is called after it: the only one there is.
    pub fn parameter_macro(&self, holds: impl Fn(Fact) -> bool) -> String {
        parameter_macro(self.name, self.parameters(holds))
    }
}

/// The values of an axis that a family takes.
#[derive(Clone, Copy, Debug)]
pub enum Values {
    /// These.
    Only(&'static [&'static str]),
    /// All but these.
    AllBut(&'static [&'static str]),
    /// The values that have a file in this folder. With a fact, only those of which the fact is false.
    FilesIn(&'static str, Option<Fact>),
}

impl Values {
    /// Whether a value is among them: `has_file` says whether it has a file in a folder, `holds` what is true of a strategy
    /// that has it.
    pub fn take(&self, value: &str, has_file: impl Fn(&str) -> bool, holds: impl Fn(Fact) -> bool) -> bool {
        match self {
            Self::Only(values) => values.contains(&value),
            Self::AllBut(values) => !values.contains(&value),
            Self::FilesIn(folder, but) => has_file(folder) && !but.is_some_and(holds),
        }
    }
}

/// An axis that a family does not take all values of.
#[derive(Debug)]
pub struct Rule {
    /// The axis.
    pub axis: &'static str,
    /// What is taken. An axis that the family ignores keeps one value, which stands for none.
    pub takes: Values,
    /// Why, after the family's label: "walks no tree".
    pub because: &'static str,
}

/// A family of kernels.
#[derive(Debug)]
pub struct Family {
    /// Its name.
    pub name: &'static str,
    /// The strategies it is for, as messages tell them.
    pub label: &'static str,
    /// The file under `cl/` that everything else is included from.
    pub entry: &'static str,
    /// Its kernels.
    pub kernels: &'static [Kernel],
    /// The names of its defines, in groups that families share.
    pub defines: &'static [&'static [(Fact, &'static str)]],
    /// The axes that it does not take all values of.
    pub rules: &'static [Rule],
}

impl Family {
    /// Its first kernel for something, if it has one.
    pub fn kernel(&self, role: Role) -> Option<&'static Kernel> {
        self.kernels.iter().find(|kernel| kernel.role == role)
    }

    /// Whether it takes a scene of which this is true: textures, soft lights or a sky.
    pub fn takes(&self, fact: Fact) -> bool {
        let parameters = self.kernels.iter().flat_map(|kernel| kernel.parameters.iter().copied().flatten());
        parameters.into_iter().any(|parameter| parameter.when == fact)
    }

    /// Its kernel of this name.
    pub fn kernel_named(&self, name: &str) -> Option<&'static Kernel> {
        self.kernels.iter().find(|kernel| kernel.name == name)
    }

    /// Its defines where these facts hold.
    pub fn defines(&self, holds: impl Fn(Fact) -> bool) -> impl Iterator<Item = &'static str> {
        self.defines.iter().copied().flatten().filter(move |(when, _)| holds(*when)).map(|(_, name)| *name)
    }
}

/// Whether a kernel of this name casts primary rays: of a frame's kernels its registers count.
pub fn is_main(name: &str) -> bool {
    FAMILIES.iter().filter_map(|family| family.kernel_named(name)).any(Kernel::is_main)
}
