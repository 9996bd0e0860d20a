//! Two folders of results, point by point: faster, slower, same or unclear.

use super::folder::{Folder, merged};
use super::page::{SCRIPT, STYLE, nonce};
use super::plot::Plot;
use super::plot::chart::{Across, Chart, Mark, Series};
use super::plot::palette::Look;
use super::plot::scale::Kind;
use super::words::{size_name, tip, title};
use crate::error::{Error, Result};
use crate::measure::{Summary, Verdict, compare};
use crate::record::{HOST, Outcome, Record, by, interval, median, ms, significant};
use askama::Template;
use serde::Serialize;
use std::collections::HashMap;
use std::fmt::Write as _;

/// A point that both folders measured.
#[derive(Clone, Debug)]
pub struct Pair {
    /// Its record in the first folder.
    pub before: Record,
    /// Its record in the second.
    pub after: Record,
    /// How the second stands to the first.
    pub verdict: Verdict,
    /// The second's time as a percentage of the first's, less 100: positive is slower.
    pub change_percent: f64,
}

/// A pair as `--json` prints it.
#[derive(Debug, Serialize)]
pub struct PairLine<'a> {
    scene: &'a str,
    image_size: [u32; 2],
    device: [&'a str; 2],
    name: &'a str,
    local_size: Option<[u32; 2]>,
    median_ms: [Option<f64>; 2],
    change_percent: f64,
    verdict: &'static str,
}

/// What comparing two folders found.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// What the folders are called.
    pub labels: [String; 2],
    /// The points that both measured, in the first's order.
    pub pairs: Vec<Pair>,
    /// Points that only one measured, or that another outcome replaced: what happened, in a line.
    pub others: Vec<String>,
    /// Changes of less than this part are the same.
    pub threshold: f64,
}

impl Comparison {
    /// Compares two folders. `threshold` is a part: 0.02 is 2%.
    ///
    /// Points correspond where scene, image size, strategy and local size are equal. Devices correspond by name, or,
    /// where each folder has but one, to each other: another machine's results can be compared.
    pub fn of(before: &Folder, after: &Folder, threshold: f64) -> Self {
        let one_each = devices(before).len() == 1 && devices(after).len() == 1;
        let point = |record: &Record| {
            let device = if one_each && !record.is_baseline() { "the device" } else { &record.device };
            (
                record.scene.clone(),
                record.image_size,
                device.to_owned(),
                record.name.clone(),
                record.local_size,
            )
        };
        let after_records = merged(std::slice::from_ref(after));
        let mut found: HashMap<_, _> = after_records.iter().map(|record| (point(record), record)).collect();
        let mut comparison =
            Self { labels: labels(before, after), pairs: Vec::new(), others: Vec::new(), threshold };
        for record in merged(std::slice::from_ref(before)) {
            match found.remove(&point(&record)) {
                Some(other) => comparison.add(record, other),
                None => {
                    comparison.others.push(format!("{}: only in {}", name(&record), comparison.labels[0]))
                }
            }
        }
        let left = after_records.iter().filter(|record| found.contains_key(&point(record)));
        let only: Vec<_> =
            left.map(|record| format!("{}: only in {}", name(record), comparison.labels[1])).collect();
        comparison.others.extend(only);
        comparison
    }

    fn add(&mut self, before: Record, after: &Record) {
        let summaries =
            [&before, after].map(|record| median(record).and_then(|_| Summary::of(&record.samples_ms)));
        if let [Some(a), Some(b)] = summaries {
            let verdict = compare(&a, &b, self.threshold);
            let change_percent = 100.0 * (b.median_ms / a.median_ms - 1.0);
            self.pairs.push(Pair { before, after: after.clone(), verdict, change_percent });
        } else if before.outcome != after.outcome {
            let [a, b] = [before.outcome, after.outcome].map(Outcome::name);
            self.others.push(format!("{}: was {a}, is {b}", name(&before)));
        }
    }

