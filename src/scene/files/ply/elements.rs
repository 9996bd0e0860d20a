//! The elements of a PLY file: vertices, faces and strips. The readers of ASCII and binary files pass the
//! properties of an element to its method `set_property`, one after the other.

use super::colour::Colour;
use crate::words::counted;
use glam::{DVec3, Vec3};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

/// The names by which the components of a vertex's normal are read.
pub(super) const NORMAL: [&str; 3] = ["nx", "ny", "nz"];
/// Other names of the components of a vertex's normal, which some programs write. Capital letters in these names do
/// not matter.
const OTHER_NORMAL: [&str; 3] = ["normal_x", "normal_y", "normal_z"];

/// Returns the name of a property. Another spelling of a name in [`NORMAL`], such as `NX` or `normal_x`, is replaced by
/// the name in this list.
pub(super) fn with_usual_normal(name: String) -> String {
    let is_same =
        |(usual, other): &(&str, &str)| [usual, other].iter().any(|own| own.eq_ignore_ascii_case(&name));
    let usual = NORMAL.into_iter().zip(OTHER_NORMAL).find(is_same);
    usual.map_or(name, |(usual, _)| usual.to_owned())
}

/// A vertex. A property that the file does not have stays 0; a missing alpha stays 1.
pub(super) struct Vertex {
    pub position: DVec3,
    pub normal: Vec3,
    pub colour: Colour,
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self { position: DVec3::ZERO, normal: Vec3::ZERO, colour: Colour::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let Some(value) = number(&property) else { return PropertyAccessResult::Ignored };
        match name {
            "x" => self.position.x = value,
            "y" => self.position.y = value,
            "z" => self.position.z = value,
            "nx" => self.normal.x = value as f32,
            "ny" => self.normal.y = value as f32,
            "nz" => self.normal.z = value as f32,
            _ if self.colour.set(name, &property, value) => {}
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// Returns the value of a property that is a number; `None` for a list.
fn number(property: &Property) -> Option<f64> {
    Some(match property {
        Property::Char(value) => f64::from(*value),
        Property::UChar(value) => f64::from(*value),
        Property::Short(value) => f64::from(*value),
        Property::UShort(value) => f64::from(*value),
        Property::Int(value) => f64::from(*value),
        Property::UInt(value) => f64::from(*value),
        Property::Float(value) => f64::from(*value),
        Property::Double(value) => *value,
        _ => return None,
    })
}

/// The indices of the vertices of a face or a strip; `None` if the element has no such list.
pub(super) struct Face(Option<Property>);

impl Face {
    fn numbers(&self) -> Vec<i64> {
        match &self.0 {
            Some(Property::ListChar(list)) => list.iter().map(|&i| i.into()).collect(),
            Some(Property::ListUChar(list)) => list.iter().map(|&i| i.into()).collect(),
            Some(Property::ListShort(list)) => list.iter().map(|&i| i.into()).collect(),
            Some(Property::ListUShort(list)) => list.iter().map(|&i| i.into()).collect(),
            Some(Property::ListInt(list)) => list.iter().map(|&i| i.into()).collect(),
            Some(Property::ListUInt(list)) => list.iter().map(|&i| i.into()).collect(),
            _ => Vec::new(),
        }
    }

    pub fn corners(&self, count: usize) -> Result<Vec<u32>, String> {
        self.numbers().into_iter().map(|number| corner(number, count)).collect()
    }

    /// Passes the triangles of a strip to `push`. Two corners of every second triangle are swapped, so that
    /// all triangles face the same side. The index -1 starts a new strip.
    pub fn triangles(&self, count: usize, push: &mut impl FnMut([u32; 3])) -> Result<(), String> {
        for strip in self.numbers().split(|&number| number == -1) {
            let corners: Vec<u32> =
                strip.iter().map(|&number| corner(number, count)).collect::<Result<_, _>>()?;
            for (index, window) in corners.windows(3).enumerate() {
                let [a, b, c] = [window[0], window[1], window[2]];
                push(if index.is_multiple_of(2) { [a, b, c] } else { [b, a, c] });
            }
        }
        Ok(())
    }
}

fn corner(number: i64, count: usize) -> Result<u32, String> {
    match u32::try_from(number) {
        Ok(index) if (index as usize) < count => Ok(index),
        _ => {
            let vertices = counted(count, "vertex");
            Err(format!("vertex {number} does not exist; the file has {vertices}, numbered from 0"))
        }
    }
}

/// The names of the property that lists a face's corners.
pub(super) const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Returns true if `name` is the name of the property that lists a face's corners.
pub(super) fn is_corners(name: &str) -> bool {
    CORNERS.contains(&name)
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(None)
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        // A number of this name is no list of corners.
        if is_corners(name) && number(&property).is_none() {
            self.0 = Some(property);
            return PropertyAccessResult::Set;
        }
        PropertyAccessResult::Ignored
    }
}

/// A face with a colour of its own.
pub(super) struct ColouredFace {
    pub face: Face,
    pub colour: Colour,
}

impl PropertyAccess for ColouredFace {
    fn new() -> Self {
        Self { face: Face::new(), colour: Colour::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        match number(&property) {
            Some(value) if self.colour.set(name, &property, value) => PropertyAccessResult::Set,
            _ => self.face.set_property(name, property),
        }
    }
}

/// An element whose properties are not stored.
pub(super) struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}
