//! Presets, which are named strategies: those of the student paper that raycl reproduces, and faster ones.

use super::{
    Culling, Epsilons, Intersector, LISTED, Layout, LeafSize, Math, NodeWidth, Passes, Records, Shading,
    Strategy, TileSize, Traversal, Triangles, Vectors, Width,
};
use crate::device::DeviceKind;
use crate::error::{Error, Result, meant};

/// A named strategy.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// The preset's name in configs.
    pub name: &'static str,
    /// A short description of the preset.
    pub about: &'static str,
    /// The strategy that the preset names: a value on every axis.
    pub strategy: Strategy,
    /// The kind of device that the preset is meant for. On other kinds, an experiment measures the preset only
    /// if its config has `any_kind = true`, or if `--set` names the preset. `None` means all kinds.
    pub meant_for: Option<DeviceKind>,
}

/// The strategy of the first kernel in the paper that raycl reproduces. The presets for all other kernels of
/// the paper differ from `PAPER` in a few axes (choices).
const PAPER: Strategy = Strategy {
    traversal: Traversal::Exhaustive,
    vectors: Vectors::HEAP,
    triangles: Triangles::GLOBAL,
    layout: Layout::SOUP,
    shading: Shading::EAGER,
    passes: Passes::Fused,
    intersector: Intersector::MOLLER_TRUMBORE,
    records: Records::EachTest,
    culling: Culling::None,
    epsilons: Epsilons::Paper,
    width: Width::W1,
    node_width: NodeWidth::N8,
    leaf_size: LeafSize::L4,
    tile: TileSize::T32x16,
    math: Math::Strict,
};

/// The strategy of the preset `deferred`. The preset `raster`, and all presets after `deferred`, differ from
/// `MODERN` in a few axes.
const MODERN: Strategy = Strategy {
    vectors: Vectors::PRIVATE,
    shading: Shading::DEFERRED,
    passes: Passes::Separate,
    epsilons: Epsilons::Relative,
    ..PAPER
};

/// The base of presets that cast rays in tiles, with the rays of a tile in wide vectors. The passes of these
/// presets are fused, since a tile's hits are best shaded while the tile's triangles are in the caches.
const TILE: Strategy = Strategy {
    traversal: Traversal::Tile,
    passes: Passes::Fused,
    width: Width::W16,
    node_width: NodeWidth::N16,
    leaf_size: LeafSize::L8,
    intersector: Intersector::EDGE_PLANES,
    ..MODERN
};

/// The base of presets in which 32 work-items share a tile. With fused passes, tiles that have finished the
/// rays from the eye continue with shadow rays while other tiles still cast rays from the eye. The preset with
/// the watertight test has separate passes, because this test needs too many registers for fused passes.
const TILE_GROUP: Strategy = Strategy {
    traversal: Traversal::Tile,
    passes: Passes::Fused,
    node_width: NodeWidth::N32,
    leaf_size: LeafSize::L32,
    tile: TileSize::T8x8,
    intersector: Intersector::COMMON_ORIGIN,
    ..MODERN
};

