//! Properties of a device's hardware that OpenCL 1.2 alone does not report, or that not every driver reports:
//! compute capability, clock, timer, PCI bus, UUID. Drivers report most of this module's properties only with
//! an extension of OpenCL. The device is usable even if some of these properties are missing.

use serde::{Deserialize, Serialize};

/// Properties that only some drivers report; `None` if a driver does not report the property.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(default)]
pub struct Hardware {
    /// Compute capability, such as "9.0", which is queried with the extension cl_nv_device_attribute_query.
    pub compute_capability: Option<String>,
    /// The device's highest clock rate in MHz, as the driver reports it.
    pub max_clock_mhz: Option<u64>,
    /// Resolution of the timer with which the driver times kernels.
    pub timer_resolution_ns: Option<u64>,
    /// The device's PCI address: domain, bus, device and function, such as "0000:1b:00.0".
    pub pci_bus: Option<String>,
    /// The 16 bytes of the device's UUID as hexadecimal digits.
    pub uuid: Option<String>,
}

const MAX_CLOCK_FREQUENCY: u32 = 0x100C;
const PROFILING_TIMER_RESOLUTION: u32 = 0x1025;
const COMPUTE_CAPABILITY_MAJOR_NV: u32 = 0x4000;
const COMPUTE_CAPABILITY_MINOR_NV: u32 = 0x4001;
const PCI_BUS_ID_NV: u32 = 0x4008;
const PCI_SLOT_ID_NV: u32 = 0x4009;
const PCI_DOMAIN_ID_NV: u32 = 0x400A;
const PCI_BUS_INFO_KHR: u32 = 0x410F;
const UUID_KHR: u32 = 0x106A;

impl Hardware {
    /// Returns what distinguishes the device from all others of its model: its UUID or, if the UUID is
    /// unknown, its PCI address. Returns `None` if neither UUID nor PCI address is known.
    pub fn id(&self) -> Option<&str> {
        self.uuid.as_deref().or(self.pci_bus.as_deref())
    }

    /// Queries the properties of a device's hardware. The device supports the OpenCL extensions `extensions`.
    /// `ask` returns the bytes of the device's answer to a query, or `None` if the query fails.
    pub fn ask(extensions: &[String], ask: impl Fn(u32) -> Option<Vec<u8>>) -> Self {
        let has = |name: &str| extensions.iter().any(|extension| extension == name);
        let attributes = has("cl_nv_device_attribute_query");
        let number = |query| ask(query).and_then(|bytes| first_number(&bytes));
        let of_nv = |query| attributes.then(|| number(query)).flatten();
        let khr_bus = || has("cl_khr_pci_bus_info").then(|| bus_of(&ask(PCI_BUS_INFO_KHR)?)).flatten();
        let nv_bus = || {
            let (bus, slot) = (of_nv(PCI_BUS_ID_NV)?, of_nv(PCI_SLOT_ID_NV)?);
            Some(bus_name(of_nv(PCI_DOMAIN_ID_NV).unwrap_or(0), bus, slot >> 3, slot & 7))
        };
        let uuid = || has("cl_khr_device_uuid").then(|| uuid_of(&ask(UUID_KHR)?)).flatten();
        let capability = of_nv(COMPUTE_CAPABILITY_MAJOR_NV).zip(of_nv(COMPUTE_CAPABILITY_MINOR_NV));
        Self {
            compute_capability: capability.map(|(major, minor)| format!("{major}.{minor}")),
            max_clock_mhz: number(MAX_CLOCK_FREQUENCY).filter(|mhz| *mhz > 0),
            timer_resolution_ns: number(PROFILING_TIMER_RESOLUTION).filter(|ns| *ns > 0),
            pci_bus: khr_bus().or_else(nv_bus),
            uuid: uuid(),
        }
    }
}

/// Reads a driver's answer that is an integer of 4 or 8 bytes.
fn first_number(bytes: &[u8]) -> Option<u64> {
    match bytes.len() {
        4 => Some(u64::from(u32::from_ne_bytes(bytes.try_into().ok()?))),
        8 => Some(u64::from_ne_bytes(bytes.try_into().ok()?)),
        _ => None,
    }
}

