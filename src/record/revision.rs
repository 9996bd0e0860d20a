//! Determines whether the raycl program that wrote a record can be built again.

/// The text that describes a raycl program built from uncommitted sources.
pub const DIRTY: &str = "a raycl that was built from uncommitted changes and cannot be built again";

/// Returns true if a revision is marked as having uncommitted changes.
pub fn is_dirty(revision: &str) -> bool {
    revision.ends_with("-dirty")
}

/// Returns a note for this program's results if the program was built from uncommitted sources. Returns
/// `None` if the program was built from a commit, or if the program's revision is unknown.
pub fn dirty_program() -> Option<String> {
    option_env!("RAYCL_GIT_REVISION")
        .filter(|revision| is_dirty(revision))
        .map(|_| format!("These figures come from {DIRTY}."))
}