/// Every preset. The presets for the paper's kernels come first.
pub const PRESETS: &[Preset] = &[
    Preset {
        name: "naive",
        about: "the paper's first kernel: vectors from an in-kernel malloc, triangles in global memory",
        strategy: PAPER,
        meant_for: None,
    },
    Preset {
        name: "naive-scratch",
        about: "naive without the malloc: vectors in a preallocated global buffer",
        strategy: Strategy { vectors: Vectors::GLOBAL, ..PAPER },
        meant_for: None,
    },
    Preset {
        name: "naive-test-vectors",
        about: "naive, with five more vectors in memory at each ray-triangle test, as in the function `intersect` of the paper's author",
        strategy: Strategy { intersector: Intersector::FIVE_VECTORS, ..PAPER },
        meant_for: None,
    },
    Preset {
        name: "private",
        about: "vectors in private memory: the paper's static arrays, with which its kernel failed to launch",
        strategy: Strategy { vectors: Vectors::PRIVATE, ..PAPER },
        meant_for: None,
    },
    Preset {
        name: "local-vectors",
        about: "the paper's optimisation 1: vectors in __local memory",
        strategy: Strategy { vectors: Vectors::LOCAL, ..PAPER },
        meant_for: None,
    },
    Preset {
        name: "local-triangles",
        about: "the paper's optimisation 2: all triangles in __local memory",
        strategy: Strategy { triangles: Triangles::LOCAL, ..PAPER },
        meant_for: None,
    },
    Preset {
        name: "compounded",
        about: "the paper's optimisations 1 and 2 together, which the paper could not combine",
        strategy: Strategy { vectors: Vectors::LOCAL, triangles: Triangles::LOCAL, ..PAPER },
        meant_for: None,
    },
    Preset {
        name: "constant-triangles",
        about: "vectors in private memory, triangles in __constant memory",
        strategy: Strategy { vectors: Vectors::PRIVATE, triangles: Triangles::CONSTANT, ..PAPER },
        meant_for: None,
    },
    Preset {
        name: "split-vertices",
        about: "a next step that the paper proposes: indexed triangles, with vertices in __local memory and normals in global memory",
        strategy: Strategy { triangles: Triangles::SPLIT_VERTICES, layout: Layout::INDEXED_16, ..PAPER },
        meant_for: None,
    },
    Preset {
        name: "split-normals",
        about: "the reverse of split-vertices: indexed triangles, with normals in __local memory and vertices in global memory",
        strategy: Strategy { triangles: Triangles::SPLIT_NORMALS, layout: Layout::INDEXED_16, ..PAPER },
        meant_for: None,
    },
    Preset {
        name: "raster",
        about: "another next step that the paper proposes: the book's rasteriser, with the ray caster's shading",
        strategy: Strategy { traversal: Traversal::Raster, ..MODERN },
        meant_for: None,
    },
    Preset {
        name: "deferred",
        about: "vectors in private memory; each pixel is shaded once, at the nearest hit",
        strategy: MODERN,
        meant_for: None,
    },
    Preset {
        name: "tiled",
        about: "deferred, with triangles streamed through __local memory",
        strategy: Strategy { triangles: Triangles::TILED, ..MODERN },
        meant_for: None,
    },
    Preset {
        name: "watertight",
        about: "deferred, with the watertight test: no ray slips through a shared edge or vertex",
        strategy: Strategy { intersector: Intersector::WATERTIGHT, ..MODERN },
        meant_for: None,
    },
    Preset {
        name: "wide",
        about: "deferred, 16 rays per work-item in vector types: fits a CPU's vectors",
        strategy: Strategy { width: Width::W16, ..MODERN },
        meant_for: Some(DeviceKind::Cpu),
    },
    Preset {
        name: "wide-common-origin",
        about: "wide, with the test common-origin: planes through each edge and the eye or a light",
        strategy: Strategy { width: Width::W16, intersector: Intersector::COMMON_ORIGIN, ..MODERN },
        meant_for: Some(DeviceKind::Cpu),
    },
    Preset {
        name: "wide-pixel-linear",
        about: "wide, with planes through the eye and each edge as linear functions of the pixel's x and y: fewest operations per ray-triangle test",
        strategy: Strategy { width: Width::W16, intersector: Intersector::PIXEL_LINEAR, ..MODERN },
        meant_for: Some(DeviceKind::Cpu),
    },
    Preset {
        name: "tiled-wide",
        about: "tiled, 4 rays per work-item: the test moller-trumbore in the form that suits GPUs",
        strategy: Strategy { width: Width::W4, triangles: Triangles::TILED, ..MODERN },
        meant_for: Some(DeviceKind::Gpu),
    },
    Preset {
        name: "tiled-pixel-linear",
        about: "triangles as pixel-linear planes, streamed through __local memory, 16 rays per work-item: fewest operations per ray-triangle test on a GPU",
        strategy: Strategy {
            width: Width::W16,
            intersector: Intersector::PIXEL_LINEAR,
            triangles: Triangles::TILED,
            ..MODERN
        },
        meant_for: Some(DeviceKind::Gpu),
    },
    Preset {
        name: "tiled-common-origin",
        about: "common-origin planes streamed through __local memory, 8 rays per work-item",
        strategy: Strategy {
            width: Width::W8,
            intersector: Intersector::COMMON_ORIGIN,
            triangles: Triangles::TILED,
            ..MODERN
        },
        meant_for: Some(DeviceKind::Gpu),
    },
    Preset {
        name: "bvh",
        about: "deferred and watertight, each ray walking a tree of four children per node: fastest on a GPU for scenes with soft light, or with more triangles than pixels",
        strategy: Strategy {
            traversal: Traversal::Bvh,
            node_width: NodeWidth::N4,
            intersector: Intersector::WATERTIGHT,
            ..MODERN
        },
        meant_for: None,
    },
    Preset {
        name: "bvh-packet",
        about: "deferred, packets of 16 rays walking a tree of eight children per node",
        strategy: Strategy { traversal: Traversal::Bvh, width: Width::W16, ..MODERN },
        meant_for: Some(DeviceKind::Cpu),
    },
    Preset {
        name: "tile",
        about: "tiles of 512 rays walking a tree together in vectors of 16: fastest for big scenes on a CPU",
        strategy: TILE,
        meant_for: Some(DeviceKind::Cpu),
    },
    Preset {
        name: "tile-watertight",
        about: "tile, with the watertight test: no ray slips through a shared edge or vertex",
        strategy: Strategy { intersector: Intersector::WATERTIGHT, ..TILE },
        meant_for: Some(DeviceKind::Cpu),
    },
    Preset {
        name: "tile-group",
        about: "tiles of 64 rays; 32 work-items share each tile and walk a tree of 32 children per node: for big scenes on a GPU",
        strategy: TILE_GROUP,
        meant_for: Some(DeviceKind::Gpu),
    },
    Preset {
        name: "tile-group-watertight",
        about: "tile-group, with the watertight test: no ray slips through a shared edge or vertex",
        strategy: Strategy { intersector: Intersector::WATERTIGHT, passes: Passes::Separate, ..TILE_GROUP },
        meant_for: Some(DeviceKind::Gpu),
    },
];

