//! Computes what a sample of a pixel sees: a point of each light that has an extent, and one direction of the sky.
//! The counterpart for devices is `cl/common/soft.cl`; both choose the points and directions from the same numbers,
//! equal bit for bit.

use super::environment::radiance_of_picture;
use super::real::{Real, Vector};
use crate::scene::{Area, AreaShape, Light, Sample, SampleLight, Scene, Sky, scrambled, sobol};
use glam::DVec3;
use std::borrow::Cow;
use std::f64::consts::TAU;

/// The lights, each at the point that a pixel's sample sees, and the sky.
#[derive(Clone, Debug)]
pub struct Seen<'a> {
    /// The scene's lights. A light with an extent is replaced by a light at one of its points.
    pub lights: Cow<'a, [Light]>,
    /// The sky, and a point of the unit sphere that determines the direction in which the sky is seen.
    pub sky: Option<(&'a Sky, DVec3)>,
    /// Two numbers from 0 to 1 that determine which direction of the sky's picture a shiny surface mirrors.
    pub mirrored: [f64; 2],
    /// True if all light arrives, as if nothing blocked it.
    pub unoccluded: bool,
    /// The offset by which the mirrored direction is moved.
    turn: DVec3,
}

impl<'a> Seen<'a> {
    /// Returns the lights and the sky as a sample of a pixel sees them. In a picture with a single sample per pixel,
    /// lights are points.
    pub fn of(scene: &'a Scene, sample: Sample, pixel: [u32; 2]) -> Self {
        let unoccluded = sample.light == SampleLight::Unoccluded;
        let are_points = unoccluded || sample.most == 1;
        let soft = !are_points && scene.has_soft_lights();
        let placed = || (0..).zip(&scene.lights).map(|(number, light)| placed(light, number, sample, pixel));
        let lights = if soft { placed().collect() } else { Cow::Borrowed(&scene.lights[..]) };
        let source = scene.lights.len() as u32;
        // Unoccluded light of the sky is a mean over all directions around the normal, so no direction is
        // chosen.
        let point = if unoccluded { DVec3::ZERO } else { on_sphere(numbers(source, sample, pixel)) };
        let sky = scene.sky.as_ref().map(|sky| (sky, point));
        let [first, second, _] = numbers(source + 1, sample, pixel);
        Self { lights, sky, mirrored: [first, second], unoccluded, turn: DVec3::ZERO }
    }

    /// Returns a copy of this view in which `by` is added to two vectors: the point of the unit sphere in `sky`, and
    /// the offset `turn`. This changes the directions in which the sky is seen and mirrored.
    pub fn turned(&self, by: DVec3) -> Self {
        let sky = self.sky.map(|(sky, point)| (sky, point + by));
        Self { lights: self.lights.clone(), sky, turn: self.turn + by, ..*self }
    }

    /// Returns a half vector near a normal. The half vector is chosen with a probability proportional to
    /// the cosine of its angle to the normal, to the power of `shininess`.
    pub fn half_vector<R: Real>(&self, normal: R::Vector, shininess: f32) -> R::Vector {
        let [a, b] = self.mirrored;
        let squared_sine = -(2.0 / (f64::from(shininess) + 1.0) * a.ln()).exp_m1();
        let (sine, turn) = (squared_sine.sqrt(), TAU * b);
        let [across, down, axis] = AXES.map(DVec3::from_array);
        let own = sine * (turn.sin() * across + turn.cos() * down) + (1.0 - squared_sine).sqrt() * axis;
        let (own, axis) = (R::Vector::round(own + self.turn), R::Vector::round(axis));
        // The axis is turned to the normal by the smallest rotation.
        let both = axis + normal;
        let part = both.dot(own) / (R::ONE + axis.dot(normal)).max(R::from(1e-6));
        own - both * part + normal * (R::from(2.0) * axis.dot(own))
    }
}

/// The axes in which a half vector is computed; the last axis is then turned to the normal.
const AXES: [[f64; 3]; 3] = [[0.8, -0.6, 0.0], [0.48, 0.64, -0.6], [0.36, 0.48, 0.8]];

/// Returns a unit vector near a normal. The vector is chosen with a probability proportional to the cosine of its
/// angle to the normal.
pub fn way_to_sky<R: Real>(point: DVec3, normal: R::Vector) -> R::Vector {
    (normal + R::Vector::round(point)).normalize_or_zero()
}

