//! Predicts what a run would do, without compiling anything.

use super::{Run, Work};
use crate::error::Result;
use crate::memory::Available;
use crate::record::HOST;
use crate::strategy::{HostNeeds, Requirements, Workload};
use serde::Serialize;

/// A point of a plan, with its predicted memory needs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// Scene, size, strategy, local size.
    pub label: String,
    /// The device's name in records.
    pub device: String,
    /// The bytes that the point needs; `None` for a caster on the host.
    pub needs: Option<Requirements>,
    /// Why the point does not fit on the device; `None` if it fits.
    pub refused: Option<String>,
    /// Why the point is not measured on the device, if its preset is meant for another kind of device.
    pub not_for: Option<String>,
    /// Parts of the scene's file that were ignored or replaced by defaults.
    pub scene_notes: Vec<String>,
}

/// Predicts every point of a run.
pub fn dry_run(run: &Run<'_>) -> Result<Vec<Forecast>> {
    let available = Available::read();
    let scenes = run.load_scenes()?;
    let forecast = |point: &super::Point| {
        let label = point.label(run.experiment);
        let scene_notes = scenes[point.scene].notes.clone();
        let (Work::Kernel { strategy, local_size }, Some(device)) = (point.work, point.device) else {
            let device = HOST.to_owned();
            return Forecast { label, device, needs: None, refused: None, not_for: None, scene_notes };
        };
        let info = run.devices[device];
        let strategy = &run.experiment.strategies[strategy].strategy;
        let workload = Workload::of(&scenes[point.scene].scene, point.image_size, local_size);
        let limits = run.experiment.emulate.apply(info.limits);
        let on_host = || HostNeeds::of(strategy, &workload, limits.is_cpu, true).check(&available, 0).err();
        let refused = Requirements::check(strategy, &workload, &limits).err().or_else(on_host);
        Forecast {
            label,
            device: info.label.clone(),
            needs: Some(Requirements::of(strategy, &workload)),
            refused: refused.map(|infeasible| infeasible.reason),
            not_for: run.not_for(point, Some(info)),
            scene_notes,
        }
    };
    Ok(run.plan().points.iter().map(forecast).collect())
}
