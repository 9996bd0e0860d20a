//! Tests of requirements against the limits of the paper's device, and of the arithmetic at random sizes.

use super::super::{AXES, Cause, PRESETS, Strategy, preset};
use super::*;
use crate::device::LaneOperations;
use proptest::prelude::*;
use proptest::strategy::Strategy as _;

pub(super) const PAPER_DEVICE: DeviceLimits = DeviceLimits {
    local_bytes: 48 << 10,
    constant_bytes: 64 << 10,
    local_is_emulated: false,
    constant_is_emulated: false,
    global_bytes: 1 << 30,
    allocation_bytes: 1 << 28,
    work_group_size: 1024,
    work_item_sizes: [1024, 1024, 64],
    compute_units: 16,
    native_width: 1,
    shares_memory: false,
    is_cpu: false,
    lane_operations: LaneOperations::Barriers,
};

pub(super) fn workload(triangles: usize, local: u32) -> Workload {
    Workload {
        triangles,
        positions: triangles,
        normals: triangles,
        materials: 2,
        lights: 1,
        texture_words: 0,
        mip_levels: false,
        cut_outs: false,
        corner_colours: false,
        emissive: false,
        soft_lights: false,
        area_lights: false,
        sky: false,
        smooth_shadows: false,
        many_samples: false,
        half_light: false,
        given_rays: false,
        sky_texels: 0,
        stack_size: 0,
        image_size: [800, 500],
        local_size: [local, local],
    }
}

/// Returns what a strategy needs of the device that the paper used.
pub(super) fn needs_of(strategy: &Strategy, workload: &Workload) -> Requirements {
    Requirements::of(strategy, workload, PAPER_DEVICE.lane_operations)
}

fn check(name: &str, triangles: usize, local: u32) -> Result<(), Infeasible> {
    let strategy = preset(name).map_err(|e| Infeasible::beyond(e.to_string()))?.strategy;
    Requirements::check(&strategy, &workload(triangles, local), &PAPER_DEVICE)
}

#[test]
fn optimisation_2_holds_472_triangles_in_48_kib() {
    assert_eq!(check("local-triangles", 472, 16), Ok(()));
    let strategy = preset("local-triangles").unwrap().strategy;
    assert_eq!(needs_of(&strategy, &workload(472, 16)).local_bytes, 49088);
    let refused = check("local-triangles", 473, 16).unwrap_err();
    assert_eq!(refused.reason, "__local memory: scene 104 B x 473 triangles = 49192 B > 49152 B");
}

#[test]
fn compounded_holds_206_triangles_beside_16x16_vectors() {
    assert!(check("compounded", 206, 16).is_ok());
    assert!(check("compounded", 207, 16).is_err());
}

#[test]
fn vectors_of_24x24_do_not_fit_48_kib() {
    let refused = check("local-vectors", 1, 24).unwrap_err();
    assert_eq!(refused.reason, "__local memory: vectors 108 B x 24 x 24 = 62208 B > 49152 B");
}

#[test]
fn work_items_of_a_wide_strategy_cover_blocks_of_pixels() {
    let wide = preset("wide").unwrap().strategy;
    assert_eq!(workload(1, 6).global_size(&wide), [204, 126]);
    // Each work-item covers a block of 4 x 4 pixels. Pixels at the image's edges that do not fill a whole block need a
    // work-item too.
    let odd = Workload { image_size: [33, 9], ..workload(1, 1) };
    assert_eq!(odd.global_size(&wide), [9, 3]);
}

#[test]
fn a_buffer_larger_than_the_device_allocates_at_once_is_refused() {
    let refused = check("deferred", 3_000_000, 8).unwrap_err();
    assert_eq!(refused.reason, "largest buffer: scene 104 B x 3000000 triangles = 312000000 B > 268435456 B");
    let wide = Workload { image_size: [8192, 8192], ..workload(4, 8) };
    let strategy = preset("deferred").unwrap().strategy;
    let refused = Requirements::check(&strategy, &wide, &PAPER_DEVICE).unwrap_err();
    assert!(refused.reason.starts_with("largest buffer: image 16 B x 67108864 pixels"), "{}", refused.reason);
}

#[test]
fn records_are_as_long_as_the_test_says() {
    let strategy = preset("deferred").unwrap().strategy;
    let once = Strategy { records: Records::Once, ..strategy };
    let bytes = |strategy| needs_of(strategy, &workload(1000, 8)).global_bytes;
    assert_eq!(bytes(&once) - bytes(&strategy), 48 * 1000);
    assert_eq!(
        Requirements::scene_bytes(&once, &workload(1000, 8)),
        Requirements::scene_bytes(&strategy, &workload(1000, 8))
    );
}

