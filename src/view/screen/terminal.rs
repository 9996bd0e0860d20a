//! A terminal as a screen, in half blocks or in pixels.

use super::text::{last_line, over};
use super::{Graphics, Input, Screen};
use crate::device::tell_panics;
use crate::error::{Error, Result};
use crate::view::keys::Key;
use crossterm::event::{
    self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers, MouseButton, MouseEventKind,
};
use crossterm::{cursor, execute, terminal};
use image::{GenericImageView as _, RgbImage};
use std::borrow::Cow;
use std::io::{ErrorKind, IsTerminal as _, Stdout, Write as _};
use std::time::Duration;

/// The numbers of characters across and down that raycl assumes if the terminal does not report them.
const USUAL_CELLS: [u16; 2] = [80, 24];
/// The size of a character in pixels that raycl assumes if the terminal does not report it.
const USUAL_CELL_PIXELS: [u32; 2] = [8, 16];
/// Longest wait for the rest of the terminal's answer, after the part that says which graphics the terminal
/// can show. The terminal sends all parts of its answer at once.
const REST_OF_ANSWER: Duration = Duration::from_millis(20);
/// The escape codes that select the terminal's default colours and clear the screen.
const CLEAR: &str = "\x1b[0m\x1b[2J";

/// The terminal at standard output, or a pipe or a file whose contents will be shown in a terminal.
pub struct Terminal {
    out: Stdout,
    /// The size of the last picture or, before the first picture, the size for which the terminal has room.
    size: [u32; 2],
    /// The terminal's width and height in characters, including the line for text.
    cells: [u16; 2],
    /// Size of a character in pixels.
    cell_pixels: [u32; 2],
    graphics: Graphics,
    /// True if standard input and standard output are terminals, so that a user can press keys.
    is_interactive: bool,
    /// True if the terminal is in raw mode and shows its alternate screen.
    is_entered: bool,
    /// True if nobody reads the output any more.
    is_gone: bool,
    /// The button that is down, and the character at which the pointer was last; `None` if no button is down.
    dragged: Option<(MouseButton, [u16; 2])>,
    pointer: Option<[u32; 2]>,
    line: String,
}

impl Terminal {
    /// Returns the terminal. If `graphics` is `None`, asks the terminal in which form it can show pictures.
    /// Uses half blocks without asking in three cases: if the terminal does not report the size of a character
    /// in pixels, if standard input is not a terminal, or if the output is a pipe or a file.
    ///
    /// The terminal changes to raw mode and to its alternate screen when raycl first shows a picture, writes
    /// a line or looks for input. Before the terminal is in raw mode, for example while a large scene is
    /// loaded, Ctrl-C ends raycl. When the returned value is dropped, the terminal returns to its usual mode
    /// and screen.
    pub fn open(graphics: Option<Graphics>) -> Result<Self> {
        let out = std::io::stdout();
        let is_interactive = out.is_terminal() && std::io::stdin().is_terminal();
        let (cells, cell_pixels) = if out.is_terminal() { sizes() } else { (USUAL_CELLS, None) };
        let graphics = match graphics {
            Some(graphics) => graphics,
            None if is_interactive && cell_pixels.is_some() => asked()?,
            None => Graphics::Blocks,
        };
        Ok(Self::new(out, graphics, (cells, cell_pixels.unwrap_or(USUAL_CELL_PIXELS)), is_interactive))
    }

    fn new(
        out: Stdout,
        graphics: Graphics,
        (cells, cell_pixels): ([u16; 2], [u32; 2]),
        is_interactive: bool,
    ) -> Self {
        Self {
            out,
            size: room(graphics, cells, cell_pixels),
            cells,
            cell_pixels,
            graphics,
            is_interactive,
            is_entered: false,
            is_gone: false,
            dragged: None,
            pointer: None,
            line: String::new(),
        }
    }

    /// Returns true if a user can press keys: if standard input and standard output are terminals.
    pub fn is_interactive(&self) -> bool {
        self.is_interactive
    }

    /// Returns the size of a picture that fills the terminal, pixels across and down.
    pub fn room(&self) -> [u32; 2] {
        room(self.graphics, self.cells, self.cell_pixels)
    }

    /// Returns the size of the part of the picture, from its upper left corner, for which the terminal has room. The
    /// terminal has room for the whole picture, unless the terminal has become smaller since the picture was cast.
    fn visible(&self) -> [u32; 2] {
        let room = self.room();
        [0, 1].map(|axis| self.size[axis].min(room[axis]))
    }

