//! Shows the progress of a run: a bar on a terminal; plain lines elsewhere, and with `--verbose`.

use crate::device::common_name;
use crate::experiment::Observer;
use crate::numbers::ms;
use crate::printer::{self, tell};
use crate::record::{Outcome, Record};
use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use std::time::{Duration, Instant};

/// A bar with the number of finished steps and the total, the time left, and the current work. A step is the
/// measurement of one point in one launch.
pub struct Bar {
    bar: ProgressBar,
}

/// Returns the bar's layout as a template for indicatif, the library that draws the bar. In place of `wide_msg`, the
/// bar shows the text about the current work, which the method `works_on` received last. On a terminal of 80 columns,
/// this text has about 40 columns. The layout itself contains the escape codes for cyan and for the terminal's default
/// colour, because the colours of indicatif do not obey `--color`.
fn layout(coloured: bool) -> String {
    let [cyan, usual] = if coloured { ["\u{1b}[36m", "\u{1b}[0m"] } else { [""; 2] };
    format!("{{spinner}} {cyan}{{bar:16}}{usual} {{pos}}/{{len}}, {{left}} left: {{wide_msg}}")
}

/// Writes the time left; `?` if no step has finished yet.
fn left(state: &ProgressState, out: &mut dyn std::fmt::Write) {
    // If writing the time left fails, the error is ignored: the run continues without a complete bar.
    let _ = match state.pos() {
        0 => out.write_str("?"),
        _ => write!(out, "{:#}", HumanDuration(state.eta())),
    };
}

impl Bar {
    /// Returns `bar` with raycl's layout. Returns `None` if indicatif (the library that draws the bar) hides the bar,
    /// for example on a terminal that cannot move its cursor (`TERM=dumb`). A hidden bar is useless, since indicatif
    /// would also discard the lines that are printed above it.
    fn on(bar: ProgressBar, coloured: bool) -> Option<Self> {
        if bar.is_hidden() {
            return None;
        }
        let layout = layout(coloured);
        // If the layout were wrong, the default layout of indicatif (the library that draws the bar) would be used.
        let style = ProgressStyle::with_template(&layout).unwrap_or_else(|_| ProgressStyle::default_bar());
        bar.set_style(style.with_key("left", left));
        Some(Self { bar })
    }
}

impl Observer for Bar {
    fn begins(&mut self, _points: usize, steps: usize) {
        self.bar.set_length(steps as u64);
        self.bar.enable_steady_tick(Duration::from_millis(100));
    }

    fn resumes(&mut self, _points: usize, steps: usize) {
        self.bar.set_position(steps as u64);
        self.bar.reset_eta();
    }

    fn advances(&mut self, steps: usize) {
        self.bar.inc(steps as u64);
    }

    fn works_on(&mut self, what: &str) {
        self.bar.set_message(printer::line(what).into_owned());
    }

    fn says(&mut self, words: &str) {
        self.bar.println(printer::plain(words));
    }

    fn finished(&mut self, record: &Record) {
        if !record.outcome.is_fine() {
            self.bar.println(printer::plain(&line(record)));
        }
    }

