//! Exports records as cache files of the auto-tuner Kernel Tuner (B. van Werkhoven, 2019). From these files,
//! Kernel Tuner can simulate tuning without running a kernel. raycl writes one file per device, scene and image
//! size, with times in milliseconds.

use serde_json::{Map, Value, json};

use super::file_names::file_names;
use super::outcome::Outcome;
use super::parameters::{joined, parameters};
use super::summary::{Group, groups};
use super::types::{HOST, Record};

/// Returns the file name without extension, and the text, of each cache file. Baselines, which run on no
/// OpenCL device, are left out.
pub fn kernel_tuner_caches(records: &[Record]) -> Vec<(String, String)> {
    let groups = groups(records);
    let named = file_names(&groups).into_iter().zip(&groups);
    named.filter(|(_, group)| group.device != HOST).map(|(name, group)| (name, cache(group))).collect()
}

fn cache(group: &Group<'_>) -> String {
    let all: Vec<_> = group.records.iter().map(|record| (*record, parameters(record))).collect();
    let names = names(&all);
    let entries: Map<String, Value> =
        all.iter().map(|(record, given)| (joined(given, &names), entry(record, given.clone()))).collect();
    let head = json!({
        "device_name": group.device,
        "kernel_name": "raycl",
        "problem_size": group.image_size,
        "tune_params_keys": names,
        "tune_params": values(&all, &names),
        "objective": "time",
    });
    let text = |value: &Value| serde_json::to_string(value).unwrap_or_default();
    let members = head.as_object().into_iter().flatten();
    let lines: String =
        members.map(|(key, value)| format!("{}: {},\n", text(&json!(key)), text(value))).collect();
    let entries: Vec<_> =
        entries.iter().map(|(key, value)| format!("{}: {}", text(&json!(key)), text(value))).collect();
    // Kernel Tuner treats a file as complete only if it ends with these two closing braces.
    format!("{{\n{lines}\"cache\": {{\n{}}}\n}}", entries.join(",\n"))
}

/// Returns the names of all tuning parameters of the records. The parameters of the local size come first.
/// All parameters that do not belong to the local size follow in the order in which they first occur.
fn names(all: &[(&Record, Map<String, Value>)]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for name in all.iter().flat_map(|(_, parameters)| parameters.keys()) {
        if !names.contains(name) {
            names.push(name.clone());
        }
    }
    // The parameters of each record are sorted by name. The sort moves the parameters `block_size...` to the
    // front, as is usual in Kernel Tuner.
    names.sort_by_key(|name| !name.starts_with("block_size"));
    names
}

/// Returns the list of different values that each tuning parameter has.
fn values(all: &[(&Record, Map<String, Value>)], names: &[String]) -> Map<String, Value> {
    let of = |name: &String| {
        let mut values: Vec<Value> = Vec::new();
        for value in all.iter().filter_map(|(_, parameters)| parameters.get(name)) {
            if !values.contains(value) {
                values.push(value.clone());
            }
        }
        (name.clone(), Value::Array(values))
    };
    names.iter().map(of).collect()
}

fn entry(record: &Record, mut entry: Map<String, Value>) -> Value {
    let error = match record.outcome {
        Outcome::Measured => None,
        Outcome::Infeasible | Outcome::OtherKind => Some("InvalidConfig"),
        Outcome::BuildFailed => Some("CompilationFailedConfig"),
        Outcome::LaunchFailed | Outcome::WrongImage | Outcome::TimedOut | Outcome::Crashed => {
            Some("RuntimeFailedConfig")
        }
    };
    match error {
        None => {
            entry.insert("time".into(), json!(record.median_ms));
            entry.insert("times".into(), json!(record.samples_ms));
        }
        Some(error) => {
            entry.insert("time".into(), error.into());
            entry.insert("__error__".into(), error.into());
        }
    }
    let others = [
        ("compile_time", json!(record.build_ms.unwrap_or(0.0))),
        ("benchmark_time", json!(record.samples_total_ms())),
        ("verification_time", json!(0.0)),
        ("strategy_time", json!(0.0)),
        ("framework_time", json!(0.0)),
        ("timestamp", json!(record.timestamp.as_deref().unwrap_or_default())),
        ("name", json!(record.name)),
    ];
    entry.extend(others.map(|(key, value)| (key.to_owned(), value)));
    Value::Object(entry)
}

#[cfg(test)]
mod tests {
    use super::super::summary::tests::{infeasible, measured};
    use super::*;

    #[test]
    fn a_cache_has_a_key_a_point_and_ends_as_kernel_tuner_wants() {
        let named = |mut record: Record| {
            record.strategy = format!("vectors=local width=4 name={}", record.name);
            record
        };
        let records =
            [named(measured("gpu", "naive", 8, 2.0)), named(infeasible("gpu", "wide", 32, "too large"))];
        let caches = kernel_tuner_caches(&records);
        let [(name, text)] = caches.as_slice() else { panic!("{caches:?}") };
        assert_eq!(name, "teapot-800x500-gpu");
        assert!(text.ends_with("}\n}"), "{text}");
        let cache: Value = serde_json::from_str(text).expect("JSON");
        assert_eq!(
            cache["tune_params_keys"],
            json!(["block_size_x", "block_size_y", "name", "vectors", "width"])
        );
        assert_eq!(cache["cache"]["8,8,naive,local,4"]["time"], 2.0);
        assert_eq!(cache["cache"]["32,32,wide,local,4"]["__error__"], "InvalidConfig");
    }