    /// Changes the terminal to raw mode and to its alternate screen. Does nothing if the terminal has already
    /// been changed, or if no user can press keys.
    fn enter(&mut self) -> Result<()> {
        if !self.is_interactive || self.is_entered {
            return Ok(());
        }
        // The terminal's size may have changed while the scene was loaded.
        let (cells, cell_pixels) = sizes();
        self.resized(cells, cell_pixels);
        // `is_entered` is set before the steps that follow, so that all of these steps are undone when the
        // terminal is dropped, even if one of them fails.
        self.is_entered = true;
        tell_panics(restore);
        terminal::enable_raw_mode().map_err(failed)?;
        let screen = (terminal::EnterAlternateScreen, cursor::Hide, event::EnableMouseCapture);
        execute!(self.out, screen.0, screen.1, screen.2).map_err(failed)
    }

    /// Stores the new size of a terminal that has become larger or smaller.
    fn resized(&mut self, cells: [u16; 2], cell_pixels: Option<[u32; 2]>) {
        self.cells = cells;
        self.cell_pixels = cell_pixels.unwrap_or(self.cell_pixels);
        // The line of text is written again, on the new last line.
        self.line.clear();
        // Another pixel may now be under the pointer, so the pointer's position counts as unknown until the mouse
        // moves.
        self.pointer = None;
        self.dragged = None;
    }

    fn write(&mut self, text: &str) -> Result<()> {
        match self.out.write_all(text.as_bytes()).and_then(|()| self.out.flush()) {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => self.is_gone = true,
            // A file that gets the pictures may be on a full disk.
            Err(error) if !self.out.is_terminal() => return Err(Error::unwritable_output(&error)),
            written => written.map_err(failed)?,
        }
        Ok(())
    }

    fn mouse(&mut self, input: &mut Input, kind: MouseEventKind, at: [u16; 2]) {
        let [width, height] = self.visible();
        let pixels = self.graphics.pixels_of(self.cell_pixels);
        match kind {
            MouseEventKind::Down(button) => self.dragged = Some((button, at)),
            MouseEventKind::Up(_) => self.dragged = None,
            MouseEventKind::Drag(button) => {
                if let Some((_, from)) = self.dragged.replace((button, at)) {
                    let cells = |axis: usize| f64::from(at[axis]) - f64::from(from[axis]);
                    let by =
                        [0, 1].map(|axis| cells(axis) * f64::from(pixels[axis]) / f64::from(self.size[1]));
                    let drag = if button == MouseButton::Left { &mut input.orbit } else { &mut input.pan };
                    *drag = [drag[0] + by[0], drag[1] + by[1]];
                }
            }
            MouseEventKind::ScrollUp => input.wheel += 1.0,
            MouseEventKind::ScrollDown => input.wheel -= 1.0,
            _ => {}
        }
        // The pointer counts as being at the pixel in the middle of the character. If a character has two
        // middle pixels, the pointer counts as being at the first of the two; with half blocks, at the upper
        // pixel.
        let [x, y] = [0, 1].map(|axis| u32::from(at[axis]) * pixels[axis] + (pixels[axis] - 1) / 2);
        self.pointer = (x < width && y < height).then_some([x, y]);
    }
}

impl Screen for Terminal {
    fn show(&mut self, picture: &RgbImage) -> Result<()> {
        self.enter()?;
        let end = if self.is_interactive { "\r\n" } else { "\n" };
        let home = if self.is_interactive { "\x1b[H" } else { "" };
        self.size = picture.dimensions().into();
        let visible = self.visible();
        let picture = if picture.dimensions() == (visible[0], visible[1]) {
            Cow::Borrowed(picture)
        } else {
            // The terminal has become smaller than the picture, so the picture is cut. If the whole picture
            // were written, the ends of its rows would appear at the beginning of the terminal's next lines.
            Cow::Owned(picture.view(0, 0, visible[0], visible[1]).to_image())
        };
        let shown = self.graphics.text(&picture, end)?;
        self.write(&format!("{home}{shown}"))
    }

    fn tell(&mut self, line: &str) -> Result<()> {
        if !self.is_interactive || line == self.line {
            return Ok(());
        }
        self.enter()?;
        self.line = line.to_owned();
        self.write(&last_line(line, self.cells))
    }

    fn write_over(&mut self, lines: &[String]) -> Result<bool> {
        // The next picture in half blocks, which are characters, replaces the text. The next picture that is
        // drawn with pixels, not characters, might not replace the text.
        if !self.is_interactive || self.graphics != Graphics::Blocks {
            return Ok(false);
        }
        let [across, pixels_down] = self.visible().map(|side| side as usize);
        self.write(&over(lines, [across, pixels_down.div_ceil(2)]))?;
        Ok(true)
    }

