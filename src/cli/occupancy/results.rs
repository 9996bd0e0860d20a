//! Prints predicted occupancy next to measured times, for the points of a run whose kernels have a known
//! number of registers.

use crate::device::occupancy::multiprocessor;
use crate::error::{Error, Result};
use crate::numbers::{by, ms};
use crate::printer;
use crate::program::CompiledKernel;
use crate::record::{Folder, Record, median, not_enough};
use crate::words::{path_word, quote};
use serde_json::json;
use std::path::Path;

/// Prints one row for each point of the run in `path`, with the point's predicted occupancy. With `as_json`,
/// prints one JSON object for each point. `path` is a folder of results or the records.jsonl in it. Three kinds of
/// points are left out: points with an unknown number of registers, points with an unknown occupancy, and points of
/// rasterisers, because the local size of a rasteriser's main kernel is not the point's local size. If
/// `compute_capability` is given, the occupancy is predicted for this capability. If no capability is given, raycl
/// prints the recorded occupancy, which was predicted for the device's own capability.
pub fn run(path: &Path, compute_capability: Option<&str>, as_json: bool) -> Result<()> {
    if let Some(name) = compute_capability {
        multiprocessor(name)?;
    }
    let folder = Folder::read(path)?;
    let points: Vec<(&Record, CompiledKernel)> = folder
        .records
        .iter()
        .filter_map(|record| Some((record, predicted(record, compute_capability)?)))
        .collect();
    print_notes(&folder.notes, as_json || points.is_empty())?;
    if points.is_empty() {
        return Err(nothing_known(&folder, path, compute_capability));
    }
    if as_json {
        return points
            .iter()
            .try_for_each(|(record, kernel)| super::super::print_json(&object(record, kernel)));
    }
    super::super::print(text(&points))
}

/// Prints the notes on a folder. If `apart` is true, standard output contains JSON or nothing instead of a
/// table, so the notes go to standard error.
fn print_notes(notes: &[String], apart: bool) -> Result<()> {
    notes.iter().map(|note| format!("note: {note}")).try_for_each(|note| match apart {
        true => {
            printer::tell(printer::plain(&note));
            Ok(())
        }
        false => super::super::print(note),
    })
}

/// Returns the error for a folder of results in which no point has a known occupancy.
fn nothing_known(folder: &Folder, path: &Path, compute_capability: Option<&str>) -> Error {
    let path = path.display();
    if folder.records.is_empty() {
        let help = format!(
            "`raycl repair {0}` removes damaged lines, and `raycl run CONFIG --out {0} --resume` measures the missing points",
            quote(&path_word(&folder.path))
        );
        return Error::run(format!("{path} has no record that can be read")).with_help(help);
    }
    Error::run(format!("{path} has no point whose occupancy is known"))
        .with_help(help(&folder.records, compute_capability))
}

/// Returns the advice for the user if no record has a prediction. If a record has the number of registers of
/// its kernel, only the compute capability is missing for a prediction.
fn help(records: &[Record], compute_capability: Option<&str>) -> String {
    let registers = |record: &Record| record.main_kernel_of_local_size()?.resources.registers;
    match records.iter().any(|record| registers(record).is_some()) {
        true => "a prediction needs the device's compute capability, which these records do not have; choose one: \
                 --compute-capability 9.0"
            .to_owned(),
        false => format!(
            "a prediction needs the kernel's number of registers, which only some compilers print; this \
             command predicts the occupancy for any number of registers, without records: raycl occupancy \
             --compute-capability {} --registers 32",
            compute_capability.unwrap_or("9.0")
        ),
    }
}

/// Returns the kernel that casts a point's primary rays, with its occupancy. The occupancy is predicted for the given
/// compute capability; if no capability is given, the recorded occupancy is returned. `None` if the kernel's number of
/// registers or its occupancy is unknown, or if its work-groups do not have the point's local size.
fn predicted(record: &Record, compute_capability: Option<&str>) -> Option<CompiledKernel> {
    let kernel = record.main_kernel_of_local_size()?.clone();
    let items = record.local_size?.iter().product();
    kernel.resources.registers?;
    let kernel = match compute_capability {
        Some(_) => kernel.predicted(compute_capability, items),
        None => kernel,
    };
    kernel.occupancy.is_some().then_some(kernel)
}

fn object(record: &Record, kernel: &CompiledKernel) -> serde_json::Value {
    json!({
        "scene": record.scene,
        "device": record.device,
        "image_size": record.image_size,
        "name": record.name,
        "local_size": record.local_size,
        "kernel": kernel.name,
        "registers": kernel.resources.registers,
        "local_bytes": kernel.group_local_bytes(),
        "groups": kernel.resident_groups,
        "occupancy": kernel.occupancy,
        "limited_by": kernel.occupancy_limited_by,
        "median_ms": median(record),
        "samples": record.samples_ms.len(),
    })
}

fn text(points: &[(&Record, CompiledKernel)]) -> String {
    let header =
        ["point", "local size", "registers", "__local B", "groups", "occupancy", "limited by", "median ms"];
    let mut table = super::super::table(&header, 1);
    for (record, kernel) in points {
        table.add_row([
            format!("{} {}, {}: {}", record.scene, by(record.image_size), record.device, record.name),
            record.local_size.map_or(String::new(), by),
            kernel.resources.registers.map_or(String::new(), |count| count.to_string()),
            kernel.group_local_bytes().to_string(),
            kernel.resident_groups.map_or(String::new(), |groups| groups.to_string()),
            kernel.occupancy.map_or(String::new(), |part| format!("{:.0}%", 100.0 * part)),
            kernel.occupancy_limited_by.clone().unwrap_or_default(),
            time(record),
        ]);
    }
    table.to_string()
}

