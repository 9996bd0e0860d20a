//! Formats texts about records, and assigns colours to strategies, for several pages and plots.

use super::plot::look::Look;
use super::view::PAPER_SIZE;
use crate::numbers::{by, duration, duration_range, ms, significant};
pub(crate) use crate::record::first_line;
use crate::record::{Group, HOST, Record, interval, median, not_enough, percent, to_mind};

/// Assigns a colour and a marker to each series name, so that a strategy looks the same in all plots.
#[derive(Clone, Debug, Default)]
pub struct Looks(Vec<String>);

impl Looks {
    /// Assigns colours and markers to the strategies in the order of the groups, and last to the baselines.
    pub fn of(groups: &[Group<'_>]) -> Self {
        let mut names: Vec<String> = Vec::new();
        let (baselines, kernels): (Vec<_>, Vec<_>) = groups.iter().partition(|group| group.device == HOST);
        for record in kernels.iter().chain(&baselines).flat_map(|group| &group.records) {
            let name = series_name(record);
            if !names.contains(&name) {
                names.push(name);
            }
        }
        Self(names)
    }

    /// Returns the colour and marker of the series with the given name. All unknown names get the same colour
    /// and marker.
    pub fn look(&self, name: &str) -> Look {
        Look::of(self.0.iter().position(|known| known == name).unwrap_or(self.0.len()))
    }
}

/// Returns a record's name in a legend. For a baseline, the name is the kind of baseline followed by " (host)",
/// such as "serial-f32 (host)".
pub fn series_name(record: &Record) -> String {
    if record.is_baseline() { format!("{} (host)", record.strategy) } else { record.name.clone() }
}

/// Returns a record's local size, such as "16x16", or "-" if the record has no local size.
pub fn size_name(record: &Record) -> String {
    record.local_size.map_or("-".to_owned(), |[across, down]| format!("{across}x{down}"))
}

/// Returns a record's title, such as "naive at 16 x 16". For a record without a local size, the title is
/// [`series_name`].
pub fn title(record: &Record) -> String {
    match record.local_size {
        Some(size) => format!("{} at {}", record.name, by(size)),
        None => series_name(record),
    }
}

/// Returns an image size as text, such as "200 x 125", or `None` if the size is [`PAPER_SIZE`]. On the page
/// about the student paper that raycl reproduces, texts name an image size only if it differs from the size of the
/// paper's figures.
pub fn other_size(image_size: [u32; 2]) -> Option<String> {
    (image_size != PAPER_SIZE).then(|| by(image_size))
}

/// Appends the image size to a text that ends with a scene's name, such as "on teapot at 200 x 125". Returns
/// the text unchanged if the image size is the size of the paper's figures.
pub fn at_size(text: &str, image_size: [u32; 2]) -> String {
    other_size(image_size).map_or(text.to_owned(), |size| format!("{text} at {size}"))
}

/// Returns a group's title, such as "teapot, 800 x 500, NVIDIA H200".
pub fn group_title(group: &Group<'_>) -> String {
    format!("{}, {}, {}", group.scene, by(group.image_size), group.device)
}

/// Returns the tooltip of a record. The tooltip states the strategy and the local size. Next come the median
/// with its interval and the number of samples, or the reason why the record has no time. Further lines state
/// the host, the properties of the compiled kernel, the fraction of the peak rate, and warnings, as far as
/// the record has them.
pub fn tip(record: &Record) -> String {
    let mut lines = vec![title(record)];
    match median(record) {
        Some(time) => {
            lines.push(format!("median {}", duration(time)));
            lines.extend(sureness(record));
            lines.push(format!("n = {}{}", record.samples_ms.len(), stopped(record)));
        }
        None => lines.push(format!("{}: {}", record.outcome.name(), first_line(record))),
    }
    lines.extend(record.host.as_ref().map(|host| format!("measured on {host}")));
    lines.extend(made(record));
    lines.extend(
        record
            .limit_fraction
            .map(|part| format!("{} of the device's peak rate of multiply-adds", percent(part))),
    );
    lines.extend(to_mind(record));
    lines.join("\n")
}

/// Returns the known properties of a record's main kernel (the kernel that casts primary rays), such as "168
/// registers, 12 B spilled, occupancy 19%". Returns `None` if no property is known.
pub fn made(record: &Record) -> Option<String> {
    let kernel = record.main_kernel()?;
    let registers = kernel.resources.registers.map(|count| format!("{count} registers"));
    let spilled = kernel.resources.spill_store_bytes.filter(|bytes| *bytes > 0);
    let predicted = record.main_kernel_of_local_size().and_then(|kernel| kernel.occupancy);
    let occupancy = predicted.map(|part| format!("occupancy {}", percent(part)));
    let spilled = spilled.map(|bytes| format!("{bytes} B spilled"));
    let parts: Vec<String> = registers.into_iter().chain(spilled).chain(occupancy).collect();
    (!parts.is_empty()).then(|| parts.join(", "))
}

/// Returns, in brackets, the reason why the sampling of a point stopped. Returns an empty text if the reason was not
/// recorded.
fn stopped(record: &Record) -> String {
    record.stop_reason.as_ref().map_or(String::new(), |reason| format!(" ({reason})"))
}

/// Returns a text such as "95% interval 1.2 to 1.4 ms". If the record has no interval, returns a note on the
/// reason: too few samples, or times of 0. Returns `None` if the record has no time.
fn sureness(record: &Record) -> Option<String> {
    let known = || Some(format!("95% interval {}", duration_range(interval(record)?, median(record)?)));
    not_enough(record).or_else(known)
}

/// Formats an interval in milliseconds, such as "1.2 to 1.4".
pub fn interval_text([low, high]: [f64; 2]) -> String {
    format!("{} to {}", ms(low), ms(high))
}

/// Returns the ratio `slow / fast` as text, such as "4.35×".
pub fn times(slow: f64, fast: f64) -> String {
    format!("{}×", significant(slow / fast, 3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::CompiledKernel;
    use crate::record::fixtures::measured;
    use crate::record::groups;

    #[test]
    fn each_strategy_has_one_look_in_the_order_of_the_records_with_baselines_last() {
        let records = [
            measured("host", "serial-f32", 0, 100.0),
            measured("gpu", "naive", 8, 3.0),
            measured("gpu", "naive", 16, 2.0),
            measured("gpu", "wide", 8, 1.0),
        ];
        let looks = Looks::of(&groups(&records));
        let numbers = ["naive", "wide", "serial-f32 (host)", "unknown"].map(|name| looks.look(name).number);
        assert_eq!(numbers, [0, 1, 2, 3]);
    }

    #[test]
    fn a_tooltip_has_what_is_known_of_the_kernel() {
        let kernel = |registers, spill_store_bytes, occupancy| {
            let name = "cast_frame".to_owned();
            let mut kernel = CompiledKernel { name, occupancy, ..CompiledKernel::default() };
            (kernel.resources.registers, kernel.resources.spill_store_bytes) = (registers, spill_store_bytes);
            kernel
        };
        let with = |kernel| Record { kernels: vec![kernel], ..measured("gpu", "naive", 8, 3.0) };
        let known = with(kernel(Some(168), Some(12), Some(0.1875)));
        assert!(tip(&known).contains("\n168 registers, 12 B spilled, occupancy 19%"), "{}", tip(&known));
        assert_eq!(made(&with(kernel(Some(20), Some(0), None))).as_deref(), Some("20 registers"));
        assert_eq!(made(&with(kernel(None, None, None))), None);
    }
}
