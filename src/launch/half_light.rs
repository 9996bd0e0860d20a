//! Casts soft light at half resolution. Two pictures of half the width and height are cast, one with and one without
//! shadows. One kernel filters the ratio of the picture with shadows to the picture without shadows. Another kernel
//! multiplies the light from surfaces in the whole picture (the picture of full size) by the filtered ratio of the two
//! small pictures.

use super::arguments::Arguments;
use super::buffers::allocate;
use super::caster::Caster;
use super::frame::{FrameTimes, Pass};
use super::setup::{Setup, background_arguments};
use super::steps::{Extent, Step};
use super::{LaunchError, Queue};
use crate::clock::ms_since;
use crate::image::Radiance;
use crate::manifest::Role;
use crate::reference::half_light::HalfPictures;
use crate::scene::{Camera, SampleLight, Sampling, Scene};
use ocl::Buffer;
use ocl::prm::{Float4, Int2};
use std::time::Instant;

/// The parts from which a picture with soft light at half resolution is computed.
pub struct LightParts {
    /// The whole picture's unoccluded light.
    pub whole: Radiance,
    /// Number of pixels of the whole picture that hit something.
    pub hits: usize,
    /// For each pixel of the whole picture, the share of its samples that hit something.
    pub hit_shares: Vec<f32>,
    /// The half picture (half the width and height) with shadows: light that is blocked does not arrive at the
    /// surfaces.
    pub lit: Radiance,
    /// The half picture (half the width and height) with unoccluded light (nothing blocks any light).
    pub unoccluded: Radiance,
    /// For each pixel of the half pictures, the share of its samples that hit something.
    pub half_hit_shares: Vec<f32>,
}

impl LightParts {
    /// Returns the two half pictures, and the shares of their samples that hit something.
    pub fn halves(&self) -> HalfPictures<'_> {
        HalfPictures { lit: &self.lit, unoccluded: &self.unoccluded, hit_shares: &self.half_hit_shares }
    }
}

/// The two half pictures (half the width and height) of soft light: one with shadows, and one with unoccluded light.
/// One kernel filters the ratio of these pictures, and another multiplies the light from surfaces in the whole picture
/// by the filtered ratio.
pub(super) struct HalfLight {
    /// The half picture (half the width and height) with shadows: light that is blocked does not arrive at the
    /// surfaces.
    lit: Caster,
    /// The half picture (half the width and height) with unoccluded light (nothing blocks any light).
    unoccluded: Caster,
    filter: Step,
    apply: Step,
    /// The whole picture's size. If the width or the height is odd, the half pictures have a slightly different aspect
    /// ratio, so the camera of the half pictures needs the whole picture's size to show the same view.
    whole_size: [u32; 2],
}

impl HalfLight {
    /// Makes the casters of the two half pictures (half the width and height) of a frame whose whole picture is
    /// `image`. Also makes the kernel that filters the ratio of the half pictures, and the kernel that multiplies
    /// `image` by the filtered ratio. All these kernels belong to the frame's program.
    pub fn new(setup: &Setup<'_>, image: &Buffer<Float4>) -> Result<Self, LaunchError> {
        let workload = setup.workload.halved();
        let half = Setup { workload: &workload, ..*setup };
        let [lit, unoccluded] = [Caster::alone(half)?, Caster::alone(half)?];
        let size = |[width, height]: [u32; 2]| Int2::new(width as i32, height as i32);
        let ratios = allocate::<Float4>(setup.queue, workload.pixels() as usize)?;
        let arguments = background_arguments(Arguments::default(), setup.scene);
        let arguments = arguments.with("half_lit", lit.image()).with("half_unoccluded", unoccluded.image());
        let arguments = arguments.with("half_size", size(workload.image_size)).with("ratios", &ratios);
        let arguments = arguments.with("image_size", size(setup.workload.image_size)).with("image", image);
        let rays = setup.strategy.width.rays();
        let kernel = |role: Role, [across, down]: [u32; 2]| {
            let items = [(across as usize).div_ceil(rays), down as usize];
            setup.row_kernel(setup.kernel_for(role)?, &arguments, items).map(Step::Run)
        };
        let filter = kernel(Role::FilterLight, workload.image_size)?;
        let apply = kernel(Role::ApplyLight, setup.workload.image_size)?;
        Ok(Self { lit, unoccluded, filter, apply, whole_size: setup.workload.image_size })
    }

    /// Casts soft light in two half pictures (half the width and height): with shadows, and without shadows. Returns
    /// the sums of the times of the two half pictures.
    pub fn cast(&self, camera: &Camera, sampling: &Sampling) -> Result<FrameTimes, LaunchError> {
        let camera = camera.covering(self.whole_size);
        let cast = |caster: &Caster, light| caster.cast_round(&camera, &sampling.of_half_light(light), None);
        let lit = cast(&self.lit, SampleLight::Interleaved)?;
        Ok(lit.and(&cast(&self.unoccluded, SampleLight::Unoccluded)?))
    }

