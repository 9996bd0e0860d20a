//! The device that the user names with `--device`, in the environment variable `RAYCL_DEVICE` or in the settings, or
//! that raycl chooses.

use crate::cache::Cache;
use crate::device::{Device, DeviceInfo, LaneTest, default_index, matching_indices, pick_one};
use crate::error::{Error, Result};
use crate::settings;
use crate::sources::Sources;

/// Returns the device that a command uses: the first usable device that matches `pattern`. Without `pattern`, returns
/// the first usable device that matches `RAYCL_DEVICE` or, if this variable is not set, the user's settings. If the
/// settings name no device either, returns the most capable device. Returns an error if no usable device matches, or if
/// no device is usable.
pub fn one_device(pattern: Option<&str>, sources: &Sources) -> Result<Device> {
    one_device_with(pattern, sources, LaneTest::Now)
}

/// Returns the index, in `infos`, of the device that [`one_device`] chooses. `word` is the text that
/// names a device in `RAYCL_DEVICE` or the user's settings. Returns an error if `pattern` or `word` matches
/// no usable device. Without `pattern` and `word`, returns `None` if no device is usable.
fn one_device_index(
    infos: &[DeviceInfo],
    pattern: Option<&str>,
    word: Option<String>,
) -> Result<Option<usize>> {
    match (pattern, word) {
        (Some(pattern), _) => Ok(matching_indices(infos, &[pattern.to_owned()])?.first().copied()),
        (None, Some(word)) => {
            Ok(matching_indices(infos, &[word]).map_err(settings::blame_device)?.first().copied())
        }
        (None, None) => Ok(default_index(infos)),
    }
}

/// Returns the index, in `infos`, of the device on which commands cast if no option names a device. `RAYCL_DEVICE` or,
/// without this variable, the user's settings may name a device; commands then cast on the first usable device that
/// matches this name. Without a name, commands cast on the most capable device; returns `None` if no device is usable.
///
/// # Errors
///
/// Fails if `RAYCL_DEVICE` or the user's settings name a device, but no usable device matches.
pub fn usual_device_index(infos: &[DeviceInfo]) -> Result<Option<usize>> {
    one_device_index(infos, None, settings::device())
}

/// Returns a device, chosen as [`one_device`] chooses it. If the cache has no up-to-date list of devices, `lane_test`
/// decides whether the devices' lane operations (such as ballots among work-items that execute together) are tested now
/// or later.
pub fn one_device_with(pattern: Option<&str>, sources: &Sources, lane_test: LaneTest) -> Result<Device> {
    let choose = |infos: &[DeviceInfo]| one_device_index(infos, pattern, settings::device());
    pick_one(&Cache::of_user(), sources, lane_test, choose)?.ok_or_else(|| {
        Error::run("no OpenCL device is usable")
            .with_help("`raycl devices` says why each device is not usable")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_several_devices_that_match_the_first_is_taken() {
        let infos = ["one", "two"]
            .map(|name| crate::device::tests::example("P", name, crate::device::DeviceKind::Cpu, 2));
        for (pattern, word) in [(Some("cpu"), None), (None, Some("cpu")), (Some("one"), Some("two"))] {
            let index = one_device_index(&infos, pattern, word.map(str::to_owned)).unwrap();
            assert_eq!(index, Some(0), "{pattern:?} {word:?}");
        }
        assert_eq!(one_device_index(&infos, None, Some("two".to_owned())).unwrap(), Some(1));
    }
}
