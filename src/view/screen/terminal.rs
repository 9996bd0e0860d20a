//! A terminal as a screen, in half blocks or in pixels.

use super::{Graphics, Input, Screen};
use crate::error::{Error, Result};
use crate::view::keys::Key;
use crossterm::event::{
    self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers, MouseButton, MouseEventKind,
};
use crossterm::{cursor, execute, terminal};
use image::RgbImage;
use std::io::{ErrorKind, IsTerminal as _, Stdout, Write as _};
use std::time::Duration;

/// Characters across and down if the terminal does not report them.
const USUAL_CELLS: [u16; 2] = [80, 24];
/// Size of a character in pixels if the terminal does not report it.
const USUAL_CELL_PIXELS: [u32; 2] = [8, 16];

/// The terminal at standard output, or a file that will be shown on a terminal.
pub struct Terminal {
    out: Stdout,
    /// Characters across and down.
    cells: [u16; 2],
    /// Size of a character in pixels.
    cell_pixels: [u32; 2],
    graphics: Graphics,
    /// True if a user can press keys.
    is_interactive: bool,
    /// The button that is down, and the character at which the pointer was last; `None` if no button is down.
    dragged: Option<(MouseButton, [u16; 2])>,
    pointer: Option<[u32; 2]>,
    line: String,
}

impl Terminal {
    /// Uses the whole terminal until the returned value is dropped. If `graphics` is `None`, asks the terminal in which
    /// form it can show pictures. Uses half blocks without asking if no user can press keys, or if the terminal does
    /// not report the size of a character in pixels.
    pub fn open(graphics: Option<Graphics>) -> Result<Self> {
        let out = std::io::stdout();
        let is_interactive = out.is_terminal() && std::io::stdin().is_terminal();
        let (cells, cell_pixels) = if out.is_terminal() { sizes() } else { (USUAL_CELLS, None) };
        let mut opened = Self {
            out,
            cells,
            cell_pixels: cell_pixels.unwrap_or(USUAL_CELL_PIXELS),
            graphics: graphics.unwrap_or(Graphics::Blocks),
            is_interactive,
            dragged: None,
            pointer: None,
            line: String::new(),
        };
        if is_interactive {
            terminal::enable_raw_mode().map_err(failed)?;
            let screen = (terminal::EnterAlternateScreen, cursor::Hide, event::EnableMouseCapture);
            execute!(opened.out, screen.0, screen.1, screen.2).map_err(failed)?;
            if graphics.is_none() && cell_pixels.is_some() {
                opened.graphics = Graphics::of_terminal();
            }
        }
        Ok(opened)
    }

    /// Returns the pixels across and down; one line is left for text.
    pub fn size(&self) -> [u32; 2] {
        let [across, down] = self.cells.map(u32::from);
        self.graphics.size([across.max(1), down.saturating_sub(1).max(1)], self.cell_pixels)
    }

    fn write(&mut self, text: &str) -> Result<()> {
        match self.out.write_all(text.as_bytes()).and_then(|()| self.out.flush()) {
            Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(failed(error)),
            _ => Ok(()),
        }
    }

    fn mouse(&mut self, input: &mut Input, kind: MouseEventKind, at: [u16; 2]) {
        let [width, height] = self.size();
        let pixels = self.graphics.pixels_of(self.cell_pixels);
        match kind {
            MouseEventKind::Down(button) => self.dragged = Some((button, at)),
            MouseEventKind::Up(_) => self.dragged = None,
            MouseEventKind::Drag(button) => {
                if let Some((_, from)) = self.dragged.replace((button, at)) {
                    let cells = |axis: usize| f64::from(at[axis]) - f64::from(from[axis]);
                    let by = [0, 1].map(|axis| cells(axis) * f64::from(pixels[axis]) / f64::from(height));
                    let drag = if button == MouseButton::Left { &mut input.orbit } else { &mut input.pan };
                    *drag = [drag[0] + by[0], drag[1] + by[1]];
                }
            }
            MouseEventKind::ScrollUp => input.wheel += 1.0,
            MouseEventKind::ScrollDown => input.wheel -= 1.0,
            _ => {}
        }
        // The pointer is at the pixel in the middle of the character, or at the first of two middle pixels, so that
        // half blocks give the upper pixel.
        let [x, y] = [0, 1].map(|axis| u32::from(at[axis]) * pixels[axis] + (pixels[axis] - 1) / 2);
        self.pointer = (x < width && y < height).then_some([x, y]);
    }
}

impl Screen for Terminal {
    fn show(&mut self, picture: &RgbImage) -> Result<()> {
        let end = if self.is_interactive { "\r\n" } else { "\n" };
        let home = if self.is_interactive { "\x1b[H" } else { "" };
        let shown = self.graphics.text(picture, end)?;
        self.write(&format!("{home}{shown}"))
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
                Event::Key(key) => pressed(&mut input, key),
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
            let _ = self.write(self.graphics.end());
            let _ =
                execute!(self.out, event::DisableMouseCapture, cursor::Show, terminal::LeaveAlternateScreen);
            let _ = terminal::disable_raw_mode();
        }
    }
}

/// Returns the characters across and down, and the size of a character in pixels if the terminal reports it.
fn sizes() -> ([u16; 2], Option<[u32; 2]>) {
    let Ok(window) = terminal::window_size() else {
        return (terminal::size().map_or(USUAL_CELLS, <[u16; 2]>::from), None);
    };
    let cells = [window.columns, window.rows];
    let pixels = [window.width, window.height];
    let cell = [0, 1].map(|axis| u32::from(pixels[axis] / cells[axis].max(1)));
    (cells, (cell[0] > 0 && cell[1] > 0).then_some(cell))
}

