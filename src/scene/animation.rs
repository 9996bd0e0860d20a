//! Animations: scenes whose values change from frame to frame, as the `[animation]` of a scene file says.

mod between;
mod notes;
mod track;
mod wire;

use super::assemble::{Assembled, Notes, assemble};
use super::document::{Document, KEYS};
use super::frame_cache::FrameCache;
use super::overrides::{self, PATHS};
use super::setting::Setting;
use super::wire::{SceneWire, Whole};
use super::{Scene, Shot};
use crate::error::{Error, Result, shortened};
use crate::toml_error::toml_error;
use crate::toml_read::from_text;
use crate::words::{counted, few};
use notes::FrameNotes;
use std::collections::BTreeSet;
use std::fmt;
use std::ops::RangeInclusive;
use std::sync::Arc;
use toml::Table;
use track::{STEPS, Track, is_within};
pub(super) use wire::AnimationWire;

/// The `[animation]` of a scene file: values that change from frame to frame. The scene of a frame is built
/// from a copy of the scene file's TOML table, in which the frame's values have been set. Each frame reuses
/// data of the previous frame: a mesh file that both frames use is read again only if a value that determines
/// the mesh has changed, such as `crease`. If the mesh does not change, the scenes of both frames share one
/// mesh.
pub struct Animation {
    /// The number of frames, which are counted from 1.
    pub frames: u32,
    /// The number of frames per second; `None` if the scene file does not set it.
    pub frames_per_second: Option<u16>,
    document: Document,
    /// The scene file's TOML table, without the key `animation`.
    table: Table,
    tracks: Vec<Track>,
    /// The tracks that are left out, because an angle of the camera replaces them: the number and the path of each.
    /// Tracks are numbered from 0, in the order of the scene file.
    left_out: Vec<(usize, String)>,
    shot: Shot,
    cache: FrameCache,
    /// The notes on the frames that were rendered.
    notes: FrameNotes,
}

impl fmt::Debug for Animation {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Animation").field("frames", &self.frames).finish_non_exhaustive()
    }
}

impl Animation {
    /// Checks the `[animation]` of a scene file, and returns the animation. If a setting sets an angle of the camera,
    /// the file's tracks that move the camera are left out. These tracks are left out only after all tracks were
    /// numbered. A path such as `animation.track.1` therefore means the same track with and without an angle.
    pub(super) fn of(document: Document, wire: AnimationWire, shot: Shot) -> Result<Self> {
        let AnimationWire { frames: Whole(frames), frames_per_second, track } = wire;
        let (left_out, kept): (Vec<_>, Vec<_>) =
            track.into_iter().enumerate().partition(|(_, track)| document.leaves_out_track(&track.path));
        let left_out =
            left_out.into_iter().map(|(number, track)| (number, track.path.into_inner())).collect();
        let tracks = kept.into_iter().map(|track| Track::of(&document, track, frames));
        let tracks = tracks.collect::<Result<Vec<Track>>>()?;
        for (number, track) in tracks.iter().enumerate() {
            tracks[..number].iter().try_for_each(|earlier| track.refuse_to_hide(&document, earlier))?;
        }
        refuse_angle_beside_position(&document, &tracks)?;
        let mut table: Table = document.text.parse().map_err(|error| document.misread(&error))?;
        table.remove("animation");
        let frames_per_second = frames_per_second.and_then(|Whole(rate)| u16::try_from(rate).ok());
        let cache = FrameCache::default();
        Ok(Self {
            frames,
            frames_per_second,
            document,
            table,
            tracks,
            left_out,
            shot,
            cache,
            notes: FrameNotes::default(),
        })
    }

    /// Returns a note for each setting whose value a track replaces, wholly or in part, and for each setting that
    /// changes a track that was left out.
    pub(super) fn notes_on_replaced(&self, settings: &[Setting]) -> Vec<String> {
        let quotes = self.document.quotes;
        let replaced =
            |setting: &Setting| self.tracks.iter().find_map(|track| track.note_replaced(setting, quotes));
        let noted = |setting: &Setting| replaced(setting).or_else(|| self.note_left_out(setting));
        settings.iter().filter_map(noted).collect()
    }

    /// Returns a note if `setting` changes a track that was left out; otherwise `None`.
    fn note_left_out(&self, setting: &Setting) -> Option<String> {
        let is_of =
            |(number, _): &(usize, String)| is_within(&setting.path, &format!("animation.track.{number}"));
        self.left_out.iter().any(is_of).then(|| {
            let origin = shortened(&*setting.origin);
            format!("{origin} has no effect: the camera's angle replaces this track")
        })
    }

