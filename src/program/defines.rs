//! Computes the values of the defines that the manifest (`crate::manifest`) lists for a kernel family.

use crate::accel::{NORMAL_FLOATS, PADDING_ROWS, WideBvh};
use crate::device::Builtins;
use crate::manifest::{
    AREA_LIGHT_FLOATS, Fact, GROUP_LANES, HALF_LIGHT_SHARPNESS, INTERLEAVED, LIGHT_FLOATS, NO_HIT,
    ROUGH_STEPS, ROW_FLOATS, SAMPLED_BLOCK, SOFT_HEAD_FLOATS, TEXTURE_HEAD_WORDS, TILE_TRIANGLES,
    WORKING_VECTORS, soup_floats,
};
use crate::scene::{AreaShape, COLOUR_STEPS, LEAST_ALPHA_UNIT, Material, Triangle, Wrap};
use crate::strategy::{Culling, Epsilons, Math, Strategy, Workload};

/// The defines that state whether a fact holds, usually a property of the strategy, the scene or the picture: 1
/// if the fact holds, otherwise 0.
const SWITCHES: &[(&str, Fact)] = &[
    ("TREE", Fact::Tree),
    ("PLANES_OF_ORIGIN", Fact::Planes),
    ("RECORDS_ONCE", Fact::Records),
    ("TEXTURES", Fact::Textured),
    ("CORNER_COLOURS", Fact::CornerColours),
    ("EMISSIVE", Fact::Emissive),
    ("CUTOUTS", Fact::CutOut),
    ("SOFT", Fact::Soft),
    ("ENVIRONMENT", Fact::Environment),
    ("SMOOTH_SHADOWS", Fact::SmoothShadows),
    ("AREA_LIGHTS", Fact::AreaLights),
    ("SAMPLED", Fact::Sampled),
    ("HALF_LIGHT", Fact::HalfLight),
    ("FUSED", Fact::Fused),
    ("LEFTOVER_KERNEL", Fact::Leftover),
    ("GIVEN_RAYS", Fact::GivenRays),
];

/// Returns the value of the define `name`; `None` if no define has this name, or if the define has no value for
/// the strategy (`INDEX_BITS` for a layout without indices).
pub(super) fn value_of(
    name: &str,
    strategy: &Strategy,
    workload: &Workload,
    builtins: Builtins,
) -> Option<u64> {
    switch(name, strategy, workload)
        .or_else(|| of_strategy(name, strategy))
        .or_else(|| of_workload(name, strategy, workload))
        .or_else(|| of_device(name, strategy, builtins))
        .or_else(|| constant(name))
}

fn switch(name: &str, strategy: &Strategy, workload: &Workload) -> Option<u64> {
    let (_, fact) = SWITCHES.iter().find(|(define, _)| *define == name)?;
    Some(u64::from(strategy.holds_of(*fact, workload)))
}

fn of_strategy(name: &str, strategy: &Strategy) -> Option<u64> {
    let (tile_x, tile_y) = strategy.tile.pixels();
    let children = strategy.node_width.children();
    Some(match name {
        "WIDTH" => strategy.width.rays() as u64,
        "BLOCK_X" => strategy.block().0 as u64,
        "CULL_BACK" => u64::from(strategy.culling == Culling::Back),
        "PAPER_EPSILONS" => u64::from(strategy.epsilons == Epsilons::Paper),
        "FAST_MATH" => u64::from(strategy.math == Math::Fast),
        "LINEAR_IN_PIXEL" => u64::from(strategy.intersector.counts_in_pixels()),
        "WATERTIGHT" => u64::from(strategy.intersector.needs_exact_signs()),
        "RECORD_FLOATS" => strategy.intersector.record_floats() as u64,
        "INDEX_BITS" => u64::from(strategy.layout.index_bits()?),
        "NODE_WIDTH" => children as u64,
        "NODE_STRIDE" => WideBvh::stride(children) as u64,
        "TILE_X" => tile_x as u64,
        "TILE_Y" => tile_y as u64,
        "LIGHTS_OF_ROUND" => strategy.lights_of_round() as u64,
        _ => return None,
    })
}

