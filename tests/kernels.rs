//! Casts pictures on PoCL with every preset at every local size, and with a pairwise cover (see
//! common/cover.rs). Compares the pictures with the reference. `make test-long` tests all of these
//! combinations. `make test` tests a third of the cover's strategies, and each preset at 8 x 8 and at up to two other
//! local sizes. Presets whose work-items share tiles are an exception: they have a single local size.

use crate::common::apart::apart;
use crate::common::cover::pairwise_cover;
use crate::common::{COMMON_LOCAL_SIZE, Stand, compiles_soon, is_long, one_preset_of_each_family, scene};
use glam::{Vec3, vec3};
use raycl::device::Builtins;
use raycl::program::Sources;
use raycl::scene::{Camera, Scene};
use raycl::strategy::{Layout, PRESETS, Passes, Strategy, Traversal, Vectors, Width, preset};
use std::ops::Range;

/// The local sizes of the student paper that raycl reproduces, and three local sizes that are not square.
const LOCAL_SIZES: [[u32; 2]; 13] = [
    [1, 1],
    [2, 2],
    [4, 4],
    [6, 6],
    [8, 8],
    [10, 10],
    [12, 12],
    [14, 14],
    [16, 16],
    [32, 32],
    [64, 1],
    [32, 2],
    [3, 5],
];

/// The size of the tests' images. The width and the height are odd, so that no even number of work-items or
/// rays divides them.
const SIZE: [u32; 2] = [45, 29];

type Point = (Strategy, [u32; 2]);

