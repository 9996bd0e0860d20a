//! Tests of exact numbers of bytes, and of limits that are just reached.

use super::super::preset;
use super::tests::{PAPER_DEVICE, needs_of, workload};
use super::*;
use crate::device::LaneOperations;

fn of(name: &str) -> Strategy {
    preset(name).unwrap().strategy
}

fn with(name: &str, axis: &str, value: &str) -> Strategy {
    let mut strategy = of(name);
    strategy.set(axis, value).unwrap();
    strategy
}

fn refusal(strategy: &Strategy, workload: &Workload, limits: &DeviceLimits) -> String {
    Requirements::check(strategy, workload, limits).map_or_else(|refused| refused.reason, |()| String::new())
}

#[test]
fn a_tile_keeps_33_words_of_each_ray() {
    let bytes = |name, local_size| {
        let tile = with(name, "tile", "8x8");
        needs_of(&tile, &Workload { local_size, ..workload(1, 1) }).private_bytes
    };
    assert_eq!(bytes("tile", [2, 3]), 33 * 4 * 64 * 2 * 3);
    assert_eq!(bytes("tile-group", [32, 2]), 33 * 4 * 64 * 2, "32 work-items share a tile");
}

#[test]
fn private_vectors_count_where_all_work_items_keep_them_at_once() {
    let bytes = |name| needs_of(&of(name), &workload(1, 4)).private_bytes;
    assert_eq!([bytes("wide"), bytes("bvh-packet")], [108 * 16 * 16; 2]);
    assert_eq!(bytes("private"), 0);
    assert_eq!(bytes("tiled"), 108 * 16);
}

#[test]
fn soft_light_at_half_resolution_takes_two_half_pictures_and_their_ratios() {
    let bytes = |half_light| {
        let w = Workload { half_light, image_size: [200, 101], local_size: [32, 1], ..workload(1, 1) };
        needs_of(&of("tile-group"), &w).global_bytes
    };
    // Each half picture (of half the width and height) has the same data per pixel as the picture of full
    // size. The data of a pixel are a value of the image, the nearest triangle, one entry of the queue of
    // leftover shadow rays (rays that tiles do not finish), and a word whose bits say which lights reach the
    // pixel's hit. Each half picture also has the triangle's planes for the eye and the light.
    assert_eq!(bytes(true) - bytes(false), (2 * (16 + 4 + 8 + 4) + 16) * 100 * 51 + 2 * 2 * 48);
    let scratch = |half_light| {
        let w = Workload { half_light, image_size: [64, 64], local_size: [8, 8], ..workload(1, 1) };
        needs_of(&of("naive-scratch"), &w).scratch_bytes
    };
    assert_eq!(scratch(true), scratch(false) * 3 / 2);
}

#[test]
fn several_samples_per_pixel_take_two_words_per_block_and_with_a_picture_of_the_sky_one_per_pixel() {
    let more = |sky_texels| {
        let [one, many] = [false, true].map(|many_samples| {
            let w = Workload { many_samples, sky_texels, image_size: [801, 502], ..workload(1, 1) };
            needs_of(&of("naive"), &w).global_bytes
        });
        many - one
    };
    // There are 201 x 126 blocks of 4 x 4 pixels, some of which reach beyond the picture.
    assert_eq!([more(0), more(8)], [2 * 4 * 201 * 126, 2 * 4 * 201 * 126 + 4 * 801 * 502]);
}

#[test]
fn what_a_heap_takes_is_held_to_global_memory() {
    let (strategy, w) = (of("naive"), workload(1, 8));
    let needs = needs_of(&strategy, &w);
    assert_eq!(needs.scratch_bytes, 108 * 800 * 504);
    let limits = DeviceLimits { global_bytes: needs.global_bytes + needs.scratch_bytes, ..PAPER_DEVICE };
    assert_eq!(refusal(&strategy, &w, &limits), "");
    let less = DeviceLimits { global_bytes: limits.global_bytes - 1, ..limits };
    assert!(refusal(&strategy, &w, &less).starts_with("global memory: "));
}

#[test]
fn a_limit_that_an_experiment_sets_is_told_from_the_devices_own() {
    let w = workload(1000, 8);
    for (name, memory) in [("local-vectors", "__local"), ("constant-triangles", "__constant")] {
        let own = DeviceLimits { local_bytes: 1000, constant_bytes: 1000, ..PAPER_DEVICE };
        let emulated = DeviceLimits { local_is_emulated: true, constant_is_emulated: true, ..own };
        let reason = refusal(&of(name), &w, &own);
        assert!(reason.starts_with(memory) && reason.ends_with(" B > 1000 B"), "{reason}");
        assert_eq!(refusal(&of(name), &w, &emulated), format!("{reason}, the limit in [emulate]"));
    }
}

#[test]
fn what_a_shared_tile_hands_on_is_counted() {
    let bytes = |side: u32| {
        let w = Workload { image_size: [side, side], local_size: [32, 1], ..workload(1, 1) };
        needs_of(&of("tile-group"), &w).global_bytes
    };
    // A pixel's bytes have four parts: a value of the image, the nearest triangle, one entry of the queue of
    // leftover shadow rays, and a word whose bits say which lights reach the pixel's hit.
    assert_eq!(bytes(200) - bytes(100), (16 + 4 + 8 + 4) * 30_000);
}

