//! Rays aimed at edges and vertices: single rays at closed meshes, and frames in which every primary or shadow ray
//! meets a net, which is a grid of triangles. No ray leaks with the watertight test under any traversal, nor with the
//! rasteriser. The leaks of the other ray-triangle tests are counted. Many rays leak with the student paper's test,
//! which shows that the rays do meet edges.

use crate::binary::WorkFolder;
use crate::common::apart::apart;
use crate::common::edges::{
    ORIGINS, closed_meshes, is_stopped, net_before_the_eye, net_before_the_light, rays_at_edges,
    rays_beside_edges, slivers_beside_the_rays,
};
use crate::common::{Stand, compiles_soon};
use raycl::image::Radiance;
use raycl::launch::Ray;
use raycl::program::Sources;
use raycl::scene::{Sample, Sampling, Scene};
use raycl::strategy::{
    Intersector, NodeWidth, Passes, Records, Shading, Strategy, TileSize, Traversal, Triangles, Width, preset,
};

/// Number of single rays that are cast with each traversal.
const RAYS: usize = 60_000;
/// The side in pixels of a square image of at least [`RAYS`] pixels. At the image's edges, parts of tiles and
/// work-groups are outside.
const SIDE: u32 = 246;
const PIXELS: usize = (SIDE * SIDE) as usize;
/// The side in pixels of the small square images of some tests, which have 6,724 pixels.
const SMALL_SIDE: u32 = 82;
/// The number of rays that may leak in small images. On a device that rounds unlike PoCL, about one ray in ten thousand
/// may leak.
const FEW: usize = 4;
const LOCAL_SIZE: [u32; 2] = [8, 2];

fn of(name: &str) -> Strategy {
    preset(name).expect("a preset").strategy
}

/// Returns the strategies in `all` with the ray-triangle test `intersector` instead of their own test. Leaves
/// out strategies in which this test contradicts another value.
fn with(intersector: Intersector, all: Vec<Strategy>) -> Vec<Strategy> {
    let all = all.into_iter().map(|strategy| Strategy { intersector, ..strategy });
    all.filter(|strategy| strategy.contradiction().is_none()).collect()
}

/// Returns strategies for every way to cast single rays: exhaustively, in tiles of triangles, with a tree,
/// alone and in packets.
fn traversals_of_rays(intersector: Intersector) -> Vec<Strategy> {
    let [exhaustive, tree, packet] = ["deferred", "bvh", "bvh-packet"].map(of);
    let all = vec![
        exhaustive,
        Strategy { records: Records::Once, ..exhaustive },
        of("wide"),
        Strategy { width: Width::W4, triangles: Triangles::TILED, ..exhaustive },
        Strategy { node_width: NodeWidth::N2, ..tree },
        tree,
        packet,
        Strategy { node_width: NodeWidth::N16, ..packet },
    ];
    with(intersector, all)
}

/// Returns strategies for every way to cast rays from the eye, except the rasteriser.
fn traversals_of_pixels(intersector: Intersector) -> Vec<Strategy> {
    let [tree, tile] = ["bvh", "tile"].map(of);
    let all = vec![
        of("wide"),
        Strategy { node_width: NodeWidth::N8, ..tree },
        of("bvh-packet"),
        tile,
        Strategy { tile: TileSize::T8x8, node_width: NodeWidth::N8, ..tile },
        Strategy { tile: TileSize::T16x16, passes: Passes::Separate, ..tile },
        of("tile-group"),
    ];
    with(intersector, all)
}

/// The closed meshes on the device and on the host, with the rays at their edges and vertices, which are the same for
/// all strategies.
struct Meshes {
    stand: Stand,
    scene: Scene,
    /// For each of [`ORIGINS`], the rays, and the distances of the points at which they aim.
    rays: Vec<(Vec<Ray>, Vec<f32>)>,
}

impl Meshes {
    fn new() -> Self {
        let scene = closed_meshes();
        let rays_from = |origin| rays_at_edges(&scene.mesh, origin, RAYS / ORIGINS.len());
        let rays = ORIGINS.into_iter().map(rays_from).collect();
        Self { stand: Stand::new(scene.clone(), [64, 64]), scene, rays }
    }

    /// Returns how many of [`RAYS`] rays at edges and vertices pass between triangles.
    fn leaks(&self, strategy: &Strategy) -> usize {
        let built = self.stand.build_for_rays(strategy, LOCAL_SIZE).expect("a strategy that fits");
        let leaks = |(rays, targets): &(Vec<Ray>, Vec<f32>)| {
            let hits = built.cast_rays(rays).expect("a cast");
            let rays = rays.iter().zip(targets).zip(hits);
            rays.filter(|((ray, target), hit)| !is_stopped(&self.scene.mesh, ray, **target, *hit)).count()
        };
        self.rays.iter().map(leaks).sum()
    }
}

