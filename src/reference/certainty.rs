//! Finds the certain pixels: all correct casters must agree on these pixels, however the casters round.

use super::cast::Caster;
use super::intersect::Hit;
use super::pixel_sample::{PixelSample, Reach};
use super::ray::{Frame, Ray};
use super::shade::{Reaches, Sight, shade, sights, surface_at};
use super::shadow_end::ends_before_hit;
use super::soft::Seen;
use crate::scene::{Mapped, Material, Mesh, PixelFrame, Scene, Textures, Triangle};
use glam::DVec3;
use std::cell::RefCell;

mod highlight;
mod quick;

pub use quick::quick_sample;

/// The angle of wide nudges (a nudge is a small change to a ray's direction): ten times the angle of narrow
/// nudges. A pixel is certain only if wide nudges of its ray do not change its radiance noticeably. In
/// pictures with a very wide field of view, wide and narrow nudges both have larger angles (see
/// [`enlargement`]).
const WIDE_NUDGE_RADIANS: f64 = 1e-5;
/// The angle of narrow nudges: almost 17 times the rounding error of single precision. Rounding can turn a ray by up to
/// ten rounding errors: four of the direction, and six of cross and dot products. A narrow nudge thus turns a ray
/// further than rounding can, but less than twice as far. A pixel that changes only under wide nudges is
/// nearly certain (see [`super::Doubt`]), and is verified almost like a certain pixel.
const NUDGE_RADIANS: f64 = 1e-6;
/// The largest rounding error of single precision, relative to the rounded number.
const ROUNDING: f64 = 6e-8;
/// If a triangle lies behind the nearest hit by at most this fraction of the hit's distance, the triangle may be the
/// nearest one after rounding.
const RIVAL: f64 = 1e-6;
/// How far rounding may move a hit off its triangle's plane, as a fraction of a length. This length is the largest
/// of the hit's distances from the eye, from the scene's origin, and from the farthest corner of the hit's
/// triangle. For a thin triangle, the move may be larger (see [`Caster::off_plane`]). For grazing light, a move off
/// the plane may decide whether a shadow ray starts above or below the triangle. Nudges (small turns) of the
/// pixel's ray do not reveal a move off the plane.
const OFF_PLANE: f64 = 1e-6;

/// The angle by which the direction to the sky is nudged: at most twice the angle by which rounding may turn this
/// direction. The direction is computed from rounded sines and a rounded normal.
const SKY_NUDGE: f64 = 1e-6;
/// The angle by which the direction to a sky with a picture is nudged. This angle is larger than `SKY_NUDGE`, because
/// finding a texel adds the rounding errors of an arc tangent and of a product with the picture's size.
const PICTURE_NUDGE: f64 = 4e-6;
/// How far rounding may move a hit's position in a texture, relative to the triangle's largest texture
/// coordinate (at least 1): almost seven rounding errors of single precision. On a device, the position has
/// at most six rounding errors. The first weight (1 minus the other two weights) adds one error, the products
/// of weights and coordinates add one, and the sum of these products adds two. The texel's position (the sum
/// times the texture's size, minus a half) adds two more.
const TEXTURE_SHIFT: f32 = 4e-7;

/// A surface that is this close to a light may or may not occlude the light. `AT_LIGHT` is relative to the
/// light's distance from the hit, or to the light's distance from the scene's origin if the latter distance
/// is larger.
pub(super) const AT_LIGHT: f64 = 1e-6;

/// The inputs from which one sample of a pixel is cast, and cast again with small changes.
pub struct Asked<'a> {
    /// The ray caster in double precision. The caster contains the scene.
    pub caster: &'a Caster<'a, f64>,
    /// Defines the ray through each position of the image.
    pub frame: &'a PixelFrame,
    /// The shadow bias: the distance from a hit at which shadow rays start.
    pub bias: f64,
    /// The sky and the lights. In place of a light with an extent, `seen` contains one point of this light:
    /// the point to which the sample's shadow ray runs.
    pub seen: Seen<'a>,
    /// The pixel coordinates (x, y) of the pixel's centre.
    pub centre: [f64; 2],
}

