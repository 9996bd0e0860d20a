//! Colours of vertices and faces.

use super::needed::has_number;
use crate::scene::files::colours;
use glam::{Vec3, Vec4};
use ply_rs_bw::ply::{ElementDef, Property, PropertyType, ScalarType};

/// The names of the colour channels of vertices and faces. Each row of this table has the names of red, green and
/// blue. If an element has a number with each name of a row, these three numbers are the element's colour. If this is
/// true of several rows, the first of them counts.
pub(super) const CHANNELS: [[&str; 3]; 3] =
    [["red", "green", "blue"], ["diffuse_red", "diffuse_green", "diffuse_blue"], ["r", "g", "b"]];
/// The name of the alpha channel that belongs to each row of [`CHANNELS`]. If an element lacks the alpha
/// channel of its row, the first of these names counts instead.
const ALPHA: [&str; 3] = ["alpha", "diffuse_alpha", "a"];
/// The names of red, green, blue and alpha by which [`Colour::set`] knows them.
const KNOWN: [&str; 4] = ["red", "green", "blue", "alpha"];

/// The factor by which a channel of the type `ushort` grows if raycl reads it as a number from 0 to 255: 65535 / 255.
const WIDE_TO_BYTES: f64 = 257.0;

/// The largest channel of 16 bits.
const FULL_OF_16_BITS: f64 = 65535.0;
/// The largest channel of 10 bits.
const MOST_OF_TEN_BITS: f64 = 1023.0;

/// Returns the name of a property. The name of a colour channel is converted to lower case, since some
/// programs write `Red`.
pub(super) fn with_lower_case(name: String) -> String {
    let is_channel =
        CHANNELS.as_flattened().iter().chain(&ALPHA).any(|channel| channel.eq_ignore_ascii_case(&name));
    if is_channel { name.to_ascii_lowercase() } else { name }
}

/// Returns the names of red, green, blue and alpha in an element's definition; `None` if the element has no colour.
/// The element may lack alpha.
pub(super) fn channels(element: &ElementDef) -> Option<[&'static str; 4]> {
    let is_complete = |names: &[&str; 3]| names.iter().all(|name| has_number(element, name));
    let row = CHANNELS.iter().position(is_complete)?;
    let [red, green, blue] = CHANNELS[row];
    let alpha = Some(ALPHA[row]).filter(|name| has_number(element, name)).unwrap_or(ALPHA[0]);
    Some([red, green, blue, alpha])
}

/// Returns the element's definition, in which the channels of the element's colour have the names in `KNOWN`. No other
/// property has one of these names, except an `alpha` of an element without a colour. [`Colour::set`] knows
/// only these names, so it does not take a radius `r` for red.
pub(super) fn with_known_channels(element: &ElementDef) -> ElementDef {
    let channels = channels(element);
    let known = |name: String| match channels.and_then(|all| all.iter().position(|own| *own == name)) {
        Some(channel) => KNOWN[channel].to_owned(),
        // In an element without a colour, `alpha` can only be opacity. A note counts such alphas.
        None if channels.is_none() && name == "alpha" => name,
        // No name in a header contains a blank, so the new name occurs only once.
        None if KNOWN.contains(&name.as_str()) => format!("other {name}"),
        None => name,
    };
    let properties = element.properties.clone().into_iter();
    let properties = properties.map(|(name, property)| (known(name), property)).collect();
    ElementDef { properties, ..element.clone() }
}

/// The colour of a vertex or a face, as displayed (sRGB). A channel with full intensity is 1; a file may state
/// channels outside 0 to 1.
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
    /// has this name. Channels have the names in [`KNOWN`], so elements with a colour must be read with the definition
    /// that [`with_known_channels`] returns.
    pub fn set(&mut self, name: &str, property: &Property, value: f64) -> bool {
        let channel = match name {
            "red" => &mut self.channels.x,
            "green" => &mut self.channels.y,
            "blue" => &mut self.channels.z,
            "alpha" => &mut self.alpha,
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
        Property::UShort(_) => FULL_OF_16_BITS,
        Property::Char(_) => 127.0,
        _ => 255.0,
    }
}

