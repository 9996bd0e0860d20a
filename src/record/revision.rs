//! Whether what ran can be had again.

/// What a program is called whose text is in no commit.
pub const DIRTY: &str =
    "a raycl built from a tree with changes that are in no commit: what they say cannot be had again";

/// Whether a revision is of a tree with changes.
pub fn is_dirty(revision: &str) -> bool {
    revision.ends_with("-dirty")
}

/// What is to be said beside a figure of this very program; nothing where its revision is a commit's, or not known.
pub fn dirty_program() -> Option<String> {
    option_env!("RAYCL_GIT_REVISION")
        .filter(|revision| is_dirty(revision))
        .map(|_| format!("These figures come of {DIRTY}."))
}
