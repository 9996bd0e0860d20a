//! Finds regressions: slowdowns that are statistically significant. The tests are of each single point, of
//! the mean of each strategy's points, and of the mean of all points except baselines. A mean shows a small slowdown of
//! many points even if no single slowdown is significant, for example after a change to a file that all strategies
//! share.

use super::Comparison;
use super::change::References;
use super::pair::{Against, Both, Pair, percent, strategy};
use crate::entry::entry;
use crate::measure::{Interval, Relative, quantile};
use crate::record::{
    Record, anchored_mean, are_together, mean_relative_to, mean_relative_to_earlier, ratio_of_means,
    unshared_delay,
};

/// The largest probability with which a comparison of two runs of the same program should report a regression. (With
/// two launches, the actual probability is up to twice as large.)
const RISK: f64 = 0.02;

/// Returns one line per slowdown that exceeds `limit_percent` with the certainty that `RISK` demands. A
/// single point is listed only if its fastest samples also became slower by more than `limit_percent` (see
/// [`change_of_fastest`]). A further line follows for each point that was measured in the first folder and
/// has another outcome in the second folder, such as `infeasible` or `wrong-image`. The permitted probability
/// of a false report (`RISK`) is divided into three equal parts: for the mean of all points, for the
/// strategies' means, and for the single points.
pub fn regressions(comparison: &Comparison, limit_percent: f64) -> Vec<String> {
    let limit = 1.0 + limit_percent / 100.0;
    let slower = |what: &str, change: Interval, tests: usize| {
        let sure = change.surely_above(RISK / 3.0 / tests as f64);
        let [middle, sure_percent] = [change.middle, sure].map(percent);
        (sure > limit).then(|| format!("{what} {middle:.1}% slower (at least {sure_percent:.1}%)"))
    };
    let means = means(comparison);
    let strategies = means.iter().filter(|mean| mean.strategy.is_some() && mean.change.is_some()).count();
    let of_means = means.iter().filter_map(|mean| match mean.strategy {
        None => slower("all points together are", mean.change?, 1),
        Some(name) => slower(&format!("{name} at its {} points is", mean.tested), mean.change?, strategies),
    });
    let judged = comparison.pairs.iter().filter_map(|pair| Some((pair, pair.change?.0))).collect::<Vec<_>>();
    let several = comparison.has_several_devices();
    let of_points = judged
        .iter()
        .filter(|(pair, change)| change_of_fastest(pair, *change) > limit)
        .filter_map(|(pair, change)| slower(&format!("{} is", pair.point(several)), *change, judged.len()));
    of_means.chain(of_points).chain(comparison.broken.iter().cloned()).collect()
}

/// Returns a note on the means from which points are left out. [`regressions`] tests these means without the
/// left-out points, or not at all. Returns `None` if every mean includes all of its points.
pub fn left_out(comparison: &Comparison) -> Option<String> {
    let means = means(comparison);
    let lacking: Vec<&Mean<'_>> = means.iter().filter(|mean| mean.tested < mean.points).collect();
    let name = |mean: &&Mean<'_>| {
        let (name, count) = (mean.strategy.unwrap_or("all points together"), mean.points - mean.tested);
        format!("{name} (without {count} of {} points)", mean.points)
    };
    let why = match lacking.iter().all(|mean| mean.lacks_only_in_common) {
        true => ONLY_IN_COMMON,
        false => WHY_LEFT_OUT,
    };
    (!lacking.is_empty()).then(|| {
        format!(
            "`--fail-on-regression` cannot test these mean changes, or can test them only without some points: \
             {}. {why}",
            lacking.iter().map(name).collect::<Vec<_>>().join(", ")
        )
    })
}

/// The reason why means leave out points if the change of each of these points is known.
const ONLY_IN_COMMON: &str = "These points are left out because they are compared only with each other, so a change that \
                              all of them share cannot be detected.";
/// The reasons why means may leave out points.
const WHY_LEFT_OUT: &str = "A point is left out if it has too few samples, if its times are below the timer's \
                            resolution, or if no other work of the same rounds shows how much the machine's speed \
                            changed. Such work is the anchor kernel or baselines. Kernels that are not part of the \
                            mean are such work only if they belong to a majority of the device's kernels that \
                            changed by similar factors.";

/// Returns the factor by which the 10% quantile of a point's samples changed. Like the change of the median, the change
/// of the 10% quantile is relative to other measurements (see [`Against`]). If the program became slower, usually all
/// samples take longer, including the fastest. If the program is as fast as before, but the machine was slow for most
/// of the run, the fastest samples usually take as long as in the first run. If a record has no samples, the function
/// returns the change of the median.
fn change_of_fastest(pair: &Pair, change: Interval) -> f64 {
    let (before, after) = (spread(&pair.before), spread(&pair.after));
    let [Some(before), Some(after)] = [before, after] else { return change.middle };
    change.middle * after / before
}

/// Returns the 10% quantile of a record's samples as a fraction of their median; `None` if the record has no
/// samples.
fn spread(record: &Record) -> Option<f64> {
    let mut sorted = record.samples_ms.clone();
    sorted.sort_by(f64::total_cmp);
    let at = |part: f64| quantile(&sorted, part);
    (!sorted.is_empty()).then(|| at(0.1) / at(0.5))
}

