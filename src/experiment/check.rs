//! All that a point must pass before it is timed: it fits, it builds, it runs, its image is right.

use super::bench::{Bench, Refusal, first_image};
use super::oracle::Oracle;
use super::session::Ready;
use super::{KeyParts, Point, Results, Run, Work, host, key, pictures};
use crate::config::Baseline;
use crate::error::Result;
use crate::image::Radiance;
use crate::record::{HOST, Record};
use crate::scene::Scene;
use crate::strategy::{Culling, Workload};
use crate::verify::verify;

/// Checks points one after another, and keeps what they share.
pub struct Checker<'a> {
    run: &'a Run<'a>,
    benches: Vec<Bench>,
    oracle: Oracle,
    /// The hash of the scene at hand.
    scene_hash: Option<(usize, String)>,
}

/// A point's image, and what it was cast with.
struct Cast {
    image: Radiance,
    culling: Culling,
    ready: Ready,
}

impl<'a> Checker<'a> {
    /// Opens the run's devices.
    pub fn open(run: &'a Run<'a>) -> Result<Self> {
        let open = |device: &&crate::device::Device| Bench::open(device, &run.experiment.limits, run.sources);
        let benches = run.devices.iter().map(open).collect::<Result<Vec<_>>>()?;
        Ok(Self { run, benches, oracle: Oracle::default(), scene_hash: None })
    }

    /// A record with what is known before anything is tried.
    pub fn draft(&self, point: &Point, scene: &Scene) -> Record {
        let mut record = Record {
            scene: scene.name.clone(),
            image_size: point.image_size,
            triangles: Some(scene.mesh.triangles.len() as u64),
            lights: Some(scene.lights.len() as u64),
            seed: Some(self.run.experiment.timing.seed),
            device: point
                .device
                .map_or(HOST.to_owned(), |device| self.run.devices[device].info.label.clone()),
            ..Record::default()
        };
        match point.work {
            Work::Host(baseline) => {
                record.name = baseline.name().to_owned();
                record.strategy = baseline.strategy().to_owned();
            }
            Work::Kernel { strategy, local_size } => {
                let named = &self.run.experiment.strategies[strategy];
                record.name = named.name.clone();
                record.preset = named.preset.clone();
                record.strategy = named.strategy.to_string();
                record.local_size = Some(local_size);
            }
        }
        record
    }

    /// Casts a point once and compares its image with the reference; fills in `record` on the way.
    pub fn check(
        &mut self,
        point: &Point,
        scene: &Scene,
        results: &mut Results,
        record: &mut Record,
    ) -> Result<std::result::Result<Ready, Refusal>> {
        let cast = match (point.work, point.device) {
            (Work::Kernel { strategy, local_size }, Some(device)) => {
                self.cast_kernel(point, strategy, local_size, device, scene, record)?
            }
            (Work::Host(baseline), _) => Ok(self.cast_host(point, baseline, scene, record)),
            (Work::Kernel { .. }, None) => Err(Refusal::no_device()),
        };
        match cast {
            Ok(cast) => {
                let judged = self.judge(&cast, point.scene, scene, results, record)?;
                Ok(judged.map(|()| cast.ready))
            }
            Err(refusal) => Ok(Err(refusal)),
        }
    }

    fn cast_kernel(
        &mut self,
        point: &Point,
        strategy: usize,
        local_size: [u32; 2],
        device: usize,
        scene: &Scene,
        record: &mut Record,
    ) -> Result<std::result::Result<Cast, Refusal>> {
        let named = &self.run.experiment.strategies[strategy];
        let mut workload = Workload::of(scene, point.image_size, local_size);
        if let Err(refusal) = self.benches[device].grow(named, point.scene, scene, &mut workload) {
            record.key = self.key(point, scene, record);
            return Ok(Err(refusal));
        }
        let spec = self.benches[device].spec(named, &workload)?;
        record.program_hash = Some(spec.hash());
        record.key = self.key(point, scene, record);
        let bench = &mut self.benches[device];
        let cast = bench.prepare(named, &workload, point.scene, scene, &spec, record).and_then(|caster| {
            let (image, hits) = first_image(&caster)?;
            record.shadow_rays = Some((hits * scene.lights.len()) as u64);
            Ok(Cast { image, culling: named.strategy.culling, ready: Ready::Kernel(Box::new(caster)) })
        });
        Ok(cast)
    }

    fn cast_host(&mut self, point: &Point, baseline: Baseline, scene: &Scene, record: &mut Record) -> Cast {
        record.key = self.key(point, scene, record);
        let (image, _) = host::cast(baseline, scene, point.image_size);
        Cast { image, culling: Culling::None, ready: Ready::Host(baseline) }
    }

    /// Compares an image with the reference and keeps its pictures.
    fn judge(
        &mut self,
        cast: &Cast,
        number: usize,
        scene: &Scene,
        results: &mut Results,
        record: &mut Record,
    ) -> Result<std::result::Result<(), Refusal>> {
        let expected = self.oracle.reference(number, scene, record.image_size, cast.culling);
        let verdict = verify(&cast.image, expected, scene.display);
        pictures::keep(results, record, &cast.image, expected, scene, cast.culling)?;
        record.max_difference = Some(verdict.max_difference).filter(|difference| difference.is_finite());
        record.worst_pixel = verdict.worst_pixel;
        record.uncertain_pixels = Some(verdict.uncertain_pixels as u64);
        record.unexplained_pixels = Some(verdict.unexplained_pixels as u64);
        if verdict.ok {
            return Ok(Ok(()));
        }
        Ok(Err(Refusal::wrong_image(verdict.reason.unwrap_or_default())))
    }

    fn key(&mut self, point: &Point, scene: &Scene, record: &Record) -> String {
        if self.scene_hash.as_ref().is_none_or(|(number, _)| *number != point.scene) {
            self.scene_hash = Some((point.scene, scene.content_hash()));
        }
        let by = |[x, y]: [u32; 2]| format!("{x}x{y}");
        let device = point.device.map_or(HOST.to_owned(), |device| self.run.devices[device].info.identity());
        key(&KeyParts {
            scene_hash: self.scene_hash.as_ref().map_or("", |(_, hash)| hash),
            device: &device,
            limits: &self.run.experiment.limits.to_string(),
            strategy: &record.strategy,
            local_size: &record.local_size.map_or(String::new(), by),
            image_size: &by(point.image_size),
            program_hash: record.program_hash.as_deref().unwrap_or(env!("CARGO_PKG_VERSION")),
            timing: &self.run.experiment.timing.to_string(),
        })
    }
}
