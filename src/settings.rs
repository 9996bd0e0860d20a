//! The user's own settings in `~/.config/raycl/config.toml`. A setting applies only if neither an option nor an
//! environment variable sets the same value.

use std::ffi::OsString;
use std::fs::Metadata;
use std::io::{Error as IoError, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use serde::Deserialize;
use toml::Spanned;

use crate::cache;
use crate::cli::colour::Colour;
use crate::device_lock;
use crate::error::{Error, Result, broken_link};
use crate::experiment::check_moved_samples;
use crate::reader::{self, Kind};
use crate::toml_error::toml_error;
use crate::toml_read::from_text;
use crate::xdg;

/// The environment variable that names the default device.
pub const DEVICE: &str = "RAYCL_DEVICE";
/// The environment variable that names the folder in which runs create their folders of results.
const RESULTS: &str = "RAYCL_RESULTS";
/// The remedy for a folder of results that cannot be found.
const FOLDER: &str =
    "give an absolute path, such as /home/me/results, or a path relative to the current folder";
/// The remedy for a mistake in the settings file.
const KEYS: &str = "the keys are device, color (auto, always or never) and results; README.md explains them";

/// The keys of the settings file, with their values.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Wire {
    device: Option<Spanned<String>>,
    color: Option<Colour>,
    results: Option<Spanned<String>>,
}

/// The settings, with the file's text for messages.
#[derive(Debug, Default)]
struct Settings {
    name: String,
    text: String,
    wire: Wire,
}

static USER: OnceLock<Settings> = OnceLock::new();

/// Reads the user's settings file, if there is one, and checks raycl's environment variables. Call this function once,
/// before any setting is used.
///
/// # Errors
///
/// Returns an input error if the file cannot be read or contains a mistake, or if the value of an environment
/// variable cannot be used. The error names the variable, or the file with the line of the mistake. If a name
/// in the file is unknown, the error also has the most similar valid name. After an error in the file, no
/// settings of the file apply.
pub fn load() -> Result<()> {
    if let Some(folder) = xdg::folder("XDG_CONFIG_HOME", ".config") {
        let settings = read(&folder.join("config.toml"))?;
        // If `load` was called before, the earlier settings stay.
        let _ = USER.set(settings);
    }
    check_variables()
}

/// Checks raycl's environment variables, so that no wrong value is ignored.
///
/// # Errors
///
/// Returns an input error if the value of an environment variable cannot be used. The error names the variable.
pub fn check_variables() -> Result<()> {
    for name in [DEVICE, RESULTS] {
        refuse_other_than_utf8(name, std::env::var_os(name))?;
    }
    if let Some(Err(message)) = variable(RESULTS).map(|path| xdg::expanded(Path::new(&path))) {
        return Err(Error::input(format!("{RESULTS}: {message}")).with_help(FOLDER));
    }
    cache::check_limit()?;
    check_moved_samples()?;
    device_lock::check_folder()
}

/// Returns an error if the value of an environment variable is not UTF-8: without the error, raycl would
/// ignore the value.
fn refuse_other_than_utf8(name: &str, value: Option<OsString>) -> Result<()> {
    let Some(value) = value.filter(|value| value.to_str().is_none()) else { return Ok(()) };
    let message = format!("{name}: the value '{}' is not UTF-8", value.to_string_lossy());
    Err(Error::input(message).with_help(format!("set {name} to UTF-8 text, or unset it")))
}

fn read(path: &Path) -> Result<Settings> {
    let text = match reader::text(path, Kind::Toml) {
        Ok(text) => text,
        Err(error) => return without_text(path, &error),
    };
    let name = path.display().to_string();
    let wire: Wire = from_text(&text).map_err(|error| toml_error(&name, &text, &error, KEYS))?;
    let settings = Settings { name, text, wire };
    for value in settings.wire.device.iter().chain(&settings.wire.results) {
        if value.get_ref().trim().is_empty() {
            return Err(settings
                .error(value, "the setting is empty".to_owned())
                .with_help("set a value, or remove the line"));
        }
    }
    if let Some(results) = &settings.wire.results {
        xdg::expanded(Path::new(results.get_ref()))
            .map_err(|message| settings.error(results, message).with_help(FOLDER))?;
    }
    Ok(settings)
}