/// Formats a time: "12.30", "12.30, not enough samples (n = 3)", or "-" for a point without a time.
fn time(record: &Record) -> String {
    let few = not_enough(record).map_or(String::new(), |why| format!(", {why}"));
    median(record).map_or("-".to_owned(), |time| ms(time) + &few)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::compiled::Resources;
    use crate::record::fixtures::measured;
    use crate::record::journals::RECORDS;
    use crate::record::{CurrentPlan, JsonLines};

    fn record(registers: Option<u32>) -> Record {
        let resources = Resources { registers, ..Resources::default() };
        let kernel = CompiledKernel { name: "cast_frame".into(), resources, ..CompiledKernel::default() };
        let kernel = kernel.predicted(Some("9.0"), 256);
        Record { local_size: Some([16, 16]), kernels: vec![kernel], ..Record::default() }
    }

    #[test]
    fn a_point_is_predicted_for_its_device_or_for_another() {
        let own = predicted(&record(Some(128)), None).expect("a prediction");
        let other = predicted(&record(Some(128)), Some("7.5")).expect("a prediction");
        assert_eq!((own.occupancy, other.occupancy), (Some(0.25), Some(0.5)));
        assert!(text(&[(&record(Some(128)), own)]).contains("25%"));
    }

    #[test]
    fn json_has_the_median_time_and_the_number_of_samples() {
        let point = object(&measured("gpu", "naive", 16, 10.0), &CompiledKernel::default());
        assert_eq!((point["median_ms"].as_f64(), point["samples"].as_u64()), (Some(10.0), Some(10)));
    }

    #[test]
    fn points_of_unknown_registers_are_left_out() {
        assert!(predicted(&record(None), Some("9.0")).is_none());
        assert!(predicted(&Record::default(), None).is_none());
    }

    #[test]
    fn what_is_missing_is_named() {
        let remedy_of = |registers, compute_capability: Option<&str>| {
            let folder = tempfile::tempdir().unwrap();
            let resources = Resources { registers, ..Resources::default() };
            let kernel = CompiledKernel { name: "cast_frame".into(), resources, ..CompiledKernel::default() };
            let record = Record { kernels: vec![kernel], ..measured("gpu", "naive", 16, 10.0) };
            JsonLines::append_to(&folder.path().join(RECORDS)).unwrap().append(&record).unwrap();
            run(folder.path(), compute_capability, false).unwrap_err().remedy().to_owned()
        };
        let unknown = remedy_of(None, Some("2.0"));
        assert!(unknown.ends_with("--compute-capability 2.0 --registers 32"), "{unknown}");
        assert!(!unknown.contains("choose one"), "{unknown}");
        assert!(!remedy_of(None, None).contains("choose one"));
        let without_capability = remedy_of(Some(32), None);
        assert!(without_capability.ends_with("choose one: --compute-capability 9.0"), "{without_capability}");
    }

    #[test]
    fn a_folder_whose_records_are_all_damaged_gets_no_advice_on_registers() {
        let folder = tempfile::tempdir().unwrap();
        CurrentPlan::of(&[measured("gpu", "naive", 16, 10.0)]).write(folder.path()).unwrap();
        std::fs::write(folder.path().join(RECORDS), "damaged\n").unwrap();
        let error = run(folder.path(), None, false).unwrap_err();
        assert!(error.to_string().ends_with(" has no record that can be read"), "{error}");
        let remedy = error.remedy();
        assert!(remedy.starts_with("`raycl repair ") && !remedy.contains("registers"), "{remedy}");
    }

    #[test]
    fn points_of_rasterisers_are_left_out() {
        let raster = Record { strategy: "traversal=raster".into(), ..record(Some(48)) };
        assert!([None, Some("9.0")].iter().all(|capability| predicted(&raster, *capability).is_none()));
    }

    /// Drivers other than NVIDIA's may report registers without a compute capability.
    #[test]
    fn points_of_unknown_occupancy_are_left_out() {
        let resources = Resources { registers: Some(32), ..Resources::default() };
        let kernel = CompiledKernel { name: "cast_frame".into(), resources, ..CompiledKernel::default() };
        let record = Record { local_size: Some([16, 16]), kernels: vec![kernel], ..Record::default() };
        assert!(predicted(&record, None).is_none());
        assert!(predicted(&record, Some("9.0")).is_some());
    }

    /// The build log also counts the `__local` memory of the functions that a kernel calls, so the build log's number
    /// takes precedence over the number that the driver reports.
    #[test]
    fn the_local_memory_is_that_of_the_build_log_or_of_the_driver() {
        let local_bytes = |shared_bytes: Option<u64>| {
            let resources = Resources { registers: Some(32), shared_bytes, ..Resources::default() };
            let kernel = CompiledKernel { local_bytes: Some(2048), resources, ..CompiledKernel::default() };
            object(&Record::default(), &kernel)["local_bytes"].as_u64()
        };
        assert_eq!([Some(3072), None].map(local_bytes), [Some(3072), Some(2048)]);
    }
}
