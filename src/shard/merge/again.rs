//! Reports shards that were attempted more than once, for example after a requeue. The first attempt may still have
//! been running during the second attempt, and may have changed the second attempt's times.

use super::lines;
use crate::error::Result;
use crate::record::Sample;
use crate::record::journals::SAMPLES;
use crate::shard::Attempt;
use crate::words::few;
use std::collections::BTreeMap;

/// Returns a note that names the attempts at each shard with several attempts that took samples on the same devices;
/// `None` if there is no such shard.
pub fn attempted_again(attempts: &[Attempt]) -> Result<Option<String>> {
    let mut of_shards: BTreeMap<(u32, Vec<String>), Vec<&str>> = BTreeMap::new();
    for attempt in attempts {
        if !took_samples(attempt)? {
            continue;
        }
        let Some(about) = attempt.about()? else { continue };
        of_shards.entry((about.shard, about.devices)).or_default().push(&attempt.name);
    }
    let texts: Vec<String> = of_shards
        .iter()
        .filter(|(_, names)| names.len() > 1)
        .map(|((shard, _), names)| format!("{} attempts at shard {shard} ({})", names.len(), few(names)))
        .collect();
    Ok((!texts.is_empty()).then(|| {
        format!("There were {}. Attempts that ran at the same time may have slowed each other.", few(&texts))
    }))
}

/// Returns true if an attempt took samples. An attempt at a shard that an earlier attempt has finished takes none, and
/// has at most copies of the earlier attempt's samples.
fn took_samples(attempt: &Attempt) -> Result<bool> {
    let samples = lines::<Sample>(&attempt.folder.join(SAMPLES))?;
    Ok(samples.iter().any(|sample| sample.origin.is_none()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::JsonLines;
    use crate::shard::About;

    #[test]
    fn attempts_at_one_shard_on_the_same_devices_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let begin = |shard, host: &str, device: &str, samples: &[Option<&str>]| {
            let about = About {
                shard,
                of: 4,
                host: host.into(),
                devices: vec![device.to_owned()],
                ..About::default()
            };
            let attempt = Attempt::begin(folder.path(), &about).unwrap();
            let sample =
                |origin: &Option<&str>| Sample { origin: origin.map(str::to_owned), ..Sample::default() };
            let samples: Vec<Sample> = samples.iter().map(sample).collect();
            JsonLines::append_to(&attempt.folder.join(SAMPLES)).unwrap().append_all(&samples).unwrap();
        };
        begin(1, "n1", "gpu", &[None]);
        begin(1, "n1", "cpu", &[None]);
        begin(3, "n3", "cpu", &[None]);
        // Attempts that measured nothing did not slow the others.
        begin(3, "n1", "cpu", &[]);
        begin(3, "n2", "cpu", &[Some("shard-00003.n3..r00 launch 0")]);
        let note = || attempted_again(&Attempt::all(folder.path()).unwrap()).unwrap();
        assert_eq!(note(), None);
        begin(3, "n4", "cpu", &[Some("shard-00003.n3..r00 launch 0"), None]);
        assert_eq!(
            note().as_deref(),
            Some(
                "There were 2 attempts at shard 3 (shard-00003.n3..r00, shard-00003.n4..r00). Attempts that ran at the \
                 same time may have slowed each other."
            )
        );
    }
}
