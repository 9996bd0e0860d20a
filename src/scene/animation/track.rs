//! A track: one value of a scene over time, interpolated between its keyframes.

use super::between::{are_alike, between, is_numeric};
use super::wire::{Interpolation, TrackWire};
use crate::error::{Result, shortened};
use crate::filetype::MeshFormat;
use crate::scene::document::Document;
use crate::scene::overrides;
use crate::scene::setting::{Setting, TrackValue};
use crate::words::{counted, counted_are};
use std::path::Path;
use toml::{Spanned, Value};

/// Largest number of names and indices in a track's path; `object.0.face_normals.0.0` has five.
const MAX_DEPTH: usize = 8;

/// A value of the scene over time.
pub(super) struct Track {
    /// The track's number in the scene file, from 0.
    number: usize,
    /// The value's dotted path in the scene file.
    pub path: Spanned<String>,
    /// The frames of the keyframes, ascending.
    at: Vec<f64>,
    /// The values at the frames in `at`; there is at least one.
    values: Vec<Spanned<Value>>,
    /// The number of values that the animation does not use, because it has only one frame.
    unused: usize,
    interpolation: Interpolation,
}

impl Track {
    /// Checks a track of an animation with `frames` frames, and returns the track. `number` is the track's
    /// index in the scene file, from 0.
    pub fn of(document: &Document, (number, wire): (usize, TrackWire), frames: u32) -> Result<Self> {
        let TrackWire { path, at, values, interpolation } = wire;
        if path.get_ref().split('.').next() == Some("animation") {
            return Err(document.error(path.span(), "a track cannot change the animation", "this path"));
        }
        if path.get_ref().split('.').count() > MAX_DEPTH {
            return Err(document.error(
                path.span(),
                "this path is longer than the path of any value of a scene",
                "this path",
            ));
        }
        if values.get_ref().is_empty() {
            return Err(document.error(values.span(), "a track without values", "expected at least one"));
        }
        let at = match &at {
            Some(at) => given(document, at, values.get_ref().len(), frames)?,
            None => evenly(values.get_ref().len(), frames),
        };
        let mut values = values.into_inner();
        let interpolation = checked(document, &values, interpolation)?;
        let unused = values.len() - at.len();
        values.truncate(at.len());
        Ok(Self { number, path, at, values, unused, interpolation })
    }

    /// Refuses this track if it would replace a value that the track `earlier` sets.
    ///
    /// # Errors
    ///
    /// Fails if both tracks have the same path, or if `earlier` sets a part of the value that this track
    /// sets.
    pub fn refuse_to_hide(&self, document: &Document, earlier: &Self) -> Result<()> {
        let (path, other) = (self.path.get_ref(), earlier.path.get_ref());
        let refused = |message: String, label: &str| document.error(self.path.span(), message, label);
        match other.strip_prefix(path.as_str()) {
            Some("") => Err(refused(format!("a second track for `{path}`"), "this path has a track already")),
            Some(rest) if rest.starts_with('.') => {
                let message = format!("`{path}` replaces the value of the track `{other}`");
                let help = "put this track before all tracks that set a part of its value";
                Err(refused(message, "this path").with_help(help))
            }
            _ => Ok(()),
        }
    }

    /// Returns a note if this track replaces the value of `setting` or a part of it; otherwise `None`. The note
    /// contains the track's path only if `quotes` is true, that is, if messages may quote the scene file.
    pub fn note_replaced(&self, setting: &Setting, quotes: bool) -> Option<String> {
        let path = self.path.get_ref();
        let (effect, part) = match (is_within(&setting.path, path), is_within(path, &setting.path)) {
            (true, _) => ("no effect", "this value"),
            (false, true) => ("only part of its effect", "a part of this value"),
            (false, false) => return None,
        };
        let track = if quotes { format!("the track `{path}`") } else { "a track".to_owned() };
        Some(format!("{} has {effect}: {track} sets {part}", shortened(&*setting.origin)))
    }

