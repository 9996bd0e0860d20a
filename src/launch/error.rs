//! The errors because of which a frame cannot be prepared or cast.

use crate::device::{DeviceInfo, lacks_resources, note_failure, without_frame};
use crate::manifest::GROUP_LANES;
use crate::sensor::{UsedMemory, used_memory};
use crate::sources::some_of;
use ocl::enums::Status;
use thiserror::Error;

/// The reason why a frame cannot be prepared or cast.
#[derive(Debug, Error)]
pub enum LaunchError {
    /// The text of an error that OpenCL returned.
    #[error("{0}")]
    OpenCl(String),
    /// OpenCL's error if memory or another resource is missing, on the device or on the host. Other processes may be
    /// using the missing memory.
    #[error("{0}")]
    Resources(String),
    /// The local size has more work-items than the kernel supports.
    #[error("the local size has {items} work-items; the compiled kernel {kernel} supports at most {most}")]
    WorkGroup {
        /// The name of the kernel that supports fewer work-items.
        kernel: String,
        /// Number of work-items that the kernel supports.
        most: usize,
        /// Number of work-items in the local size.
        items: usize,
    },
    /// The sub-groups of the kernel have more or fewer work-items than the 32 that share a tile.
    #[error(
        "the driver makes sub-groups of {size} work-items for the kernel {kernel}, which needs sub-groups of {needed}",
        needed = GROUP_LANES
    )]
    SubGroups {
        /// The name of the kernel.
        kernel: String,
        /// Number of work-items in a sub-group of the kernel.
        size: usize,
    },
    /// No argument fits a parameter in the manifest (raycl's table of kernels): a bug in raycl.
    #[error("a bug in raycl: the kernel {kernel} has no argument for its parameter {parameter}")]
    Argument {
        /// The name of the kernel that has this parameter.
        kernel: &'static str,
        /// The parameter that no argument fits, with its type.
        parameter: String,
    },
    /// The program has no kernel for some work, such as shading: a bug in raycl. A program may contain only some of its
    /// family's kernels.
    #[error("a bug in raycl: this program of the kernel family {family} has no kernel that {work}")]
    Kernel {
        /// The name of the program's kernel family.
        family: &'static str,
        /// The work for which the program lacks a kernel, in words such as "casts shadow rays".
        work: &'static str,
    },
    /// A mistake in kernel files that the user changed or added: the program lacks a kernel that raycl
    /// starts, or the kernel has other parameters than raycl's own kernel.
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
        "the heap of the working vectors is too small: {used} values requested, {size} available; \
         in the header of the kernel file for the axis `vectors`, correct `bytes_per_ray`, the number of bytes \
         of all vectors of a ray"
    )]
    HeapExhausted {
        /// Number of values that the kernel's work-items requested.
        used: u64,
        /// Number of values that the heap holds.
        size: u64,
        /// True if the program contains a kernel file that the user added or changed.
        has_own_file: bool,
    },
}

impl LaunchError {
    /// Returns the [`LaunchError`] for OpenCL's `error` about the kernel with the name `kernel`: OpenCL could
    /// not make the kernel or set its arguments. `own_files` are the paths of the program's kernel files that
    /// the user added or changed. If `own_files` is not empty, a missing kernel or a parameter that differs
    /// from raycl's is a mistake of the user, and the message names the files.
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
                let one_of = if own_files.len() == 1 { "" } else { "one of these files: " };
                Self::OwnKernel(format!(
                    "the kernel `{kernel}` has other parameters than raycl's kernel of this name ({why}); correct its \
                     parameters in {one_of}{files}"
                ))
            }
            _ => Self::from(error),
        }
    }

    /// Returns the error about a kernel that uses `used` bytes of `__local` memory, although the headers of
    /// kernel files imply only `stated` bytes. `own_files` are the paths of the user's files whose headers
    /// may be wrong.
    pub(crate) fn of_local_memory(kernel: &str, [used, stated]: [u64; 2], own_files: &[String]) -> Self {
        let headers = if own_files.len() == 1 { "the header" } else { "the headers" };
        Self::OwnHeader(format!(
            "the kernel `{kernel}` uses {used} B of __local memory, but according to {headers} of {}, it uses {stated} B: correct the key `memory`, `bytes_per_ray` or `copied`",
            some_of(own_files)
        ))
    }

    /// Returns the error's message. If memory may be missing, and other processes may use memory of `device`, the
    /// message says how much memory the other processes use. If this amount is not known, the message says how much
    /// memory all processes use.
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
        let status = error.api_status();
        let message = without_frame(&error.to_string()) + consequence(status);
        note_failure(&message);
        match status.is_some_and(lacks_resources) {
            true => Self::Resources(message),
            false => Self::OpenCl(message),
        }
    }
}

/// Returns what follows from `status`, as the end of a message; empty if the status says enough. raycl asks only for
/// the times of commands for which it has waited, so a kernel without times has failed. PoCL compiles a kernel when the
/// kernel starts; if this compilation fails, the missing times are the only sign of it.
fn consequence(status: Option<Status>) -> &'static str {
    match status {
        Some(Status::CL_PROFILING_INFO_NOT_AVAILABLE) => {
            ": a kernel has not run to its end; the driver may have failed to compile it for this local size"
        }
        _ => "",
    }
}

/// Returns true if drivers return `status` when an argument does not fit its parameter.
fn of_arguments(status: Status) -> bool {
    matches!(
        status,
        Status::CL_INVALID_ARG_INDEX | Status::CL_INVALID_ARG_VALUE | Status::CL_INVALID_ARG_SIZE
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::Role;

    #[test]
    fn a_missing_kernel_is_named_by_its_work() {
        let missing = LaunchError::Kernel { family: "tile_gpu", work: Role::Mark.work() };
        let expected = "a bug in raycl: this program of the kernel family tile_gpu has no kernel that decides \
                        which pixels get more samples";
        assert_eq!(missing.to_string(), expected);
    }

    #[test]
    fn a_status_that_hides_a_failed_kernel_is_explained() {
        let explained = consequence(Some(Status::CL_PROFILING_INFO_NOT_AVAILABLE));
        assert!(explained.starts_with(": a kernel has not run to its end"), "{explained}");
        assert_eq!([consequence(Some(Status::CL_OUT_OF_RESOURCES)), consequence(None)], ["", ""]);
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