/// The mean change of all points, or of a strategy's points.
struct Mean<'a> {
    /// The points' strategy; `None` for all points.
    strategy: Option<&'a str>,
    /// Number of points, including those that the mean leaves out.
    points: usize,
    /// Number of points that the mean includes.
    tested: usize,
    /// True if each point that the mean leaves out was compared only with other points of the mean
    /// ([`Against::PointsInCommon`]).
    lacks_only_in_common: bool,
    /// The mean change; `None` if too few points can be included: none at all or, for a strategy, only one. A
    /// single point is tested separately.
    change: Option<Interval>,
}

/// Returns the mean change of all points except baselines, followed by the mean change of each strategy with
/// several points.
fn means(comparison: &Comparison) -> Vec<Mean<'_>> {
    let kernels: Vec<&Pair> = comparison.pairs.iter().filter(|pair| !pair.before.is_baseline()).collect();
    let strategies = by_strategy(&kernels);
    let references = References::among(&comparison.measured());
    let whole = mean(None, &kernels, comparison, &references);
    let each = strategies.iter().map(|(name, pairs)| mean(Some(*name), pairs, comparison, &references));
    std::iter::once(whole).chain(each).collect()
}

/// Groups the compared points by strategy, and leaves out strategies with a single point.
fn by_strategy<'a>(kernels: &[&'a Pair]) -> Vec<(&'a str, Vec<&'a Pair>)> {
    let mut strategies: Vec<(&str, Vec<&Pair>)> = Vec::new();
    for &pair in kernels {
        let own = strategy(pair.both());
        entry(&mut strategies, |(name, _)| *name == own, || (own, Vec::new())).1.push(pair);
    }
    strategies.retain(|(_, pairs)| pairs.len() > 1);
    strategies
}

/// Returns the mean change of some points: first the change of each group of points that were measured together, then
/// the mean over the groups. Groups whose change is unknown are left out.
fn mean<'a>(
    strategy: Option<&'a str>,
    pairs: &[&'a Pair],
    comparison: &'a Comparison,
    references: &References<'a>,
) -> Mean<'a> {
    let mut groups: Vec<Vec<&Pair>> = Vec::new();
    for &pair in pairs.iter().filter(|pair| pair.change.is_some()) {
        let is_beside = |group: &Vec<&Pair>| {
            are_together(&group[0].before, &pair.before)
                && are_together(&group[0].after, &pair.after)
                && group[0].before.device == pair.before.device
        };
        entry(&mut groups, is_beside, Vec::new).push(pair);
    }
    let is_own = |both: &Both<'_>| {
        !both.0.is_baseline() && strategy.is_none_or(|own| own == super::pair::strategy(*both))
    };
    let controls: Vec<Both<'a>> = comparison.controls().filter(is_own).collect();
    let known = |group: &Vec<&'a Pair>| Some((group.len(), change_of_group(group, &controls, references)?));
    let (sizes, changes): (Vec<usize>, Vec<Relative>) = groups.iter().filter_map(known).unzip();
    let least = if strategy.is_some() { 2 } else { 1 };
    let sum: usize = sizes.iter().sum();
    let change = Relative::mean(&changes).filter(|_| sum >= least);
    let tested = if change.is_some() { sum } else { 0 };
    let is_in_common = |group: &Vec<&'a Pair>| matches!(group[0].change, Some((_, Against::PointsInCommon)));
    let left_out = groups.iter().filter(|&group| is_in_common(group) && known(group).is_none());
    let lacks_only_in_common = left_out.map(Vec::len).sum::<usize>() == pairs.len() - tested;
    Mean { strategy, points: pairs.len(), tested, lacks_only_in_common, change }
}

/// Returns the mean change of points that were measured together on one device. Returns `None` if the points' times
/// must be divided by the times of other work (references), but there are no references. Without an anchor and
/// without baselines, only kernels that are not part of the mean can be references, so the mean of all points has no
/// references. `controls` contains the borrowed control points of the mean's strategy or, for the mean of all
/// points, of all strategies. (A block borrows a control point if it measures the point although the point belongs
/// to another block.) Neither these control points nor the points of `group` can be references.
fn change_of_group<'a>(
    group: &[&'a Pair],
    controls: &[Both<'a>],
    references: &References<'a>,
) -> Option<Relative> {
    let (_, against) = group.first()?.change?;
    let points: Vec<Both<'a>> = group.iter().map(|pair| pair.both()).collect();
    let (before, after): (Vec<&Record>, Vec<&Record>) = points.iter().copied().unzip();
    match against {
        Against::SameRounds => ratio_of_means(&after, &before).map(Relative::alone),
        Against::BareTimes => mean_relative_to_earlier(&after, &before),
        Against::Anchor => {
            let change = anchored_mean(&after)?.over(anchored_mean(&before)?);
            // A point's delay is the logarithm of the factor by which other programs may have made the
            // point's change too large. The delay of one point changes the logarithm of the mean by the delay
            // divided by the number of points. Positive and negative delays both widen the interval, so they
            // must not cancel in a sum. For this reason, the delays of the points are applied one after
            // another.
            let delay_of = |(before, after): &Both<'_>| unshared_delay(before, after) / points.len() as f64;
            Some(points.iter().map(delay_of).fold(change, Relative::over_up_to))
        }
        Against::Baselines | Against::PointsInCommon => {
            let (references, _) = references.of(&[&points[..], controls].concat())?;
            let (first, second): (Vec<&Record>, Vec<&Record>) = references.into_iter().unzip();
            Some(mean_relative_to(&after, &second)?.over(mean_relative_to(&before, &first)?))
        }
    }
}