    fn input(&mut self) -> Result<Input> {
        self.enter()?;
        let mut input = Input::default();
        while self.is_interactive && event::poll(Duration::ZERO).map_err(failed)? {
            match event::read().map_err(failed)? {
                Event::Key(key) => pressed(&mut input, key),
                Event::Mouse(mouse) => self.mouse(&mut input, mouse.kind, [mouse.column, mouse.row]),
                Event::Resize(..) => input.redraws = true,
                _ => {}
            }
        }
        if input.redraws {
            let (cells, cell_pixels) = sizes();
            self.resized(cells, cell_pixels);
            self.write(CLEAR)?;
        }
        input.room = Some(self.room());
        input.pointer = self.pointer;
        input.closed |= self.is_gone;
        Ok(input)
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        if self.is_entered {
            // If this output fails, the failure is ignored, since a message in the same terminal would fail too.
            let _ = self.write(self.graphics.end());
            let _ = leave_terminal(&mut self.out);
            let _ = terminal::disable_raw_mode();
        }
    }
}

/// Ends the terminal's reports about the mouse, and shows the cursor and the terminal's usual screen again.
pub fn leave_terminal(out: &mut Stdout) -> std::io::Result<()> {
    execute!(out, event::DisableMouseCapture, cursor::Show, terminal::LeaveAlternateScreen)
}

/// Restores the terminal if it is in raw mode. raycl calls this function when the crate `ocl` has panicked,
/// before the process ends. After this call, the message about the panic appears on the terminal's usual
/// screen.
fn restore(_reason: &str) {
    if terminal::is_raw_mode_enabled().unwrap_or(false) {
        // If this output fails, the failure is ignored, since a message in the same terminal would fail too.
        let _ = leave_terminal(&mut std::io::stdout());
        let _ = terminal::disable_raw_mode();
    }
}

/// Returns the form in which the terminal can show pictures. The terminal must be in raw mode to be asked; raw mode
/// ends after the answer.
fn asked() -> Result<Graphics> {
    terminal::enable_raw_mode().map_err(failed)?;
    let graphics = Graphics::of_terminal();
    // The rest of the terminal's answer is read before raw mode ends, since the terminal would show an unread
    // rest as text after the end of raw mode.
    while event::poll(REST_OF_ANSWER).is_ok_and(|is_there| is_there) {
        let _ = event::read();
    }
    terminal::disable_raw_mode().map_err(failed)?;
    Ok(graphics)
}

/// Returns the size in pixels of a picture that fills a terminal; one line is left for text.
fn room(graphics: Graphics, cells: [u16; 2], cell_pixels: [u32; 2]) -> [u32; 2] {
    let [across, down] = cells.map(u32::from);
    graphics.size([across.max(1), down.saturating_sub(1).max(1)], cell_pixels)
}

/// Returns the numbers of characters across and down, and the size of a character in pixels if the terminal reports it.
fn sizes() -> ([u16; 2], Option<[u32; 2]>) {
    let Ok(window) = terminal::window_size() else {
        return (known(terminal::size().map_or(USUAL_CELLS, <[u16; 2]>::from)), None);
    };
    let cells = [window.columns, window.rows];
    let pixels = [window.width, window.height];
    let cell = [0, 1].map(|axis| u32::from(pixels[axis] / cells[axis].max(1)));
    (known(cells), (cell[0] > 0 && cell[1] > 0).then_some(cell))
}

/// Returns the numbers of characters across and down. A terminal that does not know its size, such as a serial line,
/// reports 0; raycl then assumes a usual number.
fn known(cells: [u16; 2]) -> [u16; 2] {
    [0, 1].map(|axis| if cells[axis] == 0 { USUAL_CELLS[axis] } else { cells[axis] })
}

fn failed(error: std::io::Error) -> Error {
    Error::run(format!("the terminal cannot be used: {error}"))
        .with_help("without --terminal, raycl opens a window instead")
}

/// Adds a key to the input, unless the event is the key's release. Ctrl-C closes the view; all other keys are ignored
/// while Ctrl is held. If Escape may have been pressed just before the key, first adds Escape ([`follows_escape`]).
fn pressed(input: &mut Input, key: KeyEvent) {
    if key.kind == KeyEventKind::Release {
        return;
    }
    input.keys.extend(follows_escape(&key).then_some(Key::Escape));
    let control = key.modifiers.contains(KeyModifiers::CONTROL);
    input.closed |= control && key.code == KeyCode::Char('c');
    input.keys.extend(meant(key.code).filter(|_| !control));
}

