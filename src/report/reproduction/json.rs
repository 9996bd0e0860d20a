//! Writes the answers of the page of `raycl reproduce`, and the claims with their verdicts, as JSON for programs.

use super::{Device, Reproduction};
use crate::error::{Error, Result};
use crate::report::claims::Claim;
use serde_json::{Value, json};
use std::collections::HashMap;

impl Reproduction {
    /// Returns each device's answer and claims as JSON text; `docs/format.md` documents every field.
    pub fn json(&self) -> Result<String> {
        let devices: Vec<Value> = self.devices.iter().map(|one| device(one, &self.drivers)).collect();
        let text = serde_json::to_string_pretty(&json!({ "devices": devices }));
        text.map(|text| text + "\n").map_err(|error| Error::fault(error.to_string()))
    }
}

/// Returns, for a device, the answer to the student paper's question, and the verdicts on the paper's claims.
/// `drivers` maps a device's common name to the name that the driver reports.
fn device(device: &Device, drivers: &HashMap<String, String>) -> Value {
    let answer = &device.answer;
    json!({
        "device": drivers.get(&device.name).unwrap_or(&device.name),
        "answer": {
            "memory_strategy": answer.strategy,
            "local_size": answer.size,
            "why": answer.why,
            "how_sure": answer.sure,
        },
        "claims": device.claims.iter().map(claim).collect::<Vec<_>>(),
    })
}

fn claim(claim: &Claim) -> Value {
    let line =
        |line: &crate::report::claims::Line| json!({ "text": line.text, "verdict": line.verdict.name() });
    json!({
        "sentence": claim.row.sentence,
        "place": claim.row.place,
        "reading": claim.row.reading,
        "verdict": claim.verdict.name(),
        "lines": claim.lines.iter().map(line).collect::<Vec<_>>(),
        "decides": claim.decides(),
    })
}
