//! Provides tests with a device that casts nothing, and with workers that wait instead of casting frames.
//! With workers that only wait, tests on one machine can imitate measurements on many machines. The workers
//! for tests open no device and take no device lock.

use super::draft::{Drafter, HeldScene};
use super::protocol::{Reply, Request};
use super::request_handler::no_such_point;
use super::{Plan, Point};
use crate::device::{DeviceInfo, DeviceKind, DeviceLimits};
use crate::error::Result;
use crate::launch::FrameTimes;
use crate::record::Outcome;
use std::time::{Duration, Instant};

/// The name of the platform of devices for tests. No driver uses this name.
const PLATFORM: &str = "raycl asleep";

/// Returns a device for tests whose frames take `frame_ms` milliseconds.
pub fn device(frame_ms: f64) -> DeviceInfo {
    DeviceInfo {
        platform: PLATFORM.to_owned(),
        platform_version: String::new(),
        name: "asleep".to_owned(),
        vendor: String::new(),
        version: "OpenCL 1.2".to_owned(),
        driver: format!("{frame_ms}"),
        kind: DeviceKind::Gpu,
        extensions: Vec::new(),
        limits: DeviceLimits {
            local_bytes: 1 << 20,
            constant_bytes: 1 << 20,
            local_is_emulated: false,
            constant_is_emulated: false,
            global_bytes: 1 << 40,
            allocation_bytes: 1 << 40,
            work_group_size: 1024,
            work_item_sizes: [1024; 3],
            compute_units: 1,
            native_width: 1,
            shares_memory: false,
            is_cpu: false,
            lane_operations: Default::default(),
        },
        hardware: Default::default(),
        settings: Vec::new(),
        cores: None,
        threads: None,
        twins_before: 0,
        label: "asleep".to_owned(),
        unusable: None,
    }
}

/// Returns true if `device` is a device for tests, which casts nothing.
pub fn is_asleep(device: &DeviceInfo) -> bool {
    device.platform == PLATFORM
}

/// Returns the time of a frame, in milliseconds, on the first test device in `devices`; a test device states
/// this time in its field `driver`. Returns `None` if there is no test device, or if the field is not a
/// number.
pub fn frame_ms(devices: &[&DeviceInfo]) -> Option<f64> {
    devices.iter().find(|device| is_asleep(device))?.driver.parse().ok()
}

/// Answers a run's requests in a worker for tests, which has no device. If a request asks for a frame, the
/// worker waits as long as a frame takes, and answers with the time that it waited. The worker answers every
/// other request at once.
pub struct Asleep<'a> {
    drafter: Drafter<'a>,
    plan: Plan,
    frame: Duration,
    device: DeviceInfo,
    scene: HeldScene,
}

impl<'a> Asleep<'a> {
    /// Makes an `Asleep` for the points of a plan. The `Asleep` waits `frame_ms` milliseconds instead of casting a frame.
    pub fn new(drafter: Drafter<'a>, plan: Plan, frame_ms: f64) -> Self {
        let frame = Duration::try_from_secs_f64(1e-3 * frame_ms).unwrap_or_default();
        Self { drafter, plan, frame, device: device(frame_ms), scene: HeldScene::default() }
    }

    /// Answers a request: a check passes without casting anything, and a cast only waits for the time of a frame.
    pub fn answer(&mut self, request: &Request) -> Result<Reply> {
        match request {
            Request::Check { point, .. } => self.check(*point),
            Request::Build { .. } => Ok(Reply::Built(None)),
            Request::Anchor => Ok(Reply::Sample(FrameTimes::whole(1.0, 1.0))),
            Request::Cast { .. } => {
                let start = Instant::now();
                std::thread::sleep(self.frame);
                let ms = 1e3 * start.elapsed().as_secs_f64();
                Ok(Reply::Sample(FrameTimes::whole(ms, ms)))
            }
        }
    }

    fn check(&mut self, number: usize) -> Result<Reply> {
        let point: Point = *self.plan.points.get(number).ok_or_else(no_such_point)?;
        let at = self.scene.of(self.drafter.experiment, &point)?;
        let mut record = self.drafter.draft(&point, point.device.map(|_| &self.device), at)?;
        (record.outcome, record.image_hash) = (Outcome::Measured, Some(String::new()));
        Ok(Reply::Checked { record: Box::new(record), ready: true })
    }
}
