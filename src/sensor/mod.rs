//! A device's clock, power, temperature and throttling, watched while frames are timed.

mod nvml;
mod watch;

pub use watch::Watch;

use crate::device::Hardware;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Something that can be asked how a device fares.
pub trait Sensor: Send {
    /// How it fares now.
    fn read(&mut self) -> Reading;
}

/// What a sensor shows at one moment; what it cannot tell is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// All but the energy of a frame, which no moment has.
    pub shown: SensorReading,
    /// A counter of the energy the device has taken.
    pub energy_counter_mj: Option<f64>,
}

/// Watches a device's sensors, where it has any that raycl can read.
pub fn watch(hardware: &Hardware) -> Watch {
    let hardware = hardware.clone();
    Watch::start(move || nvml::find(&hardware))
}

/// What sensors showed while a sample was taken; a record has the means of its samples'.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SensorReading {
    /// The processors' clock.
    pub clock_mhz: Option<f64>,
    /// The memory's clock.
    pub memory_clock_mhz: Option<f64>,
    /// Power of the whole device.
    pub power_w: Option<f64>,
    /// Temperature of the chip.
    pub temperature_c: Option<f64>,
    /// Whether the device held its clock down for power, heat or a brake on its slot.
    pub throttled: bool,
    /// Energy of one frame.
    pub energy_mj: Option<f64>,
}

impl SensorReading {
    /// The means of several; throttled where any was. None of none.
    pub fn mean<'a>(all: impl Iterator<Item = &'a Self> + Clone) -> Option<Self> {
        all.clone().next()?;
        let mean = |of: fn(&Self) -> Option<f64>| {
            let values: Vec<f64> = all.clone().filter_map(of).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        Some(Self {
            clock_mhz: mean(|one| one.clock_mhz),
            memory_clock_mhz: mean(|one| one.memory_clock_mhz),
            power_w: mean(|one| one.power_w),
            temperature_c: mean(|one| one.temperature_c),
            throttled: all.clone().any(|one| one.throttled),
            energy_mj: mean(|one| one.energy_mj),
        })
    }
}