impl Asked<'_> {
    /// Includes in `sample` the values that a hit's radiance takes if rounding turns the direction in which the sky is
    /// seen. `radiance` returns the hit's radiance under a sky whose direction was turned.
    fn turn_sky(&self, sample: &mut PixelSample, radiance: impl Fn(&Seen<'_>) -> DVec3) {
        if self.seen.sky.is_none() {
            return;
        }
        let has_picture = self.seen.sky.is_some_and(|(sky, _)| sky.picture.is_some());
        let size = if has_picture { PICTURE_NUDGE } else { SKY_NUDGE };
        for turn in DVec3::AXES.into_iter().flat_map(|axis| [axis * size, axis * -size]) {
            sample.consider(radiance(&self.seen.turned(turn)));
        }
    }

    /// Includes in `sample` the colours that a ray without a hit may get from the sky's picture if rounding turns the
    /// ray's direction.
    fn turn_background(&self, sample: &mut PixelSample, ray: &Ray<f64>) {
        for turn in DVec3::AXES.into_iter().flat_map(|axis| [axis * PICTURE_NUDGE, axis * -PICTURE_NUDGE]) {
            sample.consider(self.caster.background((ray.direction + turn).normalize()));
        }
    }

    /// Includes in `sample` the values that a hit's radiance takes if rounding moves the hit's position in a
    /// texture. Nudges of the ray do not reveal an error of this position if all corners of the triangle have
    /// the same texture coordinates, as in models whose texture is a palette. `reaches` tests whether a light
    /// or the sky is visible. The function calls `reaches` at most once for each light and for the sky, since
    /// the hit point does not move.
    fn shift_texture(
        &self,
        sample: &mut PixelSample,
        (ray, hit): (&Ray<f64>, &Hit<f64>),
        reaches: Reaches<'_, f64>,
    ) {
        let scene = self.caster.scene();
        let Some(mesh) = textured_triangle(&scene.mesh, hit.triangle) else { return };
        let corners = mesh.textures.mapped[0].corners;
        let mut shifted = scene_of(mesh, scene);
        let largest = corners.as_flattened().iter().fold(1.0_f32, |largest, value| largest.max(value.abs()));
        let by = TEXTURE_SHIFT * largest;
        let width = Frame::<f64>::new(self.frame).cone_width(ray, hit.t);
        let hit = Hit { triangle: 0, ..*hit };
        // `known` has an element for each light, and a last element for the sky: `Some(true)` if the light or
        // the sky is visible, `None` before the first test.
        let known = RefCell::new(vec![None; self.seen.lights.len() + 1]);
        let reaches_once = |sight: &Sight<f64>| {
            let earlier: Option<bool> = known.borrow()[sight.light];
            earlier.unwrap_or_else(|| {
                let result = reaches(sight);
                known.borrow_mut()[sight.light] = Some(result);
                result
            })
        };
        for [across, down] in [[by, by], [by, -by], [-by, by], [-by, -by]] {
            let shifted_corners = corners.map(|[u, v]| [u + across, v + down]);
            shifted.mesh_mut().textures.mapped[0].corners = shifted_corners;
            sample.consider(shade(&shifted, &self.seen, (ray, width), &hit, &reaches_once));
        }
    }

    /// Ends the shadow rays farther from a hit than usual, and includes the resulting radiance in `sample`. A device
    /// that casts shadow rays from a distant light may end the rays at any distance between the two distances of
    /// [`ends_before_hit`]. This function therefore casts each of these shadow rays twice: once to each of the two
    /// distances. `radiance` returns the hit's radiance. The argument of `radiance` is a function that returns the
    /// distance from the hit at which the shadow ray of a [`Sight`] ends.
    fn end_before_hit(
        &self,
        sample: &mut PixelSample,
        (ray, hit): (&Ray<f64>, &Hit<f64>),
        radiance: impl Fn(&dyn Fn(&Sight<f64>) -> f64) -> DVec3,
    ) {
        let [point, normal] = surface_at(self.caster.scene(), ray, hit);
        let ends = |sight: &Sight<f64>| match self.is_light(sight) {
            true => ends_before_hit(self.bias, sight, normal),
            false => [self.bias; 2],
        };
        // If no light is distant, all shadow rays end as usual, at the shadow bias from the hit, so the
        // radiance stays the same.
        if sights(&self.seen, point, normal).any(|sight| ends(&sight)[1] > self.bias) {
            for end in [0, 1] {
                sample.consider(radiance(&|sight| ends(sight)[end]));
            }
        }
    }

    /// Includes in `sample` the values that the radiance of this hit takes under small changes of the shadow
    /// rays, of the plane of the hit, of the direction to the sky, of the position in the texture and of
    /// highlights. The pixel's ray is not nudged. `leaning` contains the casters of [`Caster::leaning`], in
    /// which rounding makes all triangles larger or all smaller.
    fn change_hit(
        &self,
        sample: &mut PixelSample,
        (ray, hit): (&Ray<f64>, &Hit<f64>),
        leaning: &[Caster<'_, f64>; 2],
    ) {
        let (caster, seen, bias) = (self.caster, &self.seen, self.bias);
        for factor in [0.5, 2.0] {
            sample.consider(caster.radiance(seen, ray, Some(hit), bias * factor));
        }
        self.end_before_hit(sample, (ray, hit), |end| {
            caster.shaded(seen, ray, Some(hit), &|sight| caster.reaches(sight, end(sight)))
        });
        for part in [AT_LIGHT, -AT_LIGHT] {
            let reaches = |sight: &Sight<f64>| {
                caster.reaches_within(sight, bias, sight.distance - part * self.scale(sight))
            };
            sample.consider(caster.shaded(seen, ray, Some(hit), &reaches));
        }
        for off in off_plane(caster, ray, hit) {
            let slid = slid(ray, hit, off);
            for caster in [caster, &leaning[0], &leaning[1]] {
                let reaches = |sight: &Sight<f64>| caster.reaches(&moved(sight, off), bias);
                sample.consider(caster.shaded(seen, ray, Some(hit), &reaches));
                sample.consider(caster.radiance(seen, &slid, Some(hit), bias));
            }
        }
        if let Some(grazing) = caster.grazing(seen, ray, hit, bias, OFF_PLANE) {
            let grazed = caster.grazed(seen, ray, hit, grazing);
            grazed.into_iter().for_each(|radiance| sample.consider(radiance));
        }
        self.turn_sky(sample, |seen| caster.radiance(seen, ray, Some(hit), bias));
        let usual = |sight: &Sight<f64>| caster.reaches(sight, bias);
        self.shift_texture(sample, (ray, hit), &usual);
        self.change_highlights(sample, (ray, hit), &usual);
    }

    /// Returns true if `sight` shows a light, and false if it shows the sky.
    fn is_light(&self, sight: &Sight<f64>) -> bool {
        sight.light < self.seen.lights.len()
    }

    /// Returns the length to which rounding errors at a light are relative: the greater of the light's
    /// distances from the hit and from the scene's origin. For the sky, the function returns the sky's reach
    /// (the distance up to which surfaces block the sky's light).
    fn scale(&self, sight: &Sight<f64>) -> f64 {
        let position =
            self.seen.lights.get(sight.light).map_or(0.0, |light| light.position.as_dvec3().length());
        sight.distance.max(position)
    }
}

/// Returns a copy of `scene` with another mesh, without the lights and the sky. [`shade`] takes lights and
/// sky from another argument (a [`Seen`]), so copying them for every pixel would waste time.
fn scene_of(mesh: Mesh, scene: &Scene) -> Scene {
    Scene {
        name: String::new(),
        mesh: mesh.into(),
        lights: Vec::new(),
        sky: None,
        camera: scene.camera,
        background: scene.background,
        transparent: scene.transparent,
        shadow_bias: scene.shadow_bias,
        smooth_shadows: scene.smooth_shadows,
        display: scene.display,
    }
}

/// Returns a mesh that consists of one triangle of `mesh`; returns `None` if the triangle has no texture and
/// no emission texture. The triangle's mask is left out, because a mask does not change the radiance of a
/// hit.
fn textured_triangle(mesh: &Mesh, triangle: u32) -> Option<Mesh> {
    let row = mesh.textures.mapped.get(triangle as usize)?;
    let corner_colours: Vec<_> = mesh.corner_colours.get(triangle as usize).copied().into_iter().collect();
    let triangle = &mesh.triangles[triangle as usize];
    let material = mesh.material(triangle);
    let mut list = Vec::new();
    let mut only = |number: u32| {
        list.push(mesh.textures.list[number as usize].clone());
        list.len() as u32 - 1
    };
    let (texture, emission_texture) = (row.texture.map(&mut only), material.emission_texture.map(&mut only));
    if list.is_empty() {
        return None;
    }
    let textures = Textures { list, mapped: vec![Mapped { texture, mask: None, ..*row }] };
    let bare = mesh_of(mesh, triangle, Material { emission_texture, ..*material });
    Some(Mesh { textures, corner_colours, ..bare })
}

/// Returns a mesh that consists of one triangle of `mesh`, with the material `material`, and without textures and
/// colours of corners.
fn mesh_of(mesh: &Mesh, triangle: &Triangle, material: Material) -> Mesh {
    Mesh {
        positions: mesh.corners(triangle).to_vec(),
        normals: mesh.corner_normals(triangle).to_vec(),
        triangles: vec![Triangle { positions: [0, 1, 2], normals: [0, 1, 2], material: 0 }],
        materials: vec![material],
        ..Mesh::default()
    }
}

/// Casts a pixel's sample, and casts the sample again with each of the changes below. The returned sample
/// includes the results of all these casts. The changes are:
///
/// - The pixel's ray is nudged in each direction along the image's axes.
/// - The shadow bias is halved, and doubled.
/// - Shadow rays start a little above, and below, the plane of the hit.
/// - The hit is where the ray meets a plane a little above, and below, the plane of the hit.
/// - Shadow rays end as far from the hit as those that a device casts from a distant light.
/// - Surfaces very close to a light are included as occluders, and left out.
/// - Rounding makes triangles larger and holes smaller, or triangles smaller and holes larger.
/// - For grazing light, every result that rounding allows is included.
/// - The direction to the sky is turned slightly.
/// - The hit's position in a texture is moved slightly.
/// - Highlights of very shiny surfaces become brighter, and darker.
/// - Surfaces just behind the hit are seen instead of the surface that was hit: if two surfaces coincide,
///   either one is correct. Each surface just behind the hit is also cast with the other changes of this
///   list, except nudges, because rounding may change a pixel in several ways at once.
pub fn sample(asked: &Asked<'_>) -> PixelSample {
    let Asked { caster, frame, bias, seen, centre } = asked;
    let (bias, [x, y]) = (*bias, *centre);
    let (ray, hit) = caster.look(x, y);
    let mut sample = PixelSample::of(caster.radiance(seen, &ray, hit.as_ref(), bias), hit.is_some());
    let mut look_again = |caster: &Caster<'_, f64>, reach, [x, y]: [f64; 2]| {
        let (ray, other) = caster.look(x, y);
        if hit.is_some() != other.is_some() {
            sample.turn(reach);
        }
        sample.nudge(reach, caster.radiance(seen, &ray, other.as_ref(), bias));
    };
    nudges(frame, [x, y]).for_each(|(reach, position)| look_again(caster, reach, position));
    let leaning = caster.leaning();
    leaning.iter().for_each(|leaning| look_again(leaning, Reach::Near, [x, y]));
    if hit.is_none() && caster.sky_behind().is_some() {
        asked.turn_background(&mut sample, &ray);
    }
    if let Some(hit) = &hit {
        asked.change_hit(&mut sample, (&ray, hit), &leaning);
        for rival in caster.rivals(&ray, hit, RIVAL) {
            sample.consider(caster.radiance(seen, &ray, Some(&rival), bias));
            asked.change_hit(&mut sample, (&ray, &rival), &leaning);
        }
    }
    sample
}

