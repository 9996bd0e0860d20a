//! A window in which the view shows its pictures (a [`Screen`]). The window's libraries are loaded when the
//! window opens, so that no other command needs them.

#[cfg(unix)]
use super::pointer::{Moves, Pointer};
#[cfg(unix)]
use super::shared_memory::SharedMemory;
use super::typed::{Focus, Typed};
#[cfg(unix)]
use super::x_server::{MOST_PIXELS, Pixels, XServer};
use super::{Input, Screen};
use crate::error::{Error, Result};
use crate::view::keys::Key;
use image::RgbImage;
use minifb::{MouseButton, MouseMode, ScaleMode, WindowOptions};
use rayon::prelude::*;
use std::sync::mpsc::{Receiver, channel};

const REMEDY: &str = "--terminal shows the scene in this terminal instead; `raycl render` writes a picture to a \
    file; if you have logged in to this machine with ssh, `ssh -X` shows the window on your own screen";

/// The number of bits that a display's pixels must have: minifb (the library that opens windows) opens no
/// window on other displays.
#[cfg(unix)]
const PIXEL_BITS: u8 = 32;

/// The bits of a pixel in which minifb writes red, green and blue, on every display.
#[cfg(unix)]
const MASKS: [u32; 3] = [0xff_0000, 0xff00, 0xff];

/// The number of pixels that a thread copies at a time.
const TOGETHER: usize = 1 << 14;

/// A window, which opens at the first picture's size.
pub struct Window {
    window: minifb::Window,
    /// The size of the picture that is shown, pixels across and down.
    size: [u32; 2],
    /// The keys that were typed.
    keys: Receiver<Key>,
    focus: Focus,
    /// The pixels that are shown. The bytes of each pixel, from the highest, are 0, red, green and blue.
    pixels: Vec<u32>,
    /// The position of the pointer when `drag` was last called; `None` if no button was down at that time.
    dragged: Option<[f64; 2]>,
    /// The events of the pointer; `None` if no X server sends them. In this case, raycl asks minifb once per frame
    /// where the pointer is and which buttons are down.
    #[cfg(unix)]
    events: Option<Pointer>,
    /// The memory that raycl shares with the X server; `None` if minifb shows the pictures.
    #[cfg(unix)]
    shared: Option<SharedMemory>,
    /// True if the call that showed the last picture has also read the user's input.
    looked: bool,
}

impl Window {
    /// Opens the window.
    ///
    /// # Errors
    ///
    /// Returns a user error if there is no display, if the display's pixels do not have 32 bits, if the
    /// display stores colours in other bits of a pixel than minifb, if the display supports no windows of
    /// this size, or if the window's libraries are missing.
    pub fn open(title: &str, size: [u32; 2]) -> Result<Self> {
        // The connection to the display must stay open until the window is open.
        let display = checked_display(size)?;
        let [width, height] = size.map(|side| side as usize);
        let mut window = minifb::Window::new(title, width, height, options()).map_err(|error| {
            Error::input(format!("the window cannot be opened: {error}")).with_help(format!(
                "a window needs a display, and on Debian the packages libx11-6 and libxcursor1; {REMEDY}"
            ))
        })?;
        drop(display);
        // Without this call, minifb would wait in each frame until 4 ms have passed since the last frame. The view
        // itself rests while there is nothing to cast.
        window.set_target_fps(0);
        let ((sender, keys), focus) = (channel(), Focus::default());
        window.set_input_callback(Box::new(Typed::new(sender, &focus)));
        // `update` asks the X server for the pointer's position. When the server has answered, it has also
        // carried out the earlier request to create the window.
        window.update();
        Ok(Self {
            #[cfg(unix)]
            events: x11_window(&window).and_then(Pointer::over),
            #[cfg(unix)]
            shared: x11_window(&window).and_then(SharedMemory::of),
            window,
            size,
            keys,
            focus,
            pixels: Vec::new(),
            dragged: None,
            looked: false,
        })
    }

    /// Returns the window's size, which is at least one pixel across and down.
    fn room(&self) -> [u32; 2] {
        <[usize; 2]>::from(self.window.get_size()).map(|side| side.clamp(1, u32::MAX as usize) as u32)
    }

    fn pointer(&self) -> Option<[u32; 2]> {
        let (x, y) = self.window.get_unscaled_mouse_pos(MouseMode::Discard)?;
        let [x, y] = [x as u32, y as u32];
        (x < self.size[0] && y < self.size[1]).then_some([x, y])
    }

    /// Returns how far the pointer moved with a button down since the last call, in heights of the picture.
    fn drag(&mut self) -> [f64; 2] {
        let down = self.is_down(MouseButton::Left) || self.pans();
        let at = self.window.get_unscaled_mouse_pos(MouseMode::Pass).filter(|_| down);
        let at = at.map(|(x, y)| [x, y].map(f64::from));
        moved(std::mem::replace(&mut self.dragged, at), at, self.size)
    }

