//! Reads a mesh file of any format. raycl recognises the format by the file's content.
#![no_main]

mod folder;

use libfuzzer_sys::fuzz_target;
use raycl::scene::load_scene;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(loaded) = load_scene(&folder::write("mesh", bytes)) {
        loaded.scene.validate().expect("a loaded scene is valid");
    }
});