/// Returns the offsets by which rounding may move a hit off its plane. A shadow ray that runs along a
/// neighbouring triangle may start above or below this triangle because of such an offset. Nudges of the
/// pixel's ray do not reveal the offsets, since a nudge moves the hit within its own plane.
fn off_plane(caster: &Caster<'_, f64>, ray: &Ray<f64>, hit: &Hit<f64>) -> [DVec3; 2] {
    let off = caster.off_plane(ray, hit, OFF_PLANE);
    [off, -off]
}

/// Returns a ray with the direction of `ray`. At the distance `hit.t`, the returned ray reaches the point where `ray`
/// meets the plane of the triangle if rounding moves this plane by `off`. This point is the moved hit. On a large
/// triangle that a ray meets at a small angle, the hit moves so far along the triangle that the light's distance and
/// direction change noticeably. The returned ray starts on the line of `ray`, but not where `ray` starts.
fn slid(ray: &Ray<f64>, hit: &Hit<f64>, off: DVec3) -> Ray<f64> {
    let along = off.length_squared() / off.dot(ray.direction);
    // If the ray sees the plane edge-on, its hit on the moved plane may lie behind the eye or at infinity.
    let along = if along.is_finite() { along.max(-hit.t).min(hit.t) } else { 0.0 };
    Ray { origin: ray.origin + ray.direction * along, ..*ray }
}