/// Reads cl_device_pci_bus_info_khr: domain, bus, device, function.
fn bus_of(bytes: &[u8]) -> Option<String> {
    let (words, rest) = bytes.as_chunks::<4>();
    let words: Vec<u64> = words.iter().map(|word| u64::from(u32::from_ne_bytes(*word))).collect();
    match (words.as_slice(), rest) {
        (&[domain, bus, device, function], []) => Some(bus_name(domain, bus, device, function)),
        _ => None,
    }
}

fn bus_name(domain: u64, bus: u64, device: u64, function: u64) -> String {
    format!("{domain:04x}:{bus:02x}:{device:02x}.{function}")
}

fn uuid_of(bytes: &[u8]) -> Option<String> {
    let known = bytes.len() == 16 && bytes.iter().any(|byte| *byte != 0);
    known.then(|| bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extensions(names: &[&str]) -> Vec<String> {
        names.iter().map(|&name| name.to_owned()).collect()
    }

    fn word(value: u32) -> Option<Vec<u8>> {
        Some(value.to_ne_bytes().to_vec())
    }

    #[test]
    fn a_device_that_knows_the_queries_is_described() {
        // The numbers are those of Khronos's OpenCL headers. Numbers that begin with 0x10, except the UUID's, are
        // in CL/cl.h; the UUID's number and all others are in CL/cl_ext.h.
        let answers = |query: u32| match query {
            0x4000 => word(9),                               // CL_DEVICE_COMPUTE_CAPABILITY_MAJOR_NV
            0x4001 => word(0),                               // CL_DEVICE_COMPUTE_CAPABILITY_MINOR_NV
            0x4008 => word(0x1b),                            // CL_DEVICE_PCI_BUS_ID_NV
            0x4009 => word(0x08),                            // CL_DEVICE_PCI_SLOT_ID_NV
            0x400A => word(2),                               // CL_DEVICE_PCI_DOMAIN_ID_NV
            0x100C => word(1980),                            // CL_DEVICE_MAX_CLOCK_FREQUENCY
            0x1025 => Some(1000_u64.to_ne_bytes().to_vec()), // CL_DEVICE_PROFILING_TIMER_RESOLUTION
            0x106A => Some((0..16).collect()),               // CL_DEVICE_UUID_KHR
            _ => None,
        };
        let hardware =
            Hardware::ask(&extensions(&["cl_nv_device_attribute_query", "cl_khr_device_uuid"]), answers);
        assert_eq!(hardware.compute_capability.as_deref(), Some("9.0"));
        assert_eq!(hardware.pci_bus.as_deref(), Some("0002:1b:01.0"));
        assert_eq!((hardware.max_clock_mhz, hardware.timer_resolution_ns), (Some(1980), Some(1000)));
        assert_eq!(hardware.uuid.as_deref(), Some("000102030405060708090a0b0c0d0e0f"));
        assert_eq!(hardware.id(), hardware.uuid.as_deref());
        assert_eq!(Hardware { uuid: None, ..hardware.clone() }.id(), Some("0002:1b:01.0"));
        let khr: Vec<u8> = [1_u32, 0xc2, 3, 0].iter().flat_map(|n| n.to_ne_bytes()).collect();
        // CL_DEVICE_PCI_BUS_INFO_KHR in CL/cl_ext.h.
        let answers = |query: u32| (query == 0x410F).then(|| khr.clone());
        let hardware = Hardware::ask(&extensions(&["cl_khr_pci_bus_info"]), answers);
        assert_eq!(hardware.pci_bus.as_deref(), Some("0001:c2:03.0"));
    }

    #[test]
    fn a_device_that_knows_none_is_left_undescribed() {
        assert_eq!(Hardware::ask(&[], |_| None), Hardware::default());
        let odd = Hardware::ask(&extensions(&["cl_khr_pci_bus_info"]), |_| Some(vec![1, 2, 3]));
        assert_eq!(odd, Hardware::default());
        for bytes in [vec![1; 15], vec![1; 17], vec![0; 16], Vec::new()] {
            assert_eq!(uuid_of(&bytes), None, "{bytes:?}");
        }
    }
}
