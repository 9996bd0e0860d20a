//! The host's memory: how much this process may still allocate, and how much it has used.

use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Memory that this process may still allocate, and the source of this number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Available {
    /// Available bytes; `u64::MAX` if the system does not report available memory.
    pub bytes: u64,
    /// The path of the file from which `bytes` comes: the file states `bytes`, or a limit on memory from which `bytes`
    /// was computed. The text is "nothing" if the system does not report available memory.
    pub source: String,
}

impl Available {
    /// Returns the smallest of the machine's available memory, the memory that the control groups of this process still
    /// allow, and the rest of the process's address space (`ulimit -v`).
    pub fn read() -> Self {
        let machine = read_text(Path::new(MEMINFO)).and_then(|text| meminfo_available(&text));
        let machine = machine.map(|bytes| Self { bytes, source: MEMINFO.to_owned() });
        let groups = read_text(Path::new("/proc/self/cgroup")).unwrap_or_default();
        let folders = group_folders(&groups);
        let groups = folders.iter().filter_map(|(folder, files)| group_available(folder, files));
        let space = address_space_left().map(|bytes| Self { bytes, source: LIMITS.to_owned() });
        let unknown = || Self { bytes: u64::MAX, source: "nothing".to_owned() };
        groups.chain(machine).chain(space).min_by_key(|available| available.bytes).unwrap_or_else(unknown)
    }

    /// Returns an error if `bytes` is more than the available memory. For the message, `what` names the allocation,
    /// and `sum` shows how its size is computed.
    pub fn hold(&self, bytes: u64, what: &str, sum: &str) -> Result<()> {
        if bytes <= self.bytes {
            return Ok(());
        }
        let message = format!(
            "{what} needs about {} of memory ({sum} = {bytes} B), but only {} are available ({} B according to {})",
            readable(bytes),
            readable(self.bytes),
            self.bytes,
            self.source
        );
        Err(Error::input(message).with_help(if self.source == LIMITS { UNLIMITED } else { FEWER }))
    }
}

/// Returns true if a message says that the limit of the address space (`ulimit -v`) leaves too little memory.
pub fn blames_address_space(message: &str) -> bool {
    message.contains(LIMITS)
}

/// The remedy if the limit of the address space leaves too little memory.
pub const UNLIMITED: &str = "remove the limit of the address space with `ulimit -v unlimited`; in a batch job, ask for more memory instead; or choose a smaller image or scene";
/// The remedy if there is too little memory for a reason other than a limit of the address space.
const FEWER: &str = "use fewer triangles or pixels, end other programs, or raise the memory limit";

const STATUS: &str = "/proc/self/status";
const MEMINFO: &str = "/proc/meminfo";
const LIMITS: &str = "/proc/self/limits";

/// Returns how many bytes the address space of this process may have (`ulimit -v`); `None` if there is no
/// limit, or if the system does not report the limit.
pub fn address_space_limit() -> Option<u64> {
    address_space(&read_text(Path::new(LIMITS))?)
}

/// Returns how many more bytes of address space this process may use; `None` if there is no limit, or if the
/// system does not report the limit or the number of bytes in use.
fn address_space_left() -> Option<u64> {
    left_below(&read_text(Path::new(LIMITS))?, &read_text(Path::new(STATUS))?)
}

/// Returns how many more bytes of address space a process may use, according to the texts of its files `limits` and
/// `status` in /proc; `None` if there is no limit, or if the texts lack the limit or the number of bytes in use.
fn left_below(limits: &str, status: &str) -> Option<u64> {
    let used = kibibytes(status, "VmSize:")?;
    Some(address_space(limits)?.saturating_sub(used))
}

/// The size of a new thread's stack if stacks have no limit, as glibc chooses it on x86-64 and AArch64.
#[cfg(unix)]
const UNLIMITED_STACK_BYTES: u64 = 2 << 20;

/// Returns the size of the stacks that drivers' threads get by default (`ulimit -s`).
#[cfg(unix)]
pub fn thread_stack_bytes() -> u64 {
    use rustix::process::{Resource, getrlimit};
    getrlimit(Resource::Stack).current.unwrap_or(UNLIMITED_STACK_BYTES)
}

/// Returns the size of the stacks that drivers' threads get by default: 1 MiB, as on Windows.
#[cfg(not(unix))]
pub fn thread_stack_bytes() -> u64 {
    1 << 20
}

/// Returns the soft limit of the address space that `text`, the content of /proc/self/limits, states. Returns `None`
/// if this limit is "unlimited" or missing.
fn address_space(text: &str) -> Option<u64> {
    let values = text.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    values.split_whitespace().next()?.parse().ok()
}

