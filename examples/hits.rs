//! Prints how much of the picture each object of a scene covers:
//! `cargo run --example hits -- scenes/still-life.toml`.

use miette::{Result, bail};
use raycl::{NOTHING, hits, load_scene};
use std::collections::BTreeMap;

fn main() -> Result<()> {
    let Some(scene) = std::env::args().nth(1) else { bail!("usage: hits SCENE") };
    let layers = hits(&load_scene(scene.as_ref())?, [160, 100])?;

    // The number of pixels of each object, and the smallest depth among them.
    let mut objects: BTreeMap<u32, (usize, f32)> = BTreeMap::new();
    for (object, depth) in layers.object.iter().zip(&layers.depth).filter(|(object, _)| **object != NOTHING) {
        let (pixels, nearest) = objects.entry(*object).or_insert((0, f32::INFINITY));
        (*pixels, *nearest) = (*pixels + 1, nearest.min(*depth));
    }
    for (object, (pixels, nearest)) in objects {
        println!("object {object}: {pixels} pixels, the nearest at depth {nearest:.3}");
    }
    Ok(())
}
