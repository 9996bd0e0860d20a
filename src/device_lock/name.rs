//! Names of device locks.

use crate::device::{DeviceInfo, DeviceKind};
use std::cmp::Ordering;
use std::fmt;

/// The name of a lock. All drivers for the host's processors, and the casters on the host, share one lock.
/// Two drivers that list the same device (but not the host's processors) share a lock if both report the same
/// UUID. If neither driver reports a UUID, the two drivers share a lock if both report the same PCI address.
/// If neither driver reports a UUID or a PCI address, each driver has a lock of its own. Names of the same
/// lock are equal, whatever their labels are.
#[derive(Clone, Debug)]
pub struct LockName {
    file: String,
    /// The device's name in messages. Drivers that share a lock may give the device different names.
    label: String,
}

impl PartialEq for LockName {
    fn eq(&self, other: &Self) -> bool {
        self.file == other.file
    }
}

impl Eq for LockName {}

impl PartialOrd for LockName {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for LockName {
    fn cmp(&self, other: &Self) -> Ordering {
        self.file.cmp(&other.file)
    }
}

impl LockName {
    /// Returns the name of a device's lock. The lock's name is made from the device's UUID. If the device has no UUID,
    /// the lock's name is made from the device's PCI address. If the device has no PCI address either, the lock's name
    /// is made from the device's platform, its name and, if several devices have this name, its number among them. For
    /// `None`, returns the name of the lock of the host's processors.
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

    /// Returns the name of the lock's file, without an extension.
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

    #[test]
    fn names_of_one_lock_are_equal_whatever_label_a_driver_gives_the_device() {
        let listed = |label: &str, uuid: &str| {
            let mut gpu = example("Intel", "Arc", DeviceKind::Gpu, 32);
            gpu.label = label.to_owned();
            gpu.hardware.uuid = Some(uuid.to_owned());
            LockName::of(Some(&gpu))
        };
        let (first, second) = (listed("Arc (Intel)", "00ff"), listed("Arc (rusticl)", "00ff"));
        assert_ne!(first.to_string(), second.to_string());
        assert_eq!((first.cmp(&second), &first), (Ordering::Equal, &second));
        assert_ne!(first, listed("Arc (Intel)", "00fe"), "another GPU of the same model");
    }
}
