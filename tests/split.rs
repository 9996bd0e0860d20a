//! One frame on several devices: the same pixels as on one. PoCL makes two devices of one machine.
#![allow(missing_docs, reason = "a test binary has no documentation")]

mod binary;

use binary::{Place, repository};
use serde_json::Value;

fn render(place: &Place, devices: Option<&str>, strategy: &str, picture: &str) -> Value {
    let scene = repository("scenes/still-life.toml");
    let mut arguments = vec!["render", scene.to_str().expect("UTF-8"), "--json", "-o", picture];
    arguments.extend(["--width", "75", "--height", "61", "--strategy", strategy, "--local-size", "4x2"]);
    match devices {
        Some(devices) => arguments.extend(["--devices", devices, "--verify"]),
        None => arguments.extend(["--device", "portable computing language"]),
    }
    let mut command = place.raycl(&arguments);
    let output =
        command.env("POCL_DEVICES", "pthread pthread").assert().success().get_output().stdout.clone();
    serde_json::from_slice(&output).expect("JSON")
}

#[test]
fn two_devices_cast_the_pixels_of_one() {
    let place = Place::new();
    for strategy in ["naive-scratch", "deferred,width=4", "bvh", "tiled-common-origin", "naive"] {
        let one = render(&place, None, strategy, "one.exr");
        let two = render(&place, Some("portable computing language"), strategy, "two.exr");
        let rows: Vec<[u64; 2]> = two["devices"]
            .as_array()
            .expect("a list")
            .iter()
            .map(|device| [0, 1].map(|end| device["rows"][end].as_u64().expect("a row")))
            .collect();
        assert_eq!(rows.len(), 2, "{two}");
        assert_eq!((rows[0][0], rows[0][1], rows[1][1]), (0, rows[1][0], 61), "{two}");
        assert!(rows.iter().all(|[first, end]| first < end), "{two}");
        assert_eq!(two["strategy"], one["strategy"]);
        let longest = two["devices"].as_array().into_iter().flatten().filter_map(|d| d["frame_ms"].as_f64());
        assert_eq!(two["frame_ms"].as_f64(), longest.reduce(f64::max));
        assert!(same_pixels(&place, "one.exr", "two.exr"), "{strategy}: other pixels");
    }
}

fn same_pixels(place: &Place, one: &str, other: &str) -> bool {
    let [one, other] = [one, other].map(|name| image::open(place.path(name)).expect("a picture").to_rgb32f());
    one.dimensions() == other.dimensions() && one.as_raw() == other.as_raw()
}
