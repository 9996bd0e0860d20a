//! Checks a point before it is timed: the point must fit on its device, its program must build and run, and its image
//! must be right.

use super::draft::Drafter;
use super::protocol::{Built, Phase};
use super::ready::{Ready, cast_frames};
use super::reference_cache::ReferenceCache;
use super::{Pictures, Point, PointFailure, Work, host, views};
use crate::anchor::Anchor;
use crate::config::Baseline;
use crate::device::{Device, DeviceInfo};
use crate::error::{Error, Result};
use crate::image::Radiance;
use crate::launch::{Queue, Refused, Session};
use crate::program::BuiltProgram;
use crate::record::{Outcome, Record};
use crate::scene::{Sampling, Scene};
use crate::strategy::{Culling, Requirements, Strategy};
use crate::verify::verify;
use std::sync::Arc;
use std::time::Instant;

/// Checks the points of one device one after another, and stores the data that several points share.
pub struct Checker<'a> {
    drafter: Drafter<'a>,
    device: Option<(&'a Device, Queue)>,
    /// The scene of the points that are being checked, loaded on the device.
    session: Option<Session>,
    pictures: Pictures,
    references: ReferenceCache,
    /// Is called when another phase of the work on a request begins.
    tells: Box<dyn Fn(Phase)>,
}

/// The image of a point of the experiment, and the caster that made the image.
struct Cast {
    image: Radiance,
    /// Number of pixels whose rays hit something, if the caster counted these pixels.
    hits: Option<usize>,
    culling: Culling,
    ready: Ready,
}

impl<'a> Checker<'a> {
    /// Opens the device on which points will be checked. If `device` is `None`, only casters on the host can
    /// be checked.
    pub fn open(drafter: Drafter<'a>, device: Option<&'a Device>, pictures: Pictures) -> Result<Self> {
        let device = match device {
            Some(device) => Some((device, Queue::open(device)?)),
            None => None,
        };
        let references = ReferenceCache::default();
        Ok(Self { drafter, device, session: None, pictures, references, tells: Box::new(|_| {}) })
    }

    /// Lets the checker call `tells` whenever another phase of the work on a request begins.
    #[must_use]
    pub fn telling(self, tells: impl Fn(Phase) + 'static) -> Self {
        Self { tells: Box::new(tells), ..self }
    }

    /// Tells the run that another phase of the work on a request begins.
    pub fn begin(&self, phase: Phase) {
        (self.tells)(phase);
    }