/// Returns a scene on the device, for square images.
fn square(kernels: &Sources, scene: Scene) -> Stand {
    square_of(SIDE, kernels, scene)
}

/// Returns a scene on the device, for square images with sides of `side` pixels.
fn square_of(side: u32, kernels: &Sources, scene: Scene) -> Stand {
    Stand::of(kernels, scene, [side; 2], |builtins| builtins)
}

/// Returns two numbers of pixels of a frame: those that are lit, and those whose primary rays hit something.
fn lit_and_hit(stand: &Stand, strategy: &Strategy) -> (usize, usize) {
    let (image, hits) = stand.cast_and_count(strategy, LOCAL_SIZE).expect("a strategy that fits");
    (lit(&image), hits)
}

/// Returns the number of pixels that are not black.
fn lit(image: &Radiance) -> usize {
    image.pixels.iter().filter(|pixel| pixel.iter().any(|channel| *channel > 0.0)).count()
}

/// Scenes with nets (grids of triangles whose vertices and edges rays meet), on the device. Several strategies use the
/// same nets, since the trees of the nets take long to build.
struct Nets {
    /// The number of pixels, and so of rays, of a frame.
    pixels: usize,
    /// Two nets in front of the eye: a crumpled net (with vertices at different depths) and a flat net.
    before_the_eye: [Stand; 2],
    /// The net between a light and a floor, which shadow rays meet.
    before_the_light: Stand,
}

impl Nets {
    fn new(kernels: &Sources) -> Self {
        Self::of_side(SIDE, kernels)
    }

    /// Returns nets for square images with sides of `side` pixels.
    fn of_side(side: u32, kernels: &Sources) -> Self {
        let square = |scene| square_of(side, kernels, scene);
        Self {
            pixels: (side * side) as usize,
            before_the_eye: [false, true].map(|is_flat| square(net_before_the_eye(side, is_flat))),
            before_the_light: square(net_before_the_light(side, true)),
        }
    }

    /// Returns how many primary rays pass through the crumpled net or the flat net. `pixels` rays are aimed at each
    /// net.
    fn leaks_to(&self, strategy: &Strategy) -> usize {
        self.before_the_eye.iter().map(|net| self.pixels - lit_and_hit(net, strategy).1).sum()
    }

    /// Returns how many of `pixels` shadow rays pass through the net in front of the light.
    fn leaks_from(&self, strategy: &Strategy) -> usize {
        lit_and_hit(&self.before_the_light, strategy).0
    }
}

/// The number of rays that are allowed to hit a sliver (a long, narrow triangle) beyond its end. In single
/// precision, no ray-triangle test can tell for every sliver where along the sliver's plane a ray passes.
const ALLOWED: usize = 8;

/// Returns how many of 4,096 primary rays hit something. The scene has a sliver (a long, narrow triangle)
/// beside each ray, and no ray should hit a sliver.
fn hits_beyond_slivers(kernels: &Sources, strategy: &Strategy) -> usize {
    let stand = Stand::of(kernels, slivers_beside_the_rays(64), [64; 2], |builtins| builtins);
    lit_and_hit(&stand, strategy).1
}

/// Counts the rays that a strategy with these kernels casts wrongly. Returns four counts of rays. The first
/// two count primary rays and shadow rays that pass through a net (a grid of triangles). The third counts
/// rays that a triangle stops although they pass beside it. The fourth counts rays that hit a sliver (a long,
/// narrow triangle) beyond its end, minus the few hits that are [`ALLOWED`].
pub fn faults(kernels: &Sources, strategy: &Strategy) -> [usize; 4] {
    let nets = Nets::new(kernels);
    [
        nets.leaks_to(strategy),
        nets.leaks_from(strategy),
        stopped_beside_edges(kernels, strategy),
        hits_beyond_slivers(kernels, strategy).saturating_sub(ALLOWED),
    ]
}

/// Returns how many of 2,000 rays are stopped, although they pass just outside a triangle's edges. Each of these rays
/// passes an edge of a triangle at a distance of 7e-7 times the edge's distance from the ray's origin, which is a few
/// rounding errors. For the Möller-Trumbore test, which allows each triangle its own rounding error, the rays pass the
/// edges at ten times this distance. Tiles and the test `pixel-linear` work only with the rays of a frame, but the rays
/// of this function belong to no frame. For strategies with tiles or with `pixel-linear`, this function returns 0.
fn stopped_beside_edges(kernels: &Sources, strategy: &Strategy) -> usize {
    let for_cameras =
        strategy.traversal == Traversal::Tile || strategy.intersector == Intersector::PIXEL_LINEAR;
    if for_cameras {
        return 0;
    }
    let part = if strategy.intersector == Intersector::MOLLER_TRUMBORE { 7e-6 } else { 7e-7 };
    let (scene, rays) = rays_beside_edges(part);
    let stand = Stand::of(kernels, scene, [64, 64], |builtins| builtins);
    let built = stand.build_for_rays(strategy, LOCAL_SIZE).expect("a strategy that fits");
    built.cast_rays(&rays).expect("a cast").into_iter().flatten().count()
}

