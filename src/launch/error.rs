//! The errors because of which a frame cannot be prepared or cast.

use crate::device::{DeviceInfo, lacks_resources};
use crate::sensor::{UsedMemory, used_memory};
use crate::sources::some_of;
use ocl::enums::Status;
use thiserror::Error;

/// Why a frame cannot be prepared or cast: the device or its driver refused a step, the tree could not be built, a
/// kernel file of the user has a mistake, the strategy does not support the rays of a caller, or raycl has a bug.
#[derive(Debug, Error)]
pub enum LaunchError {
    /// OpenCL's own error.
    #[error("{0}")]
    OpenCl(String),
    /// OpenCL's error if memory or another resource is missing, on the device or on the host. Other processes may be
    /// using the missing memory.
    #[error("{0}")]
    Resources(String),
    /// The local size has more work-items than the kernel supports.
    #[error("the local size has {items} work-items; the compiled kernel {kernel} supports at most {most}")]
    WorkGroup {
        /// The kernel's name.
        kernel: String,
        /// Number of work-items that the kernel supports.
        most: usize,
        /// Number of work-items in the local size.
        items: usize,
    },
    /// No argument fits a parameter in the manifest: a bug in raycl.
    #[error("a bug in raycl: the kernel {kernel} has no argument for its parameter {parameter}")]
    Argument {
        /// The kernel's name.
        kernel: &'static str,
        /// The parameter, with its type.
        parameter: String,
    },
    /// The program lacks a kernel for one of a frame's tasks, such as shading (a role): a bug in raycl. A program
    /// contains only the kernels that its frames need.
    #[error("a bug in raycl: this program of the kernel family {family} has no kernel for {role}")]
    Kernel {
        /// The family's name.
        family: &'static str,
        /// The kernel's role.
        role: String,
    },
    /// A program with kernel files of the user lacks a kernel that raycl starts, or this kernel has other parameters
    /// than raycl's kernel: a mistake of the user.
    #[error("{0}")]
    OwnKernel(String),
    /// A kernel uses more `__local` memory than the headers of the user's files state: a mistake of the user.
    #[error("{0}")]
    OwnHeader(String),
    /// The strategy does not support rays that a caller provides. Only tests provide rays.
    #[error("{0}")]
    GivenRays(&'static str),
    /// The scene's tree could not be built.
    #[error("{0}")]
    Tree(String),
    /// The heap, the buffer from which a kernel allocates working vectors, was too small: the header of a kernel file
    /// states too few bytes.
    #[error(
        "the heap of the working vectors is too small: {used} values requested, {size} available; correct `bytes_per_ray` in the header of the kernel file for the axis `vectors`: it must count the bytes of every vector of a ray"
    )]
    HeapExhausted {
        /// Number of values requested.
        used: u64,
        /// Number of values that the heap holds.
        size: u64,
        /// Whether the program contains a kernel file that the user added or changed.
        has_own_file: bool,
    },
}

impl LaunchError {
    /// Turns `error`, because of which a program's kernel could not be made, into a [`LaunchError`]. `own_files` are
    /// the paths of the kernel files in the program that the user added or changed. If there are such files, they may
    /// lack the kernel, or declare other parameters.
    pub(crate) fn of_kernel(kernel: &str, own_files: &[String], error: ocl::Error) -> Self {
        let (status, files) = (error.api_status(), some_of(own_files));
        match status {
            _ if own_files.is_empty() => Self::from(error),
            Some(Status::CL_INVALID_KERNEL_NAME) => {
                let verb = if own_files.len() == 1 { "defines" } else { "define" };
                Self::OwnKernel(format!("{files} {verb} no kernel `{kernel}`, which raycl needs"))
            }
            _ if matches!(error, ocl::Error::Kernel(_)) || status.is_some_and(of_arguments) => {
                let why = without_frame(&error.to_string());
                let why = why.split(". ").next().unwrap_or_default();
                Self::OwnKernel(format!(
                    "the kernel `{kernel}` of a program with {files} has other parameters than raycl's kernel: {why}"
                ))
            }
            _ => Self::from(error),
        }
    }

    /// Returns the error about a kernel that uses `used` bytes of `__local` memory, although `stated` bytes follow from
    /// the headers of kernel files. `own_files` are those of the user's files whose headers may be wrong.
    pub(crate) fn of_local_memory(kernel: &str, [used, stated]: [u64; 2], own_files: &[String]) -> Self {
        let headers = if own_files.len() == 1 { "the header" } else { "the headers" };
        Self::OwnHeader(format!(
            "the kernel `{kernel}` uses {used} B of __local memory, but {stated} B follow from {headers} of {}: correct `memory`, `bytes_per_ray` or `copied`",
            some_of(own_files)
        ))
    }

    /// Returns the message of an error on a device. If memory may be missing, the message says how much of the
    /// device's memory other processes use.
    pub fn on(&self, device: &DeviceInfo) -> String {
        self.with(|| used_memory(&device.hardware))
    }

    fn with(&self, used: impl FnOnce() -> Option<UsedMemory>) -> String {
        let used = matches!(self, Self::Resources(_)).then(used).flatten();
        match used.filter(UsedMemory::may_be_others) {
            Some(used) => format!("{self}; {used}"),
            None => self.to_string(),
        }
    }
}

impl From<ocl::core::Error> for LaunchError {
    fn from(error: ocl::core::Error) -> Self {
        Self::from(ocl::Error::from(error))
    }
}

impl From<ocl::Error> for LaunchError {
    fn from(error: ocl::Error) -> Self {
        let message = without_frame(&error.to_string());
        match error.api_status().is_some_and(lacks_resources) {
            true => Self::Resources(message),
            false => Self::OpenCl(message),
        }
    }
}

/// Returns whether a driver returns this status if an argument does not fit its parameter.
fn of_arguments(status: Status) -> bool {
    matches!(
        status,
        Status::CL_INVALID_ARG_INDEX | Status::CL_INVALID_ARG_VALUE | Status::CL_INVALID_ARG_SIZE
    )
}

/// Rewrites a message of the `ocl` crate as a sentence: the OpenCL function and its status. The crate's message has a
/// frame of `#` around it and ends with a link.
fn without_frame(message: &str) -> String {
    let lines = message.lines().map(str::trim);
    let mut lines = lines.filter(|line| !line.is_empty() && !line.contains("####")).peekable();
    let function = lines.peek().and_then(|line| line.strip_prefix("Error executing function: "));
    if let Some(function) = function {
        lines.next();
        if let Some(status) = lines.peek().and_then(|line| line.strip_prefix("Status error code: ")) {
            return format!("{function} returned {status}");
        }
        return format!("{function} failed: {}", lines.collect::<Vec<_>>().join(" "));
    }
    lines.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn memory_that_others_use_is_reported_only_where_memory_may_be_missing() {
        let used = |used_bytes| Some(UsedMemory { total_bytes: 1000, used_bytes, own_bytes: Some(100) });
        let missing = LaunchError::Resources("clFinish returned -5".to_owned());
        assert_eq!(
            missing.with(|| used(900)),
            "clFinish returned -5; other processes use 800 B of the device's 1.0 kB of memory"
        );
        assert_eq!(missing.with(|| used(110)), "clFinish returned -5", "others use next to nothing");
        assert_eq!(missing.with(|| None), "clFinish returned -5");
        assert_eq!(LaunchError::OpenCl("no".to_owned()).with(|| used(900)), "no");
    }
}
