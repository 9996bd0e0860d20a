//! The lights of a mesh file, in the file's units.

use super::origin::{self, Placement};
use crate::scene::Light;
use glam::{DVec3, Vec3};

/// A directional light becomes a point light at this distance, in radii of the mesh.
const DIRECTIONAL_RADII: f64 = 50.0;
/// The least distance of a light in the computation of the brightness at the mesh's centre, in radii of the
/// mesh. A light that is nearer to the centre counts as if it were at this least distance.
const NEAREST_RADII: f64 = 0.25;

/// The origin of a light: a point, or infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Source {
    Point(DVec3),
    /// The light comes from infinity and shines in this direction, of length 1.
    Direction(DVec3),
}

/// A light of a mesh file. raycl uses only the ratios between the strengths of the file's lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::scene) struct FileLight {
    source: Source,
    /// The intensity of a point light, or the irradiance of a directional light.
    strength: DVec3,
}

impl FileLight {
    pub(super) fn point(position: DVec3, intensity: DVec3) -> Self {
        Self { source: Source::Point(position), strength: intensity }
    }

    /// Makes a directional light. If `direction` is zero, the light shines along -y.
    pub(super) fn direction(direction: DVec3, irradiance: DVec3) -> Self {
        Self { source: Source::Direction(direction.normalize_or(DVec3::NEG_Y)), strength: irradiance }
    }

    /// Returns the light in the coordinates of a mesh that was moved and scaled by `placement`. The strength
    /// of a point light is multiplied by the square of the scale, so that the light illuminates the mesh as
    /// brightly as before.
    pub(super) fn placed_by(self, placement: &Placement) -> Self {
        match self.source {
            Source::Point(position) => Self {
                source: Source::Point(placement.apply(position)),
                strength: self.strength * placement.scale * placement.scale,
            },
            Source::Direction(_) => self,
        }
    }

    /// Returns true if the light's position is within the limit of coordinates, and its strength is finite.
    pub(super) fn is_valid(&self) -> bool {
        let is_near = match &self.source {
            Source::Point(position) => origin::is_valid(position),
            Source::Direction(_) => true,
        };
        is_near && self.strength.is_finite()
    }

    /// Returns the light's position, and its power without the factor by which `of_file` multiplies the
    /// powers of all lights. `centre` and `radius` are those of the ball around the mesh.
    fn placed(&self, centre: DVec3, radius: f64) -> (DVec3, DVec3) {
        match self.source {
            Source::Point(position) => (position, self.strength),
            Source::Direction(direction) => {
                let distance = DIRECTIONAL_RADII * radius;
                (centre - direction * distance, self.strength * distance * distance)
            }
        }
    }
}

/// Returns `lights` as lights of a scene. Together, these lights illuminate the point `centre` as brightly as one light
/// with the power `power` at the distance `distance`. `centre` and `radius` are those of the ball around the mesh. If
/// all lights have the power 0, they keep it. A light whose power would not be finite also gets the power 0.
pub(in crate::scene) fn of_file(
    lights: &[FileLight],
    (centre, radius): (DVec3, f64),
    (power, distance): (f64, f64),
) -> Vec<Light> {
    let placed: Vec<_> = lights.iter().map(|light| light.placed(centre, radius)).collect();
    let brightness = |(position, power): &(DVec3, DVec3)| {
        let nearest = NEAREST_RADII * radius;
        power.element_sum() / 3.0 / position.distance_squared(centre).max(nearest * nearest)
    };
    let total: f64 = placed.iter().map(brightness).sum();
    let factor = if total > 0.0 { power / (distance * distance) / total } else { 0.0 };
    let light = |(position, power): (DVec3, DVec3)| {
        let power = (power * factor).as_vec3();
        let power = if power.is_finite() { power } else { Vec3::ZERO };
        Light { position: position.as_vec3(), power, radius: 0.0, area: None }
    };
    placed.into_iter().map(light).collect()
}

