//! Running a plan: every group of comparable points in turn.

use super::bench::{Bench, Refusal, first_image};
use super::rounds::{Rounds, measure};
use super::{KeyParts, Observer, Plan, Point, Results, Work, host, key};
use crate::config::{Baseline, Experiment, NamedStrategy};
use crate::device::Device;
use crate::error::Result;
use crate::image::{Radiance, difference_image};
use crate::launch::{Caster, FrameTimes};
use crate::measure::{StopReason, StoppingRule, Summary};
use crate::program::Sources;
use crate::record::{HOST, Outcome, Record, Sample};
use crate::reference::{Reference, reference};
use crate::scene::{Scene, load_scene};
use crate::strategy::{Culling, Requirements, Traversal, Workload};
use crate::verify::verify;

/// What a run needs besides its observer.
pub struct Run<'a> {
    /// What is measured.
    pub experiment: &'a Experiment,
    /// On which devices.
    pub devices: &'a [&'a Device],
    /// Where kernels come from.
    pub sources: &'a Sources,
}

/// A point that passed verification and can be cast again and again.
enum Ready {
    Kernel(Box<Caster>),
    Host(Baseline),
}

/// A group of points while it is measured.
struct Session<'a> {
    scene: &'a Scene,
    points: Vec<(Record, Ready)>,
    results: &'a mut Results,
    observer: &'a mut dyn Observer,
    done: &'a mut Vec<Record>,
    labels: Vec<String>,
}

