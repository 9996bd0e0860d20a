//! Predicts what a run would do, without compiling anything.

use super::pending::PendingPoint;
use super::{Past, Plan, Run, Work, host};
use crate::error::Result;
use crate::memory::Available;
use crate::strategy::{Afterwards, HostNeeds, Requirements};
use serde::Serialize;

/// A point of a plan, with its predicted memory needs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// A text with the point's scene, image size, strategy and local size and, if two folders of kernels are
    /// compared, the point's folder of kernels.
    pub label: String,
    /// The name that records give to the point's device.
    pub device: String,
    /// The bytes of memory that the point's strategy needs; `None` for a caster on the host.
    pub needs: Option<Requirements>,
    /// Why the point does not fit on the device or into the host's memory, or why its strategy or baseline cannot cast
    /// the scene; `None` if no such reason is known.
    pub refused: Option<String>,
    /// Why the point is not measured, if its preset is meant for another kind of device; otherwise `None`.
    pub not_for: Option<String>,
    /// Notes on what raycl ignored in the scene's file or replaced by defaults, and on other scenes of the config with
    /// the same content.
    pub scene_notes: Vec<String>,
    /// True if a resumed run does not measure the point again, because the point has a record.
    pub done: bool,
}

/// Returns a forecast for every point of the experiment's plan, even if a run would not measure the point (see
/// [`Forecast`]). If two folders of kernels are compared, a point that uses kernels has a forecast for each folder.
/// `past` contains the run's results so far.
pub fn dry_run(run: &Run<'_>, past: &Past) -> Result<Vec<Forecast>> {
    let available = Available::read();
    let (plan, kernels) = (run.plan(), run.kernels()?);
    let points = run.pending_points(&plan, &plan.whole())?;
    let done = run.done(points.iter().flatten(), past);
    let forecast = |pending: PendingPoint| {
        let kernels = run.kernels_of(&pending, &kernels);
        let (needs, refused) = kernels.during(|| needs_of(&pending, run, &plan, &available));
        Forecast {
            done: done.contains(&pending.record.key),
            label: pending.label,
            device: pending.record.device,
            needs,
            refused,
            not_for: pending.not_for,
            scene_notes: pending.record.scene_notes,
        }
    };
    Ok(points.into_iter().flatten().map(forecast).collect())
}

