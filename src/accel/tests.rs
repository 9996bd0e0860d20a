//! Tests that rays find the same hits in trees over random, degenerate, coincident, tiny and huge triangles
//! as in an exhaustive search.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::*;
use crate::scene::Triangle;
use glam::{DVec3, Vec3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn mesh_of(triangles: impl IntoIterator<Item = [Vec3; 3]>) -> Mesh {
    let mut mesh = Mesh::default();
    for corners in triangles {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners);
        mesh.triangles.push(Triangle {
            positions: [first, first + 1, first + 2],
            normals: [0; 3],
            material: 0,
        });
    }
    mesh
}

fn random_point(rng: &mut ChaCha8Rng) -> Vec3 {
    Vec3::from_array(rng.random()) * 2.0 - 1.0
}

/// Returns `count` random triangles around random points of a cube of side 2. Along each axis, a triangle's corners are
/// at most `edge` from its point. All coordinates are multiplied by `scale`.
fn random_mesh(seed: u64, count: usize, edge: f32, scale: f32) -> Mesh {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    mesh_of((0..count).map(|_| {
        let centre = random_point(&mut rng);
        [(); 3].map(|()| (centre + edge * random_point(&mut rng)) * scale)
    }))
}

/// Returns the distance at which a ray hits a triangle, by the test of Moeller and Trumbore ("Fast, minimum
/// storage ray/triangle intersection", 1997) in f64; `None` for a miss.
fn hit_distance(mesh: &Mesh, triangle: u32, origin: DVec3, direction: DVec3) -> Option<f64> {
    let [a, b, c] = mesh.corners(&mesh.triangles[triangle as usize]).map(|corner| corner.as_dvec3());
    let (e1, e2, p) = (b - a, c - a, direction.cross(c - a));
    let det = e1.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = origin - a;
    let (u, q) = (s.dot(p) / det, s.cross(e1));
    let (v, t) = (direction.dot(q) / det, e2.dot(q) / det);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}

fn closest_of_all(mesh: &Mesh, origin: DVec3, direction: DVec3) -> Option<f64> {
    let all = 0..mesh.triangles.len() as u32;
    all.filter_map(|triangle| hit_distance(mesh, triangle, origin, direction)).min_by(f64::total_cmp)
}

/// Checks several trees over a mesh: a tree that is built over triangles, and trees whose upper levels are
/// built over few or many cells of a grid.
fn check(mesh: &Mesh, leaf_size: usize, width: usize, scale: f64, seed: u64) {
    for cells in [None, Some(1), Some(7), Some(4096)] {
        check_tree(mesh, build::build(mesh, leaf_size, cells), leaf_size, width, scale, seed);
    }
}

/// Checks that a binary tree and the wide tree made of it are valid, and that the wide tree finds the same hits as an
/// exhaustive search.
fn check_tree(mesh: &Mesh, bvh: Bvh, leaf_size: usize, width: usize, scale: f64, seed: u64) {
    bvh.validate(mesh).unwrap();
    let wide = WideBvh::new(bvh.clone(), width, 2 * leaf_size).unwrap();
    wide.validate(mesh).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for _ in 0..20 {
        let origin = 3.0 * scale * random_point(&mut rng).as_dvec3();
        let direction = scale * random_point(&mut rng).as_dvec3() - origin;
        let walk = wide.closest_hit(origin, direction, f64::INFINITY, |triangle, reach| {
            hit_distance(mesh, triangle, origin, direction).filter(|&distance| distance < reach)
        });
        assert_eq!(walk.hit.map(|hit| hit.distance), closest_of_all(mesh, origin, direction));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn random_triangles(
        seed: u64,
        count in 0usize..600,
        edge in prop::sample::select(vec![0.0f32, 0.01, 0.3, 2.0]),
        scale in prop::sample::select(vec![1e-6f32, 1e-3, 1.0, 1e6]),
        leaf_size in 1usize..17,
        width in prop::sample::select(WideBvh::WIDTHS.to_vec()),
    ) {
        check(&random_mesh(seed, count, edge, scale), leaf_size, width, f64::from(scale), seed);
    }
}

#[test]
fn no_triangle_and_one_triangle() {
    check(&Mesh::default(), 4, 8, 1.0, 1);
    check(&random_mesh(2, 1, 1.0, 1.0), 4, 32, 1.0, 2);
    let empty = WideBvh::new(Bvh::build(&Mesh::default(), 4), 8, 8).unwrap();
    assert_eq!((empty.node_count(), empty.depth, empty.stack_size()), (1, 1, 8));
}

#[test]
fn coincident_triangles_are_halved() {
    let one = random_mesh(3, 1, 1.0, 1.0).positions;
    let mesh = mesh_of(std::iter::repeat_n([one[0], one[1], one[2]], 10_000));
    check(&mesh, 4, 8, 1.0, 3);
    assert_eq!(Bvh::build(&mesh, 1).depth, 14);
}

#[test]
fn concentric_triangles_share_a_centre() {
    let corners = [Vec3::NEG_ONE, Vec3::new(1.0, -1.0, 0.0), Vec3::ONE];
    let mesh = mesh_of((1..3000).map(|size| corners.map(|corner| corner * size as f32)));
    check(&mesh, 4, 8, 3000.0, 4);
}

#[test]
fn points_and_lines_are_triangles_too() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mesh = mesh_of((0..3000).map(|i| {
        let (a, b) = (random_point(&mut rng), random_point(&mut rng));
        if i % 2 == 0 { [a, a, a] } else { [a, b, (a + b) / 2.0] }
    }));
    check(&mesh, 2, 4, 1.0, 5);
}

