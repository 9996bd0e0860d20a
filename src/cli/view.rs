//! `raycl view`: shows a scene from all around, in a window or in the terminal.

use super::choice::{parse_seconds, whole};
use super::subject::Subject;
use super::watch::{Watched, folders};
use crate::error::{Error, Result};
use crate::printer;
use crate::scene::INPUTS;
use crate::view::screen::{Graphics, Screen, Terminal, Window};
use crate::view::{Live, Total, Until, Viewer, keys};
use crate::words::counted;
use serde::Serialize;
use std::io::IsTerminal as _;
use std::time::Duration;

/// The note for a view that the user cannot end by a key, and that no limit ends.
const ENDLESS: &str = "note: without a terminal, no keys are read: Ctrl-C ends the view; with --frames or --seconds, \
                       the view ends by itself";

/// Arguments of `raycl view`.
#[derive(Debug, clap::Args)]
#[command(after_help = after_help())]
pub struct Args {
    #[command(flatten)]
    pub(super) subject: Subject,
    /// Number of samples per pixel that raycl accumulates while nothing moves, 1 to 1024
    #[arg(long, default_value_t = 64, value_parser = whole::<u32>(1..=1024))]
    samples: u32,
    /// Show the scene in this terminal. The pictures have the terminal's size, so --width and --height cannot
    /// be given. HOW is the form in which raycl draws pictures. Without HOW, raycl asks the terminal which
    /// forms it supports, and uses the best of them
    #[arg(long, value_name = "HOW", num_args = 0..=1, require_equals = true, conflicts_with_all = ["width", "height"])]
    terminal: Option<Option<Graphics>>,
    /// Move the camera around the scene by one degree per frame
    #[arg(long)]
    spin: bool,
    /// End after this many frames, or earlier, as soon as each pixel has the number of samples that --samples states
    #[arg(long, value_parser = whole::<u32>(1..=u32::MAX))]
    frames: Option<u32>,
    /// End after this many seconds
    #[arg(long, value_parser = parse_seconds)]
    seconds: Option<Duration>,
    /// At the end, print one JSON object instead of text
    #[arg(long)]
    json: bool,
    /// Print nothing but errors and, with --json, the JSON object
    #[arg(short, long)]
    quiet: bool,
}

impl Args {
    /// Returns true if the pictures are shown in the terminal.
    pub(super) fn uses_terminal(&self) -> bool {
        self.terminal.is_some()
    }

    /// Returns a note if neither a key nor a limit can end the view. `reads_keys` is true if raycl reads keys.
    fn without_end(&self, reads_keys: bool) -> Option<&'static str> {
        let has_end = reads_keys || self.frames.is_some() || self.seconds.is_some();
        (!has_end && !self.quiet && !self.json).then_some(ENDLESS)
    }

    /// Returns true if raycl writes the pictures to standard output, and standard output is a pipe or a file.
    pub(super) fn streams(&self) -> bool {
        self.uses_terminal() && !std::io::stdout().is_terminal()
    }
}

fn after_help() -> String {
    let keys: Vec<String> = keys::lines().map(|line| format!("  {line}")).collect();
    format!(
        "Keys:\n{}\n\nThe left mouse button orbits, the right or the middle mouse button pans, and the wheel zooms. \
         If the window or the terminal changes its size, the pictures change their size too. \
         raycl reads the files of the scene and of --cl-dir again when they change, unless the scene comes from \
         standard input.\n\n\
         Examples:\n  \
         raycl view scenes/teapot.toml\n  raycl view bunny.obj --plain --width 1280 --height 720\n  \
         zcat part.stl.gz | raycl view - --up z\n  raycl view scenes/table.toml --spin --seconds 10 --json",
        keys.join("\n")
    )
}