    /// How many points have this verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.pairs.iter().filter(|pair| pair.verdict == verdict).count()
    }

    /// The points that are surely slower by more than `percent`, and those that ran before and fail now.
    pub fn regressions(&self, percent: f64) -> Vec<String> {
        let slower =
            self.pairs.iter().filter(|pair| pair.verdict == Verdict::Slower && pair.change_percent > percent);
        let slower =
            slower.map(|pair| format!("{} is {:.1}% slower", name(&pair.before), pair.change_percent));
        let broken = self.others.iter().filter(|line| line.contains(": was measured, is ")).cloned();
        slower.chain(broken).collect()
    }

    /// "12 faster, 3 slower, 40 same, 5 unclear".
    pub fn summary(&self) -> String {
        let all = [Verdict::Faster, Verdict::Slower, Verdict::Same, Verdict::Unclear];
        all.map(|verdict| format!("{} {}", self.count(verdict), verdict.name())).join(", ")
    }

    /// The pairs as JSON lines would have them.
    pub fn lines(&self) -> Vec<PairLine<'_>> {
        self.pairs.iter().map(line).collect()
    }

    /// The comparison as Markdown.
    pub fn markdown(&self) -> String {
        let [a, b] = &self.labels;
        let mut text = format!("# {b} against {a}\n\n{}.\n\n", self.summary());
        let _ = writeln!(text, "| point | {a}, ms | {b}, ms | change | verdict |\n|---|--:|--:|--:|---|");
        for row in self.rows() {
            let cells = row.cells();
            // A bar would end the cell.
            let cells = cells.map(|cell| cell.replace('|', "\\|"));
            let _ = writeln!(text, "| {} |", cells.join(" | "));
        }
        if !self.others.is_empty() {
            text.push_str("\nNot compared:\n\n");
            self.others.iter().for_each(|line| {
                let _ = writeln!(text, "- {line}");
            });
        }
        let _ = writeln!(
            text,
            "\nSame: medians within {}%. Faster and slower: farther apart than that, and the intervals from the least sample to \
             the third quartile do not touch; else unclear.",
            100.0 * self.threshold
        );
        text
    }

    /// The largest changes first.
    fn rows(&self) -> Vec<Row> {
        let mut pairs: Vec<_> = self.pairs.iter().collect();
        pairs.sort_by(|a, b| b.change_percent.abs().total_cmp(&a.change_percent.abs()));
        let row = |pair: &&Pair| Row {
            point: name(&pair.before),
            before: median(&pair.before).map_or("-".into(), ms),
            after: median(&pair.after).map_or("-".into(), ms),
            change: format!("{:+.1}%", pair.change_percent),
            verdict: pair.verdict.name(),
        };
        pairs.iter().map(row).collect()
    }

    /// The second folder's times against the first's.
    pub fn plot(&self) -> Plot {
        let [a, b] = &self.labels;
        let verdicts = [Verdict::Faster, Verdict::Slower, Verdict::Same, Verdict::Unclear];
        let series = verdicts.into_iter().enumerate().filter_map(|(place, verdict)| {
            let pairs: Vec<_> = self.pairs.iter().filter(|pair| pair.verdict == verdict).collect();
            let marks = pairs.iter().filter_map(|pair| {
                let tip = format!(
                    "{}\n{} ({:+.1}%)\n{a}: {}\n{b}: {}",
                    name(&pair.before),
                    verdict.name(),
                    pair.change_percent,
                    tip(&pair.before),
                    tip(&pair.after)
                );
                Some(Mark {
                    x: median(&pair.before)?,
                    y: median(&pair.after)?,
                    interval: interval(&pair.after),
                    tip,
                })
            });
            // Green, vermilion, blue and grey, as the words in the table.
            let look = Look::of([2, 1, 0, 6][place]);
            let name = format!("{} ({})", verdict.name(), pairs.len());
            (!pairs.is_empty()).then(|| Series { name, look, joined: false, marks: marks.collect() })
        });
        let chart = Chart {
            title: format!("{b} against {a}"),
            x_label: format!("{a}: median ms"),
            y_label: format!("{b}: median ms"),
            across: Across::Numbers(Kind::Log),
            up: Kind::Log,
            diagonal: true,
            series: series.collect(),
        };
        Plot {
            name: "compare".into(),
            caption: format!(
                "Below the line {b} is faster, above it {a}; bars are 95% intervals of {b}'s medians."
            ),
            svg: chart.svg(),
        }
    }

    /// The comparison as a page.
    pub fn html(&self) -> Result<String> {
        let records: Vec<Record> = self.pairs.iter().map(|pair| pair.after.clone()).collect();
        let page = Page {
            style: STYLE,
            script: SCRIPT,
            nonce: nonce(&records),
            version: env!("CARGO_PKG_VERSION"),
            labels: &self.labels,
            summary: self.summary(),
            plot: self.plot(),
            rows: self.rows(),
            others: &self.others,
            threshold: significant(100.0 * self.threshold, 3),
        };
        page.render().map_err(|error| Error::run(format!("the comparison could not be written: {error}")))
    }
}

