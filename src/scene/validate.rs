//! The checks that every scene must pass, whether it was read from a file or made in code.

use super::area::LEAST_SINE;
use super::material::{MAX_EMITTED, MAX_REFLECTANCE, MAX_SHININESS};
use super::mesh::{Mesh, PARALLEL_TRIANGLES};
use super::{Area, Camera, Light, Mapped, Material, Scene, Sky, Texture, Textures};
use crate::error::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// Largest absolute value of a coordinate. Intersection tests multiply three coordinates, and the product
/// must stay below the largest f32, 3.4e38.
pub const MAX_COORDINATE: f32 = 1e12;

/// Largest power of a light, which is enough for a scene of the largest allowed size. `MAX_POWER` is also the
/// largest radiance of the sky and of the background. Kernels add the radiances of several samples before
/// they divide the sum, so each radiance must be much less than the largest f32, 3.4e38.
pub const MAX_POWER: f32 = 1e28;

/// Largest value that [`Brightness::check`] allows in the computation of a pixel; single precision holds up
/// to 3.4e38.
const MAX_PRODUCT: f64 = 1e37;

/// The allowed squared lengths of normals. To normalise a normal, a kernel squares its length, so the square must
/// fit into single precision. Loaded scenes have squared lengths from 1e-12 to 1e12 (`tame` in normals.rs), which a
/// transformation may change by rounding.
const SQUARED_NORMALS: Range<f32> = 1e-13..1e13;

/// Smallest distance between a light and a surface in the check of brightness, as a fraction of the scene's
/// diagonal.
const RELATIVE_RESOLUTION: f32 = 1e-7;

impl Scene {
    /// Checks the values that a scene file can set: numbers are finite and in their ranges, indices are in
    /// bounds, and the camera has a direction. The texels of a sky's picture are not checked here, but when
    /// the picture is read. Scenes from [`super::load_scene`] are already checked; a scene made in code should
    /// be checked once.
    ///
    /// # Errors
    ///
    /// Returns a user error that describes the first mistake.
    pub fn validate(&self) -> Result<()> {
        check_mesh(&self.mesh)?;
        self.validate_view()?;
        let bounds = self.mesh.bounds().unwrap_or_default();
        let brightness = Brightness::of(&self.mesh, bounds, self.lights.len(), self.shadow_bias);
        self.lights.iter().try_for_each(|light| brightness.check(light))
    }

    /// Checks the same as [`Self::validate`], except the mesh and the brightness of lights, whose limit
    /// depends on the mesh.
    pub(super) fn validate_view(&self) -> Result<()> {
        let background = self.background;
        let valid = background.is_finite() && background.min_element() >= 0.0;
        require(valid && background.max_element() <= MAX_POWER, || {
            format!("the background is {:?}; expected values from 0 to {MAX_POWER:e}", background.to_array())
        })?;
        let numbers = [
            ("shadow_bias", self.shadow_bias, self.shadow_bias.is_finite()),
            ("the exposure", self.display.exposure, self.display.exposure.is_finite()),
        ];
        for (what, value, finite) in numbers {
            require(finite && value >= 0.0, || {
                format!("{what} is {value}; expected a finite value of at least 0")
            })?;
        }
        let gamma = self.display.gamma;
        require(gamma > 0.0 && gamma.is_finite(), || {
            format!("gamma is {gamma}; expected a finite value of more than 0")
        })?;
        check_camera(&self.camera)?;
        self.lights.iter().try_for_each(check_light)?;
        self.sky.iter().try_for_each(check_sky)
    }
}

fn require(holds: bool, message: impl FnOnce() -> String) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::input(message()).with_help(LIMITS)) }
}

/// The help in an error about a value out of range.
const LIMITS: &str = "docs/scenes.md lists the range of every value, and its default";

fn in_range(position: Vec3) -> bool {
    // A position with a NaN is not finite, so it is refused.
    position.is_finite() && position.abs().max_element() <= MAX_COORDINATE
}

pub(super) fn check_camera(camera: &Camera) -> Result<()> {
    let at = camera.position;
    require(in_range(at), || {
        format!("the camera is at {at}; expected coordinates within +-{MAX_COORDINATE:e}")
    })?;
    let units = [camera.right, camera.up, camera.forward];
    let orthonormal = units.iter().all(|v| (v.length() - 1.0).abs() < 1e-3)
        && units[0].cross(units[1]).dot(-units[2]) > 0.999;
    require(orthonormal, || "the camera's axes are not an orthonormal basis".to_owned())?;
    let tan = camera.tan_half_fov;
    require(tan > 0.0 && tan.is_finite(), || {
        format!("the camera's tan_half_fov is {tan}; expected a finite number of more than 0")
    })?;
    let near = camera.z_near;
    require(near >= 0.0 && near.is_finite(), || {
        format!("z_near is {near}; expected a finite distance of at least 0")
    })
}

