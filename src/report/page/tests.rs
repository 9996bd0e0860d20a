use super::*;
use crate::record::fixtures::{infeasible, measured};

#[test]
fn the_microscope_is_asked_for_by_the_devices_own_name() {
    let environment = serde_json::json!({ "devices": [{ "device": "gpu" }] });
    let folders = [Folder { environment, ..Folder::default() }];
    let mut best = measured("gpu (driver 580)", "naive", 8, 1.0);
    best.scene_file = Some("scenes/teapot.toml".into());
    let command = command(&folders, &best).expect("a command");
    assert!(command.contains("--device gpu --local-size 8x8"), "{command}");
}

#[test]
fn what_does_not_fit_or_is_not_meant_for_the_device_has_not_failed() {
    let with = |name: &str, outcome| Record { outcome, ..infeasible("gpu", name, 1, "no") };
    let records = [
        measured("gpu", "naive", 8, 1.0),
        infeasible("gpu", "local-vectors", 32, "too large"),
        infeasible("gpu", "local-vectors", 16, "too large"),
        with("wide", Outcome::OtherKind),
        with("bvh", Outcome::BuildFailed),
    ];
    let said = |records: &[Record]| -> Vec<String> {
        let counts = counts(records, &groups(records));
        counts.into_iter().map(|(count, name)| format!("{count} {name}")).collect()
    };
    assert_eq!(
        said(&records)[2..],
        [
            "5 points",
            "10 samples",
            "2 points do not suit the device or the scene",
            "1 point is meant for another kind of device",
            "1 point failed",
        ]
    );
    assert_eq!(
        said(&records[..4])[4..],
        ["2 points do not suit the device or the scene", "1 point is meant for another kind of device"]
    );
}

#[test]
fn a_scene_at_two_image_sizes_is_one_scene() {
    let at = |image_size| Record { image_size, ..measured("gpu", "naive", 8, 1.0) };
    let records = [[800, 500], [1600, 1000]].map(at);
    let counts = counts(&records, &groups(&records));
    assert_eq!(counts[..2], ["scene", "device"].map(|name| ("1".to_owned(), name.to_owned())));
}

#[test]
fn every_note_on_a_scene_is_shown_once() {
    let with = |(side, notes): (u32, [&str; 2])| Record {
        scene_notes: notes.map(str::to_owned).into(),
        ..measured("gpu", "naive", side, 1.0)
    };
    let records = [(4, ["a", "b"]), (8, ["b", "c"])].map(with);
    assert_eq!(scene_notes(&groups(&records)[0]), ["a", "b", "c"]);
}
