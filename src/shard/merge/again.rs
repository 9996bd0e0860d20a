//! Reports shards that were attempted more than once, for example after a requeue. The first attempt may still have
//! been running during the second attempt, and may have changed the second attempt's times.

use crate::error::Result;
use crate::shard::Attempt;
use crate::words::few;
use std::collections::BTreeMap;

/// Returns a note that names the attempts at each shard with several attempts on the same devices; `None` if there
/// is no such shard.
pub fn attempted_again(attempts: &[Attempt]) -> Result<Option<String>> {
    let mut of_shards: BTreeMap<(u32, Vec<String>), Vec<&str>> = BTreeMap::new();
    for attempt in attempts {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shard::About;

    #[test]
    fn attempts_at_one_shard_on_the_same_devices_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let begin = |shard, host: &str, device: &str| {
            let about = About {
                shard,
                of: 4,
                host: host.into(),
                devices: vec![device.to_owned()],
                ..About::default()
            };
            Attempt::begin(folder.path(), &about).unwrap();
        };
        begin(1, "n1", "gpu");
        begin(1, "n1", "cpu");
        begin(3, "n3", "cpu");
        let note = || attempted_again(&Attempt::all(folder.path()).unwrap()).unwrap();
        assert_eq!(note(), None);
        begin(3, "n4", "cpu");
        assert_eq!(
            note().as_deref(),
            Some(
                "There were 2 attempts at shard 3 (shard-00003.n3..r00, shard-00003.n4..r00). Attempts that ran at the \
                 same time may have slowed each other."
            )
        );
    }
}
