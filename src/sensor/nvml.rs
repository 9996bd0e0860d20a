//! Reads sensors with NVIDIA's management library (NVML), if this library is installed.

use super::{Reading, Sensor, SensorReading, UsedMemory};
use crate::device::Hardware;
use nvml_wrapper::bitmasks::device::ThrottleReasons;
use nvml_wrapper::enum_wrappers::device::{Clock, TemperatureSensor};
use nvml_wrapper::enums::device::UsedGpuMemory;
use nvml_wrapper::struct_wrappers::device::{MemoryInfo, ProcessInfo};
use nvml_wrapper::{Device, Nvml};
use std::sync::OnceLock;

/// One device, whose sensors NVML (NVIDIA's management library) reads.
struct NvmlSensor<D>(D);

/// Returns the sensors of the device with this PCI address or UUID; `None` if NVML is not installed, or does not know
/// such a device.
pub(super) fn find(hardware: &Hardware) -> Option<Box<dyn Sensor>> {
    Some(Box::new(NvmlSensor(device(hardware)?)))
}

/// Returns how much of the device's memory is in use now; `None` if NVML is not installed, does not know the
/// device, or does not report its memory.
pub(super) fn used_memory(hardware: &Hardware) -> Option<UsedMemory> {
    let device = device(hardware)?;
    let memory = device.memory_info().ok()?;
    let processes = device.running_compute_processes().unwrap_or_default();
    Some(use_of(&memory, used_by(&processes, std::process::id())))
}

/// Returns the use of a device's memory, of which this process uses `own_bytes`.
fn use_of(memory: &MemoryInfo, own_bytes: Option<u64>) -> UsedMemory {
    UsedMemory { total_bytes: memory.total, used_bytes: memory.used, own_bytes }
}

/// Returns the bytes that the process with this number uses; `None` if the list lacks the process, or does not
/// state how much memory the process uses.
fn used_by(processes: &[ProcessInfo], id: u32) -> Option<u64> {
    match processes.iter().find(|process| process.pid == id)?.used_gpu_memory {
        UsedGpuMemory::Used(bytes) => Some(bytes),
        UsedGpuMemory::Unavailable => None,
    }
}

/// Returns the handle by which NVML names a device.
fn device(hardware: &Hardware) -> Option<Device<'static>> {
    // The library is loaded once and never unloaded, since raycl may use a handle from the library until the
    // process ends.
    static LIBRARY: OnceLock<Option<Nvml>> = OnceLock::new();
    let library = || LIBRARY.get_or_init(|| Nvml::init().ok()).as_ref();
    let by_bus = |address: &str| library()?.device_by_pci_bus_id(address).ok();
    let by_uuid = |name: &str| library()?.device_by_uuid(name).ok();
    named(hardware, by_bus, by_uuid)
}

/// Returns the device at the PCI address, or else the device with the UUID; `None` if neither is found.
fn named<D>(
    hardware: &Hardware,
    by_bus: impl FnOnce(&str) -> Option<D>,
    by_uuid: impl FnOnce(&str) -> Option<D>,
) -> Option<D> {
    let at_address = hardware.pci_bus.as_deref().and_then(by_bus);
    at_address.or_else(|| by_uuid(&uuid_name(hardware.uuid.as_deref()?)?))
}

/// Formats 32 hexadecimal digits in the library's form: "GPU-01234567-89ab-...".
fn uuid_name(digits: &str) -> Option<String> {
    let part = |from: usize, to: usize| digits.get(from..to);
    let (a, b, c, d, e) = (part(0, 8)?, part(8, 12)?, part(12, 16)?, part(16, 20)?, part(20, 32)?);
    Some(format!("GPU-{a}-{b}-{c}-{d}-{e}"))
}

/// The values that the library reads, each in the library's own unit; `None` if a device does not report a value.
trait Source {
    fn clock_mhz(&self, clock: Clock) -> Option<u32>;
    fn power_mw(&self) -> Option<u32>;
    fn temperature_c(&self) -> Option<u32>;
    fn throttle_reasons(&self) -> Option<ThrottleReasons>;
    /// Returns the energy that the device has used since its driver was loaded.
    fn energy_mj(&self) -> Option<u64>;
}

impl Source for Device<'_> {
    fn clock_mhz(&self, clock: Clock) -> Option<u32> {
        self.clock_info(clock).ok()
    }

    fn power_mw(&self) -> Option<u32> {
        self.power_usage().ok()
    }

    fn temperature_c(&self) -> Option<u32> {
        self.temperature(TemperatureSensor::Gpu).ok()
    }

    fn throttle_reasons(&self) -> Option<ThrottleReasons> {
        self.current_throttle_reasons().ok()
    }

    fn energy_mj(&self) -> Option<u64> {
        self.total_energy_consumption().ok()
    }
}

