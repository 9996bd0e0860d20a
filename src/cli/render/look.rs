//! Options of how a mesh or a scene is seen: each stands for a value of the scene.

use toml::Value;

/// From where, in what, and how.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "How it is seen")]
pub struct Look {
    /// The direction upwards of a bare mesh
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true, value_parser = ["x", "y", "z", "-x", "-y", "-z"])]
    up: Option<String>,
    /// See all of it from this angle in degrees, from its front to the right [default for a bare mesh: 31]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    azimuth: Option<f64>,
    /// See all of it from this high in degrees, -90 to 90 [default for a bare mesh: 21]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    elevation: Option<f64>,
    /// What is seen where nothing is: a display colour such as '#203040', black, white
    #[arg(long, value_name = "COLOUR")]
    background: Option<String>,
    /// Edges of meshes without normals stay sharp from this angle between faces on [default for a bare mesh: 40]
    #[arg(long, value_name = "DEGREES")]
    crease: Option<f64>,
    /// Turn normals to the viewer, as those of a bare mesh are: back faces are lit as fronts
    #[arg(long)]
    two_sided: bool,
}

impl Look {
    /// The values of the scene that the options mean.
    pub fn values(&self) -> Vec<(String, Value)> {
        let number = |value: Option<f64>| value.map(Value::Float);
        let values = [
            ("camera.up", self.up.as_deref().map(axis)),
            ("camera.azimuth_degrees", number(self.azimuth)),
            ("camera.elevation_degrees", number(self.elevation)),
            ("background", self.background.clone().map(Value::String)),
            ("crease", number(self.crease)),
            ("two_sided", self.two_sided.then_some(Value::Boolean(true))),
        ];
        values.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))).collect()
    }
}

/// The unit vector of `x` to `z`, or of its opposite.
fn axis(name: &str) -> Value {
    let size = if name.starts_with('-') { -1 } else { 1 };
    let along = |axis: char| Value::Integer(if name.ends_with(axis) { size } else { 0 });
    Value::Array(['x', 'y', 'z'].map(along).to_vec())
}
