//! Compares points by samples that were measured close in time, over several launches of the worker processes.
//!
//! The usual interval of a median treats all samples as independent. For measured times, an interval that assumes
//! independent samples is too narrow, for two reasons. First, a machine may be slower than usual for some seconds, so
//! samples that follow each other are not independent. Second, some conditions are random but constant within a launch
//! (addresses, placement of threads, the kernel's binary), so the samples of one launch cannot show the effect of these
//! conditions. Therefore, following Kalibera and Jones, "Rigorous Benchmarking in Reasonable Time" (ISMM 2013),
//! launches are repeated. Each launch gives one value per point, and intervals are computed from the spread of these
//! values. The spread includes all effects within a launch, even autocorrelation, so no model of these effects is
//! needed.
//!
//! 1. In each launch, the drift that all points share is subtracted from the logarithms of the times
//!    ([`drift`]). In a launch, a point's value is the median, over the point's samples, of the logarithm of
//!    the time minus the drift. The drift can be distinguished from differences between points only if
//!    samples of different points alternate. An experiment with alternating samples is called a paired
//!    design.
//! 2. Each value in the table of points and launches is split into the effect of its point, the effect of its
//!    launch, and the rest (two-way analysis of variance). Three launches give only a poor estimate of the
//!    spread of a pair of points (two degrees of freedom). Therefore the variance of the pair itself is averaged
//!    with the variance of a usual pair of points, which follows from the variances of all points (a
//!    moderated variance, after Smyth 2004). The variance of the pair itself has (launches - 1) degrees
//!    of freedom. The variance of a usual pair of points adds at most six degrees of freedom. If the group
//!    has few other points, or if the variances of the points differ much from each other ([`prior`]), the
//!    variance of a usual pair of points adds fewer degrees of freedom. If the group has fewer than four
//!    points, the variance of a usual pair of points adds no degrees of freedom. The same is true if the
//!    variance of the pair itself is more than twice as large as that of a usual pair. Student's t gives the
//!    interval ([`spread`]). For the ratio of a point to an anchor (work that is timed for comparison) that
//!    runs on processors (CPUs), only the variance of this pair itself is used.
//! 3. The interval of a median also includes the effects of a launch that are equal for all points. In the
//!    ratio of the times of two points, effects that are equal for all points cancel. Each group of points
//!    has a table of its own. First, the point's own spread between launches is averaged with the spread of
//!    all points in the table of the point's group. Then the result is averaged with the spread between
//!    launches in the tables of other groups of the same run. Only the tables of groups that were measured on
//!    the same machine and devices, in the same number of launches (at least two), are used. The resulting
//!    spread has (launches - 1) degrees of freedom, plus at most six from the tables of all other groups
//!    together. The other points in the table of the point's own group add no degrees of freedom. As in step
//!    2, a point's own variance is averaged only with a variance that is at least half as large.
//! 4. Launches of a run are minutes apart at most, so they do not show that the machine may be slower on
//!    another day. The differences between runs were therefore measured separately, for CPUs and for all
//!    other devices ([`between`]). From run to run, the times of all points on one kind of device are
//!    multiplied by a common factor, and the time of each point by a factor of its own. The variances of both
//!    factors are added to the variance of a median. If two points were measured together on the same kind of
//!    device, only the variances of their own factors are added to the variance of their ratio, since the
//!    common factor cancels in the ratio.
//!
//! If there is only one launch, the samples of each point are split into five consecutive parts, and each
//! part is treated as a launch. The intervals of a single launch are preliminary, since they do not include
//! differences between launches.

mod between;
mod drift;
mod error;
mod interval;
mod prior;
mod relative;
mod sample;
#[cfg(test)]
mod simulation;
mod spread;
#[cfg(test)]
mod tests;

pub use between::BetweenRuns;
pub use interval::Interval;
pub use relative::Relative;
pub use sample::PairedSample;

use super::MIN_SAMPLES;
use super::summary::median_of;
use error::Error;
use interval::interval;
use sample::by_point;
use spread::Pooled;
use std::collections::BTreeMap;

/// Number of parts into which a point's samples are split if there is a single launch. Points with fewer than
/// `PARTS` samples are left out before, so no part is empty.
const PARTS: usize = MIN_SAMPLES;

/// The comparison of points that were measured together.
#[derive(Clone, Debug, PartialEq)]
pub struct Paired {
    launches: usize,
    /// The points, and then the anchors; `None` for a point or an anchor with too few samples.
    points: Vec<Option<Point>>,
    /// One value per anchor: true if the anchor runs on processors (CPUs), false if it runs on another
    /// device, such as a GPU.
    on_processors: Vec<bool>,
    /// How much the times of each point differ from run to run; zero if unknown.
    between: Vec<BetweenRuns>,
    pooled: Pooled,
}

