//! Finds regressions: slowdowns that are statistically significant. The tests cover each single point, the mean of each
//! strategy's points, and the mean of all points. The means detect small slowdowns of many points even if no single
//! slowdown is significant, for example after a change to a file that all strategies share.

use super::Comparison;
use super::pair::{Against, Pair, percent, strategy};
use crate::measure::{Interval, quantile};
use crate::record::{Record, anchored_mean, are_together, ratio_of_means};

/// The largest probability that a comparison of two runs of the same program reports a regression.
const RISK: f64 = 0.02;

/// Returns one line per slowdown that surely exceeds `limit_percent`, and one line per point that was measured before
/// and fails now. The permitted probability of a false report (`RISK`) is divided into three equal parts: for the mean
/// of all points, for the strategies' means, and for the single points.
pub fn regressions(comparison: &Comparison, limit_percent: f64) -> Vec<String> {
    let limit = 1.0 + limit_percent / 100.0;
    let slower = |what: &str, change: Interval, tests: usize| {
        let sure = change.surely_above(RISK / 3.0 / tests as f64);
        let [middle, sure_percent] = [change.middle, sure].map(percent);
        (sure > limit).then(|| format!("{what} {middle:.1}% slower (at least {sure_percent:.1}%)"))
    };
    let kernels: Vec<&Pair> =
        comparison.pairs.iter().filter(|pair| pair.change.is_some() && !pair.before.is_baseline()).collect();
    let together = change_of(&kernels).and_then(|change| slower("all points together are", change, 1));
    let strategies = by_strategy(&kernels);
    let of_strategies = strategies.iter().filter_map(|(name, pairs)| {
        slower(&format!("{name} at its {} points is", pairs.len()), change_of(pairs)?, strategies.len())
    });
    let judged = comparison.pairs.iter().filter_map(|pair| Some((pair, pair.change?.0))).collect::<Vec<_>>();
    let several = comparison.has_several_devices();
    let of_points = judged
        .iter()
        .filter(|(pair, change)| change_of_fastest(pair, *change) > limit)
        .filter_map(|(pair, change)| slower(&format!("{} is", pair.point(several)), *change, judged.len()));
    together
        .into_iter()
        .chain(of_strategies)
        .chain(of_points)
        .chain(comparison.broken.iter().cloned())
        .collect()
}

/// Returns the factor by which the 10% quantile of a point's samples changed. Like the change of the median, this
/// factor is relative to other measurements (see [`Against`]). If a program is slower, all its samples take longer. But
/// if only the machine was slower for most of the run, the fastest samples take as long as before.
fn change_of_fastest(pair: &Pair, change: Interval) -> f64 {
    let (before, after) = (spread(&pair.before), spread(&pair.after));
    let [Some(before), Some(after)] = [before, after] else { return change.middle };
    change.middle * after / before
}

/// Returns the 10% quantile of a record's samples as a fraction of their median; `None` without
/// samples.
fn spread(record: &Record) -> Option<f64> {
    let mut sorted = record.samples_ms.clone();
    sorted.sort_by(f64::total_cmp);
    let at = |part: f64| quantile(&sorted, part);
    (!sorted.is_empty()).then(|| at(0.1) / at(0.5))
}

/// Groups the compared points by strategy; strategies with a single point are left out.
fn by_strategy<'a>(kernels: &[&'a Pair]) -> Vec<(&'a str, Vec<&'a Pair>)> {
    let mut strategies: Vec<(&str, Vec<&Pair>)> = Vec::new();
    for &pair in kernels {
        let own = strategy(&pair.before);
        match strategies.iter_mut().find(|(name, _)| *name == own) {
            Some((_, pairs)) => pairs.push(pair),
            None => strategies.push((own, vec![pair])),
        }
    }
    strategies.retain(|(_, pairs)| pairs.len() > 1);
    strategies
}

/// Returns the mean change of some points: first the change of each group of points that were measured together, then
/// the mean over the groups. Returns `None` if the change of any group is unknown. The change of a group is known only
/// if it is relative to an anchor, or if it compares times from the same rounds.
fn change_of(pairs: &[&Pair]) -> Option<Interval> {
    let mut groups: Vec<Vec<&Pair>> = Vec::new();
    for &pair in pairs {
        let is_beside = |group: &Vec<&Pair>| {
            are_together(&group[0].before, &pair.before)
                && are_together(&group[0].after, &pair.after)
                && group[0].before.device == pair.before.device
        };
        match groups.iter_mut().find(|group| is_beside(group)) {
            Some(group) => group.push(pair),
            None => groups.push(vec![pair]),
        }
    }
    let changes: Option<Vec<Interval>> = groups.iter().map(|group| change_of_group(group)).collect();
    Interval::mean(&changes?)
}

fn change_of_group(group: &[&Pair]) -> Option<Interval> {
    let (_, against) = group.first()?.change?;
    let before: Vec<_> = group.iter().map(|pair| &pair.before).collect();
    let after: Vec<_> = group.iter().map(|pair| &pair.after).collect();
    match against {
        Against::SameRounds => ratio_of_means(&after, &before),
        Against::Anchor => Some(anchored_mean(&after)?.over(anchored_mean(&before)?)),
        _ => None,
    }
}
