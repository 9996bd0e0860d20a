//! Computes the constants of the rule by which `render` chooses a strategy, from sweeps (measured times of
//! candidate strategies). A choice of the rule loses time if another candidate strategy is faster. In a round
//! of fitting, each constant in turn is set to the value with which the chosen strategies lose the least
//! time. Rounds of fitting are repeated until no constant of the rule changes, but at most `ROUNDS` times.

use super::Sweep;
use crate::strategy::{Class, Constants, Task};

/// The largest ratio of a choice's time to the best time. A greater ratio counts as `REFUSED`. A choice
/// without a time, for example because the device refused the strategy, also counts as `REFUSED`.
const REFUSED: f64 = 100.0;
/// A constant is changed only if the sum that [`loss_of`] returns decreases by more than this number.
const GAIN: f64 = 1e-3;
/// The rule that chooses a strategy compares a value of each case (scene and image size), such as the number
/// of triangles, with a constant. If the values of two cases differ by less than the factor `ALIKE`, no
/// constant between these two values is tried.
const ALIKE: f64 = 1.01;
/// Largest number of rounds of fitting. In a round of fitting, each constant of the rule is fitted once.
/// Several rounds are needed, since the best value of a constant depends on the other constants.
const ROUNDS: usize = 8;

/// Returns the constants of the rule that chooses a strategy, for a class of devices, fitted to the sweeps
/// (measured times) of this class. If `watertight` is true, returns the constants for watertight tests. A
/// constant stays unchanged if, in the sweeps, no other value makes the chosen strategies clearly faster.
/// Returns `None` if the rule has no constants for this class of devices.
pub fn fitted(sweeps: &[Sweep], class: Class, watertight: bool) -> Option<Constants> {
    let mut constants = class.constants(watertight)?;
    let of_class: Vec<&Sweep> = sweeps.iter().filter(|sweep| sweep.class == class).collect();
    let mut loss = loss_of(&of_class, constants, watertight);
    for _ in 0..ROUNDS {
        let before = constants;
        for index in 0..constants.of(&Task::default(), 1).len() {
            for value in values_to_try(&of_class, constants, (index, watertight)) {
                let mut moved = constants;
                *moved.of(&Task::default(), 1)[index].1 = value;
                let moved_loss = loss_of(&of_class, moved, watertight);
                if moved_loss < loss - GAIN {
                    (constants, loss) = (moved, moved_loss);
                }
            }
        }
        if constants == before {
            break;
        }
    }
    Some(constants)
}

/// Returns how much time the rule's choices lose, as a sum over the watertight cases or, if `watertight` is
/// false, over all cases that are not watertight. A case without any time is left out. Each case adds the
/// logarithm of a ratio: the time of the chosen strategy divided by the best time, but at most `REFUSED`.
fn loss_of(sweeps: &[&Sweep], constants: Constants, watertight: bool) -> f64 {
    let verdicts = sweeps.iter().flat_map(|sweep| {
        let cases = sweep.cases.iter().filter(|case| case.task.watertight == watertight);
        cases.filter_map(|case| case.verdict(constants.choice(&case.task, sweep.compute_units)))
    });
    verdicts.map(|verdict| verdict.ratio().min(REFUSED).ln()).sum()
}

/// Returns the values to try for a constant of the rule. The rule compares a value of each case, such as the
/// number of triangles, with this constant. The values of the cases form a sorted list, in which only the
/// first of several nearly equal values is kept. The values to try are 0, infinity, and one number with few
/// digits between every two neighbours in this list.
fn values_to_try(
    sweeps: &[&Sweep],
    mut constants: Constants,
    (index, watertight): (usize, bool),
) -> Vec<f64> {
    let mut seen: Vec<f64> = Vec::new();
    for sweep in sweeps {
        let cases = sweep.cases.iter().filter(|case| case.task.watertight == watertight);
        seen.extend(cases.map(|case| constants.of(&case.task, sweep.compute_units)[index].2));
    }
    seen.sort_unstable_by(f64::total_cmp);
    // If the values of two cases are nearly equal, no value between them is tried for the constant.
    seen.dedup_by(|next, last| *next < *last * ALIKE);
    let between = seen.windows(2).map(|pair| between(pair[0], pair[1])).filter(|value| value.is_finite());
    [0.0, f64::INFINITY].into_iter().chain(between).collect()
}

/// Returns a value near the geometric mean of `low` and `high`, with as few digits as possible, but at least two. The
/// value is above `low` and not above `high`. If `low` is 0, returns `high`.
fn between(low: f64, high: f64) -> f64 {
    let mean = (low * high).sqrt();
    let rounded = |digits: usize| format!("{mean:.digits$e}").parse::<f64>().ok();
    (1..=6).filter_map(rounded).find(|value| *value > low && *value <= high).unwrap_or(high)
}

/// Generates a new text for src/strategy/constants.rs, with constants fitted to `sweeps`.
pub fn source(sweeps: &[Sweep]) -> String {
    let mut text = HEAD.to_owned();
    for (name, about, class, watertight) in [
        ("CPU", "For CPUs whose vectors hold 16 rays.", Class::TilesInVectors, false),
        (
            "CPU_WATERTIGHT",
            "For CPUs whose vectors hold 16 rays, with a watertight test.",
            Class::TilesInVectors,
            true,
        ),
        ("NARROW_CPU", "For CPUs whose vectors hold fewer than 16 rays.", Class::TilesInNarrowVectors, false),
        (
            "NARROW_CPU_WATERTIGHT",
            "For CPUs whose vectors hold fewer than 16 rays, with a watertight test.",
            Class::TilesInNarrowVectors,
            true,
        ),
        (
            "GPU",
            "For GPUs whose work-items exchange values by PTX's lane operations.",
            Class::SharedTiles,
            false,
        ),
        (
            "GPU_WATERTIGHT",
            "For GPUs whose work-items exchange values by PTX's lane operations, with a watertight test.",
            Class::SharedTiles,
            true,
        ),
    ] {
        let Some(mut constants) = fitted(sweeps, class, watertight) else { continue };
        text.push_str(&format!("\n/// {about}\npub const {name}: Constants = Constants {{\n"));
        for (field, value, _) in constants.of(&Task::default(), 1) {
            let value = if value.is_finite() { format!("{value:?}") } else { "f64::INFINITY".to_owned() };
            text.push_str(&format!("    {field}: {value},\n"));
        }
        text.push_str("};\n");
    }
    text
}