/// A point's times, as logarithms of milliseconds.
#[derive(Clone, Debug, PartialEq)]
struct Point {
    /// The median time of the point's samples of all launches.
    median: f64,
    /// The median of the point's samples in each launch, or in each part of a single launch.
    plain: Vec<f64>,
    /// Like `plain`, but the medians of samples from which the drift was subtracted.
    relative: Vec<f64>,
}

/// A point, or the mean of several points, with the spread of all points that were measured together.
#[derive(Clone, Debug, PartialEq)]
pub struct Standing {
    launches: usize,
    point: Point,
    /// The number of points of which `point` is the mean; 1 for a single point.
    points: usize,
    /// True if `point` is an anchor (work that is timed for comparison) that runs on processors (CPUs).
    is_anchor_on_processors: bool,
    between: BetweenRuns,
    pooled: Pooled,
}

impl Standing {
    /// Returns the number of launches in which the point was measured.
    pub fn launches(&self) -> usize {
        self.launches
    }

    /// Returns the median of all samples, in milliseconds, with its 95% interval.
    pub fn median_ms(&self) -> Interval {
        interval(self.point.median, self.error_of_level())
    }

    fn error_of_level(&self) -> Error {
        let between = self.between.of_level(self.points);
        Error::of_sum([self.pooled.of_level(&self.point.plain), between])
    }

    /// Returns the value by which points are ranked: the logarithm of the time without drift, as the mean
    /// over all launches.
    pub fn level(&self) -> f64 {
        self.point.level()
    }

    /// Returns the ratio of this point's time to the time of `other`, from samples that are close in time.
    /// Both points must have been measured together.
    pub fn ratio(&self, other: &Self) -> Interval {
        let points = [self.points, other.points];
        let between = self.between.of_ratio(other.between, points);
        interval(self.level() - other.level(), Error::of_sum([self.error_within_run(other), between]))
    }

    /// Returns the ratio of this point's time to the time of `reference`, like [`Self::ratio`]. The time of
    /// `reference` differs from run to run, which adds the same error to all ratios to `reference`. The error
    /// that the time of `reference` adds to these ratios is stored separately (see [`Relative`]).
    pub fn relative_to(&self, reference: &Self) -> Relative {
        let error = Error::of_sum([self.error_within_run(reference), self.between.of_points(self.points)]);
        let common = self.between.variance_of_reference(reference.between, reference.points);
        Relative { ratio: interval(self.level() - reference.level(), error), common }
    }

    /// Returns the error of a ratio without the part that the differences between runs add. If an anchor runs
    /// on processors, other programs may delay the anchor far more than the points. A few launches cannot
    /// show whether other programs delayed the anchor (work that is timed for comparison). Therefore, the
    /// usual spread of all points is not used for the error of a ratio to an anchor that runs on processors.
    fn error_within_run(&self, other: &Self) -> Error {
        let pairs = self.point.relative.iter().zip(&other.point.relative);
        let differences: Vec<f64> = pairs.map(|(own, other)| own - other).collect();
        let is_delayed = self.is_anchor_on_processors || other.is_anchor_on_processors;
        let pooled = if is_delayed { self.pooled.alone() } else { self.pooled };
        pooled.of_difference(&differences, [self.points, other.points])
    }

    /// Returns the ratio of this point's time to the time of `other`, a point that was measured at another
    /// time. The ratio includes the effect of any change of the machine's speed between the two measurements.
    pub fn ratio_apart(&self, other: &Self) -> Interval {
        let error = Error::of_sum([self.error_of_level(), other.error_of_level()]);
        interval(self.point.median - other.point.median, error)
    }

    /// Returns the ratio of this point's time to the time of `earlier`, like [`Self::ratio_apart`]. From run
    /// to run, the times of all points of a kind of device change by a common factor. The error that this
    /// common factor of all points adds to the ratio is stored separately (see [`Relative`]).
    pub fn relative_to_earlier(&self, earlier: &Self) -> Relative {
        let own = |one: &Self| [one.pooled.of_level(&one.point.plain), one.between.of_points(one.points)];
        let error = Error::of_sum([own(self), own(earlier)].concat());
        let common = self.between.shared.powi(2) + earlier.between.shared.powi(2);
        Relative { ratio: interval(self.point.median - earlier.point.median, error), common }
    }

    /// Returns the geometric mean of the times of points that were measured together; `None` if `points` is
    /// empty.
    pub fn mean(points: &[&Self]) -> Option<Self> {
        let first = *points.first()?;
        let mean =
            |of: &dyn Fn(&Self) -> f64| points.iter().map(|one| of(one)).sum::<f64>() / points.len() as f64;
        let each = |of: fn(&Point) -> &Vec<f64>| {
            (0..of(&first.point).len()).map(|index| mean(&|one| of(&one.point)[index])).collect()
        };
        let point = Point {
            median: mean(&|one| one.point.median),
            plain: each(|point| &point.plain),
            relative: each(|point| &point.relative),
        };
        Some(Self { point, points: points.iter().map(|one| one.points).sum(), ..first.clone() })
    }

