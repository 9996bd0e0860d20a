//! Tests whose expected results were calculated without the tested code.

use super::*;
use crate::measure::Ranking;

/// Methods for the tests in this file and for the simulation of machines (`simulation.rs`). The methods
/// identify points by their indices; raycl itself compares records (`record::ratios`, `record::ranking`).
impl Paired {
    /// Returns the number of launches in which at least one point has enough samples.
    fn launches(&self) -> usize {
        self.launches
    }

    /// Returns the ratio of a point's time to that of `other`; `None` if one of them has too few samples.
    pub(super) fn ratio(&self, point: usize, other: usize) -> Option<Interval> {
        Some(self.standing(point)?.ratio(&self.standing(other)?))
    }

    /// Returns the fastest point and all points that tie with it. A point ties if the lower end of the 95% interval of
    /// its ratio to the fastest point is at most 1 + `resolution`.
    pub(super) fn ranking(&self, resolution: f64) -> Ranking<usize> {
        let level = |point: usize| self.points[point].as_ref().map(Point::level);
        let ties = |point: usize, best: usize| {
            point == best || self.ratio(point, best).is_some_and(|ratio| ratio.low <= 1.0 + resolution)
        };
        Ranking::by((0..self.points.len()).map(|point| (point, level(point))), ties)
    }
}

/// Returns samples of several launches, for points that take 1, 2, 3, ... ms and, in two of three rounds, slightly
/// more.
fn steady(points: usize, launches: u32, rounds: usize) -> Vec<PairedSample> {
    let mut samples = Vec::new();
    for launch in 0..launches {
        for round in 0..rounds {
            for point in 0..points {
                let wobble = 1.0 + 0.001 * ((round + point + launch as usize) % 3) as f64;
                samples.push(PairedSample { point, launch, ms: (point + 1) as f64 * wobble });
            }
        }
    }
    samples
}

#[test]
fn medians_and_ratios_of_steady_points_are_found() {
    let paired = Paired::of(&steady(4, 3, 9), 4);
    assert_eq!(paired.launches(), 3);
    let ratio = paired.ratio(3, 1).expect("enough samples");
    assert!((ratio.middle - 2.0).abs() < 1e-3 && ratio.high / ratio.low < 1.01, "{ratio:?}");
    let median = paired.median_ms(2).expect("enough samples");
    assert!((median.middle - 3.003).abs() < 1e-9 && median.low <= 3.003, "{median:?}");
    assert!(paired.resolution().is_some_and(|part| part < 0.01), "{:?}", paired.resolution());
    assert_eq!(paired.ranking(0.0).winners, [0]);
}

#[test]
fn a_slow_launch_and_a_slow_hour_are_no_difference() {
    let mut samples = steady(3, 3, 9);
    for (index, sample) in samples.iter_mut().enumerate() {
        let launch = if sample.launch == 1 { 1.3 } else { 1.0 };
        sample.ms *= launch * if (40..70).contains(&index) { 1.7 } else { 1.0 };
    }
    let paired = Paired::of(&samples, 3);
    let ratio = paired.ratio(1, 0).expect("enough samples");
    assert!((ratio.middle - 2.0).abs() < 0.01 && ratio.high / ratio.low < 1.05, "{ratio:?}");
    let median = paired.median_ms(0).expect("enough samples");
    assert!(median.high / median.low > 1.3, "the medians of launches lie apart: {median:?}");
}

/// Half of the samples take 1 ms and half 3 ms, so the median is 2 ms. The median must not be computed as 1.73 ms, the
/// geometric mean of 1 and 3 ms.
#[test]
fn the_median_of_an_even_number_of_samples_lies_in_its_own_interval() {
    let launch = |launch: u32| [1.0, 3.0, 1.0, 3.0, 1.0, 3.0].map(|ms| PairedSample { point: 0, launch, ms });
    let samples = (0..4).map(launch).collect::<Vec<_>>().concat();
    let median = Paired::of(&samples, 1).median_ms(0).expect("enough samples");
    assert!((median.middle - 2.0).abs() < 1e-12, "{median:?}");
    assert!(median.low <= median.middle && median.middle <= median.high, "{median:?}");
}

#[test]
fn apart_the_medians_of_all_samples_are_compared() {
    // Two of the three launches are slow. The median of all samples is therefore a time of the slow launches.
    // The mean of the three launches' medians would be less than the median of all samples.
    let mut slow = steady(2, 3, 9);
    slow.iter_mut().filter(|sample| sample.launch > 0).for_each(|sample| sample.ms *= 4.0);
    let standing = |samples: &[PairedSample]| Paired::of(samples, 2).standing(0).expect("enough samples");
    let ratio = standing(&slow).ratio_apart(&standing(&steady(2, 3, 9)));
    assert!((ratio.middle - 4.0).abs() < 0.01, "{ratio:?}");
}

