//! Compilers that talk to the terminal.

use ocl::Device;
use ocl::enums::{DeviceInfo, DeviceInfoResult};

/// The option that keeps a device's compiler from it. PoCL's counts warnings on the terminal ("2 warnings generated."), of its own
/// headers among them, and keeps them in no log.
pub fn quieting(device: Device) -> &'static str {
    let platform = device.info(DeviceInfo::Platform).ok().and_then(|info| match info {
        DeviceInfoResult::Platform(platform) => ocl::Platform::new(platform).name().ok(),
        _ => None,
    });
    let pocl = platform.is_some_and(|name| name.to_lowercase().contains("portable computing language"));
    if pocl { "-w" } else { "" }
}