pub(super) fn check_light(light: &Light) -> Result<()> {
    let (at, power, radius) = (light.position, light.power, light.radius);
    require(in_range(at), || {
        format!("a light is at {at}; expected coordinates within +-{MAX_COORDINATE:e}")
    })?;
    let valid = power.is_finite() && power.min_element() >= 0.0 && power.max_element() <= MAX_POWER;
    require(valid, || format!("a light's power is {power}; expected values from 0 to {MAX_POWER:e}"))?;
    require((0.0..=MAX_COORDINATE).contains(&radius), || {
        format!("a light's radius is {radius}; expected a length from 0 to {MAX_COORDINATE:e}")
    })?;
    light.area.as_ref().map_or(Ok(()), |area| check_area(area, radius))
}

fn check_area(area: &Area, radius: f32) -> Result<()> {
    let [first, second] = area.edges;
    require(radius == 0.0, || {
        format!(
            "a light has a radius of {radius} and edges; expected either a radius (the light is a ball) or edges (the light is flat)"
        )
    })?;
    require(in_range(first) && in_range(second), || {
        format!("a light's edges are {first} and {second}; expected coordinates within +-{MAX_COORDINATE:e}")
    })?;
    require(area.sine() >= LEAST_SINE, || {
        format!("a light's edges are {first} and {second}; expected two that are neither zero nor parallel")
    })
}

fn check_sky(sky: &Sky) -> Result<()> {
    let Sky { zenith, horizon, up, reach, .. } = sky;
    let valid = |radiance: &Vec3| radiance.is_finite() && radiance.min_element() >= 0.0;
    let most = zenith.max(*horizon).max_element();
    require(valid(zenith) && valid(horizon) && most <= MAX_POWER, || {
        format!(
            "the sky's radiance is {zenith} at the zenith and {horizon} at the horizon; expected values from 0 to \
             {MAX_POWER:e}"
        )
    })?;
    require((up.length() - 1.0).abs() < 1e-3, || {
        format!("the sky's zenith is towards {up}, which is not a unit vector")
    })?;
    require(*reach > 0.0 && reach.is_finite(), || {
        format!("the sky's reach is {reach}; expected a finite distance of more than 0")
    })
}

/// The properties of a scene from which the largest brightness of its surfaces is computed.
pub(super) struct Brightness {
    /// The bounding box of all surfaces.
    bounds: (Vec3, Vec3),
    /// A light that is nearer to a surface than this distance counts as if it were at this distance.
    nearest: f32,
    /// The largest value of pi times the reflectance formula, over all materials.
    reflectance: f64,
    lights: usize,
}

impl Brightness {
    /// Collects the properties of a scene with the bounding box `bounds` and with `lights` lights.
    pub fn of(mesh: &Mesh, bounds: (Vec3, Vec3), lights: usize, shadow_bias: f32) -> Self {
        let nearest = shadow_bias.max(RELATIVE_RESOLUTION * bounds.1.distance(bounds.0));
        let reflectance = mesh.materials.iter().map(brightest).fold(0.0, f64::max);
        Self { bounds, nearest, reflectance, lights }
    }

    /// Refuses a light if products in `cl/cast/shade.cl` could exceed the range of single precision. The
    /// distance from the light to the scene's bounding box counts as the distance to the nearest surface.
    pub fn check(&self, light: &Light) -> Result<()> {
        let outside = light.position.distance(light.position.clamp(self.bounds.0, self.bounds.1));
        // Straight in front of an area light, four times as much light arrives as from a point light of the
        // same power.
        let (reach, ahead) = light.area.map_or((light.radius, 1.0), |area| (area.reach(), 4.0));
        let nearest = (outside - reach).max(self.nearest);
        let spread = ahead / (4.0 * std::f64::consts::PI * f64::from(nearest).powi(2));
        let incoming = spread * f64::from(light.power.max_element());
        let sum = incoming * self.reflectance * self.lights as f64;
        let product = spread.max(incoming).max(sum);
        // `nearest` is 0 only if the scene has no extent. A scene without extent has no surface that a light
        // could make too bright.
        require(product <= MAX_PRODUCT || nearest == 0.0, || {
            let Self { reflectance, .. } = self;
            format!(
                "a light with the power {} could be as near as {nearest:e} to a surface, and surfaces have a \
                 reflectance of up to {reflectance:e}; if all lights of the scene were like this one, the computation of a \
                 pixel could contain the number {product:e}; expected at most {MAX_PRODUCT:e}, so that every number fits into single precision; \
                 reduce the power or move the light away",
                light.power
            )
        })
    }
}

