//! Selects OpenCL devices by name and kind (CPU, GPU, accelerator), not by number, since a device's number
//! differs between machines.

use super::{Device, DeviceInfo, DeviceKind, common_name, is_pocl};
use crate::error::{Error, Result, nearest};
use crate::sources::Sources;

/// The patterns that select a kind of device.
const KINDS: [&str; 3] = ["cpu", "gpu", "accelerator"];

/// Returns the usable devices that match the patterns of `--device`, each device once, in the order of the
/// patterns. Without patterns, returns every usable device.
///
/// A pattern is `all`, a kind (`cpu`, `gpu`, `accelerator`), or any part of one of these texts: a platform's name, or
/// a device's name, common name or vendor. A pattern that consists of digits matches a text only if the digits are a
/// whole number in the text: `1` does not select an `H100`. The pattern `pocl` also matches every device of PoCL. A
/// pattern can also be whole words of the platform's version, if one of the words has a dot, such as `pocl 3.1`. A
/// pattern can also be a device's whole name for files (`slug`); if several devices have the same name, the label of
/// each of these devices is its name for files. The case of letters does not matter. A pattern that matches no usable
/// device is a user error. A mistake in a kernel file of the user is a user error, too, if a selected device fails the
/// test of its lane operations because of this mistake.
pub fn select(devices: &[Device], patterns: &[String], sources: &Sources) -> Result<Vec<Device>> {
    let infos: Vec<_> = devices.iter().map(|device| &device.info).collect();
    let indices = selected(&infos, patterns)?;
    let mut chosen: Vec<Device> = indices.into_iter().map(|index| devices[index].clone()).collect();
    chosen.iter_mut().try_for_each(|device| device.test_lanes(sources))?;
    Ok(chosen)
}

/// Returns the index of the usable device on which raycl casts if the user names no device. GPUs come before CPUs,
/// CPUs before accelerators (some of which a driver only emulates on a CPU), and accelerators before devices of other
/// kinds. GPUs with memory of their own come before GPUs that share the host's memory. The numbers of compute units do
/// not matter for this order, since vendors count different things as compute units. Among GPUs of the same kind of
/// memory, GPUs with a vendor's driver come before GPUs with PoCL's or Mesa's driver. Among devices that are still
/// equal, the device with the most compute units comes first. Of devices with equally many compute units, the first in
/// `infos` is chosen. Returns `None` if no device is usable.
pub fn default_index(infos: &[DeviceInfo]) -> Option<usize> {
    preferred(&infos.iter().collect::<Vec<_>>())
}

/// Returns the indices of the devices that match the patterns, as [`select`] does.
pub fn matching_indices(infos: &[DeviceInfo], patterns: &[String]) -> Result<Vec<usize>> {
    selected(&infos.iter().collect::<Vec<_>>(), patterns)
}

fn preferred(infos: &[&DeviceInfo]) -> Option<usize> {
    let rank = |kind| match kind {
        DeviceKind::Gpu => 0,
        DeviceKind::Cpu => 1,
        DeviceKind::Accelerator => 2,
        DeviceKind::Other => 3,
    };
    let key = |info: &DeviceInfo| {
        let is_gpu = info.kind == DeviceKind::Gpu;
        let shares_memory = is_gpu && info.limits.shares_memory;
        let is_open_driver = is_gpu && (is_pocl(&info.platform) || info.platform == "rusticl");
        (rank(info.kind), shares_memory, is_open_driver, std::cmp::Reverse(info.limits.compute_units))
    };
    (0..infos.len()).filter(|&index| infos[index].unusable.is_none()).min_by_key(|&index| key(infos[index]))
}

fn selected(infos: &[&DeviceInfo], patterns: &[String]) -> Result<Vec<usize>> {
    let everything = ["all".to_owned()];
    let patterns = if patterns.is_empty() { &everything } else { patterns };
    let mut chosen = Vec::new();
    for pattern in patterns {
        let meant = usable(infos, pattern)?;
        chosen.extend(meant);
    }
    let mut seen = vec![false; infos.len()];
    chosen.retain(|&index| !std::mem::replace(&mut seen[index], true));
    Ok(chosen)
}

