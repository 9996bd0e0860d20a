//! The text of a scene file, and the locations of mistakes in it.

use super::setting::{Changed, Origin, Setting, TrackValue, error_in};
use super::{INPUTS, files, overrides};
use crate::error::{Error, Result, line_of, shortened};
use crate::filetype::{Opened, Wanted, is_standard_input, may_be_scene, unpacked_name};
use crate::reader::{self, Kind, NotUtf8};
use crate::toml_error::{expectation, mistake};
use crate::words::{path_word, quote};
use std::cell::RefCell;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::de::DeTable;
use toml::{Spanned, Table, Value};

/// The help in an error about a scene file that cannot be parsed.
pub(super) const KEYS: &str = "docs/scenes.md lists every key of a scene, with its type";
/// The words with which a message that must not quote the scene file describes the expected input.
const PERMITTED: &str = "a key or value that a scene may have there";
/// The words with which a message that must not quote the scene file says that a line contains a mistake.
const IN_LINE: &str = "a mistake in this line";
/// The help in an error about a scene that cannot be read.
const ANY_SCENE: &str = "give the path of a scene (.toml) or a mesh (.obj, .ply, .stl, .gltf, .glb)";
/// The help in an error about a scene that is a pipe or a device.
const PIPED: &str = "read a pipe through standard input, with `raycl render - < PIPE` or `COMMAND | raycl render -`; or give the path of an ordinary file";

/// Returns the help in the error about a scene that cannot be opened.
fn instead_of(error: &std::io::Error) -> &'static str {
    // `reader::open` refuses a pipe with this kind of error.
    if error.kind() == std::io::ErrorKind::InvalidInput { PIPED } else { ANY_SCENE }
}

/// A scene file's text, with the data that messages about it need.
pub(super) struct Document {
    /// The file's name in messages.
    pub name: String,
    /// The TOML text, including all values that options, a config or tracks have set.
    pub text: String,
    /// The folder to which the document's paths are relative.
    pub folder: PathBuf,
    /// The file's name without extension.
    pub stem: String,
    /// True if the document was made for a bare mesh, which has no scene file.
    pub bare: bool,
    /// True if messages may quote the text.
    pub quotes: bool,
    /// The number, from 1, of the animation's frame whose values `text` contains; 1 if no track has set a
    /// value in `text`.
    frame: u32,
    /// The values that options, a config or tracks have set in `text`, and the text of the file without these
    /// values; `None` if no values were set.
    changed: Option<Changed>,
    /// The path and the open file of a bare mesh; `None` for a scene file, and after the mesh was read. The
    /// file is not opened again to read the mesh, because a pipe cannot be opened twice.
    held: RefCell<Option<(PathBuf, Opened)>>,
}

/// In a bare mesh without normals, an edge stays sharp if the normals of the faces beside this edge differ by more
/// than this angle.
pub(super) const BARE_CREASE_DEGREES: u32 = 40;

impl Document {
    /// Reads a scene file, or makes the document of a bare mesh.
    pub fn read(path: &Path, settings: &[Setting], quotes: bool) -> Result<Self> {
        INPUTS.add(path);
        let unreadable = |error: std::io::Error| {
            Error::unreadable_among(("scene", path), &error, may_be_scene, instead_of(&error))
        };
        let opened = Opened::at(path).map_err(unreadable)?;
        if let Some(refusal) = opened.filetype.refusal(&path.display().to_string(), Wanted::Scene) {
            return Err(refusal);
        }
        let bare = files::format(&opened, path).is_some();
        let (text, held) = match bare {
            true => (bare_text(path)?, Some((path.to_owned(), opened))),
            false => (read_text(path, opened)?, None),
        };
        let mut document = Self {
            name: path.display().to_string(),
            text,
            folder: path.parent().unwrap_or(Path::new("")).to_owned(),
            stem: stem(path),
            bare,
            quotes,
            frame: 1,
            changed: None,
            held: RefCell::new(held),
        };
        if !settings.is_empty() {
            document.set(settings)?;
        }
        Ok(document)
    }

