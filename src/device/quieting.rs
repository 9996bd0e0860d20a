//! Keeps compilers from printing to the terminal.

use ocl::Device;
use ocl::enums::{DeviceInfo, DeviceInfoResult};

/// Returns a compiler option that stops a device's compiler from printing to the terminal. PoCL's prints the
/// number of warnings ("2 warnings generated."), including those in its own headers, and does not write them
/// to a log.
pub fn quieting(device: Device) -> &'static str {
    let platform = device.info(DeviceInfo::Platform).ok().and_then(|info| match info {
        DeviceInfoResult::Platform(platform) => ocl::Platform::new(platform).name().ok(),
        _ => None,
    });
    let pocl = platform.is_some_and(|name| name.to_lowercase().contains("portable computing language"));
    if pocl { "-w" } else { "" }
}
