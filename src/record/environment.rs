//! Reads and writes `environment.json`, which describes the machine, the input files and the settings of a
//! run.

use std::collections::BTreeSet;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::clocks::Clocks;
use super::git::git_state;
use super::whole::write_json;
use crate::device::{DeviceInfo, common_name, variables};
use crate::error::Result;

/// The contents of `environment.json`: the conditions under which a run was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Environment {
    /// The version of the raycl program that measured the run.
    pub raycl_version: String,
    /// The git revision from which raycl was built, with "-dirty" if there were uncommitted
    /// changes; null if the revision is unknown.
    pub git_revision: Option<String>,
    /// How raycl was built: the profile, the level of optimisation, the target with its features, the compiler's
    /// flags, and the compiler.
    #[serde(default)]
    pub build: String,
    /// The environment variables of OpenCL drivers, of OpenCL loaders and of the library Rayon, as
    /// `NAME=VALUE`. All variables that are set are included, even those that do not affect results.
    #[serde(default)]
    pub variables: Vec<String>,
    /// When the run began, in the format of RFC 3339.
    pub started: String,
    /// The command line with which the run was started, beginning with the program.
    pub command_line: Vec<String>,
    /// The machine that measured the run.
    pub host: Host,
    /// The devices that the run used.
    pub devices: Vec<DeviceEnvironment>,
    /// The options with which kernels are usually compiled. Programs that use sub-groups are compiled for a
    /// later version of OpenCL C.
    pub build_options: Vec<String>,
    /// The path of the run's config.
    pub config_path: String,
    /// The text of the run's config.
    pub config: String,
    /// BLAKE3 hash of the config's text and overrides.
    pub config_hash: String,
    /// The values of the config that the option `--set` changed, each as a line of TOML.
    pub overrides: Vec<String>,
    /// Notes on the config. They name the strategies that are measured under the name of an equal strategy.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub config_notes: Vec<String>,
    /// The input files of the run: the config, the scenes, the kernels.
    #[serde(default)]
    pub sources: Vec<Source>,
}

/// The path, in a [`Source`], of the kernels that raycl's binary contains.
pub const BUILT_IN: &str = "built in";

/// An input file or folder of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Source {
    /// What the input is: "config", "scene" or "kernels".
    pub what: String,
    /// The input's path; [`BUILT_IN`] for the kernels that raycl's binary contains.
    pub path: String,
    /// BLAKE3 hash of the file's contents. For the kernels: BLAKE3 hash of the names and texts of all kernel files,
    /// including the built-in files that the user's folder does not replace. Null if a file cannot be read.
    pub hash: Option<String>,
    /// The commit that is checked out in the file's repository, and whether the file has been changed since
    /// this commit; "in no commit" if the commit does not contain the file (see [`git_state`]). Null if no git
    /// repository with a commit contains the file, if git is not installed, and for the kernels that raycl's
    /// binary contains.
    pub git: Option<String>,
}

impl Source {
    /// Describes an input file as it is now: its path, the hash of its contents, and its state in git.
    pub fn file(what: &str, path: &Path) -> Self {
        let hash = std::fs::read(path).ok().map(|bytes| blake3::hash(&bytes).to_hex().to_string());
        Self { what: what.to_owned(), path: path.display().to_string(), hash, git: git_state(path) }
    }
}

/// The machine that measured a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Host {
    /// The machine's name on its network; null if the system does not report it.
    #[serde(default)]
    pub name: Option<String>,
    /// The operating system's name and version.
    pub os: String,
    /// The processor's model. If Linux does not report a model, as on 64-bit ARM, the value is the architecture with
    /// the implementer, part and variant of each kind of processor. If Linux does not report these numbers either, the
    /// value is the board's name. If the board has no name, the value is the architecture alone.
    pub cpu: String,
    /// Number of processors (hardware threads) that this process may use; 1 if this number is unknown.
    pub cores: usize,
    /// The cores' clock frequencies.
    #[serde(default)]
    pub clocks: Clocks,
}

