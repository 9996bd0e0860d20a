//! The default surroundings of a bare mesh: a ground, a soft key light, a weak fill light and a sky.

use super::framing::{self, Ball};
use super::mesh::PARALLEL_TRIANGLES;
use super::validate::MAX_COORDINATE;
use super::{Camera, Light, Material, Mesh, Sky, Triangle};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Factors by which the powers of the key light and of the fill light are multiplied. With the
/// default surroundings, the lights are weaker than without them, because the sky provides the rest of the
/// light.
const STRENGTHS: [f32; 2] = [0.74, 0.3];
/// Colour of the key light, which is slightly warmer than the sky.
const KEY_COLOUR: Vec3 = Vec3::new(1.04, 1.0, 0.94);
/// Radius of the key light, in radii of the ball that represents the mesh. Seen from the ball's centre, ten
/// radii away, the light has a diameter of nine degrees. A larger light would need more samples.
const KEY_RADII: f64 = 0.8;
/// The sky's radiance from directly above. By default, a radiance of 1/15 is displayed as white.
const ZENITH: Vec3 = Vec3::new(0.0150, 0.0160, 0.0175);
/// The sky's radiance from the horizon and from below it.
const HORIZON: Vec3 = Vec3::new(0.0108, 0.0110, 0.0114);
/// Surfaces that are farther from a hit than `REACH_RADII` radii of the ball around the mesh do not occlude the sky.
const REACH_RADII: f64 = 3.0;
/// The value that replaces [`REACH_RADII`] for a mesh that is open on one side, such as a room without its
/// front wall.
const REACH_RADII_INSIDE: f64 = 0.4;
/// The ground's diffuse reflectance k_L, which is lower than that of meshes without a colour.
const GROUND: Vec3 = Vec3::new(0.52, 0.52, 0.53);
/// The ground is a square that is surrounded by square rings. The elements are the distances from the
/// ground's middle to the sides of the inner square, and to the outer sides of each ring. The distances are in
/// radii of the ball around the mesh.
/// The largest distance, that of the outermost ring, is so large that the ground's edge is not visible in a usual view.
/// The triangles near the middle are small, because rounding errors of a ray-triangle test grow with the triangle's
/// size. If the triangles near the middle were large, a shadow ray that leaves the ground at a low angle could hit the
/// ground itself.
const GROUND_RADII: [f64; 4] = [1.5, 5.0, 17.0, 60.0];
/// Distance of the ground below the mesh, in radii of the ball around the mesh, so that the ground does not
/// coincide with a mesh's flat bottom.
const GAP_RADII: f64 = 2e-4;

/// The default surroundings of a mesh.
#[derive(Debug)]
pub(super) struct Studio {
    pub lights: Vec<Light>,
    pub sky: Sky,
    /// The ground. `ground` is `None` if the mesh is open on one side, like a room without its front wall.
    /// `ground` is also `None` if the eye is lower than the mesh's lowest point, or if the ground's
    /// coordinates would exceed `MAX_COORDINATE`.
    pub ground: Option<Mesh>,
    /// The background's radiance: about that of the ground far away, which receives light almost only from the sky.
    pub background: Vec3,
}

impl Studio {
    /// Makes the surroundings of a mesh for a camera.
    pub fn around(mesh: &Mesh, ball: Ball, camera: &Camera, up: DVec3) -> Self {
        let (_, radius) = ball.centre_and_radius();
        let mut lights = framing::lights(camera, ball);
        for (light, strength) in lights.iter_mut().zip(STRENGTHS) {
            light.power *= strength;
        }
        if let Some(key) = lights.first_mut() {
            key.power *= KEY_COLOUR;
            key.radius = (KEY_RADII * radius) as f32;
        }
        let reach = if ball.is_open() { REACH_RADII_INSIDE } else { REACH_RADII };
        let reach = (reach * radius) as f32;
        let sky = Sky { zenith: ZENITH, horizon: HORIZON, up: up.as_vec3(), reach, picture: None };
        let ground = (!ball.is_open()).then(|| ground(mesh, ball, camera, up)).flatten();
        // A horizontal surface receives the mean of the sky's radiance, weighted by the cosine of the angle
        // to the zenith. The radiance grows with the sine of the angle above the horizon. The mean is
        // therefore two thirds of the way from the horizon's radiance to the zenith's.
        let background = GROUND * HORIZON.lerp(ZENITH, 2.0 / 3.0);
        Self { lights, sky, ground, background }
    }
}