/// The report at the end of the command. With `--json`, raycl prints this report as a JSON object.
#[derive(Serialize)]
struct Report {
    scene: String,
    triangles: usize,
    device: String,
    /// The device's name in the printed text.
    #[serde(skip)]
    device_name: String,
    /// The value of every axis of the strategy at the end of the view; the user can change the strategy by keys.
    strategy: String,
    /// Work-items per work-group, across and down.
    local_size: [u32; 2],
    image_size: [u32; 2],
    /// The number of frames that were shown.
    frames: u32,
    /// The time from the first frame to the last.
    seconds: f64,
    /// The number of frames after the first frame, divided by `seconds`; null if only one frame or none was
    /// shown.
    frames_per_s: Option<f64>,
    /// The number of frames that were cast since the strategy, the local size, the device, the picture's size or a file
    /// changed last.
    timed_frames: usize,
    /// The median device time of the frames that `timed_frames` counts; null if `timed_frames` is 0.
    frame_ms: Option<f64>,
    /// The number of primary and shadow rays of the frames that `timed_frames` counts, divided by the device time of
    /// these frames; null if this time is 0.
    rays_per_s: Option<f64>,
    /// Notes about the scene as it was last read and, if the system refuses to watch the scene's files, a note that
    /// says why.
    notes: Vec<String>,
}

/// Shows a scene until the user closes the view, or until `--frames` or `--seconds` ends it.
pub fn run(args: Args) -> Result<()> {
    if let Some(graphics) = args.terminal {
        let terminal = Terminal::open(graphics)?;
        args.without_end(terminal.is_interactive()).into_iter().for_each(printer::tell);
        let [width, height] = terminal.room();
        let subject = Subject { width, height, ..args.subject };
        return show(Args { subject, ..args }, terminal);
    }
    let title = format!("raycl {}", args.subject.scene.display());
    let window = Window::open(&crate::printer::line(&title), args.subject.size())?;
    show(args, window)
}

fn show(args: Args, screen: impl Screen) -> Result<()> {
    let streams = args.streams();
    let Args { subject, samples, spin, frames, seconds, json, quiet, .. } = args;
    let (mut watched, note) = watched(&subject)?;
    let has_changed = || watched.as_mut().is_some_and(Watched::has_changed);
    let mut live = Live::open(subject, samples)?;
    live.add_notes(note);
    let viewer = Viewer::new(live, screen, spin);
    let (live, total) = viewer.run(Until { frames, time: seconds }, has_changed)?;
    let ended = report(&live, total);
    super::print_report(&ended, || text(&ended), streams, (json, quiet))
}

/// The files that are watched and, if the system refuses to watch them, a note that says why.
type WatchedOrNote = (Option<Watched>, Option<String>);

/// Begins to watch the folders of a scene's file and of `--cl-dir`. Watches nothing if the scene comes from standard
/// input, since such a scene cannot be read again.
fn watched(subject: &Subject) -> Result<WatchedOrNote> {
    if subject.reads_standard_input() {
        return Ok((None, None));
    }
    or_note(Watched::new(&folders(&subject.scene, subject.cl_dir.as_deref()), &[], &INPUTS))
}

/// Turns the system's refusal to watch files into a note, since a view is of use without watched files too. A mistake
/// of the user, such as a missing folder, stays an error.
fn or_note(watched: Result<Watched>) -> Result<WatchedOrNote> {
    match watched {
        Ok(watched) => Ok((Some(watched), None)),
        Err(refused @ Error::Run { .. }) => {
            Ok((None, Some(format!("changed files are not read again: {refused}; {}", refused.remedy()))))
        }
        Err(mistake) => Err(mistake),
    }
}

fn report(live: &Live, total: Total) -> Report {
    let Total { frames, seconds, frames_per_s, timed_frames, frame_ms, rays_per_s } = total;
    Report {
        scene: live.scene().name.clone(),
        triangles: live.scene().mesh.triangles.len(),
        device: live.device().label.clone(),
        device_name: live.device_name(),
        strategy: live.strategy().to_string(),
        local_size: live.local_size(),
        image_size: live.size(),
        frames,
        seconds,
        frames_per_s,
        timed_frames,
        frame_ms,
        rays_per_s,
        notes: live.loaded().notes.clone(),
    }
}

fn text(report: &Report) -> String {
    let ([width, height], [x, y]) = (report.image_size, report.local_size);
    let mut lines = vec![
        format!("scene     {}: {}", report.scene, counted(report.triangles, "triangle")),
        format!("device    {}", report.device_name),
        format!("strategy  {}", report.strategy),
        format!("size      {width} x {height} pixels, local size {x} x {y}"),
    ];
    lines.extend(report.frame_ms.map(|ms| format!("kernel    {ms:10.2} ms{}", kernel_remark(report))));
    lines.extend(speed(report).map(|speed| format!("speed     {speed}")));
    lines.extend(report.notes.iter().map(|note| format!("note      {note}")));
    lines.join("\n")
}