/// Returns true if a key may have been pressed after Escape. If the bytes of Escape and of this key are read together,
/// they equal the bytes of the key with Alt, so the crate crossterm reports the key with Alt. raycl uses no key with
/// Alt; it takes such a key for Escape followed by the key. Only keys of one character are affected: an arrow key with
/// Alt, for example, has bytes of its own. On systems other than Unix, crossterm reads no bytes, so Alt means Alt.
fn follows_escape(key: &KeyEvent) -> bool {
    let is_one_character =
        matches!(key.code, KeyCode::Char(_) | KeyCode::Enter | KeyCode::Tab | KeyCode::Backspace);
    cfg!(unix) && is_one_character && key.modifiers.contains(KeyModifiers::ALT)
}

/// Returns the key that a code of the terminal means; `None` for keys that raycl does not use.
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

    #[cfg(unix)]
    #[test]
    fn escape_is_not_lost_if_another_key_follows_before_raycl_reads() {
        let keys = |code, modifiers| {
            let mut input = Input::default();
            pressed(&mut input, KeyEvent::new(code, modifiers));
            input.keys
        };
        let (alt, control) = (KeyModifiers::ALT, KeyModifiers::CONTROL);
        let letter = KeyCode::Char('s');
        assert_eq!(keys(letter, alt), [Key::Escape, Key::Char('s')]);
        assert_eq!(keys(letter, alt | control), [Key::Escape]);
        assert_eq!(keys(KeyCode::Enter, alt), [Key::Escape]);
        assert_eq!(keys(letter, KeyModifiers::SHIFT), [Key::Char('s')]);
        assert_eq!(
            keys(KeyCode::Left, alt),
            [Key::Left],
            "Alt and an arrow key are not Escape and an arrow key"
        );
    }

    /// Returns a terminal of 80 x 24 characters, of 10 x 20 pixels each, in which no user presses keys.
    fn terminal(graphics: Graphics) -> Terminal {
        Terminal::new(std::io::stdout(), graphics, ([80, 24], [10, 20]), false)
    }

    #[test]
    fn a_terminal_that_does_not_know_its_size_has_the_usual_one() {
        assert_eq!([[0, 0], [0, 30], [120, 0], [1, 2]].map(known), [[80, 24], [80, 30], [120, 24], [1, 2]]);
    }

    #[test]
    fn the_view_is_closed_when_nobody_reads_it() {
        let mut terminal = terminal(Graphics::Blocks);
        assert!(!terminal.input().expect("no input").closed);
        terminal.is_gone = true;
        assert!(terminal.input().expect("no input").closed);
    }

    #[test]
    fn a_smaller_terminal_shows_the_upper_left_part_of_a_picture_until_the_next_one() {
        let mut terminal = terminal(Graphics::Kitty);
        terminal.line = "a line".to_owned();
        terminal.resized([60, 11], None);
        assert_eq!(
            (terminal.room(), terminal.visible(), terminal.line.as_str()),
            ([600, 200], [600, 200], "")
        );
        let mut input = Input::default();
        let mut pointed = |at| {
            terminal.mouse(&mut input, MouseEventKind::Moved, at);
            terminal.pointer
        };
        assert_eq!((pointed([59, 9]), pointed([59, 10])), (Some([594, 189]), None));
        assert_eq!(terminal.input().expect("no input").room, Some([600, 200]));
        // A terminal that has become larger has room for a larger picture, but shows the last (smaller)
        // picture until a larger picture is cast.
        terminal.pointer = Some([594, 189]);
        terminal.resized([100, 40], Some([20, 40]));
        assert_eq!(
            (terminal.room(), terminal.visible(), terminal.cell_pixels, terminal.pointer),
            ([2000, 1560], [800, 460], [20, 40], None)
        );
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
        // The terminal's last line is left for text, so a picture has 23 of the 24 lines.
        assert_eq!(terminal.room(), [800, 460]);
        let mut input = Input::default();
        let mut mouse = |kind, at| {
            terminal.mouse(&mut input, kind, at);
            (input.orbit, input.pan)
        };
        mouse(MouseEventKind::Drag(MouseButton::Left), [3, 3]);
        mouse(MouseEventKind::Down(MouseButton::Left), [10, 10]);
        mouse(MouseEventKind::Drag(MouseButton::Left), [33, 10]);
        let (orbit, pan) = mouse(MouseEventKind::Drag(MouseButton::Left), [33, 8]);
        // The drag goes 23 characters of 10 pixels each to the right, and 2 characters of 20 pixels each up.
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
        assert_eq!((blocks.room(), blocks.pointer), ([80, 46], Some([2, 6])));
        assert_eq!(blocks.input().expect("no input").pointer, Some([2, 6]));
    }
}