#[test]
fn the_sum_of_buffers_is_held_to_global_memory() {
    let limits = DeviceLimits { allocation_bytes: 1 << 40, ..PAPER_DEVICE };
    let strategy = preset("bvh").unwrap().strategy;
    let refused = Requirements::check(&strategy, &workload(10_000_000, 8), &limits).unwrap_err();
    assert_eq!(
        refused.reason,
        "global memory: scene 104 B x 10000000 triangles + leaves 48 B x 10000008 rows \
         + about 128 B x 2500001 nodes + image 16 B x 400000 pixels \
         + nearest triangles 4 B x 400000 pixels = 1848000512 B > 1073741824 B"
    );
}

#[test]
fn tiles_need_no_copy_of_the_mesh_and_trees_no_more_triangles_than_they_can_name() {
    let w = workload(1_000_000, 1);
    let [tile, deferred] =
        ["tile", "deferred"].map(|name| needs_of(&preset(name).unwrap().strategy, &w).global_bytes);
    assert!(tile < deferred + 40_000_000, "{tile} {deferred}");
    let limits = DeviceLimits { global_bytes: u64::MAX, allocation_bytes: u64::MAX, ..PAPER_DEVICE };
    let many = workload(WideBvh::MAX_INDEX + 1, 8);
    let refused = Requirements::check(&preset("bvh").unwrap().strategy, &many, &limits).unwrap_err();
    assert_eq!(
        refused.reason,
        "a tree's leaves: 33554433 triangles > the 33554432 triangles that leaves can index"
    );
}

#[test]
fn what_a_strategy_lacks_is_told_apart_from_what_a_device_cannot_hold() {
    let strategy = preset("raster").unwrap().strategy;
    let is_lacking = |workload: Workload| {
        Requirements::check(&strategy, &workload, &PAPER_DEVICE).unwrap_err().cause == Cause::Lacking
    };
    let plain = workload(4, 8);
    assert!(is_lacking(Workload { sky: true, ..plain }));
    assert!(is_lacking(Workload { soft_lights: true, ..plain }));
    assert!(is_lacking(Workload { texture_words: 4, ..plain }));
    assert!(!is_lacking(Workload { image_size: [1 << 16, 1 << 16], ..plain }));
}

#[test]
fn a_large_work_group_is_the_cause_only_if_a_smaller_one_fits() {
    let limits = DeviceLimits { is_cpu: true, work_group_size: 4096, ..PAPER_DEVICE };
    let cause = |name: &str, triangles, local_size| {
        let strategy = preset(name).unwrap().strategy;
        let workload = Workload { local_size, stack_size: 64, ..workload(triangles, 8) };
        Requirements::check(&strategy, &workload, &limits).unwrap_err().cause
    };
    assert_eq!(cause("tile", 1, [64, 64]), Cause::LargeGroup, "a thread's stack");
    assert_eq!(cause("wide", 1, [64, 64]), Cause::LargeGroup, "a thread's stack");
    assert_eq!(cause("local-vectors", 1, [24, 24]), Cause::LargeGroup, "__local memory");
    assert_eq!(cause("compounded", 207, [16, 16]), Cause::LargeGroup, "__local memory");
    // The scene alone exceeds the `__local` memory.
    assert_eq!(cause("local-triangles", 473, [16, 16]), Cause::Size);
    assert_eq!(cause("compounded", 473, [16, 16]), Cause::Size);
}

#[test]
fn every_preset_fits_one_triangle() {
    for preset in PRESETS {
        let mut workload = workload(1, 8);
        workload.local_size = preset.strategy.local_size(&PAPER_DEVICE, workload.local_size);
        let fits = Requirements::check(&preset.strategy, &workload, &PAPER_DEVICE);
        assert!(fits.is_ok(), "{}: {fits:?}", preset.name);
    }
}

#[test]
fn a_work_group_keeps_at_most_5_mib_on_the_stack_of_a_cpus_thread() {
    let strategy = preset("tile").unwrap().strategy;
    let limits = DeviceLimits { is_cpu: true, ..PAPER_DEVICE };
    let of = |down| Workload { local_size: [1, down], ..workload(1, 8) };
    let check = |down: u32| Requirements::check(&strategy, &of(down), &limits);
    let bytes = |down| needs_of(&strategy, &of(down)).private_bytes;
    let most = (1..1024).take_while(|down| check(*down).is_ok()).last().unwrap();
    // The user may have set another size of stacks (`ulimit -s`).
    let limit = cpu_stack_bytes(thread_stack_bytes());
    assert!(bytes(most) <= limit && bytes(most + 1) > limit, "{most}");
    assert_eq!([1, 8, 64].map(|mib| cpu_stack_bytes(mib << 20)), [5 << 17, 5 << 20, 5 << 20]);
    assert!(check(most + 1).unwrap_err().reason.starts_with("a CPU thread's stack: "));
    assert!(Requirements::check(&strategy, &of(most + 1), &PAPER_DEVICE).is_ok());
}

