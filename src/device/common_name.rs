//! Derives the names under which people know devices, such as "AMD EPYC 9B45, PoCL" for the device that PoCL
//! calls "cpu-znver4-AMD EPYC 9B45 96-Core Processor". In this file, *the driver's name* of a device is the name that
//! the driver gives to the device. Files that raycl writes for other programs keep the driver's names.

use std::collections::HashMap;

/// The beginnings of the names that PoCL gives to CPUs. Such a beginning is followed by LLVM's name of the processor's
/// type, such as `znver4` in `cpu-znver4-AMD EPYC`.
const POCL: [&str; 6] = ["cpu-minimal-", "cpu-tbb-", "cpu-", "pthread-", "basic-", "tbb-"];

/// The part numbers of ARM's processors ("CPU part" in `/proc/cpuinfo`), as PoCL writes them, with ARM's names of these
/// processors. PoCL 6 names older processors itself.
const ARM_PARTS: [(&str, &str); 9] = [
    ("0xd0b", "Cortex-A76"),
    ("0xd0c", "Neoverse-N1"),
    ("0xd40", "Neoverse-V1"),
    ("0xd41", "Cortex-A78"),
    ("0xd49", "Neoverse-N2"),
    ("0xd4f", "Neoverse-V2"),
    ("0xd81", "Cortex-A720"),
    ("0xd84", "Neoverse-V3"),
    ("0xd8e", "Neoverse-N3"),
];

/// Returns the name under which people know a device. The name is derived from the driver's name alone, because stored
/// records contain only the driver's name. If the name has none of PoCL's beginnings, only trademark signs, the clock
/// rate and words such as `Processor` are removed.
pub fn common_name(name: &str) -> String {
    // In the results that `raycl merge` writes, a text in brackets at the end of a name distinguishes devices
    // of the same name. A device's common name ends with the same text in brackets as the device's name in
    // the results.
    let brackets = name.find(" (").filter(|_| name.ends_with(')')).unwrap_or(name.len());
    let (name, brackets) = name.split_at(brackets);
    match POCL.iter().find_map(|start| name.strip_prefix(start)) {
        Some(rest) => format!("{}, PoCL{brackets}", plain(&model(rest))),
        None => format!("{}{brackets}", plain(name)),
    }
}

/// Returns the common name of a device. If the driver's name differs, adds it in brackets, since several
/// devices can have the same common name.
pub fn both_names(name: &str) -> String {
    let common = common_name(name);
    if common == name { common } else { format!("{common} ({name})") }
}

/// Returns a map from each name in `names` (the names that drivers give to devices) to the common name. If different
/// names in `names` have the same common name, the map contains each of these names itself in place of the common name.
pub fn common_names<'a>(names: impl Iterator<Item = &'a str>) -> HashMap<&'a str, String> {
    let mut all: HashMap<&str, String> = names.map(|name| (name, common_name(name))).collect();
    let mut counts: HashMap<String, usize> = HashMap::new();
    all.values().for_each(|common| *counts.entry(common.clone()).or_default() += 1);
    all.iter_mut()
        .filter(|(_, common)| counts[*common] > 1)
        .for_each(|(name, common)| *common = (*name).into());
    all
}

/// Returns the processor's model. `rest` consists of LLVM's name of the processor's type, a hyphen and the model, as in
/// `skylake-avx512-Intel(R) Xeon(R) Processor`. LLVM's names of processor types have neither capital letters nor
/// blanks. If `rest` contains only LLVM's name of the processor's type, returns LLVM's name.
fn model(rest: &str) -> String {
    let parts: Vec<&str> = rest.split('-').collect();
    let is_model = |part: &&str| part.contains(|c: char| c.is_uppercase() || c == ' ');
    match parts.iter().position(is_model) {
        Some(first) => parts[first..].join("-"),
        None => arm_model(rest).unwrap_or_else(|| rest.to_owned()),
    }
}

/// Returns the model of an ARM processor. `rest` consists of LLVM's name of the processor's type, which may be missing,
/// and of the processor's name or part number: `neoverse-n1-0xd0c`, `cortex-a72-cortex-a72`, `-0xd0c`. Returns `None`
/// if `rest` has neither a part number nor a name that begins with `cortex-` or `neoverse-`.
fn arm_model(rest: &str) -> Option<String> {
    if let Some((of_llvm, part)) = rest.rsplit_once('-').filter(|(_, part)| part.starts_with("0x")) {
        let known =
            || ARM_PARTS.iter().find(|(number, _)| *number == part).map(|(_, name)| (*name).to_owned());
        return arm_name(of_llvm).or_else(known).or_else(|| Some(format!("CPU part {part}")));
    }
    let families = ["cortex-", "neoverse-"];
    families.iter().find_map(|family| rest.rfind(family)).and_then(|start| arm_name(&rest[start..]))
}

