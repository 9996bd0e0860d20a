//! How many threads PoCL has: by itself one for each processor of the machine, however few the process may run on.

use super::DeviceKind;

/// PoCL's names for the number of its threads: that of version 5 and later, and the one before it, which all versions know.
const COUNTS: [&str; 2] = ["POCL_CPU_MAX_CU_COUNT", "POCL_MAX_PTHREAD_COUNT"];
/// The number of compute units of all its drivers, where those names are not set (version 6).
const OF_ALL_DRIVERS: &str = "POCL_MAX_COMPUTE_UNITS";

/// The variables to set before a driver is loaded, so that PoCL has no more threads than the process may run on, by its
/// affinity and its control groups. None where the user has set one of them.
pub fn thread_variables() -> Vec<(&'static str, String)> {
    variables(|name| std::env::var_os(name).is_some(), allowed())
}

/// Threads that the process may run at once.
fn allowed() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

fn variables(is_set: impl Fn(&str) -> bool, threads: usize) -> Vec<(&'static str, String)> {
    if COUNTS.into_iter().chain([OF_ALL_DRIVERS]).any(is_set) {
        return Vec::new();
    }
    COUNTS.map(|name| (name, threads.to_string())).to_vec()
}

/// The number of threads that a device casts with, if known: PoCL's has one per compute unit.
pub fn threads_of(platform: &str, kind: DeviceKind, compute_units: u32) -> Option<u32> {
    let is_pocl = platform.to_lowercase().contains("portable computing language");
    (is_pocl && kind == DeviceKind::Cpu).then_some(compute_units)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pocl_gets_as_many_threads_as_there_are_unless_the_user_said_how_many() {
        let all = variables(|_| false, 3);
        assert!(all.contains(&("POCL_MAX_PTHREAD_COUNT", "3".to_owned())) && all.len() == 2, "{all:?}");
        for set in ["POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT", "POCL_MAX_COMPUTE_UNITS"] {
            assert!(variables(|name| name == set, 3).is_empty(), "{set}");
        }
        assert!(allowed() >= 1);
    }

    #[test]
    fn threads_are_known_of_pocl_only() {
        assert_eq!(threads_of("Portable Computing Language", DeviceKind::Cpu, 4), Some(4));
        assert_eq!(threads_of("Portable Computing Language", DeviceKind::Gpu, 4), None);
        assert_eq!(threads_of("Intel(R) OpenCL", DeviceKind::Cpu, 4), None);
    }
}
