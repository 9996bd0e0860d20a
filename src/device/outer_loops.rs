//! Keeps PoCL 7 from adding barriers to the loops of kernels. By default, PoCL 7.0 and 7.1 run each iteration of a
//! kernel's loop for all work-items of a work-group before the next iteration. In PoCL 7.1, kernels of raycl then read
//! wrong values if a work-group has more than one work-item, and many of them crash (see docs/reliability.md). Earlier
//! versions do this only if an environment variable asks for it.

/// The environment variable that decides whether PoCL adds barriers to the loops of kernels without barriers.
const VARIABLE: &str = "POCL_FORCE_PARALLEL_OUTER_LOOP";
/// With this value, PoCL adds no barriers. The value is the default of versions before 7.0.
const NO_BARRIERS: &str = "0";

/// Returns the environment variable that raycl must set before a driver is loaded, so that PoCL adds no barriers to
/// loops. Returns no variable if the user has set it.
pub fn loop_variables() -> Vec<(&'static str, String)> {
    variables(std::env::var_os(VARIABLE).is_some())
}

/// Returns true if the setting (`NAME=VALUE`) is the one that raycl makes, which is also the default of PoCL before
/// 7.0. Neither the keys of points nor the printed commands that repeat a run contain this setting.
pub fn is_usual(setting: &str) -> bool {
    setting.strip_prefix(VARIABLE).and_then(|rest| rest.strip_prefix('=')) == Some(NO_BARRIERS)
}

fn variables(is_set: bool) -> Vec<(&'static str, String)> {
    if is_set { Vec::new() } else { vec![(VARIABLE, NO_BARRIERS.to_owned())] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pocl_adds_no_barriers_unless_the_user_has_decided() {
        assert_eq!(variables(false), [("POCL_FORCE_PARALLEL_OUTER_LOOP", "0".to_owned())]);
        assert!(variables(true).is_empty());
    }

    #[test]
    fn only_the_setting_of_raycl_is_usual() {
        assert!(variables(false).iter().all(|(name, value)| is_usual(&format!("{name}={value}"))));
        for other in
            ["POCL_FORCE_PARALLEL_OUTER_LOOP=1", "POCL_FORCE_PARALLEL_OUTER_LOOP=", "POCL_AFFINITY=0", ""]
        {
            assert!(!is_usual(other), "{other}");
        }
    }
}
