//! Points compared by samples that were taken close in time, over several launches of the program.
//!
//! Two things make the plain interval of a median too narrow. A machine changes speed for seconds at a time, so samples
//! are not independent; and what a launch draws once (addresses, placement of threads, the kernel's binary) no sample of
//! that launch can show. So, after Kalibera and Jones, "Rigorous Benchmarking in Reasonable Time" (ISMM 2013), the launch is
//! what is repeated: each gives one value per point, and intervals come from how far these lie apart. What happens within a
//! launch, autocorrelation included, is in that spread, and needs no model.
//!
//! 1. In each launch the drift that all points share is taken away ([`drift`]), and a point's value is the median of what
//!    is left: a paired design, for which samples of different points must be interleaved.
//! 2. The table of points and launches is split into point, launch and the rest (two-way analysis of variance). Three launches
//!    tell a pair's own spread poorly (two degrees of freedom), so it is weighted with that of all points, which
//!    counts as six more at most (a moderated variance, after Smyth 2004), and Student's t makes the interval ([`spread`]).
//! 3. The interval of a median keeps what launches do to all points alike, which pairs cancel: its t has one degree less than
//!    there are launches.
//!
//! With a single launch, five stretches of time stand for launches. Such a run is a look: its intervals do not include
//! differences between launches.

mod drift;
mod error;
mod interval;
mod sample;
#[cfg(test)]
mod simulation;
mod spread;
#[cfg(test)]
mod tests;

pub use interval::Interval;
pub use sample::PairedSample;

use super::summary::median_of;
use super::{MIN_SAMPLES, Ranking};
use error::Error;
use interval::interval;
use spread::Pooled;

/// Stretches of time that a single launch is split into: every point has as many samples at least.
const STRETCHES: usize = MIN_SAMPLES;

/// What the samples of points that were measured together tell of each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Paired {
    launches: usize,
    /// None for a point of too few samples.
    points: Vec<Option<Point>>,
    pooled: Pooled,
}

/// What a point took, in logarithms of milliseconds; a value per launch.
#[derive(Clone, Debug, PartialEq)]
struct Point {
    /// The median over all launches.
    median: f64,
    /// Each launch's median.
    plain: Vec<f64>,
    /// Each launch's median without drift.
    relative: Vec<f64>,
}

/// A point among those that were measured with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Standing {
    launches: usize,
    point: Point,
    /// Points that it is the mean of.
    points: usize,
    pooled: Pooled,
}

impl Standing {
    /// Launches that it rests on.
    pub fn launches(&self) -> usize {
        self.launches
    }

    /// The median over all samples, in milliseconds.
    pub fn median_ms(&self) -> Interval {
        interval(self.point.median, self.pooled.of_level(&self.point.plain))
    }

    /// What ranks it: the logarithm of its time without drift.
    pub fn level(&self) -> f64 {
        self.point.level()
    }

    /// How many times as long as `other` it takes, by samples close in time. Both were measured together.
    pub fn ratio(&self, other: &Self) -> Interval {
        let pairs = self.point.relative.iter().zip(&other.point.relative);
        let differences: Vec<f64> = pairs.map(|(own, other)| own - other).collect();
        interval(
            self.level() - other.level(),
            self.pooled.of_difference(&differences, [self.points, other.points]),
        )
    }

    /// The same of one that was measured at another time: what the machine did meanwhile is in it.
    pub fn ratio_apart(&self, other: &Self) -> Interval {
        let error = |standing: &Self| standing.pooled.of_level(&standing.point.plain);
        interval(self.point.median - other.point.median, Error::of_sum([error(self), error(other)]))
    }

    /// The mean of points that were measured together; none of none.
    pub fn mean(points: &[&Self]) -> Option<Self> {
        let first = *points.first()?;
        let mean =
            |of: &dyn Fn(&Self) -> f64| points.iter().map(|one| of(one)).sum::<f64>() / points.len() as f64;
        let each = |of: fn(&Point) -> &Vec<f64>| {
            (0..of(&first.point).len()).map(|place| mean(&|one| of(&one.point)[place])).collect()
        };
        let point = Point {
            median: mean(&|one| one.point.median),
            plain: each(|point| &point.plain),
            relative: each(|point| &point.relative),
        };
        Some(Self { point, points: points.iter().map(|one| one.points).sum(), ..first.clone() })
    }

    /// As [`Paired::resolution`].
    pub fn resolution(&self) -> Option<f64> {
        self.pooled.usual().map(|error| error.reach(interval::RISK).exp_m1())
    }
}

impl Point {
    fn level(&self) -> f64 {
        self.relative.iter().sum::<f64>() / self.relative.len() as f64
    }
}