/// Returns the largest value of pi times a material's reflectance formula.
fn brightest(material: &Material) -> f64 {
    let highlight = f64::from(material.glossy.max_element()) * (f64::from(material.shininess) + 8.0) / 8.0;
    f64::from(material.lambertian.max_element()) + highlight
}

fn check_material(material: &Material) -> Result<()> {
    let numbers = material.to_floats();
    let most = MAX_REFLECTANCE.max(MAX_SHININESS);
    require(numbers.iter().all(|value| (0.0..=most).contains(value)), || {
        format!(
            "a material has the values {numbers:?} (three for k_L, three for k_G, the shininess, and 1 if the \
             material has a highlight, otherwise 0); expected values from 0 to {most:e}"
        )
    })?;
    let emitted = material.emitted;
    require(emitted.to_array().iter().all(|value| (0.0..=MAX_EMITTED).contains(value)), || {
        format!("a material emits the radiance {emitted}; expected values from 0 to {MAX_EMITTED:e}")
    })
}

fn check_mesh(mesh: &Mesh) -> Result<()> {
    require(!mesh.triangles.is_empty(), || "the scene has no triangles".to_owned())?;
    mesh.materials.iter().try_for_each(check_material)?;
    check_positions(mesh)?;
    let usable = |n: &Vec3| SQUARED_NORMALS.contains(&n.length_squared()); // does not contain NaN
    let usable = mesh.normals.par_chunks(PARALLEL_TRIANGLES).all(|normals| normals.iter().all(usable));
    require(usable, || "a normal is zero, not finite, or of extreme length".to_owned())?;
    let (positions, normals) = (mesh.positions.len(), mesh.normals.len());
    let materials = mesh.materials.len();
    let is_bounded = |t: &crate::scene::Triangle| {
        t.positions.iter().all(|&i| (i as usize) < positions)
            && t.normals.iter().all(|&i| (i as usize) < normals)
            && (t.material as usize) < materials
    };
    let bounded = mesh.triangles.par_chunks(PARALLEL_TRIANGLES).all(|some| some.iter().all(is_bounded));
    require(bounded, || "a triangle names a vertex, normal or material that does not exist".to_owned())?;
    check_textures(mesh)
}

fn check_textures(mesh: &Mesh) -> Result<()> {
    let Textures { list, mapped } = &mesh.textures;
    let whole = |texture: &Texture| {
        !texture.size.contains(&0) && texture.level_start(texture.last_level() + 1) == texture.texels.len()
    };
    require(list.iter().all(whole), || "a texture's number of texels does not match its size".to_owned())?;
    require(mapped.is_empty() || mapped.len() == mesh.triangles.len(), || {
        format!(
            "{} of {} triangles are mapped to textures; expected all or none",
            mapped.len(),
            mesh.triangles.len()
        )
    })?;
    let valid = |row: &Mapped| {
        row.corners.as_flattened().iter().all(|value| value.is_finite())
            && [row.texture, row.mask].into_iter().flatten().all(|number| (number as usize) < list.len())
    };
    require(mapped.iter().all(valid), || {
        "a triangle's texture or mask does not exist, or its texture coordinates are not finite".to_owned()
    })?;
    let mut emission = mesh.materials.iter().filter_map(|material| material.emission_texture);
    require(emission.all(|number| !mapped.is_empty() && (number as usize) < list.len()), || {
        "a material's emission texture does not exist".to_owned()
    })?;
    let colours = &mesh.corner_colours;
    require(colours.is_empty() || colours.len() == mesh.triangles.len(), || {
        let (have, all) = (colours.len(), mesh.triangles.len());
        format!("{have} of {all} triangles have colours of their corners; expected all or none")
    })
}

