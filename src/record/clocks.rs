//! Clock frequencies of the host's cores, if the operating system reports them.

use serde::{Deserialize, Serialize};
use std::path::Path;

/// The host's clock frequencies at the beginning of a run. Values that the system does not report are null.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Clocks {
    /// The first core's frequency governor, such as "performance" or "powersave".
    pub governor: Option<String>,
    /// Lowest and highest frequency of any core at the beginning of the run, MHz.
    pub now_mhz: Option<[f64; 2]>,
    /// The highest frequency that the hardware of the first core allows, MHz. If the system does not report
    /// this frequency, the value is the highest frequency that the system's settings allow.
    pub max_mhz: Option<f64>,
}

impl Clocks {
    /// Reads the clock frequencies of this machine. On systems other than Linux, all values are null.
    pub fn read() -> Self {
        Self::under(Path::new("/"))
    }

    /// Reads the clock frequencies from files under `root`, which is `/` except in tests.
    fn under(root: &Path) -> Self {
        let text =
            |path: &str| std::fs::read_to_string(root.join(path)).ok().map(|text| text.trim().to_owned());
        let policy = |name: &str| text(&format!("sys/devices/system/cpu/cpu0/cpufreq/{name}"));
        let khz = |name: &str| policy(name)?.parse::<f64>().ok();
        Self {
            governor: policy("scaling_governor"),
            now_mhz: text("proc/cpuinfo").and_then(|text| ends(&text)),
            max_mhz: khz("cpuinfo_max_freq").or_else(|| khz("scaling_max_freq")).map(|khz| khz / 1e3),
        }
    }
}

/// Returns the lowest and the highest value of "cpu MHz" in the text of /proc/cpuinfo; `None` if the text has
/// no such value.
fn ends(cpuinfo: &str) -> Option<[f64; 2]> {
    let lines = cpuinfo.lines().filter(|line| line.starts_with("cpu MHz"));
    let values = lines.filter_map(|line| line.split_once(':')?.1.trim().parse::<f64>().ok());
    let [low, high] = values.fold([f64::INFINITY, 0.0], |[low, high], mhz| [low.min(mhz), high.max(mhz)]);
    (low <= high).then_some([low, high])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_reported_is_read_and_what_is_not_is_absent() {
        let root = tempfile::tempdir().expect("a folder");
        assert_eq!(Clocks::under(root.path()), Clocks::default());
        let cpufreq = root.path().join("sys/devices/system/cpu/cpu0/cpufreq");
        std::fs::create_dir_all(&cpufreq).expect("a folder");
        std::fs::create_dir(root.path().join("proc")).expect("a folder");
        std::fs::write(cpufreq.join("scaling_governor"), "powersave\n").expect("it writes");
        std::fs::write(cpufreq.join("cpuinfo_max_freq"), "4200000\n").expect("it writes");
        let cores = "model name\t: X\ncpu MHz\t\t: 2450.5\n\nmodel name\t: X\ncpu MHz\t\t: 3600\n";
        std::fs::write(root.path().join("proc/cpuinfo"), cores).expect("it writes");
        let clocks = Clocks::under(root.path());
        assert_eq!(clocks.governor.as_deref(), Some("powersave"));
        assert_eq!((clocks.now_mhz, clocks.max_mhz), (Some([2450.5, 3600.0]), Some(4200.0)));
    }

    #[test]
    fn without_the_processors_highest_clock_that_of_its_policy_is_used() {
        let root = tempfile::tempdir().expect("a folder");
        let cpufreq = root.path().join("sys/devices/system/cpu/cpu0/cpufreq");
        std::fs::create_dir_all(&cpufreq).expect("a folder");
        std::fs::write(cpufreq.join("scaling_max_freq"), "2000000\n").expect("it writes");
        assert_eq!(Clocks::under(root.path()).max_mhz, Some(2000.0));
        std::fs::write(cpufreq.join("cpuinfo_max_freq"), "3000000\n").expect("it writes");
        assert_eq!(Clocks::under(root.path()).max_mhz, Some(3000.0));
    }
}
