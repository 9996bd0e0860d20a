//! What the errors of drivers mean.

use ocl::enums::Status;

/// Returns whether a driver returns this status if memory or another resource is missing. For example, if other
/// processes use nearly all memory of a GPU, NVIDIA's driver returns `CL_OUT_OF_HOST_MEMORY` when a context is made,
/// and `CL_MEM_OBJECT_ALLOCATION_FAILURE` when data is transferred.
pub fn lacks_resources(status: Status) -> bool {
    matches!(
        status,
        Status::CL_MEM_OBJECT_ALLOCATION_FAILURE
            | Status::CL_OUT_OF_RESOURCES
            | Status::CL_OUT_OF_HOST_MEMORY
    )
}

/// Returns whether a step that failed with this status may succeed later: memory may be free again, or the device is
/// not available now, for example because it is being reset or because another process uses it exclusively.
pub fn may_pass(status: Status) -> bool {
    lacks_resources(status) || matches!(status, Status::CL_DEVICE_NOT_AVAILABLE)
}

/// Returns the compiler's messages without the frames of `#` that the crate `ocl` adds.
pub fn compiler_log(message: &str) -> String {
    let lines: Vec<_> =
        message.lines().filter(|line| !line.contains("####") && !line.trim().is_empty()).collect();
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_or_resources_may_be_missing_by_the_status() {
        let missing = [
            Status::CL_MEM_OBJECT_ALLOCATION_FAILURE,
            Status::CL_OUT_OF_RESOURCES,
            Status::CL_OUT_OF_HOST_MEMORY,
        ];
        assert!(missing.into_iter().all(|status| lacks_resources(status) && may_pass(status)));
        let other = [Status::CL_INVALID_BUFFER_SIZE, Status::CL_INVALID_WORK_GROUP_SIZE, Status::CL_SUCCESS];
        assert!(!other.into_iter().any(may_pass));
        let reset = Status::CL_DEVICE_NOT_AVAILABLE;
        assert!(may_pass(reset) && !lacks_resources(reset));
    }

    #[test]
    fn a_compilers_log_has_no_frame() {
        let message = "\n###### OPENCL PROGRAM BUILD DEBUG OUTPUT ######\n\na.cl:1:1: error: no\n\n######\n";
        assert_eq!(compiler_log(message), "a.cl:1:1: error: no");
    }
}