#[test]
fn triangles_far_apart_by_powers_of_two_keep_the_depth_bounded() {
    let mesh = mesh_of((-140..120).flat_map(|power| {
        let corner = Vec3::splat(2f32.powi(power));
        std::iter::repeat_n([corner, corner * Vec3::new(1.0, 1.25, 1.0), corner * 1.5], 40)
    }));
    for bvh in [Bvh::build(&mesh, 1), build::build(&mesh, 1, Some(1000))] {
        bvh.validate(&mesh).unwrap();
        assert!(bvh.depth <= 64 + 14, "depth {}", bvh.depth);
    }
}

/// The triangles are far apart along each axis in turn, so each cut of least cost separates only few triangles
/// from all others. If all nodes were cut at the least cost, the tree would be far deeper than the test allows.
/// To limit the depth, the builder divides nodes from depth 64 on into halves whose numbers of triangles differ
/// by at most one.
#[test]
fn triangles_far_apart_along_each_axis_keep_the_depth_bounded() {
    let mesh = mesh_of((-140..120).flat_map(|power| {
        Vec3::AXES.map(|axis| {
            let corner = axis * 2f32.powi(power);
            [corner, corner * 1.25, corner * 1.5]
        })
    }));
    let bvh = Bvh::build(&mesh, 1);
    bvh.validate(&mesh).unwrap();
    assert!((64..=64 + 10).contains(&bvh.depth), "depth {}", bvh.depth);
}

/// The mesh has a row of five thousand triangles on one side of the origin, and a hundred triangles on the other
/// side. Each of the hundred triangles is half as far from the origin as the previous triangle.
#[test]
fn the_depth_is_that_of_the_deeper_side() {
    for side in [1.0, -1.0] {
        let row = (0..5000).map(|number| Vec3::new(side * (10.0 + number as f32), 0.0, 0.0));
        let row = row.map(|corner| [corner, corner + 0.5 * Vec3::X, corner + Vec3::Y]);
        let halves = (0..100).map(|power| Vec3::new(-side * 2f32.powi(-power), 0.0, 0.0));
        let halves = halves.map(|corner| [corner, corner * 1.25, corner * 1.5]);
        let mesh = mesh_of(row.chain(halves));
        let bvh = Bvh::build(&mesh, 1);
        bvh.validate(&mesh).unwrap();
        WideBvh::new(bvh.clone(), 2, 1).unwrap().validate(&mesh).unwrap();
    }
}

#[test]
fn coordinates_near_the_largest_float() {
    let mesh = random_mesh(6, 2000, 0.1, 1.5e38);
    Bvh::build(&mesh, 4).validate(&mesh).unwrap();
    build::build(&mesh, 4, Some(100)).validate(&mesh).unwrap();
}