    /// Filters the ratio of the half picture with shadows to the half picture with unoccluded light, and multiplies the
    /// light from surfaces in the whole picture by the filtered ratio. Returns the total times of the filtering kernel
    /// and the multiplying kernel.
    pub fn apply(&self, queue: &Queue) -> Result<FrameTimes, LaunchError> {
        let start = Instant::now();
        let steps = [&self.filter, &self.apply];
        let events =
            steps.map(|step| Ok::<_, LaunchError>((Pass::Whole, step.enqueue(queue, Extent::default())?)));
        let events = events.into_iter().collect::<Result<Vec<_>, _>>()?;
        queue.commands.finish()?;
        Ok(FrameTimes::of(&events, ms_since(start), 1)?)
    }

    /// Sets the background and the shadow bias of the two half pictures for soft light to those of `scene`. Also sets
    /// the background for the kernel that multiplies the whole picture. (The shadow bias is the distance between a
    /// surface and the nearer end of a shadow ray.)
    pub fn show_background(&self, scene: &Scene) -> Result<(), LaunchError> {
        let arguments = background_arguments(Arguments::default(), scene);
        self.apply.kernel().map_or(Ok(()), |kernel| arguments.rebind(kernel))?;
        self.lit.show_background(scene)?;
        self.unoccluded.show_background(scene)
    }

    /// Reads, for each pixel of the half pictures, the share of its samples that hit something.
    pub fn read_hit_shares(&self) -> Result<Vec<f32>, LaunchError> {
        self.unoccluded.read_hit_shares()
    }

    /// Reads the half picture with shadows, and the half picture with unoccluded light.
    pub fn read(&self) -> Result<[Radiance; 2], LaunchError> {
        Ok([self.lit.read()?.0, self.unoccluded.read()?.0])
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use crate::device::discover;
    use crate::image::{Radiance, relative_difference};
    use crate::launch::Session;
    use crate::program::Sources;
    use crate::reference::fixtures;
    use crate::reference::half_light::with_half_light;
    use crate::scene::{Sampling, Scene, Shot, Sky, load_scene_for};
    use crate::strategy::preset;
    use glam::Vec3;
    use std::path::Path;
    use std::sync::Arc;

    /// Sizes of the pictures to be filtered. If the width is even, kernels with vectors of 16 pixels read the half
    /// pictures in a quicker way than if the width is odd. Such vectors fill the rows of the first picture exactly, but
    /// not the rows of the other pictures.
    const SIZES: [[u32; 2]; 5] = [[96, 64], [75, 61], [38, 22], [7, 5], [1, 1]];

    /// Compares the device's filter with the reference filter in double precision, for single rays (`bvh`) and for
    /// vectors of 16 rays (`tile` and `bvh-packet`).
    #[test]
    fn a_picture_is_what_the_filter_makes_of_its_parts() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/table/globe.obj");
        let shot = Shot { dressed: true, ..Shot::SQUARE };
        let scene = Arc::new(load_scene_for(&path, &[], shot).unwrap().scene);
        let sampling = Sampling { first: 1, half_light: 2, ..Sampling::all(6) };
        // Tiles that work-items share have the same filter as `bvh`, and take PoCL half a minute to compile.
        // tests/half_light.rs verifies their pictures.
        for name in ["tile", "bvh", "bvh-packet"] {
            let session = Session::open(&device, &Sources::Embedded, Arc::clone(&scene)).unwrap();
            let mut session = session.with_sampling(sampling);
            let strategy = preset(name).unwrap().strategy;
            for size in SIZES {
                let local_size = strategy.local_size(&device.info.limits, [1, 1]);
                let prepared = session.prepare(&strategy, size, local_size);
                let caster = prepared.map_err(|refused| refused.reason()).unwrap().caster();
                let caster = caster.map_err(|refused| refused.reason()).unwrap();
                caster.cast_samples(&scene.camera, &sampling).unwrap();
                let picture = caster.read().unwrap().0;
                let parts = caster.cast_parts(&scene.camera, &sampling).unwrap().expect("soft light");
                assert_eq!([parts.lit.width, parts.lit.height], size.map(|side| side.div_ceil(2)));
                let background = scene.background.as_dvec3();
                let expected = with_half_light(&parts.whole, &parts.hit_shares, &parts.halves(), background);
                let pixels = picture.pixels.iter().zip(&expected.pixels);
                let largest = pixels.map(|(a, b)| relative_difference(*a, *b, 1e-4)).fold(0.0, f64::max);
                assert!(largest < 1e-4, "{name}, {size:?}: {largest}");
                // If the picture has more than one pixel, some of its pixels are in shadow.
                let darker =
                    parts.whole.pixels.iter().zip(&picture.pixels).filter(|(a, b)| b[1] < 0.9 * a[1]);
                assert!(darker.count() * 50 > picture.pixels.len() || size == [1, 1], "{name}, {size:?}");
            }
        }
    }