    /// Returns what X11's events report: the drags of the pointer that orbit, the drags that pan (both in
    /// heights of the picture), the steps of the wheel, and whether the server has lost a part of the
    /// picture. minifb does not receive these events.
    #[cfg(unix)]
    fn moves(&mut self) -> ([[f64; 2]; 2], f64, bool) {
        let moves = self.events.as_mut().map(Pointer::moves).unwrap_or_default();
        let Moves { orbit, pan, wheel, loses_picture } = moves;
        ([orbit, pan].map(|by| in_heights(by, self.size)), wheel, loses_picture)
    }

    /// Returns zeros and false: on systems other than Unix there is no X server, and `drag` returns all
    /// movements that minifb reports.
    #[cfg(not(unix))]
    fn moves(&mut self) -> ([[f64; 2]; 2], f64, bool) {
        ([[0.0; 2]; 2], 0.0, false)
    }

    /// Shows the pixels. minifb also reads the user's input, and sends the window's title to the display.
    fn present(&mut self) -> Result<()> {
        self.looked = true;
        if self.share() {
            self.window.update();
            return Ok(());
        }
        let [width, height] = self.size.map(|side| side as usize);
        self.window
            .update_with_buffer(&self.pixels, width, height)
            .map_err(|error| Error::run(format!("the window cannot show a picture: {error}")))
    }

    /// Shows the pixels through memory that raycl shares with the X server. Returns false if the pixels cannot be shown
    /// in this way; raycl then does not try this way again.
    #[cfg(unix)]
    fn share(&mut self) -> bool {
        let shown = self.shared.as_mut().and_then(|shared| shared.show(&self.pixels, self.size));
        if shown.is_none() {
            self.shared = None;
        }
        shown.is_some()
    }

    /// Returns false: only on Unix can raycl share memory with an X server.
    #[cfg(not(unix))]
    fn share(&mut self) -> bool {
        false
    }

    fn is_down(&self, button: MouseButton) -> bool {
        self.window.get_mouse_down(button)
    }

    fn pans(&self) -> bool {
        self.is_down(MouseButton::Right) || self.is_down(MouseButton::Middle)
    }
}

impl Screen for Window {
    fn show(&mut self, picture: &RgbImage) -> Result<()> {
        self.size = picture.dimensions().into();
        self.pixels.resize(picture.len() / 3, 0);
        let parts = self.pixels.par_chunks_mut(TOGETHER).zip(picture.par_chunks(3 * TOGETHER));
        parts.for_each(|(pixels, bytes)| {
            for (pixel, [red, green, blue]) in pixels.iter_mut().zip(bytes.as_chunks().0) {
                *pixel = u32::from_be_bytes([0, *red, *green, *blue]);
            }
        });
        self.present()
    }

    fn tell(&mut self, line: &str) -> Result<()> {
        self.window.set_title(line);
        Ok(())
    }

    fn tell_at_once(&mut self, line: &str) -> Result<()> {
        self.window.set_title(line);
        // Before the first picture is cast, the window has no pixels to show.
        if self.pixels.is_empty() { Ok(()) } else { self.present() }
    }

    fn input(&mut self) -> Result<Input> {
        if !std::mem::take(&mut self.looked) {
            self.window.update();
        }
        self.focus.now(self.window.is_active());
        let by = self.drag();
        let asked = orbit_and_pan(by, self.pans());
        let (moves, wheel, redraws) = self.moves();
        let sum = |drag: usize| [0, 1].map(|axis: usize| asked[drag][axis] + moves[drag][axis]);
        Ok(Input {
            keys: self.keys.try_iter().collect(),
            orbit: sum(0),
            pan: sum(1),
            wheel: wheel + self.window.get_scroll_wheel().map_or(0.0, |(_, steps)| f64::from(steps)),
            room: Some(self.room()),
            pointer: self.pointer(),
            redraws,
            closed: !self.window.is_open(),
        })
    }
}

/// Returns the options of the window. If the window's size changes, the last picture lies unscaled in the upper left
/// corner until a picture of the new size is cast. The pointer's position in the window is therefore always its
/// position in the picture, too.
fn options() -> WindowOptions {
    WindowOptions { resize: true, scale_mode: ScaleMode::UpperLeft, ..WindowOptions::default() }
}

/// Returns how far the pointer moved during a drag from `from` to `at`. The first number is the distance to the right,
/// the second the distance down. The unit is the height of the picture. `size` is the picture's size in pixels. Returns
/// zeros if the drag has only begun (`from` is `None`) or has ended (`at` is `None`).
fn moved(from: Option<[f64; 2]>, at: Option<[f64; 2]>, size: [u32; 2]) -> [f64; 2] {
    let by = match (from, at) {
        (Some(from), Some(at)) => [at[0] - from[0], at[1] - from[1]],
        _ => [0.0; 2],
    };
    in_heights(by, size)
}

