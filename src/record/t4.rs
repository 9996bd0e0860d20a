//! Exports records as T4 results 1.0.0, an exchange format of auto-tuners
//! (<https://github.com/odgaard/TuningSchema>, branch T4, `results-schema.json`).

use serde_json::{Value, json};

use super::outcome::Outcome;
use super::parameters::parameters;
use super::types::Record;

/// Returns all records as one T4 document. Baselines are left out, since they have no tuning parameters.
pub fn t4_results(records: &[Record]) -> String {
    let results: Vec<_> = records.iter().filter(|record| !record.is_baseline()).map(result).collect();
    let document = json!({
        "schema_version": "1.0.0",
        "metadata": {"timeunit": "milliseconds", "producer": concat!("raycl ", env!("CARGO_PKG_VERSION"))},
        "results": results,
    });
    // Strings, numbers and lists can always be serialised.
    serde_json::to_string_pretty(&document).unwrap_or_default()
}

fn result(record: &Record) -> Value {
    let mut configuration = parameters(record);
    configuration.insert("scene".into(), record.scene.as_str().into());
    configuration.insert("device".into(), record.device.as_str().into());
    configuration.insert("image_width".into(), record.image_size[0].into());
    configuration.insert("image_height".into(), record.image_size[1].into());
    configuration.insert("name".into(), record.name.as_str().into());
    let build_ms = record.build_ms.unwrap_or(0.0);
    json!({
        "timestamp": record.timestamp.as_deref().unwrap_or_default(),
        "configuration": configuration,
        "times": {
            "compilation": build_ms,
            "compilation_time": build_ms,
            "benchmark": record.samples_total_ms(),
            "framework": 0.0,
            "search_algorithm": 0.0,
            "validation": 0.0,
            "runtimes": record.samples_ms,
        },
        "invalidity": invalidity(record.outcome),
        "correctness": if record.outcome == Outcome::Measured { 1 } else { 0 },
        "objectives": ["time"],
        "measurements": measurements(record),
    })
}

fn invalidity(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Measured => "correct",
        Outcome::Infeasible | Outcome::OtherKind => "constraints",
        Outcome::BuildFailed => "compile",
        Outcome::LaunchFailed | Outcome::Crashed => "runtime",
        Outcome::WrongImage => "correctness",
        Outcome::TimedOut => "timeout",
    }
}