    /// Returns the relative difference above which the times of two points can be distinguished, like
    /// [`Paired::resolution`].
    pub fn resolution(&self) -> Option<f64> {
        resolution(&self.pooled, self.between)
    }
}

impl Point {
    fn level(&self) -> f64 {
        self.relative.iter().sum::<f64>() / self.relative.len() as f64
    }
}

impl Paired {
    /// Compares `points` points by their samples. Within each launch, samples must be in the order in which
    /// they were measured. A sample is skipped if its time is not a positive, finite number, or if its field
    /// `point` is not below `points`.
    ///
    /// A launch is ignored if no point has [`MIN_SAMPLES`] samples in the launch, for example because the
    /// launch was interrupted. A point has too few samples if it has fewer than [`MIN_SAMPLES`] samples in a
    /// launch that is not ignored.
    pub fn of(samples: &[PairedSample], points: usize) -> Self {
        Self::with_anchors(samples, &vec![true; points], &[])
    }

    /// Compares points like [`Self::of`], but the samples may include times of anchors (work that is timed
    /// for comparison) that were measured together with the points. `are_typical` has one value per point.
    /// The spread of times is estimated from the points for which `are_typical` is true. If fewer than two
    /// typical points have enough samples, the spread is estimated from all points. `on_processors` has one
    /// value per anchor: true if the anchor runs on processors (CPUs). In the samples, the indices of the
    /// anchors follow the indices of the points.
    pub fn with_anchors(samples: &[PairedSample], are_typical: &[bool], on_processors: &[bool]) -> Self {
        let points = are_typical.len() + on_processors.len();
        let fine = |sample: &&PairedSample| sample.point < points && sample.ms.is_finite() && sample.ms > 0.0;
        let samples: Vec<PairedSample> = samples.iter().filter(fine).copied().collect();
        let launches = launches(&samples, points);
        let counts: Vec<Vec<usize>> = launches.iter().map(|launch| counts(launch, points)).collect();
        let enough = |point: usize| counts.iter().all(|counts| counts[point] >= MIN_SAMPLES);
        let enough: Vec<bool> = (0..points).map(|point| !launches.is_empty() && enough(point)).collect();
        let launches: Vec<Vec<PairedSample>> = launches
            .into_iter()
            .map(|launch| launch.into_iter().filter(|sample| enough[sample.point]).collect())
            .collect();
        let logs = |launch: &[PairedSample]| launch.iter().map(|sample| sample.ms.ln()).collect::<Vec<f64>>();
        let by_point = |values: &dyn Fn(&[PairedSample]) -> Vec<f64>| -> Vec<Vec<Vec<f64>>> {
            launches.iter().map(|launch| by_point(launch, &values(launch), points)).collect()
        };
        let (plain, relative) = (by_point(&logs), by_point(&|launch| drift::without_drift(launch, points)));
        let points: Vec<_> = enough
            .iter()
            .enumerate()
            .map(|(index, enough)| enough.then(|| point(index, &plain, &relative)).flatten())
            .collect();
        let rows = rows(&points, are_typical);
        let relative: Vec<&[f64]> = rows.iter().map(|point| point.relative.as_slice()).collect();
        let plain: Vec<&[f64]> = rows.iter().map(|point| point.plain.as_slice()).collect();
        let pooled = Pooled::of(&relative, &plain);
        let between = vec![BetweenRuns::default(); points.len()];
        let on_processors = on_processors.to_vec();
        Self { launches: launches.len(), points, on_processors, between, pooled }
    }

    /// Sets how much the times of each point differ from run to run.
    #[must_use]
    pub fn over_runs(self, between: Vec<BetweenRuns>) -> Self {
        Self { between, ..self }
    }

    /// Improves the estimates of the spread between launches in several tables of points. A table has the
    /// points that were measured together. All tables must come from one run, on the same devices of one
    /// machine. The estimates of each table also use the spread between launches in all other tables with the
    /// same number of launches. A table with a single launch neither uses other tables nor is used for them,
    /// because parts of one launch do not show how much launches differ.
    pub fn borrow_from_each_other(all: &mut [Self]) {
        let lenders: Vec<(usize, Pooled)> = all.iter().map(|one| (one.launches, one.pooled)).collect();
        for (index, one) in all.iter_mut().enumerate().filter(|(_, one)| one.launches > 1) {
            let lends = |(other, (launches, pooled)): (usize, &(usize, Pooled))| {
                (other != index && *launches == one.launches).then_some(*pooled)
            };
            let others: Vec<Pooled> = lenders.iter().enumerate().filter_map(lends).collect();
            one.pooled.borrow(&others);
        }
    }

