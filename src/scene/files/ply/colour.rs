//! Colours of vertices and faces.

use crate::scene::files::colours;
use glam::Vec3;
use ply_rs_bw::ply::Property;

/// The names of the colour channels of vertices and faces. Each row of this table has a name for red, green
/// and blue; a file uses the names of one row.
pub(super) const CHANNELS: [[&str; 3]; 3] =
    [["red", "green", "blue"], ["diffuse_red", "diffuse_green", "diffuse_blue"], ["r", "g", "b"]];
/// The names of the alpha channel.
const ALPHA: [&str; 3] = ["alpha", "diffuse_alpha", "a"];

/// Returns the name of a property. The name of a colour channel is converted to lower case, since some
/// programs write `Red`.
pub(super) fn with_lower_case(name: String) -> String {
    let is_channel =
        CHANNELS.as_flattened().iter().chain(&ALPHA).any(|channel| channel.eq_ignore_ascii_case(&name));
    if is_channel { name.to_ascii_lowercase() } else { name }
}

/// The colour of a vertex or a face, as displayed; each channel is from 0 to 1.
pub(super) struct Colour {
    channels: Vec3,
    alpha: f32,
}

impl Colour {
    /// Returns opaque black, the colour of an element without channels.
    pub fn new() -> Self {
        Self { channels: Vec3::ZERO, alpha: 1.0 }
    }

    /// Sets the channel `name` from the value `value` of the property `property`. Returns true if a channel
    /// has this name.
    pub fn set(&mut self, name: &str, property: &Property, value: f64) -> bool {
        let channel = match name {
            "red" | "diffuse_red" | "r" => &mut self.channels.x,
            "green" | "diffuse_green" | "g" => &mut self.channels.y,
            "blue" | "diffuse_blue" | "b" => &mut self.channels.z,
            "alpha" | "diffuse_alpha" | "a" => &mut self.alpha,
            _ => return false,
        };
        *channel = (value / full_channel(property)) as f32;
        true
    }

    /// Returns the colour in linear light.
    pub fn linear(&self) -> Vec3 {
        self.channels.map(colours::linear)
    }

    pub fn is_clear(&self) -> bool {
        self.alpha < 1.0
    }
}

/// Returns the value of a channel at full intensity, which depends on the property's type. Channels of the
/// types `short`, `int` and `uint` have values from 0 to 255.
fn full_channel(property: &Property) -> f64 {
    match property {
        Property::Float(_) | Property::Double(_) => 1.0,
        Property::UShort(_) => 65535.0,
        Property::Char(_) => 127.0,
        _ => 255.0,
    }
}