const HEAD: &str = "\
//! The sizes at which one way of casting becomes faster than another. `raycl rule --fit` generates this file from
//! stored sweeps; do not edit it. A constant that lies between two cases of the sweeps is near the geometric mean of
//! their values. A constant that no sweep determines keeps its former value.

use super::fastest::Constants;
";

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::Measured;
    use super::*;

    /// A case: its numbers of triangles and of pixels, and the time of each strategy.
    type CaseTimes<'a> = (usize, usize, &'a [(&'a str, f64)]);

    fn sweep(cases: &[CaseTimes<'_>]) -> Sweep {
        let measured = |&(triangles, pixels, times): &CaseTimes<'_>| Measured {
            name: format!("{triangles} in {pixels}"),
            task: Task::covering(triangles, pixels),
            least_ms: times.iter().map(|(name, ms)| ((*name).to_owned(), *ms)).collect(),
        };
        Sweep {
            device: "a test's".to_owned(),
            class: Class::TilesInVectors,
            compute_units: 2,
            date: String::new(),
            conditions: String::new(),
            rounds: 5,
            cases: cases.iter().map(measured).collect(),
        }
    }

    #[test]
    fn a_constant_goes_between_the_cases_that_it_distinguishes() {
        let times =
            |exhaustive, tiles, single| [("exhaustive", exhaustive), ("tiles", tiles), ("single", single)];
        let [tiny, small, large, dense] =
            [times(1.0, 2.0, 3.0), times(4.0, 2.0, 3.0), times(900.0, 5.0, 6.0), times(9e4, 12.0, 6.0)];
        let sweep = sweep(&[
            (4, 400_000, &tiny),
            (9, 400_000, &small),
            (100_000, 400_000, &large),
            (4_000_000, 400_000, &dense),
        ]);
        let constants = fitted(std::slice::from_ref(&sweep), Class::TilesInVectors, false).unwrap();
        assert_eq!(constants.tree_triangles, 6.0);
        assert!(constants.single_triangles_a_pixel > 0.25 && constants.single_triangles_a_pixel <= 10.0);
        assert!(loss_of(&[&sweep], constants, false) < 1e-9);
    }

    #[test]
    fn a_constant_has_few_digits_and_is_above_the_lower_case() {
        assert_eq!(between(4.0, 9.0), 6.0);
        // The mean 6.0498 is 6.0 with two digits, but the result must be above the lower of the two
        // arguments, 6.0.
        assert_eq!(between(6.0, 6.1), 6.05);
        // The mean 5.095 is 5.1 with two digits. The result may equal the upper of the two arguments, 5.1.
        assert_eq!([between(5.09, 5.1), between(0.0, 7.3)], [5.1, 7.3]);
    }

    #[test]
    fn without_a_sweep_nothing_moves() {
        for watertight in [false, true] {
            let constants = Class::SharedTiles.constants(watertight);
            assert_eq!(fitted(&[], Class::SharedTiles, watertight), constants);
        }
    }

    #[test]
    fn constants_are_fitted_to_sweeps_of_their_own_class_only() {
        // With the constants that raycl uses, the rule does not choose exhaustive casting for a million
        // triangles. In the sweep of this test, exhaustive casting is the fastest, so fitting must change the
        // constants of the sweep's class.
        let times = [("exhaustive", 1.0), ("tiles", 2.0), ("single", 3.0)];
        let of_cpu = [sweep(&[(1_000_000, 400_000, &times)])];
        for (class, moves) in [(Class::TilesInVectors, true), (Class::SharedTiles, false)] {
            assert_eq!(fitted(&of_cpu, class, false) != class.constants(false), moves, "{class:?}");
        }
    }

    /// A choice that a device refused counts as if it took a hundred times the best time. Suppose that a
    /// refused choice counted as infinitely long, and that the device refused every strategy that the rule
    /// could choose for one case. The sum over all cases would then be infinite for all constants, and hide
    /// the differences between constants.
    #[test]
    fn a_refused_choice_does_not_hide_what_the_other_cases_lose() {
        let times = |exhaustive, tiles| [("exhaustive", exhaustive), ("tiles", tiles), ("single", 1e3)];
        let (tiny, small) = (times(1.0, 2.0), times(4.0, 2.0));
        let refused = [("large-separate-tiles", 5.0)];
        let all = [
            (4, 400_000, &tiny[..]),
            (9, 400_000, &small[..]),
            // The device refused every strategy that the rule could choose.
            (400_000, 400_000, &refused[..]),
        ];
        let sweep = sweep(&all);
        let constants = fitted(std::slice::from_ref(&sweep), Class::TilesInVectors, false).unwrap();
        assert_eq!(constants.tree_triangles, 6.0);
        assert!((loss_of(&[&sweep], constants, false) - REFUSED.ln()).abs() < 1e-9);
    }
}