/// Returns a remark that the kernel's time is the median of several frames; an empty text if only one frame
/// was timed.
fn kernel_remark(report: &Report) -> String {
    let frames = || format!(", the median of {}", counted(report.timed_frames, "frame"));
    (report.timed_frames > 1).then(frames).unwrap_or_default()
}

/// Returns a text with the frames per second and the rays per second. Leaves out a rate that the report does
/// not have. Returns `None` if the report has neither frames per second nor rays per second.
fn speed(report: &Report) -> Option<String> {
    let frames = report.frames_per_s.map(|rate| format!("{rate:.1} frames/s"));
    let rays = report.rays_per_s.map(|rate| crate::words::rate(rate, "rays"));
    let rates: Vec<String> = frames.into_iter().chain(rays).collect();
    (!rates.is_empty()).then(|| rates.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text_of(frames: u32, timed_frames: usize, notes: &[&str]) -> String {
        let is_timed = timed_frames > 0;
        text(&Report {
            scene: "little".to_owned(),
            triangles: 1,
            device: "a label".to_owned(),
            device_name: "a device".to_owned(),
            strategy: "naive".to_owned(),
            local_size: [8, 4],
            image_size: [48, 30],
            frames,
            seconds: 1.0,
            frames_per_s: (frames > 1).then_some(2.0),
            timed_frames,
            frame_ms: is_timed.then_some(1.5),
            rays_per_s: is_timed.then_some(4e6),
            notes: notes.iter().map(|&note| note.to_owned()).collect(),
        })
    }

    #[test]
    fn a_view_that_neither_a_key_nor_a_limit_can_end_has_a_note() {
        #[derive(clap::Parser)]
        struct Command {
            #[command(flatten)]
            args: Args,
        }
        let is_noted = |options: &[&str], reads_keys| {
            let words = [&["view", "a.obj", "--terminal"], options].concat();
            <Command as clap::Parser>::parse_from(words).args.without_end(reads_keys).is_some()
        };
        assert!(is_noted(&[], false) && is_noted(&["--spin"], false));
        assert!(!is_noted(&[], true));
        for options in [&["--frames", "1"][..], &["--seconds", "1"], &["--quiet"], &["--json"]] {
            assert!(!is_noted(options, false), "{options:?}");
        }
    }

    #[test]
    fn one_frame_has_neither_a_median_nor_frames_per_second() {
        let (one, three) = (text_of(1, 1, &[]), text_of(3, 3, &[]));
        assert!(one.contains(" 1.50 ms\n") && one.ends_with("speed     4.00 Mrays/s"), "{one}");
        assert!(three.contains(" 1.50 ms, the median of 3 frames\n"), "{three}");
        assert!(three.ends_with("speed     2.0 frames/s, 4.00 Mrays/s"), "{three}");
    }

    #[test]
    fn sizes_are_printed_across_before_down() {
        let printed = text_of(1, 1, &[]);
        assert!(printed.contains("\nsize      48 x 30 pixels, local size 8 x 4\n"), "{printed}");
    }

    #[test]
    fn the_median_is_printed_with_the_frames_since_the_last_switch() {
        let (two_of_nine, none_of_nine) = (text_of(9, 2, &[]), text_of(9, 0, &[]));
        assert!(two_of_nine.contains(" 1.50 ms, the median of 2 frames\n"), "{two_of_nine}");
        assert!(!none_of_nine.contains("kernel"), "{none_of_nine}");
        assert!(none_of_nine.ends_with("speed     2.0 frames/s"), "{none_of_nine}");
    }

    #[test]
    fn files_that_the_system_does_not_watch_are_a_note_and_a_missing_folder_is_a_mistake() {
        let (watched, note) = or_note(Err(Error::run("no room").with_help("make room"))).expect("a note");
        assert!(watched.is_none());
        assert_eq!(note.as_deref(), Some("changed files are not read again: no room; make room"));
        let mistake = or_note(Err(Error::input("no folder"))).err().expect("a mistake");
        assert_eq!(mistake.exit_code(), 2);
    }

    #[test]
    fn notes_about_the_scene_are_at_the_end() {
        let printed = text_of(3, 3, &["a remark", "another"]);
        assert!(printed.ends_with("rays/s\nnote      a remark\nnote      another"), "{printed}");
    }
}
