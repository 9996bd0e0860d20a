//! What a device's lock is called.

use crate::device::{DeviceInfo, DeviceKind};
use std::fmt;

/// The same for all that share hardware: every driver of the host's processors, and casters without a driver, are one.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LockName {
    file: String,
    /// As messages name it.
    label: String,
}

impl LockName {
    /// The lock's name for a device: from its UUID or its place on the bus, else from its name. For none, the host's.
    pub fn of(device: Option<&DeviceInfo>) -> Self {
        let Some(info) = device.filter(|info| info.kind != DeviceKind::Cpu) else {
            return Self { file: "cpu".to_owned(), label: "the host's processors".to_owned() };
        };
        let hardware = &info.hardware;
        let uuid = hardware.uuid.as_ref().map(|uuid| format!("uuid-{uuid}"));
        let bus = hardware.pci_bus.as_ref().map(|bus| format!("pci-{}", bus.replace([':', '.'], "-")));
        let file = uuid.or(bus).unwrap_or_else(|| format!("name-{}", info.slug()));
        Self { file, label: info.label.clone() }
    }

    /// The name of its file, without an ending.
    pub fn file(&self) -> &str {
        &self.file
    }
}

impl fmt::Display for LockName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.label)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::tests::example;

    #[test]
    fn processors_are_one_device_and_other_devices_are_told_apart() {
        let file = |info: &DeviceInfo| LockName::of(Some(info)).file;
        let [pocl, intel] = ["PoCL", "Intel"].map(|platform| example(platform, "EPYC", DeviceKind::Cpu, 2));
        assert_eq!([file(&pocl), file(&intel)], ["cpu", "cpu"]);
        assert_eq!(LockName::of(None), LockName::of(Some(&pocl)));

        let mut gpu = example("CUDA", "H200", DeviceKind::Gpu, 132);
        assert_eq!(file(&gpu), "name-cuda-h200");
        let mut twin = gpu.clone();
        twin.twins_before = 1;
        assert_ne!(file(&gpu), file(&twin));
        gpu.hardware.pci_bus = Some("0000:1b:00.0".into());
        assert_eq!(file(&gpu), "pci-0000-1b-00-0");
        gpu.hardware.uuid = Some("00ff".into());
        assert_eq!(file(&gpu), "uuid-00ff");
    }
}
