//! Limits the number of PoCL's threads, and pins the threads to processors. By default PoCL starts one thread
//! per processor of the machine, even if the process may run on fewer processors. PoCL leaves the placement
//! of its threads to the system, which can put two threads on the same processor for seconds while another
//! processor is idle.

use super::{DeviceKind, is_pocl};
use crate::threads::cores;

/// The environment variables for the number of PoCL's threads: the variable that PoCL reads since version 5,
/// and the older variable, which all versions of PoCL read.
const COUNTS: [&str; 2] = ["POCL_CPU_MAX_CU_COUNT", "POCL_MAX_PTHREAD_COUNT"];
/// The environment variable for the number of compute units of all of PoCL's drivers. PoCL 6 reads this variable if
/// neither variable in `COUNTS` is set.
const OF_ALL_DRIVERS: &str = "POCL_MAX_COMPUTE_UNITS";
/// The environment variables for the smallest number of PoCL's threads: the newer variable, and the older
/// variable. PoCL starts at least this smallest number of threads, even if a variable in `COUNTS` sets a
/// lower number.
const LEAST_COUNTS: [&str; 2] = ["POCL_CPU_MIN_CU_COUNT", "POCL_PTHREAD_MIN_THREADS"];

/// Returns true if `name` is one of the variables in `COUNTS`, which set the number of PoCL's threads.
pub fn sets_threads(name: &str) -> bool {
    COUNTS.contains(&name)
}

/// Returns true for the environment variables about PoCL's threads that raycl may set if the user has not set them.
pub fn is_set_by_raycl(name: &str) -> bool {
    sets_threads(name) || name == PINNED
}

/// Returns the environment variables that raycl must set before a driver is loaded, so that PoCL does not start too
/// many threads. The affinity and the control groups of the process determine how many threads it may run at the same
/// time. If the user has set only one of the variables in `COUNTS`, the other variable gets the same value: older
/// versions of PoCL do not read the newer variable, and the keys of points depend on both. Returns no variables if the
/// user has set both, or `OF_ALL_DRIVERS`.
pub fn thread_variables() -> Vec<(&'static str, String)> {
    variables(value_of, cores())
}

/// The environment variable that makes PoCL pin each of its threads to the processor of the same number.
const PINNED: &str = "POCL_AFFINITY";

/// Returns the environment variables that raycl must set before a driver is loaded, so that PoCL pins its threads.
/// Returns no variables if the user has set `POCL_AFFINITY`, or has set more threads than the process may run at the
/// same time. If the user has set the number of threads to a text that is not a number, raycl also assumes that there
/// are too many threads. Also returns no variables if the processors of the process are not the first processors of the
/// machine, or if the process may use them only for part of the time.
pub fn pinning_variables() -> Vec<(&'static str, String)> {
    pinning(value_of, &processors(), cores())
}

/// Returns the value of an environment variable, with invalid UTF-8 replaced; `None` if the variable is not set.
fn value_of(name: &str) -> Option<String> {
    std::env::var_os(name).map(|value| value.to_string_lossy().into_owned())
}

fn pinning(
    value_of: impl Fn(&str) -> Option<String>,
    processors: &[usize],
    threads: usize,
) -> Vec<(&'static str, String)> {
    // PoCL aborts if it has to pin a thread to a processor that does not exist.
    let has_room = |count: &str| count.trim().parse::<usize>().is_ok_and(|count| count <= threads);
    let mut counts = COUNTS.into_iter().chain([OF_ALL_DRIVERS]).chain(LEAST_COUNTS);
    let have_room = counts.all(|name| value_of(name).is_none_or(|count| has_room(&count)));
    if value_of(PINNED).is_some() || !have_room || !are_the_first(processors, threads) {
        return Vec::new();
    }
    vec![(PINNED, "1".to_owned())]
}

/// Returns true if `processors` are the first processors of the machine, and their number is `threads`, the
/// number that the process may use at once. PoCL pins its threads to the first processors.
fn are_the_first(processors: &[usize], threads: usize) -> bool {
    processors.iter().copied().eq(0..threads)
}

/// Returns the numbers of the processors that the process may run on; an empty list if the system does not
/// report these numbers.
#[cfg(target_os = "linux")]
fn processors() -> Vec<usize> {
    use rustix::thread::{CpuSet, sched_getaffinity};
    let own = sched_getaffinity(None);
    own.map_or_else(|_| Vec::new(), |own| (0..CpuSet::MAX_CPU).filter(|number| own.is_set(*number)).collect())
}