    /// Returns the properties of the device on which points are checked; `None` if there is no device.
    pub fn device(&self) -> Option<&'a DeviceInfo> {
        self.device.as_ref().map(|(device, _)| &device.info)
    }

    /// Builds the device's anchor (a fixed kernel that a run times in turn with its points). Returns an error if there
    /// is no device.
    pub fn anchor(&self) -> Result<Anchor> {
        let (device, queue) = self.device.as_ref().ok_or_else(|| Error::run("the host has no anchor"))?;
        Anchor::build(queue, device.info.limits.compute_units)
    }

    /// Frees the current scene on the device, before another scene is loaded.
    pub fn leave_scene(&mut self) {
        self.session = None;
    }

    /// Returns how many samples each pixel of a point's image gets.
    fn sampling(&self, point: &Point) -> Sampling {
        self.drafter.experiment.scenes[point.scene].sampling()
    }

    /// Returns the session in which a point's scene is loaded on the device; `None` without a device. If the
    /// experiment imitates a smaller device, the session has that device's limits. Each scene of the
    /// experiment has a session of its own, with the scene's number of samples per pixel.
    fn session(&mut self, point: &Point, scene: &Arc<Scene>) -> Option<&mut Session> {
        let sampling = self.sampling(point);
        let (device, queue) = self.device.as_ref()?;
        let Drafter { experiment, sources } = self.drafter;
        self.session.take_if(|session| !session.is_of(scene));
        Some(self.session.get_or_insert_with(|| {
            let session = Session::new(queue.clone(), &device.info, sources, Arc::clone(scene));
            let limits = experiment.emulate.apply(device.info.limits);
            session.limited(limits).verifying(true).with_sampling(sampling)
        }))
    }

    /// Builds the program with which a point of the experiment is measured, and stores the program in the
    /// cache. After the build, casts a frame, since some drivers compile parts of a program only when a
    /// kernel first runs. Returns `None` if the program cannot be built, and for a caster on the host.
    pub fn build(&mut self, point: &Point, scene: &Arc<Scene>) -> Option<Built> {
        let Work::Kernel { strategy, local_size } = point.work else { return None };
        let strategy = &self.drafter.experiment.strategies[strategy].strategy;
        build_kernel(self.session(point, scene)?, scene, strategy, local_size).ok()
    }

    /// Casts a point's image once, and compares the image with the reference picture. If the image has the
    /// hash `verified`, an identical image has been compared before, and the comparison is skipped. Adds the
    /// results to `record`. Returns the ready caster or, as the inner error, the reason why the point fails.
    /// The outer error is a mistake of the user or an error of the run.
    pub fn check(
        &mut self,
        point: &Point,
        scene: &Arc<Scene>,
        verified: Option<&str>,
        record: &mut Record,
    ) -> Result<std::result::Result<Ready, PointFailure>> {
        let cast = match point.work {
            Work::Kernel { strategy, local_size } => {
                let strategy = &self.drafter.experiment.strategies[strategy].strategy;
                match self.session(point, scene) {
                    Some(session) => cast_kernel(session, scene, (strategy, local_size), record),
                    None => return Ok(Err(PointFailure::no_device())),
                }
            }
            Work::Host(baseline) => match host::refusal(baseline, &self.sampling(point)) {
                Some(reason) => return Ok(Err(PointFailure::new(Outcome::Infeasible, reason))),
                None => Ok(cast_host(baseline, scene, point.image_size)),
            },
        };
        match cast {
            Ok(cast) if verified == Some(&*Pictures::hash(&cast.image)) => Ok(Ok(cast.ready)),
            Ok(cast) => Ok(self.judge(&cast, point, scene, record)?.map(|()| cast.ready)),
            Err(Refused::Mistake(error)) => Err(error),
            Err(refused) => Ok(Err(PointFailure::of(&refused, self.device()))),
        }
    }

    /// Compares an image with the reference, and saves the pictures of the comparison. Adds the results of
    /// the comparison to `record`. If the image is wrong, the inner error is the point's failure.
    fn judge(
        &mut self,
        cast: &Cast,
        point: &Point,
        scene: &Scene,
        record: &mut Record,
    ) -> Result<std::result::Result<(), PointFailure>> {
        self.begin(Phase::Host);
        record.image_hash = Some(Pictures::hash(&cast.image));
        let sampled = (scene, &self.sampling(point));
        let expected = self.references.reference(point.scene, sampled, record.image_size, cast.culling);
        let verdict = verify(&cast.image, cast.hits, expected, scene.display);
        // A caster on the host does not count shadow rays, so their number is computed from the reference's hits.
        record.shadow_rays.get_or_insert((expected.hits * scene.shadow_rays_per_hit()) as u64);
        views::keep(&mut self.pictures, record, &cast.image, expected, scene, cast.culling)?;
        record.max_difference = verdict.max_difference.filter(|difference| difference.is_finite());
        record.worst_pixel = verdict.worst_pixel;
        record.uncertain_pixels = Some(verdict.uncertain_pixels as u64);
        record.hits = Some(expected.hits as u64);
        record.uncertain_hits = Some(expected.uncertain_hits() as u64);
        record.unexplained_pixels = Some(verdict.unexplained_pixels as u64);
        if verdict.ok {
            return Ok(Ok(()));
        }
        Ok(Err(PointFailure::wrong_image(verdict.reason.unwrap_or_default())))
    }
}

/// The image size of the frame that is cast after a build. A frame of one work-group is enough to make
/// drivers compile everything, since the compiled code does not depend on the image size.
pub(super) const SMALLEST: [u32; 2] = [1, 1];

/// Returns by how many milliseconds the launch of a frame took longer than the frame itself. During a
/// program's first launch, drivers may compile.
fn beside_frame_ms(launch_ms: f64, frame_ms: f64) -> f64 {
    (launch_ms - frame_ms).max(0.0)
}