#[test]
fn the_watertight_test_leaks_none_of_sixty_thousand_rays() {
    apart!();
    let meshes = Meshes::new();
    for strategy in traversals_of_rays(Intersector::WATERTIGHT) {
        assert_eq!(meshes.leaks(&strategy), 0, "{strategy}");
    }
}

#[test]
fn the_watertight_test_leaks_none_of_sixty_thousand_pixels() {
    apart!();
    let nets = Nets::new(&Sources::Embedded);
    for strategy in traversals_of_pixels(Intersector::WATERTIGHT).into_iter().filter(compiles_soon) {
        assert_eq!(nets.leaks_to(&strategy), 0, "primary rays: {strategy}");
        let lit_and_hit = lit_and_hit(&nets.before_the_light, &strategy);
        assert_eq!(lit_and_hit, (0, PIXELS), "shadow rays: {strategy}");
    }
}

/// Without `make test-long`, no other test of this file casts tiles that work-items share, since PoCL takes long to
/// compile them. The program of this test is also that of `rounds_of_lights_of_every_tile` (tests/trees.rs).
#[test]
fn tiles_that_work_items_share_leak_hardly_any_ray() {
    apart!();
    let nets = Nets::of_side(SMALL_SIDE, &Sources::Embedded);
    let strategy = Strategy { tile: TileSize::T8x4, passes: Passes::Separate, ..of("tile-group") };
    let leaks = [nets.leaks_to(&strategy), nets.leaks_from(&strategy)];
    assert!(leaks.iter().all(|leaks| *leaks <= FEW), "{leaks:?} primary and shadow rays: {strategy}");
}

/// Returns the number of shadow rays to the light that pass through the net. The light's radius is so small that all
/// its points are equal in single precision, but kernels cast rays to this light as to a large one. The cast sample is
/// at the pixels' centres, since shadow rays from there meet the net's edges.
fn leaks_of_soft_light(kernels: &Sources, strategy: &Strategy) -> usize {
    let mut scene = net_before_the_light(SMALL_SIDE, true);
    scene.lights[0].radius = 1e-9;
    let camera = scene.camera;
    let stand = square_of(SMALL_SIDE, kernels, scene).with_sampling(Sampling::all(2));
    let built = stand.build(strategy, LOCAL_SIZE).expect("a strategy that fits");
    let caster = built.caster().expect("a caster");
    let centre = Sample { count: 2, most: 2, ..Sample::CENTRE };
    caster.cast_sample(&camera, &centre).expect("a cast");
    let (image, hits) = caster.read().expect("an image");
    assert_eq!(hits, image.pixels.len(), "the floor fills the image");
    lit(&image)
}

/// Rays to a light with a radius are tested by other code than rays to a point. This code also enlarges triangles a
/// little. The changed kernel of this test makes triangles smaller.
#[test]
fn soft_light_leaks_hardly_any_ray() {
    apart!();
    for name in ["wide-common-origin", "tile"] {
        let leaks = leaks_of_soft_light(&Sources::Embedded, &of(name));
        assert!(leaks <= FEW, "{name}: {leaks} rays");
    }
    let folder = WorkFolder::new();
    let [from, to] =
        ["", "-"].map(|sign| format!("slack1 = {sign}ROUNDING * size2 * distance, slack2 = {sign}ROUNDING"));
    let kernels = Sources::Folder(folder.path(&folder.kernels("common/soft.cl", &from, &to)));
    let leaks = leaks_of_soft_light(&kernels, &of("tile"));
    assert!(leaks > 1000, "{leaks} rays");
}

/// Two triangles that share an edge have exactly opposite values of the rasteriser's edge function for this edge. The
/// same is true of the watertight test. A pixel on an edge belongs to both triangles.
#[test]
fn the_rasteriser_leaks_none_of_sixty_thousand_pixels() {
    apart!();
    assert_eq!(Nets::new(&Sources::Embedded).leaks_to(&of("raster")), 0);
}

#[test]
fn without_its_net_the_floor_is_lit() {
    apart!();
    let floor = square(&Sources::Embedded, net_before_the_light(SIDE, false));
    assert_eq!(lit_and_hit(&floor, &of("tile")), (PIXELS, PIXELS));
}