/// Converts a movement from pixels to the unit of the picture's height.
fn in_heights(by: [f64; 2], size: [u32; 2]) -> [f64; 2] {
    by.map(|pixels| pixels / f64::from(size[1]))
}

/// Returns the number of a window on its X server; `None` without an X server.
#[cfg(unix)]
fn x11_window(window: &minifb::Window) -> Option<u32> {
    // The handle of a window of X11 is its number on the server.
    let number = u32::try_from(window.get_window_handle() as usize).ok()?;
    if cfg!(target_os = "macos") { None } else { Some(number) }
}

/// Returns the movement of a drag as `[orbit, pan]`: one of the two is zero, depending on the button.
fn orbit_and_pan(by: [f64; 2], pans: bool) -> [[f64; 2]; 2] {
    if pans { [[0.0; 2], by] } else { [by, [0.0; 2]] }
}

/// Returns a connection to the X11 display. Returns `None` in two cases: on macOS, whose windows need no X11
/// display, or if the display does not say how it stores pixels.
///
/// # Errors
///
/// Returns a user error if there is no display, if X11 supports no windows of this size, or if minifb cannot
/// write the display's pixels.
#[cfg(unix)]
fn checked_display(size: [u32; 2]) -> Result<Option<XServer>> {
    if cfg!(target_os = "macos") {
        return Ok(None);
    }
    let name = std::env::var_os("DISPLAY").unwrap_or_default();
    if name.is_empty() {
        let message = "there is no display: the environment variable DISPLAY is not set or is empty";
        return Err(Error::input(message).with_help(REMEDY));
    }
    check_size(size)?;
    let display = name.to_str().and_then(XServer::of);
    let pixels = display.as_ref().map(|display| display.pixels);
    match pixels.filter(|pixels| (pixels.bits, pixels.masks) != (PIXEL_BITS, MASKS)) {
        Some(pixels) => Err(other_pixels(&name.to_string_lossy(), pixels)),
        None => Ok(display),
    }
}

/// Returns `None`: only windows of Unix need an X11 display.
#[cfg(not(unix))]
fn checked_display(_size: [u32; 2]) -> Result<Option<std::convert::Infallible>> {
    Ok(None)
}

/// Returns a user error if X11 supports no windows of this size. Without this check, Xlib would end the
/// process.
#[cfg(unix)]
fn check_size([width, height]: [u32; 2]) -> Result<()> {
    let sides = [("--width", width), ("--height", height)];
    let Some((option, side)) = sides.into_iter().find(|(_, side)| *side > MOST_PIXELS) else { return Ok(()) };
    let message = format!(
        "the window cannot be opened: {option} is {side}, but a window has at most {MOST_PIXELS} pixels across and down"
    );
    let remedy = format!(
        "give {option} a smaller number, or give --terminal instead of --width and --height; `raycl render` writes larger pictures"
    );
    Err(Error::input(message).with_help(remedy))
}

/// Returns the error for a display whose pixels minifb cannot write, or would write with wrong colours.
#[cfg(unix)]
fn other_pixels(display: &str, Pixels { depth, bits, masks }: Pixels) -> Error {
    let [found, needed] =
        [masks, MASKS].map(|[red, green, blue]| format!("{red:#x}, {green:#x} and {blue:#x}"));
    Error::input(format!(
        "the window cannot be opened: the display {display} has {depth}-bit colours, in pixels of {bits} bits with the masks {found} of red, green and blue, but a window needs pixels of {PIXEL_BITS} bits with the masks {needed}"
    ))
    .with_help(format!("use a display with 24-bit colours in pixels of {PIXEL_BITS} bits, or no window: {REMEDY}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_window_that_is_too_large_for_x11_is_a_mistake_in_the_option() {
        assert!(check_size([32767, 32767]).is_ok());
        for (size, option) in [([32768, 1], "--width is 32768"), ([1, 65536], "--height is 65536")] {
            let error = check_size(size).expect_err("it is too large");
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains(&format!("{option}, ")), "{error}");
        }
    }

    #[test]
    fn a_picture_of_another_size_than_the_window_is_not_stretched() {
        let WindowOptions { resize, scale_mode, .. } = options();
        assert_eq!((resize, scale_mode), (true, ScaleMode::UpperLeft));
    }

    #[test]
    fn drags_are_counted_in_heights_of_the_picture_from_one_position_to_the_next() {
        let moved = |from, at| moved(from, at, [800, 500]);
        assert_eq!(moved(Some([100.0, 200.0]), Some([150.0, 175.0])), [0.1, -0.05]);
        assert_eq!([moved(None, Some([9.0, 9.0])), moved(Some([9.0, 9.0]), None)], [[0.0; 2]; 2]);
        let by = [0.1, -0.05];
        assert_eq!(orbit_and_pan(by, false), [by, [0.0; 2]]);
        assert_eq!(orbit_and_pan(by, true), [[0.0; 2], by]);
    }
}