/// Returns the ground, a square below a mesh. Returns `None` if the eye is lower than the mesh's lowest
/// point, or if the ground's coordinates would exceed `MAX_COORDINATE`.
fn ground(mesh: &Mesh, ball: Ball, camera: &Camera, up: DVec3) -> Option<Mesh> {
    let (centre, radius) = ball.centre_and_radius();
    let height = |point: Vec3| (point.as_dvec3() - centre).dot(up);
    let heights = mesh
        .triangles
        .par_iter()
        .with_min_len(PARALLEL_TRIANGLES)
        .map(|triangle| mesh.corners(triangle).into_iter().map(height).fold(f64::INFINITY, f64::min));
    let lowest = heights.reduce(|| f64::INFINITY, f64::min) - GAP_RADII * radius;
    if height(camera.position) < lowest + GAP_RADII * radius {
        return None;
    }
    let across = up.any_orthonormal_vector();
    let along = up.cross(across);
    let corners = [-across - along, across - along, across + along, along - across];
    let middle = centre + up * lowest;
    let square = |radii: f64| corners.map(|corner| (middle + corner * (radii * radius)).as_vec3());
    let positions: Vec<_> = GROUND_RADII.into_iter().flat_map(square).collect();
    if positions.iter().any(|position| position.abs().max_element() > MAX_COORDINATE) {
        return None;
    }
    let faces = ground_faces();
    Some(Mesh {
        positions,
        normals: vec![up.as_vec3()],
        triangles: faces.map(|positions| Triangle { positions, normals: [0; 3], material: 0 }).collect(),
        materials: vec![Material::lambertian(GROUND)],
        ..Mesh::default()
    })
}