/// A fifth of the triangles lie in one cell, so that this cell has many more triangles than any other cell.
#[test]
fn a_large_tree_over_cells_is_right_and_the_same_for_any_number_of_threads() {
    let mut mesh = random_mesh(17, 100_000, 0.01, 1.0);
    mesh.positions[..60_000].iter_mut().for_each(|corner| *corner *= 1e-3);
    let trees = [1, 2, 7].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| build::build(&mesh, 4, Some(400)))
    });
    trees[0].validate(&mesh).unwrap();
    assert!(trees[0] == trees[1] && trees[1] == trees[2], "the tree depends on the number of threads");
    assert!(trees[0] != Bvh::build(&mesh, 4), "the tree was built without cells");
    let area = |tree: &Bvh| tree.nodes.iter().map(|node| f64::from(node.half_area())).sum::<f64>();
    let ratio = area(&trees[0]) / area(&Bvh::build(&mesh, 4));
    assert!((0.9..1.1).contains(&ratio), "the nodes' areas are {ratio} times as large");
}

#[test]
fn nodes_on_all_cores_give_a_right_tree() {
    let mesh = random_mesh(7, 100_000, 0.01, 1.0);
    let bvh = Bvh::build(&mesh, 4);
    bvh.validate(&mesh).unwrap();
    assert_eq!(bvh, Bvh::build(&mesh, 4), "every build produces the same tree");
    for (width, leaf_size) in [(2, 4), (8, 8), (32, 32)] {
        WideBvh::new(bvh.clone(), width, leaf_size).unwrap().validate(&mesh).unwrap();
    }
}

#[test]
fn nodes_on_all_cores_are_cut_across_any_axis() {
    for axis in Vec3::AXES {
        // The mesh is ten times as long along `axis` as along the other two axes, so that the first cut is
        // perpendicular to `axis`.
        let stretch = Vec3::ONE + 9.0 * axis;
        let mut mesh = random_mesh(16, 70_000, 0.01, 1.0);
        mesh.positions.iter_mut().for_each(|corner| *corner *= stretch);
        Bvh::build(&mesh, 4).validate(&mesh).unwrap();
    }
}

#[test]
fn coincident_triangles_on_all_cores() {
    let mesh = mesh_of(std::iter::repeat_n([Vec3::ZERO, Vec3::X, Vec3::Y], 100_000));
    Bvh::build(&mesh, 4).validate(&mesh).unwrap();
}

#[test]
fn a_tree_is_much_cheaper_than_a_search_of_all() {
    let mesh = random_mesh(8, 20_000, 0.02, 1.0);
    let wide = WideBvh::new(Bvh::build(&mesh, 4), 8, 8).unwrap();
    let origin = DVec3::new(0.1, 0.2, 5.0);
    let walk = wide.closest_hit(origin, -DVec3::Z, 10.0, |t, _| hit_distance(&mesh, t, origin, -DVec3::Z));
    assert!(walk.nodes < 60 && walk.triangles < 200, "{walk:?}");
}

#[test]
fn nearer_boxes_are_searched_first() {
    let sheet = |depth: u8| [Vec3::ZERO, Vec3::X, Vec3::Y].map(|corner| corner - f32::from(depth) * Vec3::Z);
    let mesh = mesh_of((1..=8).map(sheet));
    let wide = WideBvh::new(Bvh::build(&mesh, 1), 8, 1).unwrap();
    for (origin, direction, nearest) in [(0.0, -DVec3::Z, 0), (-9.0, DVec3::Z, 7)] {
        let origin = DVec3::new(0.2, 0.2, origin);
        let walk =
            wide.closest_hit(origin, direction, 20.0, |t, _| hit_distance(&mesh, t, origin, direction));
        assert_eq!((walk.hit.map(|hit| hit.triangle), walk.triangles), (Some(nearest), 1), "{walk:?}");
    }
}

#[test]
fn impossible_layouts_are_refused() {
    let bvh = Bvh::build(&random_mesh(9, 100, 0.1, 1.0), 4);
    for (width, leaf_size) in [(3, 8), (8, 2), (8, 64)] {
        assert!(WideBvh::new(bvh.clone(), width, leaf_size).is_err(), "{width} wide, {leaf_size} a leaf");
    }
    assert!(
        WideBvh::new(bvh.clone(), 2, 4).is_ok()
            && WideBvh::new(bvh.clone(), 32, WideBvh::MAX_LEAF_SIZE).is_ok()
    );
    let message = WideBvh::new(bvh.clone(), 8, 2).unwrap_err().to_string();
    assert!(message.starts_with("a leaf size of 2 is not possible; expected 4 to "), "{message}");
}

