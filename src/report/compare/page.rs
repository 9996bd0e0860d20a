//! Formats a comparison as Markdown, as a plot and as a page.

use super::{Comparison, Pair};
use crate::error::{Error, Result};
use crate::measure::Verdict;
use crate::numbers::ms;
use crate::printer::{line, markdown};
use crate::record::{interval, median};
use crate::report::page::{SCRIPT, STYLE, nonce};
use crate::report::plot::Plot;
use crate::report::plot::chart::{Across, Chart, Mark, Series};
use crate::report::plot::look::Look;
use crate::report::plot::scale::Kind;
use crate::report::words::tip;
use askama::Template;
use std::fmt::Write as _;

impl Comparison {
    /// Returns the comparison as Markdown.
    pub fn markdown(&self) -> String {
        let [a, b] = &self.labels.each_ref().map(|label| markdown(label));
        let mut text = format!("# {b} against {a}\n\n{}.\n\n", self.summary());
        let _ = writeln!(text, "| point | {a}, ms | {b}, ms | change | verdict |\n|---|--:|--:|--:|---|");
        for row in self.rows() {
            let cells = row.cells();
            let cells = cells.map(markdown);
            let _ = writeln!(text, "| {} |", cells.join(" | "));
        }
        self.notes.iter().for_each(|note| {
            let _ = writeln!(text, "\nNote: {}", line(note));
        });
        if !self.others.is_empty() {
            text.push_str("\nNot compared:\n\n");
            self.others.iter().for_each(|other| {
                let _ = writeln!(text, "- {}", markdown(other));
            });
        }
        let _ = writeln!(text, "\n{}", self.rule());
        text
    }

    /// Returns a text that explains how the verdicts are determined.
    fn rule(&self) -> String {
        format!(
            "In each folder, a point's time is divided by the time of the anchor, a kernel that never \
             changes and is timed in the same rounds. Without an anchor, the point's time is divided by the \
             mean time of the baselines. Without baselines, a kernel's time is divided by the mean time of \
             the kernels of the same device that changed by similar factors. If there is no \
             anchor, no baseline and no such kernel, the verdict is \"not comparable\". The two times are compared without being divided in three cases: \
             with `--times`; if the devices differ and the folders have no baselines in common; and if one run \
             measured the point with both folders of kernels. The change is the second folder's \
             quotient (or time), divided by the first folder's quotient (or time). A point is called faster \
             (or slower) if its whole 95% interval is a decrease (or an increase) of more than {0}%. A point is \
             called the same if its whole interval is a change of less than {0}% in either direction. All other \
             points are unclear. Nominally, at most one point in 40 is wrongly called faster, and at most one \
             in 40 wrongly called slower. Points with fewer than five samples in a launch, or with a sample of the time 0, are not judged.",
            self.threshold_percent()
        )
    }

    /// Returns the threshold in percent, such as "2" or "0.5", without binary rounding errors.
    fn threshold_percent(&self) -> String {
        ((1e4 * self.threshold).round() / 100.0).to_string()
    }

    /// Returns the rows of the comparison's table, with the largest changes first.
    fn rows(&self) -> Vec<Row> {
        let several = self.has_several_devices();
        let mut pairs: Vec<_> = self.pairs.iter().collect();
        // Half the time and twice the time count as equally large changes. Points whose change is
        // unknown come last.
        let size = |pair: &Pair| pair.change.map_or(-1.0, |(change, _)| change.middle.ln().abs());
        pairs.sort_by(|a, b| size(b).total_cmp(&size(a)));
        let row = |pair: &&Pair| Row {
            point: pair.point(several),
            before: median(&pair.before).map_or("-".into(), ms),
            after: median(&pair.after).map_or("-".into(), ms),
            change: pair.change(),
            percent: pair.change_percent().map_or_else(String::new, |percent| percent.to_string()),
            verdict: pair.verdict.name(),
        };
        pairs.iter().map(row).collect()
    }

    /// Plots the second folder's times over the first folder's times, with one series per verdict.
    pub fn plot(&self) -> Plot {
        let [a, b] = &self.labels;
        let series = Verdict::ALL.into_iter().enumerate().filter_map(|(index, verdict)| {
            let pairs: Vec<_> = self.pairs.iter().filter(|pair| pair.verdict == verdict).collect();
            let marks = pairs.iter().filter_map(|pair| {
                let tip = format!(
                    "{}\n{} ({})\n{a}: {}\n{b}: {}",
                    pair.point(true),
                    verdict.name(),
                    pair.change(),
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
            // As in the table, green means faster, vermilion slower, blue the same, and grey unclear. The
            // verdicts on points whose change cannot be computed have further colours.
            let look = Look::of([2, 1, 0, 6, 4, 5, 3][index]);
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
        let caption = format!(
            "Below the line of equal times, {b} is faster; above this line, {a} is faster. Bars are 95% intervals of {b}'s medians; points with fewer than five samples in a launch, or with a sample of the time 0, have no bar."
        );
        Plot::of("compare", caption, &chart)
    }

    /// Returns the comparison as a page.
    pub fn html(&self) -> Result<String> {
        let page = Page {
            style: STYLE,
            script: SCRIPT,
            nonce: nonce(),
            version: env!("CARGO_PKG_VERSION"),
            labels: &self.labels,
            summary: self.summary(),
            plot: self.plot(),
            rows: self.rows(),
            others: &self.others,
            notes: &self.notes,
            rule: self.rule(),
        };
        page.render().map_err(|error| Error::fault(format!("the comparison could not be written: {error}")))
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
    notes: &'a [String],
    rule: String,
}

/// A row of the comparison's table.
struct Row {
    point: String,
    before: String,
    after: String,
    change: String,
    /// The change in percent, by which the page sorts rows; empty if the change is unknown.
    percent: String,
    verdict: &'static str,
}

impl Row {
    fn cells(&self) -> [&str; 5] {
        [&self.point, &self.before, &self.after, &self.change, self.verdict]
    }
}