impl Run<'_> {
    /// The plan.
    pub fn plan(&self) -> Plan {
        Plan::new(self.experiment, self.devices.len())
    }

    /// Measures every point. Records are on disk when this returns, and all but the current group's when it fails.
    pub fn execute(&self, results: &mut Results, observer: &mut dyn Observer) -> Result<Vec<Record>> {
        let plan = self.plan();
        let mut scenes = self.load_scenes()?;
        let mut benches = Vec::new();
        for device in self.devices {
            benches.push(Bench::open(device, &self.experiment.limits, self.sources)?);
        }
        observer.begins(plan.points.len());
        let mut done = Vec::new();
        for group in plan.groups() {
            let Some(point) = group.first() else { continue };
            let scene = &mut scenes[point.scene];
            self.measure_group(group, scene, &mut benches, results, observer, &mut done)?;
        }
        observer.ends();
        results.summarise(&done, &self.experiment.question, &self.experiment.expectation)?;
        Ok(done)
    }

    fn load_scenes(&self) -> Result<Vec<Scene>> {
        self.experiment.scenes.iter().map(|path| load_scene(path).map(|loaded| loaded.scene)).collect()
    }

    /// Verifies the points of one scene, size and device, then times those that passed together.
    fn measure_group(
        &self,
        group: &[Point],
        scene: &Scene,
        benches: &mut [Bench],
        results: &mut Results,
        observer: &mut dyn Observer,
        done: &mut Vec<Record>,
    ) -> Result<()> {
        let mut oracle = Oracle::default();
        let mut ready = Vec::new();
        for bench in benches.iter_mut() {
            bench.forget_scene();
        }
        for point in group {
            let label = point.label(self.experiment);
            observer.works_on(&format!("checking {label}"));
            let mut record = self.draft(point, scene);
            match self.verify_point(point, scene, benches, &mut oracle, results, &mut record)? {
                Ok(caster) => ready.push((record, caster, label)),
                Err(refusal) => {
                    record.outcome = refusal.outcome;
                    record.reason = Some(refusal.reason);
                    keep(record, results, observer, done)?;
                }
            }
        }
        let timing = &self.experiment.timing;
        let rule = StoppingRule {
            min_samples: timing.min_samples as usize,
            max_samples: timing.max_samples as usize,
            relative_sigma: timing.relative_sigma,
            time_limit_ms: timing.time_limit_ms,
        };
        let labels = ready.iter().map(|(_, _, label)| label.clone()).collect();
        let points = ready.into_iter().map(|(record, caster, _)| (record, caster)).collect();
        let mut session = Session { scene, points, results, observer, done, labels };
        session.warm_up(timing.warmup, timing.time_limit_ms)?;
        let count = session.points.len();
        measure(count, &rule, timing.seed, &mut session)
    }

    /// A record with what is known before anything is tried.
    fn draft(&self, point: &Point, scene: &Scene) -> Record {
        let named = self.named(point);
        let (name, preset, strategy, local_size) = match point.work {
            Work::Host(baseline) => (baseline.name().to_owned(), None, baseline.strategy().to_owned(), None),
            Work::Kernel { local_size, .. } => {
                let named = named.cloned();
                let strategy = named.as_ref().map_or(String::new(), |named| named.strategy.to_string());
                let preset = named.as_ref().and_then(|named| named.preset.clone());
                (named.map_or(String::new(), |named| named.name), preset, strategy, Some(local_size))
            }
        };
        Record {
            scene: scene.name.clone(),
            device: point.device.map_or(HOST.to_owned(), |device| self.devices[device].info.name.clone()),
            name,
            preset,
            strategy,
            local_size,
            image_size: point.image_size,
            triangles: Some(scene.mesh.triangles.len() as u64),
            lights: Some(scene.lights.len() as u64),
            seed: Some(self.experiment.timing.seed),
            ..Record::default()
        }
    }

    fn named(&self, point: &Point) -> Option<&NamedStrategy> {
        match point.work {
            Work::Kernel { strategy, .. } => self.experiment.strategies.get(strategy),
            Work::Host(_) => None,
        }
    }

    /// Casts a point once and compares its image with the reference.
    fn verify_point(
        &self,
        point: &Point,
        scene: &Scene,
        benches: &mut [Bench],
        oracle: &mut Oracle,
        results: &mut Results,
        record: &mut Record,
    ) -> Result<std::result::Result<Ready, Refusal>> {
        let (image, ready, culling) = match (point.work, point.device) {
            (Work::Kernel { strategy, local_size }, Some(device)) => {
                let named = &self.experiment.strategies[strategy];
                let bench = &mut benches[device];
                let workload = Workload::of(scene, point.image_size, local_size);
                let spec = bench.spec(named, &workload)?;
                record.program_hash = Some(spec.hash());
                record.key = self.key(point, scene, record);
                let prepared = bench.prepare(named, &workload, scene, &spec, record);
                let caster = match prepared {
                    Ok(caster) => caster,
                    Err(refusal) => return Ok(Err(refusal)),
                };
                let (image, hits) = match first_image(&caster) {
                    Ok(first) => first,
                    Err(refusal) => return Ok(Err(refusal)),
                };
                record.shadow_rays = Some((hits * scene.lights.len()) as u64);
                (image, Ready::Kernel(Box::new(caster)), named.strategy.culling)
            }
            (Work::Host(baseline), _) => {
                record.key = self.key(point, scene, record);
                let (image, _) = host::cast(baseline, scene, point.image_size);
                (image, Ready::Host(baseline), Culling::None)
            }
            (Work::Kernel { .. }, None) => return Ok(Err(Refusal::no_device())),
        };
        let verdict = self.judge(&image, scene, culling, oracle, results, record)?;
        Ok(verdict.map(|()| ready))
    }

    /// Compares an image with the reference and keeps both pictures.
    fn judge(
        &self,
        image: &Radiance,
        scene: &Scene,
        culling: Culling,
        oracle: &mut Oracle,
        results: &mut Results,
        record: &mut Record,
    ) -> Result<std::result::Result<(), Refusal>> {
        let [width, height] = record.image_size;
        let expected = oracle.reference(scene, record.image_size, culling);
        let verdict = verify(image, expected, scene.display);
        results.picture(&format!("{}-{width}x{height}-reference", scene.name), &expected.radiance, scene.display)?;
        let name = format!("{}-{width}x{height}-{}-{}", scene.name, record.device, record.name);
        record.image = Some(results.picture(&name, image, scene.display)?);
        record.max_difference = Some(verdict.max_difference).filter(|difference| difference.is_finite());
        record.worst_pixel = verdict.worst_pixel;
        record.uncertain_pixels = Some(verdict.uncertain_pixels as u64);
        if verdict.ok {
            return Ok(Ok(()));
        }
        let local = record.local_size.map_or(String::new(), |[x, y]| format!("-{x}x{y}"));
        let picture = difference_image(image, &expected.radiance);
        record.difference_image = Some(results.difference(&format!("{name}{local}"), &picture)?);
        Ok(Err(Refusal { outcome: Outcome::WrongImage, reason: verdict.reason.unwrap_or_default() }))
    }

    fn key(&self, point: &Point, scene: &Scene, record: &Record) -> String {
        let by = |[x, y]: [u32; 2]| format!("{x}x{y}");
        let device = point.device.map_or(HOST.to_owned(), |device| self.devices[device].info.identity());
        key(&KeyParts {
            scene_hash: &scene.content_hash(),
            device: &device,
            limits: &self.experiment.limits.to_string(),
            strategy: &record.strategy,
            local_size: &record.local_size.map_or(String::new(), by),
            image_size: &by(point.image_size),
            program_hash: record.program_hash.as_deref().unwrap_or(env!("CARGO_PKG_VERSION")),
            timing: &self.experiment.timing.to_string(),
        })
    }
}

/// The references of one scene and size, made when first asked for.
#[derive(Default)]
struct Oracle {
    made: Vec<(Culling, Reference)>,
}

impl Oracle {
    fn reference(&mut self, scene: &Scene, size: [u32; 2], culling: Culling) -> &Reference {
        let place = self.made.iter().position(|(made, _)| *made == culling).unwrap_or_else(|| {
            self.made.push((culling, reference(scene, size, culling)));
            self.made.len() - 1
        });
        &self.made[place].1
    }
}

/// Completes a record: on disk, then heard of.
fn keep(
    mut record: Record,
    results: &mut Results,
    observer: &mut dyn Observer,
    done: &mut Vec<Record>,
) -> Result<()> {
    record.timestamp = Some(jiff::Timestamp::now().to_string());
    results.record(&record)?;
    observer.finished(&record);
    done.push(record);
    Ok(())
}

