//! The notes on a scene: on values and parts of files that raycl ignores or changes.

use crate::error::shortened_note;

/// The notes on a scene or, in an animation, on the scene of a frame.
#[derive(Clone, Default)]
pub(in crate::scene) struct Notes {
    /// The notes on the objects. Frames with the same objects have the same notes.
    pub of_objects: Vec<String>,
    pub others: Vec<String>,
    /// The notes on settings that have no effect. In an animation, such a note is true only if the settings have no
    /// effect on any frame.
    pub idle: Vec<String>,
    /// A note that nothing illuminates the scene although it has lights or a sky. In an animation, this note on one
    /// frame is of use only if all frames are dark.
    pub dark: Option<String>,
}

impl Notes {
    /// Returns all notes, shortened.
    pub fn all(&self) -> impl Iterator<Item = String> + '_ {
        self.of_objects.iter().chain(&self.others).chain(&self.idle).chain(&self.dark).map(shortened_note)
    }
}