#[test]
fn a_wrong_tree_is_found_out() {
    let mesh = random_mesh(10, 500, 0.1, 1.0);
    let good = Bvh::build(&mesh, 4);
    let spoil = |change: &dyn Fn(&mut Bvh)| {
        let mut bad = good.clone();
        change(&mut bad);
        bad.validate(&mesh).unwrap_err()
    };
    assert!(spoil(&|bvh| bvh.order[0] = bvh.order[1]).contains("twice"));
    let beyond = spoil(&|bvh| bvh.order[0] = 999);
    assert_eq!(beyond, "triangle 999 occurs twice in the leaf order, or the mesh of 500 triangles lacks it");
    let missing = spoil(&|bvh| bvh.order.truncate(499));
    assert_eq!(missing, "triangles in leaf order: 499, expected 500");
    let last = good.nodes.len() - 1;
    assert!(good.nodes[last].is_leaf());
    assert!(spoil(&|bvh| bvh.nodes[last].high = bvh.nodes[last].low).contains("does not enclose"));
    assert!(spoil(&|bvh| bvh.nodes[0].high[1] = 0.0).contains("enclose"));
    assert!(spoil(&|bvh| bvh.nodes[0].low[1] = 0.0).contains("enclose"));
    assert!(spoil(&|bvh| bvh.nodes[0].right = 5000).contains("beyond"));
    assert!(spoil(&|bvh| bvh.depth += 1).contains("depth"));
    assert!(spoil(&|bvh| bvh.nodes[1].count += 1).contains("triangles below both children"));
    let mut wide = WideBvh::new(good.clone(), 8, 8).unwrap();
    wide.nodes[6 * 8] = WideBvh::UNUSED;
    assert!(wide.validate(&mesh).unwrap_err().contains("not marked"));
}

#[test]
fn triangle_rows_follow_the_leaf_order() {
    let mut mesh = random_mesh(11, 50, 0.1, 1.0);
    (1..).zip(&mut mesh.triangles).for_each(|(material, triangle)| triangle.material = material);
    let order = Bvh::build(&mesh, 4).order;
    let mut rows = vec![1.0; (50 + PADDING_ROWS) * TRIANGLE_WORDS];
    write_triangle_rows(&mesh, &order, &mut rows);
    assert!(rows[50 * TRIANGLE_WORDS..].iter().all(|word| *word == 0.0));
    for (row, &number) in rows.chunks(TRIANGLE_WORDS).zip(&order) {
        let triangle = &mesh.triangles[number as usize];
        let [a, b, c] = mesh.corners(triangle);
        assert_eq!((row[7].to_bits(), row[11]), (triangle.material, 0.0));
        assert_eq!((row[0], row[3].to_bits()), (a.x, number));
        assert_eq!((&row[4..7], &row[8..11]), (&b.to_array()[..], &c.to_array()[..]));
    }
}

#[test]
fn the_triangles_of_a_leaf_have_the_meshs_order() {
    let tree = Bvh::build(&random_mesh(16, 3000, 0.1, 1.0), 4);
    let mut rest = &tree.order[..];
    for leaf in tree.nodes.iter().filter(|node| node.is_leaf()) {
        let (own, others) = rest.split_at(leaf.count as usize);
        assert!(own.is_sorted(), "{own:?}");
        rest = others;
    }
    assert!(rest.is_empty() && !tree.order.is_sorted());
}

#[test]
fn normal_rows_hold_the_normal_of_each_corner() {
    let mut mesh = random_mesh(11, 50, 0.1, 1.0);
    mesh.normals = mesh.positions.iter().map(|corner| 2.0 * *corner).collect();
    mesh.triangles.iter_mut().for_each(|triangle| triangle.normals = triangle.positions);
    let order = Bvh::build(&mesh, 4).order;
    let mut rows = vec![1.0; 51 * NORMAL_FLOATS];
    write_normal_rows(&mesh, &order, &mut rows);
    assert_eq!(rows[50 * NORMAL_FLOATS..], [0.0; NORMAL_FLOATS]);
    for (row, &number) in rows.chunks(NORMAL_FLOATS).zip(&order) {
        let triangle = &mesh.triangles[number as usize];
        let normals = mesh.corner_normals(triangle).map(|normal| normal.to_array());
        assert_eq!(row, normals.concat());
    }
}

