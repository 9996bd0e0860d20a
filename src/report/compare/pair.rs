//! Defines a point that two compared folders measured, and the change of the point's time.

use crate::measure::{Interval, Verdict};
use crate::numbers::{by, significant};
use crate::record::{Record, fewest, is_below_resolution};
use crate::report::words::{size_name, title};
use serde::Serialize;

/// The two records of a point that both compared folders measured.
pub(super) type Both<'a> = (&'a Record, &'a Record);

/// A point that both compared folders measured, with the verdict on the change of its time.
#[derive(Clone, Debug)]
pub struct Pair {
    /// The point's record in the first folder.
    pub before: Record,
    /// The point's record in the second folder.
    pub after: Record,
    /// The verdict on the second record's time, compared with the first record's time.
    pub verdict: Verdict,
    /// The ratio of the second time to the first time, and the measurements to which both times are
    /// relative; `None` if the ratio cannot be computed.
    pub change: Option<(Interval, Against)>,
}

/// The measurements, if any, by whose times both times of a point are divided to compute the change of the
/// point's time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Against {
    /// The device's anchor, a fixed kernel that was run in the same rounds.
    Anchor,
    /// Ray casters on the host (baselines) that were timed in the same rounds as the point. The program of
    /// the baselines is the same in both folders.
    Baselines,
    /// Kernels of the same rounds, on the point's device, that changed by similar factors. If all kernels of
    /// the device change by the same factor, dividing by these kernels' times hides the change. A baseline is
    /// never compared in this way.
    PointsInCommon,
    /// The two times are not divided by another measurement. The two times are compared directly, although
    /// they are from different runs or sessions.
    BareTimes,
    /// The two times are not divided by another measurement. Both times of the point were measured in the
    /// same rounds of one run, so they can be compared directly.
    SameRounds,
}

impl Pair {
    /// Returns the change in percent (positive if the point became slower); `None` if the change is unknown.
    pub fn change_percent(&self) -> Option<f64> {
        self.change.map(|(change, _)| percent(change.middle))
    }

    /// Formats the change as "+12.3% (+10.1 to +14.2)". If the change is a factor of at least 10, the format is "496×
    /// as long". If the change is a factor of at most 0.1, the format is "20.0× as fast". If a record has too few
    /// samples, the format is "n = 10 and 3"; the two numbers are the two records' smallest numbers of samples in a
    /// launch. If the change is unknown although both records have enough samples, the returned text is "?".
    pub fn change(&self) -> String {
        let Some((change, _)) = self.change else {
            return match self.verdict {
                Verdict::NotEnough => format!("n = {} and {}", fewest(&self.before), fewest(&self.after)),
                _ => "?".to_owned(),
            };
        };
        match change.middle {
            ratio if ratio >= 10.0 => format!("{}× as long", significant(ratio, 3)),
            ratio if ratio <= 0.1 => format!("{}× as fast", significant(1.0 / ratio, 3)),
            ratio => {
                let [middle, low, high] = [ratio, change.low, change.high].map(percent);
                format!("{middle:+.1}% ({low:+.1} to {high:+.1})")
            }
        }
    }

    /// Returns the point's name, such as "teapot 800 x 500, naive 8x8". If `device` is true and the point is
    /// not a baseline, the name ends with the device's name.
    pub fn point(&self, device: bool) -> String {
        common_name(self.both(), device)
    }

    /// Sets the change of the point, and the verdict that follows from it.
    pub(super) fn judge(&mut self, change: Option<(Interval, Against)>, threshold: f64) {
        self.change = change;
        self.verdict = match change {
            Some((change, _)) => Verdict::of(change, threshold),
            None => self.without_change(),
        };
    }

    /// Returns the verdict on a point whose change cannot be computed. The verdict says why the change cannot
    /// be computed.
    fn without_change(&self) -> Verdict {
        let records = [&self.before, &self.after];
        if records.iter().all(|record| record.relative_times.is_some()) {
            Verdict::NotComparable
        } else if records.into_iter().any(is_below_resolution) {
            Verdict::BelowResolution
        } else {
            Verdict::NotEnough
        }
    }

    /// Returns the point's two records.
    pub(super) fn both(&self) -> Both<'_> {
        (&self.before, &self.after)
    }
}

/// Converts a ratio of two times to the change in percent: 1.5 becomes 50.
pub(super) fn percent(ratio: f64) -> f64 {
    100.0 * (ratio - 1.0)
}

/// Returns the name of the point that two records have in common, like [`Pair::point`].
pub(super) fn common_name(both: Both<'_>, device: bool) -> String {
    named(both.0, strategy(both), device)
}

/// Returns the name of a record's point. If the record's run compared two folders of kernels, the name contains
/// the folder of the record's kernels, since the run measured another point with the other folder.
pub(super) fn name(record: &Record, device: bool) -> String {
    named(record, &record.name, device)
}

fn named(record: &Record, strategy: &str, device: bool) -> String {
    if record.is_baseline() {
        return format!("{} {}, {}", record.scene, by(record.image_size), title(record));
    }
    let on = if device { format!(", {}", record.device) } else { String::new() };
    format!("{} {}, {} {}{on}", record.scene, by(record.image_size), strategy, size_name(record))
}

/// Returns the name of the strategy that two records have in common. If their kernels are from different folders,
/// the returned name lacks the folder with which each record's name ends. If both records have kernels of the
/// same folder, the name keeps this folder: the compared runs may have measured kernels of another folder, too.
pub(super) fn strategy((before, after): Both<'_>) -> &str {
    let folder = before.kernels_of.as_ref().filter(|_| before.kernels_of != after.kernels_of);
    let folder = folder.map(|kernels| format!(" ({kernels})"));
    folder.and_then(|folder| before.name.strip_suffix(&folder)).unwrap_or(&before.name)
}