/// Returns the sky's radiance in a direction. Without a picture, all directions below the horizon
/// have the radiance of the horizon.
pub fn radiance_of_sky<R: Real>(sky: &Sky, way: R::Vector) -> R::Vector {
    if let Some(picture) = &sky.picture {
        return radiance_of_picture::<R>(sky, picture, way);
    }
    let height = way.dot(R::Vector::of(sky.up)).max(R::ZERO);
    R::Vector::of(sky.horizon) * (R::ONE - height) + R::Vector::of(sky.zenith) * height
}

/// Returns an approximate mean of the sky's radiance around a normal, weighted by the cosine; see `cl/common/soft.cl`.
pub fn mean_of_sky<R: Real>(sky: &Sky, normal: R::Vector) -> R::Vector {
    if sky.picture.is_some() {
        return radiance_of_sky::<R>(sky, normal);
    }
    let cosine = normal.dot(R::Vector::of(sky.up));
    let height = R::from(0.2122) + cosine * (R::from(0.3333) + R::from(0.1211) * cosine);
    R::Vector::of(sky.horizon) * (R::ONE - height) + R::Vector::of(sky.zenith) * height
}

/// Returns a light with an extent as a sample of a pixel sees it: moved to one point of its ball or its
/// surface.
fn placed(light: &Light, number: u32, sample: Sample, pixel: [u32; 2]) -> Light {
    if !light.has_extent() {
        return *light;
    }
    let chosen = numbers(number, sample, pixel);
    let off = match &light.area {
        Some(area) => off_centre(area, chosen),
        None => f64::from(light.radius) * in_ball(chosen),
    };
    Light { position: (light.position.as_dvec3() + off).as_vec3(), ..*light }
}

/// Returns a point of the unit ball. The points are those of a uniform distribution on a sphere in four dimensions,
/// projected to three. Seen from afar, the ball then looks like a uniformly bright disc from every side.
fn in_ball([a, b, c]: [f64; 3]) -> DVec3 {
    let (ring, turn) = ((1.0 - a).sqrt(), TAU * b);
    DVec3::new(ring * turn.sin(), ring * turn.cos(), a.sqrt() * (TAU * c).sin())
}

/// Returns a uniformly distributed point of a light's surface, relative to the surface's centre.
fn off_centre(area: &Area, [a, b, _]: [f64; 3]) -> DVec3 {
    let [across, down] = match area.shape {
        AreaShape::Rectangle => [a - 0.5, b - 0.5],
        AreaShape::Disc => [(TAU * b).sin(), (TAU * b).cos()].map(|part| 0.5 * a.sqrt() * part),
    };
    let [first, second] = area.edges.map(|edge| edge.as_dvec3());
    across * first + down * second
}

/// Returns a uniformly distributed point on the unit sphere.
fn on_sphere([a, b, _]: [f64; 3]) -> DVec3 {
    let (ring, turn) = (2.0 * (a * (1.0 - a)).sqrt(), TAU * b);
    DVec3::new(ring * turn.sin(), ring * turn.cos(), 1.0 - 2.0 * a)
}

/// Returns three numbers from 0 to 1 for a source of light. `source` is the number of a light, from 0. The numbers
/// after the last light belong to the sky. The points with the first two numbers as coordinates are also evenly
/// distributed over the unit square.
fn numbers(source: u32, sample: Sample, [x, y]: [u32; 2]) -> [f64; 3] {
    let [x, y] = sample.period().map_or([x, y], |period| [x % period, y % period]);
    let number = along_curve(x, y).wrapping_mul(sample.count).wrapping_add(sample.number);
    // Each source has its own order of samples; otherwise the samples of two sources would be correlated.
    let [first, second] = [0, 1].map(|which| scrambled(number, seed(source, which)));
    let unit = |bits, which| unit(scrambled(bits, seed(source, which)));
    [unit(sobol(first, 0), 2), unit(sobol(first, 1), 3), unit(sobol(second, 0), 4)]
}

fn seed(source: u32, which: u32) -> u32 {
    (8 * source + which + 1).wrapping_mul(0x9e37_79b9)
}

/// Returns the number of a pixel along a Z-order curve, by interleaving the bits of its coordinates.
fn along_curve(x: u32, y: u32) -> u32 {
    let spread = |value: u32| (0..16).map(|bit| (value >> bit & 1) << (2 * bit)).sum::<u32>();
    spread(x) | spread(y) << 1
}

/// Returns 23 bits as a number between 0 and 1.
fn unit(bits: u32) -> f64 {
    (f64::from(bits >> 9) + 0.5) / f64::from(1 << 23)
}

