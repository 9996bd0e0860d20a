//! Completes a point's record from its samples.

use super::taken::Taken;
use crate::launch::FrameTimes;
use crate::measure::{StopReason, Summary, median_of, without_preempted};
use crate::numbers::significant;
use crate::record::{Outcome, Record};
use crate::sensor::SensorReading;

/// Adds the results of a point's samples to the point's record. The 95% interval is computed later, since it depends on
/// all points of a group. Preempted samples, during which other programs probably used the processors, are counted, but
/// do not affect the results.
pub fn complete(record: &mut Record, taken: &[Taken], reason: Option<StopReason>) {
    let all = taken.len();
    let remaining = without_preempted(taken, |one| Some((one.launch, one.utilization()?)));
    record.preempted_samples = remaining.as_ref().map(|remaining| (all - remaining.len()) as u32);
    let taken = remaining.as_deref().unwrap_or(taken);
    let frames: Vec<FrameTimes> = taken.iter().map(|taken| taken.times).collect();
    record.sample_launches = taken.iter().map(|taken| taken.launch).collect();
    record.samples_at_ms = taken.iter().map(|taken| taken.at_ms).collect();
    record.utilization = median_of(&taken.iter().filter_map(Taken::utilization).collect::<Vec<_>>());
    record.outcome = Outcome::Measured;
    record.stop_reason = reason.map(|reason| reason.name().to_owned());
    record.samples_ms = frames.iter().map(|frame| frame.frame_ms).collect();
    if let Some(summary) = Summary::of(&record.samples_ms) {
        record.median_ms = Some(summary.median);
        record.q1_ms = Some(summary.q1);
        record.q3_ms = Some(summary.q3);
    }
    record.host_median_ms = FrameTimes::median_of(&frames, |frame| Some(frame.host_ms));
    record.primary_ms = FrameTimes::median_of(&frames, |frame| frame.primary_ms);
    record.shadow_ms = FrameTimes::median_of(&frames, |frame| frame.shadow_ms);
    record.shade_ms = FrameTimes::median_of(&frames, |frame| frame.shade_ms);
    record.batch = frames.iter().filter_map(|frame| frame.batch).max();
    record.sensed = SensorReading::mean(frames.iter().filter_map(|frame| frame.sensed.as_ref()));
    let throttled = |frame: &&FrameTimes| frame.sensed.is_some_and(|sensed| sensed.throttled);
    record.throttled_samples = record.sensed.map(|_| frames.iter().filter(throttled).count() as u32);
    rates(record);
    record.warning = warning(record, &frames);
}

/// Returns a warning if a point's frames are too short for comparisons, or if the device throttled its clock
/// during samples; otherwise `None`.
fn warning(record: &Record, frames: &[FrameTimes]) -> Option<String> {
    let throttled = record.throttled_samples.filter(|count| *count > 0).map(|count| {
        format!("the device throttled its clock in {count} of {} samples", record.samples_ms.len())
    });
    let warnings: Vec<_> = start_bound(record, frames).into_iter().chain(throttled).collect();
    (!warnings.is_empty()).then(|| warnings.join("; "))
}

/// Returns a warning if starting a frame's kernels takes longer than casting the frame; `None` otherwise, and for
/// baselines, which start no kernels. A frame that takes less time than the start of its kernels is too short for
/// comparisons. The kernels' starting time and the frame's time are each the least of all samples, since other work on
/// the host can delay the start of kernels.
fn start_bound(record: &Record, frames: &[FrameTimes]) -> Option<String> {
    if record.is_baseline() || frames.is_empty() {
        return None;
    }
    let least = |of: fn(&FrameTimes) -> f64| frames.iter().map(of).fold(f64::INFINITY, f64::min);
    let start_ms = least(|frame| frame.host_ms - frame.frame_ms);
    let frame_ms = least(|frame| frame.frame_ms);
    let us = |ms: f64| significant(1e3 * ms, 2);
    (start_ms > frame_ms).then(|| {
        let batched = record.batch.map_or(String::new(), |batch| format!(" in batches of {batch}"));
        let (start, device) = (us(start_ms), us(frame_ms));
        format!("frames are too short for comparisons: starting the kernels takes {start} us per frame{batched}, casting only {device} us; use larger images")
    })
}