fn build_kernel(
    session: &mut Session,
    scene: &Scene,
    strategy: &Strategy,
    local_size: [u32; 2],
) -> std::result::Result<Built, Refused> {
    let prepared = session.prepare(strategy, SMALLEST, local_size)?;
    let start = Instant::now();
    // If the kernel cannot be launched, the later check of the point reports the error.
    let frame = prepared.caster().map(|caster| cast_frames(&caster, scene, &prepared.sampling, 1));
    let frame_ms = frame.ok().and_then(std::result::Result::ok).map_or(0.0, |frame| frame.frame_ms);
    let key = prepared.program.stored_as().map(str::to_owned);
    let launch_ms = beside_frame_ms(start.elapsed().as_secs_f64() * 1e3, frame_ms);
    prepared.program.rehearse();
    let lacks_log = prepared.program.lacks_log();
    let BuiltProgram { build_ms, from_cache, .. } = prepared.program;
    Ok(Built { build_ms: build_ms + launch_ms, from_cache, key, lacks_log })
}

/// Casts the first frame of a point's kernel; drivers may still compile during this frame. Adds the memory needs, the
/// program, the build times, the properties of the compiled kernels and the number of shadow rays to the record.
fn cast_kernel(
    session: &mut Session,
    scene: &Scene,
    (strategy, local_size): (&Strategy, [u32; 2]),
    record: &mut Record,
) -> std::result::Result<Cast, Refused> {
    let workload = session.workload(strategy, record.image_size, local_size)?;
    let needs = Requirements::of(strategy, &workload, session.builtins().lanes);
    record.local_bytes = Some(needs.local_bytes);
    record.constant_bytes = Some(needs.constant_bytes);
    record.scratch_bytes = Some(needs.scratch_bytes);
    record.private_bytes = Some(needs.private_bytes);
    let spec = session.spec(strategy, &workload)?;
    record.program_hash = Some(spec.hash());
    let prepared = session.build(strategy, &workload, spec)?;
    record.build_ms = Some(prepared.program.build_ms);
    record.build_from_cache = Some(prepared.program.from_cache);
    let caster = prepared.caster()?;
    record.records_ms = caster.records_ms();
    record.kernels = prepared.made(&caster, &prepared.program.log(), &prepared.program.ptx());
    let sampling = prepared.sampling;
    cast_frames(&caster, scene, &sampling, 1).map_err(Refused::at("the launch"))?;
    let reading = Refused::at("reading the image");
    let (image, hits) = caster.read().map_err(&reading)?;
    let hit_rays = match sampling.most {
        1 => hits as u64,
        samples => caster.read_sample_hits(samples).map_err(&reading)?,
    };
    record.shadow_rays = Some(hit_rays * (workload.lights + usize::from(workload.sky)) as u64);
    let ready = Ready::Kernel(Box::new(caster), sampling);
    Ok(Cast { image, hits: Some(hits), culling: strategy.culling, ready })
}

