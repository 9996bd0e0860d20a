//! The output of `raycl run --dry-run`.

use crate::cli::{print, print_json, table};
use crate::error::Result;
use crate::experiment::{Expected, Forecast};
use crate::strategy::Requirements;

/// Prints every point, its memory needs in bytes and whether it fits. Without `json`, also prints the expected
/// duration of the run.
pub fn forecast(points: &[Forecast], expected: &Expected, json: bool) -> Result<()> {
    if json {
        return points.iter().try_for_each(print_json);
    }
    let mut table = table(&["point", "device", "fits", "__local B", "__constant B", "scratch B"], 3);
    for point in points {
        let bytes = |of: fn(&Requirements) -> u64| {
            point.needs.as_ref().map_or(String::new(), |needs| of(needs).to_string())
        };
        let cells = [
            point.label.clone(),
            point.device.clone(),
            point.not_for.clone().or(point.refused.clone()).unwrap_or_else(|| "yes".to_owned()),
            bytes(|needs| needs.local_bytes),
            bytes(|needs| needs.constant_bytes),
            bytes(|needs| needs.scratch_bytes),
        ];
        table.add_row(cells);
    }
    print(table)?;
    let mut notes: Vec<&String> = points.iter().flat_map(|point| &point.scene_notes).collect();
    notes.dedup();
    notes.into_iter().try_for_each(|note| print(format!("note: {note}")))?;
    let other_kind = points.iter().filter(|point| point.not_for.is_some()).count();
    let refused = points.iter().filter(|point| point.not_for.is_none() && point.refused.is_some()).count();
    let others = match other_kind {
        0 => String::new(),
        1 => " and 1 is meant for devices of another kind".to_owned(),
        count => format!(" and {count} are meant for devices of another kind"),
    };
    print(format!(
        "{} points, {refused} of which do not fit{others}. Nothing was compiled or measured.\n{expected}.",
        points.len()
    ))
}
