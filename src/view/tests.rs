//! Tests of the viewer, with a screen that follows a script.

use super::*;
use crate::cli::subject::Subject;
use crate::error::Error;
use clap::Parser as _;
use keys::Key;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};

#[derive(clap::Parser)]
struct Command {
    #[command(flatten)]
    subject: Subject,
}

/// Returns the triangle of scenes/triangle.toml in a picture of 40 x 20 pixels, cast by a CPU.
pub(super) fn live(options: &[&str], samples: u32) -> Live {
    live_in(["40", "20"], options, samples)
}

fn live_in(size: [&str; 2], options: &[&str], samples: u32) -> Live {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/triangle.toml");
    live_of(&scene, size, options, samples)
}

/// Returns a scene in a picture of this size, cast by a CPU, with the strategy `naive` unless the options name
/// another.
pub(super) fn live_of(scene: &Path, [width, height]: [&str; 2], options: &[&str], samples: u32) -> Live {
    let scene = scene.to_str().expect("UTF-8");
    let usual = ["view", scene, "--device", "cpu", "--width", width, "--height", height];
    let strategy: &[&str] = if options.contains(&"--strategy") { &[] } else { &["--strategy", "naive"] };
    let command = Command::parse_from([&usual[..], strategy, options].concat());
    Live::open(command.subject, samples).expect("it can be cast")
}

/// Writes scenes/triangle.toml into a folder, with the triangle's back towards the camera. Returns the file.
pub(super) fn back_face_in(folder: &Path) -> PathBuf {
    let own = include_str!("../../scenes/triangle.toml");
    let turned = own.replace("faces = [[0, 1, 2]]", "faces = [[0, 2, 1]]");
    assert_ne!(turned, own);
    let path = folder.join("scene.toml");
    std::fs::write(&path, turned).expect("a file");
    path
}

/// A screen whose user follows a script. The script stores the pictures and the lines that the screen shows.
#[derive(Default)]
struct Script {
    /// True if the screen writes text over pictures.
    writes_over: bool,
    /// The lines of text that were written over pictures.
    over: Vec<String>,
    inputs: VecDeque<Input>,
    /// The number of times that the user's input was read.
    reads: u32,
    pictures: Vec<RgbImage>,
    lines: Vec<String>,
}

impl Screen for &mut Script {
    fn show(&mut self, picture: &RgbImage) -> Result<()> {
        self.pictures.push(picture.clone());
        Ok(())
    }

    fn tell(&mut self, line: &str) -> Result<()> {
        self.lines.push(line.to_owned());
        Ok(())
    }

    fn write_over(&mut self, lines: &[String]) -> Result<bool> {
        if self.writes_over {
            self.over.extend_from_slice(lines);
        }
        Ok(self.writes_over)
    }

    fn input(&mut self) -> Result<Input> {
        self.reads += 1;
        assert!(self.reads < 1000, "the view does not end");
        Ok(self.inputs.pop_front().unwrap_or_default())
    }
}

#[test]
fn the_scene_follows_the_pointer_that_drags_it() {
    let to_the_right_and_down = Input { orbit: [0.1, 0.2], ..Input::default() };
    let Action::Orbit([right, up]) = dragged(&to_the_right_and_down) else { panic!("the eye orbits") };
    // A drag across the whole height of the picture moves the eye by three radians.
    let is_right = (right + 0.3).abs() < 1e-9 && (up - 0.6).abs() < 1e-9;
    assert!(is_right, "the eye goes {right} to the right and {up} up");
}

