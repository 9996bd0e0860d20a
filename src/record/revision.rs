//! Finds out, from a record's git revision, whether the raycl program that wrote the record can be built
//! again.

/// The text that describes a raycl program built from uncommitted sources.
pub const DIRTY: &str = "a raycl that was built from uncommitted changes and cannot be built again";

/// Returns true if a git revision is marked as having uncommitted changes.
pub fn is_dirty(revision: &str) -> bool {
    revision.ends_with("-dirty")
}

/// Returns a note for the results of the running raycl program if this program was built from uncommitted
/// sources. Returns `None` if the program was built from a commit, or if the program's revision is unknown.
pub fn dirty_program() -> Option<String> {
    option_env!("RAYCL_GIT_REVISION")
        .filter(|revision| is_dirty(revision))
        .map(|_| format!("These figures come from {DIRTY}."))
}
