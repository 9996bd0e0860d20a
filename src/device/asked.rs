//! Queries an OpenCL device for its properties, and reads the answers as raw bytes. A failed query, or an
//! answer of an impossible length, makes the device unusable, but does not stop raycl. There is one exception: if
//! the query HostUnifiedMemory fails, the device stays usable.

use super::direct::{device_answer, one_line};
use super::limits::native_width;
use super::{DeviceLimits, LaneOperations};
use ocl::core::DeviceInfo as Query;

/// The reasons for which a device stays unusable until it gets another driver: the driver lacks a feature that raycl
/// needs, or its version of OpenCL cannot be read. `TOO_OLD` and `UNREADABLE` contain only the beginning of a reason's
/// text.
const NO_COMPILER: &str = "its driver has no compiler for OpenCL C";
const NO_TIMES: &str = "its queues cannot time kernels (no profiling)";
const NO_GROUPS: &str = "its driver reports that a work-group can have at most 0 work-items";
const TOO_OLD: &str = "its driver supports OpenCL";
const UNREADABLE: &str = "its version of OpenCL cannot be read";

/// The oldest version of OpenCL that raycl can use: its major and its minor number.
const OLDEST: (u16, u16) = (1, 2);

/// Returns true if a device that is unusable for `reason` may soon be usable with the same driver: the device
/// is not available now, or a query failed.
pub(super) fn may_be_usable_soon(reason: &str) -> bool {
    let lasting = [NO_COMPILER, NO_TIMES, NO_GROUPS, TOO_OLD, UNREADABLE];
    !lasting.iter().any(|start| reason.starts_with(start))
}

/// Returns why raycl cannot use a device with the OpenCL version `version` (such as "OpenCL 1.1 A Driver");
/// `None` if this version is new enough.
fn unsuitable_version(version: &str) -> Option<String> {
    match numbers_of(version) {
        None => Some(format!("{UNREADABLE}: '{version}'")),
        Some(numbers) if numbers < OLDEST => {
            Some(format!("{TOO_OLD} {}.{}, but raycl needs {}.{}", numbers.0, numbers.1, OLDEST.0, OLDEST.1))
        }
        Some(_) => None,
    }
}

/// Returns the major and the minor number of a version such as "OpenCL 3.0 A Driver"; `None` if the text has another
/// form.
fn numbers_of(version: &str) -> Option<(u16, u16)> {
    let mut words = version.split_whitespace();
    words.next().filter(|word| word.eq_ignore_ascii_case("OpenCL"))?;
    let (major, minor) = words.next()?.split_once('.')?;
    Some((major.parse().ok()?, minor.parse().ok()?))
}

/// A device that is being queried, and a message about the first query that failed.
pub(super) struct Asked {
    device: ocl::Device,
    failure: Option<String>,
}

impl Asked {
    /// Returns an `Asked` for a device that has not been queried yet.
    pub fn new(device: ocl::Device) -> Self {
        Self { device, failure: None }
    }

    pub fn limits(&mut self, is_cpu: bool) -> DeviceLimits {
        DeviceLimits {
            local_bytes: self.number(Query::LocalMemSize),
            constant_bytes: self.number(Query::MaxConstantBufferSize),
            local_is_emulated: false,
            constant_is_emulated: false,
            global_bytes: self.number(Query::GlobalMemSize),
            allocation_bytes: self.number(Query::MaxMemAllocSize),
            work_group_size: self.number(Query::MaxWorkGroupSize) as usize,
            work_item_sizes: self.work_item_sizes(),
            compute_units: self.number(Query::MaxComputeUnits) as u32,
            native_width: native_width(is_cpu, self.number(Query::NativeVectorWidthFloat)),
            shares_memory: self.has(Query::HostUnifiedMemory),
            is_cpu,
            lane_operations: LaneOperations::Barriers, // the caller may set faster operations
        }
    }

    pub fn why_unusable(mut self) -> Option<String> {
        let available = self.number(Query::Available) != 0;
        let compiler = self.number(Query::CompilerAvailable) != 0;
        let profiling = self.number(Query::QueueProperties) & ocl::ffi::CL_QUEUE_PROFILING_ENABLE != 0;
        let groups = self.number(Query::MaxWorkGroupSize) > 0 && self.has_two_sides();
        let version = self.text(Query::Version);
        if self.failure.is_some() {
            return self.failure;
        }
        let reasons = [
            (available, "its driver says that the device is not available"),
            (compiler, NO_COMPILER),
            (profiling, NO_TIMES),
            (groups, NO_GROUPS),
        ];
        let reason = reasons.into_iter().find(|(fine, _)| !fine).map(|(_, reason)| reason.to_owned());
        reason.or_else(|| unsuitable_version(&version))
    }

