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
    /// Why the point does not fit on the device or into the host's memory; `None` if it fits.
    pub refused: Option<String>,
    /// The reason, if the point is not measured because its preset is meant for another kind of device; `None`
    /// otherwise.
    pub not_for: Option<String>,
    /// Parts of the scene's file that were ignored or replaced by defaults.
    pub scene_notes: Vec<String>,
}

/// Returns a forecast for every point of a run.
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
            needs: Some(Requirements::of(strategy, &workload, limits.lane_operations)),
            refused: refused.map(|infeasible| infeasible.reason),
            not_for: run.not_for(point, Some(info)),
            scene_notes,
        }
    };
    Ok(run.plan().points.iter().map(forecast).collect())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::super::{asleep, fixtures};
    use super::*;

    /// The device in this test is a GPU.
    #[test]
    fn a_forecast_says_what_fits_the_imitated_device_and_what_is_meant_for_it() {
        let lines = "baselines = ['serial']\nlocal_sizes = [4]\n[[strategy]]\npreset = 'local-vectors'\n\
                     [[strategy]]\npreset = 'wide'\n[emulate]\nlocal_bytes = 100";
        let experiment = fixtures::experiment(lines);
        let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
        let devices = [&device];
        let all = dry_run(&fixtures::run(&experiment, &devices, &locks)).unwrap();
        let [host, naive, local, wide] = &all[..] else { panic!("{all:?}") };
        assert_eq!((host.device.as_str(), host.label.as_str()), (HOST, "triangle 8x5 host serial-f32"));
        assert!(host.needs.is_none() && host.refused.is_none() && host.not_for.is_none());
        assert_eq!((naive.device.as_str(), naive.label.as_str()), ("asleep", "triangle 8x5 naive 4x4"));
        assert!(naive.needs.is_some() && naive.refused.is_none() && naive.not_for.is_none(), "{naive:?}");
        assert!(local.refused.as_ref().is_some_and(|reason| reason.contains("> 100 B")), "{local:?}");
        assert!(local.needs.as_ref().is_some_and(|needs| needs.local_bytes > 100) && local.not_for.is_none());
        assert!(wide.not_for.as_ref().is_some_and(|reason| reason.starts_with("meant for CPUs")), "{wide:?}");
    }
}