    /// Returns a note if this track sets the scene's `name`, which changes no picture, or if some of the track's
    /// values are not used; otherwise `None`.
    pub fn note_unused(&self, document: &Document) -> Option<String> {
        let location = || document.location_of(&self.path.span());
        if self.path.get_ref() == "name" {
            return Some(format!("{}: a track of `name` changes no picture", location()));
        }
        let unused = || counted_are(self.unused, "more value");
        let note = || format!("{}: {} not used, since the animation has one frame", location(), unused());
        (self.unused > 0).then(note)
    }

    /// Returns true if this track sets the camera's azimuth or elevation.
    pub fn is_angle(&self) -> bool {
        overrides::is_angle(self.path.get_ref())
    }

    /// Returns true if this track sets the camera's position or a part of the position.
    pub fn sets_camera_position(&self) -> bool {
        let path = self.path.get_ref();
        self.values.iter().any(|value| overrides::sets_camera_position(path, value.get_ref()))
    }

    /// Returns the track's value at a frame. Before the first keyframe, the track has its first
    /// value; after the last keyframe, the track has its last value.
    pub fn value(&self, frame: u32) -> Value {
        let frame = f64::from(frame);
        let begin = self.last_keyframe(frame);
        let first = self.values[begin].get_ref();
        if frame <= self.at[begin] || begin + 1 == self.at.len() {
            return first.clone();
        }
        // The curve's slopes at the keyframes `begin` and `begin + 1` also depend on the keyframes
        // `begin - 1` and `begin + 2`.
        let (low, high) = (begin.saturating_sub(1), (begin + 3).min(self.at.len()));
        let values: Vec<&Value> = self.values[low..high].iter().map(Spanned::get_ref).collect();
        between((&self.at[low..high], &values), begin - low, frame, self.interpolation)
    }

    /// Returns the frames of this track's keyframes. Returns no frames if the track's values are all numbers,
    /// lists of numbers, or names of mesh files that cannot name pictures (STL and PLY).
    pub fn steps(&self) -> impl Iterator<Item = u32> + '_ {
        let may_name_pictures = !self.values.iter().all(|value| names_no_picture(value.get_ref()));
        // A keyframe that was placed by `evenly` can lie between two frames. If a keyframe between two frames
        // names a picture, the picture is first needed at the later of these two frames.
        self.at.iter().filter(move |_| may_name_pictures).map(|at| at.ceil() as u32)
    }

    /// Describes, for messages, the value that the track sets in a frame. The description's `name` contains
    /// the track's path only if `quotes` is true, that is, if messages may quote the scene file.
    pub fn setting(&self, frame: u32, quotes: bool) -> TrackValue {
        let path = self.path.get_ref();
        let (number, keyframe) = (self.number, self.last_keyframe(f64::from(frame)));
        let name = if quotes { format!("track `{path}`") } else { "a track".to_owned() };
        TrackValue {
            path: path.clone(),
            keyframe: format!("animation.track.{number}.values.{keyframe}"),
            name: format!("{name} at frame {frame}"),
        }
    }

    /// Returns the location, in the file, of the value of the last keyframe at or before `frame`. If all
    /// keyframes are after `frame`, returns the location of the first value.
    pub fn value_span(&self, frame: u32) -> std::ops::Range<usize> {
        self.values[self.last_keyframe(f64::from(frame))].span()
    }

    /// Returns the index of the last keyframe at or before a frame; 0 if all keyframes are after the frame.
    fn last_keyframe(&self, frame: f64) -> usize {
        self.at.partition_point(|at| *at <= frame).saturating_sub(1)
    }
}