    /// Returns notes for a command that renders the frames: on tracks that are left out, on tracks and values without
    /// effect, and on an animation of several frames without tracks.
    pub fn notes_on_tracks(&self) -> Vec<String> {
        let name = &self.document.name;
        let still = || format!("{name}: the animation has no track, so all frames are equal");
        let is_still = self.tracks.is_empty() && self.left_out.is_empty() && self.frames > 1;
        let unused = self.tracks.iter().filter_map(|track| track.note_unused(&self.document));
        let still = is_still.then(still);
        self.note_all_left_out().into_iter().chain(still).chain(unused).collect()
    }

    /// Returns a note with the number and the paths of the tracks that are left out; `None` if there are none.
    fn note_all_left_out(&self) -> Option<String> {
        let count = self.left_out.len();
        let angle = self.document.angle().filter(|_| count > 0)?;
        let paths: Vec<&String> = self.left_out.iter().map(|(_, path)| path).collect();
        let paths = if self.document.quotes { format!(" ({})", few(&paths)) } else { String::new() };
        let still = if self.tracks.is_empty() && self.frames > 1 { ", so all frames are equal" } else { "" };
        Some(format!("{angle} replaces {} of the scene file{paths}{still}", counted(count, "track")))
    }

    /// Checks two conditions for each frame in `frames`: the scene file with the frame's values can be parsed
    /// as a scene, and the frame's background is transparent if and only if the background of frame 1 is
    /// transparent. Files of meshes and pictures are not read.
    ///
    /// # Errors
    ///
    /// Returns a user error for the first frame that fails a check. If the frame's document is not a valid
    /// scene, the error points to the track that makes the document invalid.
    pub fn check(&self, mut frames: RangeInclusive<u32>) -> Result<()> {
        let alpha = self.read(1)?.2.is_transparent();
        frames.try_for_each(|frame| {
            if self.read(frame)?.2.is_transparent() == alpha {
                return Ok(());
            }
            let name = &self.document.name;
            let message =
                format!("{name} at frame {frame}: the background is transparent in some frames only");
            Err(Error::input(message).with_help("set background = \"transparent\" in all frames or in none"))
        })
    }

    /// Finds the pictures of later frames, and adds them to [`INPUTS`](super::INPUTS), the list of the files that were
    /// read. For this purpose, the function builds the scenes of all keyframes after frame 1, except keyframes of
    /// tracks whose values are all numbers, lists of numbers, or names of STL and PLY files. Such values name neither
    /// pictures nor meshes that use pictures. If one of the scenes has a mistake, only the files that were read before
    /// the mistake was found are added.
    pub(crate) fn find_files(&mut self) {
        // The files of frame 1 were read when the scene was loaded.
        let steps: BTreeSet<u32> = self.tracks.iter().flat_map(Track::steps).collect();
        for frame in steps.into_iter().filter(|frame| *frame > 1) {
            // Errors are ignored here, because rendering the frame reports them again.
            let _ = self.assemble(frame);
        }
    }

    /// Returns the validated scene of the frame `frame`, which is to be rendered, and keeps the notes on it. If the
    /// scene's mesh equals the mesh of the validated scene `last`, the two scenes share one mesh in memory, and the
    /// mesh is not validated again.
    ///
    /// # Errors
    ///
    /// Fails in the same cases as [`super::load_scene`].
    pub fn scene(&mut self, frame: u32, last: &Scene) -> Result<Scene> {
        let mut assembled = self.assemble(frame)?;
        let scene = &mut assembled.scene;
        if Arc::ptr_eq(&scene.mesh, &last.mesh) || scene.mesh == last.mesh {
            scene.mesh = Arc::clone(&last.mesh);
            scene.validate_view()?;
        } else {
            scene.validate()?;
        }
        if frame > 1 && self.notes.is_empty() {
            assembled.note_averted(self.shot);
        }
        self.notes.add(frame, assembled.notes);
        Ok(assembled.scene)
    }

    /// Builds the scene of a frame.
    pub(super) fn assemble(&mut self, frame: u32) -> Result<Assembled> {
        let (table, document, wire) = self.read(frame)?;
        let changes =
            |track: &Track| ["object", "crease"].iter().any(|key| track.path.get_ref().starts_with(key));
        self.cache.begin(&table, self.tracks.iter().any(changes));
        assemble(&document, wire, self.shot, &mut self.cache)
    }

    /// Keeps the notes on frame 1, which is built when the scene is loaded.
    pub(super) fn keep_notes(&mut self, notes: Notes) {
        self.notes.load(notes);
    }

    /// `notes` are the notes on the scene as it was loaded. Returns these notes, but with the notes on the rendered
    /// frames in place of those on frame 1.
    pub fn notes(&self, notes: Vec<String>) -> Vec<String> {
        self.notes.instead_of_loaded(notes)
    }