#[test]
fn the_users_input_moves_the_eye() {
    let mut screen = Script::default();
    let mut viewer = Viewer::new(live(&[], 1), &mut screen, false);
    let mut after = |input: Input| (viewer.obey(&input), viewer.pose);
    let (ends, pose) = after(Input { wheel: 10.0, ..Input::default() });
    assert_eq!((ends, pose), (false, Pose { distance: 0.5, ..Pose::START }));
    // The field of view is 90 degrees across, and the picture is half as high as wide. Where the pivot (the
    // point around which the eye turns) lies, the visible part of the scene is therefore as high as the
    // distance between eye and pivot. The scene moves as far as the pointer.
    let (_, pose) = after(Input { pan: [0.1, 0.2], ..Input::default() });
    let [right, up] = pose.aside;
    assert!((right + 0.1).abs() < 1e-6 && (up - 0.2).abs() < 1e-6, "{pose:?}");
    let (_, pose) = after(Input { keys: vec![Key::Char('x'), Key::Char('r')], ..Input::default() });
    assert_eq!(pose, Pose::START);
    let (_, pose) = after(Input { orbit: [-0.1, 0.0], ..Input::default() });
    assert!((pose.turn - 0.1 * DRAG).abs() < 1e-12, "{pose:?}");
    let (ends, _) = after(Input { keys: vec![Key::Left, Key::Char('q')], ..Input::default() });
    assert!(ends, "the user quits");
}

#[test]
fn a_view_ends_after_its_frames_its_time_or_when_nothing_is_left_to_cast() {
    let run = |until: Until, inputs: Vec<Input>| {
        let mut screen = Script { inputs: inputs.into(), ..Script::default() };
        let (live, total) =
            Viewer::new(live(&[], 3), &mut screen, false).run(until, || false).expect("it casts");
        assert_eq!(
            (live.progress(), screen.pictures.len()),
            ([total.frames as usize, 3], total.frames as usize)
        );
        total.frames
    };
    let frames = |frames| Until { frames: Some(frames), time: None };
    assert_eq!([run(frames(2), vec![]), run(frames(9), vec![])], [2, 3]);
    assert_eq!(run(Until { frames: None, time: Some(Duration::ZERO) }, vec![]), 1);
    assert_eq!(run(Until::default(), vec![Input { closed: true, ..Input::default() }]), 0);
    let quits = Input { keys: vec![Key::Escape], ..Input::default() };
    assert_eq!(run(Until::default(), vec![Input::default(), quits]), 1);
}

#[test]
fn the_line_beside_the_picture_tells_how_it_is_cast() {
    let mut screen = Script::default();
    let frames = Until { frames: Some(1), time: None };
    let (live, _) = Viewer::new(live(&["--local-size", "16x2"], 3), &mut screen, false)
        .run(frames, || false)
        .expect("it casts");
    let parts: Vec<&str> = screen.lines[0].split(" | ").collect();
    let [scene, strategy, local_size, rays, frames, samples, device] = parts[..] else { panic!("{parts:?}") };
    assert_eq!([scene, strategy, local_size, samples], ["triangle", "naive", "16x2", "1 of 3 samples"]);
    // Whether rates are measured already, and how large they are, depends on the machine.
    assert!(rays.ends_with("rays/s") && !rays.starts_with("0.00"), "{parts:?}");
    assert!(frames.ends_with(" frames/s"), "{parts:?}");
    assert_eq!(device, live.device().common_name());
}

#[test]
fn a_scene_that_changed_is_cast_again() {
    let mut screen = Script::default();
    let mut changes = [false, true].into_iter();
    let until = Until { frames: Some(9), time: None };
    let viewer = Viewer::new(live(&[], 2), &mut screen, false);
    let (_, total) = viewer.run(until, || changes.next().unwrap_or(false)).expect("it casts");
    // One of the two samples is cast before the scene changes, and both are cast after the change: three frames in all.
    assert_eq!(total.frames, 3);
    assert!(screen.pictures[0] == screen.pictures[1] && screen.pictures[1] != screen.pictures[2]);
}

#[test]
fn an_eye_that_spins_begins_at_the_scenes_own_camera() {
    let mut screen = Script::default();
    let mut viewer = Viewer::new(live(&[], 1), &mut screen, true);
    let mut turns = Vec::new();
    for _ in 0..3 {
        assert!(viewer.show_next().expect("it casts"));
        turns.push(viewer.pose.turn.to_degrees().round());
    }
    viewer.act(Action::Spin);
    assert!(!viewer.show_next().expect("it casts"), "nothing moves, and the only sample is cast");
    assert_eq!((turns, viewer.rate.frames()), (vec![0.0, 1.0, 2.0], 3));
    viewer.act(Action::Spin);
    assert!(viewer.show_next().expect("it casts"), "it spins again");
}

