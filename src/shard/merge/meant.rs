//! Selects the kinds of device whose results are merged.

use crate::device::{DeviceKind, common_name, has_part};
use crate::error::{Error, Result};
use crate::existing;
use crate::record::HOST;
use crate::record::journals::ENVIRONMENT;
use crate::shard::missing::names;
use crate::shard::{Attempt, Kind};
use serde_json::Value;
use std::collections::HashMap;

/// The type of each kind of device, such as "gpu", by [`Kind::identity`].
pub type Types = HashMap<String, String>;

/// Returns the types of the devices that attempts measured on. The type of a device, such as "gpu", is read
/// from the description of the environment in the attempt's folder. An attempt that was killed before it
/// wrote this description is left out, since it has no records.
pub fn types_of_devices(attempts: &[Attempt]) -> Result<Types> {
    let mut types = Types::new();
    for attempt in attempts {
        let environment = existing::bytes(&attempt.folder.join(ENVIRONMENT))?;
        let Some((environment, about)) = environment.zip(attempt.about()?) else { continue };
        // `about.devices` and `of_devices` have the attempt's devices in the same order.
        let of_devices = device_types(&environment).unwrap_or_default();
        types.extend(about.devices.into_iter().zip(of_devices));
    }
    Ok(types)
}

/// Returns the types of the devices in an attempt's environment; `None` if the environment is damaged.
fn device_types(environment: &[u8]) -> Option<Vec<String>> {
    let mut environment: Value = serde_json::from_slice(environment).ok()?;
    let devices: Vec<Value> = serde_json::from_value(environment["devices"].take()).ok()?;
    Some(devices.iter().map(|device| device["kind"].as_str().unwrap_or_default().to_owned()).collect())
}

/// Returns the kinds of device that took part in the experiment and are selected, and the words in `meant` that match
/// no kind. If `meant` has no words, all kinds of device are selected. The kinds of host, on which baselines run, are
/// always selected. A word is `all`, a type of device (`cpu`, `gpu`, `accelerator`), or a part of a kind's
/// description. As with `raycl run --device`, a word that consists only of digits matches a whole number in the
/// description, but not a part of a longer number. A word may match only the host, for example because the host's
/// processor has the same vendor as a GPU. Such a word counts as a word that matches no kind, unless it is `all` or
/// `host`.
///
/// # Errors
///
/// Returns an input error if a word is blank. Returns an input error, too, if kinds of device took part and `meant`
/// has words, but none of these words matches a kind: otherwise, the merge would discard the results of devices that
/// an earlier merge wrote.
pub fn meant_kinds(all: &[Kind], types: &Types, meant: &[String]) -> Result<(Vec<Kind>, Vec<String>)> {
    let plain = |word: &String| word.trim().to_lowercase();
    let has = |kind: &Kind, word: &String| matches(kind, types.get(&kind.identity), &plain(word));
    let names_host = |word: &String| ["all", HOST].contains(&plain(word).as_str());
    let is_selected =
        |kind: &Kind, word: &String| has(kind, word) && (kind.device != HOST || names_host(word));
    let not_begun: Vec<String> =
        meant.iter().filter(|word| !all.iter().any(|kind| is_selected(kind, word))).cloned().collect();
    let matches_none = !all.is_empty() && not_begun.len() == meant.len();
    let blank = meant.iter().find(|word| word.trim().is_empty());
    if let Some(word) = blank.or(meant.first().filter(|_| matches_none)) {
        return Err(no_match(all, word));
    }
    let is_meant =
        |kind: &Kind| meant.is_empty() || kind.device == HOST || meant.iter().any(|word| has(kind, word));
    Ok((all.iter().filter(|kind| is_meant(kind)).cloned().collect(), not_begun))
}

/// Returns the error about a word that matches no kind of device.
fn no_match(all: &[Kind], word: &str) -> Error {
    let listing = if all.is_empty() { "none".to_owned() } else { names(all) };
    Error::input(format!("no device with results matches '{word}'")).with_help(format!(
        "name a part of a device's description, a kind (cpu, gpu, accelerator), or all; devices with results: {listing}"
    ))
}