#[test]
fn a_shared_tile_has_32_work_items_and_room_for_its_stack() {
    let strategy = preset("tile-group").unwrap().strategy;
    let check = |local_size, stack_size, lane_operations| {
        let workload = Workload { local_size, stack_size, ..workload(1, 8) };
        let limits = DeviceLimits { lane_operations, ..PAPER_DEVICE };
        Requirements::check(&strategy, &workload, &limits)
            .map(|()| Requirements::of(&strategy, &workload, lane_operations).local_bytes)
    };
    let [barriers, ptx] = [LaneOperations::Barriers, LaneOperations::Ptx];
    assert_eq!(check([32, 4], 192, ptx), Ok((192 * 8 + 52 * 32) * 4));
    assert!(
        check([8, 8], 192, ptx)
            .unwrap_err()
            .reason
            .ends_with("must have 32 work-items, which share a tile; use 32 x 1 to 32 x 8")
    );
    assert!(check([8, 8], 192, barriers).unwrap_err().reason.ends_with("; use 32 x 1"));
    assert!(
        check([32, 4], 192, barriers).unwrap_err().reason.contains("can exchange values only with barriers")
    );
    // Only lanes that exchange values by barriers need an array in `__local` memory for these values: two words per
    // lane.
    assert_eq!(check([32, 1], 192, barriers), Ok(192 * 8 + 52 * 32 + 2 * 4 * 32));
    assert_eq!(check([32, 1], 192, ptx), Ok(192 * 8 + 52 * 32));
    let refused = check([32, 4], 1600, ptx).unwrap_err();
    assert!(refused.reason.starts_with("__local memory: stack 8 B x 1600 entries x 4 tiles"), "{refused:?}");
}

#[test]
fn a_shared_tile_is_32_work_items_of_the_frame() {
    let strategy = preset("tile-group").unwrap().strategy;
    let workload = Workload { image_size: [45, 29], local_size: [32, 3], ..workload(1, 8) };
    assert_eq!(workload.global_size(&strategy), [6 * 32, 6]);
}

/// Generates presets with some axes changed.
fn strategies() -> impl proptest::strategy::Strategy<Value = Strategy> {
    let changes = prop::collection::vec(any::<[prop::sample::Index; 2]>(), 0..6);
    (prop::sample::select(PRESETS), changes).prop_map(|(preset, changes)| {
        let mut strategy = preset.strategy;
        for [axis, value] in changes {
            let axis = axis.get(AXES);
            let mut changed = strategy;
            changed.set(axis.name, value.get(&axis.values()).0).unwrap();
            if changed.contradiction().is_none() {
                strategy = changed;
            }
        }
        strategy
    })
}

/// Generates numbers with at most `bits` bits. First, a number of bits from 0 to `bits` is drawn, then a
/// number with at most this number of bits. Numbers with few bits are therefore drawn as often as numbers with
/// many bits.
fn magnitudes(bits: u32) -> impl proptest::strategy::Strategy<Value = u64> {
    (0..=bits, any::<u64>()).prop_map(|(bits, number)| number.checked_shr(64 - bits).unwrap_or(0))
}

fn workloads() -> impl proptest::strategy::Strategy<Value = Workload> {
    let counts = [(); 6].map(|()| magnitudes(64));
    // The sides of an image have up to 30 bits. An image with sides of 30 bits has far more pixels than raycl
    // supports, but the number of pixels still fits into `usize`.
    let side = |bits| magnitudes(bits).prop_map(|side| (side as u32).max(1));
    (counts, [side(30), side(30)], [side(12), side(12)]).prop_map(|(counts, image_size, local_size)| {
        let counts = counts.map(|count| count as usize >> 1);
        let [triangles, positions, normals, materials, lights, texture_words] = counts;
        let counts = Workload { triangles, positions, normals, materials, lights, ..Workload::default() };
        Workload { texture_words, image_size, local_size, ..counts }
    })
}

