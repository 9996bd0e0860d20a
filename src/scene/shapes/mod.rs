//! Generates shapes by formulas, with up to 100 million triangles.

mod gourd;
mod grid;
mod interior;
mod paper;
mod sphere;
mod teapot;
mod terrain;

use super::Mesh;

/// Largest number of triangles in a shape or a scene. 32-bit indices suffice even if the triangles of a scene
/// share no vertices.
pub const MAX_TRIANGLES: u32 = 100_000_000;
/// The fineness of a teapot with [`MAX_TRIANGLES`].
pub(super) const MAX_FINENESS: u32 = 1250;

/// A shape and its resolution. `triangles` is a target: the actual number of triangles may differ, by a few
/// per cent at most if the target is 5,000 or more. In every shape, y points up, and the diffuse reflectance
/// k_L is 0.8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// The paper's ground: y = -1, x from -10 to 10, z from -10 to -0.01; two triangles.
    Ground,
    /// The pyramid of the paper's Figure 3 with its hidden back and base; four triangles.
    Pyramid,
    /// The closed unit sphere about the origin.
    Sphere {
        /// Target number of triangles.
        triangles: u32,
    },
    /// Newell's teapot, 6.43 units wide and 3.15 units high, which stands on the plane y = 0 with its spout
    /// towards +x.
    Teapot {
        /// Each of the 32 patches has `fineness` x `fineness` quads.
        fineness: u32,
    },
    /// Newell's teapot with a target number of triangles.
    TeapotOf {
        /// Target number of triangles.
        triangles: u32,
    },
    /// A closed surface of revolution, 2 units high, which stands on the plane y = 0.
    Gourd {
        /// Target number of triangles; the default gives exactly 648.
        triangles: u32,
    },
    /// The gourd with irregular flat facets, some of which face inwards.
    BrokenGourd {
        /// Target number of triangles; the default gives exactly 648.
        triangles: u32,
    },
    /// Hills over x and z from -1 to 1, with heights from 0 to 0.5.
    Terrain {
        /// Target number of triangles.
        triangles: u32,
        /// The seed for the shape of the hills.
        seed: u32,
    },
    /// A hall with two rows of columns, seen from inside: x from -2 to 2, y from 0 to 3, z from -10 to 0.
    Interior {
        /// Target number of triangles.
        triangles: u32,
    },
}

impl Shape {
    /// The names in scene files.
    pub const NAMES: [&'static str; 8] =
        ["ground", "pyramid", "sphere", "teapot", "gourd", "broken-gourd", "terrain", "interior"];

    /// Returns the shape with this name, at its default resolution; `None` if there is no such shape.
    pub fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "ground" => Self::Ground,
            "pyramid" => Self::Pyramid,
            "sphere" => Self::Sphere { triangles: 5_000 },
            "teapot" => Self::Teapot { fineness: 4 },
            "gourd" => Self::Gourd { triangles: 648 },
            "broken-gourd" => Self::BrokenGourd { triangles: 648 },
            "terrain" => Self::Terrain { triangles: 20_000, seed: 1 },
            "interior" => Self::Interior { triangles: 20_000 },
            _ => return None,
        })
    }

    /// Returns the target number of triangles.
    pub fn triangles(&self) -> u64 {
        match *self {
            Self::Ground => 2,
            Self::Pyramid => 4,
            Self::Teapot { fineness } => 64 * u64::from(fineness) * u64::from(fineness),
            Self::Sphere { triangles }
            | Self::TeapotOf { triangles }
            | Self::Gourd { triangles }
            | Self::BrokenGourd { triangles }
            | Self::Terrain { triangles, .. }
            | Self::Interior { triangles } => triangles.into(),
        }
    }

    /// Sets the parameter that scene files call `parameter`.
    ///
    /// # Errors
    ///
    /// Returns a message if the shape does not have the parameter or the value is out of range.
    pub fn set(&mut self, parameter: &str, value: u32) -> Result<(), String> {
        let limit = if parameter == "fineness" { MAX_FINENESS } else { MAX_TRIANGLES };
        if parameter != "seed" && !(1..=limit).contains(&value) {
            return Err(format!("{parameter} = {value}; expected 1 to {limit}"));
        }
        match (parameter, self) {
            ("fineness", Self::Teapot { fineness }) => *fineness = value,
            ("triangles", shape @ (Self::Teapot { .. } | Self::TeapotOf { .. })) => {
                *shape = Self::TeapotOf { triangles: value };
            }
            (
                "triangles",
                Self::Sphere { triangles }
                | Self::Gourd { triangles }
                | Self::BrokenGourd { triangles }
                | Self::Terrain { triangles, .. }
                | Self::Interior { triangles },
            ) => *triangles = value,
            ("seed", Self::Terrain { seed, .. }) => *seed = value,
            ("fineness", Self::TeapotOf { .. }) => {
                return Err("both triangles and fineness; expected one of them".to_owned());
            }
            _ => return Err(format!("this shape has no `{parameter}`")),
        }
        Ok(())
    }
}

/// Generates a shape's mesh. The mesh is the same on every machine, except that positions and normals may differ in
/// their last digits if the machines' sine, cosine or exponential functions round differently. The time for generating
/// the mesh is about proportional to the number of triangles.
pub fn generate(shape: &Shape) -> Mesh {
    match *shape {
        Shape::Ground => paper::ground(),
        Shape::Pyramid => paper::pyramid(),
        Shape::Sphere { triangles } => sphere::sphere(triangles),
        Shape::Teapot { fineness } => teapot::teapot(fineness.max(1), fineness.max(1)),
        Shape::TeapotOf { triangles } => teapot::of_triangles(triangles),
        Shape::Gourd { triangles } => gourd::gourd(triangles),
        Shape::BrokenGourd { triangles } => gourd::broken(triangles),
        Shape::Terrain { triangles, seed } => terrain::terrain(triangles, seed),
        Shape::Interior { triangles } => interior::interior(triangles),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