    /// Returns the scene file's table with the values of a frame, the document with the same values, and the
    /// parsed document.
    fn read(&self, frame: u32) -> Result<(Table, Document, SceneWire)> {
        let table = self.table(frame, &self.tracks)?;
        let document = self.document_of(frame, &table)?;
        match from_text(&document.text) {
            Ok(wire) => Ok((table, document, wire)),
            Err(_) => Err(self.mistake(frame)),
        }
    }

    /// Returns the scene file's table after the tracks `tracks` have set their values for a frame.
    fn table(&self, frame: u32, tracks: &[Track]) -> Result<Table> {
        let mut table = self.table.clone();
        for track in tracks {
            let path = track.path.get_ref();
            overrides::set(&mut table, path, &track.value(frame)).map_err(|reason| {
                let message = format!("`{path}`: {reason}");
                self.document.error(track.path.span(), message, "this path").with_help(PATHS)
            })?;
        }
        Ok(table)
    }

    fn document_of(&self, frame: u32, table: &Table) -> Result<Document> {
        let text = toml::to_string(table).map_err(|error| {
            Error::input(format!(
                "{}: the scene of frame {frame} cannot be written as TOML: {error}",
                self.document.name
            ))
            .with_help(KEYS)
        })?;
        let quotes = self.document.quotes;
        let of_tracks = self.tracks.iter().map(|track| track.setting(frame, quotes)).collect();
        Ok(self.document.at_frame(frame, text, of_tracks))
    }

    /// Returns the error for a frame whose document cannot be parsed as a scene. To find the mistake, the
    /// tracks are applied one by one. The error points to the last track that turns a valid document into an
    /// invalid one.
    fn mistake(&self, frame: u32) -> Error {
        let mut wrong = None;
        for (number, track) in self.tracks.iter().enumerate() {
            let table = self.table(frame, &self.tracks[..=number]);
            let document = match table.and_then(|table| self.document_of(frame, &table)) {
                Ok(document) => document,
                Err(error) => return error,
            };
            match from_text::<SceneWire>(&document.text) {
                // With this track's value, the document is valid, so the mistake is not in an earlier track.
                Ok(_) => wrong = None,
                Err(error) => wrong = wrong.or(Some((track, document, error))),
            }
        }
        let Some((track, document, error)) = wrong else {
            // None of the tracks makes the document invalid. A file that is invalid without its tracks is
            // refused earlier, so this error is a bug in raycl.
            let message = format!(
                "{} at frame {frame} is not a valid scene, although no track makes it invalid",
                self.document.name
            );
            return Error::fault(message);
        };
        // The message names the frame, but no line of `document.text`. This text was formatted again, so its
        // line numbers differ from those of the scene file.
        let name = format!("{} at frame {frame}", document.name);
        let shown = toml_error(&name, &document.text, &error, KEYS);
        let starts = |with: &[&str]| with.iter().any(|start| error.message().starts_with(start));
        let of_path = starts(&["unknown field", "missing field", "duplicate field"]);
        let span = if of_path { track.path.span() } else { track.value_span(frame) };
        let message = format!("`{}` at frame {frame}: {shown}", track.path.get_ref());
        let label = if of_path { "this path" } else { "the invalid value is computed from this value" };
        let is_whole = starts(&["invalid type: floating point"]);
        let remedy = if is_whole { STEPS.to_owned() } else { shown.remedy().to_owned() };
        self.document.error(span, message, label).with_help(remedy)
    }
}

