//! The keys that a user types in the window of the view.

use crate::view::keys::{self, Key};
use minifb::InputCallback;
use std::cell::Cell;
use std::rc::Rc;
use std::sync::mpsc::Sender;

/// Notices when the window loses the keyboard's focus. Without the focus, this window does not learn which keys are
/// released.
#[derive(Default)]
pub struct Focus {
    is_here: bool,
    /// True if the window has lost the focus since [`Typed`] got the last key.
    was_lost: Rc<Cell<bool>>,
}

impl Focus {
    /// Stores whether the window has the focus now. A window may get keys without ever having the focus, if there
    /// is no window manager.
    pub fn now(&mut self, is_here: bool) {
        let was_here = std::mem::replace(&mut self.is_here, is_here);
        self.was_lost.set(self.was_lost.get() || was_here && !is_here);
    }
}

/// Collects every press of a key, so that a tap counts even if it begins and ends during one frame.
pub struct Typed {
    sender: Sender<Key>,
    /// The keys that are down, as far as this window knows.
    down: Vec<minifb::Key>,
    /// True if the window has lost the focus since the last key ([`Focus`]).
    lost_focus: Rc<Cell<bool>>,
    /// True if the key of the last call of `set_key_state` is being held: the key is down, and was already
    /// down at the previous call for this key.
    is_held: bool,
}

impl Typed {
    /// Makes a collector that sends the keys of a window to `sender`. `focus` notices when this window loses the focus.
    pub fn new(sender: Sender<Key>, focus: &Focus) -> Self {
        let lost_focus = Rc::clone(&focus.was_lost);
        Self { sender, down: Vec::new(), lost_focus, is_held: false }
    }

    fn send(&self, key: Key) {
        if !self.is_held || keys::repeats(key) {
            // `send` fails only if the receiver was dropped, together with its window. After the window has
            // closed, a key has no effect, so it may be lost.
            let _ = self.sender.send(key);
        }
    }
}

impl InputCallback for Typed {
    /// The window calls `set_key_state` for a key first and then this function, so `is_held` is about the
    /// same key.
    fn add_char(&mut self, code: u32) {
        if let Some(letter) = char::from_u32(code).filter(|letter| !letter.is_control()) {
            self.send(Key::Char(letter));
        }
    }

    fn set_key_state(&mut self, key: minifb::Key, is_down: bool) {
        if self.lost_focus.take() {
            self.down.clear();
        }
        self.is_held = is_down && self.down.contains(&key);
        self.down.retain(|known| *known != key);
        if is_down {
            self.down.push(key);
            if let Some(key) = meant(key) {
                self.send(key);
            }
        }
    }
}

/// Returns the meaning of a key that types no character; `None` if raycl does not use the key.
fn meant(key: minifb::Key) -> Option<Key> {
    use minifb::Key as Pressed;
    Some(match key {
        Pressed::Left => Key::Left,
        Pressed::Right => Key::Right,
        Pressed::Up => Key::Up,
        Pressed::Down => Key::Down,
        Pressed::Escape => Key::Escape,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;

    #[test]
    fn keys_that_type_no_character_have_their_meaning() {
        for (pressed, expected) in [
            (minifb::Key::Left, Some(Key::Left)),
            (minifb::Key::Right, Some(Key::Right)),
            (minifb::Key::Up, Some(Key::Up)),
            (minifb::Key::Down, Some(Key::Down)),
            (minifb::Key::Escape, Some(Key::Escape)),
            (minifb::Key::S, None),
        ] {
            assert_eq!(meant(pressed), expected, "{pressed:?}");
        }
    }

    #[test]
    fn a_tap_counts_and_only_movement_repeats() {
        let (sender, keys) = channel();
        let mut typed = Typed::new(sender, &Focus::default());
        // The first press is a tap. The next two presses are reports of one key that is held: X11 reports a
        // held key again and again.
        for is_down in [true, false, true, true] {
            typed.set_key_state(minifb::Key::S, is_down);
            if is_down {
                typed.add_char(u32::from('s'));
            }
        }
        (0..3).for_each(|_| typed.set_key_state(minifb::Key::Left, true));
        typed.set_key_state(minifb::Key::Escape, true);
        typed.add_char(0x1b);
        let [s, left] = [Key::Char('s'), Key::Left];
        assert_eq!(keys.try_iter().collect::<Vec<_>>(), [s, s, left, left, left, Key::Escape]);
    }

    #[test]
    fn a_key_that_was_released_in_another_window_is_not_held_when_it_is_pressed_again() {
        let ((sender, keys), mut focus) = (channel(), Focus::default());
        let mut typed = Typed::new(sender, &focus);
        let mut taps_with = |focus_changes: &[bool]| {
            focus_changes.iter().for_each(|is_here| focus.now(*is_here));
            typed.set_key_state(minifb::Key::S, true);
            typed.add_char(u32::from('s'));
            keys.try_iter().count()
        };
        let counts = [&[false][..], &[false], &[true], &[true], &[false], &[true], &[false, true]];
        assert_eq!(counts.map(&mut taps_with), [1, 0, 0, 0, 1, 0, 1]);
    }
}