fn failed(error: std::io::Error) -> Error {
    Error::run(format!("the terminal cannot be used: {error}"))
        .with_help("without --terminal, raycl opens a window instead")
}

/// Adds a key to the input, unless it was only released. Ctrl-C closes the view; no other key has a meaning with Ctrl.
fn pressed(input: &mut Input, key: KeyEvent) {
    if key.kind == KeyEventKind::Release {
        return;
    }
    let control = key.modifiers.contains(KeyModifiers::CONTROL);
    input.closed |= control && key.code == KeyCode::Char('c');
    input.keys.extend(meant(key.code).filter(|_| !control));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_mean_what_they_mean_in_the_window() {
        assert_eq!(meant(KeyCode::Char('S')), Some(Key::Char('S')));
        assert_eq!(meant(KeyCode::Esc), Some(Key::Escape));
        assert_eq!(meant(KeyCode::F(1)), None);
    }

    #[test]
    fn only_ctrl_c_closes_the_view_and_a_key_that_is_released_does_nothing() {
        let input = |keys: &[KeyEvent]| {
            let mut input = Input::default();
            keys.iter().for_each(|key| pressed(&mut input, *key));
            (input.closed, input.keys)
        };
        let key = |letter: char, modifiers| KeyEvent::new(KeyCode::Char(letter), modifiers);
        let (none, control) = (KeyModifiers::NONE, KeyModifiers::CONTROL);
        assert_eq!(input(&[key('c', control)]), (true, vec![]));
        // A later key does not cancel the effect of Ctrl-C.
        assert_eq!(input(&[key('c', control), key('s', none)]), (true, vec![Key::Char('s')]));
        assert_eq!(input(&[key('c', none)]), (false, vec![Key::Char('c')]));
        assert_eq!(input(&[key('q', control)]), (false, vec![]));
        assert_eq!(input(&[key('S', KeyModifiers::SHIFT)]), (false, vec![Key::Char('S')]));
        let of_kind = |kind| KeyEvent { kind, ..key('x', none) };
        assert_eq!(input(&[of_kind(KeyEventKind::Repeat)]), (false, vec![Key::Char('x')]));
        assert_eq!(input(&[of_kind(KeyEventKind::Release)]), (false, vec![]));
        let released = KeyEvent { kind: KeyEventKind::Release, ..key('c', control) };
        assert_eq!(input(&[released]), (false, vec![]));
    }

    /// Returns a terminal of 80 x 24 characters, of 10 x 20 pixels each, in which no user presses keys.
    fn terminal(graphics: Graphics) -> Terminal {
        Terminal {
            out: std::io::stdout(),
            cells: [80, 24],
            cell_pixels: [10, 20],
            graphics,
            is_interactive: false,
            dragged: None,
            pointer: None,
            line: String::new(),
        }
    }

    #[test]
    fn arrows_mean_arrows() {
        for (code, key) in [
            (KeyCode::Left, Key::Left),
            (KeyCode::Right, Key::Right),
            (KeyCode::Up, Key::Up),
            (KeyCode::Down, Key::Down),
        ] {
            assert_eq!(meant(code), Some(key));
        }
    }

    #[test]
    fn drags_are_counted_in_heights_of_the_picture() {
        let mut terminal = terminal(Graphics::Kitty);
        // The last line is left for text.
        assert_eq!(terminal.size(), [800, 460]);
        let mut input = Input::default();
        let mut mouse = |kind, at| {
            terminal.mouse(&mut input, kind, at);
            (input.orbit, input.pan)
        };
        mouse(MouseEventKind::Drag(MouseButton::Left), [3, 3]);
        mouse(MouseEventKind::Down(MouseButton::Left), [10, 10]);
        mouse(MouseEventKind::Drag(MouseButton::Left), [33, 10]);
        let (orbit, pan) = mouse(MouseEventKind::Drag(MouseButton::Left), [33, 8]);
        // 23 characters of 10 pixels to the right, 2 of 20 pixels up.
        assert_eq!((orbit, pan), ([230.0 / 460.0, -40.0 / 460.0], [0.0; 2]));
        mouse(MouseEventKind::Up(MouseButton::Left), [33, 8]);
        // A movement is a drag only while a button is down.
        mouse(MouseEventKind::Moved, [40, 8]);
        assert_eq!(mouse(MouseEventKind::Drag(MouseButton::Left), [50, 9]), (orbit, pan));
        mouse(MouseEventKind::Up(MouseButton::Left), [50, 9]);
        mouse(MouseEventKind::Down(MouseButton::Right), [0, 0]);
        let (still, pan) = mouse(MouseEventKind::Drag(MouseButton::Right), [0, 23]);
        assert_eq!((still, pan), (orbit, [0.0, 1.0]));
    }

    #[test]
    fn the_wheel_zooms_and_the_pointer_is_in_the_middle_of_its_character() {
        let mut input = Input::default();
        let mut pixels = terminal(Graphics::Sixel);
        pixels.mouse(&mut input, MouseEventKind::ScrollUp, [2, 3]);
        assert_eq!((input.wheel, pixels.pointer), (1.0, Some([24, 69])));
        pixels.mouse(&mut input, MouseEventKind::ScrollDown, [2, 23]);
        assert_eq!((input.wheel, pixels.pointer), (0.0, None), "the last line is no part of the picture");
        let mut blocks = terminal(Graphics::Blocks);
        blocks.mouse(&mut input, MouseEventKind::Moved, [2, 3]);
        assert_eq!((blocks.size(), blocks.pointer), ([80, 46], Some([2, 6])));
        assert_eq!(blocks.input().expect("no input").pointer, Some([2, 6]));
    }
}