    fn ends(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Prints a line to standard error for every finished point. All points of a group (points that are compared
/// with each other) are finished at the same time, after the group's last launch. While a group is measured,
/// a long time can pass in which no point is finished. After each minute without a line, a line about the
/// current work is printed.
#[derive(Default)]
pub struct Lines {
    points: usize,
    done: usize,
    /// Number of points that earlier sessions have finished; with several runs (stages), only the points of
    /// the runs that have begun.
    earlier: usize,
    /// Number of steps of all points; a step is the measurement of one point in one launch. `taken` is the number of
    /// finished steps.
    steps: usize,
    taken: usize,
    /// When this run's first point began, and the number of steps that were finished at that time; `None` if
    /// no point has begun.
    since: Option<(Instant, usize)>,
    /// Number of steps that this run has finished without a sample, for example because the step's point does not fit
    /// on the device.
    untimed: usize,
    /// When the latest line of progress was printed. If no line was printed yet, `printed_at` is the time when the run
    /// first reported its current work; `None` if the run has not reported its work yet.
    printed_at: Option<Instant>,
}

/// If the run has printed no line of progress for this duration, it prints a line about its current work.
const QUIET: Duration = Duration::from_secs(60);

impl Lines {
    /// Returns text such as ", about 12m left", or an empty text if no step has been timed yet or none is left. The
    /// estimate uses the steps that were timed since this run's first point began. Points that do not fit on the device
    /// take no time; if their steps counted, the estimate would be too short.
    fn left(&self) -> String {
        let Some((begun, before)) = self.since else { return String::new() };
        let now_done = self.taken.saturating_sub(before + self.untimed);
        let missing = self.steps.saturating_sub(self.taken);
        if now_done == 0 || missing == 0 {
            return String::new();
        }
        let left = begun.elapsed().mul_f64(missing as f64 / now_done as f64);
        format!(", about {:#} left", HumanDuration(left))
    }

    /// Returns a line about the points that earlier sessions have finished; `None` if they have finished no point.
    /// `done` is the number of all points that are finished now. If this session consists of several runs (see
    /// [`Stages`]), `done` also counts points that earlier runs of this session have finished. The line does not count
    /// these points.
    fn earlier_line(&mut self, done: usize) -> Option<String> {
        self.earlier += done.saturating_sub(self.done);
        (self.earlier > 0).then(|| format!("{} of {} points are done already", self.earlier, self.points))
    }

    /// Returns a line with the progress followed by `text`, and stores the present time as the time of the
    /// latest line.
    fn line(&mut self, text: &str) -> String {
        self.printed_at = Some(Instant::now());
        format!("[{}/{}{}] {text}", self.done, self.points, self.left())
    }

    /// Returns a line about the current work if no line was printed for a minute; otherwise `None`.
    fn overdue_line(&mut self, what: &str) -> Option<String> {
        let is_quiet = self.printed_at.get_or_insert_with(Instant::now).elapsed() >= QUIET;
        is_quiet.then(|| self.line(what))
    }
}

impl Observer for Lines {
    fn enters(&mut self, stage: &str) {
        tell(stage);
    }

    fn begins(&mut self, points: usize, steps: usize) {
        (self.points, self.steps) = (points, steps);
    }

    fn resumes(&mut self, done: usize, steps: usize) {
        self.earlier_line(done).into_iter().for_each(tell);
        (self.done, self.taken) = (done, steps);
        (self.since, self.untimed) = (None, 0);
    }

    fn advances(&mut self, steps: usize) {
        self.taken += steps;
    }

    fn works_on(&mut self, what: &str) {
        self.since.get_or_insert((Instant::now(), self.taken));
        if let Some(line) = self.overdue_line(&printer::line(what)) {
            tell(line);
        }
    }

    fn finished(&mut self, record: &Record) {
        self.done += 1;
        tell(self.line(&line(record)));
        if self.since.is_some() && record.median_ms.is_none() {
            self.untimed += self.steps / self.points.max(1);
        }
    }

    fn ends(&mut self) {}
}

/// Shows the progress of several runs like the progress of a single run: the counts of finished points and
/// steps continue from run to run.
pub struct Stages {
    inner: Box<dyn Observer>,
    /// Number of points in all runs.
    points: usize,
    /// Number of steps (measurements of one point in one launch) in all runs together.
    steps: usize,
    done: usize,
    taken: usize,
    stage: String,
    begun: bool,
}

impl Stages {
    /// Returns an observer that passes its calls on to `inner`. `points` and `steps` are the numbers of
    /// points and of steps in all runs together.
    pub fn of(points: usize, steps: usize, inner: Box<dyn Observer>) -> Self {
        Self { inner, points, steps, done: 0, taken: 0, stage: String::new(), begun: false }
    }

    /// Begins the next run, which has the name `stage` in the printed progress.
    pub fn enter(&mut self, stage: String) {
        self.inner.enters(&stage);
        self.stage = stage;
    }

    /// Returns the number of finished points.
    pub fn done(&self) -> usize {
        self.done
    }

    /// Tells the observer `inner` that the last run has ended.
    pub fn end(&mut self) {
        self.inner.ends();
    }
}

impl Observer for Stages {
    fn begins(&mut self, _points: usize, _steps: usize) {
        if !std::mem::replace(&mut self.begun, true) {
            self.inner.begins(self.points, self.steps);
        }
    }

    fn resumes(&mut self, done: usize, steps: usize) {
        (self.done, self.taken) = (self.done + done, self.taken + steps);
        if done > 0 {
            self.inner.resumes(self.done, self.taken);
        }
    }

    fn advances(&mut self, steps: usize) {
        self.taken += steps;
        self.inner.advances(steps);
    }

    fn works_on(&mut self, what: &str) {
        self.inner.works_on(&format!("{}: {what}", self.stage));
    }

    fn says(&mut self, line: &str) {
        self.inner.says(line);
    }

    fn finished(&mut self, record: &Record) {
        self.done += 1;
        self.inner.finished(record);
    }

    fn ends(&mut self) {}
}

/// Shows no progress. Prints only the lines that a run prints immediately, such as the line which says that
/// the run waits for another process.
struct Notes;

impl Observer for Notes {
    fn begins(&mut self, _points: usize, _steps: usize) {}
    fn works_on(&mut self, _what: &str) {}
    fn finished(&mut self, _record: &Record) {}
    fn ends(&mut self) {}
}

/// Returns the observer that shows the progress on standard error. If `quiet` is true, the observer shows no
/// progress. If `verbose` is true, the observer prints a line per point. The observer also prints a line per
/// point if standard error cannot show a bar: if it is no terminal, or if the terminal cannot move its
/// cursor. If the observer prints no lines, and `quiet` is false, it shows a progress bar.
pub fn observer(quiet: bool, verbose: bool) -> Box<dyn Observer> {
    if quiet {
        return Box::new(Notes);
    }
    // Unless the user chose otherwise, the bar is coloured, since it is only shown on a terminal.
    let coloured = super::colour::chosen().unwrap_or(true);
    match Bar::on(ProgressBar::new(0), coloured) {
        Some(bar) if !verbose => Box::new(bar),
        _ => Box::new(Lines::default()),
    }
}

/// Returns a line about a record: the point, and its median time or the reason why the point was not
/// measured.
fn line(record: &Record) -> String {
    let [width, height] = record.image_size;
    let local = record.local_size.map_or(String::new(), |[x, y]| format!(" {x}x{y}"));
    let name = if record.is_baseline() { &record.strategy } else { &record.name };
    let point = format!("{} {width}x{height} {} {name}{local}", record.scene, common_name(&record.device));
    match (record.outcome, record.median_ms) {
        (Outcome::Measured, Some(median_ms)) => {
            format!("{point}: {} ms, n = {}", ms(median_ms), record.samples_ms.len())
        }
        (outcome, _) => {
            // A compiler's log has many lines. Only the first line is shown; the record contains the whole log.
            let reason = record.reason.as_deref().and_then(|reason| reason.lines().next());
            format!("{point}: {}: {}", outcome.name(), reason.unwrap_or_default())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use indicatif::{ProgressDrawTarget, TermLike};
    use std::io::Result;
    use std::sync::{Arc, Mutex};

    /// An observer that stores the name and the arguments of every call.
    #[derive(Clone, Default)]
    struct Events(Arc<Mutex<Vec<String>>>);

    impl Observer for Events {
        fn enters(&mut self, stage: &str) {
            self.0.lock().expect("no test panicked").push(format!("enters {stage}"));
        }
        fn begins(&mut self, points: usize, steps: usize) {
            self.0.lock().expect("no test panicked").push(format!("begins {points}, {steps} steps"));
        }
        fn resumes(&mut self, done: usize, steps: usize) {
            self.0.lock().expect("no test panicked").push(format!("resumes {done}, {steps} steps"));
        }
        fn advances(&mut self, steps: usize) {
            self.0.lock().expect("no test panicked").push(format!("advances {steps}"));
        }
        fn says(&mut self, line: &str) {
            self.0.lock().expect("no test panicked").push(format!("says {line}"));
        }
        fn works_on(&mut self, what: &str) {
            self.0.lock().expect("no test panicked").push(what.to_owned());
        }
        fn finished(&mut self, _: &Record) {
            self.0.lock().expect("no test panicked").push("finished".into());
        }
        fn ends(&mut self) {
            self.0.lock().expect("no test panicked").push("ends".into());
        }
    }

    /// A terminal for tests, which stores the text that is written to it.
    #[derive(Clone, Debug, Default)]
    struct Screen(Arc<Mutex<String>>);

    impl TermLike for Screen {
        fn width(&self) -> u16 {
            80
        }
        fn move_cursor_up(&self, _: usize) -> Result<()> {
            Ok(())
        }
        fn move_cursor_down(&self, _: usize) -> Result<()> {
            Ok(())
        }
        fn move_cursor_right(&self, _: usize) -> Result<()> {
            Ok(())
        }
        fn move_cursor_left(&self, _: usize) -> Result<()> {
            Ok(())
        }
        fn write_line(&self, text: &str) -> Result<()> {
            self.write_str(text)
        }
        fn write_str(&self, text: &str) -> Result<()> {
            self.0.lock().expect("no test panicked").push_str(text);
            Ok(())
        }
        fn clear_line(&self) -> Result<()> {
            Ok(())
        }
        fn flush(&self) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn the_bar_has_colours_only_if_they_are_wanted() {
        let shown = |coloured| {
            let screen = Screen::default();
            let target = ProgressDrawTarget::term_like(Box::new(screen.clone()));
            let mut bar = Bar::on(ProgressBar::with_draw_target(Some(4), target), coloured).expect("a bar");
            bar.works_on("timing teapot");
            bar.advances(1);
            bar.bar.tick();
            let text = screen.0.lock().expect("no test panicked").clone();
            assert!(text.contains("timing teapot") && text.contains("1/4"), "{text:?}");
            text
        };
        assert!(shown(true).contains("\u{1b}[36m"), "{:?}", shown(true));
        assert!(!shown(false).contains('\u{1b}'), "{:?}", shown(false));
    }

    #[test]
    fn above_the_bar_only_points_that_failed_have_lines() {
        let screen = Screen::default();
        let target = ProgressDrawTarget::term_like(Box::new(screen.clone()));
        let mut bar = Bar::on(ProgressBar::with_draw_target(Some(4), target), false).expect("a bar");
        let of = |name: &str, outcome| Record { name: name.to_owned(), outcome, ..Record::default() };
        bar.finished(&of("naive", Outcome::Measured));
        bar.finished(&of("wide", Outcome::Crashed));
        let text = screen.0.lock().expect("no test panicked").clone();
        assert!(text.contains("wide: crashed") && !text.contains("naive"), "{text:?}");
    }

    #[test]
    fn there_is_no_bar_where_it_would_be_hidden() {
        assert!(Bar::on(ProgressBar::hidden(), false).is_none());
    }

    #[test]
    fn several_runs_count_as_one() {
        let events = Events::default();
        let mut stages = Stages::of(5, 15, Box::new(events.clone()));
        for (name, done) in [("a", 0), ("b", 1)] {
            stages.enter(name.to_owned());
            stages.begins(2, 6);
            stages.resumes(done, 3 * done);
            stages.works_on("timing");
            stages.advances(2);
            stages.says("waits");
            stages.finished(&Record::default());
            stages.ends();
        }
        assert_eq!(stages.done(), 3);
        stages.end();
        let expected = [
            "enters a",
            "begins 5, 15 steps",
            "a: timing",
            "advances 2",
            "says waits",
            "finished",
            "enters b",
            "resumes 2, 5 steps",
            "b: timing",
            "advances 2",
            "says waits",
            "finished",
            "ends",
        ];
        assert_eq!(*events.0.lock().expect("no test panicked"), expected);
    }

    #[test]
    fn a_line_has_the_point_and_its_time_or_the_first_line_of_the_reason() {
        let record = Record {
            scene: "teapot".to_owned(),
            image_size: [8, 5],
            device: "gpu".to_owned(),
            name: "naive".to_owned(),
            local_size: Some([16, 4]),
            samples_ms: vec![1.0; 7],
            median_ms: Some(1.25),
            outcome: Outcome::Measured,
            ..Record::default()
        };
        assert_eq!(line(&record), "teapot 8x5 gpu naive 16x4: 1.250 ms, n = 7");
        let short = Record { median_ms: Some(0.001_51), ..record.clone() };
        assert!(line(&short).ends_with(": 0.001510 ms, n = 7"), "{}", line(&short));
        let reason = Some("line 1\nline 2".to_owned());
        let failed =
            Record { outcome: Outcome::BuildFailed, median_ms: None, local_size: None, reason, ..record };
        assert_eq!(line(&failed), "teapot 8x5 gpu naive: build-failed: line 1");
    }

    #[test]
    fn a_line_names_devices_and_baselines_as_tables_do() {
        let of = |device: &str, name: &str, strategy: &str| {
            let [device, name, strategy] = [device, name, strategy].map(str::to_owned);
            line(&Record { scene: "teapot".to_owned(), device, name, strategy, ..Record::default() })
        };
        let on_cpu = of("pthread-skylake-avx512-Intel(R) Xeon(R) Processor", "naive", "traversal=exhaustive");
        assert!(on_cpu.starts_with("teapot 0x0 Intel Xeon, PoCL naive: "), "{on_cpu}");
        let baseline = of("host", "serial", "serial-f32");
        assert!(baseline.starts_with("teapot 0x0 host serial-f32: "), "{baseline}");
    }

    #[test]
    fn a_line_counts_the_points_of_earlier_sessions_as_done() {
        let mut lines = Lines::default();
        lines.begins(10, 30);
        lines.resumes(4, 12);
        assert_eq!((lines.taken, lines.line("a")), (12, "[4/10] a".to_owned()));
        lines.finished(&Record::default());
        assert_eq!(lines.line("b"), "[5/10] b");
    }

    #[test]
    fn points_that_were_finished_just_now_are_not_counted_as_done_already() {
        let mut lines = Lines::default();
        lines.begins(10, 30);
        assert_eq!(lines.earlier_line(0), None);
        assert_eq!(lines.earlier_line(2).as_deref(), Some("2 of 10 points are done already"));
        lines.done = 2;
        // In this test, the session finishes three points. Then the next run begins, of which earlier
        // sessions have finished four points.
        (0..3).for_each(|_| lines.finished(&Record::default()));
        assert_eq!(lines.earlier_line(9).as_deref(), Some("6 of 10 points are done already"));
    }

    #[test]
    fn the_time_left_is_estimated_from_what_is_done_since_the_begin() {
        let mut lines = Lines::default();
        lines.begins(10, 30);
        assert_eq!(lines.left(), "");
        lines.since = Some((Instant::now().checked_sub(Duration::from_secs(60)).expect("a minute ago"), 6));
        lines.taken = 12;
        assert_eq!(lines.left(), ", about 3m left");
        // The finished point has a median time, so its steps were timed and still count for the estimate of
        // the time left.
        lines.finished(&Record { median_ms: Some(1.0), ..Record::default() });
        assert_eq!(lines.left(), ", about 3m left");
        // A point that does not fit on the device finishes the steps of its three launches at once.
        lines.finished(&Record::default());
        lines.advances(3);
        assert_eq!(lines.left(), ", about 3m left");
        lines.taken = 30;
        assert_eq!(lines.left(), "");
        // After one of several runs (a stage) has ended, the time per step of this run says nothing about the
        // next run.
        lines.resumes(5, 15);
        assert_eq!(lines.left(), "");
    }

    #[test]
    fn after_a_minute_without_a_line_one_says_what_the_run_does() {
        let mut lines = Lines::default();
        lines.begins(10, 30);
        assert_eq!(lines.overdue_line("timing teapot"), None, "the run has just begun");
        lines.printed_at = Instant::now().checked_sub(Duration::from_secs(60));
        assert_eq!(lines.overdue_line("timing teapot").as_deref(), Some("[0/10] timing teapot"));
        assert_eq!(lines.overdue_line("timing teapot"), None, "the line was just printed");
        lines.printed_at = Instant::now().checked_sub(Duration::from_secs(60));
        lines.finished(&Record::default());
        assert_eq!(lines.overdue_line("timing teapot"), None, "a finished point has a line too");
    }
}
