//! A sweep contains, for each case, times of candidate strategies on one device. A candidate has a time if it may be
//! the fastest, and if neither the device nor the host refused it. For each case, the rule's choice is compared with
//! the fastest candidate.

use super::Case;
use crate::device::Device;
use crate::error::Result;
use crate::launch::{Caster, Queue, Refused, Session};
use crate::program::Sources;
use crate::scene::Scene;
use crate::strategy::{Candidate, Class, Task};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A sample has as many frames as it needs to take this time, in milliseconds, but at most `MOST_FRAMES`. A
/// sample of a single short frame could lie wholly within a disturbance.
const SAMPLE_MS: f64 = 10.0;
/// The largest number of triangles for which exhaustive casting is timed. With more triangles, a sweep assumes that
/// another candidate is faster. (With millions of triangles, exhaustive casting would take minutes.)
const MOST_TESTED: usize = 2000;
/// Largest number of frames in a sample, even if the sample then takes less time than `SAMPLE_MS`.
const MOST_FRAMES: f64 = 200.0;

/// A sweep: the times of candidate strategies for the measured cases on one device.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Sweep {
    /// The label of the device on which the candidates were measured.
    pub device: String,
    /// The device's class, which determines the candidates.
    pub class: Class,
    /// Number of the device's compute units.
    pub compute_units: u32,
    /// The date of the measurement.
    pub date: String,
    /// A note about the machine during the measurement, from `--conditions`.
    #[serde(default)]
    pub conditions: String,
    /// Number of rounds. In each round, every candidate that has a time was measured once. The shortest time
    /// of all rounds is used.
    pub rounds: u32,
    /// The times of the candidates for each case.
    pub cases: Vec<Measured>,
}

/// The times of the candidate strategies for one case.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Measured {
    /// The case's name.
    pub name: String,
    /// The properties of the case that affect which strategy is fastest.
    #[serde(flatten)]
    pub task: Task,
    /// The time of a frame in milliseconds, by the candidate's name: the shortest of the times measured in
    /// all rounds. Candidates that the device or the host refused are missing; in large scenes, exhaustive
    /// casting is missing too.
    pub least_ms: BTreeMap<String, f64>,
}

/// The strategy that the rule chooses for a case (a scene and an image size), compared with the fastest
/// candidate strategy.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// The candidate strategy that the rule chooses.
    pub choice: Candidate,
    /// The time of the chosen strategy in milliseconds; `None` if the chosen strategy has no time (see
    /// [`Measured::least_ms`]).
    pub choice_ms: Option<f64>,
    /// The fastest candidate, and its time in milliseconds.
    pub best: (String, f64),
}

impl Verdict {
    /// Returns the time of the chosen strategy divided by the best time; infinity if the chosen strategy was
    /// not measured.
    pub fn ratio(&self) -> f64 {
        self.choice_ms.map_or(f64::INFINITY, |ms| ms / self.best.1)
    }
}

impl Measured {
    /// Compares `choice`, the candidate that the rule chooses for this case, with the fastest candidate.
    /// Returns `None` if no candidate has a time.
    pub fn verdict(&self, choice: Candidate) -> Option<Verdict> {
        let best = self.least_ms.iter().min_by(|a, b| a.1.total_cmp(b.1))?;
        let choice_ms = self.least_ms.get(choice.name()).copied();
        Some(Verdict { choice, choice_ms, best: (best.0.clone(), *best.1) })
    }

