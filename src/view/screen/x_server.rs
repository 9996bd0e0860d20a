//! Asks an X server how the server stores pixels, before a window opens. minifb is the library that opens windows. If
//! the pixels of the display do not have 32 bits, minifb frees memory twice, and the process ends. If the display
//! stores red, green and blue in other bits than minifb writes, the window shows wrong colours.

use x11rb::connection::Connection as _;
use x11rb::rust_connection::RustConnection;

/// The largest width and height of a window in pixels. The protocol stores positions in a window as signed 16-bit
/// numbers, and sizes as unsigned 16-bit numbers, so a server cannot draw the pixels of a larger window.
pub const MOST_PIXELS: u32 = i16::MAX as u32;

/// How a display stores the pixels of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pixels {
    /// The number of bits of a pixel's colour.
    pub depth: u8,
    /// The number of bits that a pixel takes in memory.
    pub bits: u8,
    /// The bits of a pixel that store red, green and blue.
    pub masks: [u32; 3],
}

/// A connection to an X server, and the server's answer about how it stores pixels. Keep the connection open
/// until the window's connection is open: a server without any connection may start again, and would then end
/// the window's new connection.
pub struct XServer {
    pub pixels: Pixels,
    _connection: RustConnection,
}

impl XServer {
    /// Connects to the server of a display, such as `:0` or `localhost:10.0`. Returns `None` if the server
    /// does not answer, or does not let this program in. Without a connection, nothing is known about the
    /// server's pixels.
    pub fn of(display: &str) -> Option<Self> {
        let (connection, screen) = RustConnection::connect(Some(display)).ok()?;
        let setup = connection.setup();
        let root = setup.roots.get(screen)?;
        let depth = root.root_depth;
        let bits = setup.pixmap_formats.iter().find(|format| format.depth == depth)?.bits_per_pixel;
        let mut visuals = root.allowed_depths.iter().flat_map(|allowed| &allowed.visuals);
        let visual = visuals.find(|visual| visual.visual_id == root.root_visual)?;
        let masks = [visual.red_mask, visual.green_mask, visual.blue_mask];
        Some(Self { pixels: Pixels { depth, bits, masks }, _connection: connection })
    }
}
