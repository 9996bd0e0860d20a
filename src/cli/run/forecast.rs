//! What `raycl run --dry-run` prints.

use crate::cli::{print, print_json, table};
use crate::error::Result;
use crate::experiment::{Expected, Forecast};
use crate::strategy::Requirements;

/// Prints every point, what it needs and whether it fits; and how long they will take.
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
            point.refused.clone().unwrap_or_else(|| "yes".to_owned()),
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
    let refused = points.iter().filter(|point| point.refused.is_some()).count();
    print(format!(
        "{} points, {refused} of which do not fit. Nothing was compiled or measured.\n{expected}.",
        points.len()
    ))
}