impl Session<'_> {
    /// Frames that are not kept. A point whose frames are as long as its time limit needs none.
    fn warm_up(&mut self, frames: u32, time_limit_ms: f64) -> Result<()> {
        for point in 0..self.points.len() {
            let mut spent_ms = 0.0;
            for _ in 0..frames {
                if spent_ms > 0.2 * time_limit_ms {
                    break;
                }
                let Ok(times) = self.frame(point) else { break };
                spent_ms += times.host_ms;
            }
        }
        Ok(())
    }

    fn frame(&mut self, point: usize) -> std::result::Result<FrameTimes, Refusal> {
        let (record, ready) = &self.points[point];
        match ready {
            Ready::Kernel(caster) => Ok(caster.cast()?),
            Ready::Host(baseline) => Ok(host::cast(*baseline, self.scene, record.image_size).1),
        }
    }
}

impl Rounds for Session<'_> {
    fn cast(&mut self, point: usize) -> Result<Option<FrameTimes>> {
        self.observer.works_on(&format!("timing {}", self.labels[point]));
        match self.frame(point) {
            Ok(times) => Ok(Some(times)),
            Err(refusal) => {
                let mut record = self.points[point].0.clone();
                record.outcome = refusal.outcome;
                record.reason = Some(refusal.reason);
                keep(record, self.results, self.observer, self.done)?;
                Ok(None)
            }
        }
    }

    fn sampled(&mut self, point: usize, round: u32, times: &FrameTimes) -> Result<()> {
        self.results.sample(&Sample {
            key: self.points[point].0.key.clone(),
            round,
            ms: times.frame_ms,
            primary_ms: times.primary_ms,
            shadow_ms: times.shadow_ms,
            host_ms: Some(times.host_ms),
        })
    }

    fn stopped(&mut self, point: usize, frames: Vec<FrameTimes>, reason: StopReason) -> Result<()> {
        let mut record = self.points[point].0.clone();
        complete(&mut record, &frames, reason);
        keep(record, self.results, self.observer, self.done)
    }
}

/// Writes what a point's frames amount to into its record.
fn complete(record: &mut Record, frames: &[FrameTimes], reason: StopReason) {
    let median = |time: &dyn Fn(&FrameTimes) -> Option<f64>| {
        let times: Vec<f64> = frames.iter().filter_map(time).collect();
        Summary::of(&times).map(|summary| summary.median_ms)
    };
    record.outcome = Outcome::Measured;
    record.stop_reason = Some(reason.name().to_owned());
    record.samples_ms = frames.iter().map(|frame| frame.frame_ms).collect();
    if let Some(summary) = Summary::of(&record.samples_ms) {
        record.median_ms = Some(summary.median_ms);
        record.q1_ms = Some(summary.q1_ms);
        record.q3_ms = Some(summary.q3_ms);
        record.ci95_ms = Some(summary.ci95_ms);
    }
    record.host_median_ms = median(&|frame| Some(frame.host_ms));
    record.primary_ms = median(&|frame| frame.primary_ms);
    record.shadow_ms = median(&|frame| frame.shadow_ms);
    rates(record);
}

/// Rays and tests a second. Where a strategy does not separate primary rays, the whole frame's time counts.
fn rates(record: &mut Record) {
    let pixels = f64::from(record.image_size[0]) * f64::from(record.image_size[1]);
    let Some(primary_ms) = record.primary_ms.or(record.median_ms).filter(|ms| *ms > 0.0) else { return };
    record.rays_per_s = Some(pixels / primary_ms * 1e3);
    let exhaustive = !record.strategy.contains(&format!("traversal={}", axis_name(Traversal::Raster)));
    if exhaustive {
        record.tests_per_s = record.triangles.map(|triangles| pixels * triangles as f64 / primary_ms * 1e3);
    }
    if let (Some(rays), Some(ms)) = (record.shadow_rays, record.shadow_ms.filter(|ms| *ms > 0.0)) {
        record.shadow_rays_per_s = Some(rays as f64 / ms * 1e3);
    }
}

fn axis_name(traversal: Traversal) -> &'static str {
    use crate::strategy::Axis;
    traversal.name()
}

/// What a run would do, without compiling anything: each point's label, its needs, and why not if not.
pub fn dry_run(run: &Run<'_>) -> Result<Vec<(String, Requirements, Option<String>)>> {
    let scenes = run.load_scenes()?;
    let mut rows = Vec::new();
    for point in &run.plan().points {
        let label = point.label(run.experiment);
        let (Work::Kernel { strategy, local_size }, Some(device)) = (point.work, point.device) else {
            rows.push((label, Requirements::default(), None));
            continue;
        };
        let strategy = &run.experiment.strategies[strategy].strategy;
        let workload = Workload::of(&scenes[point.scene], point.image_size, local_size);
        let limits = run.experiment.limits.apply(run.devices[device].info.limits);
        let refused = Requirements::check(strategy, &workload, &limits).err();
        rows.push((label, Requirements::of(strategy, &workload), refused.map(|infeasible| infeasible.reason)));
    }
    Ok(rows)
}