    /// Returns a point, with the spread of all points that were measured together; `None` if the point has
    /// too few samples.
    pub fn standing(&self, index: usize) -> Option<Standing> {
        let point = self.points.get(index)?.clone()?;
        let between = self.between.get(index).copied().unwrap_or_default();
        let anchor = index.checked_sub(self.points.len() - self.on_processors.len());
        let is_anchor_on_processors = anchor.is_some_and(|anchor| self.on_processors[anchor]);
        let (launches, pooled) = (self.launches, self.pooled);
        Some(Standing { launches, point, points: 1, is_anchor_on_processors, between, pooled })
    }

    /// Returns the median of a point's samples in milliseconds, with its 95% interval; `None` if the point
    /// has too few samples.
    pub fn median_ms(&self, point: usize) -> Option<Interval> {
        Some(self.standing(point)?.median_ms())
    }

    /// Returns the relative difference (0.03 is 3%) above which two points of typical spread can be
    /// distinguished; `None` if fewer than two points have enough samples.
    pub fn resolution(&self) -> Option<f64> {
        resolution(&self.pooled, self.between.first().copied().unwrap_or_default())
    }
}

fn resolution(pooled: &Pooled, between: BetweenRuns) -> Option<f64> {
    let between = between.of_ratio(between, [1, 1]);
    Some(Error::of_sum([pooled.usual()?, between]).reach(interval::RISK).exp_m1())
}

/// Returns the samples of each launch that is not ignored ([`Paired::of`] says which launches are ignored).
fn launches(samples: &[PairedSample], points: usize) -> Vec<Vec<PairedSample>> {
    let mut launches: BTreeMap<u32, Vec<PairedSample>> = BTreeMap::new();
    for sample in samples {
        launches.entry(sample.launch).or_default().push(*sample);
    }
    let is_finished =
        |launch: &Vec<PairedSample>| counts(launch, points).iter().any(|count| *count >= MIN_SAMPLES);
    launches.into_values().filter(is_finished).collect()
}

/// Returns the points whose values show how much times vary: the typical points or, if fewer than two typical
/// points have enough samples, all points. The anchors (work that is timed for comparison) are not among
/// these points.
fn rows<'a>(points: &'a [Option<Point>], are_typical: &[bool]) -> Vec<&'a Point> {
    let with = |untypical: bool| -> Vec<&'a Point> {
        let each = points.iter().zip(are_typical);
        each.filter(|(_, is_typical)| **is_typical || untypical)
            .filter_map(|(point, _)| point.as_ref())
            .collect()
    };
    let typical = with(false);
    if typical.len() < 2 { with(true) } else { typical }
}

/// Returns the number of samples of each point in a launch.
fn counts(launch: &[PairedSample], points: usize) -> Vec<usize> {
    let mut counts = vec![0; points];
    for sample in launch {
        counts[sample.point] += 1;
    }
    counts
}

/// Returns the point with the index `index`; `None` if the point has no samples. For each launch and point,
/// `plain` has the logarithms of the point's samples, and `relative` has the same logarithms minus the drift.
fn point(index: usize, plain: &[Vec<Vec<f64>>], relative: &[Vec<Vec<f64>>]) -> Option<Point> {
    let own = |launches: &[Vec<Vec<f64>>]| -> Vec<Vec<f64>> {
        launches.iter().map(|points| points[index].clone()).collect()
    };
    let (plain, relative) = (own(plain), own(relative));
    let median = log_of_median(&plain.concat())?;
    Some(Point { median, plain: repeats(&plain), relative: repeats(&relative) })
}

/// Returns the logarithm of the median time of samples; `logs` has the logarithms of their times. Of an even
/// number of samples, the median time is halfway between the middle two times, as in all outputs of raycl.
/// The median of the logarithms cannot be used: it is the logarithm of the geometric mean of the middle two
/// times, which is less if these two times differ. Returns `None` if `logs` is empty.
fn log_of_median(logs: &[f64]) -> Option<f64> {
    let middle = median_of(logs)?;
    let relative: Vec<f64> = logs.iter().map(|log| (log - middle).exp()).collect();
    Some(middle + median_of(&relative)?.ln())
}

/// Returns the median of each launch's values. If there is a single launch, returns the median of each of its
/// [`PARTS`] parts.
fn repeats(launches: &[Vec<f64>]) -> Vec<f64> {
    match launches {
        [only] => {
            let end = |part: usize| part * only.len() / PARTS;
            (0..PARTS).filter_map(|part| median_of(&only[end(part)..end(part + 1)])).collect()
        }
        several => several.iter().filter_map(|values| median_of(values)).collect(),
    }
}
