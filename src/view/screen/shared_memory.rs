//! Shows pictures in a window of an X server through memory that raycl shares with the server (the X extension
//! MIT-SHM). raycl writes the pixels once, and the server copies them to the window. minifb, the library that opens
//! windows, copies each picture and sends the copy through a socket, which takes several milliseconds.

use crate::output::in_memory;
use std::fs::File;
use std::os::fd::OwnedFd;
use std::os::unix::fs::FileExt as _;
use x11rb::connection::Connection as _;
use x11rb::errors::ConnectionError;
use x11rb::protocol::Event;
use x11rb::protocol::shm::{ConnectionExt as _, Seg};
use x11rb::protocol::xproto::{ConnectionExt as _, CreateGCAux, Gcontext, ImageFormat, ImageOrder, Window};
use x11rb::rust_connection::RustConnection;

/// The order in which this machine stores the bytes of a pixel.
const BYTE_ORDER: ImageOrder =
    if cfg!(target_endian = "little") { ImageOrder::LSB_FIRST } else { ImageOrder::MSB_FIRST };

/// A window's connection to an X server with which raycl can share memory.
pub struct SharedMemory {
    connection: RustConnection,
    window: Window,
    context: Gcontext,
    /// The number of bits of a pixel's colour in the window.
    depth: u8,
    /// The memory of one picture; `None` before the first picture.
    memory: Option<Memory>,
    /// True if the server may still be copying the last picture.
    copies: bool,
}

/// Memory that the server and raycl share.
struct Memory {
    segment: Seg,
    file: File,
    /// The size of the picture in the memory: pixels across and down.
    size: [u16; 2],
}

impl SharedMemory {
    /// Connects to the server of the X display that the environment variable `DISPLAY` names. Returns `None` if raycl
    /// cannot share memory with the server, for example because the server runs on another machine.
    pub fn of(window: Window) -> Option<Self> {
        let (connection, _) = RustConnection::connect(None).ok()?;
        let orders_bytes_alike = connection.setup().image_byte_order == BYTE_ORDER;
        let version = connection.shm_query_version().ok()?.reply().ok()?;
        // Since version 1.2 of the extension, a program can pass the memory to the server as an open file. (The server
        // could also pass an open file to the program. But if another program forwards the connection, this file does
        // not arrive, and the crate x11rb panics.)
        let passes_files = (version.major_version, version.minor_version) >= (1, 2);
        let depth = connection.get_geometry(window).ok()?.reply().ok()?.depth;
        let context = connection.generate_id().ok()?;
        connection.create_gc(context, window, &CreateGCAux::new()).ok()?.check().ok()?;
        let shared = Self { connection, window, context, depth, memory: None, copies: false };
        (orders_bytes_alike && passes_files).then_some(shared)
    }

    /// Shows a picture in the upper left corner of the window. The function does not wait until the server has copied
    /// the picture. Returns `None` if this picture or the last one cannot be shown in this way.
    pub fn show(&mut self, pixels: &[u32], size: [u32; 2]) -> Option<()> {
        self.finish_copy()?;
        let [width, height] = [u16::try_from(size[0]).ok()?, u16::try_from(size[1]).ok()?];
        let memory = self.memory_of([width, height])?;
        memory.file.write_all_at(bytemuck::cast_slice(pixels), 0).ok()?;
        let segment = memory.segment;
        self.copy(segment, [width, height]).ok()?;
        self.copies = true;
        Some(())
    }

    /// Asks the server to copy a picture from the memory to the window, and to send an event when it has done so.
    fn copy(&self, segment: Seg, [width, height]: [u16; 2]) -> Result<(), ConnectionError> {
        let Self { connection, window, context, depth, .. } = self;
        let (from, to, format, sends_event) = ([0, 0], [0, 0], ImageFormat::Z_PIXMAP.into(), true);
        connection.shm_put_image(
            *window,
            *context,
            width,
            height,
            from[0],
            from[1],
            width,
            height,
            to[0],
            to[1],
            *depth,
            format,
            sends_event,
            segment,
            0,
        )?;
        connection.flush()
    }

    /// Waits until the server has copied the last picture. Returns `None` if the server could not copy it.
    fn finish_copy(&mut self) -> Option<()> {
        while self.copies {
            self.copies = !is_copied(&self.connection.wait_for_event().ok()?)?;
        }
        Some(())
    }

    /// Returns memory for a picture of this size: that of the last picture, if the sizes are equal.
    fn memory_of(&mut self, size: [u16; 2]) -> Option<&Memory> {
        if self.memory.as_ref().is_none_or(|memory| memory.size != size) {
            if let Some(old) = self.memory.take() {
                self.connection.shm_detach(old.segment).ok()?;
            }
            self.memory = Some(Memory::new(&self.connection, size)?);
        }
        self.memory.as_ref()
    }
}

impl Memory {
    fn new(connection: &RustConnection, size: [u16; 2]) -> Option<Self> {
        let bytes = 4 * u64::from(size[0]) * u64::from(size[1]);
        let file = in_memory().ok()?;
        file.set_len(bytes).ok()?;
        let (segment, passed) = (connection.generate_id().ok()?, OwnedFd::from(file.try_clone().ok()?));
        connection.shm_attach_fd(segment, passed, true).ok()?.check().ok()?;
        Some(Self { segment, file, size })
    }
}

/// Returns true if the event says that the server has copied the picture. Returns `None` if the event says that the
/// server could not copy the picture. For any other event, returns false.
fn is_copied(event: &Event) -> Option<bool> {
    match event {
        Event::Error(_) => None,
        event => Some(matches!(event, Event::ShmCompletion(_))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use x11rb::protocol::ErrorKind;
    use x11rb::protocol::shm::CompletionEvent;
    use x11rb::x11_utils::X11Error;

    #[test]
    fn a_copy_ends_with_its_event_or_with_an_error() {
        assert_eq!(is_copied(&Event::ShmCompletion(CompletionEvent::default())), Some(true));
        assert_eq!(is_copied(&Event::Unknown(Vec::new())), Some(false));
        let error = X11Error {
            error_kind: ErrorKind::Drawable,
            error_code: 9,
            sequence: 1,
            bad_value: 1,
            minor_opcode: 3,
            major_opcode: 130,
            extension_name: None,
            request_name: None,
        };
        assert_eq!(is_copied(&Event::Error(error)), None, "the window is gone");
    }
}