fn devices() -> impl proptest::strategy::Strategy<Value = DeviceLimits> {
    let bytes = [(); 4].map(|()| magnitudes(64));
    let items = [(); 3].map(|()| magnitudes(14).prop_map(|items| items as usize));
    (bytes, items, any::<bool>()).prop_map(|(bytes, [items, x, y], is_cpu)| {
        let [local_bytes, constant_bytes, global_bytes, allocation_bytes] = bytes;
        DeviceLimits {
            local_bytes,
            constant_bytes,
            global_bytes,
            allocation_bytes,
            work_group_size: items,
            work_item_sizes: [x, y, 1],
            is_cpu,
            ..PAPER_DEVICE
        }
    })
}

/// Returns, for each limit, the larger of two devices' values.
fn better(one: &DeviceLimits, other: &DeviceLimits) -> DeviceLimits {
    let sizes = [0, 1, 2].map(|side| one.work_item_sizes[side].max(other.work_item_sizes[side]));
    DeviceLimits {
        local_bytes: one.local_bytes.max(other.local_bytes),
        constant_bytes: one.constant_bytes.max(other.constant_bytes),
        global_bytes: one.global_bytes.max(other.global_bytes),
        allocation_bytes: one.allocation_bytes.max(other.allocation_bytes),
        work_group_size: one.work_group_size.max(other.work_group_size),
        work_item_sizes: sizes,
        ..*one
    }
}

/// Returns the numbers that occur in a text, in the text's order.
fn numbers(text: &str) -> Vec<u128> {
    text.split(|c: char| !c.is_ascii_digit()).filter_map(|digits| digits.parse().ok()).collect()
}

/// Returns true if the number in a refusal's message exceeds the limit in the message; if the number is a sum, the
/// sum must also be correct. A message without a limit counts as correct.
fn adds_up(reason: &str) -> bool {
    if reason.starts_with("traversal = raster does not support textures") {
        return true; // a reason without numbers
    }
    let arithmetic = reason.split_once(": ").unwrap().1.replace("16-bit", "");
    let Some((needed, limit)) = arithmetic.split_once(" > ") else {
        return reason.starts_with("work-group: "); // a work-group whose shape allows no shared tiles
    };
    let Some((terms, total)) = needed.split_once(" = ") else {
        // The reason compares the two sides of a work-group with their limits, or it compares a single number with a
        // limit.
        return numbers(needed).iter().zip(numbers(limit)).any(|(needed, limit)| *needed > limit);
    };
    let product = |term| numbers(term).into_iter().fold(1, u128::saturating_mul);
    let sum = terms.split(" + ").map(product).fold(0, u128::saturating_add);
    vec![sum] == numbers(total) && sum > numbers(limit)[0]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn a_refusal_adds_up_and_what_is_accepted_fits(
        strategy in strategies(), workload in workloads(), limits in devices(),
    ) {
        match Requirements::check(&strategy, &workload, &limits) {
            Err(refused) => prop_assert!(adds_up(&refused.reason), "{}", refused.reason),
            Ok(()) => {
                let needs = Requirements::of(&strategy, &workload, limits.lane_operations);
                prop_assert!(needs.local_bytes <= limits.local_bytes);
                prop_assert!(needs.constant_bytes <= limits.constant_bytes);
                prop_assert!(needs.scratch_bytes <= limits.allocation_bytes);
                prop_assert!(!limits.is_cpu || needs.private_bytes <= 5 << 20);
                prop_assert!(needs.global_bytes.checked_add(needs.scratch_bytes).unwrap() <= limits.global_bytes);
            }
        }
    }

    #[test]
    fn a_better_device_refuses_nothing_that_a_lesser_one_holds(
        strategy in strategies(), workload in workloads(), one in devices(), other in devices(),
    ) {
        if Requirements::check(&strategy, &workload, &one).is_ok() {
            prop_assert_eq!(Requirements::check(&strategy, &workload, &better(&one, &other)), Ok(()));
        }
    }

    #[test]
    fn more_triangles_pixels_and_work_items_never_need_less(
        strategy in strategies(), less in workloads(), more in workloads(),
    ) {
        let more = Workload {
            triangles: less.triangles.max(more.triangles),
            positions: less.positions.max(more.positions),
            normals: less.normals.max(more.normals),
            materials: less.materials.max(more.materials),
            lights: less.lights.max(more.lights),
            texture_words: less.texture_words.max(more.texture_words),
            image_size: [0, 1].map(|side| less.image_size[side].max(more.image_size[side])),
            local_size: less.local_size,
            ..more
        };
        let (less, more) = (needs_of(&strategy, &less), needs_of(&strategy, &more));
        let bytes = |needs: Requirements| [
            needs.local_bytes, needs.constant_bytes, needs.scratch_bytes, needs.private_bytes, needs.global_bytes,
        ];
        for (less, more) in bytes(less).into_iter().zip(bytes(more)) {
            prop_assert!(less <= more, "{} > {}", less, more);
        }
    }
}
