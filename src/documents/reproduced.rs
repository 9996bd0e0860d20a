//! Formats the results of `raycl reproduce` for documents: the claims of the student paper that raycl
//! reproduces, with raycl's verdicts, and the answer to the paper's question in four lines (best memory
//! strategy, best local size, why, how sure).

use super::sheet::{Device, line};
use super::sources::Sources;
use crate::report::Reproduction;
use crate::words;
use serde_json::Value;

/// The possible verdicts on a claim. A document states how many claims have each verdict, in the order of
/// this list.
const VERDICTS: [&str; 4] = ["held", "did not hold", "unclear", "cannot be tested here"];

/// Returns the results of a reproduction as JSON, for the first device in the records of `device.folders`.
fn reproduction(sources: &Sources, device: &Device) -> Result<Value, String> {
    let folders: Result<Vec<_>, _> = device.folders.iter().map(|name| sources.folder(name)).collect();
    let json = Reproduction::of(&folders?).and_then(|page| page.json()).map_err(|error| error.to_string())?;
    let mut value: Value = serde_json::from_str(&json).map_err(|error| error.to_string())?;
    Ok(value["devices"][0].take())
}

/// Returns, for each device, the four lines that answer the paper's question.
pub fn answer(sources: &Sources, devices: &[Device]) -> Result<Vec<String>, String> {
    let mut lines = Vec::new();
    for device in devices {
        let answer = reproduction(sources, device)?["answer"].take();
        let said = |key: &str| code(answer[key].as_str().unwrap_or_default());
        lines.push(format!("| {} | |", device.head));
        lines.push("|---|---|".to_owned());
        for (head, key) in [
            ("best memory strategy", "memory_strategy"),
            ("best local size", "local_size"),
            ("why", "why"),
            ("how sure", "how_sure"),
        ] {
            lines.push(format!("| **{head}** | {} |", said(key)));
        }
        lines.push(String::new());
    }
    lines.pop();
    Ok(lines)
}

/// Returns the number of claims for each verdict, then a table with one row per claim. A row has the claim's
/// sentence, its place in the paper (such as a section or a figure) and, for each device, the verdict with one
/// comparison that decided the verdict.
pub fn claims(sources: &Sources, devices: &[Device]) -> Result<Vec<String>, String> {
    let reproductions: Vec<Value> =
        devices.iter().map(|device| reproduction(sources, device)).collect::<Result<_, _>>()?;
    let of = |device: &Value| device["claims"].as_array().cloned().unwrap_or_default();
    let all: Vec<Vec<Value>> = reproductions.iter().map(of).collect();
    let counts = devices.iter().zip(&all).map(|(device, claims)| counted(&device.head, claims));
    let mut lines: Vec<String> = counts.collect();
    lines.push(String::new());
    let heads =
        ["the paper says", "where"].into_iter().chain(devices.iter().map(|device| device.head.as_str()));
    lines.push(line(heads));
    lines.push(format!("|{}", "---|".repeat(2 + devices.len())));
    for (index, claim) in all.first().into_iter().flatten().enumerate() {
        let ours: Vec<String> = all.iter().map(|claims| decided(&claims[index])).collect();
        let own = ["sentence", "place"].map(|key| claim[key].as_str().unwrap_or_default());
        lines.push(line(own.into_iter().chain(ours.iter().map(String::as_str))));
    }
    Ok(lines)
}

/// Formats how many claims have each verdict: "- PoCL, 35 claims: 0 held, 13 did not hold, ...".
fn counted(head: &str, claims: &[Value]) -> String {
    let count = |verdict: &str| claims.iter().filter(|claim| claim["verdict"] == verdict).count();
    let counts = VERDICTS.map(|verdict| format!("{} {verdict}", count(verdict)));
    format!("- {head}, {} claims: {}.", claims.len(), counts.join(", "))
}

/// Returns a claim's verdict, the first comparison with that verdict, and the number of further comparisons with it. If
/// some comparisons hold and the remaining comparisons cannot be made, the claim is unclear although no single
/// comparison is unclear. If a claim is unclear only because comparisons cannot be made, returns the first comparison
/// that cannot be made.
fn decided(claim: &Value) -> String {
    let verdict = claim["verdict"].as_str().unwrap_or_default();
    let lines = claim["lines"].as_array().map_or(&[][..], Vec::as_slice);
    let mut deciding = lines.iter().filter(|line| line["verdict"] == verdict);
    let other = lines.iter().find(|line| line["verdict"] != VERDICTS[0]);
    let first = deciding.next().or(other).and_then(|line| line["text"].as_str()).unwrap_or_default();
    let more = match deciding.count() {
        0 => String::new(),
        more => format!(" (and {} with this verdict)", words::counted(more, "more comparison")),
    };
    format!("**{verdict}**: {}{more}", code(first))
}

/// Marks `__local` as code, since two underscores mean bold text in Markdown.
fn code(text: &str) -> String {
    text.replace("__local", "`__local`")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_claim_is_written_with_the_comparison_that_decides_it() {
        let decided_text = |verdict: &str, lines: &[(&str, &str)]| {
            let lines: Vec<Value> =
                lines.iter().map(|(text, verdict)| json!({ "text": text, "verdict": verdict })).collect();
            decided(&json!({ "verdict": verdict, "lines": lines }))
        };
        let [held, failed, unclear, open] =
            [("a", "held"), ("b", "did not hold"), ("c", "unclear"), ("d", "cannot be tested here")];
        assert_eq!(
            decided_text("held", &[held, held]),
            "**held**: a (and 1 more comparison with this verdict)"
        );
        assert_eq!(decided_text("did not hold", &[held, failed]), "**did not hold**: b");
        assert_eq!(decided_text("unclear", &[held, open, unclear]), "**unclear**: c");
        assert_eq!(decided_text("unclear", &[held, open]), "**unclear**: d");
    }
}