#[test]
fn apart_the_interval_has_the_spread_of_both() {
    let mut unsteady = steady(2, 3, 9);
    unsteady.iter_mut().filter(|sample| sample.launch > 0).for_each(|sample| sample.ms *= 4.0);
    let standing = |samples: &[PairedSample]| Paired::of(samples, 2).standing(0).expect("enough samples");
    let (unsteady, even) = (standing(&unsteady), standing(&steady(2, 3, 9)));
    // The standard error of the logarithm is ln(4) / 3, and Student's t is 4.303. The interval of the
    // logarithm extends by their product to each side. The upper end of the ratio's interval is therefore 53
    // times the lower end.
    for ratio in [unsteady.ratio_apart(&even), even.ratio_apart(&unsteady)] {
        assert!((ratio.high / ratio.low - 53.3).abs() < 1.0, "{ratio:?}");
    }
    let (one, both) = (unsteady.ratio_apart(&even), unsteady.ratio_apart(&unsteady));
    assert!((both.error / one.error - 2.0_f64.sqrt()).abs() < 1e-3, "{one:?} {both:?}");
}

#[test]
fn a_sample_that_took_long_in_each_launch_is_no_difference() {
    let mut samples = steady(4, 3, 9);
    for sample in samples.iter_mut().filter(|sample| sample.point == 3).step_by(9) {
        sample.ms *= 10.0;
    }
    let paired = Paired::of(&samples, 4);
    let ratio = paired.ratio(3, 1).expect("enough samples");
    assert!((ratio.middle - 2.0).abs() < 0.01 && ratio.high / ratio.low < 1.02, "{ratio:?}");
    assert!(paired.median_ms(3).is_some_and(|median| (median.middle - 4.004).abs() < 1e-9));
}

#[test]
fn intervals_that_touch_are_a_tie() {
    let mut samples = steady(3, 3, 9);
    samples.iter_mut().for_each(|sample| sample.ms = if sample.point == 2 { 2.0 } else { 1.0 });
    let paired = Paired::of(&samples, 3);
    assert_eq!(paired.ratio(1, 0).map(|ratio| (ratio.low, ratio.high)), Some((1.0, 1.0)));
    assert_eq!(paired.ranking(0.0).winners, [0, 1]);
}

#[test]
fn a_point_needs_five_samples_in_every_launch() {
    let mut samples = steady(3, 3, 5);
    let last =
        samples.iter().rposition(|sample| sample.point == 1 && sample.launch == 2).expect("it is there");
    samples.remove(last);
    let paired = Paired::of(&samples, 3);
    assert!(paired.median_ms(1).is_none() && paired.ratio(1, 0).is_none() && paired.ratio(0, 1).is_none());
    assert!(paired.ratio(2, 0).is_some());
    assert_eq!(paired.ranking(9.0).unranked, [1]);
    assert!(paired.median_ms(7).is_none());
}

#[test]
fn a_launch_that_was_interrupted_does_not_count() {
    let mut samples = steady(2, 2, 9);
    samples.extend(steady(2, 1, 4).iter().map(|sample| PairedSample { launch: 2, ..*sample }));
    let paired = Paired::of(&samples, 2);
    assert_eq!((paired.launches(), paired.median_ms(0).is_some()), (2, true));
}

#[test]
fn one_launch_gives_a_look_and_no_samples_give_nothing() {
    let look = Paired::of(&steady(3, 1, 5), 3);
    assert_eq!(look.launches(), 1);
    assert!(look.ratio(2, 0).is_some_and(|ratio| ratio.low > 2.8 && ratio.high < 3.2));
    let none = Paired::of(&[], 2);
    assert_eq!((none.launches(), none.median_ms(0), none.resolution()), (0, None, None));
    assert_eq!(none.ranking(0.0).unranked, [0, 1]);
    let alone = Paired::of(&steady(1, 3, 5), 1);
    assert_eq!((alone.resolution(), alone.ranking(0.0).winners), (None, vec![0]));
    assert!(alone.median_ms(0).is_some_and(|median| median.high.is_finite()));
}

