//! The environment of a merged folder: the environment of the first attempt that has a valid one, and a list of
//! the machines of all such attempts.

use crate::error::Result;
use crate::existing;
use crate::record::journals::ENVIRONMENT;
use crate::record::write_json;
use crate::shard::Attempt;
use serde_json::{Value, json};
use std::path::Path;

/// Writes `environment.json`: the environment of the first attempt that has a valid `environment.json`, with a list of
/// the machines of all such attempts. Writes nothing if there is no such attempt.
pub fn write(out: &Path, attempts: &[Attempt]) -> Result<()> {
    let mut hosts: Vec<Value> = Vec::new();
    let mut first: Option<Value> = None;
    for attempt in attempts {
        let text = existing::bytes(&attempt.folder.join(ENVIRONMENT))?;
        let environment = text.and_then(|text| serde_json::from_slice::<Value>(&text).ok());
        let Some(environment) = environment else { continue };
        let host = attempt.about()?.map_or_else(|| attempt.name.clone(), |about| about.host);
        let devices: Vec<&Value> =
            environment["devices"].as_array().into_iter().flatten().map(|device| &device["device"]).collect();
        let machine = &environment["host"];
        let description = json!({
            "name": host, "cpu": machine["cpu"], "cores": machine["cores"], "os": machine["os"], "devices": devices,
            "git_revision": environment["git_revision"],
        });
        if !hosts.contains(&description) {
            hosts.push(description);
        }
        first.get_or_insert(environment);
    }
    let Some(mut environment) = first else { return Ok(()) };
    environment["hosts"] = Value::Array(hosts);
    write_json(&out.join(ENVIRONMENT), &environment)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::shard::About;

    #[test]
    fn the_first_environment_stays_and_every_machine_is_listed_once() {
        let folder = tempfile::tempdir().unwrap();
        for (shard, host, started) in [(1, "n2", "early"), (2, "n1", "late"), (3, "n2", "later")] {
            let about = About { shard, of: 4, host: host.into(), job: "0".into(), ..About::default() };
            let attempt = Attempt::begin(folder.path(), &about).unwrap();
            let environment = json!({
                "started": started, "host": { "cpu": "a cpu", "cores": 4, "os": "an os" },
                "devices": [{ "device": "a gpu" }], "git_revision": "r",
            });
            std::fs::write(attempt.folder.join("environment.json"), environment.to_string()).unwrap();
        }
        // The attempt at shard 4 was killed before it wrote its environment.
        Attempt::begin(folder.path(), &About { shard: 4, of: 4, ..About::default() }).unwrap();
        write(folder.path(), &Attempt::all(folder.path()).unwrap()).unwrap();
        let text = std::fs::read(folder.path().join("environment.json")).unwrap();
        assert!(text.ends_with(b"}\n"), "the last line has an end");
        let merged: Value = serde_json::from_slice(&text).unwrap();
        assert_eq!(merged["started"], "early");
        let host = |name: &str| {
            json!({
                "name": name, "cpu": "a cpu", "cores": 4, "os": "an os", "devices": ["a gpu"], "git_revision": "r",
            })
        };
        assert_eq!(merged["hosts"], json!([host("n2"), host("n1")]));
    }
}
