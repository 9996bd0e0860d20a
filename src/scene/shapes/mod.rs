//! Shapes made by a formula, from a handful of triangles to tens of millions.

mod gourd;
mod grid;
mod interior;
mod paper;
mod sphere;
mod teapot;
mod terrain;

use super::Mesh;

/// The most triangles a shape or a scene has: their vertices then have 32-bit indices with room to spare.
pub const MAX_TRIANGLES: u32 = 100_000_000;
/// The largest fineness whose teapot has at most [`MAX_TRIANGLES`].
pub(super) const MAX_FINENESS: u32 = 1250;

/// A shape and how fine it is. `triangles` is a target that is met within a few per
/// cent from some hundred triangles on. Shapes have y up and k_L 0.8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// The paper's ground: y = -1, x from -10 to 10, z from -10 to -0.01; two triangles.
    Ground,
    /// Figure 3's pyramid with its hidden back and base; four triangles.
    Pyramid,
    /// The closed unit sphere about the origin.
    Sphere {
        /// How many to aim for.
        triangles: u32,
    },
    /// Newell's teapot, 6.525 wide and 3.15 high, standing on y = 0 with its spout towards +x.
    Teapot {
        /// Each of the 32 patches is `fineness` x `fineness` quads.
        fineness: u32,
    },
    /// Newell's teapot by its number of triangles.
    TeapotOf {
        /// How many to aim for.
        triangles: u32,
    },
    /// A closed surface of revolution, 2 high, standing on y = 0.
    Gourd {
        /// How many to aim for; the default is exactly 648.
        triangles: u32,
    },
    /// The gourd of uneven flat facets, some of which face inwards.
    BrokenGourd {
        /// How many to aim for; the default is exactly 648.
        triangles: u32,
    },
    /// Hills over x and z from -1 to 1, with heights from 0 to 0.5.
    Terrain {
        /// How many to aim for.
        triangles: u32,
        /// Which hills.
        seed: u32,
    },
    /// A hall with two rows of columns, seen from inside: x from -2 to 2, y from 0 to 3, z from -10 to 0.
    Interior {
        /// How many to aim for.
        triangles: u32,
    },
}

impl Shape {
    /// The names in scene files.
    pub const NAMES: [&'static str; 8] =
        ["ground", "pyramid", "sphere", "teapot", "gourd", "broken-gourd", "terrain", "interior"];

    /// The shape of a name in its default fineness.
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

    /// How many triangles it aims for.
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

    /// Sets a parameter by its name in scene files.
    ///
    /// # Errors
    /// In words, for a parameter the shape does not have or a value out of range.
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

/// Makes a shape: the same one on every machine, in time linear in its triangles.
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