/// Returns the preset with this name. If no preset has this name, returns an error that lists all names and, if
/// one of them is similar, suggests it.
pub fn preset(name: &str) -> Result<&'static Preset> {
    PRESETS.iter().find(|preset| preset.name == name).ok_or_else(|| {
        let names = preset_names();
        let error = Error::input(format!("'{name}' is not a preset; the presets are {}", names.join(", ")));
        error.with_help(meant(name, names).unwrap_or_else(|| LISTED.to_owned()))
    })
}

/// Returns the names of all presets.
pub fn preset_names() -> Vec<&'static str> {
    PRESETS.iter().map(|preset| preset.name).collect()
}

/// Returns the name of the preset whose strategy equals `strategy`; `None` if there is none.
pub fn preset_of(strategy: &Strategy) -> Option<&'static str> {
    PRESETS.iter().find(|preset| preset.strategy == *strategy).map(|preset| preset.name)
}

/// Returns a strategy as the option `--strategy` accepts it, in few words: the preset that differs in the fewest axes,
/// and the strategy's values of these axes, as in `deferred,width=4`.
pub fn short_name(strategy: &Strategy) -> String {
    let own = strategy.axes();
    let differing = |preset: &Preset| -> Vec<String> {
        let pairs = own.iter().zip(preset.strategy.axes());
        let others = pairs.filter(|(own, of_preset)| **own != *of_preset);
        others.map(|((axis, value), _)| format!("{axis}={value}")).collect()
    };
    let all = PRESETS.iter().map(|preset| (preset.name, differing(preset)));
    match all.min_by_key(|(_, axes)| axes.len()) {
        Some((name, axes)) => [vec![name.to_owned()], axes].concat().join(","),
        None => strategy.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::choice::parse_strategy;

    #[test]
    fn a_strategy_is_named_by_the_nearest_preset_and_the_axes_that_differ() {
        for preset in PRESETS {
            assert_eq!(preset_of(&preset.strategy), Some(short_name(&preset.strategy).as_str()));
            let mut culls = preset.strategy;
            culls.set("culling", "back").expect("an axis");
            let text = short_name(&culls);
            assert_eq!(text.matches('=').count(), 1, "{text}");
            assert!(text.ends_with(",culling=back"), "{text}");
            assert_eq!(parse_strategy(&text).expect("a strategy"), culls, "{text}");
        }
    }

    /// A preset's name, the values in which its strategy differs from another strategy, and the devices that it is
    /// meant for.
    type Row = (&'static str, &'static str, Option<DeviceKind>);

    /// The paper's presets, as differences from `naive`.
    const OF_PAPER: &[Row] = &[
        ("naive", "", None),
        ("naive-scratch", "vectors=global", None),
        ("naive-test-vectors", "intersector=five-vectors", None),
        ("private", "vectors=private", None),
        ("local-vectors", "vectors=local", None),
        ("local-triangles", "triangles=local", None),
        ("compounded", "vectors=local triangles=local", None),
        ("constant-triangles", "vectors=private triangles=constant", None),
        ("split-vertices", "triangles=split-vertices layout=indexed16", None),
        ("split-normals", "triangles=split-normals layout=indexed16", None),
    ];

    /// The other presets, as differences from `deferred`.
    const OF_RAYCL: &[Row] = &[
        ("raster", "traversal=raster", None),
        ("deferred", "", None),
        ("tiled", "triangles=tiled", None),
        ("watertight", "intersector=watertight", None),
        ("wide", "width=16", Some(DeviceKind::Cpu)),
        ("wide-common-origin", "intersector=common-origin width=16", Some(DeviceKind::Cpu)),
        ("wide-pixel-linear", "intersector=pixel-linear width=16", Some(DeviceKind::Cpu)),
        ("tiled-wide", "triangles=tiled width=4", Some(DeviceKind::Gpu)),
        ("tiled-pixel-linear", "triangles=tiled intersector=pixel-linear width=16", Some(DeviceKind::Gpu)),
        ("tiled-common-origin", "triangles=tiled intersector=common-origin width=8", Some(DeviceKind::Gpu)),
        ("bvh", "traversal=bvh intersector=watertight node_width=4", None),
        ("bvh-packet", "traversal=bvh width=16", Some(DeviceKind::Cpu)),
        (
            "tile",
            "traversal=tile passes=fused intersector=edge-planes width=16 node_width=16 leaf_size=8",
            Some(DeviceKind::Cpu),
        ),
        (
            "tile-watertight",
            "traversal=tile passes=fused intersector=watertight width=16 node_width=16 leaf_size=8",
            Some(DeviceKind::Cpu),
        ),
        (
            "tile-group",
            "traversal=tile passes=fused intersector=common-origin node_width=32 leaf_size=32 tile=8x8",
            Some(DeviceKind::Gpu),
        ),
        (
            "tile-group-watertight",
            "traversal=tile intersector=watertight node_width=32 leaf_size=32 tile=8x8",
            Some(DeviceKind::Gpu),
        ),
    ];

    /// Returns the text `base` of a strategy (`axis=value axis=value ...`), but with the values that the text
    /// `changes` states for some of the axes.
    fn changed(base: &str, changes: &str) -> String {
        let value = |own: &str| {
            let axis = own.split_once('=').map(|(axis, _)| axis);
            let instead =
                changes.split(' ').find(|change| change.split_once('=').map(|(axis, _)| axis) == axis);
            instead.unwrap_or(own).to_owned()
        };
        base.split(' ').map(value).collect::<Vec<_>>().join(" ")
    }

    /// Names of presets stand in stored records and in the documents, so a preset must not change.
    #[test]
    fn every_preset_is_the_strategy_that_its_name_stands_for() {
        let naive = "traversal=exhaustive vectors=heap triangles=global layout=soup shading=eager passes=fused \
                     intersector=moller-trumbore records=each-test culling=none epsilons=paper width=1 node_width=8 \
                     leaf_size=4 tile=32x16 math=strict";
        let deferred = changed(naive, "vectors=private shading=deferred passes=separate epsilons=relative");
        let strategies = |base: &str, presets: &[Row]| {
            let whole = |&(name, changes, kind): &Row| (name, changed(base, changes), kind);
            presets.iter().map(whole).collect::<Vec<_>>()
        };
        let expected = [strategies(naive, OF_PAPER), strategies(&deferred, OF_RAYCL)].concat();
        let all = PRESETS.iter().map(|preset| (preset.name, preset.strategy.to_string(), preset.meant_for));
        assert_eq!(all.collect::<Vec<_>>(), expected);
    }

    #[test]
    fn every_preset_makes_sense() {
        for preset in PRESETS {
            assert_eq!(preset.strategy.contradiction(), None, "{}", preset.name);
        }
    }
}