/// Returns the corners of the ground's triangles. The first two triangles are the square in the ground's
/// middle. Around this inner square lie square rings of eight triangles each, two for each side. The drawing
/// shows the inner square and the first ring, with the corners' indices.
///
/// ```text
///  7 ------------- 6
///  |  \         /  |
///  |    3 --- 2    |
///  |    |   / |    |
///  |    | /   |    |
///  |    0 --- 1    |
///  |  /         \  |
///  4 ------------- 5
/// ```
fn ground_faces() -> impl Iterator<Item = [u32; 3]> {
    let sides = (1..GROUND_RADII.len() as u32).flat_map(|ring| (0..4).map(move |side| (4 * ring, side)));
    let rings = sides.flat_map(|(outer, side)| {
        let [this, next] = [side, (side + 1) % 4];
        let inner = outer - 4;
        [[inner + this, outer + this, outer + next], [inner + this, outer + next, inner + next]]
    });
    [[0, 1, 2], [0, 2, 3]].into_iter().chain(rings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::framing::{View, camera};
    use crate::scene::{Shape, Shot, generate};

    fn studio(up: DVec3, elevation: f64) -> (Mesh, Studio) {
        let mesh = generate(&Shape::Gourd { triangles: 648 });
        let ball = Ball::around(&mesh, up);
        let shot = Shot::SQUARE;
        let (azimuth_degrees, elevation_degrees) = (Some(20.0), Some(elevation));
        let view = View { up, azimuth_degrees, elevation_degrees, lens: None, shot };
        let camera = camera(&mesh, ball, &view);
        let studio = Studio::around(&mesh, ball, &camera, up);
        (mesh, studio)
    }

    #[test]
    fn the_ground_is_level_just_under_the_mesh_and_faces_up() {
        for up in [DVec3::Y, DVec3::Z, DVec3::NEG_X] {
            let (mesh, studio) = studio(up, 25.0);
            let ground = studio.ground.expect("a ground");
            let height = |p: &Vec3| p.as_dvec3().dot(up);
            let (_, radius) = Ball::around(&mesh, up).centre_and_radius();
            let mut area = 0.0;
            let lowest = mesh.positions.iter().map(height).fold(f64::INFINITY, f64::min);
            for position in &ground.positions {
                assert!((-0.01..0.0).contains(&(height(position) - lowest)), "{up}: {position}");
            }
            for triangle in &ground.triangles {
                let [a, b, c] = ground.corners(triangle).map(|corner| corner.as_dvec3());
                let twice_area = (b - a).cross(c - a);
                assert!(twice_area.normalize().dot(up) > 0.999);
                area += twice_area.length() / 2.0;
            }
            // The triangles cover the area exactly once.
            let across = 2.0 * 60.0 * radius;
            assert!((area / (across * across) - 1.0).abs() < 1e-4, "{up}: {area}");
        }
    }

    #[test]
    fn the_key_light_has_its_size_and_the_sky_its_colours() {
        let (mesh, studio) = studio(DVec3::Y, 25.0);
        let (_, radius) = Ball::around(&mesh, DVec3::Y).centre_and_radius();
        assert!((f64::from(studio.lights[0].radius) / radius - 0.8).abs() < 1e-6);
        let sky = [studio.sky.zenith, studio.sky.horizon].map(|radiance| radiance.to_array());
        assert_eq!(sky, [[0.0150, 0.0160, 0.0175], [0.0108, 0.0110, 0.0114]]);
    }

    #[test]
    fn nothing_hides_a_mesh_that_is_seen_from_below() {
        assert!(studio(DVec3::Y, -30.0).1.ground.is_none());
    }

    /// The lights are weaker because the sky provides the rest of the light.
    #[test]
    fn the_lights_of_a_studio_are_weaker_than_those_without_one_and_the_key_light_is_warm() {
        let (mesh, studio) = studio(DVec3::Y, 25.0);
        let (power, _) = framing::key_at(Ball::around(&mesh, DVec3::Y));
        let [key, fill] = &studio.lights[..] else { panic!("{:?}", studio.lights) };
        let part = |light: &Light| light.power / power as f32;
        assert!(part(key).distance(Vec3::new(0.7696, 0.74, 0.6956)) < 1e-5, "{}", part(key));
        // Without a studio (the default surroundings), the fill light has 0.3 of the key light's power.
        assert!(part(fill).distance(Vec3::splat(0.09)) < 1e-5, "{}", part(fill));
    }

    /// The expected background is the radiance of a level ground under the whole sky. This radiance is the
    /// ground's diffuse reflectance k_L times the mean radiance of the sky: two thirds of the zenith's
    /// radiance plus one third of the horizon's.
    #[test]
    fn the_background_is_the_colour_of_the_ground_far_away() {
        let background = studio(DVec3::Y, 25.0).1.background;
        assert!(background.distance(Vec3::new(0.007_072, 0.007_453_3, 0.008_197_3)) < 1e-6, "{background}");
    }

    /// If far surfaces occluded the sky, the far walls of a room would hide the whole sky.
    #[test]
    fn only_near_surfaces_hide_the_sky_from_a_mesh_that_is_open_on_one_side() {
        let whole = generate(&Shape::Sphere { triangles: 400 });
        let is_behind = |triangle: &&Triangle| whole.corners(triangle).iter().all(|corner| corner.z < 0.1);
        let triangles = whole.triangles.iter().filter(is_behind).copied().collect();
        let half = Mesh { triangles, ..whole.clone() };
        let reach = |mesh: &Mesh| {
            let ball = Ball::around(mesh, DVec3::Y);
            let camera = Camera { position: Vec3::Z * 3.0, ..Camera::PAPER };
            let studio = Studio::around(mesh, ball, &camera, DVec3::Y);
            f64::from(studio.sky.reach) / ball.centre_and_radius().1
        };
        let [closed, open] = [&whole, &half].map(reach);
        assert!((closed - 3.0).abs() < 1e-6 && (open - 0.4).abs() < 1e-6, "{closed} {open}");
    }

    #[test]
    fn no_edge_of_the_ground_is_passed_twice_in_one_direction() {
        let edges: Vec<[u32; 2]> = ground_faces().flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
        let distinct: std::collections::HashSet<[u32; 2]> = edges.iter().copied().collect();
        assert_eq!((edges.len(), distinct.len()), (3 * 26, 3 * 26));
    }

    #[test]
    fn a_ground_that_would_exceed_the_largest_coordinate_is_left_out() {
        let ground = |scale: f32| {
            let mut mesh = generate(&Shape::Gourd { triangles: 648 });
            mesh.positions.iter_mut().for_each(|position| *position *= scale);
            let ball = Ball::around(&mesh, DVec3::Y);
            let view = View {
                up: DVec3::Y,
                azimuth_degrees: Some(20.0),
                elevation_degrees: Some(25.0),
                lens: None,
                shot: Shot::SQUARE,
            };
            ground(&mesh, ball, &camera(&mesh, ball, &view), DVec3::Y)
        };
        // The ground's edges are 60 radii of the mesh away from the middle. In the second call, the mesh's
        // radius is more than 5e10, so the ground's edges would exceed the coordinate limit of 1e12.
        assert!(ground(1e9).is_some() && ground(5e10).is_none());
    }
}
