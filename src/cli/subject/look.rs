//! Options for the view of a mesh or a scene. Each of these options except `--plain` sets a value of the
//! scene.

use crate::cli::choice::number;
use crate::scene::{Setting, Tone};
use toml::Value;

/// The help lists the options of [`Look`] under this heading. Every option names the heading itself: if the group of
/// options had the heading, the heading would also apply to the options after the group.
const HEADING: &str = "View of the scene";
/// The description of a valid angle, for messages about text that is no valid angle.
const DEGREES: &str = "a number of degrees, such as 30";
/// The description of a valid factor, for messages about text that is no valid factor.
const FACTOR: &str = "a number, such as 15";

/// Options for the view of a scene: the camera's direction, the background, the brightness, the normals and `--plain`.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Look {
    /// The axis that points up, in a bare mesh or for the camera of a scene file
    #[arg(long, help_heading = HEADING, value_name = "AXIS", allow_hyphen_values = true, value_parser = ["x", "y", "z", "-x", "-y", "-z"])]
    up: Option<String>,
    /// View the whole scene from this angle to the right of the scene's front [default for a bare mesh without a
    /// camera, or if only --elevation is given: about 31; but a room that lacks a wall is shown through the missing
    /// wall, and a scan of one side of an object from the scanned side]
    #[arg(long, help_heading = HEADING, value_name = "DEGREES", value_parser = number::<f64>(DEGREES))]
    azimuth: Option<f64>,
    /// View the whole scene from this angle above the horizon, -90 to 90 [default for a bare mesh without a
    /// camera, or if only --azimuth is given: about 21; 0 if the mesh is open on one side, like a room without its
    /// front wall]
    #[arg(long, help_heading = HEADING, value_name = "DEGREES", value_parser = number::<f64>(DEGREES))]
    elevation: Option<f64>,
    /// The background: a colour as it appears on the screen (such as '#203040', black or white), or
    /// transparent. With a transparent background, a PNG, APNG or EXR that `raycl render` writes has an alpha
    /// channel; `raycl view` shows a transparent background as black
    #[arg(long, help_heading = HEADING, value_name = "COLOUR")]
    background: Option<String>,
    /// Make the picture brighter or darker: radiance is multiplied by this number before it is displayed [default: 15,
    /// as in the student paper whose experiments raycl repeats; a scene file may set another factor]
    #[arg(long, help_heading = HEADING, value_name = "FACTOR", value_parser = number::<f64>(FACTOR))]
    exposure: Option<f64>,
    /// The tone curve: clip shows all values above white as white; filmic adds contrast in dark parts, and still shows
    /// differences in bright parts [default: clip; a scene file may set another curve]
    #[arg(long, help_heading = HEADING, value_name = "CURVE", value_parser = Tone::NAMES)]
    tone: Option<String>,
    /// For meshes without normals: keep an edge sharp if the normals of its two faces differ by more than DEGREES, 0 to
    /// 180 [default for a bare mesh: 40]
    #[arg(long, help_heading = HEADING, value_name = "DEGREES", value_parser = number::<f64>(DEGREES))]
    crease: Option<f64>,
    /// Reverse the normals of faces that show their back to the viewer, so that back faces are lit like front
    /// faces. With `raycl view` and --turntable, the camera moves, so the faces that show their back differ from
    /// picture to picture: the option then reverses either all normals of the scene or none. For a bare mesh, the
    /// option is on by default; `--set two_sided=false` turns it off
    #[arg(long, help_heading = HEADING)]
    two_sided: bool,
    /// Show a bare mesh without ground, soft light or sky, but with two point lights if its file has no
    /// lights. `raycl render` then casts one sample per pixel, unless --samples or --adaptive is given. For
    /// a scene file, the option has no effect
    #[arg(long, help_heading = HEADING)]
    pub plain: bool,
}

impl Look {
    /// Returns the values of the scene that the options set.
    pub fn values(&self) -> Vec<Setting> {
        let number = |option: &str, value: Option<f64>| {
            value.map(|value| (format!("--{option} {value}"), Value::Float(value)))
        };
        let up = self.up.as_deref().map(|up| (format!("--up {up}"), axis(up)));
        let background = self.background.as_ref();
        let background = background.map(|colour| (format!("--background {colour}"), Value::from(&**colour)));
        let tone = self.tone.as_ref().map(|tone| (format!("--tone {tone}"), Value::from(&**tone)));
        let two_sided = self.two_sided.then(|| ("--two-sided".to_owned(), Value::Boolean(true)));
        let values = [
            ("camera.up", up),
            ("camera.azimuth_degrees", number("azimuth", self.azimuth)),
            ("camera.elevation_degrees", number("elevation", self.elevation)),
            ("background", background),
            ("display.exposure", number("exposure", self.exposure)),
            ("display.tone", tone),
            ("crease", number("crease", self.crease)),
            ("two_sided", two_sided),
        ];
        let setting = |(path, set): (&str, Option<_>)| {
            set.map(|(origin, value)| Setting { path: path.to_owned(), value, origin })
        };
        values.into_iter().filter_map(setting).collect()
    }
}

/// Returns the unit vector along an axis: `x`, `y` or `z`, or `-x`, `-y` or `-z` for the opposite direction.
fn axis(name: &str) -> Value {
    let size = if name.starts_with('-') { -1 } else { 1 };
    let along = |axis: char| Value::Integer(if name.ends_with(axis) { size } else { 0 });
    Value::Array(['x', 'y', 'z'].map(along).to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_with_a_minus_points_the_opposite_way() {
        for (name, up) in [
            ("x", [1, 0, 0]),
            ("y", [0, 1, 0]),
            ("z", [0, 0, 1]),
            ("-x", [-1, 0, 0]),
            ("-y", [0, -1, 0]),
            ("-z", [0, 0, -1]),
        ] {
            let look = Look { up: Some(name.to_owned()), ..Look::default() };
            let up = Value::Array(up.map(Value::Integer).to_vec());
            let origin = format!("--up {name}");
            let [set] = &look.values()[..] else { panic!("{name} sets one value") };
            assert_eq!((set.path.as_str(), &set.value, &set.origin), ("camera.up", &up, &origin));
        }
    }

    #[test]
    fn each_option_sets_a_value_of_its_own_and_is_named_as_its_origin() {
        let look = Look {
            azimuth: Some(1.0),
            elevation: Some(2.5),
            background: Some("white".to_owned()),
            exposure: Some(8.0),
            tone: Some("filmic".to_owned()),
            crease: Some(3.0),
            two_sided: true,
            ..Look::default()
        };
        let set: Vec<_> = look.values().into_iter().map(|set| (set.path, set.value, set.origin)).collect();
        let expected = [
            ("camera.azimuth_degrees", Value::Float(1.0), "--azimuth 1"),
            ("camera.elevation_degrees", Value::Float(2.5), "--elevation 2.5"),
            ("background", Value::from("white"), "--background white"),
            ("display.exposure", Value::Float(8.0), "--exposure 8"),
            ("display.tone", Value::from("filmic"), "--tone filmic"),
            ("crease", Value::Float(3.0), "--crease 3"),
            ("two_sided", Value::Boolean(true), "--two-sided"),
        ];
        let expected = expected.map(|(path, value, origin)| (path.to_owned(), value, origin.to_owned()));
        assert_eq!(set, expected);
        assert!(Look::default().values().is_empty());
    }
}
