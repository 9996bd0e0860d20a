//! Whether the program of a record can be built again.

/// The description of a program whose source is in no commit.
pub const DIRTY: &str = "a raycl built from a tree with uncommitted changes, which cannot be built again";

/// Whether a revision is of a tree with changes.
pub fn is_dirty(revision: &str) -> bool {
    revision.ends_with("-dirty")
}

/// The note beside figures of this program; none if its revision is a commit, or unknown.
pub fn dirty_program() -> Option<String> {
    option_env!("RAYCL_GIT_REVISION")
        .filter(|revision| is_dirty(revision))
        .map(|_| format!("These figures come from {DIRTY}."))
}
