//! Makes workers fail on purpose, so that tests can check that a run continues after a worker has failed. The
//! option for these faults is `raycl run --fault`, which the help does not show.

use serde::{Deserialize, Serialize};
use signal_hook::consts::{SIGABRT, SIGKILL, SIGSEGV};
use std::io::Write as _;
use std::path::Path;
use std::str::FromStr;
use std::time::Duration;

/// The file that a worker with the fault `hang` or `hold` creates in the folder of results.
const HANGS: &str = ".hangs";

/// How and when a worker fails. For example, `segv@cast:3` makes a worker crash when it casts point 3, and
/// `hang@check:0` makes a worker hang when it checks point 0. `abort@cast:1:once` makes only the first worker
/// of each job abort (a job is the task of the workers of one device, with one folder of kernels). Points are counted
/// from 0, in the order of the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault {
    kind: Kind,
    step: Step,
    point: usize,
    /// True if only the first worker of each job fails.
    pub once: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Kind {
    Abort,
    Segv,
    Kill,
    Exit,
    Panic,
    Hang,
    Hold,
    Garbage,
}

/// A step of a worker's work at which a fault can happen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Step {
    /// Checking a point before it is timed.
    Check,
    /// Casting a frame of a point (a strategy with its sizes, scene and device) while the point is timed.
    Cast,
}

const KINDS: [(&str, Kind); 8] = [
    ("abort", Kind::Abort),
    ("segv", Kind::Segv),
    ("kill", Kind::Kill),
    ("exit", Kind::Exit),
    ("panic", Kind::Panic),
    ("hang", Kind::Hang),
    ("hold", Kind::Hold),
    ("garbage", Kind::Garbage),
];

impl FromStr for Fault {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "'{text}' is not a fault to inject; expected KIND@STEP:POINT or KIND@STEP:POINT:once, such as \
                 abort@check:3 or segv@cast:0:once; KIND is abort, segv, kill, exit, panic, hang, hold or garbage, and \
                 STEP is check or cast"
            )
        };
        let (kind, target) = text.split_once('@').ok_or_else(wrong)?;
        let (_, kind) = KINDS.into_iter().find(|(name, _)| *name == kind).ok_or_else(wrong)?;
        let mut words = target.split(':');
        let step = match words.next() {
            Some("check") => Step::Check,
            Some("cast") => Step::Cast,
            _ => return Err(wrong()),
        };
        let point = words.next().and_then(|word| word.parse().ok()).ok_or_else(wrong)?;
        match (words.next(), words.next()) {
            (None, None) => Ok(Self { kind, step, point, once: false }),
            (Some("once"), None) => Ok(Self { kind, step, point, once: true }),
            _ => Err(wrong()),
        }
    }
}

impl Fault {
    /// Makes the worker fail if `step` and `point` are the step and the point of the fault. The faults `hang`
    /// and `hold` create a file in the folder of results, and a test waits for this file. With `hold`, the
    /// worker continues when the file is removed.
    pub fn strike(&self, step: Step, point: usize, folder: &Path) {
        if (step, point) == (self.step, self.point) {
            self.kind.happen(folder);
        }
    }
}

impl Kind {
    #[allow(clippy::panic, reason = "a panic is one of the faults")]
    fn happen(self, folder: &Path) {
        // If a signal cannot be raised, the worker continues, and the test that expected the worker to die
        // fails.
        let raise = |signal| drop(signal_hook::low_level::emulate_default_handler(signal));
        match self {
            Self::Abort => raise(SIGABRT),
            Self::Segv => raise(SIGSEGV),
            Self::Kill => drop(signal_hook::low_level::raise(SIGKILL)),
            Self::Exit => signal_hook::low_level::exit(7),
            Self::Panic => panic!("a fault on purpose"),
            Self::Hang => {
                drop(std::fs::write(folder.join(HANGS), ""));
                loop {
                    std::thread::sleep(Duration::from_secs(3600));
                }
            }
            Self::Hold => {
                drop(std::fs::write(folder.join(HANGS), ""));
                while folder.join(HANGS).exists() {
                    std::thread::sleep(Duration::from_millis(5));
                }
            }
            // Imitates a driver that writes to standard output.
            Self::Garbage => drop(writeln!(std::io::stdout(), "{{\"Started\": a driver's words\n\n[1, 2")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_spelled_kind_at_step_and_point() {
        let fault: Fault = "segv@cast:3:once".parse().unwrap();
        assert_eq!(fault, Fault { kind: Kind::Segv, step: Step::Cast, point: 3, once: true });
        for wrong in
            ["", "segv", "segv@cast", "segv@cast:x", "boom@cast:1", "segv@cast:1:twice", "segv@cast:1:once:x"]
        {
            assert!(wrong.parse::<Fault>().is_err(), "{wrong}");
        }
    }
}
