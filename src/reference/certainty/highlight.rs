//! Makes sharp highlights as much brighter, and as much darker, as rounding may make them.

use super::super::intersect::Hit;
use super::super::pixel_sample::PixelSample;
use super::super::ray::Ray;
use super::super::shade::{Reaches, shade};
use super::{Asked, mesh_of, scene_of};
use crate::scene::{Material, MaterialKind};
use glam::Vec3;

/// By how much rounding may change a highlight, as a fraction of the highlight, if the exponent `shininess` is 1:
/// five rounding errors of single precision. A highlight is a cosine to the power of `shininess`. Rounding
/// changes the cosine, because the normal and the half vector are rounded; the power multiplies the cosine's
/// error by `shininess`. Nudges (small turns) of the pixel's ray do not reveal this error, since they hardly
/// change the cosine in the middle of a highlight.
const HIGHLIGHT_ERROR: f64 = 3e-7;
/// Up to this `shininess`, rounding changes a highlight by less than a third of the tolerance of certain pixels, so
/// such highlights are not changed.
const BROAD: f32 = 1000.0;

impl Asked<'_> {
    /// Includes in `sample` the values that a hit's radiance takes if rounding makes the highlights of lights
    /// brighter or darker (see [`HIGHLIGHT_ERROR`]). `reaches` tests whether a light or the sky is visible.
    pub(super) fn change_highlights(
        &self,
        sample: &mut PixelSample,
        (ray, hit): (&Ray<f64>, &Hit<f64>),
        reaches: Reaches<'_, f64>,
    ) {
        let scene = self.caster.scene();
        let triangle = &scene.mesh.triangles[hit.triangle as usize];
        let material = scene.mesh.material(triangle);
        if material.kind == MaterialKind::Lambertian || material.shininess <= BROAD {
            return;
        }
        // A triangle that reflects nothing but the highlights of lights. The sky is left out, since the sky's
        // reflection is no power of a cosine.
        let only_glossy =
            Material { lambertian: Vec3::ZERO, emitted: Vec3::ZERO, emission_texture: None, ..*material };
        let glossy = scene_of(mesh_of(&scene.mesh, triangle, only_glossy), scene);
        let mut lights = self.seen.clone();
        lights.sky = None;
        let highlights = shade(&glossy, &lights, (ray, 0.0), &Hit { triangle: 0, ..*hit }, reaches);
        let error = HIGHLIGHT_ERROR * f64::from(material.shininess);
        let radiance = self.caster.shaded(&self.seen, ray, Some(hit), reaches);
        // With s = `shininess`, a relative error e of the cosine multiplies the highlight by (1 + e)^s, which is
        // nearly exp(e s).
        [error, -error].into_iter().for_each(|error| sample.consider(radiance + highlights * error.exp_m1()));
    }
}

#[cfg(test)]
mod tests {
    use super::super::{quick_sample, sample};
    use super::*;
    use crate::image::RELATIVE_LIMIT;
    use crate::reference::cast::Caster;
    use crate::reference::fixtures;
    use crate::reference::pixel_sample::is_certain;
    use crate::reference::soft::Seen;
    use crate::reference::traverse::Exhaustive;
    use crate::reference::tree::Tree;
    use crate::scene::{Light, Sample, Scene};
    use crate::strategy::Culling;
    use glam::{DVec3, vec3};

    /// The highlight of a light close above a triangle.
    fn highlight(shininess: f32) -> Scene {
        let mut scene = fixtures::single_triangle();
        scene.camera.tan_half_fov = 0.5;
        let position = vec3(0.3, -0.2, -7.2);
        scene.lights = vec![Light { position, power: Vec3::splat(20.0), radius: 0.0, area: None }];
        let mesh = scene.mesh_mut();
        mesh.positions = vec![vec3(-3.0, -1.2, -2.0), vec3(4.0, -1.0, -2.5), vec3(0.3, -1.1, -9.0)];
        mesh.normals = vec![vec3(0.05, 1.0, 0.02), vec3(-0.1, 1.0, 0.03), vec3(0.02, 1.0, -0.1)];
        mesh.materials[0] = Material::blinn_phong(Vec3::splat(0.2), Vec3::splat(0.5), shininess);
        scene
    }

