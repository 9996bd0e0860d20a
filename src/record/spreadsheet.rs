//! Writes `summary.csv`, with one row per record. A field with two numbers, such as the local size, has one
//! column per number.

use serde::Serialize;

use super::point_times::{interval, launches};
use super::summary::quartiles;
use super::types::Record;
use crate::error::{Error, Result};

/// The columns of `summary.csv`, in order.
#[derive(Serialize)]
struct Row<'a> {
    key: &'a str,
    scene: &'a str,
    device: &'a str,
    name: &'a str,
    preset: Option<&'a str>,
    strategy: &'a str,
    local_size_x: Option<u32>,
    local_size_y: Option<u32>,
    image_width: u32,
    image_height: u32,
    triangles: Option<u64>,
    lights: Option<u64>,
    outcome: &'a str,
    reason: Option<&'a str>,
    median_ms: Option<f64>,
    q1_ms: Option<f64>,
    q3_ms: Option<f64>,
    ci95_low_ms: Option<f64>,
    ci95_high_ms: Option<f64>,
    samples: usize,
    launches: usize,
    stop_reason: Option<&'a str>,
    primary_ms: Option<f64>,
    shadow_ms: Option<f64>,
    shade_ms: Option<f64>,
    host_median_ms: Option<f64>,
    build_ms: Option<f64>,
    rays_per_s: Option<f64>,
    frame_rays_per_s: Option<f64>,
    primary_rays_per_s: Option<f64>,
    shadow_rays: Option<u64>,
    shadow_rays_per_s: Option<f64>,
    tests_per_s: Option<f64>,
    max_difference: Option<f64>,
    uncertain_pixels: Option<u64>,
    local_bytes: Option<u64>,
    constant_bytes: Option<u64>,
    scratch_bytes: Option<u64>,
    private_bytes: Option<u64>,
    batch: Option<u32>,
    threads: Option<u32>,
    limit_fraction: Option<f64>,
    registers: Option<u32>,
    spill_store_bytes: Option<u64>,
    occupancy: Option<f64>,
    clock_mhz: Option<f64>,
    energy_mj: Option<f64>,
    preempted_samples: Option<u32>,
    throttled_samples: Option<u32>,
    host: Option<&'a str>,
    block: Option<u32>,
}

impl<'a> Row<'a> {
    fn of(record: &'a Record) -> Self {
        Self {
            key: &record.key,
            scene: &record.scene,
            device: &record.device,
            name: &record.name,
            preset: record.preset.as_deref(),
            strategy: &record.strategy,
            local_size_x: record.local_size.map(|size| size[0]),
            local_size_y: record.local_size.map(|size| size[1]),
            image_width: record.image_size[0],
            image_height: record.image_size[1],
            triangles: record.triangles,
            lights: record.lights,
            outcome: record.outcome.name(),
            reason: record.reason.as_deref(),
            median_ms: record.median_ms,
            q1_ms: quartiles(record).map(|ends| ends[0]),
            q3_ms: quartiles(record).map(|ends| ends[1]),
            ci95_low_ms: interval(record).map(|ends| ends[0]),
            ci95_high_ms: interval(record).map(|ends| ends[1]),
            samples: record.samples_ms.len(),
            launches: launches(record),
            stop_reason: record.stop_reason.as_deref(),
            primary_ms: record.primary_ms,
            shadow_ms: record.shadow_ms,
            shade_ms: record.shade_ms,
            host_median_ms: record.host_median_ms,
            build_ms: record.build_ms,
            rays_per_s: record.rays_per_s,
            frame_rays_per_s: record.frame_rays_per_s(),
            primary_rays_per_s: record.primary_rays_per_s(),
            shadow_rays: record.shadow_rays,
            shadow_rays_per_s: record.shadow_rays_per_s,
            tests_per_s: record.tests_per_s,
            max_difference: record.max_difference,
            uncertain_pixels: record.uncertain_pixels,
            local_bytes: record.local_bytes,
            constant_bytes: record.constant_bytes,
            scratch_bytes: record.scratch_bytes,
            private_bytes: record.private_bytes,
            batch: record.batch,
            threads: record.threads,
            limit_fraction: record.limit_fraction,
            registers: record.main_kernel().and_then(|kernel| kernel.resources.registers),
            spill_store_bytes: record.main_kernel().and_then(|kernel| kernel.resources.spill_store_bytes),
            occupancy: record.main_kernel_of_local_size().and_then(|kernel| kernel.occupancy),
            clock_mhz: record.sensed.and_then(|sensed| sensed.clock_mhz),
            energy_mj: record.sensed.and_then(|sensed| sensed.energy_mj),
            preempted_samples: record.preempted_samples,
            throttled_samples: record.throttled_samples,
            host: record.host.as_deref(),
            block: record.block,
        }
    }
}

