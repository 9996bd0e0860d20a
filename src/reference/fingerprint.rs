//! Identifies the source code of the casters on the host.

/// The source files in this folder that cast the rays of baselines (ray casters on the host, whose times
/// raycl compares with those of kernels).
const SOURCES: [(&str, &str); 11] = [
    ("cast", include_str!("cast.rs")),
    ("cutouts", include_str!("cutouts.rs")),
    ("environment", include_str!("environment.rs")),
    ("intersect", include_str!("intersect.rs")),
    ("leaning", include_str!("leaning.rs")),
    ("ray", include_str!("ray.rs")),
    ("real", include_str!("real.rs")),
    ("shade", include_str!("shade.rs")),
    ("soft", include_str!("soft.rs")),
    ("texture", include_str!("texture.rs")),
    ("traverse", include_str!("traverse.rs")),
];

/// Returns a hash of the casters' source as 16 hexadecimal digits, the counterpart of the hash of a kernel's
/// program.
pub fn fingerprint() -> String {
    let mut hasher = blake3::Hasher::new();
    for (_, text) in SOURCES {
        hasher.update(&(text.len() as u64).to_le_bytes()).update(text.as_bytes());
    }
    hasher.finalize().to_hex()[..16].to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_that_a_caster_uses_is_hashed() {
        for (name, text) in SOURCES {
            let used = text.lines().filter_map(|line| line.strip_prefix("use super::")?.split("::").next());
            let used: Vec<&str> = used.collect();
            let is_hashed = |file: &&str| SOURCES.iter().any(|(hashed, _)| hashed == file);
            assert!(used.iter().all(is_hashed), "{name}.rs uses {used:?}: hash each of them");
        }
        assert!(SOURCES.iter().all(|(name, text)| *name == "real" || text.contains("use super::")));
    }
}