/// Returns the usable devices that match one pattern, or an error if no usable device matches.
fn usable(infos: &[&DeviceInfo], pattern: &str) -> Result<Vec<usize>> {
    let matching: Vec<_> = (0..infos.len()).filter(|&index| matches(infos[index], pattern)).collect();
    let (fine, broken): (Vec<_>, Vec<_>) =
        matching.into_iter().partition(|&index| infos[index].unusable.is_none());
    match (fine.is_empty(), broken.is_empty()) {
        (false, _) => Ok(fine),
        (true, true) => Err(no_match(infos, pattern)),
        (true, false) => Err(all_unusable(broken.iter().map(|&index| infos[index]), pattern)),
    }
}

fn matches(info: &DeviceInfo, pattern: &str) -> bool {
    let pattern = pattern.trim().to_lowercase();
    match pattern.as_str() {
        "" => false,
        "all" => true,
        kind if KINDS.contains(&kind) => info.kind.name() == kind,
        // If several devices of a platform have the same name, the label of the first device is also the beginning of
        // the others' labels. A part of a label could thus mean several devices, so only a whole label selects a
        // device.
        _ => {
            names(info).iter().any(|name| has_part(name, &pattern))
                || is_of_version(&info.platform_version, &pattern)
                || info.slug() == pattern
        }
    }
}

/// Returns the platform's name, and the device's name, vendor and common name, all in lower case. A pattern
/// selects the device if [`has_part`] returns true for one of the texts that this function returns. For a
/// device of PoCL, the text "pocl" is added, even if no other text contains this word.
fn names(info: &DeviceInfo) -> Vec<String> {
    let common = common_name(&info.name);
    let names = [&info.platform, &info.name, &info.vendor, &common].map(|name| name.to_lowercase());
    names.into_iter().chain(is_pocl(&info.platform).then(|| "pocl".to_owned())).collect()
}

/// Returns true if a pattern is a part of a name. A pattern of digits has to be a whole number in the name: a user who
/// gives the index of a device, such as 1, does not mean every device with this digit in its name.
pub(crate) fn has_part(name: &str, pattern: &str) -> bool {
    if pattern.bytes().all(|byte| byte.is_ascii_digit()) {
        return name.split(|c: char| !c.is_ascii_digit()).any(|number| number == pattern);
    }
    name.contains(pattern)
}

/// Returns true if a pattern consists of whole words of a platform's version, and at least one of the words has a dot,
/// as in `pocl 3.1`. A pattern without a dot does not match a version, since many words in versions say nothing about
/// the device, such as "None+Asserts" in the version of PoCL.
fn is_of_version(version: &str, pattern: &str) -> bool {
    let (words, wanted) = (version_words(version), version_words(pattern));
    let has_dot = wanted.iter().any(|word| word.contains('.'));
    has_dot && words.windows(wanted.len()).any(|part| part == wanted.as_slice())
}

/// Returns the words of a platform's version in lower case, each word only up to its plus sign: "3.1+debian"
/// becomes "3.1".
fn version_words(version: &str) -> Vec<String> {
    let until_plus = |word: &str| word.split('+').next().unwrap_or(word).to_lowercase();
    version.split_whitespace().map(until_plus).collect()
}

fn no_match(infos: &[&DeviceInfo], pattern: &str) -> Error {
    let question = meant(infos, pattern).map(|word| format!("did you mean '{word}'? ")).unwrap_or_default();
    Error::input(format!("no device matches '{pattern}'")).with_help(format!("{question}{}", listing(infos)))
}