impl Paired {
    /// Compares `points` points by their samples, each launch's in the order taken. Skips samples that are not a time.
    ///
    /// A point with fewer than [`MIN_SAMPLES`] in one of the launches has too few. A launch in which all have too few, such as
    /// one that was interrupted, does not count.
    pub fn of(samples: &[PairedSample], points: usize) -> Self {
        let fine = |sample: &&PairedSample| sample.point < points && sample.ms.is_finite() && sample.ms > 0.0;
        let samples: Vec<PairedSample> = samples.iter().filter(fine).copied().collect();
        let launches = launches(&samples, points);
        let enough = |point: &usize| launches.iter().all(|launch| count(launch, *point) >= MIN_SAMPLES);
        let enough: Vec<bool> = (0..points).map(|point| !launches.is_empty() && enough(&point)).collect();
        let launches: Vec<Vec<PairedSample>> = launches
            .into_iter()
            .map(|launch| launch.into_iter().filter(|sample| enough[sample.point]).collect())
            .collect();
        let left: Vec<Vec<f64>> =
            launches.iter().map(|launch| drift::without_drift(launch, points)).collect();
        let points: Vec<_> = enough
            .iter()
            .enumerate()
            .map(|(place, enough)| enough.then(|| point(place, &launches, &left)).flatten())
            .collect();
        let known = || points.iter().flatten();
        let relative: Vec<&[f64]> = known().map(|point| point.relative.as_slice()).collect();
        let plain: Vec<&[f64]> = known().map(|point| point.plain.as_slice()).collect();
        let pooled = Pooled::of(&relative, &plain);
        Self { launches: launches.len(), points, pooled }
    }

    /// Lets tables of one machine, of the same run, learn from each other how far launches lie apart.
    pub fn borrow_from_each_other(all: &mut [Self]) {
        let pooled: Vec<Pooled> = all.iter().map(|one| one.pooled).collect();
        for (place, one) in all.iter_mut().enumerate() {
            let has_as_many = |other: &usize| *other != place && pooled[*other].has_repeats_as(&one.pooled);
            let others: Vec<Pooled> =
                (0..pooled.len()).filter(has_as_many).map(|other| pooled[other]).collect();
            one.pooled.borrow(&others);
        }
    }

    /// Launches that count. Of one, intervals do not hold what another would draw.
    pub fn launches(&self) -> usize {
        self.launches
    }

    /// A point among the others; none of too few samples.
    pub fn standing(&self, point: usize) -> Option<Standing> {
        let point = self.points.get(point)?.clone()?;
        Some(Standing { launches: self.launches, point, points: 1, pooled: self.pooled })
    }

    /// A point's median over all samples, in milliseconds; none of too few samples.
    pub fn median_ms(&self, point: usize) -> Option<Interval> {
        Some(self.standing(point)?.median_ms())
    }

    /// How many times as long as `other` a point takes, by samples close in time; none where one has too few.
    pub fn ratio(&self, point: usize, other: usize) -> Option<Interval> {
        let (one, two) = (self.standing(point)?, self.standing(other)?);
        Some(if point == other { interval(0.0, Error::NONE) } else { one.ratio(&two) })
    }

    /// The difference that two points of usual spread must exceed to be told apart, as a part (0.03 is 3%); none where there
    /// are no two points of enough samples.
    pub fn resolution(&self) -> Option<f64> {
        self.pooled.usual().map(|error| error.reach(interval::RISK).exp_m1())
    }

    /// Who wins: the point of the least level, and every other that is not surely slower by more than `resolution`, a part.
    pub fn ranking(&self, resolution: f64) -> Ranking<usize> {
        let level = |place: usize| self.points[place].as_ref().map(Point::level);
        let ties = |place: usize, best: usize| {
            self.ratio(place, best).is_some_and(|ratio| ratio.low <= 1.0 + resolution)
        };
        Ranking::by((0..self.points.len()).map(|place| (place, level(place))), ties)
    }
}

/// The samples of each launch that counts.
fn launches(samples: &[PairedSample], points: usize) -> Vec<Vec<PairedSample>> {
    let mut numbers: Vec<u32> = samples.iter().map(|sample| sample.launch).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let of = |number: u32| samples.iter().filter(|sample| sample.launch == number).copied().collect();
    let counts = |launch: &Vec<PairedSample>| (0..points).any(|point| count(launch, point) >= MIN_SAMPLES);
    numbers.into_iter().map(of).filter(counts).collect()
}

fn count(launch: &[PairedSample], point: usize) -> usize {
    launch.iter().filter(|sample| sample.point == point).count()
}

/// A point's values: one per launch, or one per stretch of the only launch.
fn point(place: usize, launches: &[Vec<PairedSample>], left: &[Vec<f64>]) -> Option<Point> {
    let is_own = |sample: &PairedSample| sample.point == place;
    let plain: Vec<Vec<f64>> = launches
        .iter()
        .map(|launch| launch.iter().filter(|sample| is_own(sample)).map(|sample| sample.ms.ln()).collect())
        .collect();
    let relative: Vec<Vec<f64>> = launches
        .iter()
        .zip(left)
        .map(|(launch, left)| {
            launch.iter().zip(left).filter(|(sample, _)| is_own(sample)).map(|(_, left)| *left).collect()
        })
        .collect();
    let median = median_of(&plain.concat())?;
    Some(Point { median, plain: repeats(&plain), relative: repeats(&relative) })
}

/// The median of each launch's values, or of each stretch of the only launch.
fn repeats(launches: &[Vec<f64>]) -> Vec<f64> {
    match launches {
        [only] => {
            let end = |stretch: usize| stretch * only.len() / STRETCHES;
            (0..STRETCHES).filter_map(|stretch| median_of(&only[end(stretch)..end(stretch + 1)])).collect()
        }
        several => several.iter().filter_map(|values| median_of(values)).collect(),
    }
}
