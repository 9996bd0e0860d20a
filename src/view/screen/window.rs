//! A window of its own. Its libraries are loaded when it opens, so that no other command needs them.

use super::{Input, Screen};
use crate::error::{Error, Result};
use crate::view::keys::{self, Key};
use image::RgbImage;
use minifb::{KeyRepeat, MouseButton, MouseMode, ScaleMode, WindowOptions};

const REMEDY: &str = "--terminal shows it in this terminal instead, `raycl render` writes it to a file; elsewhere \
    than at the display itself, `ssh -X` forwards a window";

/// A window of the picture's size.
pub struct Window {
    window: minifb::Window,
    size: [u32; 2],
    /// What is shown, 0RGB.
    pixels: Vec<u32>,
    /// Where the pointer was dragged from.
    dragged: Option<[f64; 2]>,
    /// Whether the last picture's showing has also looked what the user did.
    looked: bool,
}

impl Window {
    /// Opens it.
    ///
    /// # Errors
    /// The user's mistake where there is no display, or its libraries are missing.
    pub fn open(title: &str, size: [u32; 2]) -> Result<Self> {
        if needs_display() && std::env::var_os("DISPLAY").is_none_or(|display| display.is_empty()) {
            return Err(Error::input("there is no display: DISPLAY is not set").with_help(REMEDY));
        }
        let options = WindowOptions { scale_mode: ScaleMode::UpperLeft, ..WindowOptions::default() };
        let [width, height] = size.map(|side| side as usize);
        let window = minifb::Window::new(title, width, height, options).map_err(|error| {
            Error::input(format!("the window cannot be opened: {error}")).with_help(format!(
                "it needs a display, and on Debian the packages libx11-6 and libxcursor1; {REMEDY}"
            ))
        })?;
        Ok(Self { window, size, pixels: vec![0; width * height], dragged: None, looked: false })
    }

    fn pointer(&self) -> Option<[u32; 2]> {
        let (x, y) = self.window.get_unscaled_mouse_pos(MouseMode::Discard)?;
        let [x, y] = [x as u32, y as u32];
        (x < self.size[0] && y < self.size[1]).then_some([x, y])
    }

    /// How far the pointer went since the last look while a button was down.
    fn drag(&mut self) -> [f64; 2] {
        let down = self.is_down(MouseButton::Left) || self.pans();
        let at = self.window.get_unscaled_mouse_pos(MouseMode::Pass).filter(|_| down);
        let at = at.map(|(x, y)| [x, y].map(f64::from));
        let by = match (self.dragged, at) {
            (Some(from), Some(at)) => [at[0] - from[0], at[1] - from[1]],
            _ => [0.0; 2],
        };
        self.dragged = at;
        by.map(|pixels| pixels / f64::from(self.size[1]))
    }

    fn is_down(&self, button: MouseButton) -> bool {
        self.window.get_mouse_down(button)
    }

    fn pans(&self) -> bool {
        self.is_down(MouseButton::Right) || self.is_down(MouseButton::Middle)
    }

    fn keys(&self) -> Vec<Key> {
        let is_down = |key| self.window.is_key_down(key);
        let shift = is_down(minifb::Key::LeftShift) || is_down(minifb::Key::RightShift);
        let pressed = self.window.get_keys_pressed(KeyRepeat::No);
        let held = self.window.get_keys_pressed(KeyRepeat::Yes);
        let meant = held.into_iter().filter_map(|key| Some((key, meant(key, shift)?)));
        meant
            .filter(|(key, meant)| keys::repeats(*meant) || pressed.contains(key))
            .map(|(_, key)| key)
            .collect()
    }
}

impl Screen for Window {
    fn show(&mut self, picture: &RgbImage) -> Result<()> {
        for (pixel, [red, green, blue]) in self.pixels.iter_mut().zip(picture.as_chunks().0) {
            *pixel = u32::from_be_bytes([0, *red, *green, *blue]);
        }
        let [width, height] = self.size.map(|side| side as usize);
        self.looked = true;
        self.window
            .update_with_buffer(&self.pixels, width, height)
            .map_err(|error| Error::run(format!("the window cannot show a picture: {error}")))
    }

    fn tell(&mut self, line: &str) -> Result<()> {
        self.window.set_title(line);
        Ok(())
    }

    fn input(&mut self) -> Result<Input> {
        if !std::mem::take(&mut self.looked) {
            self.window.update();
        }
        let by = self.drag();
        let (orbit, pan) = if self.pans() { ([0.0; 2], by) } else { (by, [0.0; 2]) };
        Ok(Input {
            keys: self.keys(),
            orbit,
            pan,
            wheel: self.window.get_scroll_wheel().map_or(0.0, |(_, steps)| f64::from(steps)),
            pointer: self.pointer(),
            closed: !self.window.is_open(),
        })
    }
}

/// Whether windows are X11's.
fn needs_display() -> bool {
    cfg!(all(unix, not(target_os = "macos")))
}

/// What a key of the keyboard means.
fn meant(key: minifb::Key, shift: bool) -> Option<Key> {
    use minifb::Key as Pressed;
    let letter = |lower: char| Key::Char(if shift { lower.to_ascii_uppercase() } else { lower });
    Some(match key {
        Pressed::Left => Key::Left,
        Pressed::Right => Key::Right,
        Pressed::Up => Key::Up,
        Pressed::Down => Key::Down,
        Pressed::Escape => Key::Escape,
        Pressed::Space => Key::Char(' '),
        Pressed::Equal | Pressed::NumPadPlus => Key::Char('+'),
        Pressed::Minus | Pressed::NumPadMinus => Key::Char('-'),
        _ => {
            let place = LETTERS.iter().position(|(known, _)| *known == key)?;
            letter(LETTERS[place].1)
        }
    })
}

/// The letters that mean something.
const LETTERS: [(minifb::Key, char); 11] = [
    (minifb::Key::D, 'd'),
    (minifb::Key::H, 'h'),
    (minifb::Key::I, 'i'),
    (minifb::Key::J, 'j'),
    (minifb::Key::K, 'k'),
    (minifb::Key::L, 'l'),
    (minifb::Key::Q, 'q'),
    (minifb::Key::R, 'r'),
    (minifb::Key::S, 's'),
    (minifb::Key::T, 't'),
    (minifb::Key::W, 'w'),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_letter_that_does_something_is_a_key_of_the_window() {
        for (key, _) in keys::KEYS.iter().flat_map(|row| row.keys) {
            let Key::Char(letter) = key else { continue };
            let lower = letter.to_ascii_lowercase();
            let known = LETTERS.iter().any(|(_, known)| *known == lower) || " +=-".contains(lower);
            assert!(known, "{letter}");
        }
        assert_eq!(meant(minifb::Key::S, true), Some(Key::Char('S')));
        assert_eq!(meant(minifb::Key::S, false), Some(Key::Char('s')));
        assert_eq!(meant(minifb::Key::Left, false), Some(Key::Left));
        assert_eq!(meant(minifb::Key::F1, false), None);
    }
}
