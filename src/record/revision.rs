//! Decides whether the program that made a record can be built again.

/// The description of a program that was built from uncommitted sources.
pub const DIRTY: &str = "a raycl built from a tree with uncommitted changes, which cannot be built again";

/// Returns whether a revision has uncommitted changes.
pub fn is_dirty(revision: &str) -> bool {
    revision.ends_with("-dirty")
}

/// Returns a note on results of this program; `None` if its revision is a commit, or unknown.
pub fn dirty_program() -> Option<String> {
    option_env!("RAYCL_GIT_REVISION")
        .filter(|revision| is_dirty(revision))
        .map(|_| format!("These figures come from {DIRTY}."))
}