/// Compares the pictures of points (strategies at local sizes) with the reference. Panics with a list of all
/// points whose pictures are wrong, or that do not fit the device and for which `may_not_fit` returns false.
fn all_agree(
    stand: &mut Stand,
    points: impl IntoIterator<Item = Point>,
    may_not_fit: impl Fn(&Point) -> bool,
) {
    let mut wrong = Vec::new();
    for point @ (strategy, local_size) in points {
        let reason = match stand.check(&strategy, local_size) {
            Ok(verdict) if verdict.ok => continue,
            Ok(verdict) => verdict.reason.unwrap_or_default(),
            Err(infeasible) if is_too_large(&infeasible) && may_not_fit(&point) => continue,
            Err(infeasible) => infeasible,
        };
        wrong.push(format!("{strategy} at {local_size:?}: {reason}"));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Returns true if a point was refused because it needs more memory or more registers than the device has.
fn is_too_large(infeasible: &str) -> bool {
    infeasible.contains('>') || infeasible.contains("supports at most")
}

/// Returns false, so that every point has to fit the device.
fn none(_: &Point) -> bool {
    false
}

/// Compares presets with the reference at the local sizes with these numbers in [`LOCAL_SIZES`].
fn presets_agree_at(numbers: Range<usize>) {
    let mut stand = Stand::new(scene("pyramid-lower.toml"), SIZE);
    // Strategies whose work-items share tiles always use the same local size, whichever is requested.
    let strategies: Vec<_> =
        PRESETS.iter().map(|preset| preset.strategy).filter(|strategy| !strategy.shares_tiles()).collect();
    let points = strategies.iter().enumerate().flat_map(|(row, &strategy)| {
        let sizes = LOCAL_SIZES.iter().enumerate().skip(numbers.start).take(numbers.len());
        let chosen = sizes.filter(move |(column, size)| {
            is_long() || **size == COMMON_LOCAL_SIZE || (row + column) % 12 == 0
        });
        chosen.map(move |(_, &local)| (strategy, local))
    });
    let is_cpu = stand.is_cpu();
    // A scene of six triangles fits on any device. Besides the scene's memory, three needs of a point may
    // exceed a device's limits. With 32 x 32 work-items, the working vectors may be too large for __local
    // memory. If a work-group has more than 64 tiles, their rays (66 KiB per tile) may be too large for the
    // stack of a CPU's thread. 1024 work-items may need more registers than a GPU has.
    let may_not_fit = |(strategy, [x, y]): &Point| match strategy.traversal {
        Traversal::Tile if is_cpu => x * y > 64,
        _ => x * y == 1024 && (strategy.vectors == Vectors::LOCAL || !is_cpu),
    };
    all_agree(&mut stand, points, may_not_fit);
}

/// Tests the code for GPUs, on which vectors are separate scalars: each edge is checked separately, and the masks of
/// all lanes are combined by pairwise operations.
#[test]
fn presets_of_vectors_that_no_built_in_reduces() {
    apart!();
    let scalars = |builtins| Builtins { reduce: false, ..builtins };
    let mut stand = Stand::of(&Sources::Embedded, scene("still-life.toml"), SIZE, scalars);
    let vectors = PRESETS.iter().map(|preset| preset.strategy);
    let vectors = vectors.filter(|s| s.tests_every_triangle() && s.width != Width::W1);
    assert_eq!(vectors.clone().count(), 6);
    all_agree(&mut stand, vectors.map(|strategy| (strategy, [4, 2])), none);
    // Tiles also convert masks (a truth value per lane) to the bits of a word. Outside this test, an
    // instruction of AVX-512 makes this conversion if the processor has the instruction.
    let tile = preset("tile").expect("a preset").strategy;
    all_agree(&mut stand, [(tile, [1, 1])], none);
}

/// Returns one strategy of each family, and two strategies whose work-items cast 16 rays side by side.
fn of_each_family_and_wide() -> impl Iterator<Item = Strategy> {
    let wide = ["wide-common-origin", "bvh-packet"].map(|name| preset(name).expect("a preset"));
    one_preset_of_each_family().into_iter().chain(wide).map(|preset| preset.strategy)
}

/// In all other tests of this file, pictures are wider than high. Pictures that are wider than high would not show a
/// mistake in a kernel that uses the width instead of the height.
#[test]
fn a_picture_that_is_higher_than_wide() {
    apart!();
    let mut stand = Stand::new(scene("still-life.toml"), [SIZE[1], 2 * SIZE[0]]);
    let strategies = of_each_family_and_wide().filter(|strategy| !strategy.shares_tiles());
    all_agree(&mut stand, strategies.map(|strategy| (strategy, [4, 2])), none);
}

#[test]
fn presets_that_share_tiles() {
    apart!();
    let mut stand = Stand::new(scene("terrain.toml"), SIZE);
    let shared = PRESETS.iter().map(|preset| preset.strategy).filter(Strategy::shares_tiles);
    assert_eq!(shared.clone().count(), 2);
    all_agree(&mut stand, shared.clone().map(|strategy| (strategy, [32, 1])), none);
    // In the second scene, the rays of some tiles run along several axes, so that these tiles take several passes.
    for scene in [lit_from_close_by(scene("terrain.toml")), scene("../tests/data/wide-view.toml")] {
        all_agree(&mut Stand::new(scene, SIZE), shared.clone().map(|strategy| (strategy, [32, 1])), none);
    }
}

/// Moves the light close to the ground: its distance is between the shadow bias and the square root of the bias. Moves
/// the camera to where it sees the lit spot.
fn lit_from_close_by(mut scene: Scene) -> Scene {
    let distance = 20.0 * scene.shadow_bias;
    assert!(distance.powi(2) < 0.5 * scene.shadow_bias);
    let ground = scene.mesh.positions[scene.mesh.positions.len() / 2];
    let eye = ground + vec3(0.0, 0.3, 0.2);
    scene.camera = Camera::looking_at(eye, ground, Vec3::Y, 60.0, false).expect("a camera");
    scene.lights[0].position = ground + Vec3::Y * distance;
    scene.lights[0].power = Vec3::splat(1e-3);
    scene
}

/// Lights are on both sides of the surfaces, and there are more lights than the work-items of a tile process
/// together (in one round of lights).
#[test]
fn many_lights_on_all_sides() {
    apart!();
    let mut stand = Stand::new(scene("many-lights.toml"), SIZE);
    let local_size = |strategy: &Strategy| if strategy.shares_tiles() { [32, 1] } else { [4, 2] };
    let all_passes =
        |strategy| [Passes::Fused, Passes::Separate].map(|passes| Strategy { passes, ..strategy });
    let points = of_each_family_and_wide().filter(compiles_soon).flat_map(all_passes);
    let points = points.filter(|strategy| strategy.contradiction().is_none());
    all_agree(&mut stand, points.map(|strategy| (strategy, local_size(&strategy))), none);
}

#[test]
fn every_preset_at_small_local_sizes() {
    apart!();
    presets_agree_at(0..4);
}

#[test]
fn every_preset_at_middling_local_sizes() {
    apart!();
    presets_agree_at(4..8);
}

#[test]
fn every_preset_at_large_and_odd_local_sizes() {
    apart!();
    presets_agree_at(8..LOCAL_SIZES.len());
}

#[test]
fn a_pairwise_cover_of_all_axes() {
    apart!();
    let cover = pairwise_cover();
    assert!(cover.len() > 30, "only {} strategies", cover.len());
    let mut stand = Stand::new(scene("still-life.toml"), SIZE);
    let locals = [[4, 4], [8, 2], [5, 3], [16, 1]];
    let points = cover.iter().enumerate().map(|(i, &strategy)| (strategy, locals[i % locals.len()]));
    // tests/oclgrind.rs verifies the strategies of the pairwise cover that this test leaves out.
    let own = points.enumerate().filter(|(row, _)| is_long() || row % 3 == 0).map(|(_, point)| point);
    let points = own.filter(|(strategy, _)| compiles_soon(strategy));
    all_agree(&mut stand, points, none);
}

/// Where the two spheres of this scene cut each other, the rays of one vector hit both spheres. The materials
/// of the two spheres differ in every number.
#[test]
fn each_ray_of_a_vector_has_the_material_of_its_own_hit() {
    apart!();
    let mut stand = Stand::new(scene("../tests/data/highlights.toml"), SIZE);
    let vectors = ["wide", "bvh-packet", "tile"].map(|name| preset(name).expect("a preset").strategy);
    all_agree(&mut stand, vectors.map(|strategy| (strategy, [4, 2])), none);
}

/// The gourd in the scene of this test is smooth, so the corners of its faces have different normals. In the tests of
/// presets and of the pairwise cover, all corners of a face have the same normal.
#[test]
fn each_layout_brings_every_corner_its_own_normal() {
    apart!();
    let mut stand = Stand::new(scene("gourd.toml"), SIZE);
    let deferred = preset("deferred").expect("a preset").strategy;
    let layouts = [Layout::SOUP, Layout::INDEXED_16, Layout::INDEXED_32];
    let points = layouts.map(|layout| (Strategy { layout, ..deferred }, [4, 4]));
    all_agree(&mut stand, points, none);
    // In this scene, all rays of many vectors hit the same large triangle. For such a vector, a tile loads the
    // triangle's normals only once.
    let tile = Strategy { layout: Layout::INDEXED_32, ..preset("tile").expect("a preset").strategy };
    all_agree(&mut Stand::new(scene("figure-4.toml"), SIZE), [(tile, [1, 1])], none);
}

/// Each triangle of the first, red object has a twin in a second, blue object. Of two hits at the same
/// distance, kernels keep the one on the triangle that comes first in the mesh. `make test` tries every
/// third preset.
#[test]
fn of_two_objects_in_the_same_place_every_preset_shows_the_first() {
    apart!();
    // Every preset that keeps triangles in `__local` memory can cast this scene, also on devices with little of it.
    let mut scene = scene("still-life.toml");
    let mesh = scene.mesh_mut();
    let mut second = mesh.clone();
    for (mesh, colour) in [(&mut *mesh, Vec3::X), (&mut second, Vec3::Z)] {
        mesh.materials
            .iter_mut()
            .for_each(|material| (material.lambertian, material.glossy) = (colour, Vec3::ZERO));
    }
    mesh.append(second);
    scene.background = Vec3::ZERO;
    let stand = Stand::new(scene, SIZE);
    let presets = PRESETS.iter().filter(|preset| compiles_soon(&preset.strategy));
    for preset in presets.step_by(if is_long() { 1 } else { 3 }) {
        let image = stand.cast(&preset.strategy, [4, 4]).expect("an image");
        let sum = image.pixels.iter().fold(Vec3::ZERO, |sum, pixel| sum + Vec3::from(*pixel));
        assert!(sum.x > 0.0 && sum.z == 0.0, "{}: {sum}", preset.name);
    }
}

/// Whatever the layout of normals in memory, tiles read the same normals, and compute with them in the same
/// order.
#[test]
fn the_layout_of_normals_changes_no_bit_of_a_picture_in_tiles() {
    apart!();
    let stand = Stand::new(scene("gourd.toml"), SIZE);
    for name in ["tile", "tile-watertight"] {
        let strategy = preset(name).expect("a preset").strategy;
        let cast = |layout| stand.cast(&Strategy { layout, ..strategy }, [1, 1]).expect("an image");
        assert_eq!(cast(Layout::INDEXED_32), cast(Layout::SOUP), "{name}");
    }
}

/// The largest indices of 16 bits would be negative if kernels read them as signed numbers.
#[test]
fn indices_of_16_bits_have_no_sign() {
    apart!();
    const UNUSED: usize = 40_000;
    let mut scene = scene("pyramid-lower.toml");
    let mesh = scene.mesh_mut();
    mesh.positions.splice(0..0, std::iter::repeat_n(Vec3::ZERO, UNUSED));
    mesh.normals.splice(0..0, std::iter::repeat_n(Vec3::Y, UNUSED));
    for triangle in &mut mesh.triangles {
        triangle.positions = triangle.positions.map(|index| index + UNUSED as u32);
        triangle.normals = triangle.normals.map(|index| index + UNUSED as u32);
    }
    let deferred = preset("deferred").expect("a preset").strategy;
    let indexed = Strategy { layout: Layout::INDEXED_16, ..deferred };
    all_agree(&mut Stand::new(scene, SIZE), [(indexed, [4, 4])], none);
}

#[test]
fn local_size_and_memory_change_no_bit_of_the_papers_kernel() {
    apart!();
    let stand = Stand::new(scene("figure-4.toml"), SIZE);
    let naive = preset("naive").expect("a preset").strategy;
    let expected = stand.cast(&naive, [8, 8]).expect("an image");
    for name in ["naive-scratch", "private", "local-vectors", "local-triangles", "compounded"] {
        let strategy = preset(name).expect("a preset").strategy;
        for local_size in [[1, 1], [7, 3], [16, 16]] {
            assert_eq!(stand.cast(&strategy, local_size).as_ref(), Ok(&expected), "{name} at {local_size:?}");
        }
    }
}
