//! Starts an X server without a screen (Xvfb), reads the picture that it would show, and simulates a user's input. The
//! input is sent directly in the X11 protocol. This file sends numbers in little-endian order, as its first message to
//! the server announces. Lengths are in words of four bytes, as the protocol requires.

use crate::binary::until;
use image::RgbImage;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

/// An X server for one test, which ends when the value is dropped.
pub struct Server {
    process: Child,
    number: u32,
    folder: tempfile::TempDir,
}

impl Server {
    /// Starts a server with one screen of this size.
    pub fn start(size: [u32; 2]) -> Self {
        Self::with_depth(size, 24)
    }

    /// Starts a server with one screen of this size, whose pixels have this many bits.
    pub fn with_depth(size: [u32; 2], bits: u32) -> Self {
        Self::with(size, bits, &[])
    }

    /// Starts a server that cannot share memory with programs, with one screen of this size.
    pub fn without_shared_memory(size: [u32; 2]) -> Self {
        Self::with(size, 24, &["-extension", "MIT-SHM"])
    }

    fn with([width, height]: [u32; 2], bits: u32, options: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let screen = format!("{width}x{height}x{bits}");
        let mut process = Command::new("Xvfb")
            .args(["-displayfd", "1", "-nolisten", "tcp", "-screen", "0", &screen])
            .arg("-fbdir")
            .arg(folder.path())
            .args(options)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb, which `make test` installs");
        let mut line = String::new();
        let said = process.stdout.take().expect("a pipe");
        BufReader::new(said).read_line(&mut line).expect("the number of a display");
        let number = line.trim().parse().unwrap_or_else(|_| panic!("Xvfb said '{line}'"));
        Self { process, number, folder }
    }

    /// Returns the display name by which programs find the server.
    pub fn display(&self) -> String {
        format!(":{}", self.number)
    }

    /// Returns the picture on the screen, from a file in the format of xwd. The bytes of a pixel are blue,
    /// green, red and an unused one.
    pub fn picture(&self) -> RgbImage {
        let file: PathBuf = self.folder.path().join("Xvfb_screen0");
        let bytes = std::fs::read(&file).expect("the screen's file");
        let word = |index: usize| u32::from_be_bytes(std::array::from_fn(|i| bytes[4 * index + i]));
        let [width, height, line_bytes] = [word(4), word(5), word(12)];
        let first = word(0) + 12 * word(19);
        RgbImage::from_fn(width, height, |x, y| {
            let at = (first + y * line_bytes + 4 * x) as usize;
            image::Rgb([bytes[at + 2], bytes[at + 1], bytes[at]])
        })
    }

    /// Returns the sizes of the memories that programs and the server share, in bytes.
    pub fn shared_bytes(&self) -> Vec<u64> {
        let maps = std::fs::read_to_string(format!("/proc/{}/maps", self.process.id())).expect("the maps");
        let shared = maps.lines().filter(|line| line.contains("-s ") && line.ends_with("(deleted)"));
        let bytes = |line: &str| {
            let (from, to) = line.split_once(' ')?.0.split_once('-')?;
            Some(u64::from_str_radix(to, 16).ok()? - u64::from_str_radix(from, 16).ok()?)
        };
        shared.map(|line| bytes(line).expect("an address range")).collect()
    }

    /// Starts a thread that forwards all data of another display to this server and back, but no open files, as ssh
    /// does. Returns the other display.
    pub fn forwarded(&self) -> Forwarded {
        let bound = |number| Some((UnixListener::bind(socket(number)).ok()?, number));
        let (listener, number) = (20_000..30_000).find_map(bound).expect("a free display");
        let server = socket(self.number);
        std::thread::spawn(move || {
            for program in listener.incoming().map_while(Result::ok) {
                forward(program, UnixStream::connect(&server).expect("the server's socket"));
            }
        });
        Forwarded { number }
    }