/// Refuses a track of the camera's azimuth or elevation if the file itself or another track sets the camera's
/// position, because the angle would have no effect. The position in the file does not count if a track (a
/// value over time) replaces the whole camera. A position that an option such as `--set` sets is allowed.
fn refuse_angle_beside_position(document: &Document, tracks: &[Track]) -> Result<()> {
    let Some(angle) = tracks.iter().find(|track| track.is_angle()) else { return Ok(()) };
    let file: Table = document.original().parse().map_err(|error| document.misread(&error))?;
    let is_replaced = tracks.iter().any(|track| track.path.get_ref() == "camera");
    let has_position =
        !is_replaced && file.get("camera").is_some_and(|camera| camera.get("position").is_some());
    if !has_position && !tracks.iter().any(Track::sets_camera_position) {
        return Ok(());
    }
    let message = format!("a track of `{}` beside `camera.position`", angle.path.get_ref());
    let error = document.error(angle.path.span(), message, "this track would have no effect");
    Err(error.with_help("leave out this track, or leave out `camera.position` and every track that sets the camera's position"))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::scene::{INPUTS, Loaded, load_scene, load_scene_with};
    use glam::Vec3;
    use toml::Value;

    /// Writes a scene file with a triangle and with an animation of three frames. `tracks` is the TOML text
    /// of the animation's tracks. Returns the file's folder, the scene of frame 1, and the animation.
    fn animated(tracks: &str) -> (tempfile::TempDir, Scene, Animation) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let object = "[[object]]\nvertices = [[0, 0, -2], [1, 0, -2], [0, 1, -2]]\nfaces = [[0, 1, 2]]\n";
        let light = "[[light]]\nposition = [0, 0, 0]\npower = 1\n";
        std::fs::write(&path, format!("{object}{light}[animation]\nframes = 3\n{tracks}")).unwrap();
        let loaded = load_scene(&path).unwrap();
        (folder, loaded.scene, loaded.animation.unwrap())
    }

    #[test]
    fn a_mesh_is_shared_by_the_frames_in_which_it_is_equal() {
        let track = "[[animation.track]]\npath = \"object.0.translation\"\n\
            values = [[0, 0, 0], [0, 0, 0], [5, 0, 0]]\n";
        let (_folder, first, mut animation) = animated(track);
        let second = animation.scene(2, &first).unwrap();
        assert!(Arc::ptr_eq(&first.mesh, &second.mesh));
        let third = animation.scene(3, &second).unwrap();
        assert_eq!(third.mesh.positions[0], Vec3::new(5.0, 0.0, -2.0));
        assert_eq!(second.mesh.positions[0], Vec3::new(0.0, 0.0, -2.0));
        // The crease angle changes, so each frame's mesh is made again. The meshes are equal, because a
        // single triangle has no creases.
        let track = "[[animation.track]]\npath = \"crease\"\nvalues = [30, 40]\n";
        let (_folder, first, mut animation) = animated(track);
        assert!(Arc::ptr_eq(&first.mesh, &animation.scene(3, &first).unwrap().mesh));
    }

    #[test]
    fn each_track_sets_its_own_value_in_each_frame() {
        let tracks = "[[animation.track]]\npath = \"camera.position\"\nvalues = [[0, 0, 0], [4, 0, 0]]\n\
            [[animation.track]]\npath = \"light.0.power\"\nat = [2, 3]\nvalues = [6, 8]\n";
        let (_folder, first, mut animation) = animated(tracks);
        assert_eq!(
            first.lights[0].power,
            Vec3::splat(6.0),
            "before its first keyframe, a track has its first value"
        );
        let scenes = [2, 3].map(|frame| animation.scene(frame, &first).unwrap());
        assert_eq!([&scenes[0], &scenes[1]].map(|scene| scene.camera.position.x), [2.0, 4.0]);
        assert_eq!([&scenes[0], &scenes[1]].map(|scene| scene.lights[0].power.x), [6.0, 8.0]);
        assert_eq!((animation.frames, animation.frames_per_second), (3, None));
    }

    /// The triangle has the same size in the pictures of all frames.
    #[test]
    fn a_track_of_the_field_of_view_changes_the_distance_of_a_camera_that_shows_the_whole_scene() {
        let track = "[[animation.track]]\npath = \"camera.fov_y_degrees\"\nvalues = [35, 20, 10]\n\
            [camera]\nazimuth_degrees = 0\nelevation_degrees = 0\n";
        let (_folder, first, mut animation) = animated(track);
        let distance = |scene: &Scene| scene.camera.position.z + 2.0;
        let height = |scene: &Scene| distance(scene) * scene.camera.tan_half_fov;
        for frame in [2, 3] {
            let scene = animation.scene(frame, &first).unwrap();
            assert!(distance(&scene) > 1.5 * distance(&first), "frame {frame}");
            assert!((height(&scene) / height(&first) - 1.0).abs() < 1e-4, "frame {frame}");
        }
    }

    #[test]
    fn a_track_that_sets_a_mesh_by_its_other_name_is_reported_with_its_path() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        std::fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let object = "[[object]]\nobj = \"a.obj\"\n";
        let track = "[[animation.track]]\npath = \"object.0.mesh\"\nvalues = [\"a.obj\", \"b.obj\"]\n";
        std::fs::write(&path, format!("{object}[animation]\nframes = 3\n{track}")).unwrap();
        let Error::Input(error) = load_scene(&path).unwrap_err() else { panic!("no input error") };
        assert!(error.message.contains("both `mesh` and `obj` are set"), "{}", error.message);
        assert_eq!(error.label, "this path");
        assert_eq!(error.help, "set only one of them: `obj` is another name of `mesh`");
    }

    #[test]
    fn an_animation_of_one_frame_shows_the_first_of_several_values() {
        let tracks = "[[animation.track]]\npath = \"light.0.power\"\nvalues = [6, 8, 9]\n";
        let (folder, ..) = animated(tracks);
        let path = folder.path().join("a.toml");
        let text = std::fs::read_to_string(&path).unwrap().replace("frames = 3", "frames = 1");
        std::fs::write(&path, text).unwrap();
        assert_eq!(load_scene(&path).unwrap().scene.lights[0].power, Vec3::splat(6.0));
    }

    #[test]
    fn the_files_of_later_frames_can_be_found_before_these_frames_are_reached() {
        let track = "[[animation.track]]\npath = \"object.0\"\nat = [1, 3]\n\
            values = [{ shape = \"sphere\", triangles = 20 }, { mesh = \"late.obj\" }]\n";
        let (folder, _, mut animation) = animated(track);
        let late = folder.path().canonicalize().unwrap().join("late.obj");
        std::fs::write(&late, "no mesh").unwrap();
        assert!(!INPUTS.contains(&late));
        animation.find_files();
        assert!(INPUTS.contains(&late), "although it has a mistake");
    }

    #[test]
    fn only_values_that_are_no_numbers_can_name_other_files() {
        let tracks = "[[animation.track]]\npath = \"textures\"\nvalues = [true, false]\n\
            [[animation.track]]\npath = \"light.0.power\"\nat = [2, 3]\nvalues = [6, 8]\n";
        let (_folder, _, animation) = animated(tracks);
        let steps = animation.tracks.iter().map(|track| track.steps().collect::<Vec<_>>());
        assert_eq!(steps.collect::<Vec<_>>(), [vec![1, 3], vec![]]);
    }

    #[test]
    fn a_track_of_an_angle_beside_a_position_is_refused_with_its_line() {
        let file = |camera: &str, tracks: &str| {
            format!(
                "[camera]\n{camera}\n[[object]]\nshape = \"sphere\"\ntriangles = 20\n[animation]\nframes = 3\n\
                 [[animation.track]]\npath = \"camera.azimuth_degrees\"\nvalues = [0, 90]\n{tracks}"
            )
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let load = |text: &str, settings: &[(String, Value)]| {
            std::fs::write(&path, text).unwrap();
            load_scene_with(&path, settings).map(|loaded| loaded.scene.camera)
        };
        let position = "position = [0, 0, 9]";
        let moved = "[[animation.track]]\npath = \"camera.position\"\nvalues = [[0, 0, 9], [0, 9, 0]]\n";
        let replaced = "[[animation.track]]\npath = \"camera.position.1\"\nvalues = [1, 2]\n";
        for text in [file(position, ""), file("", moved), file("", replaced)] {
            let Error::Input(error) = load(&text, &[]).unwrap_err() else { panic!("no input error") };
            assert_eq!(error.message, "a track of `camera.azimuth_degrees` beside `camera.position`");
            assert_eq!(error.label, "this track would have no effect");
            assert_eq!(crate::error::line_of(&text, error.span.unwrap().offset()), 9);
        }
        assert!(load(&file("look_at = [0, 0, 0]", ""), &[]).is_ok());
        // Here, a track replaces the file's whole camera, so the camera's position in the file does not
        // count. This track comes before the track of the azimuth.
        let after = |camera: &str| {
            let values = format!("values = [{{ {camera} }}, {{ {camera} }}]");
            let whole = format!("[[animation.track]]\npath = \"camera\"\n{values}\n[[animation.track]]");
            file(position, "").replace("[[animation.track]]", &whole)
        };
        assert_ne!(load(&after("look_at = [0, 0, 0]"), &[]).unwrap().position, Vec3::new(0.0, 0.0, 9.0));
        assert!(load(&after(position), &[]).is_err(), "the track sets a position");
        // An option may set the azimuth although the file sets a position. An option may also set the position
        // although a track sets the azimuth.
        let eye = Value::Array([0, 0, 9].map(Value::from).to_vec());
        let set = |key: &str, value: Value| [(format!("camera.{key}"), value)];
        assert!(load(&file(position, ""), &set("azimuth_degrees", Value::from(40))).is_ok());
        assert_eq!(load(&file("", ""), &set("position", eye)).unwrap().position, Vec3::new(0.0, 0.0, 9.0));
    }

    /// Loads an animation of three tracks, of which the first moves the camera. Loads it with these settings: an
    /// azimuth of the camera, and `settings`.
    fn with_angle(settings: &[(&str, Value)]) -> Loaded {
        let tracks = "[[animation.track]]\npath = \"camera.position\"\nvalues = [[0, 0, 0], [4, 0, 0]]\n\
            [[animation.track]]\npath = \"light.0.power\"\nvalues = [6, 8]\n\
            [[animation.track]]\npath = \"display.exposure\"\nvalues = [3, 9]\n";
        let (folder, ..) = animated(tracks);
        let angle = ("camera.azimuth_degrees", Value::from(30));
        let all = [&[angle][..], settings].concat();
        let all: Vec<_> = all.into_iter().map(|(path, value)| (path.to_owned(), value)).collect();
        load_scene_with(&folder.path().join("a.toml"), &all).unwrap()
    }

    #[test]
    fn an_angle_leaves_out_the_cameras_tracks_and_the_others_keep_their_numbers() {
        let values = Value::Array([2, 4].map(Value::from).to_vec());
        let loaded = with_angle(&[("animation.track.1.values", values.clone())]);
        assert_eq!((loaded.scene.lights[0].power, loaded.scene.display.exposure), (Vec3::splat(2.0), 3.0));
        let mut animation = loaded.animation.unwrap();
        let last = animation.scene(3, &loaded.scene).unwrap();
        assert_eq!((last.lights[0].power, last.display.exposure), (Vec3::splat(4.0), 9.0));
        assert_eq!(last.camera, loaded.scene.camera);

        let note = format!(
            "animation.track.0.values = {values} has no effect: the camera's angle replaces this track"
        );
        assert!(!loaded.notes.iter().any(|note| note.contains("has no effect")), "{:?}", loaded.notes);
        let notes = with_angle(&[("animation.track.0.values", values)]).notes;
        assert!(notes.contains(&note), "{notes:?}");
    }

    #[test]
    fn those_who_render_the_frames_are_told_of_tracks_that_are_left_out_or_change_nothing() {
        let angle = "camera.azimuth_degrees = 30 replaces 1 track of the scene file (camera.position)";
        assert_eq!(with_angle(&[]).animation.unwrap().notes_on_tracks(), [angle]);
        let notes = |tracks: &str, frames: &str| {
            let (folder, ..) = animated(tracks);
            let path = folder.path().join("a.toml");
            let text = std::fs::read_to_string(&path).unwrap().replace("frames = 3", frames);
            std::fs::write(&path, text).unwrap();
            let notes = load_scene(&path).unwrap().animation.unwrap().notes_on_tracks();
            let name = path.display().to_string();
            notes.into_iter().map(|note| note.replace(&name, "a.toml")).collect::<Vec<_>>()
        };
        let still = "a.toml: the animation has no track, so all frames are equal";
        assert_eq!(notes("", "frames = 3"), [still]);
        assert!(notes("", "frames = 1").is_empty());
        let track = "[[animation.track]]\npath = \"light.0.power\"\nvalues = [6, 8, 9]\n";
        assert!(notes(track, "frames = 3").is_empty());
        let unused = "a.toml:10: 2 more values are not used, since the animation has one frame";
        assert_eq!(notes(track, "frames = 1"), [unused]);
        let name = "[[animation.track]]\npath = \"name\"\nvalues = [\"b\", \"c\"]\n";
        assert_eq!(notes(name, "frames = 3"), ["a.toml:10: a track of `name` changes no picture"]);
    }

    #[test]
    fn the_notes_on_rendered_frames_replace_those_on_frame_1() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let mesh = |name: &str, more: &str| {
            std::fs::write(folder.path().join(name), format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{more}f 1 2 3\n"))
                .unwrap();
        };
        mesh("a.obj", "mtllib one.mtl\n");
        mesh("b.obj", "mtllib two.mtl\n");
        let track =
            |path: &str, values: &str| format!("[[animation.track]]\npath = \"{path}\"\nvalues = {values}\n");
        let meshes = track("object.0.mesh", "[\"a.obj\", \"b.obj\", \"b.obj\"]");
        let powers = track("light.0.power", "[0, 0, 9]");
        let light = "[[light]]\nposition = [0, 0, 3]\npower = 1\n";
        let object = "[[object]]\nmesh = \"a.obj\"\ntranslation = [0, 0, -2]\n";
        std::fs::write(&path, format!("{object}{light}[animation]\nframes = 3\n{meshes}{powers}")).unwrap();
        let noted = |frames: &[u32]| {
            let loaded = load_scene(&path).unwrap();
            let mut animation = loaded.animation.unwrap();
            animation.find_files();
            frames.iter().fold(loaded.scene, |last, frame| animation.scene(*frame, &last).unwrap());
            let notes = animation.notes(loaded.notes);
            ["one.mtl", "two.mtl", "has power 0"]
                .map(|text| notes.iter().filter(|note| note.contains(text)).count())
        };
        assert_eq!(noted(&[]), [1, 0, 1], "a still picture shows frame 1");
        assert_eq!(noted(&[1]), [1, 0, 1]);
        assert_eq!(noted(&[2]), [0, 1, 1]);
        assert_eq!(noted(&[1, 2]), [1, 1, 1]);
        assert_eq!(noted(&[1, 2, 3]), [1, 1, 0], "frame 3 is lit");
        assert_eq!(noted(&[2, 3]), [0, 1, 0]);
    }

    #[test]
    fn an_angle_leaves_out_no_track_whose_path_was_set() {
        let track: Table = "path = \"camera.fov_y_degrees\"\nvalues = [20, 40]".parse().unwrap();
        let loaded = with_angle(&[("animation.track.3", Value::Table(track))]);
        let last = loaded.animation.unwrap().scene(3, &loaded.scene).unwrap();
        assert!(last.camera.tan_half_fov > 1.5 * loaded.scene.camera.tan_half_fov);
    }

    #[test]
    fn beside_an_angle_a_mistake_in_a_track_has_the_tracks_own_line() {
        let tracks = "[[animation.track]]\npath = \"camera.position\"\nvalues = [[0, 0, 0], [4, 0, 0]]\n\
            [[animation.track]]\npath = \"object.0.faces\"\nvalues = [[[0, 1, 2]], [[0, 1, 7]]]\n\
            interpolation = \"step\"\n";
        let (folder, ..) = animated(tracks);
        let angle = ("camera.azimuth_degrees".to_owned(), Value::from(30));
        let loaded = load_scene_with(&folder.path().join("a.toml"), &[angle]).unwrap();
        let message = loaded.animation.unwrap().scene(3, &loaded.scene).unwrap_err().to_string();
        assert!(message.contains("a.toml:14: track `object.0.faces` at frame 3: "), "{message}");
    }

    #[test]
    fn a_background_that_is_transparent_at_times_is_refused() {
        let track =
            "[[animation.track]]\npath = \"background\"\nat = [1, 3]\nvalues = [\"transparent\", 0]\n";
        let (folder, _, animation) = animated(track);
        animation.check(1..=2).unwrap();
        let name = folder.path().join("a.toml");
        let expected =
            format!("{} at frame 3: the background is transparent in some frames only", name.display());
        assert_eq!(animation.check(1..=3).unwrap_err().to_string(), expected);
        assert_eq!(animation.check(3..=3).unwrap_err().to_string(), expected, "the first frame differs");
    }

    /// raycl builds frame 1 when it loads the file. The message about a mistake in frame 1 contains the line in
    /// the file, but not the frame's number. Where the help names a track, it also states the frame's number.
    #[test]
    fn locations_in_frame_1_are_lines_of_the_file_and_tracks_are_named_only_beside_their_mistake() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let object = "[[object]]\nvertices = [[0, 0, -2], [1, 0, -2], [0, 1, -2]]\nfaces = [[0, 1, 2]]\n";
        let track = "[animation]\nframes = 3\n[[animation.track]]\n";
        let turning = "path = \"object.0.rotation\"\nvalues = [[0, 0, 0], [0, 90, 0]]\n";
        let write = |text: &str| std::fs::write(&path, format!("{object}{text}")).unwrap();
        write(&format!("{track}{turning}"));
        let notes = load_scene(&path).unwrap().notes;
        let dark = format!("{}:8: no light, ", path.display());
        assert!(notes.iter().any(|note| note.starts_with(&dark)), "{notes:?}");

        write(&format!("[sky]\nhorizon = 1\n{track}{turning}"));
        let error = load_scene(&path).unwrap_err();
        assert!(error.in_a_line().starts_with(&format!("{}:", path.display())), "{}", error.in_a_line());
        assert!(!format!("{} {}", error.in_a_line(), error.remedy()).contains("at frame"), "{error:?}");

        let camera = "[camera]\nposition = [0, 0, 3]\nlook_at = [0, 0, 0]\n";
        let blind = "path = \"camera.position\"\nvalues = [[0, 0, 0], [0, 0, 3]]\n";
        write(&format!("{camera}{track}{turning}[[animation.track]]\n{blind}"));
        let error = load_scene(&path).unwrap_err();
        let end = format!("changed: {}:14: track `camera.position` at frame 1", path.display());
        assert!(error.in_a_line().starts_with(&format!("{}:6: the camera", path.display())), "{error:?}");
        assert!(error.remedy().ends_with(&end), "{}", error.remedy());

        write(&format!(
            "{camera}{track}{}",
            blind.replace("[[0, 0, 0], [0, 0, 3]]", "[[0, 0, 3], [0, 0, 0]]")
        ));
        let loaded = load_scene(&path).unwrap();
        let error = loaded.animation.unwrap().scene(3, &loaded.scene).unwrap_err();
        let start = format!("{}:6: at frame 3: the camera at", path.display());
        assert!(error.in_a_line().starts_with(&start), "{}", error.in_a_line());
    }

    #[test]
    fn a_value_that_is_wrong_in_a_frame_is_reported_with_its_track() {
        let track = "[[animation.track]]\npath = \"light.0.power\"\nvalues = [1, -3]\n";
        let (_folder, _, animation) = animated(track);
        animation.check(1..=1).unwrap();
        let error = animation.check(1..=3).unwrap_err().to_string();
        assert!(error.starts_with("`light.0.power` at frame 2: "), "{error}");
    }

    #[test]
    fn a_mistake_that_only_a_built_scene_shows_is_located_in_the_files_own_text() {
        let camera = "[camera]\n# The eye.\nposition = [0, 0, 3]\nlook_at = [0, 0, 0]\n";
        let tracks = format!(
            "[[animation.track]]\npath = \"camera.position\"\nvalues = [[0, 0, 3],\n[0, 0, 0]]\n{camera}"
        );
        let (folder, first, mut animation) = animated(&tracks);
        let Error::Input(error) = animation.scene(3, &first).unwrap_err() else { panic!("no input error") };
        let text = std::fs::read_to_string(folder.path().join("a.toml")).unwrap();
        assert_eq!(error.source_code.as_ref().unwrap().inner(), &text);
        let span = error.span.unwrap();
        assert_eq!(&text[span.offset()..span.offset() + span.len()], "[0, 0, 0]");
        assert_eq!(crate::error::line_of(&text, span.offset()), text.lines().count());
        let help = &error.help;
        assert!(help.ends_with("a.toml:12: track `camera.position` at frame 3"), "{help}");

        // Each of the two `settings` is an option. The first option sets the exposure, which the track
        // `camera.position` does not change. The second option sets the value of this track's second
        // keyframe.
        let path = folder.path().join("a.toml");
        let middle = Value::Array([0, 0, 0].map(Value::from).to_vec());
        let locations = [format!("{}:12", path.display()), format!("animation.track.0.values.1 = {middle}")];
        let settings = [("display.exposure", Value::from(10)), ("animation.track.0.values.1", middle)];
        for ((key, value), location) in settings.into_iter().zip(locations) {
            let loaded = load_scene_with(&path, &[(key.to_owned(), value)]).unwrap();
            let error = loaded.animation.unwrap().scene(3, &loaded.scene).unwrap_err();
            let expected = format!("; {location}: track `camera.position` at frame 3");
            assert!(error.remedy().ends_with(&expected), "{}", error.remedy());
        }

        // In this animation, the second value of the track `object.0.faces` is the mistake: it names a vertex
        // that does not exist.
        let tracks = "[[animation.track]]\npath = \"object.0.faces\"\nvalues = [[[0, 1, 2]], [[0, 1, 7]]]\n\
            interpolation = \"step\"\n";
        let (_folder, first, mut animation) = animated(tracks);
        let message = animation.scene(3, &first).unwrap_err().to_string();
        assert!(message.contains("a.toml:11: track `object.0.faces` at frame 3: "), "{message}");
    }

    #[test]
    fn a_path_that_leads_nowhere_is_reported_with_a_help_on_paths() {
        let (folder, ..) = animated("");
        let path = folder.path().join("a.toml");
        let track = "[[animation.track]]\npath = \"light.7.power\"\nvalues = [1]\n";
        std::fs::write(&path, std::fs::read_to_string(&path).unwrap() + track).unwrap();
        assert_eq!(load_scene(&path).unwrap_err().remedy(), PATHS);
    }

    #[test]
    fn a_setting_that_a_track_replaces_is_noted() {
        let tracks = "[[animation.track]]\npath = \"light.1\"\nvalues = [{ position = [0, 0, 2], power = 3 }]\n\
            [[animation.track]]\npath = \"light.2.power\"\nvalues = [6, 8]\n";
        let lights = "[[light]]\nposition = [0, 0, 0]\npower = 1\n".repeat(10);
        let (folder, ..) = animated(&format!("{tracks}{lights}"));
        let noted = |path: &str, value: Value| -> Vec<String> {
            let loaded = load_scene_with(&folder.path().join("a.toml"), &[(path.to_owned(), value)]).unwrap();
            loaded.notes.into_iter().filter(|note| note.contains("track")).collect()
        };
        let power = Value::from(3);
        let expected = "light.1.power = 3 has no effect: the track `light.1` sets this value";
        assert_eq!(noted("light.1.power", power.clone()), [expected]);
        assert!(noted("light.10.power", power).is_empty());
        let light: Table = "position = [0, 0, 2]\npower = 3".parse().unwrap();
        let notes = noted("light.2", Value::Table(light));
        let end = " has only part of its effect: the track `light.2.power` sets a part of this value";
        assert!(
            notes.len() == 1 && notes[0].starts_with("light.2 = ") && notes[0].ends_with(end),
            "{notes:?}"
        );
    }

    /// The text of the first track's path, `light.10.power`, begins with the text of the second track's path,
    /// `light.1`. Nevertheless, the first track sets no part of the value that the second track sets.
    #[test]
    fn light_10_is_no_part_of_light_1() {
        let tracks = "[[animation.track]]\npath = \"light.10.power\"\nvalues = [6, 8]\n\
            [[animation.track]]\npath = \"light.1\"\n\
            values = [{ position = [0, 0, 2], power = 3 }, { position = [0, 0, 4], power = 3 }]\n";
        let lights = "[[light]]\nposition = [0, 0, 0]\npower = 1\n".repeat(10);
        let (_folder, first, _) = animated(&format!("{tracks}{lights}"));
        assert_eq!((first.lights[1].position.z, first.lights[10].power.x), (2.0, 6.0));
    }
}