#[test]
fn the_keys_are_drawn_over_the_picture_or_listed_beside_a_small_one() {
    let mut screen = Script::default();
    let mut viewer = Viewer::new(live_in(["700", "420"], &[], 1), &mut screen, false);
    viewer.show_next().expect("it casts");
    viewer.redraw().expect("nothing to draw");
    viewer.act(Action::Help);
    viewer.redraw().expect("it draws");
    viewer.act(Action::Help);
    viewer.redraw().expect("it draws");
    assert_eq!(viewer.answer, None);
    let [plain, with_keys, again] = &screen.pictures[..] else {
        panic!("{} pictures", screen.pictures.len())
    };
    assert_eq!(with_keys.get_pixel(0, 0).0, [255; 3]);
    assert!(plain != with_keys && plain == again);

    let mut screen = Script::default();
    let mut viewer = Viewer::new(live(&[], 1), &mut screen, false);
    viewer.show_next().expect("it casts");
    viewer.act(Action::Help);
    viewer.redraw().expect("it draws");
    let answer = viewer.answer.clone().unwrap_or_default();
    assert!(answer.contains("orbit: go around the scene"), "{answer}");
    viewer.act(Action::Help);
    assert_eq!(viewer.answer, None);
}

#[test]
fn the_keys_are_written_over_a_small_picture_if_the_screen_can_do_so() {
    let mut screen = Script { writes_over: true, ..Script::default() };
    let mut viewer = Viewer::new(live(&[], 2), &mut screen, false);
    viewer.show_next().expect("it casts");
    viewer.act(Action::Help);
    viewer.redraw().expect("it draws");
    viewer.show_next().expect("it casts");
    assert_eq!(viewer.answer, None);
    viewer.act(Action::Help);
    viewer.redraw().expect("it draws");
    // The list of keys is written over each picture until the user hides the list.
    let lines: Vec<String> = keys::lines().collect();
    assert_eq!((screen.pictures.len(), screen.over), (4, [lines.clone(), lines].concat()));
}

#[test]
fn a_program_that_is_compiled_is_announced_with_its_strategy() {
    let mut screen = Script::default();
    let mut viewer = Viewer::new(live(&[], 1), &mut screen, false);
    viewer.act(Action::LocalSize(1));
    let same = title::compiling(&viewer.live.strategy());
    viewer.act(Action::Strategy(1));
    let next = title::compiling(&viewer.live.strategy());
    assert_eq!(same, "compiling naive ...");
    assert_ne!(same, next);
    assert_eq!(screen.lines, [same, next]);
}

#[test]
fn another_device_is_announced_before_raycl_looks_for_it() {
    let mut screen = Script::default();
    let mut viewer = Viewer::new(live(&[], 1), &mut screen, false);
    viewer.act(Action::Device);
    assert_eq!(screen.lines, [title::OPENING]);
}

#[test]
fn keys_that_waited_for_a_compiler_compile_nothing_between_the_first_strategy_and_the_last() {
    let mut screen = Script::default();
    let mut viewer = Viewer::new(live(&[], 1), &mut screen, false);
    let last = viewer.live.strategy_after(3);
    let input = |letters: &str| Input { keys: letters.chars().map(Key::Char).collect(), ..Input::default() };
    assert!(!viewer.obey(&input("sssSs")));
    assert!(viewer.obey(&input("sq")), "the user quits");
    assert_eq!(viewer.live.strategy(), last);
    assert_eq!(screen.lines, [title::compiling(&last)]);
}

#[test]
fn what_a_cleared_screen_showed_is_shown_again() {
    let mut screen = Script::default();
    screen.inputs.extend([Input::default(), Input { redraws: true, ..Input::default() }]);
    let quits = Input { keys: vec![Key::Escape], ..Input::default() };
    screen.inputs.push_back(quits);
    Viewer::new(live(&[], 1), &mut screen, false).run(Until::default(), || false).expect("it casts");
    // The only sample is cast before the screen is cleared.
    assert_eq!((screen.pictures.len(), screen.lines.len()), (2, 2));
    assert!(screen.pictures[0] == screen.pictures[1]);
}

