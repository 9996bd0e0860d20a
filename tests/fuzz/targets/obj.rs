//! Reads an OBJ file as a bare mesh. An input is the OBJ file and, after a line `====`, its material file.
#![no_main]

mod folder;

use libfuzzer_sys::fuzz_target;
use raycl::scene::load_scene;

fuzz_target!(|bytes: &[u8]| {
    let cut = bytes.windows(5).position(|window| window == b"====\n");
    let (obj, mtl) = cut.map_or((bytes, &b""[..]), |at| (&bytes[..at], &bytes[at + 5..]));
    folder::write("m.mtl", mtl);
    if let Ok(loaded) = load_scene(&folder::write("mesh.obj", obj)) {
        loaded.scene.validate().expect("a loaded scene is valid");
    }
});
