//! `--set camera.position=[0,0,1]`: changes values in the TOML of a scene file before the scene is built.

use super::setting::Setting;
use crate::error::{Result, shortened};
use crate::words::counted;
use toml::{Table, Value};

/// The help in an error about a path that cannot be set.
pub(super) const PATHS: &str = "a path is names and indices joined by dots: camera.position, light.0.power";

/// The camera's keys for the angles from which the camera shows the whole scene.
const ANGLES: [&str; 2] = ["azimuth_degrees", "elevation_degrees"];
/// The camera's keys for its position, direction and field of view.
const POSE_AND_FOV: [&str; 4] = ["position", "look_at", FOV[0], FOV[1]];
/// The camera's keys for its field of view.
const FOV: [&str; 2] = ["fov_x_degrees", "fov_y_degrees"];

/// Sets the value at each dotted path. A number in a path is an index of an array, from 0. The index after the last
/// element adds an element: in a scene without lights, `light.0.power` adds a light. With a setting of the camera's
/// azimuth or elevation, the camera shows the whole scene. A setting of the azimuth or the elevation therefore removes
/// the camera's position, direction and field of view from the scene's table. Settings before and after the angle may
/// set the direction and the field of view again. The animation's tracks of the camera stay in the table, since the
/// paths in settings and messages refer to tracks by their indices. `Animation::of` leaves out the tracks of the
/// camera. Returns an error in three cases: a path cannot be set; one setting sets an angle of the camera, and another
/// setting sets its position; or a setting replaces the whole camera after an angle was set.
pub(super) fn apply(document: &mut Table, settings: &[Setting]) -> Result<()> {
    refuse_angle_beside_position(settings)?;
    refuse_camera_after_angle(settings)?;
    if have_angle(settings) {
        remove_pose_and_fov(document);
    }
    for setting in settings {
        let Setting { path, value, .. } = setting;
        set(document, path, value).map_err(|reason| setting.error(reason).with_help(PATHS))?;
    }
    Ok(())
}

/// Returns true if one of the settings sets the camera's azimuth or elevation.
pub(super) fn have_angle(settings: &[Setting]) -> bool {
    settings.iter().any(|setting| is_angle(&setting.path))
}

/// Returns true if a value at this path is the camera's azimuth or elevation.
pub(super) fn is_angle(path: &str) -> bool {
    path.strip_prefix("camera.").is_some_and(|key| ANGLES.contains(&key))
}

/// Returns true if `value` at the path `path` sets the camera's position or a part of the position.
pub(super) fn sets_camera_position(path: &str, value: &Value) -> bool {
    match path.split_once('.') {
        None => path == "camera" && value.get("position").is_some(),
        Some((table, key)) => table == "camera" && key.split('.').next() == Some("position"),
    }
}

/// Refuses an azimuth or elevation if another setting sets the camera's position: the position would replace the
/// place that follows from the angle.
fn refuse_angle_beside_position(settings: &[Setting]) -> Result<()> {
    let angle = settings.iter().find(|setting| is_angle(&setting.path));
    let position = settings.iter().find(|setting| sets_camera_position(&setting.path, &setting.value));
    let Some((angle, position)) = angle.zip(position) else { return Ok(()) };
    let message =
        format!("this angle and '{}' both place the camera; expected only one of them", position.origin);
    Err(angle.error(message).with_help("leave out the angle or the position"))
}

/// Refuses an azimuth or elevation if a later setting replaces the whole camera, and with it the angle.
fn refuse_camera_after_angle(settings: &[Setting]) -> Result<()> {
    let mut from_angle = settings.iter().skip_while(|setting| !is_angle(&setting.path));
    let Some((angle, camera)) = from_angle.next().zip(from_angle.find(|setting| setting.path == "camera"))
    else {
        return Ok(());
    };
    let message = format!("'{}' replaces the whole camera, and with it this angle", camera.origin);
    Err(angle
        .error(message)
        .with_help("set the camera's other values one by one, for example camera.fov_y_degrees"))
}

/// Returns a note if the setting of an angle removes the field of view of the scene `document`, and no setting sets a
/// field of view. (There is no note on the position and the direction, since a user who sets an angle wants to
/// replace them.)
pub(super) fn note_removed_fov(document: &Table, settings: &[Setting]) -> Option<String> {
    let angle = settings.iter().find(|setting| is_angle(&setting.path))?;
    let is_fov = |path: &str| path.strip_prefix("camera.").is_some_and(|key| FOV.contains(&key));
    let sets_fov = |setting: &Setting| setting.path == "camera" || is_fov(&setting.path);
    let camera = document.get("camera").filter(|_| !settings.iter().any(sets_fov))?;
    let key = FOV.into_iter().find(|key| camera.get(key).is_some())?;
    let origin = shortened(&*angle.origin);
    Some(format!("{origin} removes the scene's `{key}`; to keep it, also set camera.{key}"))
}

/// Removes the camera's position, direction and field of view.
fn remove_pose_and_fov(document: &mut Table) {
    if let Some(Value::Table(camera)) = document.get_mut("camera") {
        POSE_AND_FOV.iter().for_each(|key| drop(camera.remove(*key)));
    }
}

