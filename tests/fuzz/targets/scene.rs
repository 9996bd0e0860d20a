//! Reads a scene's TOML.
#![no_main]

mod folder;

use libfuzzer_sys::fuzz_target;
use raycl::scene::load_scene;

fuzz_target!(|bytes: &[u8]| {
    // Inputs that may generate large meshes are skipped: these meshes are slow, but not wrong.
    let digits = bytes.split(|byte| !byte.is_ascii_digit()).map(<[u8]>::len).max().unwrap_or(0);
    if digits > 4 || bytes.contains(&b'e') && bytes.windows(9).any(|window| window == b"triangles") && digits > 2 {
        return;
    }
    if let Ok(loaded) = load_scene(&folder::write("scene.toml", bytes)) {
        loaded.scene.validate().expect("a loaded scene is valid");
    }
});