/// For a pattern that matches no device, returns the most similar word that would match a device; `None` if no word is
/// similar. Also returns `None` if the pattern is itself a kind of device, and thus not misspelt. Also returns `None`
/// if the pattern is most similar to a kind that no device has: the user means this kind, so any other suggestion would
/// be wrong.
fn meant(infos: &[&DeviceInfo], pattern: &str) -> Option<String> {
    let pattern = pattern.trim().to_lowercase();
    if KINDS.contains(&pattern.as_str()) {
        return None;
    }
    let is_there = |kind: &&str| infos.iter().any(|info| info.kind.name() == *kind);
    let (present, missing): (Vec<&str>, Vec<&str>) = KINDS.into_iter().partition(is_there);
    // Of equally similar words, the first is suggested, so the kinds that no device has come last.
    let kinds = [present, vec!["all"], missing.clone()].concat();
    let names: Vec<String> = infos.iter().flat_map(|info| names(info)).collect();
    let words = names.iter().flat_map(|name| name.split_whitespace());
    // The parts of a hyphenated word can be suggested, too, such as "pthread" in the name "pthread-skylake".
    let parts = words.clone().flat_map(|word| word.split(|c: char| !c.is_alphanumeric()));
    let words = words.chain(parts);
    let mut candidates: Vec<_> =
        words.map(str::to_owned).chain(kinds.into_iter().map(str::to_owned)).collect();
    candidates.retain(|word| word.len() > 2);
    let nearest = nearest(&pattern, candidates.iter().map(String::as_str));
    nearest.filter(|word| !missing.contains(word)).map(str::to_owned)
}

fn listing(infos: &[&DeviceInfo]) -> String {
    let lines: Vec<_> = infos.iter().map(|info| format!("  {}{}", info.describe(), only(info))).collect();
    format!(
        "Name devices by a part of a device's, platform's or vendor's name, by a label that `raycl devices` shows, by a kind (cpu, gpu, accelerator), or by 'all'. The devices are:\n{}",
        lines.join("\n")
    )
}

/// Returns a text that says how to select only this device, if other devices have the same name; else returns
/// an empty text.
fn only(info: &DeviceInfo) -> String {
    let help = |label: &str| format!("; '{label}' selects only this device");
    info.own_label().map(help).unwrap_or_default()
}

fn all_unusable<'a>(broken: impl Iterator<Item = &'a DeviceInfo>, pattern: &str) -> Error {
    let reasons: Vec<_> = broken
        .map(|info| format!("{}: {}", info.describe(), info.unusable.as_deref().unwrap_or_default()))
        .collect();
    Error::input(format!("no device that matches '{pattern}' can be used")).with_help(reasons.join("\n"))
}

#[cfg(test)]
mod tests {
    use super::super::tests::example;
    use super::*;

    fn machine() -> [DeviceInfo; 4] {
        let pocl = "Portable Computing Language";
        let mut broken = example("Old Platform", "relic", DeviceKind::Accelerator, 900);
        broken.platform_version = "OpenCL 1.0".into();
        broken.unusable = Some("its driver has no compiler for OpenCL C".into());
        let mut gpus = [64, 132].map(|units| example("NVIDIA CUDA", "NVIDIA H200", DeviceKind::Gpu, units));
        for gpu in &mut gpus {
            gpu.platform_version = "OpenCL 3.0 CUDA 13".into();
        }
        let [small, large] = gpus;
        [example(pocl, "pthread-skylake", DeviceKind::Cpu, 200), small, large, broken]
    }

    fn indices(patterns: &[&str]) -> Result<Vec<usize>> {
        let machine = machine();
        let patterns: Vec<_> = patterns.iter().map(|&pattern| pattern.to_owned()).collect();
        selected(&machine.each_ref(), &patterns)
    }

    fn message(patterns: &[&str]) -> String {
        let error = indices(patterns).expect_err("a mistake");
        assert_eq!(error.exit_code(), 2);
        format!("{:?}", miette::Report::new(error))
    }

    #[test]
    fn patterns_match_names_versions_and_kinds_in_any_case() {
        assert_eq!(indices(&["PORTABLE"]).unwrap(), [0]);
        assert_eq!(indices(&["pocl 3.1"]).unwrap(), [0]);
        assert_eq!(indices(&["h200"]).unwrap(), [1, 2]);
        assert_eq!(indices(&["GPU"]).unwrap(), [1, 2]);
        assert_eq!(indices(&["cpu"]).unwrap(), [0]);
    }

