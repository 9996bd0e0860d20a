//! What is compiled for a point: source text and defines, and their hash.

use super::Sources;
use crate::device::{Builtins, LaneOperations};
use crate::error::Result;
use crate::strategy::{
    Culling, Epsilons, Intersector, Layout, Math, Strategy, TILE_TRIANGLES, Traversal, Triangles, Workload,
};

/// Everything that decides a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProgramSpec {
    /// One OpenCL C text.
    pub source: String,
    /// The compiler's options, defines first, in a fixed order.
    pub options: String,
}

impl ProgramSpec {
    /// The program of `strategy` for a workload. Sizes of the scene are defines only where `__local` arrays
    /// depend on them, so that other scenes share the program.
    pub fn new(
        sources: &Sources,
        strategy: &Strategy,
        workload: &Workload,
        builtins: Builtins,
    ) -> Result<Self> {
        let mut options: Vec<String> = defines(strategy, workload, builtins)
            .into_iter()
            .map(|(name, value)| format!("-D {name}={value}"))
            .collect();
        let lanes = if strategy.shares_tiles() { builtins.lanes } else { LaneOperations::Barriers };
        options.extend(lanes.options(builtins.opencl_3));
        options.push("-cl-kernel-arg-info".to_owned());
        if strategy.math == Math::Fast {
            options.push("-cl-fast-relaxed-math".to_owned());
        }
        Ok(Self { source: sources.flatten(strategy)?, options: options.join(" ") })
    }

    /// A hash of source and options.
    pub fn hash(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(self.options.as_bytes()).update(b"\0").update(self.source.as_bytes());
        hasher.finalize().to_hex()[..16].to_string()
    }
}

/// Every define, its name and value.
fn defines(strategy: &Strategy, workload: &Workload, builtins: Builtins) -> Vec<(&'static str, u64)> {
    let staged =
        matches!(strategy.triangles, Triangles::Local | Triangles::SplitVertices | Triangles::SplitNormals);
    let if_staged = |count: usize| if staged { count as u64 } else { 0 };
    let mut defines = vec![
        ("WIDTH", strategy.width.rays() as u64),
        ("BLOCK_X", strategy.block().0 as u64),
        ("LOCAL_X", u64::from(workload.local_size[0])),
        ("LOCAL_Y", u64::from(workload.local_size[1])),
        ("CULL_BACK", u64::from(strategy.culling == Culling::Back)),
        ("PAPER_EPSILONS", u64::from(strategy.epsilons == Epsilons::Paper)),
        ("FAST_MATH", u64::from(strategy.math == Math::Fast)),
        ("RASTER", u64::from(strategy.traversal == Traversal::Raster)),
        ("TREE", u64::from(strategy.needs_tree())),
        ("TILES", u64::from(strategy.traversal == Traversal::Tile)),
        ("WATERTIGHT", u64::from(strategy.intersector == Intersector::Watertight)),
        ("REDUCE_BUILTIN", u64::from(builtins.reduce)),
        ("PREFETCH", u64::from(builtins.prefetch)),
        ("TRIANGLES", if_staged(workload.triangles)),
    ];
    if strategy.triangles == Triangles::Tiled {
        defines.push(("TILE_TRIANGLES", TILE_TRIANGLES));
    }
    if strategy.needs_tree() {
        let (across, down) = strategy.tile.pixels();
        defines.push(("NODE_WIDTH", strategy.node_width.children() as u64));
        defines.push(("STACK_SIZE", workload.stack_size as u64));
        defines.push(("TILE_X", across as u64));
        defines.push(("TILE_Y", down as u64));
    }
    if strategy.layout != Layout::Soup {
        defines.push(("INDEX_BITS", if strategy.layout == Layout::Indexed16 { 16 } else { 32 }));
        defines.push(("POSITIONS", if_staged(workload.positions)));
        defines.push(("NORMALS", if_staged(workload.normals)));
        defines.push(("MATERIALS", if_staged(workload.materials)));
    }
    defines
}