/// One OpenCL device. A value is null if the driver does not report the value, or if an earlier version of
/// raycl wrote the file without the value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DeviceEnvironment {
    /// The device's name in records.
    pub device: String,
    /// The name of the device's OpenCL platform.
    pub platform: String,
    /// The version of the device's OpenCL platform.
    pub platform_version: String,
    /// The device's OpenCL version.
    pub version: String,
    /// The device's vendor.
    pub vendor: String,
    /// The driver's version.
    pub driver: String,
    /// The kind of device: "cpu", "gpu", "accelerator" or "other".
    pub kind: String,
    /// The device's number of compute units.
    #[serde(default)]
    pub compute_units: Option<u32>,
    /// Number of threads with which the device executes kernels, if known (PoCL reports this number).
    #[serde(default)]
    pub threads: Option<u32>,
    /// The device's compute capability (NVIDIA's version number of a GPU), if the driver reports it.
    #[serde(default)]
    pub compute_capability: Option<String>,
    /// The highest clock frequency that the driver reports, MHz.
    #[serde(default)]
    pub max_clock_mhz: Option<u64>,
    /// Resolution of the timer with which the driver times kernels, ns.
    #[serde(default)]
    pub timer_resolution_ns: Option<u64>,
    /// Number of the host's processors (hardware threads) that the device may use; null if the device is not a CPU.
    #[serde(default)]
    pub cores: Option<usize>,
    /// The 16 bytes of the device's UUID as hexadecimal digits, if the driver reports the UUID.
    #[serde(default)]
    pub uuid: Option<String>,
    /// The device's PCI address, such as "0000:1b:00.0", if the driver reports the address.
    #[serde(default)]
    pub pci_bus: Option<String>,
    /// The environment variables that affect the device's times, as `NAME=VALUE`.
    #[serde(default)]
    pub settings: Vec<String>,
    /// The variables among `settings` that raycl itself has set, because the user had not set these
    /// variables.
    #[serde(default)]
    pub set_by_raycl: Vec<String>,
}

impl DeviceEnvironment {
    /// Returns those properties of a device that `environment.json` contains.
    pub fn of(info: &DeviceInfo) -> Self {
        let info = info.clone();
        Self {
            device: info.label,
            platform: info.platform,
            platform_version: info.platform_version,
            version: info.version,
            vendor: info.vendor,
            driver: info.driver,
            kind: info.kind.name().to_owned(),
            compute_units: Some(info.limits.compute_units),
            threads: info.threads,
            compute_capability: info.hardware.compute_capability,
            max_clock_mhz: info.hardware.max_clock_mhz,
            timer_resolution_ns: info.hardware.timer_resolution_ns,
            cores: info.cores,
            uuid: info.hardware.uuid,
            pci_bus: info.hardware.pci_bus,
            set_by_raycl: variables::set_by_raycl(&info.settings),
            settings: info.settings,
        }
    }
}

/// Returns true if the device name `shown` (from a record or a page) may mean the device `name`: `shown` must
/// start with `name` or with the device's common name, and a text in brackets may follow. `raycl merge` adds
/// a text in brackets to the names of devices that have the same name but differ, for example in their drivers.
pub(crate) fn is_shown_as(name: &str, shown: &str) -> bool {
    let is_end = |rest: &str| rest.is_empty() || rest.starts_with(" (") && rest.ends_with(')');
    [name, &common_name(name)].iter().any(|name| shown.strip_prefix(*name).is_some_and(is_end))
}

impl Environment {
    /// Returns the hash of a config's text and its overrides.
    pub fn hash_of(config: &str, overrides: &[String]) -> String {
        let mut hasher = blake3::Hasher::new();
        for part in std::iter::once(config).chain(overrides.iter().map(String::as_str)) {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part.as_bytes());
        }
        hasher.finalize().to_hex().to_string()
    }

    /// Writes the environment to `path` as indented JSON.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_json(path, self)
    }
}

