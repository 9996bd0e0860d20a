//! Rays aimed at the edges and vertices of closed meshes: the watertight test leaks none of them under any traversal,
//! and the others' leaks are counted, so that the rays are known to probe what they should.
#![allow(missing_docs, reason = "a test binary has no documentation")]

mod common;

use common::Stand;
use common::closed::{closed_scenes, rays_at_edges, wall_of_pixels};
use glam::Vec3;
use raycl::launch::cast_rays;
use raycl::scene::Scene;
use raycl::strategy::{
    Intersector, NodeWidth, Passes, Shading, Strategy, Traversal, Triangles, Width, preset,
};

/// Rays of one traversal in all.
const RAYS: usize = 60_000;
/// An image of at least as many pixels; odd, so that its last pixel is a vertex as its first is.
const SIDE: u32 = 245;

const ORIGINS: [Vec3; 5] = [
    Vec3::new(0.0, 0.0, 3.0),
    Vec3::new(2.0, 1.5, -1.0),
    Vec3::new(-0.3, 2.6, 0.7),
    Vec3::new(0.1, 0.2, 0.3), // inside the sphere
    Vec3::new(0.99, 0.03, 0.11),
];

fn modern() -> Strategy {
    preset("deferred").expect("a preset").strategy
}

/// Every way to cast single rays: exhaustively, in tiles of triangles, along a tree, alone and in packets.
fn traversals_of_rays(intersector: Intersector) -> Vec<Strategy> {
    let exhaustive = Strategy { intersector, ..modern() };
    let tree = Strategy { traversal: Traversal::Bvh, ..exhaustive };
    let mut all = vec![
        exhaustive,
        Strategy { width: Width::W16, ..exhaustive },
        Strategy { width: Width::W4, triangles: Triangles::Tiled, ..exhaustive },
        Strategy { node_width: NodeWidth::N2, ..tree },
        Strategy { node_width: NodeWidth::N4, ..tree },
        Strategy { width: Width::W16, ..tree },
        Strategy { width: Width::W16, node_width: NodeWidth::N16, ..tree },
    ];
    all.retain(|strategy| strategy.contradiction().is_none());
    all
}

/// Traversals of a camera's rays: whatever [`Strategy::contradiction`] lets through.
fn traversals_of_pixels(intersector: Intersector) -> Vec<Strategy> {
    let wide = Strategy { intersector, width: Width::W16, ..modern() };
    let mut all: Vec<_> = [Traversal::Exhaustive, Traversal::Raster, Traversal::Bvh, Traversal::Tile]
        .map(|traversal| Strategy { traversal, ..wide })
        .into();
    all.push(Strategy { traversal: Traversal::Bvh, width: Width::W1, ..wide });
    all.retain(|strategy| strategy.contradiction().is_none());
    all
}

/// Rays at edges and vertices that hit nothing.
fn leaks(stand: &Stand, scene: &Scene, strategy: &Strategy, count: usize) -> usize {
    let local_size = [8, 2];
    let built = stand.build(strategy, local_size).expect("a strategy that fits");
    let leaked = |&origin: &Vec3| {
        let rays = rays_at_edges(scene, origin, count / ORIGINS.len());
        let (program, tree) = (&built.program, built.tree.as_ref());
        let hits = cast_rays(&stand.queue, program, strategy, local_size, &built.scene, tree, &rays);
        hits.expect("a cast").iter().filter(|hit| hit.is_none()).count()
    };
    ORIGINS.iter().map(leaked).sum()
}

/// Leaks of a strategy in both closed meshes, of [`RAYS`].
fn leaks_of_rays(stands: &[(Stand, Scene)], strategy: &Strategy) -> usize {
    stands.iter().map(|(stand, scene)| leaks(stand, scene, strategy, RAYS / stands.len())).sum()
}

fn stands() -> Vec<(Stand, Scene)> {
    closed_scenes().into_iter().map(|scene| (Stand::new(scene.clone(), [64, 64]), scene)).collect()
}

/// A wall that fills the view, before a background that shows through any leak.
fn wall() -> Stand {
    let mut scene = wall_of_pixels(SIDE);
    scene.background = Vec3::splat(7.0);
    Stand::new(scene, [SIDE; 2])
}

/// Pixels of the wall that show the background.
fn leaks_of_pixels(wall: &Stand, strategy: &Strategy) -> usize {
    let image = wall.cast(strategy, [8, 2]).expect("an image");
    assert!(image.pixels.len() >= RAYS);
    image.pixels.iter().filter(|pixel| **pixel == [7.0; 3]).count()
}

/// What the strategy is, for tables.
fn label(strategy: &Strategy) -> String {
    let named = ["traversal", "intersector", "triangles", "width", "node_width", "epsilons"];
    let axes = strategy.axes();
    let values = axes.iter().filter(|(axis, _)| named.contains(axis)).map(|(_, value)| *value);
    values.collect::<Vec<_>>().join(" ")
}

#[test]
fn the_watertight_test_leaks_none_of_sixty_thousand_rays() {
    let stands = stands();
    for strategy in traversals_of_rays(Intersector::Watertight) {
        assert_eq!(leaks_of_rays(&stands, &strategy), 0, "{strategy}");
    }
}

#[test]
fn the_watertight_test_leaks_none_of_sixty_thousand_pixels() {
    let wall = wall();
    for strategy in traversals_of_pixels(Intersector::Watertight) {
        assert_eq!(leaks_of_pixels(&wall, &strategy), 0, "{strategy}");
    }
}

/// The rasteriser's edge functions are exact opposites as well, and belong to one side where they are zero.
#[test]
fn the_rasteriser_leaks_none_of_sixty_thousand_pixels() {
    let raster = preset("raster").expect("a preset").strategy;
    assert_eq!(leaks_of_pixels(&wall(), &raster), 0);
}

/// They are not watertight and promise nothing, but their edges overlap by a few roundings: more than one leak in a hundred
/// edge rays would be a mistake. Run with --nocapture for the table of docs/reliability.md.
#[test]
fn the_other_tests_leaks_are_counted() {
    let (stands, wall) = (stands(), wall());
    let mut table = Vec::new();
    for intersector in [Intersector::MollerTrumbore, Intersector::CommonOrigin] {
        for strategy in traversals_of_rays(intersector) {
            table.push((label(&strategy), "rays", leaks_of_rays(&stands, &strategy)));
        }
        for strategy in traversals_of_pixels(intersector) {
            table.push((label(&strategy), "pixels", leaks_of_pixels(&wall, &strategy)));
        }
    }
    for (label, of, leaks) in &table {
        println!("{leaks:6} {of:6} {label}");
    }
    let worst = table.iter().map(|(.., leaks)| *leaks).max();
    assert!(worst.is_some_and(|leaks| leaks < RAYS / 100), "{table:?}");
}

#[test]
fn the_papers_test_leaks_so_the_rays_do_probe_edges() {
    let paper = preset("private").expect("a preset").strategy;
    let rays = leaks_of_rays(&stands(), &paper);
    let wide = Strategy {
        traversal: Traversal::Bvh,
        width: Width::W16,
        shading: Shading::Deferred,
        passes: Passes::Separate,
        ..paper
    };
    let pixels = leaks_of_pixels(&wall(), &wide);
    println!("{rays:6} rays   {}\n{pixels:6} pixels {}", label(&paper), label(&wide));
    assert!(rays > 10 && pixels > 10, "{rays} rays, {pixels} pixels");
}