impl<D: Source + Send> Sensor for NvmlSensor<D> {
    fn read(&mut self) -> Reading {
        let Self(device) = self;
        // The reasons that count as throttling. Idleness and clocks set by a user do not count as throttling.
        let slowing = ThrottleReasons::SW_POWER_CAP
            | ThrottleReasons::HW_SLOWDOWN
            | ThrottleReasons::SW_THERMAL_SLOWDOWN
            | ThrottleReasons::HW_THERMAL_SLOWDOWN
            | ThrottleReasons::HW_POWER_BRAKE_SLOWDOWN;
        let shown = SensorReading {
            clock_mhz: device.clock_mhz(Clock::SM).map(f64::from),
            memory_clock_mhz: device.clock_mhz(Clock::Memory).map(f64::from),
            power_w: device.power_mw().map(|milliwatts| f64::from(milliwatts) * 1e-3),
            temperature_c: device.temperature_c().map(f64::from),
            throttled: device.throttle_reasons().is_some_and(|reasons| reasons.intersects(slowing)),
            energy_mj: None,
        };
        Reading { shown, energy_counter_mj: device.energy_mj().map(|millijoules| millijoules as f64) }
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
    fn a_device_without_an_address_has_no_sensors() {
        assert!(find(&Hardware::default()).is_none());
        assert_eq!(used_memory(&Hardware::default()), None);
    }

    #[test]
    fn the_memory_of_a_process_is_found_by_its_number() {
        let process = |pid, used_gpu_memory| ProcessInfo {
            pid,
            used_gpu_memory,
            gpu_instance_id: None,
            compute_instance_id: None,
        };
        let listed = [process(7, UsedGpuMemory::Used(70)), process(8, UsedGpuMemory::Unavailable)];
        assert_eq!([7, 8, 9].map(|id| used_by(&listed, id)), [Some(70), None, None]);
    }

    #[test]
    fn the_use_of_a_devices_memory_is_what_is_neither_free_nor_reserved() {
        let memory = MemoryInfo { free: 600, reserved: 50, total: 1000, used: 350, version: 0 };
        let expected = UsedMemory { total_bytes: 1000, used_bytes: 350, own_bytes: Some(70) };
        assert_eq!(use_of(&memory, Some(70)), expected);
    }

    #[test]
    fn a_device_is_found_by_its_address_or_else_by_its_uuid() {
        let hardware = |bus: &str, uuid: &str| Hardware {
            pci_bus: Some(bus.to_owned()).filter(|bus| !bus.is_empty()),
            uuid: Some(uuid.to_owned()).filter(|uuid| !uuid.is_empty()),
            ..Hardware::default()
        };
        let sensor_of = |hardware: &Hardware| {
            let at = |address: &str| (address == "0000:17:00.0").then(|| "at the address".to_owned());
            named(hardware, at, |name| Some(name.to_owned()))
        };
        let uuid = "0123456789abcdef0123456789abcdef";
        let name = "GPU-01234567-89ab-cdef-0123-456789abcdef";
        assert_eq!(sensor_of(&hardware("0000:17:00.0", uuid)).as_deref(), Some("at the address"));
        assert_eq!(sensor_of(&hardware("0000:17:00.0", "")).as_deref(), Some("at the address"));
        assert_eq!(sensor_of(&hardware("0000:18:00.0", uuid)).as_deref(), Some(name));
        assert_eq!(sensor_of(&hardware("", uuid)).as_deref(), Some(name));
        assert_eq!(sensor_of(&hardware("0000:18:00.0", "")), None);
    }

    /// A fake device for tests. The device reports every value if `reports` is true, and no value if
    /// `reports` is false.
    struct Fake {
        reports: bool,
        reasons: ThrottleReasons,
    }

    impl Source for Fake {
        fn clock_mhz(&self, clock: Clock) -> Option<u32> {
            let mhz = match clock {
                Clock::SM => 1980,
                Clock::Memory => 2619,
                _ => 345,
            };
            self.reports.then_some(mhz)
        }
        fn power_mw(&self) -> Option<u32> {
            self.reports.then_some(350_000)
        }
        fn temperature_c(&self) -> Option<u32> {
            self.reports.then_some(41)
        }
        fn throttle_reasons(&self) -> Option<ThrottleReasons> {
            self.reports.then_some(self.reasons)
        }
        fn energy_mj(&self) -> Option<u64> {
            self.reports.then_some(5_000_000_000)
        }
    }

    #[test]
    fn a_reading_has_megahertz_watts_degrees_and_millijoules() {
        let reasons = ThrottleReasons::empty();
        let reading = NvmlSensor(Fake { reports: true, reasons }).read();
        let shown = reading.shown;
        assert_eq!([shown.clock_mhz, shown.memory_clock_mhz], [Some(1980.0), Some(2619.0)]);
        assert!(shown.power_w.is_some_and(|power_w| (power_w - 350.0).abs() < 1e-9), "{shown:?}");
        assert_eq!((shown.temperature_c, shown.throttled, shown.energy_mj), (Some(41.0), false, None));
        // A counter of 32 bits would overflow at this value.
        assert_eq!(reading.energy_counter_mj, Some(5e9));
        assert_eq!(NvmlSensor(Fake { reports: false, reasons }).read(), Reading::default());
    }

    #[test]
    fn power_and_heat_throttle_a_device_and_idleness_and_users_do_not() {
        let throttled = |reasons| NvmlSensor(Fake { reports: true, reasons }).read().shown.throttled;
        for reason in [
            ThrottleReasons::SW_POWER_CAP,
            ThrottleReasons::HW_SLOWDOWN,
            ThrottleReasons::SW_THERMAL_SLOWDOWN,
            ThrottleReasons::HW_THERMAL_SLOWDOWN,
            ThrottleReasons::HW_POWER_BRAKE_SLOWDOWN,
        ] {
            assert!(throttled(reason) && throttled(reason | ThrottleReasons::GPU_IDLE), "{reason:?}");
        }
        for other in [
            ThrottleReasons::GPU_IDLE,
            ThrottleReasons::APPLICATIONS_CLOCKS_SETTING,
            ThrottleReasons::SYNC_BOOST,
        ] {
            assert!(!throttled(other), "{other:?}");
        }
    }
}