/// Writes LLVM's name of an ARM processor, such as `neoverse-n1`, as ARM does: `Neoverse-N1`. Returns `None` if the
/// name has fewer than two words, or if a word is empty.
fn arm_name(of_llvm: &str) -> Option<String> {
    let capital = |word: &str| {
        let (first, others) = word.split_at_checked(1)?;
        Some(first.to_uppercase() + others)
    };
    let words: Option<Vec<String>> = of_llvm.split('-').map(capital).collect();
    words.filter(|words| words.len() > 1).map(|words| words.join("-"))
}

/// Returns a model's name without trademark signs, clock rate, number of cores and the word `Processor`. If the name
/// begins with `Intel`, the word `CPU` is removed, too.
fn plain(name: &str) -> String {
    let without_marks = ["(R)", "(r)", "(TM)", "(tm)", "®", "™"]
        .iter()
        .fold(name.to_owned(), |name, mark| name.replace(mark, ""));
    let model = without_marks.split(" @ ").next().unwrap_or_default();
    let is_intel = model.starts_with("Intel");
    let adds_nothing =
        |word: &&str| !(*word == "Processor" || word.ends_with("-Core") || is_intel && *word == "CPU");
    model.split_whitespace().filter(adds_nothing).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processors_are_named_as_people_know_them() {
        for (driver, common) in [
            ("pthread-skylake-avx512-Intel(R) Xeon(R) Processor", "Intel Xeon, PoCL"),
            ("cpu-znver4-AMD EPYC 9B45 96-Core Processor", "AMD EPYC 9B45, PoCL"),
            ("pthread-AMD EPYC 9B14", "AMD EPYC 9B14, PoCL"),
            ("cpu-haswell-Intel(R) Xeon(R) CPU E5-2690 v3 @ 2.60GHz", "Intel Xeon E5-2690 v3, PoCL"),
            ("cpu-x86-64-v3-Common KVM processor", "Common KVM processor, PoCL"),
            ("pthread-cortex-a72", "Cortex-A72, PoCL"),
            ("cpu-cortex-a72-cortex-a72", "Cortex-A72, PoCL"),
            ("cpu--cortex-a72", "Cortex-A72, PoCL"),
            ("cpu-neoverse-n1-0xd0c", "Neoverse-N1, PoCL"),
            ("cpu--0xd0c", "Neoverse-N1, PoCL"),
            ("cpu--0xfff", "CPU part 0xfff, PoCL"),
            ("cpu-generic-0xd4f", "Neoverse-V2, PoCL"),
            ("cpu-skylake-avx512", "skylake-avx512, PoCL"),
            ("cpu-alderlake-13th Gen Intel(R) Core(TM) i7-1360P", "13th Gen Intel Core i7-1360P, PoCL"),
            // Names that Intel's driver gives to CPUs, names of GPUs, and the name of the host in records.
            ("Intel(R) Xeon(R) Platinum 8481C CPU @ 2.70GHz", "Intel Xeon Platinum 8481C"),
            ("Intel(R) UHD Graphics 770", "Intel UHD Graphics 770"),
            ("NVIDIA H200", "NVIDIA H200"),
            ("gfx90a:sramecc+:xnack-", "gfx90a:sramecc+:xnack-"),
            ("host", "host"),
            // Devices in results that `raycl merge` wrote: a text in brackets distinguishes devices of the same name.
            ("cpu-znver4-AMD EPYC 9B45 96-Core Processor (driver 5)", "AMD EPYC 9B45, PoCL (driver 5)"),
            ("Intel(R) Xeon(R) CPU @ 2.70GHz (driver 5)", "Intel Xeon (driver 5)"),
        ] {
            assert_eq!(common_name(driver), common, "{driver}");
            assert_eq!(common_name(common), common);
        }
    }

    #[test]
    fn devices_that_would_have_the_same_name_keep_their_drivers_names() {
        let [old, new, gpu] = ["pthread-znver4-AMD EPYC 9B45", "cpu-znver4-AMD EPYC 9B45", "NVIDIA H200"];
        let names = common_names([old, new, gpu].into_iter());
        assert_eq!([&names[old], &names[new], &names[gpu]], [old, new, gpu]);
        let names = common_names([old, gpu, old].into_iter());
        assert_eq!([&names[old], &names[gpu]], ["AMD EPYC 9B45, PoCL", gpu]);
    }
}