#[test]
fn what_is_no_time_is_passed_over() {
    let mut samples = steady(2, 2, 6);
    samples.extend([0.0, -1.0, f64::NAN, f64::INFINITY].map(|ms| PairedSample { point: 0, launch: 0, ms }));
    samples.push(PairedSample { point: 9, launch: 0, ms: 1.0 });
    assert_eq!(Paired::of(&samples, 2), Paired::of(&steady(2, 2, 6), 2));
}

/// Compares points that take 1, 2 and 3 ms. In each of three launches, the times of all points are multiplied
/// by the launch's factor.
fn with_launches(factors: [f64; 3]) -> Paired {
    let sample = |launch: u32, point: usize| PairedSample {
        point,
        launch,
        ms: (point + 1) as f64 * factors[launch as usize],
    };
    let launch = |launch| (0..15).map(move |index| sample(launch, index % 3));
    Paired::of(&(0..3).flat_map(launch).collect::<Vec<_>>(), 3)
}

#[test]
fn differences_between_runs_are_those_of_each_point_and_average_out_in_means() {
    let own = |own: f64| BetweenRuns { shared: 0.0, own };
    let paired = with_launches([1.0; 3]).over_runs(vec![own(0.1), own(0.2), own(0.1)]);
    let [one, two, three] = [0, 1, 2].map(|point| paired.standing(point).unwrap());
    let errors = [&one, &two, &three].map(|point| point.median_ms().error);
    assert!(errors.iter().zip([0.1, 0.2, 0.1]).all(|(error, own)| (error - own).abs() < 1e-9), "{errors:?}");
    let pair = Standing::mean(&[&one, &three]).unwrap();
    // From run to run, each point's time changes by a factor. The mean of two points' factors has half the
    // variance of one factor. In the ratio of this mean to a single point's time, the single point adds the
    // whole variance of its factor.
    for ratio in [pair.ratio(&one), one.ratio(&pair)] {
        assert!((ratio.error - 0.1 * 1.5_f64.sqrt()).abs() < 1e-9, "{ratio:?}");
    }
    assert_eq!(Standing::mean(&[&pair, &two]).unwrap().points, 3);
}

#[test]
fn a_table_alone_has_nothing_to_borrow() {
    let mut alone = [with_launches([1.0, 1.1, 1.3])];
    let before = alone[0].clone();
    Paired::borrow_from_each_other(&mut alone);
    assert_eq!(alone[0], before);
}

/// Five launches and the five parts of a single launch are equally many repeats, but parts do not show how much
/// launches differ.
#[test]
fn a_table_of_one_launch_neither_lends_nor_borrows() {
    let mut tables = [Paired::of(&steady(2, 5, 5), 2), Paired::of(&steady(2, 1, 25), 2)];
    let before = tables.clone();
    Paired::borrow_from_each_other(&mut tables);
    assert_eq!(tables, before);
    let mut looks = [1, 2].map(|points| Paired::of(&steady(points, 1, 25), points));
    let before = looks.clone();
    Paired::borrow_from_each_other(&mut looks);
    assert_eq!(looks, before);
    let mut alike = [2, 3].map(|points| Paired::of(&steady(points, 5, 5), points));
    let before = alike.clone();
    Paired::borrow_from_each_other(&mut alike);
    assert!(alike.iter().zip(&before).all(|(borrowed, alone)| borrowed != alone));
}

#[test]
fn tables_of_different_numbers_of_launches_borrow_nothing_from_each_other() {
    let mut tables = [3, 5].map(|launches| Paired::of(&steady(2, launches, 5), 2));
    let before = tables.clone();
    Paired::borrow_from_each_other(&mut tables);
    assert_eq!(tables, before);
}

#[test]
fn the_factors_of_a_reference_are_kept_apart_from_those_of_the_ratios_points() {
    let (one, other) = (BetweenRuns { shared: 0.3, own: 0.1 }, BetweenRuns { shared: 0.4, own: 0.2 });
    let paired = with_launches([1.0; 3]).over_runs(vec![one, one, other]);
    let [first, second, third] = [0, 1, 2].map(|point| paired.standing(point).unwrap());
    for (reference, common) in [(&second, 0.01), (&third, 0.04 + 0.09 + 0.16)] {
        let (whole, parts) = (first.ratio(reference), first.relative_to(reference));
        assert!((parts.common - common).abs() < 1e-12, "{parts:?}");
        assert!((parts.ratio.error - 0.1).abs() < 1e-9 && parts.ratio.middle == whole.middle, "{parts:?}");
        assert!((parts.ratio.error.powi(2) + common - whole.error.powi(2)).abs() < 1e-9, "{parts:?}");
    }
    // In the mean of two points, the points' own changes from run to run average out, but the changes of the
    // point that serves as reference do not.
    let both = Standing::mean(&[&first, &second]).unwrap().relative_to(&third);
    assert!(
        (both.ratio.error.powi(2) - 0.005).abs() < 1e-9 && (both.common - 0.29).abs() < 1e-12,
        "{both:?}"
    );
    let (whole, parts) = (first.ratio_apart(&third), first.relative_to_earlier(&third));
    assert!((parts.common - 0.25).abs() < 1e-12 && parts.ratio.middle == whole.middle, "{parts:?}");
    assert!((parts.ratio.error.powi(2) + 0.25 - whole.error.powi(2)).abs() < 1e-9, "{parts:?} {whole:?}");
}