/// Returns true if the value at `path` is the value at `whole` or a part of it.
pub(super) fn is_within(path: &str, whole: &str) -> bool {
    path.strip_prefix(whole).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// Returns true if a value is numeric, or if it names a mesh file whose format cannot refer to other files.
fn names_no_picture(value: &Value) -> bool {
    let format = value.as_str().and_then(|name| MeshFormat::from_ending(Path::new(name)));
    is_numeric(value) || matches!(format, Some(MeshFormat::Stl | MeshFormat::Ply))
}

/// The help in an error about values that cannot be interpolated.
pub const STEPS: &str = "interpolation = \"step\" keeps a value until the next keyframe";

/// Returns the frames in `at`, the list that the scene file gives. Returns an error if `at` does not have
/// `values` elements, or if the elements are not ascending whole numbers from 1 to `frames`.
fn given(
    document: &Document,
    at: &Spanned<Vec<Spanned<Value>>>,
    values: usize,
    frames: u32,
) -> Result<Vec<f64>> {
    let list = at.get_ref();
    if list.len() != values {
        let message = format!("`at` has {}, `values` has {values}", counted(list.len(), "element"));
        return Err(document.error(at.span(), message, "expected a frame for each value"));
    }
    let mut numbers: Vec<u32> = Vec::with_capacity(list.len());
    for frame in list {
        let value = frame.get_ref();
        let number = value.as_integer().and_then(|number| u32::try_from(number).ok());
        let Some(number) = number.filter(|number| (1..=frames).contains(number)) else {
            let message = format!("{value} is not a frame; expected a whole number from 1 to {frames}");
            return Err(document.error(frame.span(), message, "here"));
        };
        if let Some(last) = numbers.last().filter(|last| **last >= number) {
            let message = format!("frame {number} follows frame {last}");
            return Err(document.error(frame.span(), message, "expected ascending frames"));
        }
        numbers.push(number);
    }
    Ok(numbers.into_iter().map(f64::from).collect())
}

/// Returns the frames at which `values` evenly spaced keyframes lie. The first keyframe is at frame 1, and
/// the last of several keyframes is at frame `frames`. Keyframes between the first and the last one need not
/// lie at whole frames. An animation of one frame has only the first keyframe.
fn evenly(values: usize, frames: u32) -> Vec<f64> {
    let values = if frames == 1 { 1 } else { values };
    let (length, steps) = (f64::from(frames - 1), (values.max(2) - 1) as f64);
    // The product is computed before the quotient, so that a keyframe at a whole frame is not rounded.
    (0..values).map(|index| 1.0 + length * index as f64 / steps).collect()
}

/// Returns a track's interpolation: `given` or, if `given` is `None`, `Smooth` for numeric values and `Step`
/// for other values. Refuses values that the track's interpolation cannot interpolate.
fn checked(
    document: &Document,
    values: &[Spanned<Value>],
    given: Option<Spanned<Interpolation>>,
) -> Result<Interpolation> {
    let numeric = values.iter().all(|value| is_numeric(value.get_ref()));
    let default = if numeric { Interpolation::Smooth } else { Interpolation::Step };
    let interpolation = given.as_ref().map_or(default, |given| *given.get_ref());
    if interpolation == Interpolation::Step {
        return Ok(interpolation);
    }
    if let (false, Some(given)) = (numeric, given) {
        let message = "only numbers and lists of numbers can be interpolated";
        let error = document.error(given.span(), message, "some values of this track are not numbers");
        return Err(error.with_help(STEPS));
    }
    let first = values[0].get_ref();
    match values.iter().find(|value| !are_alike(first, value.get_ref())) {
        None => Ok(interpolation),
        Some(other) => {
            let message = "this value and the first one differ in structure";
            let label = "expected a number, or lists of the same lengths, as in the first value";
            Err(document.error(other.span(), message, label).with_help(STEPS))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_without_frames_lie_at_equal_distances_from_the_first_to_the_last() {
        assert_eq!(evenly(3, 121), [1.0, 61.0, 121.0]);
        assert_eq!(evenly(4, 4), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!((evenly(8, 30)[7], evenly(46, 100)[5]), (30.0, 12.0), "without rounding");
        assert_eq!([evenly(1, 9), evenly(1, 1), evenly(3, 1)], [[1.0], [1.0], [1.0]]);
    }

    #[test]
    fn a_value_depends_on_one_more_keyframe_on_both_sides() {
        let at = vec![1.0, 3.0, 7.0, 15.0, 16.0];
        let values: Vec<Value> = [0.0, 1.0, 4.0, 20.0, 50.0].map(Value::Float).to_vec();
        let spanned = values.iter().map(|value| Spanned::new(0..0, value.clone())).collect();
        let path = Spanned::new(0..0, "background".to_owned());
        let interpolation = Interpolation::Smooth;
        let track = Track { number: 0, path, at: at.clone(), values: spanned, unused: 0, interpolation };
        let all: Vec<&Value> = values.iter().collect();
        for (begin, frame) in [(0, 2), (1, 5), (2, 9)] {
            let expected = between((&at, &all), begin, f64::from(frame), Interpolation::Smooth);
            assert_eq!(track.value(frame), expected, "at frame {frame}");
        }
        let ends = [0, 1, 16, 20].map(|frame| track.value(frame));
        assert_eq!(ends, [0.0, 0.0, 50.0, 50.0].map(Value::Float));
    }

    #[test]
    fn files_are_searched_for_pictures_unless_no_value_can_name_one() {
        let steps = |names: [&str; 2]| {
            let track = Track {
                number: 0,
                path: Spanned::new(0..0, "object.0.mesh".to_owned()),
                at: vec![1.0, 2.5],
                values: names.map(|name| Spanned::new(0..0, Value::from(name))).into(),
                unused: 0,
                interpolation: Interpolation::Step,
            };
            track.steps().collect::<Vec<_>>()
        };
        assert!(steps(["a.stl", "b.PLY"]).is_empty() && steps(["a.ply.gz", "b.stl.gz"]).is_empty());
        for names in [["a.stl", "b.obj"], ["a.glb", "b.stl"], ["a.exr", "b.exr"], ["a.stl", "stl"]] {
            assert_eq!(steps(names), [1, 3], "{names:?}");
        }
    }

    #[test]
    fn a_frame_belongs_to_the_last_keyframe_that_is_not_after_it() {
        let value = |number: usize| Spanned::new(number..number + 1, Value::Integer(0));
        let track = Track {
            number: 7,
            path: Spanned::new(0..0, "background".to_owned()),
            at: vec![2.0, 5.0, 9.0],
            values: (0..3).map(value).collect(),
            unused: 0,
            interpolation: Interpolation::Step,
        };
        let spans = [1, 2, 4, 5, 8, 9, 20].map(|frame| track.value_span(frame).start);
        assert_eq!(spans, [0, 0, 0, 1, 1, 2, 2]);
        let setting = |quotes: bool| track.setting(8, quotes);
        let (path, keyframe) = ("background".to_owned(), "animation.track.7.values.1".to_owned());
        let name = "track `background` at frame 8".to_owned();
        assert_eq!(setting(true), TrackValue { path: path.clone(), keyframe: keyframe.clone(), name });
        assert_eq!(setting(false), TrackValue { path, keyframe, name: "a track at frame 8".to_owned() });
    }

    #[test]
    fn a_track_of_the_camera_sets_its_position_if_one_of_its_values_does() {
        let sets_position = |cameras: [&str; 2]| {
            let value = |camera: &str| {
                let keys: toml::Table = camera.parse().unwrap_or_default();
                Spanned::new(0..0, Value::Table(keys))
            };
            let track = Track {
                number: 0,
                path: Spanned::new(0..0, "camera".to_owned()),
                at: vec![1.0, 5.0],
                values: cameras.map(value).into(),
                unused: 0,
                interpolation: Interpolation::Step,
            };
            track.sets_camera_position()
        };
        let [placed, other] = ["position = [0, 0, 9]", "look_at = [0, 0, 0]"];
        let all = [[placed, placed], [placed, other], [other, placed], [other, other]];
        assert_eq!(all.map(sets_position), [true, true, true, false]);
    }
}
