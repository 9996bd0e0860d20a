//! The key of a measurement: a hash of what is measured, and how (scene, device, strategy, sizes, program,
//! timing settings and more).

/// The texts that make up a key; [`key`] hashes them in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct KeyParts<'a> {
    /// The scene's hash ([`SceneChoice::hash`](crate::config::SceneChoice::hash)), which depends on the
    /// number of samples per pixel if that number is above 1.
    pub scene_hash: &'a str,
    /// The platform, its version, the device and the driver; for the second and each later device of the same name,
    /// also the device's number. For a baseline: the word "host" and the processor's model.
    pub device: &'a str,
    /// The number of compute units, the numbers of usable cores and of threads if they are known, and the
    /// environment variables of the driver. For a baseline, the text contains only the numbers of usable
    /// cores and of threads.
    pub state: &'a str,
    /// The smaller device that is imitated ([`Emulate`](crate::config::Emulate)), in the form in which raycl displays
    /// it.
    pub emulate: &'a str,
    /// All axes of the strategy with their values. For a baseline:
    /// [`Baseline::strategy`](crate::config::Baseline::strategy).
    pub strategy: &'a str,
    /// Local size, such as "16x16"; empty for a baseline.
    pub local_size: &'a str,
    /// Image size, such as "800x500".
    pub image_size: &'a str,
    /// The hash of the program's source, defines and build options. For a baseline: the hash of the
    /// baselines' source, and the compiler and options with which raycl was compiled.
    pub program_hash: &'a str,
    /// The settings of [`Timing`](crate::config::Timing), in the form in which raycl displays them.
    pub timing: &'a str,
    /// The fingerprint of the code that builds trees (`accel::FINGERPRINT`); empty if the strategy uses no tree.
    pub tree: &'a str,
}

/// Returns the key of a measurement: 32 hexadecimal digits of BLAKE3 over the parts. The length of each part is
/// hashed before the part, so that different parts never result in the same input.
pub fn key(parts: &KeyParts<'_>) -> String {
    let KeyParts { scene_hash, device, state, emulate, strategy, .. } = *parts;
    let KeyParts { local_size, image_size, program_hash, timing, tree, .. } = *parts;
    let mut hasher = blake3::Hasher::new();
    for part in
        [scene_hash, device, state, emulate, strategy, local_size, image_size, program_hash, timing, tree]
    {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part.as_bytes());
    }
    hasher.finalize().to_hex()[..32].to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_changes_with_every_part_and_parts_do_not_run_together() {
        let base = KeyParts::default();
        let mut keys = vec![
            key(&base),
            key(&KeyParts { scene_hash: "a", ..base }),
            key(&KeyParts { device: "a", ..base }),
            key(&KeyParts { state: "a", ..base }),
            key(&KeyParts { emulate: "a", ..base }),
            key(&KeyParts { strategy: "a", ..base }),
            key(&KeyParts { local_size: "a", ..base }),
            key(&KeyParts { image_size: "a", ..base }),
            key(&KeyParts { program_hash: "a", ..base }),
            key(&KeyParts { timing: "a", ..base }),
            key(&KeyParts { tree: "a", ..base }),
            key(&KeyParts { scene_hash: "ab", ..base }),
            key(&KeyParts { scene_hash: "a", device: "b", ..base }),
        ];
        assert_eq!(keys[0], key(&base), "a key is a pure function");
        assert!(keys.iter().all(|key| key.len() == 32));
        let count = keys.len();
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), count);
    }
}
