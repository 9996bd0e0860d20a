//! Identifies the source of the casters on the host.

/// The source files that cast a baseline's rays.
const SOURCES: [&str; 6] = [
    include_str!("cast.rs"),
    include_str!("intersect.rs"),
    include_str!("ray.rs"),
    include_str!("real.rs"),
    include_str!("shade.rs"),
    include_str!("traverse.rs"),
];

/// Returns a hash of the casters' source, the counterpart of a kernel's program hash.
pub fn fingerprint() -> String {
    let mut hasher = blake3::Hasher::new();
    for text in SOURCES {
        hasher.update(&(text.len() as u64).to_le_bytes()).update(text.as_bytes());
    }
    hasher.finalize().to_hex()[..16].to_string()
}