#[derive(Template)]
#[template(path = "compare.html")]
struct Page<'a> {
    style: &'static str,
    script: &'static str,
    nonce: String,
    version: &'static str,
    labels: &'a [String; 2],
    summary: String,
    plot: Plot,
    rows: Vec<Row>,
    others: &'a [String],
    threshold: String,
}

/// A row of the table.
struct Row {
    point: String,
    before: String,
    after: String,
    change: String,
    verdict: &'static str,
}

impl Row {
    fn cells(&self) -> [&str; 5] {
        [&self.point, &self.before, &self.after, &self.change, self.verdict]
    }
}

fn line(pair: &Pair) -> PairLine<'_> {
    PairLine {
        scene: &pair.before.scene,
        image_size: pair.before.image_size,
        device: [&pair.before.device, &pair.after.device],
        name: &pair.before.name,
        local_size: pair.before.local_size,
        median_ms: [median(&pair.before), median(&pair.after)],
        change_percent: pair.change_percent,
        verdict: pair.verdict.name(),
    }
}

fn name(record: &Record) -> String {
    if record.is_baseline() {
        return format!("{} {}, {}", record.scene, by(record.image_size), title(record));
    }
    format!("{} {}, {} {}", record.scene, by(record.image_size), record.name, size_name(record))
}

fn devices(folder: &Folder) -> Vec<&str> {
    let mut devices: Vec<&str> =
        folder.records.iter().map(|record| record.device.as_str()).filter(|device| *device != HOST).collect();
    devices.sort_unstable();
    devices.dedup();
    devices
}

/// The folders' names, told apart where they are the same.
fn labels(before: &Folder, after: &Folder) -> [String; 2] {
    if before.label != after.label {
        return [before.label.clone(), after.label.clone()];
    }
    [before, after].map(|folder| folder.path.display().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::{infeasible, measured};

    fn folder(label: &str, records: Vec<Record>) -> Folder {
        Folder { label: label.into(), records, ..Folder::default() }
    }

    fn timed(device: &str, name: &str, around: f64) -> Record {
        let mut record = measured(device, name, 8, [around * 0.99, around * 1.01]);
        record.samples_ms = (0..10).map(|n| around * (0.99 + 0.002 * f64::from(n))).collect();
        record
    }

    #[test]
    fn another_machines_results_are_compared_point_by_point() {
        let before = folder(
            "old",
            vec![timed("a", "naive", 10.0), timed("a", "wide", 1.0), timed("a", "private", 5.0)],
        );
        let after = folder(
            "new",
            vec![
                timed("b", "naive", 20.0),
                timed("b", "wide", 0.5),
                infeasible("b", "private", 8, "no"),
                timed("b", "raster", 1.0),
            ],
        );
        let comparison = Comparison::of(&before, &after, 0.02);
        assert_eq!(comparison.summary(), "1 faster, 1 slower, 0 same, 0 unclear");
        let regressions = comparison.regressions(5.0);
        assert_eq!(regressions.len(), 2, "{regressions:?}");
        assert!(comparison.regressions(150.0)[0].contains("was measured, is infeasible"));
        assert!(comparison.others.iter().any(|line| line.contains("only in new")), "{:?}", comparison.others);
        assert!(comparison.markdown().contains("| +100.0% | slower |"), "{}", comparison.markdown());
    }

    #[test]
    fn a_folder_is_the_same_as_itself() {
        let one = folder("one", vec![timed("a", "naive", 10.0)]);
        let comparison = Comparison::of(&one, &one, 0.02);
        assert_eq!(comparison.summary(), "0 faster, 0 slower, 1 same, 0 unclear");
        assert!(comparison.html().expect("it renders").contains("class=\"mark\""));
    }
}
