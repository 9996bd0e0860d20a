//! A terminal as a screen: each character shows two pixels, as the colours of the upper and the lower half of
//! a half block.

use super::{Input, Screen};
use crate::error::{Error, Result};
use crate::view::keys::Key;
use crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers, MouseButton, MouseEventKind};
use crossterm::{cursor, execute, terminal};
use image::RgbImage;
use std::fmt::Write as _;
use std::io::{ErrorKind, IsTerminal as _, Stdout, Write as _};
use std::time::Duration;

/// Characters across and down if the terminal does not report them.
const USUAL: [u16; 2] = [80, 24];

/// The terminal at standard output, or a file that will be shown on a terminal.
pub struct Terminal {
    out: Stdout,
    /// Characters across and down.
    cells: [u16; 2],
    /// True if a user can press keys.
    is_interactive: bool,
    /// The button that is down, and its last position.
    dragged: Option<(MouseButton, [u16; 2])>,
    pointer: Option<[u32; 2]>,
    line: String,
}

impl Terminal {
    /// Takes the whole terminal until it is dropped.
    pub fn open() -> Result<Self> {
        let out = std::io::stdout();
        let cells = if out.is_terminal() { terminal::size().map_or(USUAL, <[u16; 2]>::from) } else { USUAL };
        let is_interactive = out.is_terminal() && std::io::stdin().is_terminal();
        let mut opened =
            Self { out, cells, is_interactive, dragged: None, pointer: None, line: String::new() };
        if is_interactive {
            terminal::enable_raw_mode().map_err(failed)?;
            let screen = (terminal::EnterAlternateScreen, cursor::Hide, event::EnableMouseCapture);
            execute!(opened.out, screen.0, screen.1, screen.2).map_err(failed)?;
        }
        Ok(opened)
    }

    /// Returns the pixels across and down; one line is left for text.
    pub fn size(&self) -> [u32; 2] {
        let [across, down] = self.cells.map(u32::from);
        [across.max(1), 2 * down.saturating_sub(1).max(1)]
    }

    fn write(&mut self, text: &str) -> Result<()> {
        match self.out.write_all(text.as_bytes()).and_then(|()| self.out.flush()) {
            Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(failed(error)),
            _ => Ok(()),
        }
    }

    fn mouse(&mut self, input: &mut Input, kind: MouseEventKind, at: [u16; 2]) {
        let height = f64::from(self.size()[1]);
        match kind {
            MouseEventKind::Down(button) => self.dragged = Some((button, at)),
            MouseEventKind::Up(_) => self.dragged = None,
            MouseEventKind::Drag(button) => {
                if let Some((_, from)) = self.dragged.replace((button, at)) {
                    // A character is as high as two pixels.
                    let by = |axis: usize| f64::from(at[axis]) - f64::from(from[axis]);
                    let by = [by(0) / height, 2.0 * by(1) / height];
                    let drag = if button == MouseButton::Left { &mut input.orbit } else { &mut input.pan };
                    *drag = [drag[0] + by[0], drag[1] + by[1]];
                }
            }
            MouseEventKind::ScrollUp => input.wheel += 1.0,
            MouseEventKind::ScrollDown => input.wheel -= 1.0,
            _ => {}
        }
        let [x, y] = [u32::from(at[0]), 2 * u32::from(at[1])];
        self.pointer = (x < self.size()[0] && y < self.size()[1]).then_some([x, y]);
    }
}

impl Screen for Terminal {
    fn show(&mut self, picture: &RgbImage) -> Result<()> {
        let end = if self.is_interactive { "\r\n" } else { "\n" };
        let home = if self.is_interactive { "\x1b[H" } else { "" };
        self.write(&format!("{home}{}", blocks(picture, end)))
    }

    fn tell(&mut self, line: &str) -> Result<()> {
        if !self.is_interactive || line == self.line {
            return Ok(());
        }
        self.line = line.to_owned();
        let shown: String = line.chars().take(usize::from(self.cells[0])).collect();
        self.write(&format!("\x1b[{};1H\x1b[0m{shown}\x1b[K", self.cells[1]))
    }

    fn input(&mut self) -> Result<Input> {
        let mut input = Input::default();
        while self.is_interactive && event::poll(Duration::ZERO).map_err(failed)? {
            match event::read().map_err(failed)? {
                Event::Key(key) if key.kind != KeyEventKind::Release => {
                    let control = key.modifiers.contains(KeyModifiers::CONTROL);
                    input.closed |= control && key.code == KeyCode::Char('c');
                    input.keys.extend(meant(key.code).filter(|_| !control));
                }
                Event::Mouse(mouse) => self.mouse(&mut input, mouse.kind, [mouse.column, mouse.row]),
                _ => {}
            }
        }
        input.pointer = self.pointer;
        Ok(input)
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        if self.is_interactive {
            // A failure here cannot be shown to anybody.
            let _ =
                execute!(self.out, event::DisableMouseCapture, cursor::Show, terminal::LeaveAlternateScreen);
            let _ = terminal::disable_raw_mode();
        }
    }
}

fn failed(error: std::io::Error) -> Error {
    Error::run(format!("the terminal cannot be used: {error}"))
        .with_help("without --terminal a window is opened")
}

/// Returns the key that a code of the terminal means.
fn meant(code: KeyCode) -> Option<Key> {
    match code {
        KeyCode::Char(letter) => Some(Key::Char(letter)),
        KeyCode::Left => Some(Key::Left),
        KeyCode::Right => Some(Key::Right),
        KeyCode::Up => Some(Key::Up),
        KeyCode::Down => Some(Key::Down),
        KeyCode::Esc => Some(Key::Escape),
        _ => None,
    }
}

/// Returns a picture as lines of half blocks, one line for two rows. A colour that stays the same is not
/// written again.
fn blocks(picture: &RgbImage, end: &str) -> String {
    let [width, height] = [picture.width(), picture.height()];
    let mut text = String::new();
    for top in (0..height).step_by(2) {
        let mut last = None;
        for x in 0..width {
            let below = (top + 1).min(height - 1);
            let colours = [picture.get_pixel(x, top).0, picture.get_pixel(x, below).0];
            if last != Some(colours) {
                let [[r, g, b], [red, green, blue]] = colours;
                // Writing to a String cannot fail.
                let _ = write!(text, "\x1b[38;2;{r};{g};{b};48;2;{red};{green};{blue}m");
                last = Some(colours);
            }
            text.push('▀');
        }
        let _ = write!(text, "\x1b[0m{end}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn two_rows_are_a_line_and_a_colour_is_told_once() {
        let mut picture = RgbImage::from_pixel(3, 3, Rgb([1, 2, 3]));
        picture.put_pixel(2, 1, Rgb([9, 8, 7]));
        let lines = "\x1b[38;2;1;2;3;48;2;1;2;3m▀▀\x1b[38;2;1;2;3;48;2;9;8;7m▀\x1b[0m\n\
                     \x1b[38;2;1;2;3;48;2;1;2;3m▀▀▀\x1b[0m\n";
        assert_eq!(blocks(&picture, "\n"), lines);
    }

    #[test]
    fn keys_mean_what_they_mean_in_the_window() {
        assert_eq!(meant(KeyCode::Char('S')), Some(Key::Char('S')));
        assert_eq!(meant(KeyCode::Esc), Some(Key::Escape));
        assert_eq!(meant(KeyCode::F(1)), None);
    }
}