fn moved(sight: &Sight<f64>, off: DVec3) -> Sight<f64> {
    Sight { point: sight.point + off, ..*sight }
}

/// The number of nudged rays of a pixel: four directions, each with a wide and a narrow nudge.
const NUDGES: usize = 8;

/// Returns the factor by which the nudges of a pixel are larger than usual; at least 1. A device computes the
/// direction of a pixel's ray as a sum of three vectors, and rounds each of them at most four times. In the
/// middle of a picture with a very wide field of view, the three vectors are far longer than their sum, the
/// ray's direction. A rounding error of one of the long vectors turns the ray far more than in other
/// pictures.
fn enlargement(frame: &PixelFrame, [x, y]: [f64; 2]) -> f64 {
    let lengths = [frame.corner, frame.step_x * x, frame.step_y * y].map(DVec3::length);
    let turn = 4.0 * ROUNDING * lengths.iter().sum::<f64>() / frame.direction(x, y).length();
    (turn / NUDGE_RADIANS).max(1.0)
}

/// Returns the pixel coordinates of the nudged rays, each with the size of its nudge. First, four rays are
/// turned by a wide nudge: to the right, to the left, down and up. Then, four more rays are turned in the
/// same four directions by a narrow nudge (a tenth of a wide nudge).
fn nudges(frame: &PixelFrame, [x, y]: [f64; 2]) -> impl Iterator<Item = (Reach, [f64; 2])> {
    let towards = frame.direction(x, y);
    // If `towards` is the ray's direction, a step of one pixel turns the ray by about |step x towards| /
    // |towards|^2.
    let per_radian = |step: DVec3| towards.length_squared() / step.cross(towards).length();
    let larger = enlargement(frame, [x, y]);
    let (across, down) = (larger * per_radian(frame.step_x), larger * per_radian(frame.step_y));
    [(Reach::Wide, WIDE_NUDGE_RADIANS), (Reach::Near, NUDGE_RADIANS)].into_iter().flat_map(
        move |(reach, radians)| {
            let (dx, dy) = (radians * across, radians * down);
            [[x + dx, y], [x - dx, y], [x, y + dy], [x, y - dy]].map(|position| (reach, position))
        },
    )
}