/// Refuses a mesh with a coordinate that is not finite or is beyond `MAX_COORDINATE`.
pub(super) fn check_positions(mesh: &Mesh) -> Result<()> {
    let first_far = |positions: &[Vec3]| positions.iter().find(|position| !in_range(**position)).copied();
    let far = mesh.positions.par_chunks(PARALLEL_TRIANGLES).find_map_first(first_far);
    require(far.is_none(), || {
        let position = far.unwrap_or_default();
        format!("a vertex is at {position}; expected coordinates within +-{MAX_COORDINATE:e}")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::fixtures::single_triangle;
    use crate::scene::{AreaShape, Triangle};

    #[test]
    fn coordinates_are_limited_in_both_directions() {
        for (y, is_valid) in [(1e12, true), (-1e12, true), (1e13, false), (-1e13, false)] {
            let position = Vec3::new(0.0, y, 0.0);
            let light = Light { position, power: Vec3::ONE, radius: 0.0, area: None };
            let mesh = Mesh { positions: vec![position], ..Mesh::default() };
            assert_eq!(
                check_camera(&Camera { position, ..Camera::PAPER }).is_ok(),
                is_valid,
                "camera, {y:e}"
            );
            assert_eq!(check_light(&light).is_ok(), is_valid, "light, {y:e}");
            assert_eq!(check_positions(&mesh).is_ok(), is_valid, "vertex, {y:e}");
        }
    }

    #[test]
    fn the_tangent_of_half_the_field_of_view_is_finite_and_more_than_0() {
        let check = |tan_half_fov| check_camera(&Camera { tan_half_fov, ..Camera::PAPER });
        assert!([1e-9, 1.0, 1e9].into_iter().all(|tan| check(tan).is_ok()));
        for (tan, shown) in [(0.0, "0"), (-1.0, "-1"), (f32::INFINITY, "inf"), (f32::NAN, "NaN")] {
            let error = check(tan).unwrap_err().to_string();
            let expected = "expected a finite number of more than 0";
            assert_eq!(error, format!("the camera's tan_half_fov is {shown}; {expected}"));
        }
    }

    #[test]
    fn normals_are_finite_and_not_zero() {
        for (normal, is_valid) in [(Vec3::NEG_Z, true), (Vec3::ZERO, false), (Vec3::NAN, false)] {
            assert_eq!(with_normal(normal).is_ok(), is_valid, "{normal}");
        }
    }

    /// In single precision, the squared lengths of normals of the lengths 1e-23 and 1e20 are 0 and infinite.
    #[test]
    fn normals_have_lengths_that_kernels_can_normalise() {
        for (length, is_valid) in
            [(1e-23, false), (1e-7, false), (1e-5, true), (1e5, true), (1e7, false), (1e20, false)]
        {
            assert_eq!(with_normal(Vec3::Y * length).is_ok(), is_valid, "{length:e}");
        }
        let error = with_normal(Vec3::Y * 1e20).unwrap_err().to_string();
        assert_eq!(error, "a normal is zero, not finite, or of extreme length");
    }

    /// Checks a mesh of one triangle, whose last normal is `normal`.
    fn with_normal(normal: Vec3) -> Result<()> {
        let mut scene = single_triangle();
        scene.mesh_mut().normals.extend([Vec3::Z, normal]);
        check_mesh(&scene.mesh)
    }

    /// The mesh is checked in several chunks.
    #[test]
    fn the_first_position_that_is_too_far_is_named() {
        let mut mesh = Mesh { positions: vec![Vec3::ZERO; 3 * PARALLEL_TRIANGLES], ..Mesh::default() };
        let far = [1, PARALLEL_TRIANGLES + 2, 2 * PARALLEL_TRIANGLES + 3];
        for (index, x) in far.into_iter().zip([2e12, 3e12, 4e12]).rev() {
            mesh.positions[index].x = x;
            let error = check_positions(&mesh).unwrap_err().to_string();
            assert!(error.starts_with(&format!("a vertex is at {};", mesh.positions[index])), "{error}");
        }
    }

    #[test]
    fn a_triangle_names_positions_normals_and_a_material_that_exist() {
        let is_valid = |change: fn(&mut Triangle)| {
            let mut scene = single_triangle();
            let mesh = scene.mesh_mut();
            // The mesh has five positions, two normals and one material.
            mesh.positions.resize(5, Vec3::ONE);
            mesh.normals = vec![Vec3::Z; 2];
            mesh.triangles[0].normals = [0; 3];
            mesh.triangles.push(mesh.triangles[0]);
            change(&mut mesh.triangles[1]);
            check_mesh(mesh).is_ok()
        };
        assert!(is_valid(|triangle| triangle.positions[2] = 4));
        assert!(is_valid(|triangle| triangle.normals[2] = 1));
        assert!(!is_valid(|triangle| triangle.positions[2] = 5));
        assert!(!is_valid(|triangle| triangle.normals[2] = 2));
        assert!(!is_valid(|triangle| triangle.material = 1));
    }

    #[test]
    fn either_all_triangles_or_none_are_mapped_to_textures() {
        let mut scene = single_triangle();
        let mesh = scene.mesh_mut();
        mesh.textures.mapped = vec![Mapped { corners: [[0.0; 2]; 3], texture: None, mask: None }];
        assert!(check_textures(mesh).is_ok());
        mesh.triangles = vec![mesh.triangles[0]; 2];
        let error = check_textures(mesh).unwrap_err().to_string();
        assert_eq!(error, "1 of 2 triangles are mapped to textures; expected all or none");
    }

    #[test]
    fn emitted_light_its_texture_and_colours_of_corners_are_checked() {
        let error = |change: fn(&mut Mesh)| {
            let mut scene = single_triangle();
            change(scene.mesh_mut());
            check_mesh(&scene.mesh).err().map(|error| error.to_string()).unwrap_or_default()
        };
        assert_eq!(error(|mesh| mesh.materials[0].emitted = Vec3::new(0.0, 1e6, 0.0)), "");
        let dark = error(|mesh| mesh.materials[0].emitted.y = -1.0);
        assert_eq!(dark, "a material emits the radiance [0, -1, 0]; expected values from 0 to 1e6");
        assert!(!error(|mesh| mesh.materials[0].emitted.z = f32::INFINITY).is_empty());
        let texture = error(|mesh| mesh.materials[0].emission_texture = Some(0));
        assert_eq!(texture, "a material's emission texture does not exist");
        assert_eq!(error(|mesh| mesh.corner_colours = vec![[0; 3]]), "");
        let colours = error(|mesh| mesh.corner_colours = vec![[0; 3]; 2]);
        assert_eq!(colours, "2 of 1 triangles have colours of their corners; expected all or none");
    }

    #[test]
    fn a_view_is_checked_with_the_mesh() {
        let mut scene = single_triangle();
        assert!(scene.validate().is_ok());
        scene.display.gamma = 0.0;
        assert!(scene.validate().is_err());
    }

    #[test]
    fn a_background_has_a_radiance_whose_sum_over_samples_is_finite() {
        let check = |blue| {
            let background = Vec3::new(0.0, 1.0, blue);
            Scene { background, ..single_triangle() }.validate_view()
        };
        assert!([0.0, MAX_POWER].into_iter().all(|blue| check(blue).is_ok()));
        for (blue, shown) in [(-0.5, "-0.5"), (2e28, "2e28"), (f32::NAN, "NaN")] {
            let error = check(blue).unwrap_err().to_string();
            let expected = "expected values from 0 to 1e28";
            assert_eq!(error, format!("the background is [0.0, 1.0, {shown}]; {expected}"));
        }
    }

    #[test]
    fn a_sky_has_a_reach_a_direction_and_a_radiance() {
        let sky = Sky { zenith: Vec3::ONE, horizon: Vec3::ZERO, up: Vec3::Y, reach: 10.0, picture: None };
        assert!(check_sky(&sky).is_ok());
        for reach in [0.0, -1.0, f32::INFINITY, f32::NAN] {
            assert!(check_sky(&Sky { reach, ..sky.clone() }).is_err(), "{reach}");
        }
        for up in [Vec3::ZERO, Vec3::Y * 2.0, Vec3::NAN] {
            assert!(check_sky(&Sky { up, ..sky.clone() }).is_err(), "{up}");
        }
        for (radiance, is_valid) in [(-0.1, false), (f32::NAN, false), (1e28, true), (2e28, false)] {
            let one = Vec3::new(0.0, radiance, 0.0);
            for sky in [Sky { zenith: one, ..sky.clone() }, Sky { horizon: one, ..sky.clone() }] {
                assert_eq!(check_sky(&sky).is_ok(), is_valid, "{radiance}");
            }
        }
    }

    #[test]
    fn the_values_of_a_material_are_limited() {
        let of = |k_l: f32, k_g: f32, shininess: f32| {
            check_material(&Material::blinn_phong(Vec3::splat(k_l), Vec3::splat(k_g), shininess)).is_ok()
        };
        assert!(of(0.0, 0.0, 0.0) && of(1e6, 1e6, 1e6));
        for (k_l, k_g, shininess) in
            [(-0.1, 0.5, 8.0), (0.5, 2e6, 8.0), (0.5, 0.5, 2e6), (f32::NAN, 0.5, 8.0)]
        {
            assert!(!of(k_l, k_g, shininess), "{k_l} {k_g} {shininess}");
        }
    }

    /// The limit applies to the light that arrives, power / (4 pi distance^2), times the reflectance and the
    /// number of lights.
    #[test]
    fn a_light_may_not_be_too_bright_for_the_nearest_surface() {
        let brightness = |material: Material, lights: usize| {
            let mesh = Mesh { materials: vec![material], ..Mesh::default() };
            Brightness::of(&mesh, (Vec3::ZERO, Vec3::ONE), lights, 0.0)
        };
        // Ten units above the box, 1 / (4 pi 10^2) = 7.96e-4 of the power arrives.
        let light = |power: f32, radius: f32| Light {
            position: Vec3::new(0.5, 11.0, 0.5),
            power: Vec3::new(0.0, power, 0.0),
            radius,
            area: None,
        };
        let [dull, bright] = [1.0, 1e6].map(|k_l| Material::lambertian(Vec3::splat(k_l)));
        assert!((brightest(&bright) - 1e6).abs() < 1.0);
        // With a shininess of 8, the highlight's value is twice k_G.
        let both = Material::blinn_phong(Vec3::splat(0.25), Vec3::splat(0.5), 8.0);
        assert!((brightest(&both) - 1.25).abs() < 1e-6);
        // A power of 1e35 with a reflectance of 1e6 gives 7.96e-4 * 1e35 * 1e6 = 7.96e37, which exceeds the
        // limit of 1e37. With a light's power of 1e34, the product is 7.96e36, which does not exceed the
        // limit.
        assert!(brightness(dull, 1).check(&light(1e35, 0.0)).is_ok());
        assert!(brightness(bright, 1).check(&light(1e35, 0.0)).is_err());
        assert!(brightness(bright, 1).check(&light(1e34, 0.0)).is_ok());
        assert!(brightness(bright, 10).check(&light(1e34, 0.0)).is_err());
        // A light with a radius of 9 reaches down to 1 unit above the box. At a distance of 1 unit, a hundred
        // times as much light arrives as at 10 units.
        assert!(brightness(bright, 1).check(&light(1e34, 9.0)).is_err());
        // Half the diagonal of an area light with edges of 13 is 9.2, so this light may reach as far as the
        // light with a radius of 9.
        // Straight in front of an area light, even of a small one, four times as much light arrives as from a
        // point light.
        let area = |edge: f32| {
            let edges = [edge * Vec3::X, edge * Vec3::Y];
            Light { area: Some(Area { shape: AreaShape::Rectangle, edges }), ..light(5e33, 0.0) }
        };
        assert!(brightness(bright, 1).check(&light(5e33, 0.0)).is_ok());
        assert!(brightness(bright, 1).check(&area(1e-3)).is_err());
        let dim = |edge: f32| Light { power: Vec3::splat(1e33), ..area(edge) };
        assert!(brightness(bright, 1).check(&dim(1e-3)).is_ok());
        assert!(brightness(bright, 1).check(&dim(13.0)).is_err());
    }

    #[test]
    fn the_edges_of_a_light_are_two_directions_and_it_is_no_ball_too() {
        let light = |edges: [Vec3; 2], radius: f32| {
            let area = Some(Area { shape: AreaShape::Disc, edges });
            check_light(&Light { position: Vec3::ZERO, power: Vec3::ONE, radius, area }).is_ok()
        };
        assert!(light([Vec3::X, Vec3::Y], 0.0) && light([1e12 * Vec3::X, 1e-12 * Vec3::ONE], 0.0));
        assert!(!light([Vec3::X, Vec3::Y], 1.0), "a ball, too");
        for edges in [
            [Vec3::X, -2.0 * Vec3::X],
            [Vec3::X, Vec3::ZERO],
            [Vec3::ZERO; 2],
            [Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.3, 0.6, 0.9)],
            [Vec3::X, 1e13 * Vec3::Y],
            [Vec3::X, Vec3::NAN],
        ] {
            assert!(!light(edges, 0.0), "{edges:?}");
        }
    }
}
