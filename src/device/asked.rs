//! Queries a device and reads the answers as raw bytes, so that a failed query, or an answer of an impossible length,
//! makes the device unusable, but does not stop raycl.

use super::limits::native_width;
use super::{DeviceLimits, LaneOperations};
use ocl::core::DeviceInfo as Query;

/// The reasons why a device is unusable if its driver lacks a feature. Only another driver can make such a device
/// usable.
const NO_COMPILER: &str = "its driver has no compiler for OpenCL C";
const NO_TIMES: &str = "its queues cannot time kernels (no profiling)";

/// Returns whether a device that is unusable for `reason` may soon be usable with the same driver. This is the case if
/// the device is not available now, or if a query failed.
pub(super) fn may_be_usable_soon(reason: &str) -> bool {
    ![NO_COMPILER, NO_TIMES].contains(&reason)
}

/// A device that is being queried, with the first query that failed.
pub(super) struct Asked {
    device: ocl::Device,
    failure: Option<String>,
}

impl Asked {
    /// Makes a device that has not been queried yet.
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
            is_cpu,
            lane_operations: LaneOperations::Barriers, // `inspect` may assume faster ones
        }
    }

    pub fn why_unusable(mut self) -> Option<String> {
        let available = self.number(Query::Available) != 0;
        let compiler = self.number(Query::CompilerAvailable) != 0;
        let profiling = self.number(Query::QueueProperties) & ocl::ffi::CL_QUEUE_PROFILING_ENABLE != 0;
        if self.failure.is_some() {
            return self.failure;
        }
        let reasons = [
            (available, "its driver says that it is not available"),
            (compiler, NO_COMPILER),
            (profiling, NO_TIMES),
        ];
        reasons.into_iter().find(|(fine, _)| !fine).map(|(_, reason)| reason.to_owned())
    }

    /// Queries a number of 4 or 8 bytes, the two sizes of scalars in OpenCL.
    pub fn number(&mut self, query: Query) -> u64 {
        self.numbers(query).first().copied().unwrap_or_default()
    }

    fn work_item_sizes(&mut self) -> [usize; 3] {
        let sizes = self.numbers(Query::MaxWorkItemSizes);
        std::array::from_fn(|axis| sizes.get(axis).map_or(1, |&size| size as usize))
    }

    pub fn text(&mut self, query: Query) -> String {
        let bytes = self.bytes(query);
        String::from_utf8_lossy(&bytes).trim_matches(|c: char| c == '\0' || c.is_whitespace()).to_owned()
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
        match ocl::core::get_device_info_raw(self.device.as_core(), query as u32) {
            Ok(bytes) => bytes,
            Err(error) => {
                self.fail(query, &error.to_string());
                Vec::new()
            }
        }
    }

    fn fail(&mut self, query: Query, answer: &str) {
        let answer = answer.split_whitespace().collect::<Vec<_>>().join(" ");
        self.failure
            .get_or_insert(format!("its driver gives no valid answer to the query {query:?}: {answer}"));
    }
}

/// Returns the 4-byte number or the 8-byte numbers in an answer; none if the answer has another length.
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
}