    /// Waits until the only window exists, and returns a simulated user of this window.
    pub fn user(&self) -> User {
        let mut stream = UnixStream::connect(socket(self.number)).expect("the server's socket");
        stream.write_all(&[b'l', 0, 11, 0, 0, 0, 0, 0, 0, 0, 0, 0]).expect("a greeting");
        let head = read(&mut stream, 8);
        assert_eq!(head[0], 1, "the server lets everybody in");
        let body = read(&mut stream, 4 * usize::from(half(&head, 6)));
        let (vendor, formats) = (usize::from(half(&body, 16)), usize::from(body[21]));
        let root = word(&body, 32 + vendor.next_multiple_of(4) + 8 * formats);
        let mut user = User { stream, root, window: 0, keycodes: [body[26], body[27]] };
        let start = std::time::Instant::now();
        while user.window == 0 {
            assert!(start.elapsed() < crate::binary::LIMIT, "no window appears");
            user.window = user.find_window();
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        user
    }

    /// Waits until the picture on the screen fulfils a condition.
    pub fn until_shown(&self, what: &str, so: impl Fn(&RgbImage) -> bool) {
        until(what, || so(&self.picture()));
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // The process may have ended by itself.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A display whose data is forwarded to a server. The display's socket is removed when the value is dropped.
pub struct Forwarded {
    number: u32,
}

impl Forwarded {
    /// Returns the display name by which programs find the display.
    pub fn display(&self) -> String {
        format!(":{}", self.number)
    }
}

impl Drop for Forwarded {
    fn drop(&mut self) {
        // If the file is gone already, nothing is left to remove.
        let _ = std::fs::remove_file(socket(self.number));
    }
}

/// Copies the data of each of two connections to the other one until both end.
fn forward(one: UnixStream, other: UnixStream) {
    let copy = |mut from: UnixStream, mut to: UnixStream| {
        std::thread::spawn(move || {
            // Either program may end its connection at any time.
            let _ = std::io::copy(&mut from, &mut to);
            let _ = to.shutdown(std::net::Shutdown::Both);
        });
    };
    copy(one.try_clone().expect("a descriptor"), other.try_clone().expect("a descriptor"));
    copy(other, one);
}

/// Returns the path of a display's socket.
fn socket(number: u32) -> String {
    format!("/tmp/.X11-unix/X{number}")
}

/// A simulated user with a keyboard and a pointer.
pub struct User {
    stream: UnixStream,
    root: u32,
    window: u32,
    /// The least and the greatest code of a key on the server's keyboard.
    keycodes: [u8; 2],
}

impl User {
    /// Presses and releases the key with this symbol (for a letter, its code).
    pub fn press(&mut self, symbol: u32) {
        let code = self.keycode(symbol);
        let request = [2, 3].map(|kind| self.event(kind, code)).concat();
        self.send(&request);
        self.until_done();
    }

    /// Presses or releases a button of the pointer: 1 is the left one, 3 the right one.
    pub fn button(&mut self, number: u8, is_down: bool) {
        let request = self.event(if is_down { 4 } else { 5 }, number);
        self.send(&request);
        self.until_done();
    }

    /// Presses a button at a pixel of the window, moves the pointer and releases the button, all at once. The window
    /// gets the events from the server, as from a real pointer.
    pub fn drag(&mut self, number: u8, [from, to]: [[u16; 2]; 2]) {
        let test = self.extension("XTEST");
        let root = self.root;
        let fake = |kind: u8| {
            let mut request = vec![test, 2, 9, 0, kind, number, 0, 0, 0, 0, 0, 0];
            request.extend(root.to_le_bytes());
            request.resize(36, 0);
            request
        };
        self.point(from);
        self.send(&fake(4));
        self.point(to);
        self.send(&fake(5));
        self.until_done();
    }

    /// Returns the number with which requests of an extension begin.
    fn extension(&mut self, name: &str) -> u8 {
        let mut request = vec![98, 0, 2 + name.len().div_ceil(4) as u8, 0, name.len() as u8, 0, 0, 0];
        request.extend(name.bytes());
        request.resize(request.len().next_multiple_of(4), 0);
        self.send(&request);
        let (head, _) = self.reply();
        assert_eq!(head[8], 1, "the server has no {name}");
        head[9]
    }

    /// Returns the request that sends an event to the window. `kind` is the event's number: 2 if a key is
    /// pressed, 3 if it is released, 4 if a button is pressed, and 5 if it is released. `key` is the key or
    /// the button.
    fn event(&self, kind: u8, key: u8) -> Vec<u8> {
        let mut request = vec![25, 0, 11, 0];
        request.extend(self.window.to_le_bytes());
        request.extend([1 << (kind - 2), 0, 0, 0]);
        request.extend([kind, key, 0, 0, 0, 0, 0, 0]);
        request.extend([self.root, self.window, 0].map(u32::to_le_bytes).as_flattened());
        request.extend([0; 10]);
        request.extend([1, 0]);
        request
    }

    /// Waits until the server has processed all requests, since it discards the requests of a user that has
    /// disconnected. When all requests have been processed, the window may no longer exist.
    fn until_done(&mut self) {
        self.send(&[43, 0, 1, 0]);
        while read(&mut self.stream, 32)[0] != 1 {}
    }

    /// Moves the pointer to a pixel of the window.
    pub fn point(&mut self, [x, y]: [u16; 2]) {
        let mut request = vec![41, 0, 6, 0, 0, 0, 0, 0];
        request.extend(self.window.to_le_bytes());
        request.extend([0; 8]);
        request.extend([x, y].map(u16::to_le_bytes).as_flattened());
        self.send(&request);
    }

    /// Gives the window another size.
    pub fn resize(&mut self, size: [u32; 2]) {
        let mut request = vec![12, 0, 5, 0];
        request.extend(self.window.to_le_bytes());
        request.extend([0b1100, 0, 0, 0]);
        request.extend(size.map(u32::to_le_bytes).as_flattened());
        self.send(&request);
        self.until_done();
    }

    /// Shows the window, or hides it. An X server forgets the picture in a window that is hidden.
    pub fn show(&mut self, is_shown: bool) {
        let mut request = vec![if is_shown { 8 } else { 10 }, 0, 2, 0];
        request.extend(self.window.to_le_bytes());
        self.send(&request);
        self.until_done();
    }

    /// Returns the window's title.
    pub fn title(&mut self) -> String {
        let mut request = vec![20, 0, 6, 0];
        request.extend(self.window.to_le_bytes());
        request.extend([39, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 4, 0, 0]);
        self.send(&request);
        let (head, rest) = self.reply();
        String::from_utf8_lossy(&rest[..word(&head, 16) as usize]).into_owned()
    }

    fn find_window(&mut self) -> u32 {
        let mut request = vec![15, 0, 2, 0];
        request.extend(self.root.to_le_bytes());
        self.send(&request);
        let (head, rest) = self.reply();
        if half(&head, 16) == 0 { 0 } else { word(&rest, 0) }
    }

    fn keycode(&mut self, symbol: u32) -> u8 {
        let [first, last] = self.keycodes;
        self.send(&[101, 0, 2, 0, first, last - first + 1, 0, 0]);
        let (head, rest) = self.reply();
        let per_code = usize::from(head[1]);
        let position = (0..rest.len() / 4).position(|index| word(&rest, 4 * index) == symbol);
        first + (position.unwrap_or_else(|| panic!("no key {symbol:x}")) / per_code) as u8
    }

    fn send(&mut self, request: &[u8]) {
        self.stream.write_all(request).expect("a request");
    }

    /// Returns the next reply, after skipping events and errors.
    fn reply(&mut self) -> (Vec<u8>, Vec<u8>) {
        loop {
            let head = read(&mut self.stream, 32);
            assert_ne!(head[0], 0, "an error of the server: {head:?}");
            if head[0] == 1 {
                let rest = read(&mut self.stream, 4 * word(&head, 4) as usize);
                return (head, rest);
            }
        }
    }
}

fn read(stream: &mut UnixStream, count: usize) -> Vec<u8> {
    let mut bytes = vec![0; count];
    stream.read_exact(&mut bytes).expect("a reply");
    bytes
}

fn half(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|i| bytes[at + i]))
}