fn of_workload(name: &str, strategy: &Strategy, workload: &Workload) -> Option<u64> {
    let if_staged = |count: usize| if strategy.triangles.are_staged() { count as u64 } else { 0 };
    Some(match name {
        "LOCAL_X" => u64::from(workload.local_size[0]),
        "LOCAL_Y" => u64::from(workload.local_size[1]),
        "TRIANGLES" => if_staged(workload.triangles),
        "POSITIONS" => if_staged(workload.positions),
        "NORMALS" => if_staged(workload.normals),
        "MATERIALS" => if_staged(workload.materials),
        "STACK_SIZE" => workload.stack_size as u64,
        "MIPS" => u64::from(workload.mip_levels),
        "LIGHT_FLOATS" if workload.area_lights => AREA_LIGHT_FLOATS as u64,
        "LIGHT_FLOATS" => LIGHT_FLOATS as u64,
        "MATERIAL_FLOATS" => Material::floats(workload.emissive) as u64,
        "SOUP_STRIDE" => soup_floats(workload.emissive) as u64,
        "SKY" => u64::from(workload.sky && strategy.family().takes(Fact::Soft)),
        "TILES_ACROSS" => workload.tiles_of_group()[0] as u64,
        _ => return None,
    })
}

fn of_device(name: &str, strategy: &Strategy, builtins: Builtins) -> Option<u64> {
    Some(match name {
        "REDUCE_BUILTIN" => u64::from(builtins.reduce),
        "PREFETCH" => u64::from(builtins.prefetch),
        "LANE_OPERATIONS" => strategy.lane_operations(builtins) as u64,
        _ => return None,
    })
}

fn constant(name: &str) -> Option<u64> {
    Some(match name {
        "NO_HIT" => NO_HIT as u64,
        "ROW_FLOATS" => ROW_FLOATS as u64,
        "NORMAL_FLOATS" => NORMAL_FLOATS as u64,
        "SOFT_HEAD_FLOATS" => SOFT_HEAD_FLOATS as u64,
        "AREA_DISC" => AreaShape::Disc as u64,
        "TEXTURE_HEAD_WORDS" => TEXTURE_HEAD_WORDS as u64,
        "COLOUR_STEPS" => u64::from(COLOUR_STEPS),
        "LEAST_ALPHA_UNIT" => u64::from(LEAST_ALPHA_UNIT),
        "WRAP_REPEAT" => Wrap::Repeat as u64,
        "WRAP_CLAMP" => Wrap::Clamp as u64,
        "WRAP_MIRROR" => Wrap::Mirror as u64,
        "WORKING_VECTORS" => WORKING_VECTORS as u64,
        "TILE_TRIANGLES" => TILE_TRIANGLES,
        "SAMPLED_BLOCK" => u64::from(SAMPLED_BLOCK),
        "ROUGH_STEPS" => u64::from(ROUGH_STEPS),
        "INTERLEAVED" => u64::from(INTERLEAVED),
        "HALF_LIGHT_SHARPNESS" => u64::from(HALF_LIGHT_SHARPNESS),
        "GROUP_LANES" => u64::from(GROUP_LANES),
        "LEAF_COUNT_SHIFT" => u64::from(WideBvh::COUNT_SHIFT),
        "LEAF_MOST" => WideBvh::MAX_LEAF_SIZE as u64,
        "PADDING_ROWS" => PADDING_ROWS as u64,
        "MESH_WORDS" => Triangle::WORDS as u64,
        "MESH_NORMALS" => Triangle::FIRST_NORMAL as u64,
        "UNUSED_WORD" => u64::from(WideBvh::UNUSED),
        _ => return None,
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::strategy::preset;

    #[test]
    fn a_switch_follows_the_axis_of_its_name_and_no_other() {
        let switches = [
            ("culling", "back", "CULL_BACK"),
            ("epsilons", "paper", "PAPER_EPSILONS"),
            ("math", "fast", "FAST_MATH"),
        ];
        let mut off = preset("naive").unwrap().strategy;
        for (axis, value) in [("culling", "none"), ("epsilons", "relative"), ("math", "strict")] {
            off.set(axis, value).unwrap();
        }
        for (axis, value, name) in switches {
            let mut strategy = off;
            strategy.set(axis, value).unwrap();
            for (.., other) in switches {
                assert_eq!(of_strategy(other, &strategy), Some(u64::from(other == name)), "{axis}: {other}");
            }
        }
    }
}