impl Host {
    /// Reads the properties of this machine, as far as the operating system reports them.
    pub fn read() -> Self {
        Self {
            name: host_name(),
            os: os_name(),
            cpu: cpu_model().unwrap_or_else(|| std::env::consts::ARCH.into()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            clocks: Clocks::read(),
        }
    }
}

fn host_name() -> Option<String> {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").ok()?;
    Some(name.trim().to_owned()).filter(|name| !name.is_empty())
}

fn os_name() -> String {
    let release = std::fs::read_to_string("/etc/os-release").unwrap_or_default();
    os_in(&release).unwrap_or_else(|| std::env::consts::OS.into())
}

/// Returns the name of the operating system in the text of /etc/os-release; `None` if the text contains no name.
fn os_in(release: &str) -> Option<String> {
    let name = release.lines().find_map(|line| line.strip_prefix("PRETTY_NAME="))?;
    Some(name.trim_matches('"').to_string())
}

fn cpu_model() -> Option<String> {
    let text = |path: &str| std::fs::read_to_string(path).ok();
    let model = text("/proc/cpuinfo").and_then(|cpuinfo| cpu_in(&cpuinfo));
    model.or_else(|| board_in(&text("/proc/device-tree/model")?))
}

/// Returns the model of the first processor in the text of /proc/cpuinfo or, if the text contains no model, the kinds
/// of ARM processors. Returns `None` if the text contains neither.
fn cpu_in(cpuinfo: &str) -> Option<String> {
    value_in(cpuinfo, "model name").map(str::to_owned).or_else(|| arm_processors_in(cpuinfo))
}

/// Returns the kinds of ARM processors in the text of /proc/cpuinfo, such as "aarch64 0x41/0xd0c/0x3": the
/// architecture, then the implementer, part and variant of each kind. (On 64-bit ARM, the text contains no model.)
/// Returns `None` if the text has no implementer, part and variant of a processor.
fn arm_processors_in(cpuinfo: &str) -> Option<String> {
    let kind = |processor: &str| {
        let numbers = ["CPU implementer", "CPU part", "CPU variant"].map(|name| value_in(processor, name));
        let [implementer, part, variant] = numbers;
        Some([implementer?, part?, variant?].join("/"))
    };
    let kinds: BTreeSet<String> = cpuinfo.split("\n\n").filter_map(kind).collect();
    let kinds = Vec::from_iter(kinds).join(", ");
    (!kinds.is_empty()).then(|| format!("{} {kinds}", std::env::consts::ARCH))
}

/// Returns the board's name in the text of /proc/device-tree/model; `None` if the text is empty.
fn board_in(model: &str) -> Option<String> {
    Some(model.trim_end_matches('\0').trim().to_owned()).filter(|model| !model.is_empty())
}

/// Returns the value of the first line with this name in the text of /proc/cpuinfo; `None` if there is no such line.
fn value_in<'a>(cpuinfo: &'a str, name: &str) -> Option<&'a str> {
    let mut lines = cpuinfo.lines().filter_map(|line| line.split_once(':'));
    lines.find(|(own, _)| own.trim() == name).map(|(_, value)| value.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_is_shown_by_its_name_or_with_what_distinguishes_it() {
        for (shown, is) in [
            ("H100", true),
            ("H100 (driver 580)", true),
            ("H100L", false),
            ("H100 NVL (a)", false),
            ("H100 (a", false),
        ] {
            assert_eq!(is_shown_as("H100", shown), is, "{shown}");
        }
        for shown in ["AMD EPYC, PoCL", "AMD EPYC, PoCL (driver 5)", "pthread-zen-AMD EPYC (driver 5)"] {
            assert!(is_shown_as("pthread-zen-AMD EPYC", shown), "{shown}");
        }
    }

    #[test]
    fn an_environment_comes_back_from_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("environment.json");
        let environment = Environment {
            host: Host::read(),
            devices: vec![DeviceEnvironment { kind: "cpu".into(), ..DeviceEnvironment::default() }],
            ..Environment::default()
        };
        environment.write(&path).unwrap();
        let read: Environment = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        assert_eq!(read, environment);
        assert!(std::fs::read_to_string(&path).unwrap().ends_with("}\n"), "the last line has an end");
        assert!(read.host.cores >= 1);
    }

    #[test]
    fn the_config_hash_sees_overrides() {
        let with = Environment::hash_of("a = 1", &["a = 2".to_string()]);
        assert_ne!(with, Environment::hash_of("a = 1", &[]));
        assert_ne!(with, Environment::hash_of("a = 1a = 2", &[]));
    }

    #[test]
    fn a_device_is_described_by_what_its_driver_reports() {
        use crate::device::{DeviceKind, Hardware};
        let asleep = crate::experiment::asleep::device(1.0);
        let info = DeviceInfo {
            platform: "a platform".into(),
            platform_version: "its version".into(),
            name: "a name".into(),
            vendor: "a vendor".into(),
            version: "OpenCL 3.0".into(),
            driver: "a driver".into(),
            kind: DeviceKind::Accelerator,
            limits: crate::device::DeviceLimits { compute_units: 7, ..asleep.limits },
            hardware: Hardware {
                compute_capability: Some("9.0".into()),
                max_clock_mhz: Some(1980),
                timer_resolution_ns: Some(1000),
                pci_bus: Some("0000:1b:00.0".into()),
                uuid: Some("0123".into()),
            },
            // raycl sets the variable POCL_AFFINITY; the user has not set it to this value.
            settings: vec!["A=1".into(), "POCL_AFFINITY=of a test".into()],
            cores: Some(3),
            threads: Some(5),
            label: "a label".into(),
            ..asleep
        };
        let expected = serde_json::json!({
            "device": "a label", "platform": "a platform", "platform_version": "its version", "version": "OpenCL 3.0",
            "vendor": "a vendor", "driver": "a driver", "kind": "accelerator", "compute_units": 7, "threads": 5,
            "compute_capability": "9.0", "max_clock_mhz": 1980, "timer_resolution_ns": 1000, "cores": 3,
            "uuid": "0123", "pci_bus": "0000:1b:00.0", "settings": ["A=1", "POCL_AFFINITY=of a test"],
            "set_by_raycl": ["POCL_AFFINITY=of a test"],
        });
        assert_eq!(serde_json::to_value(DeviceEnvironment::of(&info)).unwrap(), expected);
    }

    #[test]
    fn a_file_is_described_by_its_path_and_the_hash_of_its_text() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        std::fs::write(&path, "abc").unwrap();
        let expected = Source {
            what: "scene".into(),
            path: path.display().to_string(),
            // The hash of "abc" in the test vectors of BLAKE3.
            hash: Some("6437b3ac38465133ffb63b75273a8db548c558465d79db03fd359c6cd5bd9d85".into()),
            git: None,
        };
        assert_eq!(Source::file("scene", &path), expected);
        assert_eq!(Source::file("scene", &folder.path().join("missing")).hash, None);
    }

    #[test]
    fn the_systems_files_name_the_system_and_the_processor() {
        let release = "NAME=\"Debian\"\nPRETTY_NAME=\"Debian GNU/Linux 13 (trixie)\"\nID=debian\n";
        assert_eq!(os_in(release).as_deref(), Some("Debian GNU/Linux 13 (trixie)"));
        assert_eq!(os_in("NAME=Debian\n"), None);
        let cpuinfo =
            "processor\t: 0\nmodel\t\t: 17\nmodel name\t: AMD EPYC: 9B45\n\nmodel name\t: another\n";
        assert_eq!(cpu_in(cpuinfo).as_deref(), Some("AMD EPYC: 9B45"));
        assert_eq!(cpu_in("processor\t: 0\n"), None);
    }

    #[test]
    fn processors_without_a_model_are_named_by_their_kinds_or_their_board() {
        let processor = |part: &str| {
            format!(
                "BogoMIPS\t: 50.00\nCPU implementer\t: 0x41\nCPU architecture: 8\nCPU variant\t: 0x3\n\
                 CPU part\t: {part}\nCPU revision\t: 1\n\n"
            )
        };
        let cpu_of = |parts: &[&str]| cpu_in(&parts.iter().copied().map(processor).collect::<String>());
        let named = |kinds: &str| Some(format!("{} {kinds}", std::env::consts::ARCH));
        assert_eq!(cpu_of(&["0xd0c", "0xd0c"]), named("0x41/0xd0c/0x3"));
        let both = named("0x41/0xd05/0x3, 0x41/0xd0b/0x3");
        assert_eq!([cpu_of(&["0xd0b", "0xd05"]), cpu_of(&["0xd05", "0xd0b", "0xd05"])], [both.clone(), both]);
        assert_eq!(
            board_in("Raspberry Pi 4 Model B Rev 1.4\0").as_deref(),
            Some("Raspberry Pi 4 Model B Rev 1.4")
        );
        assert_eq!(board_in("\0"), None);
    }
}