    #[test]
    fn scenes_whose_names_make_the_same_file_name_have_files_of_their_own() {
        let of = |scene: &str| Record { scene: scene.to_owned(), ..measured("gpu", "naive", 8, 2.0) };
        let caches = kernel_tuner_caches(&["a/scene", "a-scene", "a scene"].map(of));
        let names: Vec<&str> = caches.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["a-scene-800x500-gpu", "a-scene-800x500-gpu_", "a-scene-800x500-gpu__"]);
    }

    #[test]
    fn points_of_two_kernel_folders_have_keys_of_their_own() {
        let of = |kernels: &str, median: f64| Record {
            kernels_of: Some(kernels.to_owned()),
            key: kernels.to_owned(),
            ..measured("gpu", "naive", 8, median)
        };
        let caches = kernel_tuner_caches(&[of("old", 2.0), of("new", 3.0)]);
        let [(_, text)] = caches.as_slice() else { panic!("{caches:?}") };
        let cache: Value = serde_json::from_str(text).expect("JSON");
        assert_eq!(
            (&cache["cache"]["8,8,old"]["time"], &cache["cache"]["8,8,new"]["time"]),
            (&json!(2.0), &json!(3.0))
        );
    }

    #[test]
    fn each_value_of_a_parameter_is_listed_once() {
        let of = |side: u32, vectors: &str| Record {
            key: format!("{vectors} {side}"),
            strategy: format!("vectors={vectors} width=4"),
            ..measured("gpu", "naive", side, 2.0)
        };
        let caches = kernel_tuner_caches(&[of(8, "local"), of(16, "local"), of(8, "private")]);
        let [(_, text)] = caches.as_slice() else { panic!("{caches:?}") };
        let cache: Value = serde_json::from_str(text).expect("JSON");
        assert_eq!(
            cache["tune_params"],
            json!({
                "block_size_x": [8, 16],
                "block_size_y": [8, 16],
                "vectors": ["local", "private"],
                "width": [4],
            })
        );
    }

    #[test]
    fn an_entry_has_its_times_or_the_kind_of_its_error() {
        let record = Record {
            timestamp: Some("2026-01-02T03:04:05Z".into()),
            build_ms: Some(12.5),
            samples_ms: vec![1.0, 2.0, 4.5],
            local_size: Some([16, 2]),
            ..measured("gpu", "naive", 8, 2.0)
        };
        let expected = json!({
            "block_size_x": 16, "block_size_y": 2, "time": 2.0, "times": [1.0, 2.0, 4.5], "compile_time": 12.5,
            "benchmark_time": 7.5, "verification_time": 0.0, "strategy_time": 0.0, "framework_time": 0.0,
            "timestamp": "2026-01-02T03:04:05Z", "name": "naive",
        });
        assert_eq!(entry(&record, parameters(&record)), expected);
        for (outcome, error) in [
            (Outcome::Infeasible, "InvalidConfig"),
            (Outcome::OtherKind, "InvalidConfig"),
            (Outcome::BuildFailed, "CompilationFailedConfig"),
            (Outcome::LaunchFailed, "RuntimeFailedConfig"),
            (Outcome::WrongImage, "RuntimeFailedConfig"),
            (Outcome::TimedOut, "RuntimeFailedConfig"),
            (Outcome::Crashed, "RuntimeFailedConfig"),
        ] {
            let exported = entry(&Record { outcome, ..record.clone() }, Map::new());
            assert_eq!([&exported["time"], &exported["__error__"]], [error, error], "{outcome:?}");
            assert_eq!(exported.get("times"), None, "{outcome:?}");
        }
        let exported = entry(&Record { samples_ms: Vec::new(), ..record }, Map::new());
        assert_eq!(exported["benchmark_time"].to_string(), "0.0", "and not -0.0");
    }

    #[test]
    fn a_cache_is_of_one_device_and_one_image_size_and_baselines_have_none() {
        let records = [
            measured("host", "serial-f32", 0, 420.0),
            measured("gpu", "naive", 8, 2.0),
            Record { image_size: [80, 50], ..measured("gpu", "naive", 8, 1.0) },
        ];
        let contents = |(name, text): &(String, String)| {
            let cache: Value = serde_json::from_str(text).expect("JSON");
            (name.clone(), cache["device_name"].clone(), cache["problem_size"].clone())
        };
        let actual: Vec<_> = kernel_tuner_caches(&records).iter().map(contents).collect();
        let of = |size: [u32; 2]| (format!("teapot-{}x{}-gpu", size[0], size[1]), json!("gpu"), json!(size));
        assert_eq!(actual, [of([800, 500]), of([80, 50])]);
    }
}
