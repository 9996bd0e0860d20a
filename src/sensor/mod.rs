//! Reads a device's clock, power, temperature and throttling while frames are timed.

mod nvml;
mod used_memory;
mod watch;

pub use used_memory::UsedMemory;
pub use watch::Watch;

use crate::device::Hardware;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A source of readings of a device's sensors (clock, power, temperature and throttling).
pub trait Sensor: Send {
    /// Reads the sensors once.
    fn read(&mut self) -> Reading;
}

/// A reading at one moment. A value that the device does not report is `None`, or false in the case of `throttled`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// All values except the energy of a frame, which is not defined for a single moment.
    pub shown: SensorReading,
    /// A counter of the energy that the device has used.
    pub energy_counter_mj: Option<f64>,
}

/// Watches a device's sensors, if the device has any that raycl can read.
pub fn watch(hardware: &Hardware) -> Watch {
    let hardware = hardware.clone();
    Watch::start(move || nvml::find(&hardware))
}

/// Returns how much of a device's memory is in use now; `None` if no installed library reports this.
pub fn used_memory(hardware: &Hardware) -> Option<UsedMemory> {
    nvml::used_memory(hardware)
}

/// The sensors' values while a sample was taken. A record has the means over its samples. A value that the
/// device does not report is `None`, or false in the case of `throttled`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SensorReading {
    /// Clock rate of the device's processors, in MHz.
    pub clock_mhz: Option<f64>,
    /// Clock rate of the device's memory, in MHz.
    pub memory_clock_mhz: Option<f64>,
    /// Power that the whole device draws, in watts.
    pub power_w: Option<f64>,
    /// Temperature of the device's chip, in degrees Celsius.
    pub temperature_c: Option<f64>,
    /// True if the device reduced its clock because of power, heat or an external signal. False if the device
    /// does not report this.
    pub throttled: bool,
    /// Energy of one frame in millijoules: the mean power times the frame's device time.
    pub energy_mj: Option<f64>,
}

impl SensorReading {
    /// Returns the means of several readings; `None` without readings. In the result, `throttled` is true if it is
    /// true in at least one reading.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_is_of_each_value_where_it_is_known() {
        let one = SensorReading {
            clock_mhz: Some(1000.0),
            memory_clock_mhz: Some(2000.0),
            power_w: Some(100.0),
            temperature_c: Some(50.0),
            throttled: false,
            energy_mj: Some(10.0),
        };
        let other = SensorReading {
            clock_mhz: Some(1200.0),
            memory_clock_mhz: None,
            power_w: Some(300.0),
            temperature_c: Some(60.0),
            throttled: true,
            energy_mj: Some(30.0),
        };
        let expected = SensorReading {
            clock_mhz: Some(1100.0),
            memory_clock_mhz: Some(2000.0),
            power_w: Some(200.0),
            temperature_c: Some(55.0),
            throttled: true,
            energy_mj: Some(20.0),
        };
        assert_eq!(SensorReading::mean([one, other].iter()), Some(expected));
        assert_eq!(SensorReading::mean([one].iter()), Some(one));
        assert_eq!(SensorReading::mean([].iter()), None);
    }
}
