//! Checks that devices have the same model, driver and limits, so that it does not matter which of these
//! devices measures a point of an experiment.

use super::DeviceInfo;
use crate::error::{Error, Result};

/// Returns an error if devices differ in one of the properties in `facts`. The error names the first
/// difference.
pub fn check_alike(devices: &[&DeviceInfo]) -> Result<()> {
    let [first, others @ ..] = devices else { return Ok(()) };
    for other in others {
        for ((what, of_first), (_, of_other)) in facts(first).into_iter().zip(facts(other)) {
            if of_first != of_other {
                let message = format!(
                    "the devices differ, so points cannot be distributed over them; they differ in: {what}"
                );
                let help = format!(
                    "{}: {of_first}\n{}: {of_other}\nomit --spread, or choose equal devices with --device",
                    first.describe(),
                    other.describe()
                );
                return Err(Error::input(message).with_help(help));
            }
        }
    }
    Ok(())
}

/// Returns the names and values of the properties in which all devices must agree.
fn facts(device: &DeviceInfo) -> [(&'static str, String); 8] {
    let limits = &device.limits;
    let hardware = &device.hardware;
    [
        ("platform", format!("{} {}", device.platform, device.platform_version)),
        ("name", device.name.clone()),
        ("driver", device.driver.clone()),
        ("compute units", limits.compute_units.to_string()),
        ("global memory, bytes", limits.global_bytes.to_string()),
        ("__local memory, bytes", limits.local_bytes.to_string()),
        ("highest clock, MHz", format!("{:?}", hardware.max_clock_mhz)),
        ("compute capability", format!("{:?}", hardware.compute_capability)),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::DeviceKind;
    use super::super::tests::example;
    use super::*;

    #[test]
    fn twins_are_alike_and_others_are_told_apart() {
        let one = example("CUDA", "H200", DeviceKind::Gpu, 132);
        let mut twin = one.clone();
        twin.twins_before = 1;
        assert!(check_alike(&[&one, &twin, &twin]).is_ok() && check_alike(&[]).is_ok());
        let mut slow = twin.clone();
        slow.hardware.max_clock_mhz = Some(1500);
        let mut small = twin.clone();
        small.limits.compute_units = 66;
        let mut cramped = twin.clone();
        cramped.limits.local_bytes /= 2;
        for (other, what) in [(slow, "highest clock"), (small, "compute units"), (cramped, "__local memory")]
        {
            let error = check_alike(&[&one, &twin, &other]).expect_err("they differ");
            assert!(error.to_string().contains(what), "{error}");
            assert_eq!(error.exit_code(), 2);
        }
    }
}
