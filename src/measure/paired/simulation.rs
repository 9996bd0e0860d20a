//! Simulates machines with known sources of error, to test whether the 95% intervals of one run contain the results of
//! other runs.

use super::*;
use crate::measure::summary::quantile;
use rand::SeedableRng as _;
use rand::{Rng, RngExt as _};
use rand_chacha::ChaCha8Rng;

/// Autocorrelation of samples in neighbouring rounds, as measured with PoCL on two shared cores.
const LAG_1: f64 = 0.55;
const LAUNCHES: u32 = 3;
const ROUNDS: u64 = 20;
const RUNS: u64 = 24;
/// A point ties with the fastest point unless the samples show that the point takes longer by more than the fraction
/// `RESOLUTION`.
const RESOLUTION: f64 = 0.01;

/// The sources of error of a machine: standard deviations of the logarithms of times, and two probabilities.
#[derive(Clone, Copy)]
struct Machine {
    /// By how much the times of all points change together from run to run.
    run: f64,
    /// By how much the time of a single point changes from run to run.
    run_of_point: f64,
    /// By how much the times of all points change together from launch to launch.
    launch: f64,
    /// By how much the time of a single point changes from launch to launch.
    launch_of_point: f64,
    /// Autocorrelated noise of a point's times; every third point has twice as much noise.
    noise: f64,
    /// Probability that a slow phase begins at a sample; a slow phase lasts tens of samples.
    regime: f64,
    /// Probability that a point with a fast and a slow mode is slow in a launch. Every third point has a fast
    /// and a slow mode.
    slow_mode: f64,
}

const MACHINE: Machine = Machine {
    run: 0.027,
    run_of_point: 0.008,
    launch: 0.015,
    launch_of_point: 0.008,
    noise: 0.015,
    regime: 0.005,
    slow_mode: 0.0,
};

/// A machine on which another process keeps one of two cores busy for half of the time. The simulation
/// imitates the other process by phases in which all points are slow. Outside of slow phases, one sample in a
/// hundred begins such a phase. A slow phase makes about 30 samples take about 1.7 times as long, so frames
/// take a sixth longer on average.
const DISTURBED: Machine = Machine { regime: 0.01, ..MACHINE };

/// A machine on which a third of the points run at one of two speeds, as measured with PoCL for points whose work-items
/// all take their working vectors from one heap (docs/log.md, 2026-11-24).
const BIMODAL: Machine = Machine { slow_mode: 0.25, ..MACHINE };
/// The logarithm of the ratio of the slow mode's time to the fast mode's time.
const SLOW_MODE: f64 = 0.4;

fn is_bimodal(point: usize) -> bool {
    point % 3 == 1
}

/// Returns the logarithm of a point's true time. Points form pairs of equal times; each pair is 5% slower than the
/// pair before.
fn level(point: usize) -> f64 {
    0.05 * (point / 2) as f64
}

fn normal(rng: &mut impl Rng) -> f64 {
    // The method of Box and Muller (1958) computes a normally distributed number from two uniformly
    // distributed numbers.
    let (radius, turn): (f64, f64) = (rng.random_range(1e-12..1.0), rng.random_range(0.0..1.0));
    (-2.0 * radius.ln()).sqrt() * (std::f64::consts::TAU * turn).cos()
}