/// Hashes everything that a device reads of a mesh's trees, for every width and two leaf sizes.
fn hash_trees(hasher: &mut blake3::Hasher, mesh: &Mesh) {
    for (width, leaf_size) in WideBvh::WIDTHS.into_iter().flat_map(|width| [(width, 4), (width, 16)]) {
        let tree = WideBvh::of_mesh(mesh, width, leaf_size).unwrap();
        let [mut corners, mut normals] =
            [TRIANGLE_WORDS, NORMAL_FLOATS].map(|floats| vec![0.0; floats * tree.order.len()]);
        write_triangle_rows(mesh, &tree.order, &mut corners);
        write_normal_rows(mesh, &tree.order, &mut normals);
        let rows = corners.iter().chain(&normals).map(|float| float.to_bits());
        let counts = [tree.stride as u32, tree.depth, tree.stack_size() as u32];
        for word in tree.nodes.iter().copied().chain(rows).chain(counts) {
            hasher.update(&word.to_le_bytes());
        }
    }
}

#[test]
fn the_fingerprint_is_that_of_this_builder() {
    let mut hasher = blake3::Hasher::new();
    let coincident = std::iter::repeat_n([Vec3::ZERO, Vec3::X, Vec3::Y], 100);
    let meshes = [
        random_mesh(12, 1, 1.0, 1.0),
        random_mesh(13, 6000, 0.02, 1.0), // larger than one task
        random_mesh(14, 500, 1.0, 1e3),
        mesh_of(coincident),
    ];
    for mut mesh in meshes {
        mesh.normals = vec![Vec3::Y];
        hash_trees(&mut hasher, &mesh);
    }
    // The following mesh has so many triangles that all cores together cut the root of its tree.
    let order = Bvh::build(&random_mesh(15, 70_000, 0.01, 1.0), 4).order;
    order.iter().for_each(|number| _ = hasher.update(&number.to_le_bytes()));
    let actual = &hasher.finalize().to_hex()[..16];
    assert_eq!(
        FINGERPRINT, actual,
        "the builder or the layout has changed: set accel::FINGERPRINT to the hash that was found"
    );
}

#[test]
fn a_stack_holds_the_children_of_every_level() {
    let wide = WideBvh::of_mesh(&random_mesh(1, 1000, 0.1, 1.0), 4, 4).unwrap();
    assert_eq!(wide.stack_size(), 3 * wide.depth as usize + 1);
}

#[test]
fn more_triangles_than_a_word_can_name_are_refused() {
    let bvh = Bvh { nodes: Vec::new(), order: vec![0; WideBvh::MAX_INDEX + 1], depth: 0 };
    let message = WideBvh::new(bvh.clone(), 4, 4).unwrap_err().to_string();
    assert!(message.contains("33554433 triangles"), "{message}");
}

#[test]
fn a_ray_along_an_axis_misses_boxes_beside_it() {
    let mesh = mesh_of([[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    let wide = WideBvh::of_mesh(&mesh, 4, 4).unwrap();
    let tested = |x: f64, y: f64| {
        wide.closest_hit(DVec3::new(x, y, 2.0), DVec3::NEG_Z, f64::INFINITY, |_, _| None).triangles
    };
    assert_eq!([tested(0.5, 0.5), tested(-0.1, 0.5), tested(1.1, 0.5), tested(0.5, 1.1)], [1, 0, 0, 0]);
}

#[test]
fn a_build_needs_the_order_the_nodes_and_the_boxes_or_the_nodes_again() {
    let boxes = 1000 * size_of::<super::bounds::Primitive>();
    let order = 1000 * size_of::<u32>();
    // The estimate assumes that leaves of at most four triangles contain two and a half triangles on average.
    // With such leaves, a tree over 1000 triangles has at most 401 leaves, and as many inner nodes.
    let nodes = 802 * size_of::<Node>();
    assert_eq!(Bvh::build_bytes(1000, 4), (boxes + order + nodes) as u64);
    // With one triangle per leaf, the nodes take more bytes than the boxes.
    let nodes = 2002 * size_of::<Node>();
    assert_eq!(Bvh::build_bytes(1000, 1), (order + 2 * nodes) as u64);
}