#[test]
fn nodes_are_about_as_many_as_half_full_leaves_need() {
    let nodes = |leaf| node_bytes(&with("tile", "leaf_size", leaf), &workload(10_000, 1)).1;
    let children = of("tile").node_width.children() as u64;
    assert_eq!(nodes("32"), 30_000 / (16 * (children - 1)) + 1);
    assert_eq!(nodes("4"), 30_000 / (4 * (children - 1)) + 1);
}

#[test]
fn planes_are_kept_for_the_eye_and_each_light() {
    let bytes =
        |lights| needs_of(&of("wide-common-origin"), &Workload { lights, ..workload(1000, 1) }).global_bytes;
    assert_eq!(bytes(3) - bytes(0), 3 * 48 * 1000);
    assert_eq!(bytes(0) - needs_of(&of("wide"), &workload(1000, 1)).global_bytes, 48 * 1000);
}

#[test]
fn each_side_of_a_work_group_has_its_own_limit() {
    let limits = DeviceLimits { work_group_size: 64, work_item_sizes: [64, 8, 1], ..PAPER_DEVICE };
    let reason = |local_size| refusal(&of("deferred"), &Workload { local_size, ..workload(1, 1) }, &limits);
    assert_eq!((reason([64, 1]), reason([8, 8])), (String::new(), String::new()));
    assert_eq!(reason([1, 16]), "work-group: 1 x 16 work-items > the device's limit of 64 x 8");
    assert_eq!(reason([13, 5]), "work-group: 13 x 5 = 65 work-items > the device's limit of 64");
}

#[test]
fn indices_of_16_bits_reach_65536_entries() {
    let strategy = with("deferred", "layout", "indexed16");
    let limits = DeviceLimits { global_bytes: 1 << 40, allocation_bytes: 1 << 40, ..PAPER_DEVICE };
    let entries = |positions, normals, materials| {
        let w = Workload { positions, normals, materials, ..workload(1000, 8) };
        refusal(&strategy, &w, &limits)
    };
    assert_eq!(entries(65_536, 65_536, 65_536), "");
    for reason in [entries(65_537, 1, 1), entries(1, 65_537, 1), entries(1, 1, 65_537)] {
        let expected = "16-bit indices: 65537 positions, normals or materials in the scene > 65536 of each that 16 bits can index; use layout = indexed32";
        assert_eq!(reason, expected);
    }
}

/// The device in this test has enough memory for any image.
#[test]
fn a_heap_has_no_more_values_than_its_counter_counts() {
    let limits = DeviceLimits { global_bytes: u64::MAX, allocation_bytes: u64::MAX, ..PAPER_DEVICE };
    let reason = |strategy: &Strategy, items| {
        refusal(strategy, &Workload { image_size: [items, 1], ..workload(1, 1) }, &limits)
    };
    // A work-item's working vectors have 27 values, each with one number per ray. A counter of 32 bits can
    // therefore count the values of 2^32 / 27 = 159,072,862.8 work-items.
    assert_eq!(reason(&of("naive"), 159_072_862), "");
    let expected = "heap: 27 values x 159072863 x 1 work-items = 4294967301 > 4294967295, the largest number that kernels can count";
    assert_eq!(reason(&of("naive"), 159_072_863), expected);
    let wide = with("naive", "width", "4");
    assert_eq!([2, 4].map(|times| reason(&wide, times * 100_000_000).is_empty()), [true, false]);
    assert_eq!(reason(&of("naive-scratch"), 159_072_863), "");
}

#[test]
fn a_queue_has_no_more_entries_than_its_counter_counts() {
    let limits = DeviceLimits { global_bytes: u64::MAX, allocation_bytes: u64::MAX, ..PAPER_DEVICE };
    let reason = |name, image_size| {
        let w = Workload { image_size, local_size: [32, 1], stack_size: 8, ..workload(1, 1) };
        refusal(&of(name), &w, &limits)
    };
    assert_eq!(reason("tile-group", [65_536, 65_535]), "");
    let expected = "queue of leftover shadow rays: 4294967296 rays from the eye > 4294967295, the largest number that kernels can count";
    assert_eq!(reason("tile-group", [65_536, 65_536]), expected);
    assert_eq!(reason("deferred", [65_536, 65_536]), "");
}

#[test]
fn trees_alone_are_held_to_what_their_words_can_name() {
    let limits = DeviceLimits { global_bytes: u64::MAX, allocation_bytes: u64::MAX, ..PAPER_DEVICE };
    let many = workload(WideBvh::MAX_INDEX + 1, 8);
    assert_eq!(refusal(&of("deferred"), &many, &limits), "");
    assert_eq!(refusal(&of("bvh"), &workload(WideBvh::MAX_INDEX, 8), &limits), "");
}

#[test]
fn a_sum_that_is_its_limit_fits() {
    let mut sum = Sum::default();
    sum.add("rows", &[(48, " B"), (10, "")]);
    assert!(sum.within("memory", 480).is_ok() && sum.each_within(480).is_ok());
    assert_eq!(sum.within("memory", 479).unwrap_err().reason, "memory: rows 48 B x 10 = 480 B > 479 B");
}

#[test]
fn more_than_32_work_items_across_share_no_tile() {
    let limits = DeviceLimits { lane_operations: LaneOperations::Ptx, ..PAPER_DEVICE };
    let w = Workload { local_size: [64, 1], stack_size: 8, ..workload(1, 1) };
    assert!(refusal(&of("tile-group"), &w, &limits).contains("must have 32 work-items, which share a tile"));
}