/// Computes the rates of a record: rays per second, and tests of rays against triangles per second. The rate of tests
/// is computed only for strategies and baselines that test every primary ray against every triangle. If primary rays
/// have no pass of their own, the rates of primary rays and of tests are computed from the time of the whole frame. If
/// the time for a rate is unknown or 0, the rate is not set.
fn rates(record: &mut Record) {
    let rays = record.primary_rays();
    let Some(primary_ms) = record.primary_ms.or(record.median_ms).filter(|ms| *ms > 0.0) else { return };
    record.rays_per_s = Some(rays / primary_ms * 1e3);
    if record.tests_every_triangle() {
        record.tests_per_s = record.triangles.map(|triangles| rays * triangles as f64 / primary_ms * 1e3);
    }
    if let (Some(rays), Some(ms)) = (record.shadow_rays, record.shadow_ms.filter(|ms| *ms > 0.0)) {
        record.shadow_rays_per_s = Some(rays as f64 / ms * 1e3);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(times: FrameTimes) -> Taken {
        Taken { launch: 0, at_ms: 0.0, core_to_core_ns: None, times }
    }

    fn completed(frame_ms: f64, host_ms: f64, batch: Option<u32>) -> Record {
        let frame = FrameTimes { batch, ..FrameTimes::whole(frame_ms, host_ms) };
        let mut record = Record { device: "gpu".into(), image_size: [8, 5], ..Record::default() };
        complete(&mut record, &[taken(frame); 5], Some(StopReason::Precise));
        record
    }

    #[test]
    fn a_record_has_the_medians_of_its_samples_and_where_each_was_taken() {
        let sample = |(number, ms): (u32, f64)| Taken {
            launch: number / 3,
            at_ms: f64::from(number),
            core_to_core_ns: None,
            times: FrameTimes {
                primary_ms: Some(10.0 * ms),
                shadow_ms: Some(20.0 * ms),
                shade_ms: Some(30.0 * ms),
                batch: Some(number),
                ..FrameTimes::whole(ms, 40.0 * ms)
            },
        };
        let samples: Vec<Taken> = (0..).zip([5.0, 1.0, 4.0, 2.0, 3.0]).map(sample).collect();
        let mut record = Record { device: "gpu".into(), ..Record::default() };
        complete(&mut record, &samples, Some(StopReason::Precise));
        assert_eq!(record.samples_ms, [5.0, 1.0, 4.0, 2.0, 3.0]);
        assert_eq!(
            (record.sample_launches, record.samples_at_ms),
            (vec![0, 0, 0, 1, 1], vec![0.0, 1.0, 2.0, 3.0, 4.0])
        );
        assert_eq!([record.q1_ms, record.median_ms, record.q3_ms], [2.0, 3.0, 4.0].map(Some));
        assert_eq!([record.primary_ms, record.shadow_ms, record.shade_ms], [30.0, 60.0, 90.0].map(Some));
        assert_eq!((record.host_median_ms, record.batch), (Some(120.0), Some(4)));
        assert_eq!((record.outcome, record.stop_reason.as_deref()), (Outcome::Measured, Some("precise")));
    }

    #[test]
    fn a_frame_shorter_than_the_start_of_its_kernels_is_warned_of() {
        let warning = completed(0.004, 0.03, Some(13)).warning.expect("a warning");
        assert!(warning.contains("26 us per frame") && warning.contains("4.0 us"), "{warning}");
        assert!(warning.contains("batches of 13"), "{warning}");
        assert_eq!(completed(0.004, 0.0075, None).warning, None);
        assert_eq!(completed(5.0, 5.1, None).warning, None);
        // A caster on the host starts no kernels, so its record has no warning about the time for starting kernels.
        let mut host = Record { device: crate::record::HOST.into(), image_size: [8, 5], ..Record::default() };
        complete(&mut host, &[taken(FrameTimes::whole(0.004, 0.03)); 5], Some(StopReason::Precise));
        assert_eq!(host.warning, None);
    }

    #[test]
    fn preempted_samples_are_counted_and_have_no_part_in_the_results() {
        let frame = |ms, processor_ms| {
            taken(FrameTimes { processor_ms: Some(processor_ms), ..FrameTimes::whole(ms, ms + 1.0) })
        };
        let mut record = Record::default();
        let mut samples = [frame(5.0, 10.0); 8];
        samples[1..4].fill(frame(9.0, 10.0));
        samples[1].at_ms = 7.0;
        complete(&mut record, &samples, None);
        assert_eq!((record.samples_ms, record.preempted_samples), (vec![5.0; 5], Some(3)));
        assert_eq!((record.utilization, completed(5.0, 5.1, None).utilization), (Some(10.0 / 6.0), None));
        assert_eq!(
            (record.sample_launches.len(), record.samples_at_ms, record.host_median_ms),
            (5, vec![0.0; 5], Some(6.0))
        );
        assert_eq!(completed(5.0, 5.1, None).preempted_samples, None);
    }

    #[test]
    fn throttled_samples_are_counted_and_sensors_averaged() {
        let sensed = |throttled, clock| {
            Some(SensorReading { throttled, clock_mhz: Some(clock), ..SensorReading::default() })
        };
        let frame =
            |throttled, clock| FrameTimes { sensed: sensed(throttled, clock), ..FrameTimes::whole(5.0, 5.1) };
        let mut record = Record { device: "gpu".into(), ..Record::default() };
        let samples = [frame(true, 1000.0), frame(false, 2000.0)].map(taken);
        complete(&mut record, &samples, Some(StopReason::Precise));
        let mean = record.sensed.expect("sensors");
        assert_eq!((mean.clock_mhz, mean.throttled, record.throttled_samples), (Some(1500.0), true, Some(1)));
        assert!(record.warning.expect("a warning").contains("1 of 2 samples"));
    }

    /// If passes are timed separately, the rate of primary rays does not include the time of shadow rays.
    #[test]
    fn rates_are_of_the_pass_that_casts_the_rays() {
        let frame =
            FrameTimes { primary_ms: Some(2.0), shadow_ms: Some(4.0), ..FrameTimes::whole(10.0, 10.1) };
        let record = Record {
            device: "gpu".into(),
            image_size: [8, 5],
            triangles: Some(7),
            shadow_rays: Some(60),
            strategy: "traversal=exhaustive".into(),
            ..Record::default()
        };
        let completed_as = |times: FrameTimes, record: &Record| {
            let mut record = record.clone();
            complete(&mut record, &[taken(times); 5], Some(StopReason::Precise));
            [record.rays_per_s, record.tests_per_s, record.shadow_rays_per_s]
        };
        assert_eq!(completed_as(frame, &record), [Some(20e3), Some(140e3), Some(15e3)]);
        assert_eq!(completed_as(FrameTimes::whole(10.0, 10.1), &record), [Some(4e3), Some(28e3), None]);
        // Each of a pixel's samples is a primary ray; `shadow_rays` counts the rays of all samples.
        let sampled = Record { samples_per_pixel: Some(4), ..record };
        assert_eq!(completed_as(frame, &sampled), [Some(80e3), Some(560e3), Some(15e3)]);
    }

    #[test]
    fn a_device_that_did_not_throttle_is_not_warned_of() {
        let frame = FrameTimes { sensed: Some(SensorReading::default()), ..FrameTimes::whole(5.0, 5.1) };
        let mut record = Record { device: "gpu".into(), ..Record::default() };
        complete(&mut record, &[taken(frame); 5], Some(StopReason::Precise));
        assert_eq!((record.throttled_samples, record.warning), (Some(0), None));
    }
}