/// Returns true if a track with this path, such as `camera.look_at.1` or `camera`, changes the camera's
/// position, direction, field of view or one of its angles.
pub(super) fn moves_camera(path: &str) -> bool {
    let mut names = path.split('.');
    let moves = |name: &str| POSE_AND_FOV.contains(&name) || ANGLES.contains(&name);
    names.next() == Some("camera") && names.next().is_none_or(moves)
}

/// Sets the value at one dotted path. The text of an error states the reason, but not the whole path.
pub(super) fn set(document: &mut Table, path: &str, value: &Value) -> std::result::Result<(), String> {
    let keys: Vec<&str> = path.split('.').collect();
    if keys.iter().any(|key| key.is_empty()) {
        return Err("a name in the path is empty (two dots in a row, or a dot at an end)".to_owned());
    }
    set_in_table(document, &keys, value)
}

fn set_in_table(table: &mut Table, keys: &[&str], value: &Value) -> std::result::Result<(), String> {
    match keys {
        [] => Ok(()),
        [key] => {
            table.insert((*key).to_owned(), value.clone());
            Ok(())
        }
        [key, rest @ ..] => {
            let inner = table.entry((*key).to_owned()).or_insert_with(|| container(rest));
            set_in_value(inner, key, rest, value)
        }
    }
}

fn set_in_value(
    target: &mut Value,
    name: &str,
    keys: &[&str],
    value: &Value,
) -> std::result::Result<(), String> {
    match target {
        Value::Table(table) => set_in_table(table, keys, value),
        Value::Array(array) => set_in_array(array, name, keys, value),
        _ => Err(format!("`{name}` is of the type {}, which has no keys", target.type_str())),
    }
}

fn set_in_array(
    array: &mut Vec<Value>,
    name: &str,
    keys: &[&str],
    value: &Value,
) -> std::result::Result<(), String> {
    let [key, rest @ ..] = keys else { return Ok(()) };
    let count = array.len();
    // An index with a sign or with leading zeros is refused, so that no element has two paths.
    let parsed = key.parse::<usize>().ok().filter(|index| *index <= count);
    let index = parsed.filter(|index| index.to_string() == *key).ok_or_else(|| {
        let range = match count {
            0 => "the index 0, which adds an element".to_owned(),
            _ => format!("an index from 0 to {count} ({count} adds an element)"),
        };
        let plain = parsed.map_or(String::new(), |index| format!("; write `{index}` instead"));
        format!("`{name}` has {}; expected {range}, not `{key}`{plain}", counted(count, "element"))
    })?;
    if rest.is_empty() {
        match array.get_mut(index) {
            Some(element) => *element = value.clone(),
            None => array.push(value.clone()),
        }
        return Ok(());
    }
    if index == count {
        array.push(container(rest));
    }
    set_in_value(&mut array[index], key, rest, value)
}