#[test]
fn pictures_have_the_screens_size_if_the_device_can_cast_them() {
    let mut screen = Script::default();
    let room = |room| Input { room: Some(room), ..Input::default() };
    let quits = Input { keys: vec![Key::Escape], ..Input::default() };
    let too_large = [1 << 20, 1 << 20];
    screen.inputs.extend([[40, 20], [40, 20], [30, 36], [30, 36], too_large, too_large, [30, 36]].map(room));
    screen.inputs.push_back(quits);
    let viewer = Viewer::new(live(&[], 1), &mut screen, false);
    let (live, total) = viewer.run(Until::default(), || false).expect("it casts");
    let sizes: Vec<_> = screen.pictures.iter().map(RgbImage::dimensions).collect();
    // The picture's single sample is cast again after the size has changed, and also after a change of the
    // size has failed. At the end, the window has the picture's size again, and shows the last picture again.
    assert_eq!(
        (sizes, live.size(), total.frames),
        (vec![(40, 20), (30, 36), (30, 36), (30, 36)], [30, 36], 3)
    );
    assert!(screen.lines.iter().any(|line| line.contains("memory") || line.contains("work-items")));
}

#[test]
fn a_size_that_the_device_refused_is_tried_again_after_each_change_that_succeeds() {
    let mut screen = Script::default();
    let mut viewer = Viewer::new(live(&[], 1), &mut screen, false);
    let is_tried = |viewer: &mut Viewer<&mut Script>| {
        viewer.answer = None;
        viewer.fit(Some([1 << 20, 1 << 20]));
        viewer.answer.is_some()
    };
    assert_eq!([is_tried(&mut viewer), is_tried(&mut viewer)], [true, false]);
    viewer.tried(|_| Err(Error::input("it does not fit")));
    assert!(!is_tried(&mut viewer), "nothing has changed");
    viewer.tried(|_| Ok(()));
    assert_eq!([is_tried(&mut viewer), is_tried(&mut viewer)], [true, false]);
    assert_eq!(viewer.live.size(), [40, 20]);
}

#[test]
fn a_change_that_fails_is_shown_until_the_next_change() {
    let mut screen = Script::default();
    let mut viewer = Viewer::new(live(&[], 2), &mut screen, false);
    viewer.show_next().expect("it casts");
    viewer.stale = false;
    viewer.tried(|_| Err(Error::input("it does not fit")));
    assert_eq!((viewer.answer.as_deref(), viewer.stale), (Some("it does not fit"), true));
    assert_eq!(viewer.live.progress(), [0, 2], "the picture is cast again");
    let picked = Picked { triangle: 7, object: 1, material: 0, normal: [0.0, 1.0, 0.0] };
    let pointed = picked.text();
    (viewer.picked, viewer.note) = (Some(picked), Some("a note".to_owned()));
    viewer.tell().expect("it tells");
    viewer.tried(|_| Ok(()));
    assert_eq!((&viewer.answer, &viewer.note), (&None, &None));
    // The line begins with the reason why the change failed, because a terminal may cut off the end of a long line.
    let [line] = &screen.lines[..] else { panic!("{:?}", screen.lines) };
    assert!(line.starts_with(&format!("it does not fit | {pointed} | triangle | naive | ")), "{line}");
    assert!(line.contains(" samples | a note | "), "{line}");
}

#[test]
fn the_answer_to_a_key_goes_with_the_next_key() {
    let mut screen = Script::default();
    let mut viewer = Viewer::new(live(&[], 1), &mut screen, false);
    for key in [Key::Char('t'), Key::Char('t'), Key::Char('r'), Key::Char(' '), Key::Left] {
        viewer.tried(|_| Err(Error::input("it is the only usable device")));
        assert!(viewer.answer.is_some());
        viewer.obey(&Input { keys: vec![key], ..Input::default() });
        assert_eq!(viewer.answer, None, "{key:?}");
    }
}