    /// Returns a note if the format of the file's contents differs from the format that the file's extension
    /// stands for; otherwise `None`. For a file without an extension, there is no note. Must be called before
    /// the mesh is read.
    pub fn unexpected_ending(&self, path: &Path) -> Option<String> {
        let held = self.held.borrow().as_ref().and_then(|(_, opened)| files::format(opened, path));
        files::unexpected_ending(held, path).map(|note| format!("{}: {note}", path.display()))
    }

    /// Opens a file named in this document. A bare mesh is already open, so its open file is returned.
    pub fn open(&self, path: &Path) -> std::io::Result<Opened> {
        INPUTS.add(path);
        let held = self.held.borrow_mut().take_if(|(held, _)| held == path);
        held.map_or_else(|| Opened::at(path), |(_, opened)| Ok(opened))
    }

    /// Returns the error for a file that is not TOML and does not have the extension .toml: raycl probably
    /// does not support its format. Returns `None` for a file that is TOML or has the extension .toml.
    pub fn not_toml(&self, path: &Path, error: &toml::de::Error) -> Option<Error> {
        if path.extension().is_some_and(|ending| ending == "toml") || DeTable::parse(&self.text).is_ok() {
            return None;
        }
        let line = line_of(&self.text, error.span().map_or(0, |span| span.start));
        let reason = if self.quotes { format!(": {}", error.message().trim_end()) } else { String::new() };
        let message = format!("{}:{line}: neither a scene (TOML) nor a mesh{reason}", self.name);
        Some(Error::input(shortened(message)).with_help(Wanted::Scene.read()))
    }

    /// Sets values in the text, and formats the text again. Keeps the file's own text, so that messages can
    /// quote it. If a mistake is in a value of `settings`, the message names the setting instead of a line of
    /// the file.
    fn set(&mut self, settings: &[Setting]) -> Result<()> {
        let mut table: Table = self.text.parse().map_err(|error| self.misread(&error))?;
        overrides::apply(&mut table, settings)?;
        let text = toml::to_string(&table).map_err(|error| {
            Error::input(format!(
                "{}: the scene with the changed values cannot be written as TOML: {error}",
                self.name
            ))
            .with_help(KEYS)
        })?;
        let original = std::mem::replace(&mut self.text, text);
        let file = self.name.clone();
        self.changed = Some(Changed { settings: settings.to_vec(), tracks: Vec::new(), file, original });
        Ok(())
    }

    /// Returns a note if a setting of the camera's angle removes the file's field of view, and no setting sets another.
    pub fn note_removed_fov(&self) -> Option<String> {
        let changed = self.changed.as_ref().filter(|changed| overrides::have_angle(&changed.settings))?;
        overrides::note_removed_fov(&changed.original.parse().ok()?, &changed.settings)
    }

    /// Returns the origin of the first setting that sets an angle of the camera; `None` if there is none.
    pub fn angle(&self) -> Option<String> {
        let settings = &self.changed.as_ref()?.settings;
        settings
            .iter()
            .find(|setting| overrides::is_angle(&setting.path))
            .map(|setting| shortened(&*setting.origin))
    }

    /// Returns the text of the file, without the values that options, a config or tracks have set.
    pub fn original(&self) -> &str {
        self.changed.as_ref().map_or(&self.text, |changed| &changed.original)
    }

