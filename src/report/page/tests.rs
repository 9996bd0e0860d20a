use super::*;
use crate::output::{Choice, OutFolder, is_of_report};
use crate::record::fixtures::{infeasible, judged, measured};
use std::collections::HashSet;

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
fn the_microscope_is_asked_for_with_the_folder_of_kernels_of_the_run() {
    let mut best = measured("gpu", "naive", 8, 1.0);
    best.scene_file = Some("scenes/teapot.toml".into());
    let of = |device: &str, kernels: &str| {
        let sources = serde_json::json!([
            { "what": "config", "path": "a.toml" }, { "what": "kernels", "path": kernels }
        ]);
        let environment = serde_json::json!({ "devices": [{ "device": device }], "sources": sources });
        Folder { environment, ..Folder::default() }
    };
    let has = |folders: &[Folder], end: &str| command(folders, &best).is_some_and(|text| text.ends_with(end));
    assert!(has(&[of("gpu", "mine"), of("gpu", "mine")], "--strategy naive --cl-dir mine --out compiled"));
    assert!(has(&[of("gpu", "built in"), of("cpu", "mine")], "--strategy naive --out compiled"));
    assert_eq!(command(&[of("gpu", "built in"), of("gpu", "mine")], &best), None);
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
fn a_row_has_millions_of_rays_and_billions_of_tests_per_second() {
    // The frame takes 10 ms for 400,000 primary rays and 200,000 shadow rays. The primary rays take 4 ms of these
    // 10 ms.
    let record = Record {
        shadow_rays: Some(200_000),
        primary_ms: Some(4.0),
        tests_per_s: Some(2e9),
        ..measured("gpu", "naive", 8, 10.0)
    };
    let shown = row(&record, None, false);
    assert_eq!([shown.frame_rays, shown.primary_rays, shown.tests], ["60.0", "100", "2.00"]);
}

#[test]
fn a_scene_at_two_image_sizes_is_one_scene() {
    let at = |image_size| Record { image_size, ..measured("gpu", "naive", 8, 1.0) };
    let records = [[800, 500], [1600, 1000]].map(at);
    let counts = counts(&records, &groups(&records));
    assert_eq!(counts[..2], ["scene", "device"].map(|name| ("1".to_owned(), name.to_owned())));
}

#[test]
fn the_host_of_the_baselines_is_no_device() {
    let records = [measured("gpu", "naive", 8, 1.0), measured("host", "serial-f32", 0, 100.0)];
    let counts = counts(&records, &groups(&records));
    assert_eq!(counts[1], ("1".to_owned(), "device".to_owned()));
}

#[test]
fn a_machines_ratio_stands_before_the_interval_of_the_ratio() {
    let at = |slower| AtHost {
        host: "n2".to_owned(),
        blocks: 2,
        median_ms: 12.0,
        interval_ms: Some([11.5, 12.5]),
        slower,
    };
    let row = host_row("teapot", &at(Some([1.2, 1.1, 1.3])));
    assert_eq!((row.point.as_str(), row.host.as_str(), row.blocks), ("teapot", "n2", 2));
    let texts = [&row.median, &row.interval, &row.slower].map(String::as_str);
    assert_eq!(texts, ["12.00", "11.50 to 12.50", "1.20× (1.10 to 1.30)"]);
    assert!(row.differs);
    let few = host_row("teapot", &at(None));
    assert_eq!((few.slower.as_str(), few.differs), ("", false));
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

/// Two scenes were measured on two devices at two image sizes. The scenes' names differ only in characters
/// that raycl replaces in file names.
#[test]
fn every_plot_has_a_file_of_its_own_that_a_later_report_can_remove() {
    let of = |device: &str, (scene, triangles): (&str, u64), width: u32, side: u32| Record {
        scene: scene.to_owned(),
        triangles: Some(triangles),
        image_size: [width, 500],
        ..measured(device, "naive", side, 1.0)
    };
    let mut records = Vec::new();
    for device in ["gpu", "cpu"] {
        for scene in [("é", 10), ("è", 1000)] {
            for width in [400, 800] {
                records.extend([4, 8, 16].map(|side| of(device, scene, width, side)));
            }
        }
    }
    let page = Page::of(&[Folder { records: judged(records), ..Folder::default() }]);
    let names: Vec<&str> = page.plots().into_iter().map(|plot| plot.name.as_str()).collect();
    assert_eq!(names.iter().collect::<HashSet<_>>().len(), names.len(), "{names:?}");
    assert!(names.contains(&"strategies-by-device") && names.contains(&"losses-by-device"), "{names:?}");
    for name in names {
        assert!(is_of_report(&format!("plots/{name}.svg")), "{name}");
    }
}

/// Returns the page of two strategies that differ in the memory of their vectors, in two scenes. In the second scene,
/// the second strategy has too few samples.
fn page_of_one_change(name: &str) -> String {
    let of = |scene: &str, (name, vectors, ms): (&str, &str, f64)| Record {
        scene: scene.to_owned(),
        strategy: format!("traversal=exhaustive vectors={vectors}"),
        ..measured("gpu", name, 8, ms)
    };
    let strategies = [("naive", "heap", 10.0), (name, "private", 5.0)];
    let mut records = ["room", "teapot"].map(|scene| strategies.map(|one| of(scene, one))).concat();
    records[3].samples_ms.truncate(3);
    records[3].sample_launches.truncate(3);
    records[3].samples_at_ms.truncate(3);
    Page::of(&[Folder { records: judged(records), ..Folder::default() }]).html().expect("a page")
}

#[test]
fn one_change_at_a_time_is_between_the_plots_of_all_scenes_and_those_of_one() {
    let page = page_of_one_change("private");
    let headings =
        ["<h2>All scenes together</h2>", ">One change at a time</h2>", "<h2>One scene on one device</h2>"];
    let places = headings.map(|heading| page.find(heading).expect("a heading"));
    assert!(places.is_sorted(), "{places:?}");
    let section = &page[places[1]..places[2]];
    for part in [
        "<caption>gpu, 800 x 500</caption>",
        "<th scope=\"col\">change</th><th scope=\"col\" class=\"num\">room</th>",
        "<th scope=\"row\">vectors: heap → private <small>(naive → private)</small></th>",
        "title=\"private at 8 x 8 is 2.00 (1.98 to 2.02) times as fast as naive at 8 x 8\"",
        ">2.00 (1.98 to 2.02)<br><b class=\"faster\">faster</b> <small>8 x 8</small></td>",
        "title=\"private at 8 x 8: not enough samples (n = 3)\">-</td>",
    ] {
        assert!(section.contains(part), "{part} is not in {section}");
    }
    assert!(!page_of_one_change("</th><script>").contains("</th><script>"), "a name became markup");
}

#[test]
fn a_page_without_changes_of_a_single_axis_has_no_part_for_them() {
    let records = judged([measured("gpu", "naive", 8, 10.0), measured("gpu", "wide", 8, 5.0)]);
    let page = Page::of(&[Folder { records, ..Folder::default() }]).html().expect("a page");
    assert!(page.contains("<h2>One scene on one device</h2>") && !page.contains("One change at a time"));
}

#[test]
fn a_scene_with_a_long_name_has_plots_and_exports() {
    let out_folder = tempfile::tempdir().expect("a folder");
    let record = Record { scene: "a".repeat(240), ..measured("gpu", "naive", 8, 1.0) };
    let folder = Folder { records: judged([record]), ..Folder::default() };
    let choice = Choice::new(false, "--out DIR");
    let mut out = OutFolder::open(out_folder.path(), choice).expect("an empty folder");
    let written = crate::report::write(&[folder], &mut out).expect("the names are short enough");
    let files = |folder: &std::path::Path| std::fs::read_dir(folder).expect("a folder").count();
    assert_eq!((files(&written.plots.0), files(&written.exports)), (2 * written.plots.1, 3));
}

#[test]
fn the_small_picture_of_an_answer_comes_from_its_own_folder() {
    let parent = tempfile::tempdir().expect("a folder");
    let folder = |(label, grey): (&str, u8)| {
        let path = parent.path().join(label);
        std::fs::create_dir(&path).expect("a folder");
        let picture = image::RgbImage::from_pixel(3, 2, image::Rgb([grey; 3]));
        picture.save(path.join("naive.png")).expect("it saves");
        let record = Record {
            scene_hash: Some(label.to_owned()),
            image: Some("naive.png".to_owned()),
            ..measured("gpu", "naive", 8, 1.0)
        };
        Folder { path, label: label.to_owned(), records: judged([record]), ..Folder::default() }
    };
    let page = Page::of(&[("before", 1), ("after", 2)].map(folder));
    let [before, after] = [0, 1].map(|index| page.answers[index].1.clone());
    assert!(before.is_some() && after.is_some() && before != after, "{before:?}, {after:?}");
}

#[test]
fn the_small_picture_of_an_answer_is_that_of_the_fastest_winner() {
    let folder = tempfile::tempdir().expect("a folder");
    let of = |name: &str, side: u32, ms: f64, grey: u8| {
        let picture = image::RgbImage::from_pixel(3, 2, image::Rgb([grey; 3]));
        picture.save(folder.path().join(format!("{name}.png"))).expect("it saves");
        Record { image: Some(format!("{name}.png")), ..measured("gpu", name, side, ms) }
    };
    let records = judged([of("naive", 8, 10.01, 1), of("wide", 4, 10.0, 200)]);
    let winners: Vec<String> =
        groups(&records)[0].ranking().winners.iter().map(|record| record.name.clone()).collect();
    assert_eq!(winners, ["wide", "naive"]);
    let page = Page::of(&[Folder { path: folder.path().to_owned(), records, ..Folder::default() }]);
    let expected = Pictures::default().thumbnail(folder.path(), "wide.png");
    assert!(expected.is_some());
    assert_eq!(page.answers[0].1, expected);
}

#[test]
fn the_question_of_several_folders_is_shown_once() {
    let of = |question: &str| Folder {
        environment: serde_json::json!({ "config": format!("question = '{question}'\nexpectation = '!'") }),
        ..Folder::default()
    };
    let pair = |question: &str| (question.to_owned(), "!".to_owned());
    assert_eq!(questions(&["a?", "b?", "a?"].map(of)), ["a?", "b?"].map(pair));
}

/// In a report on several folders, a record's device name may end with the folder's label, and `--device`
/// does not select a device by such a name.
#[test]
fn the_instructions_of_the_fastest_point_are_offered_only_for_a_single_folder() {
    let folder = |label: &str| {
        let record =
            Record { scene_file: Some("scenes/teapot.toml".into()), ..measured("gpu", "naive", 8, 1.0) };
        let environment = serde_json::json!({ "devices": [{ "device": "gpu" }] });
        Folder { label: label.to_owned(), environment, records: judged([record]), ..Folder::default() }
    };
    let commands = |folders: &[Folder]| -> Vec<String> {
        Page::of(folders).views.into_iter().map(|view| view.microscope).collect()
    };
    let one = commands(&[folder("before")]);
    assert!(one.len() == 1 && one[0].starts_with("raycl compile scenes/teapot.toml "), "{one:?}");
    let two = commands(&["before", "after"].map(folder));
    assert!(!two.is_empty() && two.iter().all(String::is_empty), "{two:?}");
}

#[test]
fn a_report_on_several_folders_says_which_records_it_leaves_out_and_has_no_notes_on_them() {
    let folder = |label: &str, names: &[&str], ms: f64| {
        let records: Vec<Record> = names.iter().map(|name| measured("gpu", name, 8, ms)).collect();
        let notes = vec![format!("a note on {label}")];
        Folder { label: label.to_owned(), records: judged(records), notes, ..Folder::default() }
    };
    let old = || folder("old", &["naive", "wide"], 2.0);
    let said = |count: &str| {
        format!(
            "{count} in several folders. Of each such point, the page shows only the record of the last of these folders."
        )
    };
    let all = Page::of(&[old(), folder("new", &["naive", "wide"], 1.0)]).notes;
    assert_eq!(all, ["new: a note on new".to_owned(), said("2 points are")]);
    let some = Page::of(&[old(), folder("new", &["naive"], 1.0)]).notes;
    let notes = ["old: a note on old".to_owned(), "new: a note on new".to_owned(), said("1 point is")];
    assert_eq!(some[..3], notes);
    // The two points that the page shows were measured in two runs.
    assert!(
        some.len() == 4 && some[3].starts_with("In 1 of 1 group of points, such as teapot 800 x 500"),
        "{some:?}"
    );
    assert_eq!(Page::of(&[old()]).notes, ["a note on old"]);
}

#[test]
fn a_device_is_not_compared_with_the_baselines_of_another_machine() {
    let folder = |label: &str, records: &[Record]| {
        let environment = serde_json::json!({ "host": { "name": label, "cpu": "EPYC", "cores": 2 } });
        Folder { label: label.to_owned(), environment, records: judged(records), ..Folder::default() }
    };
    let kernels =
        |device: &str| [("naive", 20.0), ("wide", 10.0)].map(|(name, ms)| measured(device, name, 8, ms));
    let cpu = [&kernels("cpu")[..], &[measured(HOST, "serial-f32", 0, 400.0)]].concat();
    let page = Page::of(&[folder("gpus", &kernels("gpu")), folder("cpus", &cpu)]);
    let speedups = page.answers.iter().map(|(answer, _)| answer.speedups.len());
    assert_eq!(speedups.collect::<Vec<_>>(), [1, 2]);
    assert!(page.headline.contains("as fast as serial-f32 (in 1 of 2 comparisons)"), "{}", page.headline);
    let rows = page.views.iter().map(|view| view.rows.len());
    assert_eq!(rows.collect::<Vec<_>>(), [2, 3]);
}

#[test]
fn the_table_of_a_group_ends_with_the_baselines_of_the_host() {
    let records = judged([measured(HOST, "serial-f32", 0, 1.0), measured("gpu", "naive", 8, 10.0)]);
    let page = Page::of(&[Folder { records, ..Folder::default() }]);
    let rows: Vec<_> = page.views[0].rows.iter().map(|row| (row.name.as_str(), row.wins)).collect();
    assert_eq!(rows, [("naive", true), ("serial-f32 (host)", false)]);
}

#[test]
fn a_run_of_baselines_alone_has_their_times() {
    let records = judged([measured(HOST, "serial-f32", 0, 400.0), measured(HOST, "parallel-f32", 0, 100.0)]);
    let page = Page::of(&[Folder { records, ..Folder::default() }]);
    assert_eq!(page.headline, "Only baselines were measured");
    assert_eq!(page.counts[0], ("1".to_owned(), "scene".to_owned()));
    let [(answer, _)] = page.answers.as_slice() else { panic!("an answer") };
    assert_eq!((answer.winners.len(), answer.time.as_str(), answer.speedups.len()), (1, "100.0 ms", 0));
    let [view] = page.views.as_slice() else { panic!("a view") };
    let rows: Vec<_> = view.rows.iter().map(|row| (row.name.as_str(), row.wins)).collect();
    assert_eq!(rows, [("parallel-f32 (host)", true), ("serial-f32 (host)", false)]);
    assert!(view.first && view.heat.is_none());
    let failed = vec![infeasible(HOST, "serial-f32", 0, "no")];
    let page = Page::of(&[Folder { records: failed, ..Folder::default() }]);
    assert_eq!(page.headline, "Nothing could be measured");
}

/// The page has a wide and a narrow form of most plots. In a narrow window, the style sheet hides the wide form.
/// Other wide parts of the page, such as the list of input files, have no narrow form.
#[test]
fn a_narrow_window_hides_only_the_wide_forms_of_plots() {
    let hides = |rule: &&str| rule.contains(".wide") && rule.contains("display: none");
    let hiding: Vec<&str> = STYLE.split('}').filter(hides).collect();
    assert!(hiding.len() == 1 && hiding[0].contains(".scroll.wide { display: none;"), "{hiding:?}");
}

#[test]
fn a_row_has_its_time_as_a_multiple_of_the_best_time() {
    let records = judged([measured("gpu", "naive", 8, 20.0), measured("gpu", "wide", 4, 10.0)]);
    let slower = |index: usize| row(&records[index], Some(&records[1]), false).slower;
    assert_eq!([0, 1].map(slower), ["2.00×", "1.00×"]);
}

/// Returns the page of a strategy at three local sizes, on a device with a known compute capability.
fn page_of_three_sizes() -> Page {
    let environment = serde_json::json!({ "devices": [{ "device": "gpu", "compute_capability": "9.0" }] });
    let records = judged([4, 8, 16].map(|side| measured("gpu", "naive", side, f64::from(side))));
    Page::of(&[Folder { environment, records, ..Folder::default() }])
}

#[test]
fn occupancy_is_predicted_for_the_devices_compute_capability() {
    let page = page_of_three_sizes();
    let is_wanted = |plot: &&Plot| plot.name.starts_with("occupancy");
    let caption = &page.views[0].others.iter().find(is_wanted).expect("a plot").caption;
    assert!(caption.contains("compute capability, 9.0, and assumes the paper's 63 registers"), "{caption}");
}

#[test]
fn times_over_local_sizes_have_a_logarithmic_plot_before_a_linear_one() {
    let page = page_of_three_sizes();
    let plots = page.views[0].lines.as_ref().expect("plots");
    assert_eq!(plots.each_ref().map(|plot| plot.svg.contains(">0<")), [false, true]);
}

#[test]
fn the_page_opens_with_the_scene_of_the_most_triangles() {
    let of = |(scene, triangles): (&str, u64)| Record {
        scene: scene.to_owned(),
        triangles: Some(triangles),
        ..measured("gpu", "naive", 8, 1.0)
    };
    let records = judged([("a", 5), ("b", 9), ("c", 2)].map(of));
    let page = Page::of(&[Folder { records, ..Folder::default() }]);
    let first: Vec<bool> = page.views.iter().map(|view| view.first).collect();
    assert_eq!(first, [false, true, false]);
}
