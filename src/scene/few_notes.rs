//! Notes of one kind, such as notes on pictures that cannot be read. The first three notes are shown; later
//! notes are only counted.

use crate::words::counted;
use std::collections::HashSet;

/// Largest number of notes of one kind that are shown, since a mesh may name any number of files.
const SHOWN: usize = 3;

/// The subjects of all notes of one kind, such as the names of files that cannot be read.
#[derive(Default)]
pub(in crate::scene) struct FewNotes(HashSet<String>);

impl FewNotes {
    /// Counts the note `note` on the subject `about`, such as the name of a file. Only the first note on a
    /// subject counts. Adds the note to `notes` unless `SHOWN` notes have been added before.
    pub fn add(&mut self, about: String, note: String, notes: &mut Vec<String>) {
        if self.0.insert(about) && self.0.len() <= SHOWN {
            notes.push(note);
        }
    }

    /// Returns a note with the number of counted notes that are not shown; `None` if all are shown. `what` is
    /// the word for a subject, such as "texture".
    pub fn rest(&self, what: &str) -> Option<String> {
        let count = self.0.len().saturating_sub(SHOWN);
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
                few.add(format!("file {}", number / 2), format!("note {}", number / 2), &mut notes);
            });
            notes.extend(few.rest("texture"));
            notes
        };
        assert_eq!(notes_of(0), [""; 0]);
        assert_eq!(notes_of(3), ["note 0", "note 1", "note 2"]);
        assert_eq!(notes_of(4), ["note 0", "note 1", "note 2", "1 more texture cannot be used either"]);
        assert_eq!(notes_of(1_000)[3], "997 more textures cannot be used either");
    }
}
