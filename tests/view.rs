//! `raycl view`: the contents of its window, read from an X server without a screen, and its pictures in a
//! terminal.

use crate::binary::{NO_SETTINGS, TRIANGLE, WorkFolder, device, finish, has, program, until};
use crate::x_server::Server;
use image::RgbImage;
use serde_json::Value;
use std::io::Read as _;
use std::process::{Child, Command, Output, Stdio};
use std::sync::Mutex;

const SIZE: [u32; 2] = [96, 60];
/// X11's codes (keysyms) of the keys that the tests press.
const RIGHT: u32 = 0xff53;
const LETTER: fn(char) -> u32 = |letter| letter as u32;

fn new_folder() -> WorkFolder {
    WorkFolder::with(&[("scene.toml", TRIANGLE)])
}

/// Returns the command that views `scene.toml` on the test device.
fn view(folder: &WorkFolder, options: &[&str]) -> std::process::Command {
    view_of("scene.toml", folder, options)
}

/// Returns the command that views a scene on the test device.
fn view_of(scene: &str, folder: &WorkFolder, options: &[&str]) -> std::process::Command {
    let mut command = program();
    command.current_dir(folder.path(".")).args(["view", scene, "--device", &device()]).args(options);
    command.env_remove("DISPLAY").stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn start(folder: &WorkFolder, server: &Server, options: &[&str]) -> Child {
    let [width, height] = SIZE.map(|side| side.to_string());
    let all = [&["--width", &width, "--height", &height], options].concat();
    view(folder, &all).env("DISPLAY", server.display()).spawn().expect("it starts")
}

/// Returns the picture that `render` writes for the same scene.
fn rendered(folder: &WorkFolder, options: &[&str]) -> RgbImage {
    rendered_in(folder, SIZE, options)
}

fn rendered_in(folder: &WorkFolder, size: [u32; 2], options: &[&str]) -> RgbImage {
    let [width, height] = size.map(|side| side.to_string());
    let device = device();
    let all = ["render", "scene.toml", "-o", "still.png", "--force", "--device", &device];
    folder.output(&[&all[..], &["--width", &width, "--height", &height], options].concat());
    image::open(folder.path("still.png")).expect("a picture").to_rgb8()
}

fn differences(a: &RgbImage, b: &RgbImage) -> u8 {
    a.iter().zip(b.iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0)
}

/// Ends the view by pressing `q`, and returns its report.
fn quit(child: Child, server: &Server) -> Value {
    server.user().press(LETTER('q'));
    let output = finish(child);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn without_a_display_it_is_a_mistake_with_a_remedy() {
    let folder = new_folder();
    for (display, reason) in [("", "DISPLAY is not set"), (":4099", "the window cannot be opened")] {
        let child = view(&folder, &["--frames", "1"]).env("DISPLAY", display).spawn().expect("it starts");
        let output = finish(child);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        has(&String::from_utf8_lossy(&output.stderr), &[reason, "--terminal", "`raycl render`"]);
    }
}

#[test]
fn the_window_shows_what_render_writes() {
    let folder = new_folder();
    for samples in ["1", "5"] {
        let expected = rendered(&folder, &["--samples", samples]);
        let server = Server::start(SIZE);
        let child = start(&folder, &server, &["--samples", samples, "--json"]);
        // `view` and `render` may round sums of several samples differently.
        let most = if samples == "1" { 0 } else { 1 };
        server.until_shown("it shows the picture", |shown| differences(shown, &expected) <= most);
        let report = quit(child, &server);
        assert_eq!(report["frames"].to_string(), samples, "{report}");
        assert_eq!(report["image_size"], serde_json::json!(SIZE));
        assert!(report["rays_per_s"].as_f64().expect("a number") > 0.0, "{report}");
    }
}

#[test]
fn keys_orbit_switch_and_go_back() {
    let folder = new_folder();
    let server = Server::start(SIZE);
    let child = start(&folder, &server, &["--samples", "1", "--strategy", "naive", "--json"]);
    let own = rendered(&folder, &["--strategy", "naive"]);
    let is_own = |shown: &RgbImage| differences(shown, &own) == 0;
    server.until_shown("it shows the picture", is_own);
    let mut user = server.user();
    user.press(RIGHT);
    server.until_shown("the scene has turned", |shown| !is_own(shown));
    user.press(LETTER('r'));
    server.until_shown("the scene's own camera is back", is_own);
    let user = Mutex::new(user);
    let title = || user.lock().expect("no panic").title();
    until("the title names the strategy", || title().contains("| naive |"));
    user.lock().expect("no panic").press(LETTER('s'));
    until("another strategy is cast with", || !title().contains("| naive |") && title().contains("rays/s"));
    user.lock().expect("no panic").press(LETTER('t'));
    until("the heat map is shown", || title().contains("at most 2 tests per pixel"));
    server.until_shown("it has other colours", |shown| differences(shown, &own) > 30);
    user.lock().expect("no panic").press(LETTER('t'));
    server.until_shown("the picture is back", |shown| differences(shown, &own) <= 1);
    quit(child, &server);
}

#[test]
fn the_picture_gets_the_size_of_the_window() {
    let folder = new_folder();
    let server = Server::start([160, 100]);
    let child = start(&folder, &server, &["--samples", "1", "--json"]);
    // The window opens in the middle of the screen, and its upper left corner stays where it is.
    let corner = [(160 - SIZE[0]) / 2, (100 - SIZE[1]) / 2];
    let shows = |size: [u32; 2]| {
        let expected = rendered_in(&folder, size, &[]);
        server.until_shown("it shows the whole picture", |shown| {
            let window = image::imageops::crop_imm(shown, corner[0], corner[1], size[0], size[1]).to_image();
            differences(&window, &expected) == 0
        });
    };
    shows(SIZE);
    let most_page_bytes = 1 << 16;
    let shares = |[width, height]: [u32; 2]| {
        let least = 4 * u64::from(width) * u64::from(height);
        let shared = server.shared_bytes();
        assert!(
            matches!(shared[..], [bytes] if (least..least + most_page_bytes).contains(&bytes)),
            "{shared:?}"
        );
    };
    shares(SIZE);
    // If the window has one of the following sizes, the picture's horizontal field of view stays the same, as
    // in the pictures that `render` writes.
    for size in [[120, 80], [60, 40]] {
        server.user().resize(size);
        shows(size);
    }
    shares([60, 40]);
    let report = quit(child, &server);
    assert_eq!(report["image_size"], serde_json::json!([60, 40]));
}

/// Checks that a view shows its picture on `display`, a display of `server`, without shared memory.
fn is_sent_the_pictures(server: &Server, display: &str) {
    let folder = new_folder();
    let expected = rendered(&folder, &[]);
    let [width, height] = SIZE.map(|side| side.to_string());
    let mut command = view(&folder, &["--samples", "1", "--json", "--width", &width, "--height", &height]);
    let child = command.env("DISPLAY", display).spawn().expect("it starts");
    server.until_shown("it shows the picture", |shown| differences(shown, &expected) == 0);
    assert!(server.shared_bytes().is_empty());
    quit(child, server);
}

#[test]
fn a_server_that_shares_no_memory_is_sent_the_pictures() {
    let server = Server::without_shared_memory(SIZE);
    is_sent_the_pictures(&server, &server.display());
}

#[test]
fn a_display_that_passes_no_files_is_sent_the_pictures() {
    let server = Server::start(SIZE);
    is_sent_the_pictures(&server, &server.forwarded().display());
}

/// All samples are cast before the window is hidden, so only the lost picture is a reason to show the picture again.
#[test]
fn a_window_that_was_hidden_shows_its_picture_again() {
    let folder = new_folder();
    let own = rendered(&folder, &[]);
    let is_own = |shown: &RgbImage| differences(shown, &own) == 0;
    let server = Server::start(SIZE);
    let child = start(&folder, &server, &["--samples", "1", "--json"]);
    server.until_shown("it shows the picture", is_own);
    let mut user = server.user();
    user.show(false);
    server.until_shown("the window is hidden", |shown| !is_own(shown));
    user.show(true);
    server.until_shown("it shows the picture again", is_own);
    let report = quit(child, &server);
    assert_eq!(report["frames"], 1, "nothing is cast again: {report}");
}

#[test]
fn a_display_whose_colours_do_not_have_24_bits_is_a_mistake_with_a_remedy() {
    let folder = new_folder();
    for bits in [8, 16, 30] {
        let server = Server::with_depth([160, 100], bits);
        let output = finish(start(&folder, &server, &["--frames", "1"]));
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        let reason = format!("the display {} has {bits}-bit colours", server.display());
        has(&String::from_utf8_lossy(&output.stderr), &[&reason, "--terminal", "24-bit colours"]);
    }
}

#[test]
fn a_window_that_x11_cannot_have_is_a_mistake_with_a_remedy() {
    let folder = new_folder();
    let server = Server::start([160, 100]);
    for size in [["65536", "1"], ["1", "65536"]] {
        let options = ["--width", size[0], "--height", size[1], "--frames", "1"];
        let child = view(&folder, &options).env("DISPLAY", server.display()).spawn().expect("it starts");
        let output = finish(child);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        has(&String::from_utf8_lossy(&output.stderr), &["is 65536", "32767 pixels", "--terminal"]);
    }
}

/// Returns the first column and the last column in which a picture differs from its first pixel.
fn columns(picture: &RgbImage) -> Option<[u32; 2]> {
    let differs = |x: &u32| (0..picture.height()).any(|y| picture[(*x, y)] != picture[(0, 0)]);
    Some([(0..picture.width()).find(differs)?, (0..picture.width()).rev().find(differs)?])
}

#[test]
fn the_right_button_drags_the_scene_along_and_the_left_button_turns_it() {
    let small = "vertices = [[0, 0.5, -2], [-0.5, -0.5, -2], [0.5, -0.5, -2]]";
    let scene = TRIANGLE.replace("vertices = [[0, 1, -2], [-1.9, -1, -2], [1.6, -0.5, -2]]", small);
    let folder = WorkFolder::with(&[("scene.toml", &scene)]);
    let own = rendered(&folder, &[]);
    let [left, right] = columns(&own).expect("a triangle");
    let is_as_wide = |[first, last]: [u32; 2]| (last - first).abs_diff(right - left) <= 1;
    let is_moved = |at: [u32; 2]| at[0] >= left + 8 && is_as_wide(at);
    let is_turned = |[first, last]: [u32; 2]| last - first + 4 <= right - left;
    for (button, is_dragged) in [(3, &is_moved as &dyn Fn([u32; 2]) -> bool), (1, &is_turned)] {
        let server = Server::start(SIZE);
        let child = start(&folder, &server, &["--samples", "1", "--json"]);
        server.until_shown("it shows the picture", |shown| differences(shown, &own) == 0);
        let mut user = server.user();
        user.point([40, 30]);
        user.button(button, true);
        let mut x = 40;
        until("the scene follows the pointer", || {
            x = (x + 1).min(64);
            user.point([x, 30]);
            columns(&server.picture()).is_some_and(is_dragged)
        });
        user.button(button, false);
        quit(child, &server);
    }
}

/// The button is pressed and released before raycl looks for input again. A drag by 20 pixels moves the triangle by 20.
#[test]
fn a_drag_that_is_shorter_than_a_frame_counts_in_full() {
    let small = "vertices = [[0, 0.5, -2], [-0.5, -0.5, -2], [0.5, -0.5, -2]]";
    let scene = TRIANGLE.replace("vertices = [[0, 1, -2], [-1.9, -1, -2], [1.6, -0.5, -2]]", small);
    let folder = WorkFolder::with(&[("scene.toml", &scene)]);
    let own = rendered(&folder, &[]);
    let [left, right] = columns(&own).expect("a triangle");
    let server = Server::start(SIZE);
    let child = start(&folder, &server, &["--samples", "1", "--json"]);
    server.until_shown("it shows the picture", |shown| differences(shown, &own) == 0);
    let mut user = server.user();
    for (shift, x) in [(20, 60), (0, 40)] {
        user.drag(3, [[100 - x, 30], [x, 30]]);
        server.until_shown("the triangle is where it was dragged", |shown| {
            columns(shown).is_some_and(|[first, last]| {
                first.abs_diff(left + shift) <= 1 && last.abs_diff(right + shift) <= 1
            })
        });
    }
    user.drag(1, [[40, 30], [64, 30]]);
    server.until_shown("the triangle is turned", |shown| {
        columns(shown).is_some_and(|[first, last]| last - first + 4 <= right - left)
    });
    quit(child, &server);
}

#[test]
fn the_pointer_finds_the_triangle() {
    let folder = new_folder();
    let server = Server::start(SIZE);
    let child = start(&folder, &server, &["--samples", "1", "--json"]);
    let user = Mutex::new(server.user());
    let title = || user.lock().expect("no panic").title();
    user.lock().expect("no panic").point([48, 30]);
    until("the title names the triangle", || {
        title().contains("triangle 0, object 0, material 0, normal (0.00, ")
    });
    user.lock().expect("no panic").point([1, 1]);
    until("the title names no triangle where there is none", || !title().contains("triangle 0"));
    quit(child, &server);
}

#[test]
fn it_spins_and_reads_a_changed_scene_again() {
    let folder = new_folder();
    let server = Server::start(SIZE);
    let child = start(&folder, &server, &["--samples", "1", "--json"]);
    let before = rendered(&folder, &[]);
    server.until_shown("it shows the picture", |shown| differences(shown, &before) == 0);
    folder.write("scene.toml", &TRIANGLE.replace("power = 10", "power = 3"));
    let after = rendered(&folder, &[]);
    assert!(differences(&before, &after) > 20);
    server.until_shown("it shows the changed scene", |shown| differences(shown, &after) == 0);
    folder.write("scene.toml", "power = \"none\"\n");
    let user = Mutex::new(server.user());
    until("the title describes the mistake", || user.lock().expect("no panic").title().contains("power"));
    assert_eq!(differences(&server.picture(), &after), 0, "the last good picture stays");
    user.lock().expect("no panic").press(LETTER(' '));
    server.until_shown("it spins", |shown| differences(shown, &after) > 20);
    let report = quit(child, &server);
    assert!(report["frames"].as_u64().expect("a number") > 2, "{report}");
}

#[test]
fn a_pipe_gets_half_blocks() {
    let folder = new_folder();
    let output =
        finish(view(&folder, &["--terminal", "--frames", "1", "--samples", "1"]).spawn().expect("it starts"));
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines: Vec<&str> = text.lines().filter(|line| line.contains('▀')).collect();
    assert_eq!(lines.len(), 23, "{text}");
    for line in lines {
        assert_eq!(line.matches('▀').count(), 80, "{line}");
        assert!(line.starts_with("\x1b[38;2;") && line.ends_with("\x1b[0m"), "{line}");
    }
    // The report is not on standard output, which contains the picture, but on standard error.
    assert!(!text.contains("speed"), "{text}");
    has(&String::from_utf8_lossy(&output.stderr), &["scene     little: 1 triangle\n", "\nspeed     "]);
}

#[test]
fn a_full_disk_is_named_instead_of_the_terminal() {
    let folder = new_folder();
    let full = std::fs::File::options().write(true).open("/dev/full").expect("a device");
    let mut command = view(&folder, &["--terminal", "--frames", "1"]);
    let output = finish(command.stdout(full).spawn().expect("it starts"));
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    has(&String::from_utf8_lossy(&output.stderr), &["cannot write to standard output", "free up space"]);
}

/// Returns the output of `raycl view --terminal=FORM` for one frame, without the report.
fn frame(folder: &WorkFolder, form: &str) -> Vec<u8> {
    let terminal = format!("--terminal={form}");
    one_frame(view(folder, &[&terminal, "--quiet"])).stdout
}

/// Runs a command that shows one frame, and returns its output.
fn one_frame(mut command: Command) -> Output {
    let output = finish(command.args(["--frames", "1", "--samples", "1"]).spawn().expect("it starts"));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

#[test]
fn json_is_not_mixed_with_pictures_in_a_pipe() {
    let folder = new_folder();
    let output = one_frame(view(&folder, &["--terminal=sixel", "--json"]));
    assert!(output.stdout == frame(&folder, "sixel"), "other bytes than with --quiet");
    let report: Value = serde_json::from_slice(&output.stderr).expect("JSON");
    assert_eq!(report["frames"], 1);
    assert!(report["frames_per_s"].is_null(), "a single frame has no rate: {report}");
}

#[test]
fn notes_about_the_scene_are_in_the_report() {
    let mesh = "mtllib no.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let folder = WorkFolder::with(&[("mesh.obj", mesh)]);
    let output = one_frame(view_of("mesh.obj", &folder, &["--plain", "--terminal=blocks", "--json"]));
    let report: Value = serde_json::from_slice(&output.stderr).expect("JSON");
    has(&report["notes"].to_string(), &["no.mtl"]);
}

#[test]
fn a_scene_from_standard_input_is_shown() {
    let folder = new_folder();
    let scene = std::fs::File::open(folder.path("scene.toml")).expect("a file");
    let mut command = view_of("-", &folder, &["--terminal=kitty", "--quiet"]);
    command.stdin(scene);
    assert!(one_frame(command).stdout == frame(&folder, "kitty"), "another picture than that of the file");
}

#[test]
fn a_pipe_gets_pixels_in_the_form_that_the_option_names() {
    let folder = new_folder();
    // The picture covers 80 x 23 characters, of 8 x 16 pixels each.
    let expected = rendered_in(&folder, [640, 368], &[]);
    let text = String::from_utf8(frame(&folder, "kitty")).expect("UTF-8");
    let data: String = text
        .split_terminator("\x1b\\")
        .filter_map(|command| command.strip_prefix("\x1b_G")?.split_once(';'))
        .map(|(_, data)| data)
        .collect();
    let deflated = base64::Engine::decode(&base64::engine::general_purpose::STANDARD, data).expect("base64");
    let mut bytes = Vec::new();
    flate2::read::ZlibDecoder::new(&deflated[..]).read_to_end(&mut bytes).expect("zlib");
    let shown = RgbImage::from_raw(640, 368, bytes).expect("a picture of this size");
    assert_eq!(differences(&shown, &expected), 0);
    let sixels = icy_sixel::SixelImage::decode(&frame(&folder, "sixel")).expect("sixels");
    assert_eq!(sixels.width, 640);
    let off: u64 = sixels
        .pixels
        .chunks_exact(4)
        .zip(expected.pixels())
        .flat_map(|(rgba, pixel)| [0, 1, 2].map(|channel| u64::from(rgba[channel].abs_diff(pixel[channel]))))
        .sum();
    // A picture in sixels has only 256 colours; the error of a pixel's colour is distributed over the neighbouring
    // pixels.
    assert!(off < 6 * 3 * 640 * 368, "{off}");
}

/// A terminal of tmux in which a command runs. The terminal ends when the value is dropped.
pub struct Tmux(String);

impl Tmux {
    pub fn start(folder: &WorkFolder, command: &str) -> Self {
        let tmux = Self(folder.path("tmux").display().to_string());
        let size = ["new-session", "-d", "-x", "80", "-y", "24"];
        tmux.run(&[&["-f", "/dev/null"], &size[..], &[command]].concat());
        tmux
    }

    fn run(&self, arguments: &[&str]) -> String {
        let mut tmux = Command::new("tmux");
        let output = crate::binary::run(
            tmux.env("XDG_CONFIG_HOME", NO_SETTINGS).args(["-u", "-S", &self.0]).args(arguments),
        );
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Returns the text in the terminal, with colours.
    fn text(&self) -> String {
        self.run(&["capture-pane", "-p", "-e"])
    }

    /// Returns the colours of the upper and lower halves of the half blocks; `None` if any other character is shown.
    fn picture(&self) -> Option<RgbImage> {
        self.picture_of([80, 46])
    }

    /// Returns the picture if it has this size. A picture of this size fills all lines of the terminal except the last
    /// one.
    fn picture_of(&self, [width, height]: [u32; 2]) -> Option<RgbImage> {
        let mut picture = RgbImage::new(width, height);
        let mut colours = [image::Rgb([0; 3]); 2];
        for (row, line) in (0..height / 2).zip(self.text().lines()) {
            let mut column = 0;
            for part in line.split('\x1b') {
                // Each line of the terminal begins with the colours at the end of the previous line.
                let code = part.strip_prefix('[').and_then(|part| part.split_once('m'));
                let (codes, shown) = code.unwrap_or(("", part));
                let codes: Vec<u8> = codes.split(';').filter_map(|code| code.parse().ok()).collect();
                for rgb in codes.windows(5).filter(|rgb| rgb[1] == 2 && [38, 48].contains(&rgb[0])) {
                    colours[usize::from(rgb[0] == 48)] = image::Rgb([rgb[2], rgb[3], rgb[4]]);
                }
                for _ in shown.chars().filter(|shown| *shown == '▀') {
                    (column < width).then_some(())?;
                    picture.put_pixel(column, 2 * row, colours[0]);
                    picture.put_pixel(column, 2 * row + 1, colours[1]);
                    column += 1;
                }
            }
            (column == width).then_some(())?;
        }
        Some(picture)
    }
}

impl Drop for Tmux {
    fn drop(&mut self) {
        self.run(&["kill-server"]);
    }
}

#[test]
fn a_terminal_shows_the_picture_and_takes_keys() {
    let folder = new_folder();
    let device = device();
    let expected = rendered_in(&folder, [80, 46], &[]);
    let scene = folder.path("scene.toml").display().to_string();
    let program = env!("CARGO_BIN_EXE_raycl");
    let report = folder.path("report.txt").display().to_string();
    let command =
        format!("'{program}' view '{scene}' --terminal --samples 1 --device '{device}' 2>'{report}'");
    let tmux = Tmux::start(&folder, &command);
    let is_own = || tmux.picture().is_some_and(|shown| differences(&shown, &expected) == 0);
    until("the terminal shows the picture", is_own);
    until("the last line tells the speed", || tmux.text().contains("rays/s"));
    tmux.run(&["send-keys", "Right"]);
    until("the scene has turned", || tmux.picture().is_some_and(|shown| differences(&shown, &expected) > 0));
    tmux.run(&["send-keys", "r"]);
    until("the scene's own camera is back", is_own);
    tmux.run(&["send-keys", "q"]);
    until("it has ended", || tmux.text().is_empty());
    assert_eq!(folder.text("report.txt"), "");
}

#[test]
fn a_line_of_wide_characters_does_not_scroll_the_picture() {
    let name = "\u{8336}\u{58f6}".repeat(30);
    let folder = WorkFolder::with(&[("scene.toml", &TRIANGLE.replace("little", &name))]);
    let (device, scene) = (device(), folder.path("scene.toml").display().to_string());
    let expected = rendered_in(&folder, [80, 46], &[]);
    let program = env!("CARGO_BIN_EXE_raycl");
    let command = format!("'{program}' view '{scene}' --terminal --samples 1 --device '{device}'");
    let tmux = Tmux::start(&folder, &command);
    let names_scene = || tmux.text().lines().nth(23).is_some_and(|line| line.contains("\u{8336}"));
    until("the last line names the scene", names_scene);
    assert!(tmux.picture().is_some_and(|shown| differences(&shown, &expected) == 0), "{}", tmux.text());
    tmux.run(&["send-keys", "q"]);
    until("it has ended", || tmux.text().is_empty());
}

#[test]
fn the_picture_gets_the_size_of_a_terminal_that_becomes_smaller_or_larger() {
    let folder = new_folder();
    let (device, scene) = (device(), folder.path("scene.toml").display().to_string());
    let whole = rendered_in(&folder, [80, 46], &[]);
    let program = env!("CARGO_BIN_EXE_raycl");
    let command = format!("'{program}' view '{scene}' --terminal --samples 1 --device '{device}'");
    let tmux = Tmux::start(&folder, &command);
    let shows = |size, expected: &RgbImage| {
        tmux.picture_of(size).is_some_and(|shown| differences(&shown, expected) == 0)
    };
    until("the terminal shows the picture", || shows([80, 46], &whole));
    for [across, down] in [[60, 20], [100, 30]] {
        tmux.run(&["resize-window", "-x", &across.to_string(), "-y", &down.to_string()]);
        let size = [across, 2 * (down - 1)];
        let resized = rendered_in(&folder, size, &[]);
        until("the whole picture is shown", || shows(size, &resized));
        until("the new last line is text", || {
            let last = tmux.text().lines().nth(down as usize - 1).map(str::to_owned);
            last.is_some_and(|line| line.contains("little | ") && !line.contains('▀'))
        });
    }
    tmux.run(&["send-keys", "q"]);
    until("it has ended", || tmux.text().is_empty());
}

#[test]
fn a_view_ends_when_nobody_reads_its_pipe() {
    let folder = new_folder();
    let mut child = view(&folder, &["--terminal", "--spin", "--json"]).spawn().expect("it starts");
    let mut pipe = child.stdout.take().expect("a pipe");
    pipe.read_exact(&mut [0; 100]).expect("a picture");
    drop(pipe);
    let output = finish(child);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stderr).expect("JSON");
    assert!(report["frames"].as_u64().is_some_and(|frames| frames > 0), "{report}");
}

/// Returns the memory in kB that is in use by a process whose arguments contain this text: the largest such
/// number if there are several processes, and 0 if there is none.
#[cfg(target_os = "linux")]
fn resident_kb(argument: &str) -> u64 {
    let processes = std::fs::read_dir("/proc").expect("processes").flatten();
    let of_process = |folder: std::path::PathBuf| {
        let arguments = std::fs::read(folder.join("cmdline")).ok()?;
        String::from_utf8_lossy(&arguments).contains(argument).then_some(())?;
        let status = std::fs::read_to_string(folder.join("status")).ok()?;
        let used = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
        used.split_whitespace().next()?.parse().ok()
    };
    processes.filter_map(|process| of_process(process.path())).max().unwrap_or(0)
}

#[cfg(target_os = "linux")]
#[test]
fn ctrl_c_ends_the_view_in_a_terminal_while_the_scene_is_loaded() {
    let large = "[[object]]\nshape = \"terrain\"\ntriangles = 4_000_000\n";
    let folder = WorkFolder::with(&[("scene.toml", large)]);
    let (device, scene) = (device(), folder.path("scene.toml").display().to_string());
    let (program, code) = (env!("CARGO_BIN_EXE_raycl"), folder.path("code.txt").display().to_string());
    let command =
        format!("'{program}' view '{scene}' --terminal --device '{device}' --quiet; echo $? >'{code}'");
    let tmux = Tmux::start(&folder, &command);
    // raycl uses more than 100,000 kB of memory only once it has begun to make the terrain.
    until("it makes the terrain", || resident_kb(&scene) > 100_000);
    tmux.run(&["send-keys", "C-c"]);
    until("it has ended", || tmux.text().is_empty());
    // Ctrl-C also ends the shell. If the shell had gone on, it would have written raycl's exit code to a
    // file.
    assert!(!std::path::Path::new(&code).exists(), "{:?}", std::fs::read_to_string(&code));
}

#[test]
fn ctrl_c_ends_the_view_in_a_terminal() {
    let folder = new_folder();
    let (device, scene) = (device(), folder.path("scene.toml").display().to_string());
    let (program, code) = (env!("CARGO_BIN_EXE_raycl"), folder.path("code.txt").display().to_string());
    let command =
        format!("'{program}' view '{scene}' --terminal --device '{device}' --quiet; echo $? >'{code}'");
    let tmux = Tmux::start(&folder, &command);
    until("the last line tells the speed", || tmux.text().contains("rays/s"));
    tmux.run(&["send-keys", "C-c"]);
    until("it has ended", || std::fs::read_to_string(&code).is_ok_and(|code| code == "0\n"));
}

#[cfg(target_os = "linux")]
#[test]
fn a_terminal_is_usable_after_a_view_that_a_signal_ended() {
    use rustix::process::{Pid, Signal, kill_process};
    // The test sends SIGABRT, as if a driver had crashed, to the child process that uses the driver. All
    // signals except SIGABRT are sent to the process that the user started.
    let signals = [
        (Signal::TERM, "143", "SIGTERM"),
        (Signal::HUP, "129", "SIGHUP"),
        (Signal::QUIT, "131", "SIGQUIT"),
        // raycl prints no message about SIGINT, so the test does not wait for the name of this signal.
        (Signal::INT, "130", ""),
        (Signal::ABORT, "1", "SIGABRT"),
    ];
    for (signal, code, name) in signals {
        let folder = new_folder();
        let path = |name: &str| folder.path(name).display().to_string();
        let (device, scene, program) = (device(), path("scene.toml"), env!("CARGO_BIN_EXE_raycl"));
        let (process, mode, ended) = (path("process"), path("mode"), path("code"));
        // With `ulimit -c 0`, the crash writes no file with the memory of the process. `cat` keeps the
        // terminal open.
        let begin = "ulimit -c 0; echo $$ >\"$0\"; exec \"$@\"";
        let command = format!(
            "sh -c '{begin}' '{process}' '{program}' view '{scene}' --terminal --spin --device '{device}'; \
             echo $? >'{ended}'; stty -a >'{mode}'; cat"
        );
        let tmux = Tmux::start(&folder, &command);
        let state =
            || tmux.run(&["display-message", "-p", "#{alternate_on} #{mouse_any_flag} #{cursor_flag}"]);
        until("the last line tells the speed", || tmux.text().contains("rays/s"));
        assert_eq!(state(), "1 1 0\n");
        let first: u32 = folder.text("process").trim().parse().expect("the number of a process");
        let to = if signal == Signal::ABORT { crate::faults::children(first)[0] } else { first };
        let to = Pid::from_raw(to as i32).expect("a process has a number");
        kill_process(to, signal).expect("it lives");
        until("it has ended", || {
            // PoCL's LLVM may catch the first SIGABRT from another process, and ignore it.
            if signal == Signal::ABORT {
                let _ = kill_process(to, signal);
            }
            std::fs::read_to_string(&mode).is_ok_and(|mode| !mode.is_empty())
        });
        assert_eq!(folder.text("code").trim(), code, "{signal:?}");
        let modes = folder.text("mode");
        for usual in ["icanon", "echo", "isig"] {
            assert!(modes.split_whitespace().any(|mode| mode == usual), "{signal:?}, not {usual}: {modes}");
        }
        until("the usual screen is shown", || state() == "0 0 1\n");
        // After raycl has written its message, it may take a moment until the terminal shows the message.
        until("raycl names the signal", || tmux.text().contains(name));
    }
}
