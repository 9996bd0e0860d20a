//! All that a point must pass before it is timed: it fits, it builds, it runs, its image is right.

use super::bench::{Bench, Refusal, first_image};
use super::draft::Drafter;
use super::hands::Ready;
use super::oracle::Oracle;
use super::{Pictures, Point, Work, host, views};
use crate::config::Baseline;
use crate::device::Device;
use crate::error::Result;
use crate::image::Radiance;
use crate::record::Record;
use crate::scene::Scene;
use crate::strategy::{Culling, Workload};
use crate::verify::verify;

/// Checks points of one device one after another, and keeps what they share.
pub struct Checker<'a> {
    drafter: Drafter<'a>,
    device: Option<(&'a Device, Bench)>,
    pictures: Pictures,
    oracle: Oracle,
}

/// A point's image, and what it was cast with.
struct Cast {
    image: Radiance,
    culling: Culling,
    ready: Ready,
}

impl<'a> Checker<'a> {
    /// Opens the device; without one only casters on the host can be checked.
    pub fn open(drafter: Drafter<'a>, device: Option<&'a Device>, pictures: Pictures) -> Result<Self> {
        let device = match device {
            Some(device) => Some((device, Bench::open(device, &drafter.experiment.emulate)?)),
            None => None,
        };
        Ok(Self { drafter, device, pictures, oracle: Oracle::default() })
    }

    /// The device.
    pub fn device(&self) -> Option<&'a Device> {
        self.device.as_ref().map(|(device, _)| *device)
    }

    /// Says that the points checked before were dropped.
    pub fn let_go(&mut self) {
        if let Some((_, bench)) = &mut self.device {
            bench.let_go();
        }
    }

    /// Casts a point once and compares its image with the reference; fills in `record` on the way.
    pub fn check(
        &mut self,
        point: &Point,
        scene: &Scene,
        record: &mut Record,
    ) -> Result<std::result::Result<Ready, Refusal>> {
        let cast = match point.work {
            Work::Kernel { strategy, local_size } => {
                self.cast_kernel(point, strategy, local_size, scene, record)?
            }
            Work::Host(baseline) => Ok(cast_host(baseline, scene, point.image_size)),
        };
        match cast {
            Ok(cast) => Ok(self.judge(&cast, point.scene, scene, record)?.map(|()| cast.ready)),
            Err(refusal) => Ok(Err(refusal)),
        }
    }

    fn cast_kernel(
        &mut self,
        point: &Point,
        strategy: usize,
        local_size: [u32; 2],
        scene: &Scene,
        record: &mut Record,
    ) -> Result<std::result::Result<Cast, Refusal>> {
        let Some((device, bench)) = &mut self.device else { return Ok(Err(Refusal::no_device())) };
        let named = &self.drafter.experiment.strategies[strategy];
        let mut workload = Workload::of(scene, point.image_size, local_size);
        if let Err(refusal) = bench.grow(named, point.scene, scene, &mut workload) {
            return Ok(Err(refusal));
        }
        let spec = self.drafter.spec(named, &workload, device.info.builtins())?;
        record.program_hash = Some(spec.hash());
        let cast = bench.prepare(named, &workload, point.scene, scene, &spec, record).and_then(|caster| {
            let (image, hits) = first_image(&caster)?;
            record.shadow_rays = Some((hits * scene.lights.len()) as u64);
            Ok(Cast { image, culling: named.strategy.culling, ready: Ready::Kernel(Box::new(caster)) })
        });
        Ok(cast)
    }

    /// Compares an image with the reference and keeps its pictures.
    fn judge(
        &mut self,
        cast: &Cast,
        number: usize,
        scene: &Scene,
        record: &mut Record,
    ) -> Result<std::result::Result<(), Refusal>> {
        let expected = self.oracle.reference(number, scene, record.image_size, cast.culling);
        let verdict = verify(&cast.image, expected, scene.display);
        views::keep(&mut self.pictures, record, &cast.image, expected, scene, cast.culling)?;
        record.max_difference = Some(verdict.max_difference).filter(|difference| difference.is_finite());
        record.worst_pixel = verdict.worst_pixel;
        record.uncertain_pixels = Some(verdict.uncertain_pixels as u64);
        record.unexplained_pixels = Some(verdict.unexplained_pixels as u64);
        if verdict.ok {
            return Ok(Ok(()));
        }
        Ok(Err(Refusal::wrong_image(verdict.reason.unwrap_or_default())))
    }
}

fn cast_host(baseline: Baseline, scene: &Scene, size: [u32; 2]) -> Cast {
    let (image, _) = host::cast(baseline, scene, size);
    Cast { image, culling: Culling::None, ready: Ready::Host(baseline) }
}