    #[test]
    fn a_digit_or_a_word_of_a_version_selects_no_device() {
        let mut pocl = example("Portable Computing Language", "cpu-znver3-AMD EPYC 1", DeviceKind::Cpu, 2);
        pocl.platform_version = "OpenCL 3.0 PoCL 3.1+debian  Linux, None+Asserts, RELOC, LLVM 14.0.6".into();
        let mut gpu = example("NVIDIA CUDA", "NVIDIA H200", DeviceKind::Gpu, 132);
        gpu.platform_version = "OpenCL 3.0 CUDA 13.0.84".into();
        let machine = [pocl, gpu];
        let indices = |pattern: &str| super::matching_indices(&machine, &[pattern.to_owned()]);
        for none in ["0", "2", "14", "none", "reloc", "linux", "3.", ".", "opencl 3", "ocl 3.1"] {
            assert_eq!(indices(none).expect_err(none).exit_code(), 2, "{none}");
        }
        for (pattern, expected) in [
            ("1", vec![0]),
            ("200", vec![1]),
            ("pocl", vec![0]),
            ("PoCL 3.1+debian", vec![0]),
            ("opencl 3.0", vec![0, 1]),
        ] {
            assert_eq!(indices(pattern).unwrap(), expected, "{pattern}");
        }
        assert!(!indices("nope").expect_err("a mistake").remedy().contains("did you mean"));
        let beside = example("Portable Computing Language", "a GPU", DeviceKind::Gpu, 2);
        assert_eq!(super::matching_indices(&[beside], &["pocl".to_owned()]).unwrap(), [0]);
    }

    #[test]
    fn the_whole_label_selects_one_of_several_equal_devices() {
        let mut machine = [0, 1]
            .map(|twins_before| DeviceInfo { twins_before, ..example("CUDA", "H200", DeviceKind::Gpu, 132) });
        machine.iter_mut().for_each(|info| info.label = info.slug());
        let indices = |pattern: &str| super::matching_indices(&machine, &[pattern.to_owned()]);
        let selected = ["cuda-h200", "CUDA-H200-2 ", "h200"].map(|pattern| indices(pattern).unwrap());
        assert_eq!(selected, [vec![0], vec![1], vec![0, 1]]);
        let error = indices("h100").expect_err("a mistake");
        for label in ["cuda-h200", "cuda-h200-2"] {
            assert!(error.remedy().contains(&format!("; '{label}' selects only this device")), "{error:?}");
        }
        assert!(!message(&["h100"]).contains("selects only"), "no label is needed");
    }

    #[test]
    fn each_device_is_chosen_once_in_the_patterns_order() {
        assert_eq!(indices(&["nvidia", "gpu", "all"]).unwrap(), [1, 2, 0]);
        assert_eq!(indices(&[]).unwrap(), [0, 1, 2]);
    }

    #[test]
    fn a_misspelt_name_is_answered_with_the_nearest_and_all_there_is() {
        let message = message(&["nvidai"]);
        for part in ["no device matches 'nvidai'", "did you mean 'nvidia'", "by a label", "pthread-skylake"] {
            assert!(message.contains(part), "{message}");
        }
        assert!(indices(&[""]).is_err());
    }

    #[test]
    fn only_kinds_that_some_device_has_are_suggested_and_never_the_pattern_itself() {
        let cpu = [example("Portable Computing Language", "pthread-skylake", DeviceKind::Cpu, 2)];
        let remedy = |pattern: &str| {
            let error = selected(&cpu.each_ref(), &[pattern.to_owned()]).expect_err("a mistake");
            error.remedy().to_owned()
        };
        for pattern in ["gpu", "GPU", "gpus", "accelerator", "acelerator"] {
            let remedy = remedy(pattern);
            assert!(!remedy.contains("did you mean") && remedy.contains("pthread-skylake"), "{remedy}");
        }
        assert!(remedy("cpuu").starts_with("did you mean 'cpu'?"));
        assert!(remedy("al").starts_with("did you mean 'all'?"));
        assert!(message(&["gpus"]).contains("did you mean 'gpu'?"));
    }