/// Returns a note on how lights of a mesh's file differ in the picture; `None` if there are no lights. `is_emissive` is
/// true if surfaces of the mesh emit light.
pub(in crate::scene) fn note(lights: &[FileLight], is_emissive: bool) -> Option<String> {
    let intensities = match lights.len() {
        0 => return None,
        1 => "the intensity of the file's light is not used: raycl sets the brightness at the mesh's centre",
        _ => "the file's lights keep only the ratios of their intensities",
    };
    let distant = lights.iter().filter(|light| matches!(light.source, Source::Direction(_))).count();
    let distant = match distant {
        0 => String::new(),
        1 => "; 1 directional light is shown as a distant point light".to_owned(),
        _ => format!("; {distant} directional lights are shown as distant point lights"),
    };
    let emitted = if is_emissive { "; light that surfaces emit keeps its strength" } else { "" };
    Some(format!("{intensities}{distant}{emitted}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_keep_their_ratios_and_are_as_bright_as_asked() {
        let lights = [
            FileLight::point(DVec3::new(0.0, 4.0, 0.0), DVec3::splat(1600.0)),
            FileLight::direction(DVec3::NEG_Z, DVec3::new(300.0, 0.0, 0.0)),
        ];
        let scene = of_file(&lights, (DVec3::ZERO, 2.0), (50.0, 5.0));
        let at = |light: &Light| light.power / light.position.length_squared();
        let (point, sun) = (at(&scene[0]), at(&scene[1]));
        assert!((point.x / sun.x - 100.0 / 300.0).abs() < 1e-5);
        assert!(((point + sun).element_sum() / 3.0 - 50.0 / 25.0).abs() < 1e-5);
        assert_eq!(scene[1].position, Vec3::new(0.0, 0.0, 100.0));
    }

    #[test]
    fn a_light_close_to_the_centre_counts_as_if_it_were_a_quarter_of_the_radius_away() {
        let power = |distance: f64| {
            let light = FileLight::point(DVec3::X * distance, DVec3::ONE);
            of_file(&[light], (DVec3::ZERO, 8.0), (50.0, 5.0))[0].power
        };
        assert_eq!([0.0, 1.0, 2.0, 4.0].map(power), [8.0, 8.0, 8.0, 32.0].map(Vec3::splat));
    }

    #[test]
    fn a_point_light_moves_with_the_mesh_and_a_directional_one_does_not() {
        let at = |light: FileLight| light.placed(DVec3::ZERO, 1.0).0;
        let placement = Placement { origin: DVec3::new(1.0, 2.0, 3.0), scale: 2.0 };
        let point = FileLight::point(DVec3::new(5.0, 5.0, 5.0), DVec3::ONE);
        let placed = point.placed_by(&placement);
        assert_eq!((at(placed), placed.strength), (DVec3::new(8.0, 6.0, 4.0), DVec3::splat(4.0)));
        let sun = FileLight::direction(DVec3::NEG_Y, DVec3::ONE);
        assert_eq!(at(sun.placed_by(&placement)), at(sun));
    }

    #[test]
    fn a_light_that_is_too_far_away_or_too_strong_after_scaling_is_not_valid() {
        let light = |at: f64, scale: f64| {
            let placement = Placement { origin: DVec3::ZERO, scale };
            FileLight::point(DVec3::X * at, DVec3::ONE).placed_by(&placement).is_valid()
        };
        assert!(light(1.0, 1e12) && !light(1.1, 1e12) && !light(0.0, 1e200));
    }

    #[test]
    fn a_directional_light_without_a_direction_shines_downwards() {
        let [without, down] = [DVec3::ZERO, DVec3::NEG_Y].map(|to| FileLight::direction(to, DVec3::ONE));
        assert_eq!(without, down);
    }

    #[test]
    fn a_note_says_what_is_not_shown_of_a_files_lights() {
        let [point, sun] =
            [FileLight::point(DVec3::X, DVec3::ONE), FileLight::direction(DVec3::X, DVec3::ONE)];
        let note = |lights: &[_], is_emissive| note(lights, is_emissive).unwrap_or_default();
        assert_eq!(note(&[], true), "");
        // A single light has no ratio to others.
        let one =
            "the intensity of the file's light is not used: raycl sets the brightness at the mesh's centre";
        assert_eq!(note(&[point], false), one);
        let ratios = "the file's lights keep only the ratios of their intensities";
        assert_eq!(note(&[point, point], false), ratios);
        let expected = format!(
            "{ratios}; 1 directional light is shown as a distant point light; light that surfaces emit keeps its strength"
        );
        assert_eq!(note(&[sun, point], true), expected);
        let expected = format!("{ratios}; 2 directional lights are shown as distant point lights");
        assert_eq!(note(&[sun, sun], false), expected);
    }
}