/// Checks the range of the colour channels. `element` is the definition of the colours' elements, and `colours` returns
/// the colours.
///
/// Some programs write channels from 0 to 255 in the type `ushort`. If none of these channels is larger than 255, the
/// colours would be almost black, so raycl reads the channels as numbers from 0 to 255, and adds a note. Colours are
/// also almost black if channels of 10 bits or fewer are in the type `ushort`, or if all channels of other whole
/// numbers are at most 1. In these two cases, raycl changes no colour. It adds a note if red, green and blue have the
/// same range.
///
/// raycl reads channels that are not whole numbers as numbers from 0 to 255 if one of them is clearly above 1
/// ([`check_floats`]).
pub(super) fn check_range<'a>(
    element: &ElementDef,
    colours: impl FnOnce() -> Vec<&'a mut Colour>,
) -> Option<String> {
    let kinds = channel_types(element)?;
    let is_wide = kinds.map(|kind| kind == Some(&ScalarType::UShort));
    if is_wide.contains(&true) {
        return check_wide(is_wide, colours());
    }
    let is_float = kinds.map(|kind| matches!(kind, Some(ScalarType::Float | ScalarType::Double)));
    if is_float[..3] == [true; 3] {
        return check_floats(is_float[3], colours());
    }
    let [red, green, blue, _] = kinds.map(|kind| kind.and_then(full_of_whole));
    let full = red.filter(|_| red == green && red == blue)?;
    let largest = colours().iter().map(|colour| colour.channels.max_element()).fold(0.0, f32::max);
    (largest > 0.0 && largest <= (1.0 / full) as f32).then(|| doubtful(full, 1.0))
}

/// Divides channels that are not whole numbers by 255 if one of them is so large that raycl reads all of them as
/// numbers from 0 to 255, as in an OBJ ([`colours::full_channel`]). `has_alpha` is true if alpha has such a type, too.
fn check_floats(has_alpha: bool, mut all: Vec<&mut Colour>) -> Option<String> {
    let largest = |channel: fn(&Colour) -> f32| all.iter().map(|colour| channel(colour)).fold(0.0, f32::max);
    let brightest = largest(|colour| colour.channels.max_element());
    let alpha = if has_alpha { largest(|colour| colour.alpha) } else { 0.0 };
    let [full, opaque] = [brightest, alpha].map(colours::full_channel);
    for colour in &mut all {
        colour.channels /= full;
        colour.alpha /= opaque;
    }
    colours::note_bytes(brightest)
}

/// Checks the range of colours of which some channels have the type `ushort`: those for which `is_wide` is true.
fn check_wide(is_wide: [bool; 4], mut colours: Vec<&mut Colour>) -> Option<String> {
    let largest = colours.iter().map(|colour| colour.channels.extend(colour.alpha));
    let largest = largest.fold(Vec4::ZERO, Vec4::max).to_array();
    let most = (1.0 / WIDE_TO_BYTES) as f32;
    let is_coloured = is_wide[..3].contains(&true);
    let wide = (0..3).filter(|channel| is_wide[*channel]).map(|channel| largest[channel]).fold(0.0, f32::max);
    if is_coloured && (wide == 0.0 || wide > most) {
        let is_doubtful = wide > 0.0 && wide <= (MOST_OF_TEN_BITS / FULL_OF_16_BITS) as f32;
        let are_all = is_wide[..3] == [true; 3];
        return (is_doubtful && are_all).then(|| doubtful(FULL_OF_16_BITS, MOST_OF_TEN_BITS));
    }
    let factor = |channel: usize| match is_wide[channel] && largest[channel] <= most {
        true => WIDE_TO_BYTES as f32,
        false => 1.0,
    };
    let [red, green, blue, alpha] = [0, 1, 2, 3].map(factor);
    for colour in &mut colours {
        colour.channels *= Vec3::new(red, green, blue);
        colour.alpha *= alpha;
    }
    let kind = if is_wide[..3] == [true; 3] { "" } else { " of the type ushort" };
    is_coloured.then(|| {
        format!(
            "channels of colours{kind} are read as numbers from 0 to 255, not to 65535, since none is larger \
             than 255"
        )
    })
}

/// Returns the note on colours that are almost black, since no channel is larger than `most`.
fn doubtful(full: f64, most: f64) -> String {
    format!("channels of colours are read as numbers from 0 to {full}, but none is larger than {most}")
}

/// Returns the value of a channel at full intensity, if channels of this type are whole numbers.
fn full_of_whole(kind: &ScalarType) -> Option<f64> {
    match kind {
        ScalarType::Float | ScalarType::Double => None,
        ScalarType::UShort => Some(FULL_OF_16_BITS),
        ScalarType::Char => Some(127.0),
        _ => Some(255.0),
    }
}

/// Returns the types of an element's red, green, blue and alpha; `None` if there is no colour. The type of a missing
/// alpha is `None`.
fn channel_types(element: &ElementDef) -> Option<[Option<&ScalarType>; 4]> {
    let kind = |name: &str| match &element.properties.get(name)?.data_type {
        PropertyType::Scalar(kind) => Some(kind),
        PropertyType::List(..) => None,
    };
    Some(channels(element)?.map(kind))
}