/// Returns the largest amount of memory that this process has used at any time (VmHWM); `None` if the system
/// does not report this number.
pub fn peak_bytes() -> Option<u64> {
    peak_in(&read_text(Path::new(STATUS))?)
}

/// Returns the largest amount of memory that a process has used, according to the text of its file `status`
/// in /proc.
fn peak_in(status: &str) -> Option<u64> {
    kibibytes(status, "VmHWM:")
}

/// Returns the memory that this process uses now (VmRSS); `None` if the system does not report this number.
pub fn resident_bytes() -> Option<u64> {
    resident_in(&read_text(Path::new(STATUS))?)
}

/// Returns the memory that a process uses, according to the text of its file `status` in /proc.
fn resident_in(status: &str) -> Option<u64> {
    kibibytes(status, "VmRSS:")
}

/// Formats bytes in decimal units: "512 B", "3.4 MB", "1.2 GB".
pub fn readable(bytes: u64) -> String {
    let number = bytes as f64;
    match bytes {
        1_000_000_000.. => format!("{:.1} GB", number / 1e9),
        1_000_000.. => format!("{:.1} MB", number / 1e6),
        1_000.. => format!("{:.1} kB", number / 1e3),
        _ => format!("{bytes} B"),
    }
}

fn read_text(path: &Path) -> Option<String> {
    std::fs::read_to_string(path).ok()
}

fn meminfo_available(text: &str) -> Option<u64> {
    kibibytes(text, "MemAvailable:")
}

/// Returns the value of a line such as `VmHWM:   1234 kB`, in bytes.
fn kibibytes(text: &str, key: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

/// The names that one version of Linux's control groups uses: the file with the limit of memory, the file with the
/// memory in use, and the keys in `memory.stat` for those parts of the memory in use that can be reclaimed.
struct GroupFiles {
    limit: &'static str,
    used: &'static str,
    reclaimable: [&'static str; 2],
}

const VERSION_1: GroupFiles = GroupFiles {
    limit: "memory.limit_in_bytes",
    used: "memory.usage_in_bytes",
    reclaimable: ["total_inactive_file", "total_active_file"],
};
const VERSION_2: GroupFiles =
    GroupFiles { limit: "memory.max", used: "memory.current", reclaimable: ["inactive_file", "active_file"] };

/// Returns the folder of every control group whose limit applies to a process, innermost first. `text` is the content
/// of the process's /proc/self/cgroup. A container may see its own control group as the root of all groups,
/// so the root is always included.
fn group_folders(text: &str) -> Vec<(PathBuf, &'static GroupFiles)> {
    let mut folders = Vec::new();
    for line in text.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(path)) = (parts.next(), parts.next()) else { continue };
        let (root, files) = match controllers {
            "" => ("/sys/fs/cgroup", &VERSION_2),
            _ if controllers.split(',').any(|name| name == "memory") => ("/sys/fs/cgroup/memory", &VERSION_1),
            _ => continue,
        };
        let relative = Path::new(path.trim_start_matches('/'));
        folders.extend(relative.ancestors().map(|ancestor| (Path::new(root).join(ancestor), files)));
    }
    folders
}

fn group_available(folder: &Path, files: &GroupFiles) -> Option<Available> {
    let text = |name: &str| read_text(&folder.join(name));
    let bytes =
        group_left(&text(files.limit)?, &text(files.used)?, &text("memory.stat")?, files.reclaimable)?;
    Some(Available { bytes, source: folder.join(files.limit).display().to_string() })
}