    /// Returns the origin of a part of the text: a setting (a value from an option or a config), a track, a range
    /// of the file's own text, or [`Origin::Unknown`].
    fn origin(&self, span: &Range<usize>) -> Origin<'_> {
        match &self.changed {
            Some(changed) => changed.origin(&self.text, span),
            None => Origin::File(span.clone()),
        }
    }

    /// Returns true if the animation leaves out a track that has the path `path`. If a setting sets an angle of
    /// the camera, the camera shows the whole scene from this angle. The animation then leaves out the file's
    /// tracks that move the camera. A track whose path comes from a setting is not left out.
    pub fn leaves_out_track(&self, path: &Spanned<String>) -> bool {
        let has_angle = self.changed.as_ref().is_some_and(|changed| overrides::have_angle(&changed.settings));
        has_angle
            && overrides::moves_camera(path.get_ref())
            && matches!(self.origin(&path.span()), Origin::File(_))
    }

    /// Returns the location of the part `span` of the text: `FILE:LINE`, or the setting or track that set the
    /// part. If the origin is unknown, returns only the file's name.
    pub fn location_of(&self, span: &Range<usize>) -> String {
        self.origin(span).location(&self.name, self.original())
    }

    /// Returns true if the user wrote the part `span` of the text: if the part is in a scene file, or comes from a
    /// setting. Returns false for a default in the document of a bare mesh.
    pub fn is_written(&self, span: &Range<usize>) -> bool {
        !self.bare || !matches!(self.origin(span), Origin::File(_))
    }

    /// Returns the origin of the last setting that set the whole value of `key`; `None` if there is none.
    pub fn setting_of(&self, key: &str) -> Option<String> {
        let settings = &self.changed.as_ref()?.settings;
        settings.iter().rfind(|setting| setting.path == key).map(|setting| shortened(&*setting.origin))
    }

    /// Returns `FILE:LINE` of the file's last line.
    pub fn last_line(&self) -> String {
        format!("{}:{}", self.name, self.original().lines().count())
    }

    /// Adds to the help of an error what changed the scene's values: all settings, and the tracks that may have
    /// caused the mistake. `span` is the part of the text that contains the mistake.
    pub fn with_settings(&self, span: &Range<usize>, error: Error) -> Error {
        // Frame 1 is built before all other frames. If frame 1 is valid, only tracks can make a later frame
        // invalid, so the help of a later frame's error names all tracks. If frame 1 is invalid, the mistake
        // may be in the file itself. The help of an error in frame 1 therefore names only tracks that set a
        // value in the same part of the scene, such as the camera.
        let near = (self.frame == 1).then_some(span);
        let summary = self.changed.as_ref().and_then(|changed| changed.summary(&self.text, near));
        let Some(summary) = summary else { return error };
        let remedy = format!("{}; {summary}", error.remedy());
        error.with_help(remedy)
    }

    /// Returns the document of one frame. `text` is the text of this frame's document, which already contains
    /// the values `tracks` of the animation's tracks. If the open file of a bare mesh is still in `self`,
    /// because the mesh was not read, the open file moves to the returned document.
    pub fn at_frame(&self, frame: u32, text: String, tracks: Vec<TrackValue>) -> Self {
        let settings = self.changed.as_ref().map(|changed| changed.settings.clone()).unwrap_or_default();
        let (file, original) = (self.name.clone(), self.original().to_owned());
        Self {
            name: self.name.clone(),
            text,
            frame,
            changed: Some(Changed { settings, tracks, file, original }),
            folder: self.folder.clone(),
            stem: self.stem.clone(),
            held: RefCell::new(self.held.take()),
            ..*self
        }
    }

    /// Returns the error for a text that cannot be parsed as a scene. `error` is the parser's error.
    pub fn misread(&self, error: &toml::de::Error) -> Error {
        let mistake = mistake(error, &self.text);
        let span = error.span().unwrap_or(0..0);
        let located = match self.origin(&span) {
            // The setting is the user's own text, so the message may quote its value.
            Origin::Setting(setting) => {
                return error_in(&setting, &mistake.message).with_help(mistake.remedy(KEYS));
            }
            Origin::File(span) if self.quotes => mistake
                .with_table(&super::schema(), self.original(), span.start)
                .in_file(&self.name, self.original(), span, KEYS),
            Origin::File(span) => self.withheld(span, &unquoted(error).unwrap_or_else(|| IN_LINE.to_owned())),
            Origin::Unknown if self.quotes => {
                Error::input(format!("{}: {}", self.name, mistake.message)).with_help(mistake.remedy(KEYS))
            }
            Origin::Unknown => {
                let mistake = unquoted(error).unwrap_or_else(|| format!("expected {PERMITTED}"));
                Error::input(format!("{}: {mistake}", self.name)).with_help(KEYS)
            }
        };
        self.with_settings(&span, located)
    }

    /// Returns an error for a mistake in the part `span` of a file whose text must not be shown. The message
    /// names a command that shows the line. This advice is not in the help, since a caller may replace the help.
    fn withheld(&self, span: Range<usize>, mistake: &str) -> Error {
        let file = quote(&path_word(Path::new(&self.name)));
        let mistake = format!("{mistake}; `raycl render {file}` shows the line");
        Error::withheld(&self.name, line_of(self.original(), span.start), &mistake)
    }

    /// Adds a location in this document to an error that has no location.
    pub fn located(&self, span: Range<usize>, error: Error, label: &str) -> Error {
        error.placed(|message| self.error(span, message, label))
    }

    /// Adds the frame's number to a message, except in frame 1, which is built when the scene is loaded.
    fn at_this_frame(&self, message: String) -> String {
        if self.frame > 1 { format!("at frame {}: {message}", self.frame) } else { message }
    }

    /// Returns an error for a mistake in the part `span` of this document. `label` is the text beside the
    /// marked part.
    pub fn error(&self, span: Range<usize>, message: impl Into<String>, label: &str) -> Error {
        // Labels contain only raycl's own words, so messages may show labels even if the file must not be
        // quoted.
        let why = if label == "here" { String::new() } else { format!(" ({label})") };
        let message = match self.quotes {
            true => message.into(),
            false => format!("expected {PERMITTED}{why}"),
        };
        let located = match self.origin(&span) {
            Origin::Setting(setting) => return error_in(&setting, message).with_help(KEYS),
            Origin::File(span) if self.quotes => {
                let message = self.at_this_frame(message);
                Error::in_file(&self.name, self.original(), span, message, label).with_help(KEYS)
            }
            Origin::File(span) => self.withheld(span, &format!("{IN_LINE}{why}")),
            Origin::Unknown => {
                Error::input(format!("{}: {}", self.name, self.at_this_frame(message))).with_help(KEYS)
            }
        };
        self.with_settings(&span, located)
    }
}

