//! What a run would do, without compiling anything.

use super::{Run, Work};
use crate::error::Result;
use crate::strategy::{Requirements, Workload};

/// A point of a plan, as foreseen.
#[derive(Clone, Debug, PartialEq)]
pub struct Forecast {
    /// Scene, size, strategy, local size.
    pub label: String,
    /// The bytes it needs; none for a caster on the host.
    pub needs: Option<Requirements>,
    /// Why the device cannot hold it, if so.
    pub refused: Option<String>,
}

/// Every point of a run, as foreseen.
pub fn dry_run(run: &Run<'_>) -> Result<Vec<Forecast>> {
    let scenes = run.load_scenes()?;
    let forecast = |point: &super::Point| {
        let label = point.label(run.experiment);
        let (Work::Kernel { strategy, local_size }, Some(device)) = (point.work, point.device) else {
            return Forecast { label, needs: None, refused: None };
        };
        let strategy = &run.experiment.strategies[strategy].strategy;
        let workload = Workload::of(&scenes[point.scene], point.image_size, local_size);
        let limits = run.experiment.limits.apply(run.devices[device].info.limits);
        let refused = Requirements::check(strategy, &workload, &limits).err();
        Forecast {
            label,
            needs: Some(Requirements::of(strategy, &workload)),
            refused: refused.map(|infeasible| infeasible.reason),
        }
    };
    Ok(run.plan().points.iter().map(forecast).collect())
}