fn run(machine: Machine, points: usize, seed: u64) -> Vec<PairedSample> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut samples = Vec::new();
    let of_run = machine.run * normal(&mut rng);
    let of_points: Vec<f64> = (0..points).map(|_| machine.run_of_point * normal(&mut rng)).collect();
    for launch in 0..LAUNCHES {
        let shared = of_run + machine.launch * normal(&mut rng);
        let of_launch = |of_run: &f64| of_run + machine.launch_of_point * normal(&mut rng);
        let mut own: Vec<f64> = of_points.iter().map(of_launch).collect();
        for (_, own) in own.iter_mut().enumerate().filter(|(point, _)| is_bimodal(*point)) {
            let slow = machine.slow_mode > 0.0 && rng.random_bool(machine.slow_mode);
            *own += if slow { SLOW_MODE } else { 0.0 };
        }
        let mut noise: Vec<f64> = (0..points).map(|_| normal(&mut rng)).collect();
        let (mut slow, mut left) = (0.0, 0);
        for round in 0..ROUNDS {
            for point in crate::measure::round_order(points, round, seed) {
                if left == 0 {
                    slow = 0.0;
                    if rng.random_bool(machine.regime) {
                        (slow, left) = (rng.random_range(1.4_f64..2.0).ln(), rng.random_range(10..50));
                    }
                }
                left = u32::saturating_sub(left, 1);
                noise[point] = LAG_1 * noise[point] + (1.0 - LAG_1 * LAG_1).sqrt() * normal(&mut rng);
                let noise = noise[point] * machine.noise * if point % 3 == 0 { 2.0 } else { 1.0 };
                samples.push(PairedSample {
                    point,
                    launch,
                    ms: (level(point) + shared + own[point] + slow + noise).exp(),
                });
            }
        }
    }
    samples
}

/// How well several runs on one machine agree.
struct Coverage {
    /// The share of a run's intervals that contain the result of another run: for ratios to the first point,
    /// and for medians.
    held: [f64; 2],
    /// The median relative half-width of the intervals: for ratios to the first point, and for medians.
    half: [f64; 2],
    /// Number of pairs of runs whose winners have no point in common.
    disjoint: usize,
    /// The mean number of winners of a run (the fastest point and the points that tie with it).
    winners: f64,
}

fn coverage(machine: Machine, points: usize) -> Coverage {
    let between = || vec![BetweenRuns::ON_PROCESSORS; points];
    let of = |seed| Paired::of(&run(machine, points, seed), points).over_runs(between());
    let runs: Vec<Paired> = (0..RUNS).map(of).collect();
    let ratio = |run: &Paired, point: usize| run.ratio(point, 0).expect("enough samples");
    let median = |run: &Paired, point: usize| run.median_ms(point).expect("enough samples");
    let wins: Vec<Vec<usize>> = runs.iter().map(|run| run.ranking(RESOLUTION).winners).collect();
    let pairs = (0..wins.len()).flat_map(|one| (0..one).map(move |other| (one, other)));
    let disjoint =
        |(one, other): &(usize, usize)| !wins[*one].iter().any(|point| wins[*other].contains(point));
    let (of_ratios, of_medians) = (agreement(&runs, 1..points, ratio), agreement(&runs, 0..points, median));
    Coverage {
        held: [of_ratios.0, of_medians.0],
        half: [of_ratios.1, of_medians.1],
        disjoint: pairs.filter(disjoint).count(),
        winners: wins.iter().map(Vec::len).sum::<usize>() as f64 / wins.len() as f64,
    }
}

/// Returns the share of intervals that contain another run's estimate, and the median of their relative
/// half-widths.
fn agreement<R>(
    runs: &[R],
    points: impl Iterator<Item = usize>,
    interval: impl Fn(&R, usize) -> Interval,
) -> (f64, f64) {
    let (mut held, mut all, mut halves) = (0, 0, Vec::new());
    for point in points {
        let of: Vec<Interval> = runs.iter().map(|run| interval(run, point)).collect();
        halves.extend(of.iter().map(|one| 0.5 * (one.high - one.low) / one.middle));
        for (index, one) in of.iter().enumerate() {
            let others = of.iter().enumerate().filter(|(other, _)| *other != index);
            held += others.filter(|(_, other)| (one.low..=one.high).contains(&other.middle)).count();
            all += of.len() - 1;
        }
    }
    (f64::from(held as u32) / f64::from(all as u32), median_of(&halves).expect("there are points"))
}