#[test]
fn the_first_note_about_the_scene_is_shown_until_something_is_chosen_and_after_it_was_read_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("mesh.obj");
    let mesh = "usemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    std::fs::write(&path, format!("mtllib no.mtl\n{mesh}")).expect("a file");
    let mut screen = Script::default();
    let viewed = live_of(&path, ["40", "20"], &["--plain"], 1);
    let mut viewer = Viewer::new(viewed, &mut screen, false);
    let tells = |viewer: &Viewer<&mut Script>, part: &str| {
        viewer.note.as_ref().is_some_and(|note| note.contains(part))
    };
    assert!(tells(&viewer, "no.mtl"), "{:?}", viewer.note);
    // Some notes are not shown, but counted. One of them says that the material `red` is defined in no MTL file.
    let others = viewer.live.loaded().notes.len() - 1;
    assert!(others > 0 && tells(&viewer, &format!(" (and {others} more note")), "{:?}", viewer.note);
    assert!(!tells(&viewer, "usemtl"), "{:?}", viewer.note);
    viewer.tried(|_| Ok(()));
    assert_eq!(viewer.note, None);
    std::fs::write(&path, format!("mtllib other.mtl\n{mesh}")).expect("a file");
    viewer.reload();
    assert!(tells(&viewer, "other.mtl") && !tells(&viewer, "no.mtl"), "{:?}", viewer.note);
}

#[test]
fn a_mistake_in_a_scene_that_changed_is_reported_with_its_file_and_line() {
    let own = include_str!("../../scenes/triangle.toml");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, own).expect("a file");
    let mut screen = Script::default();
    let mut viewer = Viewer::new(live_of(&path, ["40", "20"], &[], 1), &mut screen, false);
    std::fs::write(&path, format!("# mine\n\npositon = 1\n{own}")).expect("a file");
    viewer.reload();
    let begin = format!("{}:3: unknown key `positon`", path.display());
    // A key that moves the eye does not remove the message about the mistake.
    viewer.obey(&Input { keys: vec![Key::Left], ..Input::default() });
    let is_shown = viewer.mistake.as_ref().is_some_and(|mistake| mistake.starts_with(&begin));
    assert!(is_shown && viewer.answer.is_none(), "{:?} {:?}", viewer.mistake, viewer.answer);
    // The message about the mistake in the file also stays when the window gets a new size.
    viewer.fit(Some([48, 24]));
    assert!(viewer.mistake.is_some() && viewer.live.size() == [48, 24]);
    viewer.tell().expect("it tells");
    std::fs::write(&path, own).expect("a file");
    viewer.reload();
    assert_eq!(viewer.mistake, None);
    assert!(screen.lines.iter().any(|line| line.starts_with(&begin)), "{:?}", screen.lines);
}

#[test]
fn a_heat_map_becomes_finer_until_the_eye_moves_and_makes_way_for_the_picture() {
    let mut screen = Script::default();
    let mut viewer = Viewer::new(live(&[], 2), &mut screen, false);
    let all = |viewer: &mut Viewer<&mut Script>| -> Vec<RgbImage> {
        std::iter::from_fn(|| viewer.next_picture().expect("it casts")).collect()
    };
    let pictures = all(&mut viewer);
    viewer.act(Action::Tests);
    let maps = all(&mut viewer);
    // Each pixel's primary ray is tested against the triangle; if the primary ray hits, the shadow ray is
    // tested too. The map therefore shows at most two ray-triangle tests for a pixel.
    assert_eq!((pictures.len(), maps.len(), viewer.most_tests), (2, 3, 2));
    assert!(maps.iter().all(|map| !pictures.contains(map)));
    viewer.tell().expect("it tells");
    viewer.act(Action::Zoom(1.0));
    let nearer = all(&mut viewer);
    assert!(nearer.len() == 3 && nearer != maps, "the map is of what the eye sees");
    viewer.tried(Live::reload);
    let of_scene = viewer.heat.as_ref().map(|heat| heat.is_of(viewer.live.scene()));
    assert_eq!((of_scene, all(&mut viewer).len()), (Some(true), 3));
    assert!(viewer.live.bytes_of_trees > 0, "the map's tree was in memory while the scene was read");
    viewer.act(Action::Reset);
    viewer.act(Action::Tests);
    assert!(all(&mut viewer) == pictures, "the picture is cast again");
    assert!(screen.lines[0].starts_with("at most 2 tests per pixel | "), "{:?}", screen.lines);
}