#[test]
fn rays_beside_an_edge_miss() {
    apart!();
    let [wide, tree] = ["wide", "bvh"].map(of);
    for intersector in [Intersector::WATERTIGHT, Intersector::MOLLER_TRUMBORE, Intersector::COMMON_ORIGIN] {
        for strategy in with(intersector, vec![wide, tree]) {
            assert_eq!(stopped_beside_edges(&Sources::Embedded, &strategy), 0, "{strategy}");
        }
    }
}

/// The ray-triangle tests that this function lists enlarge triangles a little, so that no ray slips between
/// neighbours. Enlarging triangles must not lengthen slivers (long, narrow triangles). For this purpose, the
/// ray-triangle tests have a rule for triangles that look narrower than the enlargement. Without the rule for
/// such narrow triangles, 347 to 3,679 rays hit slivers beyond their ends. The test `pixel-linear` enlarges
/// triangles more than its rule for narrow triangles assumes, so a few rays hit slivers.
#[test]
fn hardly_any_ray_hits_a_sliver_beyond_its_end() {
    apart!();
    let intersectors = [
        Intersector::MOLLER_TRUMBORE,
        Intersector::COMMON_ORIGIN,
        Intersector::EDGE_PLANES,
        Intersector::PIXEL_LINEAR,
    ];
    for intersector in intersectors {
        for strategy in traversals_of_pixels(intersector).into_iter().filter(compiles_soon) {
            let hits = hits_beyond_slivers(&Sources::Embedded, &strategy);
            assert!(hits <= ALLOWED, "{hits} rays: {strategy}");
        }
    }
}

/// Except for the watertight test, no ray-triangle test guarantees that no ray leaks. With the ray-triangle tests that
/// this function lists, neighbouring triangles overlap by a rounding error, or share the planes of their edges and
/// overlap by less. With PoCL, the overlaps of neighbouring triangles were wide enough: no ray leaked. On a device that
/// rounds differently, one ray in ten thousand may leak. The command
/// `RAYCL_TEST_LONG=1 RAYCL_TEST_APART=1 cargo test leaks_are_counted -- --nocapture`
/// prints the numbers for these ray-triangle tests in the table of docs/reliability.md.
#[test]
fn the_other_tests_leaks_are_counted() {
    apart!();
    let (meshes, nets) = (Meshes::new(), Nets::new(&Sources::Embedded));
    let mut many = Vec::new();
    let mut count = |(leaks, of): (usize, usize), rays: &str, strategy: &Strategy| {
        let line = format!("{leaks:6} of {of} {rays:12} {strategy}");
        println!("{line}");
        many.extend((leaks > of / 10_000).then_some(line));
    };
    for intersector in [Intersector::MOLLER_TRUMBORE, Intersector::COMMON_ORIGIN, Intersector::EDGE_PLANES] {
        for strategy in traversals_of_rays(intersector) {
            count((meshes.leaks(&strategy), RAYS), "rays", &strategy);
        }
        for strategy in traversals_of_pixels(intersector).into_iter().filter(compiles_soon) {
            count((nets.leaks_to(&strategy), 2 * PIXELS), "primary rays", &strategy);
            count((nets.leaks_from(&strategy), PIXELS), "shadow rays", &strategy);
        }
    }
    for strategy in traversals_of_pixels(Intersector::PIXEL_LINEAR) {
        count((nets.leaks_to(&strategy), 2 * PIXELS), "primary rays", &strategy);
        count((nets.leaks_from(&strategy), PIXELS), "shadow rays", &strategy);
    }
    assert!(many.is_empty(), "too many rays leak:\n{}", many.join("\n"));
}

#[test]
fn the_papers_test_leaks_so_the_rays_do_probe_edges() {
    apart!();
    let paper = of("private");
    let rays = Meshes::new().leaks(&paper);
    let (traversal, width) = (Traversal::Bvh, Width::W16);
    let wide = Strategy { traversal, width, shading: Shading::DEFERRED, passes: Passes::Separate, ..paper };
    let nets = [net_before_the_eye(SIDE, false), net_before_the_light(SIDE, true)];
    let [before_the_eye, before_the_light] = nets.map(|net| square(&Sources::Embedded, net));
    let primary = PIXELS - lit_and_hit(&before_the_eye, &wide).1;
    let shadow = lit_and_hit(&before_the_light, &wide).0;
    println!("{rays} rays: {paper}\n{primary} primary and {shadow} shadow rays: {wide}");
    assert!(rays > 10 && primary > 10, "{rays} rays, {primary} primary rays");
    // The expected numbers of leaks are those of docs/reliability.md. On devices that round differently,
    // between half and twice as many rays may leak.
    let is_near = |leaks: usize, stated: usize| leaks > stated / 2 && leaks < 2 * stated;
    let near = is_near(rays, 4_241) && is_near(primary, 15_442) && is_near(shadow, 10_730);
    assert!(near, "{rays} rays, {primary} primary, {shadow} shadow");
}
