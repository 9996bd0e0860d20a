//! Reads sensors by NVIDIA's management library (NVML), if it is installed.

use super::{Reading, Sensor, SensorReading};
use crate::device::Hardware;
use nvml_wrapper::bitmasks::device::ThrottleReasons;
use nvml_wrapper::enum_wrappers::device::{Clock, TemperatureSensor};
use nvml_wrapper::{Device, Nvml};
use std::sync::OnceLock;

/// The sensors of one device.
struct NvmlSensor(Device<'static>);

/// Returns the sensors of the device with this PCI address or UUID; `None` if there is no such library or
/// device.
pub(super) fn find(hardware: &Hardware) -> Option<Box<dyn Sensor>> {
    if hardware.pci_bus.is_none() && hardware.uuid.is_none() {
        return None;
    }
    // The library is loaded once and never unloaded, since its handles live as long as the process.
    static LIBRARY: OnceLock<Option<Nvml>> = OnceLock::new();
    let library = LIBRARY.get_or_init(|| Nvml::init().ok()).as_ref()?;
    let by_bus = || library.device_by_pci_bus_id(hardware.pci_bus.clone()?).ok();
    let by_uuid = || library.device_by_uuid(uuid_name(hardware.uuid.as_deref()?)?).ok();
    let device = by_bus().or_else(by_uuid)?;
    Some(Box::new(NvmlSensor(device)))
}

/// Formats 32 hexadecimal digits in the library's form: "GPU-01234567-89ab-...".
fn uuid_name(digits: &str) -> Option<String> {
    let part = |from: usize, to: usize| digits.get(from..to);
    let (a, b, c, d, e) = (part(0, 8)?, part(8, 12)?, part(12, 16)?, part(16, 20)?, part(20, 32)?);
    Some(format!("GPU-{a}-{b}-{c}-{d}-{e}"))
}

impl Sensor for NvmlSensor {
    fn read(&mut self) -> Reading {
        let Self(device) = self;
        // The reasons for throttling; idleness and clocks set by a user are not among them.
        let slowing = ThrottleReasons::SW_POWER_CAP
            | ThrottleReasons::HW_SLOWDOWN
            | ThrottleReasons::SW_THERMAL_SLOWDOWN
            | ThrottleReasons::HW_THERMAL_SLOWDOWN
            | ThrottleReasons::HW_POWER_BRAKE_SLOWDOWN;
        let shown = SensorReading {
            clock_mhz: device.clock_info(Clock::SM).ok().map(f64::from),
            memory_clock_mhz: device.clock_info(Clock::Memory).ok().map(f64::from),
            power_w: device.power_usage().ok().map(|milliwatts| f64::from(milliwatts) * 1e-3),
            temperature_c: device.temperature(TemperatureSensor::Gpu).ok().map(f64::from),
            throttled: device.current_throttle_reasons().is_ok_and(|reasons| reasons.intersects(slowing)),
            energy_mj: None,
        };
        let energy_counter_mj = device.total_energy_consumption().ok().map(|millijoules| millijoules as f64);
        Reading { shown, energy_counter_mj }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uuids_are_written_as_the_library_does() {
        let name = uuid_name("0123456789abcdef0123456789abcdef");
        assert_eq!(name.as_deref(), Some("GPU-01234567-89ab-cdef-0123-456789abcdef"));
        assert_eq!(uuid_name("0123"), None);
    }

    #[test]
    fn a_device_without_a_place_has_no_sensors() {
        assert!(find(&Hardware::default()).is_none());
    }
}