/// Returns the bytes of memory that a pending point needs (`None` for a caster on the host). Also returns why the point
/// does not fit or cannot be cast (`None` if the point can be cast).
fn needs_of(
    pending: &PendingPoint,
    run: &Run<'_>,
    plan: &Plan,
    available: &Available,
) -> (Option<Requirements>, Option<String>) {
    let point = &plan.points[pending.point];
    let strategy = match point.work {
        Work::Kernel { strategy, .. } => strategy,
        Work::Host(baseline) => {
            return (None, host::refusal(baseline, &run.experiment.scenes[point.scene].sampling()));
        }
    };
    let strategy = &run.experiment.strategies[strategy].strategy;
    let Some((workload, device)) = pending.workload.as_ref().zip(point.device) else { return (None, None) };
    let limits = run.experiment.emulate.apply(run.devices[device].limits);
    let afterwards = Afterwards { verified: true, layers: false };
    let host_needs = || HostNeeds::of(strategy, workload, limits.is_cpu, afterwards);
    let on_host = || host_needs().check(available, 0).err();
    let refused = Requirements::check(strategy, workload, &limits).err().or_else(on_host);
    let needs = Requirements::of(strategy, workload, limits.lane_operations);
    (Some(needs), refused.map(|infeasible| infeasible.reason))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::super::{asleep, fixtures};
    use super::*;
    use crate::device::{DeviceInfo, DeviceLimits};
    use crate::program::Sources;
    use crate::record::{HOST, Outcome, Record};

    /// The device in this test is a GPU, so the points of the preset `wide`, which is meant for CPUs, are not
    /// measured.
    #[test]
    fn a_forecast_says_what_fits_the_imitated_device_and_what_is_meant_for_it() {
        let lines = "baselines = ['serial']\nlocal_sizes = [4]\n[[strategy]]\npreset = 'local-vectors'\n\
                     [[strategy]]\npreset = 'wide'\n[emulate]\nlocal_bytes = 100";
        let experiment = fixtures::experiment(lines);
        let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
        let devices = [&device];
        let all = dry_run(&fixtures::run(&experiment, &devices, &locks), &Past::default()).unwrap();
        let [host, naive, local, wide] = &all[..] else { panic!("{all:?}") };
        assert_eq!((host.device.as_str(), host.label.as_str()), (HOST, "triangle 8x5 host serial-f32"));
        assert!(host.needs.is_none() && host.refused.is_none() && host.not_for.is_none());
        assert_eq!((naive.device.as_str(), naive.label.as_str()), ("asleep", "triangle 8x5 naive 4x4"));
        assert!(naive.needs.is_some() && naive.refused.is_none() && naive.not_for.is_none(), "{naive:?}");
        assert!(local.refused.as_ref().is_some_and(|reason| reason.contains("> 100 B")), "{local:?}");
        assert!(local.needs.as_ref().is_some_and(|needs| needs.local_bytes > 100) && local.not_for.is_none());
        assert!(wide.not_for.as_ref().is_some_and(|reason| reason.starts_with("meant for CPUs")), "{wide:?}");
    }

    #[test]
    fn a_forecast_says_which_casters_do_not_take_several_samples() {
        let experiment = fixtures::experiment_of(
            "baselines = ['serial']\nlocal_sizes = [4]\nstrategies = ['bvh', 'raster']\n[[scene]]\n\
             file = 'scenes/triangle.toml'\nsamples = [1, 4]\nset = { \"light.0.radius\" = 0.2 }",
        );
        let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
        let devices = [&device];
        let run = fixtures::run(&experiment, &devices, &locks);
        let all = dry_run(&run, &Past::default()).unwrap();
        // The run expects to measure the points that are not refused, and no others.
        let possible = all.iter().filter(|forecast| forecast.refused.is_none()).count();
        assert_eq!((run.expected(&[], &Past::default()).unwrap().points, possible), (4, 4));
        let [one, four] = [&all[..3], &all[3..]];
        assert!(one.iter().all(|forecast| forecast.refused.is_none()), "{one:?}");
        let [host, bvh, raster] = four else { panic!("{four:?}") };
        assert_eq!(bvh.label, "triangle+radius=0.2+samples=4 8x5 bvh 4x4");
        assert!(bvh.refused.is_none(), "{bvh:?}");
        assert!(host.refused.as_ref().is_some_and(|why| why.starts_with("serial-f32 casts only one sample")));
        assert!(
            raster.refused.as_ref().is_some_and(|why| why.contains("lights with a radius")),
            "{raster:?}"
        );
        // The predicted memory includes the buffers that several samples per pixel need.
        let bytes = |forecast: &Forecast| forecast.needs.as_ref().unwrap().global_bytes;
        assert!(bytes(bvh) > bytes(&one[1]));
    }

    #[test]
    fn each_of_two_folders_of_kernels_has_a_forecast_by_its_own_headers() {
        let (parent, file) = (tempfile::tempdir().unwrap(), "cast/vectors/global.cl");
        let folder = parent.path().join("mine");
        std::fs::create_dir_all(folder.join("cast/vectors")).unwrap();
        let text = Sources::Embedded.read(file).unwrap();
        let larger = text.replace("// bytes_per_ray: 108\n", "// bytes_per_ray: 216\n");
        std::fs::write(folder.join(file), larger).unwrap();
        let mine = Sources::Folder(folder);
        let lines = "strategies = ['naive-scratch']\nlocal_sizes = [4]\nbaselines = ['serial']";
        let experiment = fixtures::experiment_of(&format!("scenes = ['scenes/triangle.toml']\n{lines}"));
        let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
        let devices = [&device];
        let run = Run { other_sources: Some(&mine), ..fixtures::run(&experiment, &devices, &locks) };
        let all = dry_run(&run, &Past::default()).unwrap();
        let labels: Vec<&str> = all.iter().map(|forecast| forecast.label.as_str()).collect();
        let point = "triangle 8x5 naive-scratch 4x4";
        let [built_in, of_mine] = ["built in", "mine"].map(|folder| format!("{point} ({folder})"));
        assert_eq!(labels, ["triangle 8x5 host serial-f32", built_in.as_str(), of_mine.as_str()]);
        let bytes = |one: &Forecast| one.needs.as_ref().unwrap().scratch_bytes;
        assert_eq!(bytes(&all[2]), 2 * bytes(&all[1]));
    }

    /// The device in this test is a GPU, so the points of the preset `wide`, which is meant for CPUs, are not
    /// measured.
    #[test]
    fn a_point_that_was_passed_over_is_done_and_the_run_counts_it_too() {
        let experiment = fixtures::experiment("local_sizes = [4]\n[[strategy]]\npreset = 'wide'");
        let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
        let devices = [&device];
        let run = fixtures::run(&experiment, &devices, &locks);
        let pending = run.pending_points(&run.plan(), &run.plan().whole()).unwrap();
        let of = |pending: &PendingPoint| {
            let outcome = if pending.not_for.is_some() { Outcome::OtherKind } else { Outcome::Crashed };
            Record { outcome, ..pending.record.clone() }
        };
        let past = Past { records: pending.iter().flatten().map(of).collect(), ..Past::default() };
        let done = |run: &Run<'_>| -> Vec<bool> {
            dry_run(run, &past).unwrap().iter().map(|forecast| forecast.done).collect()
        };
        assert_eq!(done(&run), [true, true]);
        assert_eq!(done(&Run { retry_failed: true, ..run }), [false, true]);
    }

    #[test]
    fn a_point_that_exceeded_global_memory_is_done_until_it_fits() {
        let experiment = fixtures::experiment("local_sizes = [4]");
        let (large, locks) = (asleep::device(1.0), fixtures::own_locks());
        let done = |device: &DeviceInfo, reason: &str| {
            let devices = [device];
            let run = fixtures::run(&experiment, &devices, &locks);
            let pending = run.pending_points(&run.plan(), &run.plan().whole()).unwrap();
            let (outcome, reason) = (Outcome::Infeasible, Some(reason.to_owned()));
            let record = Record { outcome, reason, ..pending[0][0].record.clone() };
            dry_run(&run, &Past { records: vec![record], ..Past::default() }).unwrap()[0].done
        };
        let small_buffers = DeviceLimits { allocation_bytes: 1, ..large.limits };
        let small_memory = DeviceLimits { global_bytes: 1, ..large.limits };
        for limits in [small_buffers, small_memory] {
            let small = DeviceInfo { limits, ..asleep::device(1.0) };
            let devices = [&small];
            let run = fixtures::run(&experiment, &devices, &locks);
            let refused = dry_run(&run, &Past::default()).unwrap()[0].refused.clone().unwrap();
            assert_eq!([done(&small, &refused), done(&large, &refused)], [true, false], "{refused}");
        }
        let beside = "global memory: 2 B > 1 B, in addition to 3 B that raycl already uses";
        assert!(done(&large, beside) && done(&large, "__local memory: 2 B > 1 B"));
    }

    #[test]
    fn the_points_with_a_record_are_done() {
        let lines = "compare_scenes = true\nlocal_sizes = [4, 8]\nbaselines = ['serial']";
        let other = "[[scene]]\nfile = 'scenes/pyramid-upper.toml'";
        let experiment = fixtures::experiment(&format!("{lines}\n{other}"));
        let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
        let devices = [&device];
        let run =
            Run { other_sources: Some(&Sources::Embedded), ..fixtures::run(&experiment, &devices, &locks) };
        let plan = run.plan();
        let pending = run.pending_points(&plan, &plan.whole()).unwrap();
        let pending: Vec<_> = pending.iter().flatten().collect();
        assert_eq!(pending.len(), 10);
        for one in &pending {
            let record = Record { outcome: Outcome::Measured, ..one.record.clone() };
            let all = dry_run(&run, &Past { records: vec![record], ..Past::default() }).unwrap();
            assert!(pending.iter().map(|one| &one.label).eq(all.iter().map(|forecast| &forecast.label)));
            let is_this: Vec<bool> = pending.iter().map(|of| of.record.key == one.record.key).collect();
            assert_eq!(all.iter().map(|forecast| forecast.done).collect::<Vec<_>>(), is_this);
        }
    }
}
