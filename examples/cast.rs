//! Casts a picture of a scene: `cargo run --example cast -- scenes/teapot.toml teapot.png cpu`.

use miette::{Result, bail};
use raycl::{Raycaster, load_scene};

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [scene, picture, device @ ..] = &words[..] else { bail!("usage: cast SCENE PICTURE [DEVICE]") };
    let loaded = load_scene(scene.as_ref())?;
    loaded.notes.iter().for_each(|note| println!("note: {note}"));

    let mut caster = Raycaster::open(loaded.scene, device.first().map(String::as_str))?;
    // The first frame includes work that a driver does only once, so the second frame is timed.
    caster.cast(None, [320, 200])?;
    let cast = caster.cast(None, [320, 200])?;
    cast.save(picture.as_ref())?;
    println!("{}: {:.3} ms, {} pixels hit something", caster.device(), cast.frame_ms, cast.hit_pixels);
    Ok(())
}
