//! The notes on the frames of an animation that are rendered.

use crate::error::shortened_note;
use crate::scene::assemble::Notes;
use crate::words::counted;
use std::collections::HashSet;

/// Largest number of shown notes on the objects of later frames. Each frame may have a mesh, and notes, of its own.
const SHOWN: usize = 10;

/// The notes on the rendered frames of an animation: all notes on the first of these frames, and the notes on the
/// objects of later frames. Each text counts once.
#[derive(Default)]
pub(super) struct FrameNotes {
    /// The notes on frame 1, which is built even if it is not rendered.
    loaded: Notes,
    /// The notes on the first frame that was rendered; `None` if no frame was rendered. The note `dark` is removed as
    /// soon as a frame is lit.
    first: Option<Notes>,
    /// The notes on the objects of later frames that are shown.
    later: Vec<String>,
    /// The number of notes on the objects of later frames that are not shown.
    more: usize,
    /// The texts of all notes on objects, without the numbers of frames.
    known: HashSet<String>,
}

impl FrameNotes {
    /// Keeps the notes on frame 1.
    pub fn load(&mut self, notes: Notes) {
        self.loaded = notes;
    }

    /// Returns true if no frame was rendered.
    pub fn is_empty(&self) -> bool {
        self.first.is_none()
    }

    /// Adds the notes on a frame that is rendered.
    pub fn add(&mut self, frame: u32, notes: Notes) {
        let mut is_new = |note: &String| self.known.insert(without_frame(note));
        let new: Vec<String> = notes.of_objects.iter().filter(|note| is_new(note)).cloned().collect();
        let Some(first) = &mut self.first else {
            self.first = Some(if frame == 1 { self.loaded.clone() } else { notes });
            return;
        };
        first.idle.retain(|note| notes.idle.contains(note));
        first.dark = first.dark.take().filter(|_| notes.dark.is_some());
        let shown = new.len().min(SHOWN - self.later.len());
        self.more += new.len() - shown;
        self.later.extend(new.into_iter().take(shown));
    }

    /// `notes` are the notes on the scene as it was loaded. Returns these notes, but with the notes on the rendered
    /// frames in place of those on frame 1.
    pub fn instead_of_loaded(&self, mut notes: Vec<String>) -> Vec<String> {
        let Some(first) = &self.first else { return notes };
        let of_frame_1: HashSet<String> = self.loaded.all().collect();
        notes.retain(|note| !of_frame_1.contains(note));
        notes.extend(first.all().chain(self.later.iter().map(shortened_note)));
        let more = || format!("{} on objects of later frames", counted(self.more, "more note"));
        notes.extend((self.more > 0).then(more));
        notes
    }
}

/// If a note names a track and a frame, returns the note without the frame's number. Equal notes on several frames then
/// have the same text.
fn without_frame(note: &str) -> String {
    let names_track = |before: &str| before.ends_with('`') || before.ends_with("a track");
    match note.split_once(" at frame ").filter(|(before, _)| names_track(before)) {
        Some((before, after)) => {
            format!("{before}{}", after.trim_start_matches(|c: char| c.is_ascii_digit()))
        }
        None => note.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn notes(of_objects: &[&str], other: &str, dark: Option<&str>) -> Notes {
        let of_objects = of_objects.iter().map(|&note| note.to_owned()).collect();
        Notes {
            of_objects,
            others: vec![other.to_owned()],
            dark: dark.map(str::to_owned),
            ..Notes::default()
        }
    }

    #[test]
    fn notes_on_the_first_rendered_frame_replace_those_on_frame_1() {
        let loaded = || notes(&["a.obj: a", "all"], "camera 1", Some("dark"));
        let general = || vec!["general".to_owned()];
        let mut frames = FrameNotes::default();
        frames.load(loaded());
        let all = || general().into_iter().chain(loaded().all()).collect::<Vec<_>>();
        assert_eq!(frames.instead_of_loaded(all()), all(), "no frame was rendered");
        frames.add(4, notes(&["all", "b.obj: b"], "camera 4", Some("dark at 4")));
        frames.add(5, notes(&["all", "track `x` at frame 5: odd"], "camera 5", Some("dark at 5")));
        frames.add(6, notes(&["c.obj: c", "track `x` at frame 6: odd"], "camera 6", Some("dark at 6")));
        assert_eq!(without_frame("walk at frame 6.obj: odd"), "walk at frame 6.obj: odd", "a name of a file");
        let of_4 = ["general", "all", "b.obj: b", "camera 4", "dark at 4"];
        let later = ["track `x` at frame 5: odd", "c.obj: c"];
        assert_eq!(frames.instead_of_loaded(all()), [&of_4[..], &later].concat());
        frames.add(7, notes(&[], "camera 7", None));
        assert_eq!(frames.instead_of_loaded(all()), [&of_4[..4], &later].concat(), "frame 7 is lit");
    }

    #[test]
    fn a_setting_has_no_effect_only_if_it_has_none_on_any_frame() {
        let idle = |notes: &[&str]| Notes {
            idle: notes.iter().map(|&note| note.to_owned()).collect(),
            ..Notes::default()
        };
        let mut frames = FrameNotes::default();
        frames.load(idle(&["crease", "smooth"]));
        frames.add(1, idle(&["crease", "smooth"]));
        frames.add(2, idle(&["flat", "smooth"]));
        frames.add(3, idle(&["crease", "smooth"]));
        let loaded = ["crease", "smooth"].map(str::to_owned).to_vec();
        assert_eq!(frames.instead_of_loaded(loaded), ["smooth"]);
    }

    #[test]
    fn many_notes_on_later_frames_are_counted() {
        let mut frames = FrameNotes::default();
        frames.load(notes(&["mesh 1"], "averted", None));
        (1..=15).for_each(|frame| frames.add(frame, notes(&[&format!("mesh {frame}")], "other", None)));
        let shown = frames.instead_of_loaded(vec!["mesh 1".to_owned(), "averted".to_owned()]);
        assert_eq!((shown.len(), &*shown[1], &*shown[11]), (13, "averted", "mesh 11"));
        assert_eq!(shown[12], "4 more notes on objects of later frames");
    }
}
