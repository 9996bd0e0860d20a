//! Reports shards that were attempted more than once, for example after a requeue. The first attempt at a shard may
//! still have been running during the second attempt, and may have slowed down the second attempt.

use super::lines;
use crate::error::Result;
use crate::record::Sample;
use crate::record::journals::SAMPLES;
use crate::shard::{Attempt, End};
use crate::words::few;
use std::collections::BTreeMap;

/// Returns a note on the shards with several attempts on the same devices; `None` if there is no such shard. The note
/// names at most four of these shards, and at most four attempts at each of them. Attempts that finished without
/// taking a sample are left out.
pub fn attempted_again(attempts: &[Attempt]) -> Result<Option<String>> {
    let mut of_shards: BTreeMap<(u32, Vec<String>), Vec<&Attempt>> = BTreeMap::new();
    for attempt in attempts {
        let Some(about) = attempt.about()? else { continue };
        of_shards.entry((about.shard, about.devices)).or_default().push(attempt);
    }
    let mut texts = Vec::new();
    // The samples of a shard with one attempt are not read: the journals of samples are the largest files.
    for ((shard, _), attempts) in of_shards.iter().filter(|(_, attempts)| attempts.len() > 1) {
        let names = names_of_busy(attempts)?;
        if names.len() > 1 {
            texts.push(format!("{} attempts at shard {shard} ({})", names.len(), few(&names)));
        }
    }
    Ok((!texts.is_empty()).then(|| {
        format!("There were {}. Attempts that ran at the same time may have slowed each other.", few(&texts))
    }))
}

/// Returns the names of those attempts that may have slowed other attempts.
fn names_of_busy<'a>(attempts: &[&'a Attempt]) -> Result<Vec<&'a str>> {
    let mut names = Vec::new();
    for attempt in attempts {
        if may_have_slowed(attempt)? {
            names.push(attempt.name.as_str());
        }
    }
    Ok(names)
}

/// Returns false if an attempt has finished without taking a sample, otherwise true. An attempt that took no samples,
/// but has not finished, may have compiled programs or cast pictures of the reference for a long time.
fn may_have_slowed(attempt: &Attempt) -> Result<bool> {
    Ok(attempt.end()? != Some(End::Done) || took_samples(attempt)?)
}

/// Returns true if an attempt took samples. Samples that the attempt copied from an earlier attempt do not count.
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
            attempt
        };
        let finish = |attempt: Attempt| attempt.ended(&End::Done).unwrap();
        begin(1, "n1", "gpu", &[None]);
        begin(1, "n1", "cpu", &[None]);
        finish(begin(3, "n3", "cpu", &[None]));
        // Attempts that finished without taking a sample are left out of the note.
        finish(begin(3, "n1", "cpu", &[]));
        finish(begin(3, "n2", "cpu", &[Some("shard-00003.n3..r00 launch 0")]));
        let note = || attempted_again(&Attempt::all(folder.path()).unwrap()).unwrap();
        assert_eq!(note(), None);
        finish(begin(3, "n4", "cpu", &[Some("shard-00003.n3..r00 launch 0"), None]));
        assert_eq!(
            note().as_deref(),
            Some(
                "There were 2 attempts at shard 3 (shard-00003.n3..r00, shard-00003.n4..r00). Attempts that ran at the \
                 same time may have slowed each other."
            )
        );
        // An attempt that was killed before its first sample may have compiled programs during the other attempts.
        begin(3, "n5", "cpu", &[]);
        assert!(note().unwrap().contains("There were 3 attempts at shard 3 (shard-00003.n3..r00, "));
    }
}
