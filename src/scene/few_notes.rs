//! Notes of one kind, such as notes on pictures that cannot be read. raycl shows the first three notes with different
//! texts. Of all further subjects, raycl shows only the number.

use crate::words::counted;
use std::collections::HashSet;

/// Largest number of notes of one kind that are shown, since a mesh may name any number of files.
const SHOWN: usize = 3;

/// The subjects of all notes of one kind, such as the names of files that cannot be read.
#[derive(Default)]
pub(in crate::scene) struct FewNotes {
    subjects: HashSet<String>,
    /// The notes that are shown, at most `SHOWN`.
    shown: Vec<String>,
}

impl FewNotes {
    /// Counts a note on the subject `about`, such as the whole name of a file. Only the first note on a
    /// subject counts. If fewer than `SHOWN` notes have been appended, calls `note` to make the note, and
    /// appends it to `notes`. If a note must not name its subject, notes on different subjects may have equal
    /// texts. Of notes with equal texts, only the first is appended.
    pub fn add(&mut self, about: String, note: impl FnOnce() -> String, notes: &mut Vec<String>) {
        if !self.subjects.insert(about) || self.shown.len() >= SHOWN {
            return;
        }
        let note = note();
        if !self.shown.contains(&note) {
            self.shown.push(note.clone());
            notes.push(note);
        }
    }

    /// Returns a note with the number of counted notes that are not shown; `None` if all are shown. `what` is
    /// the word for a subject, such as "texture".
    pub fn rest(&self, what: &str) -> Option<String> {
        let count = self.subjects.len() - self.shown.len();
        (count > 0).then(|| format!("{} cannot be used either", counted(count, &format!("more {what}"))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_three_different_notes_are_shown_and_the_others_counted() {
        let notes_of = |count: usize| {
            let (mut few, mut notes) = (FewNotes::default(), Vec::new());
            (0..2 * count).for_each(|number| {
                few.add(format!("file {}", number / 2), || format!("note {}", number / 2), &mut notes);
            });
            notes.extend(few.rest("texture"));
            notes
        };
        assert_eq!(notes_of(0), [""; 0]);
        assert_eq!(notes_of(3), ["note 0", "note 1", "note 2"]);
        assert_eq!(notes_of(4), ["note 0", "note 1", "note 2", "1 more texture cannot be used either"]);
        assert_eq!(notes_of(1_000)[3], "997 more textures cannot be used either");
    }

    #[test]
    fn equal_notes_on_different_subjects_are_shown_once_and_the_others_counted() {
        let (mut few, mut notes) = (FewNotes::default(), Vec::new());
        for subject in ["a", "b", "c", "d", "e"] {
            few.add(subject.to_owned(), || "a file cannot be read".to_owned(), &mut notes);
        }
        notes.extend(few.rest("file"));
        assert_eq!(notes, ["a file cannot be read", "4 more files cannot be used either"]);
    }
}
