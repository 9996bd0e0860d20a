//! Plots the roofline of a device: the rates of operations that the device's arithmetic and memories allow,
//! and the rate that each point reaches (Samuel Williams, Andrew Waterman, David Patterson: "Roofline",
//! Communications of the ACM 52(4), 2009).

use super::merged::labels;
use super::overview::{devices, numbered};
use super::plot::Plot;
use super::plot::chart::{Across, Chart, Mark, Series};
use super::plot::look::Look;
use super::plot::scale::Kind;
use super::words::{Looks, tip};
use crate::device::common_name;
use crate::numbers::significant;
use crate::peak::{Peak, Traffic, operations_per_test};
use crate::record::{Folder, Group, Record};
use crate::words::counted;
use std::collections::HashMap;

/// The factor that converts operations and bytes to billions, the unit of the plot.
const BILLIONS: f64 = 1e-9;

/// Returns a plot for every device that has points with a known number of ray-triangle tests. If the operations of a
/// test are unknown for all points of a device, the plot shows only the roofs; if the device's peak rates are unknown
/// too, the device gets no plot. If several folders contain peak rates of the device, the plot shows the peak rates
/// of the last folder. `drivers` maps a device's common name to the name that the driver reports.
pub fn rooflines(
    groups: &[Group<'_>],
    looks: &Looks,
    folders: &[Folder],
    drivers: &HashMap<String, String>,
) -> Vec<Plot> {
    let mut peaks: Vec<(String, Peak)> = Vec::new();
    let mut unreadable: Vec<(String, &Folder, String)> = Vec::new();
    for (label, folder) in labels(folders).into_iter().zip(folders) {
        match Peak::stored_in(&folder.path) {
            Ok(of_folder) => {
                peaks.extend(of_folder.into_iter().map(|peak| (label.clone(), peak)));
            }
            Err(error) => unreadable.push((label, folder, format!("{error}; {}.", error.remedy()))),
        }
    }
    let of_device = |(index, device): (usize, &str)| {
        let own = groups.iter().filter(|group| group.device == device);
        let records: Vec<(&Group<'_>, &Record)> = own
            .flat_map(|group| group.ranking().all().into_iter().map(move |record| (group, record)))
            .collect();
        let is_its = |(label, peak): &&(String, Peak)| is_of(peak, label, device, drivers);
        let peak = peaks.iter().rev().find(is_its).map(|(_, peak)| peak);
        let has = |label: &str, folder: &Folder| {
            let mut devices = folder.records.iter().map(|record| &record.device);
            devices.any(|own| device == own || device == format!("{own} ({label})"))
        };
        let own = unreadable.iter().filter(|(label, folder, _)| has(label, folder));
        let unreadable: Vec<String> = own.map(|(_, _, reason)| reason.clone()).collect();
        roofline(&records, looks, device, (peak, &unreadable), numbered("roofline", index))
    };
    devices(groups).into_iter().enumerate().filter_map(of_device).collect()
}

/// Returns true if the peak rates belong to the device that the page calls `shown`. The name `shown` is the
/// common name or, if several devices have the same common name, the driver's name. The folder's label in
/// brackets may follow.
fn is_of(peak: &Peak, label: &str, shown: &str, drivers: &HashMap<String, String>) -> bool {
    let without_label = shown.strip_suffix(format!(" ({label})").as_str());
    [Some(shown), without_label].into_iter().flatten().any(|name| match drivers.get(name) {
        // This line compares the drivers' names, not the common names: a second driver may list a device with
        // the same common name but with other peak rates.
        Some(driver) => *driver == peak.device,
        None => name == peak.device || name == common_name(&peak.device),
    })
}

/// Returns the plot of a device, with roofs if `peak` is known. `unreadable` contains a message for each file
/// of peak rates that cannot be read. If no record has a mark, the plot shows only roofs. Such a plot needs
/// known peak rates, and a record with a known number of tests; otherwise, the function returns `None`.
fn roofline(
    records: &[(&Group<'_>, &Record)],
    looks: &Looks,
    device: &str,
    (peak, unreadable): (Option<&Peak>, &[String]),
    name: String,
) -> Option<Plot> {
    let (mut series, mut left_out): (Vec<Series>, Vec<&Record>) = (Vec::new(), Vec::new());
    for (group, record) in records {
        let Some(mark) = mark(group, record) else {
            left_out.push(record);
            continue;
        };
        Series::add(&mut series, &record.name, looks.look(&record.name), false, mark);
    }
    let ends = ends(&series, peak);
    let roofs: Vec<Series> = peak.into_iter().flat_map(|peak| roofs(peak, ends, looks)).collect();
    let has_roofs = !roofs.is_empty();
    // If tests are counted, but the operations of a test are unknown for all records, the plot shows only the
    // measured roofs, and the caption says why the plot has no marks.
    let are_counted = left_out.iter().any(|record| record.tests_per_s.is_some());
    if series.is_empty() && !(has_roofs && are_counted) {
        return None;
    }
    series.sort_by_key(|one| one.look.number);
    series.extend(roofs);
    let chart = Chart {
        title: format!("Roofline: {device}"),
        x_label: "operations of a ray-triangle test per byte that it reads".into(),
        y_label: "operations per second, billions".into(),
        across: Across::Numbers(Kind::Log),
        up: Kind::Log,
        diagonal: false,
        series,
    };
    let rates = match peak {
        None => Rates::Unknown(unreadable),
        Some(_) if has_roofs => Rates::Known,
        Some(_) => Rates::Zero,
    };
    Some(Plot::of(name, caption(rates, &left_out), &chart))
}

/// Returns a record's mark in the plot; `None` if the record's ray-triangle tests per second, or the operations or the
/// bytes per test, are unknown.
fn mark(group: &Group<'_>, record: &Record) -> Option<Mark> {
    let (tests_per_s, traffic) = (record.tests_per_s?, Traffic::of(record)?);
    let operations = f64::from(operations(record)?);
    let tip = format!(
        "{}\n{}\n{operations} operations per test; {} B of the triangle from {} memory{}",
        group.scene,
        tip(record),
        significant(traffic.triangle_bytes, 3),
        traffic.triangle_in,
        match traffic.ray_bytes > 0.0 {
            true => format!(", {} B of the ray from {} memory", traffic.ray_bytes, traffic.ray_in),
            false => String::new(),
        }
    );
    Some(Mark {
        x: operations / traffic.bytes(),
        y: BILLIONS * tests_per_s * operations,
        interval: None,
        tip,
    })
}

/// Returns the number of operations of a record's ray-triangle test, as the record states it. Records of
/// earlier versions of raycl do not state the number of bytes, and state the number of operations only if the
/// device's peak rate was known. For a record of an earlier version that does not state the number of
/// operations, this number comes from the headers of the kernel files that this process has read. A record of
/// the present version lacks the number of operations only if the header of the test's kernel file has no
/// `operations`; for such a record, the function returns `None`.
fn operations(record: &Record) -> Option<u32> {
    let is_old = record.triangle_bytes_per_test.is_none();
    let by_header = || is_old.then(|| operations_per_test(&record.strategy)).flatten();
    record.operations_per_test.or_else(by_header)
}

/// Returns the range of the plot's x axis: from half the least to twice the greatest x of all marks and of
/// the corners of all roofs.
fn ends(series: &[Series], peak: Option<&Peak>) -> [f64; 2] {
    let corners = peak.into_iter().flat_map(|peak| {
        let fma = peak.fma_per_s.median;
        [peak.copy_bytes_per_s, peak.local_bytes_per_s].map(|bytes| fma / bytes.median)
    });
    let marks = series.iter().flat_map(|one| &one.marks).map(|mark| mark.x);
    let all = marks.chain(corners).filter(|x| x.is_finite() && *x > 0.0);
    let [low, high] = all.fold([f64::INFINITY, 0.0], |[low, high], x| [x.min(low), x.max(high)]);
    [low / 2.0, high * 2.0]
}

/// Returns the roofs (the upper bounds on the rate of operations) as lines. At x operations per byte, the height of a
/// roof is x times the memory's bytes per second, but at most the rate of multiply-adds. A memory has no roof if one of
/// these two rates is 0.
fn roofs(peak: &Peak, [low, high]: [f64; 2], looks: &Looks) -> Vec<Series> {
    let fma = peak.fma_per_s.median;
    let memories = [
        ("roof: global memory", peak.copy_bytes_per_s.median),
        ("roof: __local memory", peak.local_bytes_per_s.median),
    ];
    let known = memories.into_iter().filter(|(_, bytes_per_s)| *bytes_per_s > 0.0 && fma > 0.0);
    let roof = |(index, (name, bytes_per_s)): (usize, (&str, f64))| {
        let tip = format!(
            "{name}\n{} GB/s, up to {} Gfma/s",
            significant(BILLIONS * bytes_per_s, 3),
            significant(BILLIONS * fma, 3)
        );
        let mark =
            |x: f64| Mark { x, y: BILLIONS * fma.min(x * bytes_per_s), interval: None, tip: tip.clone() };
        Series {
            name: name.to_owned(),
            look: Look { dashed: true, number: looks.look(name).number + index },
            joined: true,
            marks: [low, fma / bytes_per_s, high].map(mark).to_vec(),
        }
    };
    known.enumerate().map(roof).collect()
}

/// What is known about the peak rates of a device.
enum Rates<'a> {
    /// The plot has roofs.
    Known,
    /// The plot has no roofs, because the rate of multiply-adds is 0, or because the rates of both memories
    /// are 0.
    Zero,
    /// There are no peak rates. The list contains a message for each file of peak rates that cannot be read.
    Unknown(&'a [String]),
}

fn caption(rates: Rates<'_>, left_out: &[&Record]) -> String {
    let roofs = match rates {
        Rates::Known => "Dashed lines are roofs: the device's measured peak rates. A point above a memory's roof \
                      gets its data from caches or another memory."
            .to_owned(),
        Rates::Zero => "The plot has no roofs, because the file of peak rates says that the device's arithmetic or \
                        both of its memories have a rate of 0."
            .to_owned(),
        Rates::Unknown([]) => "The device's rates, which a roofline shows as roofs, were not measured with these \
                        records, so the plot has no roofs. `raycl peak --out DIR/peak.json` or `raycl run CONFIG --peak` \
                        measures these rates; DIR is the folder of results."
            .to_owned(),
        Rates::Unknown(some) => format!("The plot has no roofs: {}", some.join(" ")),
    };
    let not_shown = not_shown(left_out);
    format!(
        "Each mark is a point of the experiment. A mark's height is the number of operations per second in ray-triangle tests \
         (primary rays only; a multiply-add counts as one). A mark's horizontal position is the number of a \
         test's operations, divided by the number of bytes that the test reads. The triangle's bytes are divided by \
         the number of rays of a work-item. With private vectors, no bytes of the ray are counted. If passes are fused, the rate is computed from the time of the whole frame, \
         so this rate is a lower bound. {roofs}{not_shown}"
    )
}

/// Returns a text that says how many points have no mark in the plot, for each of two reasons: the number of
/// ray-triangle tests is unknown, or the operations of a test are unknown. Returns an empty text if the plot
/// has a mark for every point.
fn not_shown(left_out: &[&Record]) -> String {
    let uncounted = left_out.iter().filter(|record| record.tests_per_s.is_none()).count();
    let reasons = [
        (uncounted, "If rays walk a tree, or triangles are rasterised, the number of tests is not recorded."),
        (left_out.len() - uncounted, "The header of the ray-triangle test states no `operations`."),
    ];
    let some = reasons.into_iter().filter(|(count, _)| *count > 0);
    some.map(|(count, reason)| format!(" Not shown: {}. {reason}", counted(count, "point"))).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::peak::Figure;
    use crate::record::fixtures::{judged, measured};
    use crate::record::groups;
    use crate::report::common_names::with_common_names;
    use crate::strategy::preset;
    use std::path::Path;

    fn record(name: &str, tests_per_s: Option<f64>) -> Record {
        let strategy = preset(name).unwrap().strategy.to_string();
        Record { strategy, tests_per_s, ..measured("a gpu", name, 8, 1.0) }
    }

    fn peak() -> Peak {
        let figure = |rate: f64| Figure::of(&[rate]);
        Peak {
            device: "a gpu".into(),
            fma_per_s: figure(4e12),
            copy_bytes_per_s: figure(1e12),
            local_bytes_per_s: figure(8e12),
            ..Peak::default()
        }
    }

    /// Returns a folder of results that contains peak rates, but no records.
    fn with_rates(path: &Path) -> Folder {
        Peak::write(&[peak()], &path.join(crate::peak::FILE)).unwrap();
        Folder { path: path.to_owned(), ..Folder::default() }
    }

    fn plots(records: Vec<Record>, folders: &[Folder]) -> Vec<Plot> {
        let records = judged(records);
        let groups = groups(&records);
        rooflines(&groups, &Looks::of(&groups), folders, &HashMap::new())
    }

    #[test]
    fn a_devices_roofs_are_those_of_its_own_driver() {
        let [own, other] = ["basic", "pthread"].map(|driver| format!("{driver}-Intel(R) Xeon(R) Processor"));
        let rates = |device: &str, rate: f64| Peak {
            device: device.into(),
            fma_per_s: Figure::of(&[rate]),
            ..peak()
        };
        let temporary = tempfile::tempdir().unwrap();
        let peaks = [rates(&own, 4e12), rates(&other, 9e12)];
        Peak::write(&peaks, &temporary.path().join(crate::peak::FILE)).unwrap();
        let records = vec![Record { device: own, ..record("naive", Some(1e9)) }];
        let folder = Folder { path: temporary.path().to_owned(), records, ..Folder::default() };
        let (folders, drivers) = with_common_names(&[folder]);
        let records = judged(folders[0].records.clone());
        let groups = groups(&records);
        let plots = rooflines(&groups, &Looks::of(&groups), &folders, &drivers);
        assert!(plots[0].svg.contains("up to 4000 Gfma/s"), "{}", plots[0].svg);
        // On a page of several folders, a folder's label may follow the device's name.
        let are_of = |shown: &str| peaks.each_ref().map(|peak| is_of(peak, "mine", shown, &drivers));
        assert_eq!(are_of("Intel Xeon, PoCL (mine)"), [true, false]);
        assert_eq!(are_of("Intel Xeon, PoCL (another)"), [false, false]);
        // If the report does not know which name the driver gives to a device, the device's common name alone
        // decides whether the rates belong to the device.
        assert!(is_of(&peaks[0], "mine", "Intel Xeon, PoCL", &HashMap::new()));
    }

    #[test]
    fn a_mark_lies_at_its_operations_per_byte_below_the_roofs_that_were_measured() {
        let records = vec![record("naive", Some(1e9)), record("private", Some(2e9)), record("bvh", None)];
        let without = &plots(records.clone(), &[])[0];
        assert_eq!(without.svg.matches("operations per test").count(), 2);
        assert!(
            without.svg.contains(
                "15 operations per test; 36.0 B of the triangle from global memory, 24 B of the ray"
            )
        );
        for part in ["Not shown: 1 point.", "so the plot has no roofs. `raycl peak"] {
            assert!(without.caption.contains(part), "{}", without.caption);
        }
        let temporary = tempfile::tempdir().unwrap();
        let with = &plots(records, &[with_rates(temporary.path())])[0];
        for part in ["1000 GB/s, up to 4000 Gfma/s", "8000 GB/s", ">roof: __local memory<"] {
            assert!(with.svg.contains(part), "{part}: {}", with.svg);
        }
        assert!(!with.caption.contains("no roofs"), "{}", with.caption);
    }

    #[test]
    fn of_several_folders_with_rates_of_a_device_the_last_one_has_the_roofs() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = |name: &str, rate: f64| {
            let path = temporary.path().join(name);
            std::fs::create_dir(&path).unwrap();
            let rates = Peak { fma_per_s: Figure::of(&[rate]), ..peak() };
            Peak::write(&[rates], &path.join(crate::peak::FILE)).unwrap();
            Folder { path, ..Folder::default() }
        };
        let folders = [folder("first", 3e12), folder("last", 9e12)];
        let plot = &plots(vec![record("naive", Some(1e9))], &folders)[0];
        for (roof, is_there) in [("up to 9000 Gfma/s", true), ("up to 3000 Gfma/s", false)] {
            assert_eq!(plot.svg.contains(roof), is_there, "{roof}: {}", plot.svg);
        }
    }

    #[test]
    fn a_plot_without_lines_has_no_caption_about_lines() {
        let records = judged(vec![record("naive", Some(1e9))]);
        let groups = groups(&records);
        let points = [(&groups[0], &records[0])];
        let (looks, peak, name) = (Looks::of(&groups), Peak::default(), "roofline".to_owned());
        let plot = roofline(&points, &looks, "a gpu", (Some(&peak), &[]), name).unwrap();
        assert!(!plot.svg.contains("roof: "), "{}", plot.svg);
        assert!(!plot.caption.contains("Dashed lines"), "{}", plot.caption);
        assert!(!plot.caption.contains("were not measured"), "{}", plot.caption);
        assert!(plot.caption.contains("memories have a rate of 0"), "{}", plot.caption);
    }

    #[test]
    fn a_file_of_rates_that_cannot_be_read_is_named_in_the_caption() {
        let temporary = tempfile::tempdir().unwrap();
        std::fs::write(temporary.path().join(crate::peak::FILE), "no rates").unwrap();
        let records = vec![record("naive", Some(1e9))];
        let folder =
            Folder { path: temporary.path().to_owned(), records: records.clone(), ..Folder::default() };
        let caption = &plots(records.clone(), &[folder])[0].caption;
        let expected =
            format!("The plot has no roofs: {}/peak.json does not contain", temporary.path().display());
        assert!(caption.contains(&expected) && caption.contains("; delete the file; then"), "{caption}");
        assert!(!caption.contains("were not measured"), "{caption}");
        // The caption mentions an unreadable file only if the file's folder has records of the device.
        let other = Folder { path: temporary.path().to_owned(), ..Folder::default() };
        let caption = &plots(records, &[other])[0].caption;
        assert!(caption.contains("were not measured"), "{caption}");
    }

    #[test]
    fn coordinates_follow_from_the_record() {
        let records = judged(vec![record("naive", Some(1e9))]);
        let group = &groups(&records)[0];
        let actual = mark(group, &records[0]).unwrap();
        assert_eq!((actual.x, actual.y), (15.0 / 60.0, 15.0));
    }

    /// The process that writes a report may lack the kernel files that implement the strategy's values, so
    /// the record must state the numbers of operations and bytes.
    #[test]
    fn a_record_states_the_operations_and_bytes_of_its_test() {
        let private = record("private", Some(1e9));
        let own = Record {
            strategy: private.strategy.replace("intersector=moller-trumbore", "intersector=mine"),
            operations_per_test: Some(7),
            triangle_bytes_per_test: Some(14.0),
            triangle_memory: Some("__local".into()),
            ray_bytes_per_test: Some(0.0),
            ray_memory: Some("registers".into()),
            ..private
        };
        assert!(own.strategy.contains("intersector=mine"), "{}", own.strategy);
        let records = judged(vec![own]);
        let group = &groups(&records)[0];
        let actual = mark(group, &records[0]).unwrap();
        assert_eq!((actual.x, actual.y), (0.5, 7.0));
        let expected = "7 operations per test; 14.0 B of the triangle from __local memory";
        assert!(actual.tip.ends_with(expected), "{}", actual.tip);
    }

    /// The record was measured with a user's kernel file of a ray-triangle test, whose header has no
    /// `operations`. The built-in kernel file of the same name states `operations`.
    #[test]
    fn a_test_whose_header_states_no_operations_has_no_mark() {
        let own = Record {
            triangle_bytes_per_test: Some(36.0),
            triangle_memory: Some("global".into()),
            ray_bytes_per_test: Some(24.0),
            ray_memory: Some("global".into()),
            ..record("naive", Some(1e9))
        };
        let records = judged(vec![own.clone()]);
        assert!(mark(&groups(&records)[0], &records[0]).is_none());
        let others = [record("private", Some(2e9)), record("bvh", None)];
        let caption = &plots([vec![own.clone()], others.to_vec()].concat(), &[])[0].caption;
        for part in [
            "Not shown: 1 point. If rays walk a tree,",
            "Not shown: 1 point. The header of the ray-triangle test states no `operations`.",
        ] {
            assert!(caption.contains(part), "{caption}");
        }
        // If no point has a mark, the plot shows the measured roofs, and its caption states the reason.
        assert!(plots(vec![own.clone()], &[]).is_empty());
        let temporary = tempfile::tempdir().unwrap();
        let plot = &plots(vec![own], &[with_rates(temporary.path())])[0];
        assert!(plot.svg.contains(">roof: __local memory<"), "{}", plot.svg);
        assert!(plot.caption.ends_with("states no `operations`."), "{}", plot.caption);
    }

    #[test]
    fn without_counted_tests_there_is_no_plot() {
        assert!(plots(vec![record("bvh", None)], &[]).is_empty());
    }

    #[test]
    fn the_plot_reaches_beyond_all_marks_and_all_corners_of_roofs() {
        // The roofs have their corners at 0.5 and 4 operations per byte.
        assert_eq!(ends(&[], Some(&peak())), [0.25, 8.0]);
        let mark = Mark { x: 16.0, y: 1.0, interval: None, tip: String::new() };
        let one = Series { name: String::new(), look: Look::default(), joined: false, marks: vec![mark] };
        assert_eq!(ends(&[one], Some(&peak())), [0.25, 32.0]);
    }

    #[test]
    fn a_roof_rises_with_the_operations_per_byte_up_to_the_rate_of_multiply_adds() {
        let roofs = roofs(&peak(), [0.25, 16.0], &Looks::default());
        let corner = |mark: &Mark| [mark.x, mark.y.round()];
        let corners = |index: usize| roofs[index].marks.iter().map(corner).collect::<Vec<_>>();
        // All rates are per second, in units of 10^9. At 0.25 operations per byte, the memory's 1000 bytes
        // allow 250 operations. The peak rate of multiply-adds is 4000.
        assert_eq!(corners(0), [[0.25, 250.0], [4.0, 4000.0], [16.0, 4000.0]]);
        assert_eq!(corners(1), [[0.25, 2000.0], [0.5, 4000.0], [16.0, 4000.0]]);
    }
}