/// Returns the part of a parser's message that contains no text of the file; `None` if there is no such part.
fn unquoted(error: &toml::de::Error) -> Option<String> {
    let message = error.message();
    // The name of a missing key is one of raycl's own names.
    if message.starts_with("missing field `") {
        return Some(message.trim_end().to_owned());
    }
    let other = if message.starts_with("unknown field") { ", but found another key" } else { "" };
    expectation(error).map(|expected| format!("expected {expected}{other}"))
}

/// Returns a file's name without its extension and without the extension of a compressed file (`.gz`); for
/// standard input, `picture`.
fn stem(path: &Path) -> String {
    if is_standard_input(path) {
        return "picture".to_owned();
    }
    unpacked_name(path).file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns the text of a scene file for a bare mesh.
fn bare_text(path: &Path) -> Result<String> {
    let file = path.file_name().and_then(|name| name.to_str());
    let file = file.ok_or_else(|| {
        Error::input(format!("{}: the file's name is not UTF-8", path.display())).with_help("rename the file")
    })?;
    Ok(format!("crease = {BARE_CREASE_DEGREES}\n\n[[object]]\nmesh = {}\n", Value::from(file)))
}

fn read_text(path: &Path, opened: Opened) -> Result<String> {
    let bytes =
        opened.bytes(Kind::Toml).map_err(|error| Error::unreadable("scene", path, &error, ANY_SCENE))?;
    if bytes.trim_ascii().is_empty() {
        return Err(Error::input(format!("{} is empty", path.display()))
            .with_help("a scene needs at least one [[object]]; docs/scenes.md contains an example"));
    }
    reader::utf8(bytes).map_err(|error| {
        let line = NotUtf8::line_of(&error).unwrap_or(1);
        Error::input(format!(
            "{}:{line}: not UTF-8 text; a scene must be a TOML file or a mesh",
            path.display()
        ))
        .with_help("save the file as UTF-8")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Shot, load_scene_named_in};

    #[test]
    fn text_that_is_not_utf_8_is_shown_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, b"# One.\n# Two.\n# \xff\n# Four.\n").unwrap();
        let message = read_text(&path, Opened::at(&path).unwrap()).unwrap_err().to_string();
        assert!(message.contains("scene.toml:3: not UTF-8"), "{message}");
    }

    #[test]
    fn a_scene_is_named_like_its_file_without_endings() {
        for path in ["a.b/teapot.obj", "teapot.obj.gz", "teapot.toml"] {
            assert_eq!(stem(Path::new(path)), "teapot", "{path}");
        }
        assert_eq!(stem(Path::new("-")), "picture");
    }

    /// Loads a file with the text `text`, as if another file named it. If `is_in_folder` is true, the loaded
    /// file is in the folder of the file that names it. Returns the notes on the loaded file, or the message
    /// of the error.
    fn notes_or_error(
        name: &str,
        text: &str,
        is_in_folder: bool,
    ) -> std::result::Result<Vec<String>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let of = if is_in_folder { folder.path() } else { Path::new("/elsewhere") };
        let shown = |text: String| text.replace(&format!("{}/", folder.path().display()), "");
        let loaded = load_scene_named_in(of, &path, &[], Shot::SQUARE);
        let loaded = loaded.map(|loaded| loaded.notes.into_iter().map(shown).collect());
        loaded.map_err(|error| shown(error.to_string()))
    }

    #[test]
    fn a_file_of_another_type_than_its_name_says_is_noted() {
        let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        for name in ["a.obj", "a", "a.OBJ"] {
            assert_eq!(notes_or_error(name, obj, true), Ok(vec![]), "{name}");
        }
        let note = "a.stl: read as an OBJ mesh, because of its contents and despite its name";
        assert_eq!(notes_or_error("a.stl", obj, true), Ok(vec![note.to_owned()]));
        let scene = "[[object]]\nshape = \"sphere\"\n[[light]]\nposition = [0, 9, 0]\npower = 9\n";
        let note = "a.obj: read as a scene (TOML), because of its contents and despite its name";
        let notes = notes_or_error("a.obj", scene, true).unwrap();
        assert!(notes.contains(&note.to_owned()), "{notes:?}");
        // If the contents do not show the format, the name determines it.
        let unclear = format!("Notes of the maker\n{obj}");
        assert!(notes_or_error("a.obj", &unclear, true).is_ok());
    }

    #[test]
    fn text_that_is_nothing_that_raycl_reads_is_reported_unless_its_name_says_toml() {
        let text = "nothing known\n";
        let other = notes_or_error("a.thing", text, true).unwrap_err();
        assert!(other.starts_with("a.thing:1: neither a scene (TOML) nor a mesh: "), "{other}");
        assert_eq!(
            notes_or_error("a.thing", text, false).unwrap_err(),
            "a.thing:1: neither a scene (TOML) nor a mesh"
        );
        let toml = notes_or_error("a.toml", text, true).unwrap_err();
        assert!(!toml.contains("neither"), "{toml}");
        let unknown_key = notes_or_error("a.thing", "[[object]]\nsecret = 1\n", true).unwrap_err();
        assert!(!unknown_key.contains("neither"), "this is TOML: {unknown_key}");
    }

    #[test]
    fn a_mistake_of_syntax_is_reported_in_plain_words_at_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        std::fs::write(&path, "[camera]\nz_near: 0.1\n").unwrap();
        let error = load_scene_named_in(folder.path(), &path, &[], Shot::SQUARE).unwrap_err();
        assert!(error.in_a_line().ends_with("a.toml:2: `:` in place of `=`"), "{}", error.in_a_line());
        assert_eq!(error.remedy(), "write `z_near = ...`");
        let of_other = notes_or_error("a.toml", "[camera]\nsecret: 0.1\n", false).unwrap_err();
        assert!(of_other.starts_with("a.toml:2: ") && !of_other.contains("secret"), "{of_other}");
    }

    #[test]
    fn the_key_of_a_meshs_file_is_suggested_for_names_of_formats() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let error_of = |text: String| {
            std::fs::write(&path, text).unwrap();
            load_scene_named_in(folder.path(), &path, &[], Shot::SQUARE).unwrap_err()
        };
        for key in ["ply", "stl", "gltf", "GLB", "file", "path"] {
            let error = error_of(format!("[[object]]\n{key} = \"a.ply\"\n"));
            assert_eq!(error.to_string(), format!("unknown key `{key}`; did you mean `mesh`?"));
            let help = "`mesh` reads OBJ, PLY, STL, glTF and GLB files; the valid keys here are ";
            assert!(error.remedy().starts_with(help), "{}", error.remedy());
        }
        let light = error_of("[[light]]\nply = 1\n".to_owned());
        assert_eq!(light.to_string(), "unknown key `ply`");
        assert!(light.remedy().starts_with("the valid keys here are "), "{}", light.remedy());
    }

    #[test]
    fn a_key_of_a_scene_below_a_table_is_answered_with_its_own_table() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let error_of = |text: &str| {
            std::fs::write(&path, text).unwrap();
            load_scene_named_in(folder.path(), &path, &[], Shot::SQUARE).unwrap_err()
        };
        let bias = error_of("[camera]\nz_near = 0.1\nshadow_bias = 1\n");
        assert_eq!(bias.to_string(), "unknown key `shadow_bias`");
        let place = "`shadow_bias` is a key of the top level, but this line belongs to the table [camera]: move the \
                     line above the first line in brackets; the valid keys here are ";
        assert!(bias.remedy().starts_with(place), "{}", bias.remedy());
        let light = error_of("[light]\nposition = [0, 9, 0]\npower = 9\n");
        assert_eq!(light.remedy(), "write [[light]] with double brackets");
        let camera = error_of("[[camera]]\nz_near = 0.1\n");
        assert_eq!(camera.remedy(), "write [camera] with single brackets");
        let position = error_of("[[object]]\nshape = \"sphere\"\nposition = [0, 0, 0]\n");
        assert_eq!(position.to_string(), "unknown key `position`");
        let place = "`position` is a key of [camera] and [[light]]; the valid keys here are ";
        assert!(position.remedy().starts_with(place), "{}", position.remedy());
    }

    /// A file in another folder may belong to somebody else, so its text is not quoted.
    #[test]
    fn a_mistake_in_another_folders_file_is_reported_without_its_text() {
        let object = "[[object]]\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n";
        let shown = "`raycl render a.toml` shows the line";
        for (text, expected) in [
            (format!("{object}faces = [[0, 1]]\n"), "a.toml:3: a mistake in this line"),
            (object.to_owned(), "a.toml:2: a mistake in this line (these vertices are in no face)"),
            ("[[light]]\nposition = [0, 9, 0]\n".to_owned(), "a.toml:1: missing field `power`"),
        ] {
            assert_eq!(
                notes_or_error("a.toml", &text, false).unwrap_err(),
                format!("{expected}; {shown}"),
                "{text}"
            );
            assert!(!notes_or_error("a.toml", &text, true).unwrap_err().contains("this line"), "{text}");
        }
        let unknown = notes_or_error("a.toml", &format!("{object}secret = 1\n"), false).unwrap_err();
        assert!(unknown.starts_with("a.toml:3: expected one of `mesh`, "), "{unknown}");
        assert!(unknown.contains(", but found another key; ") && !unknown.contains("secret"), "{unknown}");
        let number = notes_or_error("a.toml", &format!("{object}flat = 1\n"), false).unwrap_err();
        assert!(number.starts_with("a.toml:3: expected ") && !number.contains("another key"), "{number}");
    }
}