/// Returns the records as CSV with a header. Cells of null values are empty.
pub fn summary_csv(records: &[Record]) -> Result<Vec<u8>> {
    let fail = |error: String| Error::fault(format!("cannot write the CSV summary: {error}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    // The writer writes the header together with the first row. If `records` is empty, this function writes a
    // row with default values and then cuts this row off, so that only the header remains.
    let cut_off = records.is_empty().then(Record::default);
    for record in records.iter().chain(&cut_off) {
        writer.serialize(Row::of(record)).map_err(|error| fail(error.to_string()))?;
    }
    let mut bytes = writer.into_inner().map_err(|error| fail(error.to_string()))?;
    if cut_off.is_some() {
        let header = bytes.iter().position(|byte| *byte == b'\n').map_or(0, |end| end + 1);
        bytes.truncate(header);
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::super::summary::tests::{infeasible, judged, measured};
    use super::*;

    #[test]
    fn rows_have_a_header_and_quote_what_needs_it() {
        let wide =
            Record { local_size: Some([16, 2]), ..infeasible("pocl", "wide", 1, "too \"big\", really") };
        let records = judged([measured("pocl", "naive", 8, 100.0), wide]);
        let bytes = summary_csv(&records).unwrap();
        let mut reader = csv::Reader::from_reader(bytes.as_slice());
        let header = reader.headers().unwrap().clone();
        let rows: Vec<_> = reader.records().collect::<std::result::Result<_, _>>().unwrap();
        let cell = |row: usize, name: &str| &rows[row][header.iter().position(|head| head == name).unwrap()];
        assert_eq!(["q1_ms", "median_ms", "q3_ms"].map(|name| cell(0, name)), ["99.0", "100.0", "101.0"]);
        // In the columns of a local size or image size, the number across comes before the number down.
        assert_eq!(["local_size_x", "local_size_y"].map(|side| cell(1, side)), ["16", "2"]);
        assert_eq!(["image_width", "image_height"].map(|side| cell(1, side)), ["800", "500"]);
        assert_eq!(cell(1, "median_ms"), "");
        assert_eq!(cell(1, "reason"), "too \"big\", really");
    }

    /// Programs that read `summary.csv` expect a header, even if no point has been measured.
    #[test]
    fn without_records_there_is_only_the_header() {
        let header = summary_csv(&[]).unwrap();
        assert!(header.starts_with(b"key,scene,device,") && header.ends_with(b",block\n"), "{header:?}");
        assert!(summary_csv(&[Record::default()]).unwrap().starts_with(&header));
    }

    /// Returns a record whose numbers are all different.
    fn with_different_numbers() -> Record {
        let resources = crate::program::compiled::Resources {
            registers: Some(40),
            spill_store_bytes: Some(41),
            spill_load_bytes: Some(42),
            ..Default::default()
        };
        let kernel = crate::program::CompiledKernel {
            name: "cast_frame".into(),
            resources,
            occupancy: Some(0.43),
            ..Default::default()
        };
        let sensed = crate::sensor::SensorReading {
            clock_mhz: Some(44.0),
            memory_clock_mhz: Some(45.0),
            energy_mj: Some(46.0),
            power_w: Some(47.0),
            ..Default::default()
        };
        Record {
            triangles: Some(1),
            lights: Some(2),
            reason: Some("a reason".into()),
            stop_reason: Some("a rule".into()),
            preset: Some("a preset".into()),
            strategy: "a strategy".into(),
            primary_ms: Some(3.0),
            shadow_ms: Some(4.0),
            shade_ms: Some(5.0),
            host_median_ms: Some(6.0),
            build_ms: Some(7.0),
            rays_per_s: Some(8.0),
            shadow_rays: Some(9),
            shadow_rays_per_s: Some(10.0),
            tests_per_s: Some(11.0),
            max_difference: Some(12.0),
            uncertain_pixels: Some(13),
            unexplained_pixels: Some(14),
            local_bytes: Some(15),
            constant_bytes: Some(16),
            scratch_bytes: Some(17),
            private_bytes: Some(18),
            batch: Some(19),
            threads: Some(20),
            limit_fraction: Some(0.21),
            preempted_samples: Some(22),
            throttled_samples: Some(23),
            host: Some("a host".into()),
            block: Some(24),
            kernels: vec![kernel],
            sensed: Some(sensed),
            ..measured("a device", "naive", 8, 100.0)
        }
    }

    #[test]
    fn a_column_named_like_a_field_of_records_has_this_field() {
        let records = judged([with_different_numbers()]);
        let bytes = summary_csv(&records).unwrap();
        let mut reader = csv::Reader::from_reader(bytes.as_slice());
        let header = reader.headers().unwrap().clone();
        let row = reader.records().next().unwrap().unwrap();
        let fields = serde_json::to_value(&records[0]).unwrap();
        let as_text =
            |value: &serde_json::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let mut same = 0;
        for (name, cell) in header.iter().zip(row.iter()) {
            if let Some(field) = fields.get(name) {
                assert_eq!(cell, as_text(field), "{name}");
                same += 1;
            }
        }
        assert_eq!(same, 36, "of the fields");
        let cell = |name: &str| &row[header.iter().position(|head| head == name).unwrap()];
        let [low, high] = interval(&records[0]).unwrap();
        for (name, expected) in [
            ("ci95_low_ms", low.to_string()),
            ("ci95_high_ms", high.to_string()),
            ("samples", "10".into()),
            ("launches", "2".into()),
            // The frame of 400,000 primary and 9 shadow rays takes 100 ms, including 3 ms for the primary
            // pass.
            ("frame_rays_per_s", "4000090.0".into()),
            ("registers", "40".into()),
            ("spill_store_bytes", "41".into()),
            ("occupancy", "0.43".into()),
            ("clock_mhz", "44.0".into()),
            ("energy_mj", "46.0".into()),
        ] {
            assert_eq!(cell(name), expected, "{name}");
        }
        assert!((cell("primary_rays_per_s").parse::<f64>().unwrap() - 400_000.0 / 3e-3).abs() < 1.0);
    }
}
