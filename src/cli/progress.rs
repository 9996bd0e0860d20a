//! How a run gets on: a bar on a terminal, plain lines elsewhere.

use crate::experiment::Observer;
use crate::record::{Outcome, Record};
use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use std::io::{IsTerminal, Write as _};
use std::time::Duration;

/// A bar with what is running, done of total, and the time left.
pub struct Bar {
    bar: ProgressBar,
}

/// The bar's look; the words are what `works_on` was told last. In 80 columns half is left for them.
const STYLE: &str = "{spinner} {bar:16.cyan/blue} {pos}/{len}, {left} left: {wide_msg}";

/// The time left, which nobody knows before the first point has stopped.
fn left(state: &ProgressState, out: &mut dyn std::fmt::Write) {
    // A bar that cannot be written is no reason to stop measuring.
    let _ = match state.pos() {
        0 => out.write_str("?"),
        _ => write!(out, "{:#}", HumanDuration(state.eta())),
    };
}

impl Observer for Bar {
    fn begins(&mut self, points: usize) {
        self.bar.set_length(points as u64);
        self.bar.enable_steady_tick(Duration::from_millis(100));
    }

    fn resumes(&mut self, done: usize) {
        self.bar.set_position(done as u64);
        self.bar.reset_eta();
    }

    fn works_on(&mut self, what: &str) {
        self.bar.set_message(what.to_owned());
    }

    fn finished(&mut self, record: &Record) {
        if !record.outcome.is_fine() {
            self.bar.println(line(record));
        }
        self.bar.inc(1);
    }

    fn ends(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// A line on standard error for every point that has stopped.
#[derive(Default)]
pub struct Lines {
    points: usize,
    done: usize,
}

impl Observer for Lines {
    fn begins(&mut self, points: usize) {
        self.points = points;
    }

    fn resumes(&mut self, done: usize) {
        self.done = done;
        if done > 0 {
            let _ = writeln!(std::io::stderr(), "{done} of {} points were done before", self.points);
        }
    }

    fn works_on(&mut self, _what: &str) {}

    fn finished(&mut self, record: &Record) {
        self.done += 1;
        // A log that cannot be written is no reason to stop measuring.
        let _ = writeln!(std::io::stderr(), "[{}/{}] {}", self.done, self.points, line(record));
    }

    fn ends(&mut self) {}
}

/// The observer for standard error as it is; a line a point where `verbose`.
pub fn observer(quiet: bool, verbose: bool) -> Box<dyn Observer> {
    if quiet {
        return Box::new(());
    }
    if verbose || !std::io::stderr().is_terminal() {
        return Box::new(Lines::default());
    }
    let bar = ProgressBar::new(0);
    // The template is a constant; were it wrong, indicatif's own look would do.
    let style = ProgressStyle::with_template(STYLE).unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.set_style(style.with_key("left", left));
    Box::new(Bar { bar })
}

/// A record in a line.
fn line(record: &Record) -> String {
    let [width, height] = record.image_size;
    let local = record.local_size.map_or(String::new(), |[x, y]| format!(" {x}x{y}"));
    let point = format!("{} {width}x{height} {} {}{local}", record.scene, record.device, record.name);
    match (record.outcome, record.median_ms) {
        (Outcome::Measured, Some(median_ms)) => {
            format!("{point}: {median_ms:.3} ms, n = {}", record.samples_ms.len())
        }
        (outcome, _) => {
            // A compiler's log has many lines; the record keeps them all.
            let reason = record.reason.as_deref().and_then(|reason| reason.lines().next());
            format!("{point}: {}: {}", outcome.name(), reason.unwrap_or_default())
        }
    }
}