/// Returns how many more bytes a control group's limit allows; `None` if there is no limit. File pages count as free:
/// before Linux refuses memory, it reclaims file pages, even recently used ones (`active_file`).
fn group_left(limit: &str, used: &str, stat: &str, reclaimable: [&str; 2]) -> Option<u64> {
    let limit: u64 = limit.trim().parse().ok()?; // version 2 writes "max" if there is no limit
    let used: u64 = used.trim().parse().ok()?;
    let entry = |key: &str| {
        let bytes = |line: &str| line.strip_prefix(key)?.strip_prefix(' ')?.trim().parse::<u64>().ok();
        stat.lines().find_map(bytes).unwrap_or(0)
    };
    let reclaimable = reclaimable.map(entry).into_iter().fold(0, u64::saturating_add);
    Some(limit.saturating_sub(used.saturating_sub(reclaimable)))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn the_soft_limit_of_the_address_space_is_read_in_bytes() {
        let with = |soft: &str| {
            let other = "Max resident set          7                    unlimited            bytes";
            address_space(&format!(
                "{other}\nMax address space         {soft}            unlimited            bytes\n"
            ))
        };
        assert_eq!(
            (with("409600000"), with("unlimited"), address_space("")),
            (Some(409_600_000), None, None)
        );
    }

    #[test]
    fn the_machines_memory_is_read_in_kibibytes() {
        let text = "MemTotal:       24684160 kB\nMemFree: 1 kB\nMemAvailable:   23000000 kB\n";
        assert_eq!(meminfo_available(text), Some(23_000_000 * 1024));
        assert_eq!(meminfo_available("MemTotal: 5 kB\n"), None);
    }

    /// The lines of the file `status` of a process that state how much memory the process uses or used.
    const LINES: &str =
        "VmPeak:\t     900 kB\nVmSize:\t     300 kB\nVmHWM:\t     200 kB\nVmRSS:\t     100 kB\n";

    #[test]
    fn memory_in_use_is_not_taken_for_address_space() {
        assert_eq!([peak_in(LINES), resident_in(LINES)], [Some(204_800), Some(102_400)]);
    }

    #[test]
    fn a_limit_of_the_address_space_leaves_what_is_not_reserved() {
        let left = |soft: &str| left_below(&format!("Max address space {soft} unlimited bytes\n"), LINES);
        assert_eq!([left("409600"), left("1024"), left("unlimited")], [Some(102_400), Some(0), None]);
    }

    #[test]
    fn a_groups_limit_leaves_what_is_not_used_or_can_be_given_back() {
        let stat = "anon 5\ninactive_file 300\nactive_file 50\n";
        let left = |limit, used, stat| group_left(limit, used, stat, VERSION_2.reclaimable);
        assert_eq!(left("1000\n", "900\n", stat), Some(450));
        assert_eq!(left("1000", "2000", ""), Some(0));
        assert_eq!(left("max\n", "900\n", stat), None);
        let most = format!("inactive_file 300\nactive_file {}\n", u64::MAX);
        assert_eq!(left("1000", "900", most.as_str()), Some(1000));
    }

    #[test]
    fn both_versions_of_control_groups_and_all_parents_count() {
        let folders = |text| group_folders(text).into_iter().map(|(folder, _)| folder).collect::<Vec<_>>();
        let [pod, slice, root] = ["a/b", "a", ""].map(|part| Path::new("/sys/fs/cgroup").join(part));
        assert_eq!(folders("0::/a/b\n"), [pod, slice, root]);
        let [own, root] = ["x", ""].map(|part| Path::new("/sys/fs/cgroup/memory").join(part));
        assert_eq!(folders("5:devices:/\n4:memory,hugetlb:/x\n"), [own, root]);
    }

    #[test]
    fn this_machine_reports_what_it_has_and_what_was_taken() {
        if cfg!(target_os = "linux") {
            let available = Available::read();
            assert!((1 << 20..1 << 50).contains(&available.bytes), "{available:?}");
            assert!(peak_bytes().is_some_and(|bytes| bytes > 1 << 20));
        }
    }

    #[test]
    fn too_much_is_refused_with_its_arithmetic() {
        let available = Available { bytes: 1000, source: "a test".to_owned() };
        assert!(available.hold(1000, "this", "10 B x 100").is_ok());
        let message = available.hold(1010, "this", "10 B x 101").unwrap_err().to_string();
        assert_eq!(
            message,
            "this needs about 1.0 kB of memory (10 B x 101 = 1010 B), but only 1.0 kB are available (1000 B according to a test)"
        );
    }

    #[test]
    fn a_limit_of_the_address_space_is_blamed() {
        for (source, is_limit) in [(LIMITS, true), (MEMINFO, false)] {
            let available = Available { bytes: 1000, source: source.to_owned() };
            let error = available.hold(1001, "this", "its length").unwrap_err();
            assert_eq!(error.remedy().contains("ulimit -v unlimited"), is_limit, "{error}");
            assert_eq!(blames_address_space(&error.to_string()), is_limit, "{error}");
        }
    }

    #[test]
    fn bytes_are_readable() {
        let all = [999, 1_500, 2_340_000, 12_000_000_000].map(readable);
        assert_eq!(all, ["999 B", "1.5 kB", "2.3 MB", "12.0 GB"]);
    }

    #[test]
    fn in_the_first_version_of_control_groups_what_groups_below_can_give_back_counts() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("memory.limit_in_bytes", "1000\n");
        write("memory.usage_in_bytes", "900\n");
        write(
            "memory.stat",
            "inactive_file 5\nactive_file 6\ntotal_inactive_file 300\ntotal_active_file 70\n",
        );
        let Available { bytes, source } = group_available(folder.path(), &VERSION_1).unwrap();
        assert_eq!((bytes, source.ends_with("memory.limit_in_bytes")), (470, true), "{source}");
    }
}
