//! Where pictures are shown, and where the user's wishes come from.

mod terminal;
mod window;

pub use terminal::Terminal;
pub use window::Window;

use super::keys::Key;
use crate::error::Result;
use image::RgbImage;

/// What the user did since the last look.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Input {
    /// Keys that were pressed, or held.
    pub keys: Vec<Key>,
    /// How far the pointer was dragged to go around the scene: to the right and down, in heights of the picture.
    pub orbit: [f64; 2],
    /// And to move aside.
    pub pan: [f64; 2],
    /// Steps of the wheel, positive for away from the user.
    pub wheel: f64,
    /// The pixel that the pointer is at.
    pub pointer: Option<[u32; 2]>,
    /// Whether the window was closed.
    pub closed: bool,
}

/// A window, or a terminal.
pub trait Screen {
    /// Shows a picture.
    fn show(&mut self, picture: &RgbImage) -> Result<()>;

    /// Shows a line beside it.
    fn tell(&mut self, line: &str) -> Result<()>;

    /// What the user did since the last call.
    fn input(&mut self) -> Result<Input>;
}