/// Returns an empty list: on systems other than Linux, raycl does not query the numbers of the processors.
#[cfg(not(target_os = "linux"))]
fn processors() -> Vec<usize> {
    Vec::new()
}

fn variables(value_of: impl Fn(&str) -> Option<String>, threads: usize) -> Vec<(&'static str, String)> {
    if value_of(OF_ALL_DRIVERS).is_some() {
        return Vec::new();
    }
    let of_user = COUNTS.into_iter().find_map(&value_of);
    let count = of_user.unwrap_or_else(|| threads.to_string());
    let unset = COUNTS.into_iter().filter(|&name| value_of(name).is_none());
    unset.map(|name| (name, count.clone())).collect()
}

/// Returns the number of threads with which a device runs kernels; `None` if unknown. PoCL has one thread per
/// compute unit of a CPU.
pub fn threads_of(platform: &str, kind: DeviceKind, compute_units: u32) -> Option<u32> {
    (is_pocl(platform) && kind == DeviceKind::Cpu).then_some(compute_units)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pocl_gets_as_many_threads_as_there_are_unless_the_user_said_how_many() {
        let of = |set: &[(&str, &str)]| {
            let value = |name: &str| set.iter().find(|(own, _)| *own == name);
            variables(|name| value(name).map(|(_, value)| (*value).to_owned()), 3)
        };
        let [newer, older] = ["POCL_CPU_MAX_CU_COUNT", "POCL_MAX_PTHREAD_COUNT"];
        assert_eq!(of(&[]), [newer, older].map(|name| (name, "3".to_owned())));
        // PoCL reads one of the two variables or both, so the variable that the user has not set gets the user's value.
        for (set, other) in [(newer, older), (older, newer)] {
            assert_eq!(of(&[(set, "2")]), [(other, "2".to_owned())]);
            assert!(of(&[(set, "2"), (other, "1")]).is_empty(), "both are the user's");
            assert!(of(&[(set, "2"), ("POCL_MAX_COMPUTE_UNITS", "1")]).is_empty());
        }
        assert!(of(&[("POCL_MAX_COMPUTE_UNITS", "2")]).is_empty());
        assert!(cores() >= 1);
    }

    #[test]
    fn threads_are_pinned_if_all_of_the_first_processors_are_allowed() {
        assert!(are_the_first(&[0, 1, 2], 3));
        assert!(!are_the_first(&[0, 1, 2], 2), "a control group allows two processors' time");
        assert!(!are_the_first(&[1, 2], 2) && !are_the_first(&[0, 2], 2), "PoCL would use processor 0 and 1");
        assert!(!are_the_first(&[], 1), "nothing is known");
    }

    #[test]
    fn threads_are_pinned_unless_the_user_pins_them_or_asks_for_more_than_there_are_processors() {
        let is_pinned = |set: &str, value: &str| {
            let value_of = |name: &str| (name == set).then(|| value.to_owned());
            pinning(value_of, &[0, 1], 2) == [(PINNED, "1".to_owned())]
        };
        assert!(is_pinned("PATH", "4") && !is_pinned(PINNED, "0"));
        for name in COUNTS.into_iter().chain([OF_ALL_DRIVERS]).chain(LEAST_COUNTS) {
            assert!(is_pinned(name, "1") && is_pinned(name, " 2 "), "{name}");
            assert!(!is_pinned(name, "3") && !is_pinned(name, "4") && !is_pinned(name, "many"), "{name}");
        }
        assert!(pinning(|_| None, &[1, 2], 2).is_empty(), "the processors are not the first ones");
    }

    #[test]
    fn raycl_sets_the_variables_for_the_number_of_threads_and_for_pinning_them() {
        let all = variables(|_| None, 2).into_iter().chain(pinning(|_| None, &[0, 1], 2));
        assert!(all.clone().all(|(name, _)| is_set_by_raycl(name)) && all.count() == 3);
        assert!(!is_set_by_raycl("POCL_WORK_GROUP_METHOD") && !sets_threads(PINNED));
    }

    #[test]
    fn threads_are_known_of_pocl_only() {
        assert_eq!(threads_of("Portable Computing Language", DeviceKind::Cpu, 4), Some(4));
        assert_eq!(threads_of("Portable Computing Language", DeviceKind::Gpu, 4), None);
        assert_eq!(threads_of("Intel(R) OpenCL", DeviceKind::Cpu, 4), None);
    }
}