fn cast_host(baseline: Baseline, scene: &Scene, size: [u32; 2]) -> Cast {
    let (image, _) = host::cast(baseline, scene, size);
    Cast { image, hits: None, culling: Culling::None, ready: Ready::Host(baseline) }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::draft::Hashed;
    use super::super::{Plan, fixtures};
    use super::*;
    use crate::config::Experiment;
    use crate::device::{Device, discover};
    use crate::program::Sources;
    use crate::reference::{all_pixels, reference, reference_of};
    use crate::scene::Sample;
    use crate::strategy::Workload;
    use std::path::Path;

    /// Checks the last point of an experiment on a device, and saves the pictures in `folder`. `verified` is the hash
    /// of a picture that has been compared already.
    fn checked(
        experiment: &Experiment,
        device: &Device,
        folder: &Path,
        verified: Option<&str>,
    ) -> (Record, std::result::Result<(), PointFailure>, Option<Built>) {
        let drafter = Drafter { experiment, sources: &Sources::Embedded };
        let at = Hashed::load(&experiment.scenes[0], [8, 5]).unwrap();
        let point = *Plan::new(experiment, 1).points.last().unwrap();
        let mut record = drafter.draft(&point, Some(&device.info), &at).unwrap();
        std::fs::create_dir_all(folder.join("images")).unwrap();
        let mut checker = Checker::open(drafter, Some(device), Pictures::of(folder)).unwrap();
        let outcome = checker.check(&point, &at.scene, verified, &mut record).unwrap().map(drop);
        (record, outcome, checker.build(&point, &at.scene))
    }

    #[test]
    fn the_frame_of_the_first_launch_is_no_time_of_the_build() {
        assert_eq!([beside_frame_ms(10.0, 4.0), beside_frame_ms(3.0, 4.0)], [6.0, 0.0]);
    }

    #[test]
    fn a_checked_record_has_what_the_point_needs_and_how_its_picture_compares() {
        let folder = tempfile::tempdir().unwrap();
        let device = discover(&Sources::Embedded).unwrap().remove(0);
        let experiment = fixtures::experiment_of(
            "[[scene]]\nfile = 'scenes/pyramid-upper.toml'\n\
             set = { light = [[{ position = [1, 3, 1], power = 10 }, { position = [-1, 3, 1], power = 5 }]], \
             \"sky.zenith\" = 1 }\n\
             [[strategy]]\npreset = 'naive'\nvectors = 'global'\ntriangles = 'constant'\nlocal_sizes = [[4, 2]]",
        );
        let (record, outcome, built) = checked(&experiment, &device, folder.path(), None);
        outcome.unwrap();
        let scene = experiment.scenes[0].load([8, 5]).unwrap().scene;
        let needs = Requirements::of(
            &experiment.strategies[0].strategy,
            &Workload::of(&scene, record.image_size, [4, 2]),
            device.info.limits.lane_operations,
        );
        assert!(needs.scratch_bytes > 0 && needs.constant_bytes > 0, "the test needs different bytes");
        let bytes = [record.local_bytes, record.constant_bytes, record.scratch_bytes, record.private_bytes];
        let needed = [needs.local_bytes, needs.constant_bytes, needs.scratch_bytes, needs.private_bytes];
        assert_eq!(bytes, needed.map(Some));
        let expected = reference(&scene, record.image_size, Culling::None);
        // The scene has two lights and a sky, so each hit has three shadow rays.
        assert_eq!(record.shadow_rays, Some((expected.hits * 3) as u64));
        assert!(expected.hits > 0 && scene.lights.len() == 2);
        assert_eq!(record.unexplained_pixels, Some(0));
        assert!(record.worst_pixel.is_none_or(|[x, y]| x < 8 && y < 5));
        assert!(record.max_difference.is_some_and(|difference| difference < 1e-3));
        assert_eq!(record.uncertain_pixels, Some(expected.doubts.len() as u64));
        let hits = [expected.hits, expected.uncertain_hits()].map(|count| Some(count as u64));
        assert_eq!([record.hits, record.uncertain_hits], hits);
        assert!(record.build_from_cache.is_some());
        assert!(
            record.build_ms.is_some_and(|ms| ms > 0.0) && built.is_some_and(|built| built.build_ms > 0.0)
        );
        assert!(folder.path().join(record.image.unwrap()).is_file());
        // A picture that has been compared with the reference is not compared again.
        let (again, outcome, _) = checked(&experiment, &device, folder.path(), record.image_hash.as_deref());
        assert!(outcome.is_ok() && again.max_difference.is_none() && again.image_hash.is_none());
        let (other, outcome, _) = checked(&experiment, &device, folder.path(), Some("another hash"));
        assert!(outcome.is_ok() && other.image_hash == record.image_hash);
    }

    /// The scene has a light with a radius and a sky, so each sample that hits something has two shadow rays.
    #[test]
    fn several_samples_per_pixel_are_verified_and_their_rays_are_counted() {
        let device = discover(&Sources::Embedded).unwrap().remove(0);
        let of = |preset: &str, samples: u32| {
            let experiment = fixtures::experiment_of(&format!(
                "[[scene]]\nfile = 'scenes/pyramid-upper.toml'\nsamples = {samples}\n\
                 set = {{ \"light.0.radius\" = 0.3, \"sky.zenith\" = 1 }}\n\
                 [[strategy]]\npreset = '{preset}'\nany_kind = true\nlocal_sizes = [1]"
            ));
            let folder = tempfile::tempdir().unwrap();
            let (record, outcome, built) = checked(&experiment, &device, folder.path(), None);
            outcome.unwrap();
            assert!(built.is_some());
            (record, experiment.scenes[0].clone())
        };
        for preset in ["bvh", "tile"] {
            let [(one, _), (six, chosen)] = [of(preset, 1), of(preset, 6)];
            let scene = chosen.load([8, 5]).unwrap().scene;
            let hits_of = |sample: &Sample| {
                reference_of(&scene, [8, 5], Culling::None, &all_pixels([8, 5]), (&[*sample], &|_| u32::MAX))
                    .hits
            };
            let hits: usize = chosen.sampling().rounds().concat().iter().map(hits_of).sum();
            let shadow_rays = six.shadow_rays.unwrap();
            // Rounding may decide whether a sample at an edge hits something.
            assert!(shadow_rays.abs_diff(2 * hits as u64) <= 4, "{preset}: {shadow_rays} {hits}");
            assert!(shadow_rays > 5 * one.shadow_rays.unwrap(), "{preset}");
            assert!(six.max_difference.is_some_and(|difference| difference < 1e-3), "{preset}");
            assert!(one.image_hash != six.image_hash);
        }
    }

    #[test]
    fn a_baseline_does_not_cast_several_samples_per_pixel() {
        let experiment = fixtures::experiment_of(
            "baselines = ['serial']\n[[scene]]\nfile = 'scenes/triangle.toml'\nsamples = 4",
        );
        let drafter = Drafter { experiment: &experiment, sources: &Sources::Embedded };
        let at = Hashed::load(&experiment.scenes[0], [8, 5]).unwrap();
        let point = Plan::new(&experiment, 0).points[0];
        let mut record = drafter.draft(&point, None, &at).unwrap();
        let mut checker = Checker::open(drafter, None, Pictures::of(Path::new("unused"))).unwrap();
        let failure = checker.check(&point, &at.scene, None, &mut record).unwrap().map(drop).unwrap_err();
        assert_eq!(failure.outcome, Outcome::Infeasible);
        assert_eq!(
            failure.reason,
            "serial-f32 casts only one sample per pixel, but the scene has samples = 4"
        );
    }

    /// A caster on the host counts no shadow rays. The scene has two lights, so each hit has two shadow rays.
    #[test]
    fn the_shadow_rays_of_a_caster_on_the_host_follow_from_the_hits() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("images")).unwrap();
        let experiment = fixtures::experiment_of(
            "baselines = ['serial']\n[[scene]]\nfile = 'scenes/pyramid-upper.toml'\n\
             set = { light = [[{ position = [1, 3, 1], power = 10 }, { position = [-1, 3, 1], power = 5 }]] }",
        );
        let drafter = Drafter { experiment: &experiment, sources: &Sources::Embedded };
        let at = Hashed::load(&experiment.scenes[0], [8, 5]).unwrap();
        let point = Plan::new(&experiment, 0).points[0];
        let mut record = drafter.draft(&point, None, &at).unwrap();
        let mut checker = Checker::open(drafter, None, Pictures::of(folder.path())).unwrap();
        assert!(checker.check(&point, &at.scene, None, &mut record).unwrap().is_ok());
        assert!(record.hits > Some(0));
        assert_eq!(record.shadow_rays, record.hits.map(|hits| 2 * hits));
    }

    #[test]
    fn a_point_is_held_to_the_limits_of_the_device_that_is_imitated() {
        let folder = tempfile::tempdir().unwrap();
        let device = discover(&Sources::Embedded).unwrap().remove(0);
        let lines = "local_sizes = [4]\nemulate = { local_bytes = 100 }";
        let text = format!("scenes = ['scenes/triangle.toml']\nstrategies = ['local-vectors']\n{lines}");
        let (record, outcome, built) = checked(&fixtures::experiment_of(&text), &device, folder.path(), None);
        let failure = outcome.unwrap_err();
        assert!(failure.write_into(record).reason.is_some_and(|reason| reason.contains("> 100 B")));
        assert!(built.is_none());
    }
}