fn measurements(record: &Record) -> Vec<Value> {
    let numbers = [
        ("time", record.median_ms, "ms"),
        ("frame_rays", record.frame_rays_per_s(), "1/s"),
        ("primary_rays", record.primary_rays_per_s(), "1/s"),
        ("triangle_tests", record.tests_per_s, "1/s"),
        ("max_relative_difference", record.max_difference, ""),
    ];
    let given = numbers.into_iter().filter_map(|(name, value, unit)| value.map(|value| (name, value, unit)));
    let mut all: Vec<_> =
        given.map(|(name, value, unit)| json!({"name": name, "value": value, "unit": unit})).collect();
    if let Some(reason) = &record.reason {
        all.push(json!({"name": "skip_reason", "value": reason, "unit": ""}));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::super::summary::tests::{infeasible, measured};
    use super::*;

    #[test]
    fn outcomes_become_the_schemas_words() {
        let records = [
            measured("host", "serial-f32", 0, 1.5),
            measured("gpu", "naive", 8, 2.0),
            infeasible("gpu", "local-vectors", 32, "__local: 110592 B > 49152 B"),
        ];
        let document: Value = serde_json::from_str(&t4_results(&records)).expect("JSON");
        let results = document["results"].as_array().expect("a list");
        assert_eq!(results.len(), 2);
        assert_eq!(results[0]["measurements"][0]["value"], 2.0);
        assert_eq!(results[1]["invalidity"], "constraints");
        assert_eq!(results[1]["configuration"]["block_size_x"], 32);
    }

    #[test]
    fn rays_of_a_frame_are_not_those_of_its_primary_pass() {
        // The frame takes 10 ms, of which its 400,000 primary rays take 5 ms. The frame has half as many
        // shadow rays as primary rays.
        let (primary_ms, shadow_rays) = (Some(5.0), Some(200_000));
        let wide = measured("gpu", "wide", 1, 10.0);
        let record = Record { primary_ms, shadow_rays, rays_per_s: Some(8e7), ..wide };
        let document: Value = serde_json::from_str(&t4_results(&[record])).expect("JSON");
        let all = document["results"][0]["measurements"].as_array().expect("a list");
        let value =
            |name: &str| all.iter().find(|one| one["name"] == name).and_then(|one| one["value"].as_f64());
        assert_eq!((value("frame_rays"), value("primary_rays")), (Some(6e7), Some(8e7)));
    }

    #[test]
    fn a_point_without_a_time_has_its_reason_and_a_measured_one_none() {
        let reasons = |record: Record| -> Vec<Value> {
            let all = measurements(&record).into_iter();
            all.filter(|one| one["name"] == "skip_reason").map(|one| one["value"].clone()).collect()
        };
        assert_eq!(reasons(infeasible("gpu", "naive", 32, "too large")), ["too large"]);
        let exported = result(&infeasible("gpu", "naive", 32, "too large"));
        assert_eq!(exported["times"]["benchmark"].to_string(), "0.0", "and not -0.0");
        assert!(reasons(measured("gpu", "naive", 8, 2.0)).is_empty());
    }

    #[test]
    fn a_point_has_its_configuration_and_its_times() {
        let record = Record {
            timestamp: Some("2026-01-02T03:04:05Z".into()),
            build_ms: Some(12.5),
            local_size: Some([16, 2]),
            max_difference: Some(1e-4),
            strategy: "vectors=local width=4".into(),
            ..measured("gpu", "naive", 8, 2.0)
        };
        let exported = result(&record);
        assert_eq!(exported["timestamp"], "2026-01-02T03:04:05Z");
        let configuration = json!({
            "block_size_x": 16, "block_size_y": 2, "vectors": "local", "width": 4, "scene": "teapot", "device": "gpu",
            "image_width": 800, "image_height": 500, "name": "naive",
        });
        assert_eq!(exported["configuration"], configuration);
        let times = &exported["times"];
        // The point has ten samples of 2 ms each.
        assert_eq!(
            [&times["compilation"], &times["compilation_time"], &times["benchmark"]],
            [12.5, 12.5, 20.0]
        );
        assert_eq!(times["runtimes"], json!(vec![2.0; 10]));
        let named = |name: &str| {
            let all = exported["measurements"].as_array().expect("a list");
            all.iter().find(|one| one["name"] == name).map(|one| (one["value"].clone(), one["unit"].clone()))
        };
        assert_eq!(named("time"), Some((json!(2.0), json!("ms"))));
        assert_eq!(named("triangle_tests"), Some((json!(2e11), json!("1/s"))));
        assert_eq!(named("max_relative_difference"), Some((json!(1e-4), json!(""))));
    }

    #[test]
    fn each_outcome_has_its_word_and_only_a_measured_point_is_correct() {
        for (outcome, word, correct) in [
            (Outcome::Measured, "correct", 1),
            (Outcome::Infeasible, "constraints", 0),
            (Outcome::OtherKind, "constraints", 0),
            (Outcome::BuildFailed, "compile", 0),
            (Outcome::LaunchFailed, "runtime", 0),
            (Outcome::Crashed, "runtime", 0),
            (Outcome::WrongImage, "correctness", 0),
            (Outcome::TimedOut, "timeout", 0),
        ] {
            let exported = result(&Record { outcome, ..measured("gpu", "naive", 8, 2.0) });
            assert_eq!((&exported["invalidity"], &exported["correctness"]), (&json!(word), &json!(correct)));
        }
    }
}