#[cfg(test)]
mod tests {
    use super::super::fixtures;
    use super::super::pixel_sample::is_certain;
    use super::super::traverse::Exhaustive;
    use super::super::tree::Tree;
    use super::*;
    use crate::scene::{Camera, Sample, Sky, SkyPicture, Texture, Wrap};
    use crate::strategy::Culling;
    use glam::{Vec3, vec3};

    /// Returns the percentage of pixels for which `quick_sample` has a result. Checks that each of these
    /// results equals the result of `sample`.
    fn quickly(scene: &Scene, culling: Culling) -> usize {
        let size = [48, 30];
        let tree = Tree::new(&scene.mesh, culling);
        let caster = Caster::new(scene, size, Exhaustive::new(&scene.mesh, culling));
        let frame = scene.camera.pixel_frame(size[0], size[1]);
        let bias = f64::from(scene.shadow_bias);
        let mut quick = 0;
        for (y, x) in (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (y, x))) {
            let centre = [f64::from(x) + 0.5, f64::from(y) + 0.5];
            let seen = Seen::of(scene, Sample::CENTRE, [x, y]);
            let asked = Asked { caster: &caster, frame: &frame, bias, seen, centre };
            let Some(quick_result) = quick_sample(&asked, &tree) else { continue };
            quick += 1;
            let plain = sample(&asked);
            assert_eq!(quick_result, plain, "{} at ({x}, {y})", scene.name);
        }
        100 * quick / (size[0] * size[1]) as usize
    }

    /// Returns a scene with a triangle whose texture is a palette of 1024 texels. All corners of the triangle
    /// have the same position in the palette: `texels` texels from the left edge. The left half of the
    /// palette is dark, and the right half is white.
    fn palette(texels: f32) -> Scene {
        let mut scene = fixtures::single_triangle();
        let palette = (0..1024).map(|x| if x < 512 { 0x20_2020 } else { 0xff_ffff });
        let texture = Texture {
            size: [1024, 1],
            wrap: [Wrap::Repeat; 2],
            least_alpha: 0,
            texels: palette.collect::<Vec<u32>>().into(),
        };
        let mesh = scene.mesh_mut();
        mesh.materials[0].glossy = Vec3::ZERO;
        let row = Mapped { corners: [[texels / 1024.0, 0.5]; 3], texture: Some(0), mask: None };
        mesh.textures = Textures { list: vec![texture], mapped: vec![row] };
        scene
    }

    #[test]
    fn the_edge_of_a_colour_of_a_palette_is_uncertain_and_its_inside_is_not() {
        let change = |texels: f32| {
            let scene = palette(texels);
            let caster = Caster::new(&scene, [80, 50], Exhaustive::new(&scene.mesh, Culling::None));
            let frame = scene.camera.pixel_frame(80, 50);
            let seen = Seen::of(&scene, Sample::CENTRE, [40, 25]);
            let result =
                sample(&Asked { caster: &caster, frame: &frame, bias: 1e-4, seen, centre: [40.5, 25.5] });
            assert!(result.hit && result.radiance.x > 0.0);
            result.near_change / result.radiance.x
        };
        // The linear values of the palette's two colours are 0.014 and 1. At the edge between the two
        // colours, a shift by 4e-7 of the palette's 1024 texels adds or removes 4e-4 of the difference of
        // these values. At 511.51 texels from the palette's left edge, the white texel has a weight of one
        // hundredth in the filtered colour.
        let expected = 4e-7 * 1024.0 * (1.0 - 0.014) / (0.014 * 0.99 + 0.01);
        let [edge, inside] = [change(511.51), change(600.5)];
        assert!((edge / expected - 1.0).abs() < 0.1, "{edge}, expected {expected}");
        assert!(inside < 1e-4, "{inside}");
    }

    #[test]
    fn a_shift_of_the_texture_casts_only_one_shadow_ray_to_each_light() {
        let mut scene = palette(511.51);
        scene.lights.push(scene.lights[0]);
        let caster = Caster::new(&scene, [80, 50], Exhaustive::new(&scene.mesh, Culling::None));
        let frame = scene.camera.pixel_frame(80, 50);
        let seen = Seen::of(&scene, Sample::CENTRE, [40, 25]);
        let asked = Asked { caster: &caster, frame: &frame, bias: 1e-4, seen, centre: [40.5, 25.5] };
        let (ray, Some(hit)) = caster.look(40.5, 25.5) else { panic!("the triangle is in the middle") };
        let mut shifted = PixelSample::of(DVec3::ZERO, true);
        let cast = RefCell::new(Vec::new());
        asked.shift_texture(&mut shifted, (&ray, &hit), &|sight| {
            cast.borrow_mut().push(sight.light);
            true
        });
        assert!(shifted.change > 0.0);
        assert_eq!(*cast.borrow(), [0, 1]);
    }

    /// The direction to a sky with a picture is turned further than the direction to a sky without one,
    /// because finding a texel adds rounding errors.
    #[test]
    fn a_sky_is_turned_both_ways_along_each_axis_and_a_sky_with_a_picture_further() {
        let turns = |picture: Option<SkyPicture>| -> Vec<DVec3> {
            let mut scene = fixtures::single_triangle();
            let (dark, picture) = (Vec3::ZERO, picture.map(std::sync::Arc::new));
            scene.sky = Some(Sky { zenith: dark, horizon: dark, up: Vec3::Y, reach: f32::MAX, picture });
            let caster = Caster::new(&scene, [80, 50], Exhaustive::new(&scene.mesh, Culling::None));
            let frame = scene.camera.pixel_frame(80, 50);
            let seen = Seen::of(&scene, Sample::CENTRE, [40, 25]);
            let (_, own) = seen.sky.expect("a sky");
            let asked = Asked { caster: &caster, frame: &frame, bias: 1e-4, seen, centre: [40.5, 25.5] };
            let turns = RefCell::new(Vec::new());
            asked.turn_sky(&mut PixelSample::of(DVec3::ZERO, true), |seen| {
                turns.borrow_mut().extend(seen.sky.map(|(_, point)| point - own));
                DVec3::ZERO
            });
            turns.into_inner()
        };
        let texels = [[1.0; 3]; 4].into();
        let picture = SkyPicture { size: [4, 1], texels, ahead: Vec3::Z, is_seen: true };
        for (turns, size) in [(turns(None), SKY_NUDGE), (turns(Some(picture)), PICTURE_NUDGE)] {
            assert_eq!(turns.len(), 6);
            for turn in DVec3::AXES.into_iter().flat_map(|axis| [size * axis, -size * axis]) {
                assert!(turns.iter().any(|other| other.distance(turn) < 1e-12), "{turn}: {turns:?}");
            }
        }
    }

    /// Around the picture's middle, its texels become brighter from one side to the other.
    #[test]
    fn the_direction_of_a_background_is_turned_both_ways() {
        let mut scene = fixtures::single_triangle();
        let texels = [0.0_f32, 1.0, 2.0, 3.0].map(|grey| [grey; 3]).into();
        let picture = SkyPicture { size: [4, 1], texels, ahead: Vec3::Z, is_seen: true };
        let (dark, picture) = (Vec3::ZERO, Some(picture.into()));
        scene.sky = Some(Sky { zenith: dark, horizon: dark, up: Vec3::Y, reach: f32::MAX, picture });
        let caster = Caster::new(&scene, [80, 50], Exhaustive::new(&scene.mesh, Culling::None));
        let frame = scene.camera.pixel_frame(80, 50);
        let seen = Seen::of(&scene, Sample::CENTRE, [40, 25]);
        let asked = Asked { caster: &caster, frame: &frame, bias: 1e-4, seen, centre: [40.5, 25.5] };
        let ray = Ray { direction: DVec3::Z, ..caster.look(40.5, 25.5).0 };
        let mut sample = PixelSample::of(caster.background(ray.direction), false);
        asked.turn_background(&mut sample, &ray);
        let [darkest, brightest] = sample.range;
        assert!(darkest.x < sample.radiance.x && sample.radiance.x < brightest.x, "{sample:?}");
    }

    /// Casts a picture of 1 x 1 pixels, and returns whether its pixel is certain: first according to
    /// `sample`, then according to `quick_sample`.
    fn certain(scene: &Scene) -> [bool; 2] {
        let tree = Tree::new(&scene.mesh, Culling::None);
        let caster = Caster::new(scene, [1, 1], Exhaustive::new(&scene.mesh, Culling::None));
        let frame = scene.camera.pixel_frame(1, 1);
        let seen = Seen::of(scene, Sample::CENTRE, [0, 0]);
        let bias = f64::from(scene.shadow_bias);
        let asked = Asked { caster: &caster, frame: &frame, bias, seen, centre: [0.5, 0.5] };
        let quick = quick_sample(&asked, &tree).expect("the ray hits one triangle first");
        [sample(&asked), quick].map(|sample| is_certain(&sample, 1e-9))
    }

    /// Rounding may decide whether a surface casts a shadow if the surface's distance from the hit is between
    /// half the shadow bias and twice the bias.
    #[test]
    fn a_shadow_of_what_is_about_as_near_as_the_bias_is_uncertain() {
        let of = |gap: f32| certain(&fixtures::lit_from_behind(gap));
        assert_eq!([4e-3, 7e-3, 1.4e-2, 2.5e-2].map(of), [[true; 2], [false; 2], [false; 2], [true; 2]]);
    }

    /// At a light that is 100 units away, rounding may move the light or an occluder by 1e-4 units.
    #[test]
    fn a_shadow_of_what_is_about_as_far_as_the_light_is_uncertain() {
        let of = |beyond: f32| {
            let mut scene = fixtures::lit_from_behind(98.0 + beyond);
            scene.lights[0].position = vec3(0.0, 0.0, -100.0);
            certain(&scene)
        };
        assert_eq!([-1e-2, -5e-5, 5e-5, 1e-2].map(of), [[true; 2], [false; 2], [false; 2], [true; 2]]);
    }

    /// If a device rounds a light's position, the rounding error grows with the light's distance from the
    /// origin.
    #[test]
    fn an_error_at_a_light_is_relative_to_the_larger_of_its_distances_from_the_hit_and_the_origin() {
        let mut scene = fixtures::single_triangle();
        scene.lights[0].position = vec3(0.0, 300.0, 400.0);
        let caster = Caster::new(&scene, [80, 50], Exhaustive::new(&scene.mesh, Culling::None));
        let frame = scene.camera.pixel_frame(80, 50);
        let seen = Seen::of(&scene, Sample::CENTRE, [40, 25]);
        let asked = Asked { caster: &caster, frame: &frame, bias: 1e-4, seen, centre: [40.5, 25.5] };
        let scale =
            |light, distance| asked.scale(&Sight { light, point: DVec3::ZERO, w_i: DVec3::Y, distance });
        assert_eq!([scale(0, 2.0), scale(0, 600.0)], [500.0, 600.0]);
        // The sky's number is one more than the last light's number. The sky has no position.
        assert_eq!(scale(1, 2.0), 2.0);
    }

    /// Returns the camera of a very wide picture.
    fn wide_camera() -> Camera {
        let camera = Camera::looking_at(vec3(3.6, 2.2, 4.8), vec3(0.0, 0.5, 0.0), Vec3::Y, 179.98, false);
        camera.expect("two different points")
    }

    #[test]
    fn nudges_are_larger_than_usual_only_where_rounding_turns_rays_further() {
        let usual = Camera::PAPER.pixel_frame(320, 200);
        for position in [[0.5, 0.5], [160.0, 100.0], [160.5, 199.5], [319.5, 100.5], [319.5, 199.5]] {
            assert_eq!(enlargement(&usual, position), 1.0, "{position:?}");
        }
        for [width, height] in [[101_u8, 67], [63, 41], [255, 199]] {
            let frame = wide_camera().pixel_frame(width.into(), height.into());
            let [x, y] = [width, height].map(|size| f32::from(size) / 2.0);
            let exact = Frame::<f64>::new(&frame).primary(x.into(), y.into()).direction;
            let rounded = Frame::<f32>::new(&frame).primary(x, y).direction;
            let turn = exact.distance(rounded.as_dvec3());
            let nudge = NUDGE_RADIANS * enlargement(&frame, [x.into(), y.into()]);
            assert!(turn > 10.0 * NUDGE_RADIANS && turn < nudge, "{width}x{height}: {turn}, nudge {nudge}");
            assert_eq!(enlargement(&frame, [0.5, 0.5]), 1.0, "the direction is as long as its parts");
        }
    }

    #[test]
    fn what_is_found_quickly_is_what_the_plain_caster_finds_in_very_wide_pictures() {
        let mut scene = fixtures::figure_4();
        scene.camera = wide_camera();
        quickly(&scene, Culling::None);
    }

    #[test]
    fn what_is_found_quickly_is_what_the_plain_caster_finds() {
        for scene in [
            fixtures::single_triangle(),
            fixtures::figure_4(),
            fixtures::pyramid_upper(),
            fixtures::pyramid_lower(),
            fixtures::sphere(12),
            fixtures::random(300, 1),
            palette(511.51),
        ] {
            for culling in [Culling::None, Culling::Back] {
                let percent = quickly(&scene, culling);
                assert!(percent >= 50, "{}: {percent} of 100", scene.name);
            }
        }
    }

    /// With smooth shadows, a hit's own triangle may block the light. If `mixed` is above 0, some normals are
    /// turned so far that a hit's own triangle blocks the light.
    #[test]
    fn what_is_found_quickly_of_smooth_shadows_is_what_the_plain_caster_finds() {
        let smooth = |light: Vec3, mixed: f32| {
            let mut scene = fixtures::sphere(6);
            scene.smooth_shadows = true;
            scene.lights[0].position = light;
            let turns = [Vec3::X, Vec3::NEG_Y, Vec3::Z, Vec3::ZERO];
            let normals = scene.mesh_mut().normals.iter_mut();
            normals.zip(turns.into_iter().cycle()).for_each(|(normal, turn)| *normal += mixed * turn);
            scene
        };
        for (light, mixed) in
            [(vec3(2.0, 3.0, 1.0), 0.0), (vec3(5.0, 0.5, -2.5), 0.0), (vec3(5.0, 0.5, -2.5), 0.7)]
        {
            for culling in [Culling::None, Culling::Back] {
                let percent = quickly(&smooth(light, mixed), culling);
                assert!(percent >= 50, "{light}, {mixed}: {percent} of 100");
            }
        }
    }

    #[test]
    fn rounding_slides_a_hit_along_its_ray_onto_the_moved_plane() {
        let (near, far, to_light, is_shadow) = (0.0, f64::INFINITY, false, false);
        let ray =
            Ray { origin: DVec3::Y, direction: DVec3::new(0.8, -0.6, 0.0), near, far, to_light, is_shadow };
        let hit = Hit { t: 1.0 / 0.6, weights: [1.0, 0.0, 0.0], triangle: 0 };
        let shift = |ray: &Ray<f64>, off: f64| slid(ray, &hit, off * DVec3::Y).origin - ray.origin;
        for off in [1e-3, -1e-3] {
            let expected = DVec3::new(-off * 0.8 / 0.6, off, 0.0);
            assert!(shift(&ray, off).distance(expected) < 1e-12, "{off}: {}", shift(&ray, off));
        }
        let level = Ray { direction: DVec3::X, ..ray };
        assert_eq!(shift(&level, 1e-3), DVec3::ZERO);
        let nearly_level = Ray { direction: DVec3::new(1.0, -1e-9, 0.0), ..ray };
        assert!((shift(&nearly_level, 1e-3).length() - hit.t).abs() < 1e-12, "no farther than to the eye");
    }

    /// On a ground of 200,000 units, the distance of a hit may be wrong by a unit. In this test, a hit that
    /// is nearer to the eye is also nearer to the light.
    #[test]
    fn a_hit_on_a_large_triangle_may_be_brighter_than_the_exact_one() {
        let brightest = |half: f32| {
            let mut scene = fixtures::single_triangle();
            let mesh = scene.mesh_mut();
            mesh.positions = vec![vec3(-half, -1.0, -half), vec3(half, -1.0, -half), vec3(0.0, -1.0, half)];
            mesh.normals.fill(Vec3::Y);
            mesh.materials[0].glossy = Vec3::ZERO;
            scene.lights[0].position = vec3(0.0, 2.0, -5.0);
            let caster = Caster::new(&scene, [80, 50], Exhaustive::new(&scene.mesh, Culling::None));
            let frame = scene.camera.pixel_frame(80, 50);
            let seen = Seen::of(&scene, Sample::CENTRE, [40, 30]);
            let result =
                sample(&Asked { caster: &caster, frame: &frame, bias: 1e-4, seen, centre: [40.5, 30.5] });
            assert!(result.hit && result.radiance.x > 0.0);
            result.range[1].x / result.radiance.x
        };
        let [small, large] = [10.0, 1e5].map(brightest);
        assert!(small < 1.001 && large > 1.2, "{small} {large}");
    }

    /// The triangle is behind the camera, so all rays reach the sky's picture.
    #[test]
    fn the_colours_of_a_skys_picture_are_found_quickly_too() {
        let mut scene = fixtures::single_triangle();
        scene.mesh_mut().positions.iter_mut().for_each(|corner| corner.z += 10.0);
        let texels = [[1.0, 0.5, 0.25], [0.0, 0.5, 1.0], [2.0, 0.0, 1.0], [0.25, 1.0, 0.0]];
        let picture = SkyPicture { size: [4, 1], texels: texels.into(), ahead: Vec3::Z, is_seen: true };
        let (dark, picture) = (Vec3::ZERO, Some(picture.into()));
        scene.sky = Some(Sky { zenith: dark, horizon: dark, up: Vec3::Y, reach: f32::MAX, picture });
        let percent = quickly(&scene, Culling::None);
        assert!(percent >= 50, "{percent} of 100");
    }

    #[test]
    fn neither_near_planes_nor_lights_on_surfaces_nor_coincident_ones_mislead_it() {
        let mut near = fixtures::sphere(12);
        near.camera.z_near = 2.0;
        let mut light_in_ground = fixtures::figure_4();
        light_in_ground.lights[0].position = vec3(0.0, -1.0, -2.0);
        let mut light_in_triangle = fixtures::figure_4();
        let [a, b, c] = light_in_triangle.mesh.corners(&light_in_triangle.mesh.triangles[0]);
        light_in_triangle.lights[0].position = (a + b + c) / 3.0;
        let mut twice = fixtures::figure_4();
        twice.mesh_mut().append((*fixtures::figure_4().mesh).clone());
        let mut under_sky = fixtures::pyramid_upper();
        under_sky.sky =
            Some(Sky { zenith: Vec3::ONE, horizon: Vec3::ZERO, up: Vec3::Y, reach: f32::MAX, picture: None });
        for scene in [near, light_in_ground, light_in_triangle, twice, under_sky] {
            for culling in [Culling::None, Culling::Back] {
                quickly(&scene, culling);
            }
        }
    }

    #[test]
    fn a_triangle_with_holes_neither_is_hit_nor_blocks_the_light_for_sure() {
        let mut scene = fixtures::figure_4();
        // The first two triangles, of opposite orientation, become completely transparent; the ground stays
        // solid.
        fixtures::make_holes(scene.mesh_mut(), 2);
        for culling in [Culling::None, Culling::Back] {
            quickly(&scene, culling);
        }
    }
}