/// Returns an empty container in which a value at the path `rest` can be set: an array if the first key in
/// `rest` is a number, otherwise a table.
fn container(rest: &[&str]) -> Value {
    match rest.first().map(|key| key.parse::<usize>()) {
        Some(Ok(_)) => Value::Array(Vec::new()),
        _ => Value::Table(Table::new()),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn set(path: &str, value: i64) -> Result<String> {
        let mut document: Table = "[camera]\nz_near = 0.1\n[[light]]\npower = 1".parse().unwrap();
        apply(&mut document, &[Setting::new(path, Value::Integer(value))])?;
        Ok(toml::to_string(&document).unwrap())
    }

    #[test]
    fn paths_reach_into_tables_and_arrays_and_make_what_is_absent() {
        assert!(set("camera.z_near", 2).unwrap().contains("z_near = 2"));
        assert!(set("light.0.power", 7).unwrap().contains("power = 7"));
        assert_eq!(set("light.1.power", 7).unwrap().matches("[[light]]").count(), 2);
        assert!(set("display.exposure", 3).unwrap().contains("[display]\nexposure = 3"));
        assert!(set("object.0.normals.0", 3).unwrap().contains("[[object]]\nnormals = [3]"));
    }

    #[test]
    fn an_angle_removes_the_files_pose_and_field_of_view_but_not_what_is_set_beside_it() {
        let own = "camera = { position = [1, 2, 3], look_at = [0, 0, 0], fov_y_degrees = 60, z_near = 0.5 }";
        let set = |paths: &[&str]| {
            let mut document: Table = own.parse().unwrap();
            let values: Vec<_> = paths.iter().map(|path| Setting::new(path, Value::Integer(20))).collect();
            apply(&mut document, &values).unwrap();
            let Some(Value::Table(camera)) = document.remove("camera") else { panic!("no camera") };
            camera.into_iter().map(|(key, _)| key).collect::<Vec<_>>()
        };
        assert_eq!(set(&["camera.azimuth_degrees"]), ["azimuth_degrees", "z_near"]);
        let [angle, fov, target] = ["camera.elevation_degrees", "camera.fov_x_degrees", "camera.look_at"];
        for paths in [[angle, fov, target], [fov, angle, target], [target, fov, angle]] {
            let expected = ["elevation_degrees", "fov_x_degrees", "look_at", "z_near"];
            assert_eq!(set(&paths), expected, "{paths:?}");
        }
        let both = set(&[fov, angle, "camera.azimuth_degrees"]);
        assert_eq!(both, ["azimuth_degrees", "elevation_degrees", "fov_x_degrees", "z_near"]);
    }

    #[test]
    fn an_angle_beside_a_position_is_refused() {
        let applied = |settings: &[(&str, Value)]| {
            let settings: Vec<_> =
                settings.iter().map(|(path, value)| Setting::new(path, value.clone())).collect();
            apply(&mut Table::new(), &settings).map_err(|error| error.to_string())
        };
        let one = |path| (path, Value::Integer(1));
        let camera =
            |key: &str| ("camera", Value::Table(Table::from_iter([(key.to_owned(), Value::Integer(1))])));
        for position in [one("camera.position"), one("camera.position.0"), camera("position")] {
            for angle in ["camera.azimuth_degrees", "camera.elevation_degrees"] {
                let (path, value) = &position;
                let expected = format!(
                    "{angle} = 1: this angle and '{path} = {value}' both place the camera; expected only one of them"
                );
                assert_eq!(applied(&[one(angle), position.clone()]), Err(expected.clone()));
                assert_eq!(applied(&[position.clone(), one(angle)]), Err(expected));
            }
            assert_eq!(applied(&[position, one("camera.look_at")]), Ok(()));
        }
        let angle = one("camera.azimuth_degrees");
        assert_eq!(applied(&[angle.clone(), one("camera.look_at"), one("camera.up")]), Ok(()));
        assert_eq!(applied(&[camera("up"), angle.clone()]), Ok(()));
        let expected = "camera.azimuth_degrees = 1: 'camera = { up = 1 }' replaces the whole camera, and with it this angle";
        assert_eq!(applied(&[angle, camera("up")]), Err(expected.to_owned()));
    }

    #[test]
    fn an_angle_removes_what_moves_the_camera() {
        for path in ["camera", "camera.position", "camera.look_at.1", "camera.fov_x_degrees"] {
            assert!(moves_camera(path), "{path}");
        }
        assert!(ANGLES.iter().all(|angle| moves_camera(&format!("camera.{angle}"))));
        for path in ["camera.z_near", "camera.up", "light.0.position", "object.0.position"] {
            assert!(!moves_camera(path), "{path}");
        }
    }

    #[test]
    fn an_angle_that_removes_the_field_of_view_is_noted_unless_another_is_set() {
        let noted = |camera: &str, paths: &[&str]| {
            let settings: Vec<_> = paths.iter().map(|path| Setting::new(path, Value::Integer(9))).collect();
            note_removed_fov(&camera.parse().unwrap(), &settings)
        };
        let (scene, azimuth) = ("[camera]\nlook_at = 0\nfov_y_degrees = 20", "camera.azimuth_degrees");
        let expected = "camera.azimuth_degrees = 9 removes the scene's `fov_y_degrees`; to keep it, \
                        also set camera.fov_y_degrees";
        assert_eq!(noted(scene, &["camera.up", azimuth]).as_deref(), Some(expected));
        let silent = [
            (scene, &["camera.up"][..]),
            (scene, &[azimuth, "camera.fov_x_degrees"]),
            ("[camera]\nlook_at = 0", &[azimuth]),
            ("name = 'a'", &[azimuth]),
        ];
        for (camera, paths) in silent {
            assert_eq!(noted(camera, paths), None, "{camera} {paths:?}");
        }
    }

    #[test]
    fn an_angle_removes_no_track_so_that_each_keeps_its_index() {
        let text =
            "[[animation.track]]\npath = 'camera.position'\n[[animation.track]]\npath = 'light.0.power'\n";
        let mut document: Table = text.parse().unwrap();
        let angle = Setting::new("camera.azimuth_degrees", Value::Integer(90));
        apply(&mut document, &[angle, Setting::new("animation.track.1.at", Value::Integer(7))]).unwrap();
        let tracks = document["animation"]["track"].as_array().unwrap();
        assert_eq!((tracks.len(), tracks[0].get("at"), &tracks[1]["at"]), (2, None, &Value::Integer(7)));
    }

    #[test]
    fn a_path_through_a_number_or_out_of_an_array_is_refused() {
        for path in [
            "camera.z_near.x",
            "light.2.power",
            "light.first.power",
            "light.00.power",
            "light.+0.power",
            "camera..x",
        ] {
            let message = set(path, 1).unwrap_err().to_string();
            assert!(message.starts_with(&format!("{path} = 1: ")), "{message}");
        }
        let message = set("light.2.power", 1).unwrap_err().to_string();
        let expected = "`light` has 1 element; expected an index from 0 to 1 (1 adds an element), not `2`";
        assert!(message.ends_with(expected), "{message}");
        let message = set("camera.z_near.x", 1).unwrap_err().to_string();
        assert!(message.ends_with("`z_near` is of the type float, which has no keys"), "{message}");
    }
}