    /// Measures, for a case, the candidates that may be the fastest. Each round measures each of them once, and every
    /// second round measures them in reverse order. Candidates that the device or the host refuses have no time.
    pub fn of(case: &Case, scene: Arc<Scene>, device: &Device, rounds: u32) -> Result<Self> {
        let task = case.task(&scene);
        let limits = &device.info.limits;
        let queue = Queue::open(device)?;
        let mut session = Session::new(queue, &device.info, &Sources::Embedded, scene);
        let mut casters = Vec::new();
        let candidates = Class::of(limits).candidates().into_iter();
        for candidate in candidates.filter(|candidate| may_be_fastest(*candidate, &task)) {
            let (strategy, local_size) = candidate.strategy(limits, task.watertight)?;
            let caster = session.prepare(&strategy, case.size, local_size).and_then(|ready| ready.caster());
            match caster {
                Ok(caster) => casters.push((candidate, caster, f64::INFINITY)),
                // The device or the host refused the candidate, so the candidate gets no time.
                Err(Refused::Device(_) | Refused::Host(_)) => {}
                Err(refused) => return Err(refused.into_error(&device.info)),
            }
        }
        let failed = |error| Refused::at("the launch")(error).into_error(&device.info);
        let frames: Vec<u32> = casters
            .iter()
            .map(|(_, caster, _)| caster.cast().and_then(|_| frames_of_sample(caster)).map_err(failed))
            .collect::<Result<_>>()?;
        for round in 0..rounds {
            for index in order(round, casters.len()) {
                let (_, caster, least_ms) = &mut casters[index];
                *least_ms = least_ms.min(caster.cast_batch(frames[index]).map_err(failed)?.frame_ms);
            }
        }
        let least_ms = casters.iter().map(|(candidate, _, ms)| (candidate.name().to_owned(), *ms)).collect();
        Ok(Self { name: case.name.clone(), task, least_ms })
    }
}

/// Returns true if a candidate may be the fastest for a task. A candidate for which this function returns
/// false is not measured.
fn may_be_fastest(candidate: Candidate, task: &Task) -> bool {
    candidate != Candidate::Exhaustive || task.triangles <= MOST_TESTED
}

/// Returns the order in which the round `round` of a sweep measures the candidates.
fn order(round: u32, candidates: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..candidates).collect();
    if round % 2 == 1 {
        order.reverse();
    }
    order
}

/// Casts a frame, and returns how many such frames make a sample. The caster must have cast a frame before, since a
/// first frame takes longer.
fn frames_of_sample(caster: &Caster) -> std::result::Result<u32, crate::launch::LaunchError> {
    Ok(frames_for(caster.cast()?.frame_ms))
}

/// Returns the number of frames with which a sample takes at least `SAMPLE_MS`, if each frame takes `one_ms`; at most
/// `MOST_FRAMES`.
fn frames_for(one_ms: f64) -> u32 {
    (SAMPLE_MS / one_ms.max(1e-6)).ceil().clamp(1.0, MOST_FRAMES) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_choice_is_compared_with_the_fastest_candidate() {
        let (task, choice) = (Task::covering(1_000_000, 400_000), Candidate::Single);
        let verdict = |times: &[(&str, f64)]| {
            let least_ms = times.iter().map(|(name, ms)| ((*name).to_owned(), *ms)).collect();
            Measured { name: "a".into(), task, least_ms }.verdict(choice)
        };
        let slower = verdict(&[("exhaustive", 3.0), (choice.name(), 6.0), ("another", 4.0)]).expect("times");
        assert_eq!((slower.choice, slower.choice_ms), (choice, Some(6.0)));
        assert_eq!((slower.best.clone(), slower.ratio()), (("exhaustive".to_owned(), 3.0), 2.0));
        let refused = verdict(&[("exhaustive", 3.0)]).expect("times");
        assert_eq!((refused.choice_ms, refused.ratio()), (None, f64::INFINITY));
        assert!(verdict(&[]).is_none());
    }

    #[test]
    fn a_sample_has_frames_for_10_ms_but_at_most_200() {
        assert_eq!([25.0, 10.0, 9.9, 3.0, 0.1, 0.01, 0.0].map(frames_for), [1, 1, 2, 4, 100, 200, 200]);
    }

    #[test]
    fn every_second_round_is_in_reverse_order() {
        assert_eq!([0, 1, 2].map(|round| order(round, 3)), [[0, 1, 2], [2, 1, 0], [0, 1, 2]]);
    }

    #[test]
    fn of_many_triangles_all_candidates_but_the_exhaustive_one_are_measured() {
        let measured =
            |candidate, triangles| may_be_fastest(candidate, &Task { triangles, ..Task::default() });
        assert_eq!([2000, 2001].map(|triangles| measured(Candidate::Exhaustive, triangles)), [true, false]);
        let candidates = Class::TilesInVectors.candidates().into_iter();
        for candidate in candidates.filter(|candidate| *candidate != Candidate::Exhaustive) {
            assert!(measured(candidate, 1_000_000), "{}", candidate.name());
        }
    }
}