    /// Returns true if a work-group may have at least one work-item along each of the two sides of a picture.
    fn has_two_sides(&mut self) -> bool {
        let sizes = self.numbers(Query::MaxWorkItemSizes);
        sizes.len() >= 2 && sizes.iter().take(2).all(|&size| size > 0)
    }

    /// Queries a property that is an integer of 4 or 8 bytes. Returns 0 if the query fails.
    pub fn number(&mut self, query: Query) -> u64 {
        self.numbers(query).first().copied().unwrap_or_default()
    }

    /// Returns true if the answer to a query is a number other than 0. If the query fails, returns false, and
    /// the device stays usable. The function is only for queries that a driver may reject, such as
    /// HostUnifiedMemory, which OpenCL 2 has deprecated.
    fn has(&self, query: Query) -> bool {
        let answer = device_answer(self.device, query as u32).unwrap_or_default();
        parse_numbers(&answer).first().is_some_and(|number| *number != 0)
    }

    fn work_item_sizes(&mut self) -> [usize; 3] {
        let sizes = self.numbers(Query::MaxWorkItemSizes);
        std::array::from_fn(|axis| sizes.get(axis).map_or(1, |&size| size as usize))
    }

    pub fn text(&mut self, query: Query) -> String {
        one_line(&self.bytes(query))
    }

    fn numbers(&mut self, query: Query) -> Vec<u64> {
        let bytes = self.bytes(query);
        let numbers = parse_numbers(&bytes);
        if numbers.is_empty() {
            self.fail(query, &format!("the answer has {} bytes", bytes.len()));
        }
        numbers
    }

    fn bytes(&mut self, query: Query) -> Vec<u8> {
        match device_answer(self.device, query as u32) {
            Ok(bytes) => bytes,
            Err(why) => {
                self.fail(query, &why);
                Vec::new()
            }
        }
    }

    fn fail(&mut self, query: Query, answer: &str) {
        self.failure
            .get_or_insert(format!("its driver gives no valid answer to the query {query:?}: {answer}"));
    }
}

/// Returns the integers in a device's answer: one integer of 4 bytes, or integers of 8 bytes. Returns no
/// integers if the length of the answer is neither 4 bytes nor a multiple of 8 bytes.
fn parse_numbers(bytes: &[u8]) -> Vec<u64> {
    if let Ok(word) = <[u8; 4]>::try_from(bytes) {
        return vec![u64::from(u32::from_ne_bytes(word))];
    }
    let (words, rest) = bytes.as_chunks::<8>();
    if rest.is_empty() { words.iter().map(|&word| u64::from_ne_bytes(word)).collect() } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_read_by_their_length() {
        assert_eq!(parse_numbers(&7_u32.to_ne_bytes()), [7]);
        assert_eq!(parse_numbers(&(1_u64 << 40).to_ne_bytes()), [1 << 40]);
        let sizes: Vec<u8> = [4096_u64, 64, 1].iter().flat_map(|size| size.to_ne_bytes()).collect();
        assert_eq!(parse_numbers(&sizes), [4096, 64, 1]);
        assert!(parse_numbers(&[1, 2, 3]).is_empty());
        assert!(parse_numbers(&[]).is_empty());
    }

    #[test]
    fn a_version_must_be_readable_and_new_enough() {
        for version in ["OpenCL 1.2 pocl", "OpenCL 2.0", "opencl 99.99 x", "OpenCL 3.0 PoCL 3.1"] {
            assert_eq!(unsuitable_version(version), None, "{version}");
        }
        let old = "its driver supports OpenCL 1.1, but raycl needs 1.2";
        assert_eq!(unsuitable_version("OpenCL 1.1 x").as_deref(), Some(old));
        for version in ["garbage", "", "OpenCL x.y", "OpenCL", "OpenCL 2"] {
            let expected = format!("its version of OpenCL cannot be read: '{version}'");
            assert_eq!(unsuitable_version(version), Some(expected.clone()));
            assert!(!may_be_usable_soon(&expected) && !may_be_usable_soon(old));
        }
        assert!(may_be_usable_soon("its driver says that the device is not available"));
    }

    #[test]
    fn a_device_whose_driver_lacks_a_feature_is_not_usable_soon() {
        for reason in [NO_COMPILER, NO_TIMES, NO_GROUPS] {
            assert!(!may_be_usable_soon(reason), "{reason}");
        }
        assert!(may_be_usable_soon(
            "its driver gives no valid answer to the query Version: the answer has 0 bytes"
        ));
    }
}