#[cfg(test)]
mod tests {
    use super::super::fixtures;
    use super::super::intersect::Hit;
    use super::super::ray::Ray;
    use super::super::shade::{shade, share_towards};
    use super::*;
    use crate::launch::alone::Alone;
    use crate::manifest::SOFT_HEAD_FLOATS;
    use crate::scene::{Material, Sampling};
    use glam::Vec3;
    use ocl::prm::Uint2;
    use std::collections::BTreeSet;
    use std::f64::consts::PI;

    const RADIUS: f32 = 2.0;

    fn scene() -> Scene {
        let mut scene = fixtures::single_triangle();
        scene.lights = vec![
            Light { position: Vec3::new(5.0, 6.0, 7.0), power: Vec3::ONE, radius: RADIUS, area: None },
            Light { position: Vec3::ONE, power: Vec3::ONE, radius: 0.0, area: None },
        ];
        let sky = Sky { zenith: Vec3::ONE, horizon: Vec3::ZERO, up: Vec3::Y, reach: f32::MAX, picture: None };
        scene.sky = Some(sky);
        scene
    }

    fn samples(count: u32) -> impl Iterator<Item = Sample> {
        (0..count).map(move |number| Sample { number, count, most: count, ..Sample::CENTRE })
    }

    #[test]
    fn a_ball_looks_equally_bright_all_over_from_every_pixel() {
        let scene = scene();
        for pixel in [[0, 0], [1, 0], [639, 357]] {
            let offs: Vec<_> = samples(1024)
                .map(|sample| {
                    let lights = Seen::of(&scene, sample, pixel).lights;
                    assert_eq!(lights[1], scene.lights[1]);
                    (lights[0].position - scene.lights[0].position) / RADIUS
                })
                .collect();
            for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE.normalize()] {
                // The ball looks like a disc. A smaller disc with the same centre and `part` times the radius has
                // `part`^2 times the area.
                for part in [0.25_f32, 0.5, 0.75, 1.0] {
                    let inside = offs.iter().filter(|off| off.reject_from(axis).length() <= part).count();
                    let expected = part * part * 1024.0;
                    assert!((inside as f32 - expected).abs() < 30.0, "{axis} {part}: {inside} of {expected}");
                }
            }
        }
    }

    /// Returns a scene in which a white ground, y = 0, is under a light of power 1.
    fn under(position: Vec3, area: Area) -> Scene {
        let mut scene = fixtures::single_triangle();
        let mesh = scene.mesh_mut();
        mesh.normals.fill(Vec3::Y);
        mesh.materials[0] = Material::lambertian(Vec3::ONE);
        scene.lights = vec![Light { position, power: Vec3::ONE, radius: 0.0, area: Some(area) }];
        scene
    }

    /// Returns the irradiance at the ground's origin in each of 4096 samples.
    fn irradiances(scene: &Scene) -> Vec<f64> {
        let ray = Ray {
            origin: DVec3::Y,
            direction: DVec3::NEG_Y,
            near: 0.0,
            far: 9.0,
            to_light: false,
            is_shadow: false,
        };
        let hit = Hit { t: 1.0, weights: [1.0, 0.0, 0.0], triangle: 0 };
        let radiance = |sample| {
            let seen = Seen::of(scene, sample, [3, 5]);
            shade::<f64>(scene, &seen, (&ray, 0.0), &hit, &|_| true).x
        };
        samples(4096).map(radiance).map(|radiance| PI * radiance).collect()
    }

    /// Returns the irradiance at the origin, for the normal y, of a polygon with the radiance 1 (Lambert, "Photometria",
    /// 1760): half the sum, over the edges, of the angle between the ends times the cosine of the edge's plane.
    fn lamberts(corners: &[DVec3]) -> f64 {
        let next = corners.iter().cycle().skip(1);
        let edge = |(a, b): (&DVec3, &DVec3)| a.angle_between(*b) * a.cross(*b).normalize().y;
        corners.iter().zip(next).map(edge).sum::<f64>().abs() / 2.0
    }

    #[test]
    fn the_light_of_a_surface_is_that_of_its_form_factor() {
        let is_near = |scene: &Scene, exact: f64| {
            let all = irradiances(scene);
            let mean = all.iter().sum::<f64>() / 4096.0;
            let variance = all.iter().map(|one| (one - mean).powi(2)).sum::<f64>() / 4096.0;
            let standard_error = (variance / 4096.0).sqrt();
            assert!((mean - exact).abs() < standard_error, "{mean} {exact} +- {standard_error}");
            assert!((mean / exact - 1.0).abs() < 2e-3, "{mean} {exact}");
        };
        let down = [Vec3::X, Vec3::Z];
        for (position, [first, second]) in [
            (Vec3::new(0.0, 1.0, 0.0), down),
            (Vec3::new(1.5, 1.0, -0.4), [Vec3::new(2.0, 0.5, 0.0), Vec3::new(0.3, 0.4, 1.5)]),
            (Vec3::new(-2.0, 1.5, 0.0), [Vec3::new(0.2, 1.8, 0.0), Vec3::new(0.0, 0.0, 2.0)]),
        ] {
            let scene = under(position, Area { shape: AreaShape::Rectangle, edges: [first, second] });
            let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
            let corner = |[a, b]: [f32; 2]| (position + 0.5 * (a * first + b * second)).as_dvec3();
            let radiance = 1.0 / (PI * f64::from(first.cross(second).length()));
            is_near(&scene, radiance * lamberts(&corners.map(corner)));
        }
        // The form factor of a disc of radius 1 at the height 2 above the point is 1 / (1 + 2^2), and its radiance is
        // 1 / pi^2.
        let disc = Area { shape: AreaShape::Disc, edges: down.map(|edge| 2.0 * edge) };
        is_near(&under(2.0 * Vec3::Y, disc), 1.0 / (5.0 * PI));
    }

    #[test]
    fn an_area_light_sends_its_power_to_one_side() {
        let area = Area { shape: AreaShape::Rectangle, edges: [Vec3::new(1.0, 2.0, 0.5), Vec3::Z] };
        let scene = under(Vec3::Y, area);
        let share = |sample| {
            let way = on_sphere(numbers(3, sample, [1, 2]));
            let share = share_towards::<f64>(&scene.lights[0], -way);
            assert!(share == 0.0 || way.dot(area.front().as_dvec3()) > 0.0, "{way}");
            share
        };
        let mean = samples(4096).map(share).sum::<f64>() / 4096.0;
        assert!((mean - 1.0).abs() < 2e-3, "{mean}");
        let above = under(Vec3::Y, Area { edges: [Vec3::Z, Vec3::X], ..area });
        assert!(irradiances(&above).iter().all(|irradiance| *irradiance == 0.0));
    }

    #[test]
    fn a_sky_without_a_picture_is_that_of_its_horizon_below_it() {
        let (zenith, horizon) = (glam::Vec3::ONE, glam::Vec3::splat(0.25));
        let sky = Sky { zenith, horizon, up: glam::Vec3::Y, reach: 1.0, picture: None };
        for (way, radiance) in [(DVec3::Y, 1.0), (DVec3::X, 0.25), (DVec3::NEG_Y, 0.25)] {
            assert_eq!(radiance_of_sky::<f64>(&sky, way), DVec3::splat(radiance), "{way}");
        }
    }

    #[test]
    fn one_sample_sees_points_and_a_sky() {
        let scene = scene();
        let seen = Seen::of(&scene, Sample::CENTRE, [3, 4]);
        assert_eq!(*seen.lights, scene.lights[..]);
        assert!(seen.sky.is_some_and(|(_, point)| (point.length() - 1.0).abs() < 1e-12));
        let other = Seen::of(&scene, Sample::CENTRE, [4, 4]);
        assert_ne!(seen.sky.map(|(_, point)| point), other.sky.map(|(_, point)| point));
    }

    /// With two adaptive samples, each of the two rounds has a single sample.
    #[test]
    fn the_only_sample_of_a_round_sees_points_of_balls() {
        let scene = scene();
        let rounds = Sampling::adaptive(2).rounds().concat();
        assert_eq!(rounds.iter().map(|sample| sample.count).collect::<Vec<_>>(), [1, 1]);
        for sample in rounds {
            let lights = Seen::of(&scene, sample, [3, 4]).lights;
            assert_ne!(lights[0], scene.lights[0]);
            assert_eq!(lights[1], scene.lights[1]);
        }
    }

    #[test]
    fn samples_of_a_pixel_and_of_a_square_of_pixels_are_one_to_each_stratum() {
        let strata = |numbers: &[[f64; 3]], axis: usize| {
            let stratum = |number: &[f64; 3]| (number[axis] * numbers.len() as f64) as u32;
            numbers.iter().map(stratum).collect::<BTreeSet<_>>().len()
        };
        for source in [0, 1, 5] {
            let of_pixel: Vec<_> = samples(16).map(|sample| numbers(source, sample, [12, 7])).collect();
            let square = (0..64).map(|place| [32 + place % 8, 8 + place / 8]);
            let of_square: Vec<_> = square.map(|pixel| numbers(source, Sample::CENTRE, pixel)).collect();
            for axis in 0..3 {
                assert_eq!((strata(&of_pixel, axis), strata(&of_square, axis)), (16, 64), "{source} {axis}");
            }
            // The first two numbers are also evenly distributed over the unit square.
            let cells: BTreeSet<_> =
                of_pixel.iter().map(|[a, b, _]| ((a * 4.0) as u32, (b * 4.0) as u32)).collect();
            assert_eq!(cells.len(), 16);
        }
    }

    /// With other bits, the reference would cast other rays than the device that it judges.
    #[test]
    fn devices_compute_the_same_bits() {
        const SIZE: [u32; 2] = [23, 67];
        let before = "#define TO_FLOAT(i) convert_float(i)\n";
        let kernel = "__kernel void numbers(__global float *out, int source, uint2 sample, int width) {\n\
                      Soft soft;\nsoft.numbers = 0;\nsoft.sample = sample;\nconst int at = get_global_id(0);\n\
                      const Vec3 u = numbers_of(&soft, source, at % width, at / width);\n\
                      out[3 * at] = u.x, out[3 * at + 1] = u.y, out[3 * at + 2] = u.z;\n}\n";
        let options = format!(
            "-D WIDTH=1 -D BLOCK_X=1 -D REDUCE_BUILTIN=0 -D ROUNDING=0 -D EDGE_ON_ROUNDING=0 -D CULL_BACK=0 -D SKY=0 -D RECORD_FLOATS=12 \
             -D SAMPLED=0 -D SOFT_HEAD_FLOATS={SOFT_HEAD_FLOATS}"
        );
        let files = ["common/width.cl", "common/vec3.cl", "common/rows.cl", "common/soft.cl"];
        let device = Alone::of([before, kernel], &files, &options);
        let pixels = || (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| [x, y]));
        for (source, number, count) in [(0_i32, 0, 1), (1, 3, 16), (2, 15, 16), (7, 40, 64)] {
            let items = pixels().count();
            let found: Vec<f32> = device.results(3 * items, |found| {
                let mut kernel = device.kernel("numbers", items);
                kernel.arg(found).arg(source).arg(Uint2::new(number, count)).arg(SIZE[0] as i32).build()
            });
            let sample = Sample { number, count, ..Sample::CENTRE };
            for (pixel, found) in pixels().zip(found.chunks(3)) {
                let expected = numbers(source as u32, sample, pixel);
                assert_eq!(
                    found.iter().map(|&number| f64::from(number)).collect::<Vec<_>>(),
                    expected,
                    "{source} {pixel:?}"
                );
            }
        }
    }

    #[test]
    fn directions_to_the_sky_are_as_likely_as_their_cosine() {
        let scene = scene();
        let normal = DVec3::new(0.6, -0.48, 0.64);
        let cosines: Vec<_> = samples(4096)
            .map(|sample| {
                let point = Seen::of(&scene, sample, [9, 9]).sky.map_or(DVec3::ZERO, |(_, point)| point);
                way_to_sky::<f64>(point, normal).dot(normal)
            })
            .collect();
        // If directions on a hemisphere are weighted by their cosine, the fraction of them whose cosine is below a
        // value is the square of this value.
        for part in [0.1, 0.3, 0.7, 0.9] {
            let below = cosines.iter().filter(|cosine| **cosine < part).count() as f64 / 4096.0;
            assert!((below - part * part).abs() < 5e-3, "{part}: {below}");
        }
    }

    #[test]
    fn a_turn_is_added_to_the_directions_of_the_sky() {
        let mut scene = scene();
        let (zenith, horizon, up) = (Vec3::ONE, Vec3::ZERO, Vec3::Y);
        scene.sky = Some(Sky { zenith, horizon, up, reach: 10.0, picture: None });
        let seen = Seen::of(&scene, Sample::CENTRE, [1, 2]);
        let point = |seen: &Seen<'_>| seen.sky.map_or(DVec3::NAN, |(_, point)| point);
        let by = DVec3::new(0.1, -0.2, 0.3);
        assert_eq!(point(&seen.turned(by)), point(&seen) + by);
        assert_eq!(seen.turned(by).turned(by).turn, by + by);
    }
}