    /// In single precision, the cosine of a highlight has an error. The power `shininess` multiplies this
    /// error.
    #[test]
    fn the_range_of_a_sharp_highlight_contains_what_single_precision_makes_of_it() {
        let size = [1280, 800];
        for scene in [1e4, 1e5].map(highlight) {
            let tree = Tree::new(&scene.mesh, Culling::None);
            let caster = Caster::new(&scene, size, Exhaustive::<f64>::new(&scene.mesh, Culling::None));
            let rounded = Caster::new(&scene, size, Exhaustive::<f32>::new(&scene.mesh, Culling::None));
            let frame = scene.camera.pixel_frame(size[0], size[1]);
            let bias = f64::from(scene.shadow_bias);
            for [x, y] in (750..780_u16).flat_map(|y| (675..715).map(move |x| [x, y])) {
                let seen = Seen::of(&scene, Sample::CENTRE, [x, y].map(u32::from));
                let (ray, hit) = rounded.look(f32::from(x) + 0.5, f32::from(y) + 0.5);
                let actual = rounded.radiance(&seen, &ray, hit.as_ref(), scene.shadow_bias).as_dvec3();
                let centre = [x, y].map(|coordinate| f64::from(coordinate) + 0.5);
                let asked = Asked { caster: &caster, frame: &frame, bias, seen, centre };
                let sample = sample(&asked);
                assert!(quick_sample(&asked, &tree).is_none_or(|quick| quick == sample), "({x}, {y})");
                let [low, high] = if is_certain(&sample, 1e-9) { [sample.radiance; 2] } else { sample.range };
                let slack = DVec3::splat(RELATIVE_LIMIT * high.max_element());
                let is_within = actual.cmpge(low - slack).all() && actual.cmple(high + slack).all();
                assert!(is_within, "({x}, {y}): {actual}, {sample:?}");
            }
        }
    }

    /// At a shininess of 2000, rounding changes a highlight by up to 2000 * 3e-7 of the highlight.
    #[test]
    fn only_sharp_highlights_become_brighter_and_darker() {
        let changed = |scene: &Scene| {
            let caster = Caster::new(scene, [1280, 800], Exhaustive::<f64>::new(&scene.mesh, Culling::None));
            let frame = scene.camera.pixel_frame(1280, 800);
            let seen = Seen::of(scene, Sample::CENTRE, [695, 765]);
            let (ray, Some(hit)) = caster.look(695.5, 765.5) else { panic!("the triangle is in the middle") };
            let mut sample = PixelSample::of(caster.radiance(&seen, &ray, Some(&hit), 1e-4), true);
            let asked = Asked { caster: &caster, frame: &frame, bias: 1e-4, seen, centre: [695.5, 765.5] };
            asked.change_highlights(&mut sample, (&ray, &hit), &|_| true);
            sample
        };
        assert_eq!(changed(&highlight(1000.0)).change, 0.0);
        let (sharp, mut dull) = (highlight(2000.0), highlight(2000.0));
        dull.mesh_mut().materials[0] = Material::lambertian(Vec3::splat(0.2));
        let (sharp, dull) = (changed(&sharp), changed(&dull));
        let glossy = sharp.radiance - dull.radiance;
        assert!(dull.change == 0.0 && glossy.min_element() > 0.0, "{dull:?}, {glossy}");
        let ends = [-6e-4_f64, 6e-4].map(|error| sharp.radiance + glossy * error.exp_m1());
        assert!(
            sharp.range.iter().zip(ends).all(|(a, b)| a.distance(b) < 1e-12),
            "{:?}, {ends:?}",
            sharp.range
        );
    }
}