    #[test]
    fn of_equally_similar_kinds_one_that_some_device_has_is_suggested() {
        for (kind, meant) in [(DeviceKind::Gpu, "gpu"), (DeviceKind::Cpu, "cpu")] {
            let device = example("P", "H200", kind, 132);
            let error = selected(&[&device], &["xpu".to_owned()]).expect_err("a mistake");
            assert!(error.remedy().starts_with(&format!("did you mean '{meant}'?")), "{error:?}");
        }
    }

    #[test]
    fn a_part_of_a_misspelt_name_is_answered_with_that_part() {
        for (pattern, meant) in [("pthred", "pthread"), ("pthread-skilake", "pthread-skylake")] {
            let message = message(&[pattern]);
            assert!(message.contains(&format!("did you mean '{meant}'")), "{message}");
        }
    }

    #[test]
    fn an_unusable_device_is_refused_with_its_reason() {
        assert!(message(&["relic"]).contains("no compiler"));
    }

    #[test]
    fn the_default_is_the_largest_usable_gpu() {
        let machine = machine();
        let infos = machine.each_ref();
        assert_eq!(preferred(&infos), Some(2));
        assert_eq!(preferred(&[infos[0], infos[3]]), Some(0));
        assert_eq!(preferred(&[infos[3]]), None);
        assert_eq!(default_index(&machine), Some(2));
    }

    #[test]
    fn a_cpu_comes_before_larger_accelerators_and_of_equal_devices_the_first() {
        let of = |name: &str, kind, units| example("P", name, kind, units);
        let cpu = of("cpu", DeviceKind::Cpu, 2);
        let accelerators = ["one", "two"].map(|name| of(name, DeviceKind::Accelerator, 4));
        let [one, two] = &accelerators;
        assert_eq!(preferred(&[one, &cpu, two]), Some(1));
        assert_eq!(preferred(&[&of("other", DeviceKind::Other, 300), two, one]), Some(1));
    }

    #[test]
    fn a_gpu_with_its_own_memory_comes_first_and_of_its_drivers_the_vendors() {
        let of = |platform: &str, units, shares_memory| {
            let mut info = example(platform, "a GPU", DeviceKind::Gpu, units);
            info.limits.shares_memory = shares_memory;
            info
        };
        let in_processor = of("Intel(R) OpenCL Graphics", 96, true);
        let [of_pocl, of_mesa] =
            ["Portable Computing Language", "rusticl"].map(|platform| of(platform, 24, false));
        let of_vendor = of("NVIDIA CUDA", 24, false);
        assert_eq!(preferred(&[&in_processor, &of_pocl, &of_mesa, &of_vendor]), Some(3));
        assert_eq!(preferred(&[&in_processor, &of_mesa]), Some(1));
        let cpu = {
            let mut info = example("Portable Computing Language", "a CPU", DeviceKind::Cpu, 64);
            info.limits.shares_memory = true;
            info
        };
        // Between CPUs, only the number of compute units decides which CPU is chosen.
        assert_eq!(preferred(&[&example("Intel(R) OpenCL", "a CPU", DeviceKind::Cpu, 8), &cpu]), Some(1));
    }

    #[test]
    fn patterns_match_vendors_and_an_unusable_device_only_if_no_other_matches() {
        assert_eq!(indices(&["a vendor"]).unwrap(), [0, 1, 2]);
        assert_eq!(indices(&["  H200 "]).unwrap(), [1, 2]);
        assert!(message(&["accelerator"]).contains("no device that matches 'accelerator' can be used"));
        assert!(message(&["opencl 1.0"]).contains("relic (Old Platform"));
        let machine = machine();
        let labels = |patterns: &[&str]| -> Vec<String> {
            let patterns: Vec<_> = patterns.iter().map(|&pattern| pattern.to_owned()).collect();
            let indices = super::matching_indices(&machine, &patterns).unwrap();
            indices.into_iter().map(|index| machine[index].label.clone()).collect()
        };
        assert_eq!(labels(&["nvidia", "cpu"]), ["NVIDIA H200", "NVIDIA H200", "pthread-skylake"]);
    }
}