    /// In a half picture, the points of lights repeat every 4 pixels across and down. With four samples per pixel, a
    /// vector of a tile covers only four pixels, so that neighbouring vectors need different points.
    #[test]
    fn half_pictures_have_the_same_points_in_tiles_as_for_single_rays() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/table/globe.obj");
        let shot = Shot { dressed: true, ..Shot::SQUARE };
        let scene = Arc::new(load_scene_for(&path, &[], shot).unwrap().scene);
        for half_light in [2, 4] {
            let sampling = Sampling { first: 1, half_light, ..Sampling::all(6) };
            let [tiles, single] = ["tile", "bvh"].map(|name| {
                let session = Session::open(&device, &Sources::Embedded, Arc::clone(&scene)).unwrap();
                let strategy = preset(name).unwrap().strategy;
                let local_size = strategy.local_size(&device.info.limits, [1, 1]);
                let prepared = session.with_sampling(sampling).prepare(&strategy, [96, 64], local_size);
                let caster = prepared.map_err(|refused| refused.reason()).unwrap().caster();
                let caster = caster.map_err(|refused| refused.reason()).unwrap();
                caster.cast_parts(&scene.camera, &sampling).unwrap().expect("soft light").lit
            });
            let pixels = tiles.pixels.iter().zip(&single.pixels);
            let apart = pixels.filter(|(a, b)| relative_difference(**a, **b, 1e-4) > 1e-3).count();
            // At edges, rounding decides what a ray hits.
            assert!(apart * 50 < tiles.pixels.len(), "{half_light} samples: {apart} pixels");
        }
    }

    /// At the edges of surfaces, a pixel's light consists of the surface's light, which is filtered, and of
    /// the background's light, which is not filtered.
    #[test]
    fn the_background_of_another_scene_takes_the_place_of_the_old_one() {
        let sky = Sky { zenith: Vec3::ONE, horizon: Vec3::ZERO, up: Vec3::Y, reach: 1.0, picture: None };
        let before = Scene { sky: Some(sky), background: Vec3::ZERO, ..fixtures::single_triangle() };
        let after = Scene { background: Vec3::new(0.3, 0.2, 0.1), ..before.clone() };
        let [before, after] = [before, after].map(Arc::new);
        let expected = last_of(&[&after, &after]);
        assert!(last_of(&[&before, &after]) == expected, "another picture");
        assert!(last_of(&[&after, &before]) != expected, "the background is not seen");
    }

    /// If all light is n times as bright, the picture is n times as bright, too. The filter computes fourth powers of
    /// light, which must stay within the range of single precision.
    #[test]
    fn light_of_any_brightness_is_filtered() {
        let picture = |brightness: f32| {
            let mut scene = fixtures::figure_4();
            let zenith = Vec3::splat(0.1 * brightness);
            scene.sky = Some(Sky { zenith, horizon: zenith, up: Vec3::Y, reach: 10.0, picture: None });
            scene.background *= brightness;
            scene.lights.iter_mut().for_each(|light| light.power *= brightness);
            last_of(&[&Arc::new(scene)])
        };
        let usual = picture(1.0);
        for brightness in [1e12, 1e-12] {
            let scaled = picture(brightness);
            let pixels = scaled.pixels.iter().zip(&usual.pixels);
            let difference =
                |(a, b): (&[f32; 3], &[f32; 3])| relative_difference(a.map(|a| a / brightness), *b, 1e-4);
            let largest = pixels.map(difference).fold(0.0, f64::max);
            assert!(largest < 1e-3, "{brightness:e}: {largest}");
        }
    }

    /// Casts pictures of several scenes with the same caster, and returns the last picture.
    fn last_of(scenes: &[&Arc<Scene>]) -> Radiance {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let sampling = Sampling { half_light: 2, ..Sampling::all(4) };
        let session = Session::open(&device, &Sources::Embedded, Arc::clone(scenes[0])).unwrap();
        let mut session = session.with_sampling(sampling);
        let prepared = session.prepare(&preset("bvh").unwrap().strategy, [38, 22], [1, 1]);
        let mut prepared = prepared.map_err(|refused| refused.reason()).unwrap();
        let caster = prepared.caster().map_err(|refused| refused.reason()).unwrap();
        for scene in scenes {
            assert!(prepared.show(scene, &caster).unwrap());
            caster.cast_samples(&scene.camera, &sampling).unwrap();
        }
        caster.read().unwrap().0
    }
}
