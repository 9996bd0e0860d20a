//! Reports the progress of a run.

use crate::printer;
use crate::record::Record;

/// Receives the events of a run. The progress bar is an observer; tests use other observers.
pub trait Observer: Send {
    /// Is called with the name of a run when the run begins, if a command has several runs.
    fn enters(&mut self, _stage: &str) {}
    /// Is called when the run begins, with the numbers of all points and steps of the run, including the points
    /// and steps that earlier sessions have finished. A step is the measurement of one point in one launch.
    fn begins(&mut self, points: usize, steps: usize);
    /// Is called with the numbers of points and steps that an earlier session has finished.
    fn resumes(&mut self, _points: usize, _steps: usize) {}
    /// Is called with the number of steps that have been finished or dropped since the last call.
    fn advances(&mut self, _steps: usize) {}
    /// Is called with a short description of the current work.
    fn works_on(&mut self, what: &str);
    /// Prints a line at once, for example a line which says that the run waits for another process.
    fn says(&mut self, line: &str) {
        printer::tell(printer::plain(line));
    }
    /// Is called several times per second while the run waits for a device that another process uses, or for the
    /// process that measures the devices' peak rates.
    fn waits(&mut self) {}
    /// Is called when a point of the experiment is finished, with the point's record.
    fn finished(&mut self, record: &Record);
    /// Is called when the run's measurements end, also after an error or an interruption.
    fn ends(&mut self);
}

/// Ignores all events, and prints nothing.
impl Observer for () {
    fn begins(&mut self, _points: usize, _steps: usize) {}
    fn works_on(&mut self, _what: &str) {}
    fn says(&mut self, _line: &str) {}
    fn finished(&mut self, _record: &Record) {}
    fn ends(&mut self) {}
}
