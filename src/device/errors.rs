//! Interprets the errors that OpenCL drivers return.

use ocl::enums::Status;

/// Returns true if a driver returns this status when memory or another resource is missing. For example, if
/// other processes use nearly all memory of a GPU, NVIDIA's driver returns `CL_OUT_OF_HOST_MEMORY` when a
/// context is made, and `CL_MEM_OBJECT_ALLOCATION_FAILURE` when data is transferred.
pub fn lacks_resources(status: Status) -> bool {
    matches!(
        status,
        Status::CL_MEM_OBJECT_ALLOCATION_FAILURE
            | Status::CL_OUT_OF_RESOURCES
            | Status::CL_OUT_OF_HOST_MEMORY
    )
}

/// Returns true if a step that failed with this status may succeed later. This is the case if a resource such as memory
/// is missing now, or if the device is not available now. For example, a device is not available while it is being
/// reset, or while another process uses it exclusively.
pub fn may_pass(status: Status) -> bool {
    lacks_resources(status) || matches!(status, Status::CL_DEVICE_NOT_AVAILABLE)
}

/// The failure of a call of an OpenCL function.
#[derive(Debug)]
pub struct CallError {
    /// The function and its status, or the compiler's messages.
    pub message: String,
    /// The status of the call; `None` if no status is known, for example because the compiler rejected a program.
    pub status: Option<Status>,
}

impl CallError {
    /// Returns an error without a status.
    pub fn new(message: String) -> Self {
        Self { message, status: None }
    }

    /// Returns true if the same call may succeed later.
    pub fn may_pass(&self) -> bool {
        self.status.is_some_and(may_pass)
    }
}

impl From<ocl::Error> for CallError {
    fn from(error: ocl::Error) -> Self {
        Self { message: without_frame(&error.to_string()), status: error.api_status() }
    }
}

impl From<ocl::core::Error> for CallError {
    fn from(error: ocl::core::Error) -> Self {
        Self::from(ocl::Error::from(error))
    }
}

/// The words before the name of the failed function in messages of the crate `ocl`.
pub const EXECUTING: &str = "Error executing function: ";

/// Rewrites a message of the `ocl` crate as a sentence: the OpenCL function and its status. The crate's message has a
/// frame of `#` around it and ends with a link.
pub fn without_frame(message: &str) -> String {
    let lines = message.lines().map(str::trim);
    let mut lines = lines.filter(|line| !line.is_empty() && !line.contains("####")).peekable();
    let function = lines.peek().and_then(|line| line.strip_prefix(EXECUTING));
    if let Some(function) = function {
        lines.next();
        if let Some(status) = lines.peek().and_then(|line| line.strip_prefix("Status error code: ")) {
            return format!("{function} returned {status}");
        }
        return format!("{function} failed: {}", lines.collect::<Vec<_>>().join(" "));
    }
    lines.collect::<Vec<_>>().join(" ")
}

/// The largest number of lines of a compiler's messages that are shown and stored.
const MOST_LINES: usize = 100;
/// The largest number of bytes of a compiler's messages that are shown and stored.
const MOST_BYTES: usize = 16 * 1024;

/// Returns a compiler's messages without blank lines. If the messages have more than `MOST_LINES` lines or
/// `MOST_BYTES` bytes, returns only the first lines, and then the number of the lines that were left out. If
/// the first line alone has too many bytes, returns the beginning of this line.
pub fn compiler_log(log: &str) -> String {
    let lines: Vec<_> = log.lines().filter(|line| !line.trim().is_empty()).collect();
    let (mut shown, mut bytes) = (0, 0);
    while shown < lines.len().min(MOST_LINES) && bytes + lines[shown].len() <= MOST_BYTES {
        bytes += lines[shown].len();
        shown += 1;
    }
    let mut text = lines[..shown].join("\n");
    if let Some(line) = lines.first().filter(|_| shown == 0) {
        // A character has at most four bytes in UTF-8.
        text = line.chars().take(MOST_BYTES / 4).chain("...".chars()).collect();
        shown = 1;
    }
    match lines.len() - shown {
        0 => text,
        others => format!("{text}\n... ({others} more lines)"),
    }
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
    fn a_compilers_log_has_no_blank_lines_and_a_long_one_is_cut() {
        assert_eq!(compiler_log("\na.cl:1:1: error: no\n\n  ^\n"), "a.cl:1:1: error: no\n  ^");
        assert_eq!(compiler_log(""), "");
        let lines: String = (0..1000).map(|number| format!("line {number}\n")).collect();
        let log = compiler_log(&lines);
        assert!(log.starts_with("line 0\n") && log.ends_with("line 99\n... (900 more lines)"), "{log}");
        let long = "\u{e9}".repeat(MOST_BYTES);
        let log = compiler_log(&format!("{long}\nb\n"));
        assert!(
            log.len() < MOST_BYTES + 40 && log.ends_with("\u{e9}...\n... (1 more lines)"),
            "{}",
            log.len()
        );
        let log = compiler_log(&format!("a\n{long}"));
        assert_eq!(log, "a\n... (1 more lines)");
    }

    #[test]
    fn a_message_is_the_function_and_its_status() {
        let message = "\n\n####### OPENCL ERROR ####### \n\nError executing function: clCreateBuffer  \n\n\
            Status error code: CL_INVALID_BUFFER_SIZE (-61)  \n\nPlease visit the following url for more \
            information: \n\nhttps://example.org/clCreateBuffer.html#errors  \n\n####### \n";
        assert_eq!(without_frame(message), "clCreateBuffer returned CL_INVALID_BUFFER_SIZE (-61)");
        assert_eq!(
            without_frame("Error executing function: clFinish\n\nno status"),
            "clFinish failed: no status"
        );
        assert_eq!(without_frame("a text\nof  two lines "), "a text of  two lines");
    }
}
