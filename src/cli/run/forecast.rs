//! The output of `raycl run --dry-run`.

use crate::cli::{print, print_json, table};
use crate::device::common_names;
use crate::error::Result;
use crate::experiment::{Expected, Forecast};
use crate::printer;
use crate::strategy::Requirements;
use crate::words::counted;
use std::collections::HashSet;

/// Prints for every point whether it fits on its device, and how many bytes of `__local`, `__constant` and scratch
/// memory it needs. With `json`, also prints how many bytes of private and other global memory the point needs. Without
/// `json`, also prints notes on the points' scenes, `more_notes` and the expected duration of the run. With `json`,
/// standard output has only the points (with the notes on their scenes), so `more_notes` go to standard error.
pub fn forecast(points: &[Forecast], more_notes: &[String], expected: &Expected, json: bool) -> Result<()> {
    if json {
        more_notes.iter().for_each(|note| printer::tell(printer::plain(&format!("note: {note}"))));
        return points.iter().try_for_each(print_json);
    }
    let mut table = table(&["point", "device", "fits", "__local B", "__constant B", "scratch B"], 3);
    let names = common_names(points.iter().map(|point| point.device.as_str()));
    for point in points {
        table.add_row(cells(point, &names[point.device.as_str()]));
    }
    print(table)?;
    let mut notes = notes(points).into_iter().chain(more_notes.iter().map(String::as_str));
    notes.try_for_each(|note| print(format!("note: {note}")))?;
    print(format!("{}\n{expected}.", counts(points)))
}

/// Returns the notes on the points' scenes, without repetitions.
fn notes(points: &[Forecast]) -> Vec<&str> {
    let mut seen = HashSet::new();
    let all = points.iter().flat_map(|point| &point.scene_notes).map(String::as_str);
    all.filter(|note| seen.insert(*note)).collect()
}

/// Returns a point's row of the table; `device` is the name that the table shows for the point's device.
fn cells(point: &Forecast, device: &str) -> [String; 6] {
    let bytes = |of: fn(&Requirements) -> u64| {
        point.needs.as_ref().map_or(String::new(), |needs| of(needs).to_string())
    };
    let fits = if point.done { "yes, and is done" } else { "yes" };
    [
        point.label.clone(),
        device.to_owned(),
        point.not_for.clone().or(point.refused.clone()).unwrap_or_else(|| fits.to_owned()),
        bytes(|needs| needs.local_bytes),
        bytes(|needs| needs.constant_bytes),
        bytes(|needs| needs.scratch_bytes),
    ]
}

/// Returns a line with the number of all points, and the numbers of points that cannot be measured, are meant for
/// devices of another kind, or are done.
fn counts(points: &[Forecast]) -> String {
    let other_kind = points.iter().filter(|point| point.not_for.is_some()).count();
    let refused = points.iter().filter(|point| point.not_for.is_none() && point.refused.is_some()).count();
    let others = match other_kind {
        0 => String::new(),
        1 => " and 1 is meant for devices of another kind".to_owned(),
        count => format!(" and {count} are meant for devices of another kind"),
    };
    let done = match points.iter().filter(|point| point.done).count() {
        0 => String::new(),
        1 => "; 1 is done".to_owned(),
        count => format!("; {count} are done"),
    };
    format!(
        "{}, {refused} of which cannot be measured{others}{done}. Nothing was compiled or measured.",
        counted(points.len(), "point")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a point. `refused` is the reason why the point does not fit, and `not_for` the reason why it is not
    /// meant for its device.
    fn point(refused: Option<&str>, not_for: Option<&str>) -> Forecast {
        let needs = Requirements {
            local_bytes: 1,
            constant_bytes: 2,
            scratch_bytes: 3,
            private_bytes: 4,
            global_bytes: 5,
        };
        Forecast {
            label: "naive 8x8".to_owned(),
            device: "a device".to_owned(),
            needs: Some(needs),
            refused: refused.map(str::to_owned),
            not_for: not_for.map(str::to_owned),
            scene_notes: Vec::new(),
            done: false,
        }
    }

    #[test]
    fn a_row_has_the_bytes_of_each_kind_of_memory_and_the_reason_why_a_point_is_not_measured() {
        let cells_of = |point: &Forecast| cells(point, &point.device);
        assert_eq!(cells_of(&point(None, None)), ["naive 8x8", "a device", "yes", "1", "2", "3"]);
        assert_eq!(cells_of(&point(Some("too large"), None))[2], "too large");
        assert_eq!(cells_of(&point(Some("too large"), Some("for GPUs")))[2], "for GPUs");
        assert_eq!(cells_of(&Forecast { needs: None, ..point(None, None) })[3..], ["", "", ""]);
        let done = Forecast { done: true, ..point(None, None) };
        assert_eq!(cells_of(&done)[2], "yes, and is done");
    }

    #[test]
    fn a_note_on_the_scene_of_several_points_is_printed_once() {
        let noted = |words: &[&str]| {
            let scene_notes = words.iter().map(|note| (*note).to_owned()).collect();
            Forecast { scene_notes, ..point(None, None) }
        };
        let points = [noted(&["a", "b"]), noted(&["a", "b"]), noted(&["c"])];
        assert_eq!(notes(&points), ["a", "b", "c"]);
    }

    #[test]
    fn points_for_other_devices_are_not_counted_as_too_large() {
        let (fits, too_large) = (point(None, None), point(Some("too large"), None));
        let other = point(Some("too large"), Some("for GPUs"));
        let end = ". Nothing was compiled or measured.";
        assert_eq!(
            counts(std::slice::from_ref(&fits)),
            format!("1 point, 0 of which cannot be measured{end}")
        );
        let line = counts(&[fits.clone(), too_large.clone(), fits]);
        assert_eq!(line, format!("3 points, 1 of which cannot be measured{end}"));
        let line = counts(&[too_large.clone(), other.clone()]);
        let other_kind = "devices of another kind";
        assert_eq!(
            line,
            format!("2 points, 1 of which cannot be measured and 1 is meant for {other_kind}{end}")
        );
        let line = counts(&[other.clone(), other]);
        assert_eq!(
            line,
            format!("2 points, 0 of which cannot be measured and 2 are meant for {other_kind}{end}")
        );
    }

    #[test]
    fn points_that_need_not_be_measured_again_are_counted() {
        let (left, done) = (point(None, None), Forecast { done: true, ..point(None, None) });
        let end = ". Nothing was compiled or measured.";
        let line = counts(&[done.clone(), left.clone()]);
        assert_eq!(line, format!("2 points, 0 of which cannot be measured; 1 is done{end}"));
        let line = counts(&[done.clone(), left, done]);
        assert_eq!(line, format!("3 points, 0 of which cannot be measured; 2 are done{end}"));
    }
}