fn holds(machine: Machine, points: usize, half: [f64; 2]) {
    let coverage = coverage(machine, points);
    assert!(
        coverage.held.iter().all(|part| *part >= 0.8),
        "too few intervals contain the estimate of another run; the shares are {:?}",
        coverage.held
    );
    assert!(
        coverage.half.iter().zip(half).all(|(actual, bar)| *actual <= bar),
        "half of an interval: {:?}",
        coverage.half
    );
    assert_eq!(coverage.disjoint, 0, "pairs of runs whose winners have nothing in common");
    assert!(coverage.winners <= 4.0, "of {points} points {} win", coverage.winners);
}

#[test]
fn intervals_hold_another_runs_ratios_and_medians() {
    holds(MACHINE, 10, [0.04, 0.08]);
}

#[test]
fn they_do_without_regimes_and_on_a_disturbed_machine_with_twice_the_width() {
    holds(Machine { regime: 0.0, ..MACHINE }, 10, [0.04, 0.08]);
    holds(DISTURBED, 10, [0.08, 0.16]);
}

#[test]
fn they_do_where_a_launch_moves_each_point_for_itself() {
    holds(Machine { launch: 0.0, launch_of_point: 0.02, ..MACHINE }, 10, [0.06, 0.08]);
}

#[test]
fn they_do_of_few_points_and_of_many() {
    holds(MACHINE, 2, [0.08, 0.12]);
    holds(MACHINE, 30, [0.04, 0.08]);
}

/// Tests that points with a fast and a slow mode hardly widen the intervals of the other points. By chance, two
/// in five of the points with two modes show only the fast mode in three launches. The interval of such a point
/// contains the result of another run less often than the intervals of the other points.
#[test]
fn steady_points_are_told_apart_beside_bimodal_ones() {
    let coverage = |machine, of: &dyn Fn(usize) -> bool| {
        let between = || vec![BetweenRuns::ON_PROCESSORS; 30];
        let runs: Vec<Paired> =
            (0..RUNS).map(|seed| Paired::of(&run(machine, 30, seed), 30).over_runs(between())).collect();
        let ratio = |run: &Paired, point: usize| run.ratio(point, 0).expect("enough samples");
        agreement(&runs, (1..30).filter(|point| of(*point)), ratio)
    };
    let all = coverage(BIMODAL, &|_| true);
    let (steady, undisturbed) =
        (coverage(BIMODAL, &|point| !is_bimodal(point)), coverage(MACHINE, &|point| !is_bimodal(point)));
    assert!(all.0 >= 0.8 && steady.0 >= 0.8, "{all:?} {steady:?}");
    assert!(steady.1 <= 0.04 && steady.1 <= 1.2 * undisturbed.1, "{steady:?} {undisturbed:?}");
}

/// Returns the 95% interval of the median by the percentile bootstrap. The percentile bootstrap assumes
/// independent samples.
fn bootstrap(samples: &[f64], rng: &mut impl Rng) -> Interval {
    let mut resampled = || {
        let drawn: Vec<f64> = samples.iter().map(|_| samples[rng.random_range(0..samples.len())]).collect();
        median_of(&drawn).expect("samples")
    };
    let mut medians: Vec<f64> = (0..200).map(|_| resampled()).collect();
    medians.sort_by(f64::total_cmp);
    let middle = median_of(samples).expect("samples");
    let (low, high) = (quantile(&medians, 0.025), quantile(&medians, 0.975));
    Interval { middle, low, high, error: 0.0, degrees: 0.0, bias: 0.0 }
}

/// Shows why an interval must include the differences between launches. The bootstrap treats the samples of all
/// launches alike, and its intervals contain the result of another run far less often than those of [`Paired`].
#[test]
fn the_plain_interval_of_a_median_does_not_hold() {
    let plain = |samples: &Vec<PairedSample>, point: usize| {
        let own: Vec<f64> =
            samples.iter().filter(|sample| sample.point == point).map(|sample| sample.ms).collect();
        bootstrap(&own, &mut ChaCha8Rng::seed_from_u64(point as u64))
    };
    let runs: Vec<Vec<PairedSample>> = (0..RUNS).map(|seed| run(MACHINE, 4, seed)).collect();
    let (held, _) = agreement(&runs, 0..4, plain);
    assert!(held < 0.6, "{held}");
}