/// Returns the settings of a user without a settings file. Returns an error in two cases: there is a settings file, but
/// it could not be read because of `error`; or the file, or one of the two folders above it, is a link whose target is
/// missing.
fn without_text(path: &Path, error: &IoError) -> Result<Settings> {
    if let Some((link, why)) = path.ancestors().take(3).find_map(|link| Some((link, broken_link(link)?))) {
        return Err(Error::input(format!("your settings: {} {why}", link.display()))
            .with_help("restore the link's target, or remove the link"));
    }
    if is_out_of_reach(error, path.symlink_metadata()) {
        return Ok(Settings::default());
    }
    Err(Error::unreadable("settings", path, error, "make it a readable TOML file, or remove it"))
}

/// Returns true if `error`, from opening the settings file, means that this user has no settings file. The
/// user has no settings file if the file does not exist. The settings file also counts as missing if a part
/// of its path is a file instead of a folder: services often have the home folder /dev/null. The settings
/// file also counts as missing if it is in a folder in which this user may not look up files, such as another
/// user's home folder. `metadata` is the settings file's metadata, or the error from reading the metadata.
fn is_out_of_reach(error: &IoError, metadata: std::io::Result<Metadata>) -> bool {
    let is_denied = |error: &IoError| error.kind() == ErrorKind::PermissionDenied;
    matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory)
        || is_denied(error) && metadata.is_err_and(|error| is_denied(&error))
}

impl Settings {
    fn error(&self, at: &Spanned<String>, message: String) -> Error {
        Error::in_file(&self.name, self.text.as_str(), at.span(), message, "here")
    }
}

fn user() -> &'static Settings {
    static NONE: OnceLock<Settings> = OnceLock::new();
    USER.get().unwrap_or_else(|| NONE.get_or_init(Settings::default))
}

/// Returns an environment variable's value; `None` if the variable is not set, or if the value is blank.
fn variable(name: &str) -> Option<String> {
    filled(std::env::var(name).ok())
}

/// Returns the value; `None` if the value is blank.
fn filled(value: Option<String>) -> Option<String> {
    value.filter(|text| !text.trim().is_empty())
}

/// Returns the settings file's choice of when to use colours; `None` if the file has no such choice.
pub fn colour() -> Option<Colour> {
    user().wire.color
}

/// Returns the folder in which runs create their folders: `results` by default.
pub fn results() -> PathBuf {
    let set = || user().wire.results.as_ref().map(|path| path.get_ref().clone());
    let path = PathBuf::from(variable(RESULTS).or_else(set).unwrap_or_else(|| "results".to_owned()));
    // `load` has refused a path that cannot be expanded.
    xdg::expanded(&path).unwrap_or(path)
}

/// Returns the name of the default device, from the environment or the settings file. The default device applies if the
/// command names no device.
pub fn device() -> Option<String> {
    variable(DEVICE).or_else(|| user().wire.device.as_ref().map(|word| word.get_ref().clone()))
}

/// Returns the name of the source of the default device: the environment variable or the settings file.
/// Returns `None` if neither the variable nor the file names a device.
pub fn device_origin() -> Option<&'static str> {
    origin(variable(DEVICE).is_some(), user().wire.device.is_some())
}

/// Returns the name of the environment variable, or the words "your settings file", depending on which of
/// them names the default device. `in_environment` is true if the environment variable names a device, and
/// `in_file` is true if the settings file names one. If both name a device, the environment variable takes
/// precedence over the settings file.
fn origin(in_environment: bool, in_file: bool) -> Option<&'static str> {
    in_environment.then_some(DEVICE).or(in_file.then_some("your settings file"))
}

