//! The screens that show pictures and read the user's input.

mod blocks;
mod graphics;
#[cfg(unix)]
mod pointer;
#[cfg(unix)]
mod shared_memory;
mod terminal;
mod text;
mod typed;
mod window;
#[cfg(unix)]
mod x_server;

pub use graphics::Graphics;
pub use terminal::{Terminal, leave_terminal};
pub use window::Window;

use super::keys::Key;
use crate::error::Result;
use image::RgbImage;

/// The user's input since the last call of [`Screen::input`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Input {
    /// The keys that were pressed or held.
    pub keys: Vec<Key>,
    /// The drag that moves the eye around the scene. The numbers are the drag's distances to the right and down,
    /// divided by the picture's height.
    pub orbit: [f64; 2],
    /// The drag that moves the eye sideways, up or down. The numbers are as in `orbit`.
    pub pan: [f64; 2],
    /// The steps of the mouse wheel; steps away from the user are positive.
    pub wheel: f64,
    /// The size of the largest picture for which the screen has room, in pixels across and down; `None` if the size is
    /// not known.
    pub room: Option<[u32; 2]>,
    /// The pixel at the pointer; `None` if the pointer is not over the picture, or if its position is not known.
    pub pointer: Option<[u32; 2]>,
    /// True if the last picture and the line of text must be shown again, because the screen was cleared or has lost a
    /// part of the picture.
    pub redraws: bool,
    /// True if the window was closed, if the user pressed Ctrl-C in the terminal, or if nobody reads the
    /// terminal's output any more.
    pub closed: bool,
}

/// A window or a terminal that shows pictures and reads the user's input.
pub trait Screen {
    /// Shows a picture.
    fn show(&mut self, picture: &RgbImage) -> Result<()>;

    /// Shows a line of text beside the picture.
    fn tell(&mut self, line: &str) -> Result<()>;

    /// Shows a line of text beside the picture at once. The function `tell` of a window may show the line
    /// only with the next picture.
    fn tell_at_once(&mut self, line: &str) -> Result<()> {
        self.tell(line)
    }

    /// Writes lines of text over the picture, from its upper left corner. The next picture replaces the text. Returns
    /// false, and leaves the picture as it is, if the screen writes no text over pictures.
    fn write_over(&mut self, _lines: &[String]) -> Result<bool> {
        Ok(false)
    }

    /// Returns the user's input since the last call of this function.
    fn input(&mut self) -> Result<Input>;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A screen that implements only the functions that the trait `Screen` requires, and stores the lines
    /// that it shows.
    #[derive(Default)]
    struct Plain(Vec<String>);

    impl Screen for Plain {
        fn show(&mut self, _: &RgbImage) -> Result<()> {
            Ok(())
        }

        fn tell(&mut self, line: &str) -> Result<()> {
            self.0.push(line.to_owned());
            Ok(())
        }

        fn input(&mut self) -> Result<Input> {
            Ok(Input::default())
        }
    }

    #[test]
    fn a_plain_screen_shows_lines_beside_the_picture_and_none_over_it() {
        let mut screen = Plain::default();
        screen.tell("teapot").unwrap();
        screen.tell_at_once("compiling").unwrap();
        assert!(!screen.write_over(&["q quit".to_owned()]).unwrap());
        assert_eq!(screen.0, ["teapot", "compiling"]);
    }
}