/// Returns true if `word`, which is in lower case, selects `kind`. `known` is the type of the kind's devices.
/// If the type of the kind's devices is unknown, a word such as `gpu` is looked for in the kind's
/// description, like any other word.
fn matches(kind: &Kind, known: Option<&String>, word: &str) -> bool {
    let types = [DeviceKind::Cpu, DeviceKind::Gpu, DeviceKind::Accelerator].map(DeviceKind::name);
    let is_type = types.contains(&word);
    match known {
        _ if word == "all" => true,
        _ if is_type && kind.device == HOST => false,
        Some(known) if is_type => known == word,
        _ => has_part(&description(kind).to_lowercase(), word),
    }
}

/// Returns a kind's description: the name and the identity of its devices, and then the same texts with common names
/// in place of the names that drivers give. raycl prints common names, so a user may give a common name.
fn description(kind: &Kind) -> String {
    let parts = std::iter::once(kind.device.as_str()).chain(kind.identity.split(" | "));
    let common: Vec<String> = parts.map(common_name).collect();
    format!("{} | {} | {}", kind.device, kind.identity, common.join(" | "))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::shard::About;
    use serde_json::json;

    fn kind(device: &str, identity: &str) -> Kind {
        Kind { device: device.into(), identity: identity.into(), ..Kind::default() }
    }

    /// Returns the names of the selected kinds of device, and the words that match no kind.
    fn selected(all: &[Kind], types: &Types, words: &[&str]) -> (Vec<String>, Vec<String>) {
        let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
        let (kinds, not_begun) = meant_kinds(all, types, &words).unwrap();
        (kinds.into_iter().map(|kind| kind.device).collect(), not_begun)
    }

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn words_select_kinds_by_device_or_identity_and_the_host_is_always_selected() {
        let all = [kind("host", "amd"), kind("NVIDIA H200", "CUDA | driver 580"), kind("cpu", "PoCL | 7.0")];
        let selected = |words: &[&str]| selected(&all, &Types::new(), words);
        assert_eq!(selected(&[]), (names(&["host", "NVIDIA H200", "cpu"]), vec![]));
        assert_eq!(selected(&["h200"]), (names(&["host", "NVIDIA H200"]), vec![]));
        // Blanks around a word, as after a comma in a list, are not part of the word.
        assert_eq!(selected(&["  h200"]), (names(&["host", "NVIDIA H200"]), vec![]));
        assert_eq!(selected(&["POCL"]), (names(&["host", "cpu"]), vec![]));
        assert_eq!(selected(&["h200", "mi300"]), (names(&["host", "NVIDIA H200"]), names(&["mi300"])));
        assert_eq!(selected(&["cpu"]), (names(&["host", "cpu"]), vec![]), "the types are unknown");
    }

    #[test]
    fn a_number_selects_kinds_only_as_a_whole() {
        let all = [kind("NVIDIA H200", "CUDA | driver 580"), kind("cpu", "PoCL | 7.0")];
        let selected = |word: &str| selected(&all, &Types::new(), &[word]);
        assert_eq!(selected("200"), (names(&["NVIDIA H200"]), vec![]));
        assert_eq!(selected("7"), (names(&["cpu"]), vec![]));
        assert!(meant_kinds(&all, &Types::new(), &names(&["20"])).is_err());
    }

    #[test]
    fn the_common_name_of_a_device_selects_its_kind() {
        let driver = "pthread-skylake-avx512-Intel(R) Xeon(R) Processor";
        // If several devices have the same name, raycl gives each of them a label, which differs from the driver's
        // name.
        let label = kind("pocl-cpu-2", &format!("PoCL | {driver} | 7.0"));
        for all in [kind(driver, "PoCL"), label].map(|kind| [kind, self::kind("NVIDIA H200", "CUDA")]) {
            for word in ["Intel Xeon", "intel xeon, pocl"] {
                assert_eq!(
                    selected(&all, &Types::new(), &[word]).0,
                    names(&[all[0].device.as_str()]),
                    "{word}"
                );
            }
        }
    }

    #[test]
    fn a_blank_word_and_words_that_match_no_kind_are_refused_with_the_kinds_that_took_part() {
        let all = [kind("host", "amd"), kind("cpu-znver4-AMD EPYC 9B45", "PoCL")];
        let error =
            |all: &[Kind], words: &[&str]| meant_kinds(all, &Types::new(), &names(words)).unwrap_err();
        for (words, blamed) in [(&["h200", "mi300"][..], "h200"), (&["host", ""][..], ""), (&[" "][..], " ")]
        {
            let error = error(&all, words);
            let message = format!("no device with results matches '{blamed}'");
            assert_eq!((error.to_string(), error.exit_code()), (message, 2));
            let listing = "devices with results: host; AMD EPYC 9B45, PoCL (cpu-znver4-AMD EPYC 9B45)";
            assert!(error.remedy().ends_with(listing), "{error:?}");
        }
        assert!(error(&[], &[""]).remedy().ends_with("devices with results: none"));
        assert_eq!(selected(&[], &Types::new(), &["h200"]), (vec![], names(&["h200"])), "no shard has begun");
    }

    /// A merge of the baselines alone discards the merged results of all devices. If a word for a device selected
    /// only the host, the user would lose these results by mistake.
    #[test]
    fn a_word_that_matches_only_the_hosts_processor_selects_no_kind() {
        let all = [kind("host", "AMD EPYC 9B45"), kind("NVIDIA H200", "CUDA")];
        let selected = |all: &[Kind], words: &[&str]| selected(all, &Types::new(), words);
        for kinds in [&all[..], &all[..1]] {
            let error = meant_kinds(kinds, &Types::new(), &names(&["amd"])).unwrap_err();
            assert_eq!(error.to_string(), "no device with results matches 'amd'");
            assert_eq!(selected(kinds, &["Host "]), (names(&["host"]), vec![]));
        }
        assert_eq!(selected(&all, &["amd", "h200"]), (names(&["host", "NVIDIA H200"]), names(&["amd"])));
        assert_eq!(selected(&all[..1], &["all"]), (names(&["host"]), vec![]));
    }

    #[test]
    fn types_of_devices_and_all_select_kinds_as_they_select_devices_for_a_run() {
        let out = tempfile::tempdir().unwrap();
        let about =
            About { shard: 1, of: 1, devices: names(&["CUDA | H200", "PoCL | EPYC"]), ..About::default() };
        // The attempts at the shards 1 and 3 have no environment.
        Attempt::begin(out.path(), &about).unwrap();
        let attempt = Attempt::begin(out.path(), &About { shard: 2, ..about.clone() }).unwrap();
        let environment = json!({ "devices": [{ "kind": "gpu" }, { "kind": "cpu" }] });
        std::fs::write(attempt.folder.join("environment.json"), environment.to_string()).unwrap();
        Attempt::begin(out.path(), &About { shard: 3, ..about }).unwrap();
        let types = types_of_devices(&Attempt::all(out.path()).unwrap()).unwrap();
        let all = [kind("host", "Xeon CPU"), kind("H200", "CUDA | H200"), kind("EPYC", "PoCL | EPYC")];
        let selected = |words: &[&str]| selected(&all, &types, words);
        assert_eq!(selected(&["GPU"]), (names(&["host", "H200"]), vec![]));
        assert_eq!(selected(&["cpu"]), (names(&["host", "EPYC"]), vec![]));
        assert_eq!(selected(&["all"]), (names(&["host", "H200", "EPYC"]), vec![]));
        let two = selected(&["cpu", "accelerator"]);
        assert_eq!(two, (names(&["host", "EPYC"]), names(&["accelerator"])));
        // The host, on which baselines run, is not a device of the type `cpu`, so the word `cpu` matches no
        // kind.
        assert!(meant_kinds(&all[..1], &types, &names(&["cpu"])).is_err());
    }
}