#[test]
fn a_launch_counts_once_though_samples_of_another_lie_between_its_own() {
    let sample = |launch: u32| PairedSample { point: 0, launch, ms: 1.0 };
    let samples = [[sample(1); 5], [sample(0); 5], [sample(1); 5]].concat();
    let counts: Vec<usize> = launches(&samples, 1).iter().map(Vec::len).collect();
    assert_eq!(counts, [5, 10]);
}

/// In the second launch, six points take up to 1.02 times as long as in the first, and the anchor (work that
/// is timed for comparison) takes 1.5 times as long.
#[test]
fn the_ratio_to_an_anchor_on_processors_has_the_anchors_own_spread_and_not_that_of_the_points() {
    let mut samples = steady(7, 2, 9);
    for sample in samples.iter_mut().filter(|sample| sample.launch == 1) {
        sample.ms *= if sample.point == 6 { 1.5 } else { 1.0 + 0.01 * (sample.point % 3) as f64 };
    }
    let paired = Paired::with_anchors(&samples, &[true; 6], &[true]);
    let ratio = paired.ratio(0, 6).expect("enough samples");
    // Two launches leave one degree of freedom, and the ratio's error is half of the difference of the two launches.
    let expected = 0.5 * 1.5_f64.ln();
    assert!((ratio.degrees - 1.0).abs() < 1e-9 && (ratio.error - expected).abs() < 1e-3, "{ratio:?}");
    // The spread of the points does not include the spread of the anchor.
    let without: Vec<PairedSample> = samples.iter().filter(|sample| sample.point < 6).copied().collect();
    let alone = Paired::of(&without, 6);
    let [beside, alone] = [&paired, &alone].map(|paired| paired.ratio(3, 0).expect("enough samples"));
    assert!((beside.error / alone.error - 1.0).abs() < 1e-3 && alone.degrees > 1.1, "{beside:?} {alone:?}");
    // An anchor that does not run on processors is compared like a point: the usual spread of points is used
    // for the ratio's error unless the anchor's own spread is far above it.
    let elsewhere = Paired::with_anchors(&samples, &[true; 6], &[false]).ratio(0, 6).expect("enough samples");
    assert!((elsewhere.degrees - 1.0).abs() < 1e-9, "{elsewhere:?}");
    for sample in samples.iter_mut().filter(|sample| sample.point == 6 && sample.launch == 1) {
        sample.ms /= 1.5;
    }
    let steady = Paired::with_anchors(&samples, &[true; 6], &[false]);
    let [to_anchor, to_point] = [6, 3].map(|other| steady.ratio(0, other).expect("enough samples"));
    assert!((to_anchor.degrees - to_point.degrees).abs() < 1e-9, "{to_anchor:?} {to_point:?}");
    assert!(to_anchor.degrees > 1.1, "{to_anchor:?}");
}

/// The time of each of two kernels hardly changes from launch to launch. A third point, which is not typical,
/// takes twice as long in one launch.
#[test]
fn a_point_that_is_not_typical_has_no_part_in_the_usual_spread() {
    let mut samples = steady(3, 3, 9);
    samples.iter_mut().filter(|one| one.point == 2 && one.launch == 1).for_each(|one| one.ms *= 2.0);
    let with = |are_typical: [bool; 3]| Paired::with_anchors(&samples, &are_typical, &[]);
    let resolution = |are_typical: [bool; 3]| with(are_typical).resolution().expect("two points");
    assert!(resolution([true, true, false]) < 0.01, "{}", resolution([true, true, false]));
    assert!(resolution([true, false, true]) > 0.5, "{}", resolution([true, false, true]));
    // A single typical point does not show the usual spread of points, so the spread is estimated from all points.
    assert_eq!(with([true, false, false]), with([true; 3]));
    let ratio = with([true, true, false]).ratio(2, 0).expect("enough samples");
    assert!(ratio.high / ratio.low > 2.0, "{ratio:?}");
}