/// Returns `error`, an error about the default device, with the name of the environment variable or the
/// position in the settings file that names this device.
pub fn blame_device(error: Error) -> Error {
    error.placed(|message| match (variable(DEVICE), &user().wire.device) {
        (None, Some(word)) => user().error(word, message),
        (Some(_), _) => Error::input(format!("{DEVICE}: {message}")),
        (None, None) => Error::input(message),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Settings> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("config.toml");
        std::fs::write(&path, text).expect("a file");
        read(&path)
    }

    #[test]
    fn a_file_is_read_and_none_is_no_mistake() {
        let read = read_text("device = \"cpu\"\ncolor = \"never\"\nresults = \"~/r\"\n").expect("settings");
        assert_eq!(read.wire.color, Some(Colour::Never));
        assert_eq!(read.wire.device.map(Spanned::into_inner).as_deref(), Some("cpu"));
        assert!(super::read(Path::new("/no/such/file")).expect("no settings").wire.device.is_none());
    }

    #[test]
    fn a_file_out_of_reach_is_no_mistake_and_one_that_may_not_be_read_is() {
        assert!(super::read(Path::new("/dev/null/raycl/config.toml")).expect("no settings").text.is_empty());
        let denied = || IoError::from(ErrorKind::PermissionDenied);
        let known = || Path::new("/").metadata();
        assert!(is_out_of_reach(&denied(), Err(denied())));
        assert!(!is_out_of_reach(&denied(), known()));
        assert!(!is_out_of_reach(&IoError::from(ErrorKind::IsADirectory), known()));
    }

    #[cfg(unix)]
    #[test]
    fn a_file_or_a_folder_that_is_a_broken_link_is_a_mistake() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().expect("a folder");
        let [own, gone] = ["own", "gone"].map(|name| folder.path().join(name).join("config.toml"));
        std::fs::create_dir(folder.path().join("own")).expect("a folder");
        symlink("nothing.toml", &own).expect("a link");
        symlink("nowhere", folder.path().join("gone")).expect("a link");
        for (path, part) in
            [(&own, "config.toml is a link to `nothing.toml`"), (&gone, "gone is a link to `nowhere`")]
        {
            let error = read(path).expect_err("a broken link");
            assert!(error.to_string().ends_with(&format!("{part}, which is missing")), "{error}");
            assert!(error.remedy().ends_with("remove the link"), "{}", error.remedy());
        }
        assert!(read(&folder.path().join("none/config.toml")).expect("no settings").text.is_empty());
    }

    #[cfg(unix)]
    #[test]
    fn a_variable_that_is_not_utf8_is_refused_by_its_name() {
        use std::os::unix::ffi::OsStringExt as _;
        let error = refuse_other_than_utf8(DEVICE, Some(OsString::from_vec(vec![b'x', 0xff])));
        let error = error.expect_err("it is not UTF-8");
        assert_eq!(
            (error.to_string().as_str(), error.exit_code()),
            ("RAYCL_DEVICE: the value 'x\u{fffd}' is not UTF-8", 2)
        );
        assert!(
            [None, Some("é".into())].into_iter().all(|value| refuse_other_than_utf8(DEVICE, value).is_ok())
        );
    }

    #[test]
    fn mistakes_have_file_line_and_the_nearest_name() {
        for (text, parts) in [
            ("# mine\ndevise = \"cpu\"\n", ["config.toml:2", "devise", "did you mean `device`", "results"]),
            ("color = \"nevr\"\n", ["config.toml:1", "nevr", "did you mean `never`", "always"]),
            ("device = 3\n", ["config.toml:1", "wrong type: integer", "expected a string", "the keys are"]),
            ("color = {}\n", ["config.toml:1", "wrong type: table", "expected a string", "the keys are"]),
            ("[color]\n", ["config.toml:1", "wrong type: table", "expected a string", "the keys are"]),
            ("color = {a=1, b=2}\n", ["config.toml:1", "wrong type: table", "expected a string", "the keys"]),
            ("results = \"~me/r\"\n", ["config.toml:1", "only `~` alone", "results", "an absolute path"]),
            ("results = \"$HOME/r\"\n", ["config.toml:1", "only `~` alone", "results", "an absolute path"]),
            ("device = \" \"\n", ["config.toml:1", "the setting is empty", "set a value", "remove the line"]),
            ("\nresults = \"\"\n", ["config.toml:2", "the setting is empty", "results", "remove the line"]),
        ] {
            let error = read_text(text).expect_err(text);
            assert_eq!(error.exit_code(), 2);
            let report = format!("{:?}", miette::Report::new(error));
            parts.iter().for_each(|part| assert!(report.contains(part), "{part}: {report}"));
        }
    }

    #[test]
    fn a_blank_variable_is_not_set() {
        for blank in ["", " ", "\t"] {
            assert_eq!(filled(Some(blank.to_owned())), None);
        }
        assert_eq!(filled(Some("cpu".to_owned())).as_deref(), Some("cpu"));
    }

    #[test]
    fn the_default_device_is_that_of_the_environment_and_then_that_of_the_file() {
        assert_eq!([origin(true, true), origin(true, false)], [Some(DEVICE); 2]);
        assert_eq!([origin(false, true), origin(false, false)], [Some("your settings file"), None]);
    }
}