#[test]
fn the_triangle_at_the_pointer_is_shown_until_the_pointer_or_the_eye_leaves_it() {
    let mut screen = Script::default();
    let mut viewer = Viewer::new(live(&[], 1), &mut screen, false);
    let deadline = Instant::now() + Duration::from_secs(120);
    while viewer.picked.is_none() {
        viewer.stale = false;
        viewer.point(Some([20, 10]));
        assert!(Instant::now() < deadline, "no triangle is found");
        std::thread::sleep(REST);
    }
    assert_eq!((viewer.picked.as_ref().map(|picked| picked.triangle), viewer.stale), (Some(0), true));
    viewer.stale = false;
    viewer.point(Some([20, 10]));
    assert!(!viewer.stale, "nothing has changed");
    viewer.point(Some([0, 0]));
    assert_eq!((viewer.picked.clone(), viewer.stale), (None, true));
    viewer.point(Some([20, 10]));
    viewer.stale = false;
    viewer.point(None);
    assert_eq!((viewer.picked.clone(), viewer.stale), (None, true));
    viewer.point(Some([20, 10]));
    viewer.act(Action::Orbit([0.1, 0.0]));
    assert_eq!(viewer.picked, None);
    viewer.point(Some([20, 10]));
    assert!(viewer.picked.is_some(), "the eye sees the triangle from there too");
}

#[test]
fn rays_per_second_are_those_of_the_frames_that_the_device_cast() {
    let mut screen = Script::default();
    let mut viewer = Viewer::new(live(&[], 1), &mut screen, false);
    viewer.show_next().expect("it casts");
    let total = viewer.rate.total();
    let picture = viewer.shown.as_ref().expect("a picture");
    let hits = picture.pixels().filter(|pixel| *pixel != picture.get_pixel(0, 0)).count();
    // There is one primary ray per pixel, and one shadow ray per hit.
    let (rays_per_s, ms) = total.rays_per_s.zip(total.frame_ms).expect("a frame");
    let rays = rays_per_s * ms / 1e3;
    assert!((rays - (800 + hits) as f64).abs() < 1e-6, "{rays} {hits}");
}

#[test]
fn times_are_those_of_the_frames_since_the_last_key_that_switched_something() {
    let mut screen = Script::default();
    let mut viewer = Viewer::new(live(&[], 2), &mut screen, false);
    let mut timed_after = |key: char| {
        viewer.obey(&Input { keys: vec![Key::Char(key)], ..Input::default() });
        assert!(viewer.answer.is_none(), "{:?}", viewer.answer);
        let before = viewer.rate.total().timed_frames;
        assert!(viewer.show_next().expect("it casts"));
        (before, viewer.rate.total().timed_frames)
    };
    assert_eq!(timed_after('r'), (0, 1));
    // The key `r` brings the scene's own camera back, which changes nothing about how a frame is cast.
    assert_eq!([timed_after('r'), timed_after('w'), timed_after('s')], [(1, 2), (0, 1), (0, 1)]);
    viewer.tried(|_| Err(Error::input("it does not fit")));
    assert_eq!((viewer.rate.total().timed_frames, viewer.rate.frames()), (1, 4));
}

#[test]
fn a_rate_of_frames_that_is_0_is_measured_if_rays_are() {
    let live = live(&[], 1);
    let line = |rates| title::line(&live, rates, std::iter::empty(), None);
    assert!(line([0.0, 5e6]).contains(" | 0 frames/s | "), "{}", line([0.0, 5e6]));
    assert!(line([0.0, 0.0]).contains(" | - rays/s | - frames/s | "), "{}", line([0.0, 0.0]));
}
