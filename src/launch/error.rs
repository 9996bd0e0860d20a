//! Errors of a device or its driver.

use thiserror::Error;

/// A kernel launch that the device or its driver refused, or whose result is not valid.
#[derive(Debug, Error)]
pub enum LaunchError {
    /// OpenCL's own error.
    #[error("{0}")]
    OpenCl(String),
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
    #[error("the kernel {kernel} has no argument for its parameter {parameter}")]
    Argument {
        /// The kernel's name.
        kernel: &'static str,
        /// The parameter, with its type.
        parameter: String,
    },
    /// The program's family has no kernel for this role: a bug in raycl.
    #[error("the kernel family {family} has no kernel for {role}")]
    Kernel {
        /// The family's name.
        family: &'static str,
        /// The kernel's role.
        role: String,
    },
    /// The scene's tree could not be built.
    #[error("{0}")]
    Tree(String),
    /// The allocator in the kernel ran out of memory.
    #[error("the in-kernel heap is too small: {used} values requested, {size} available")]
    HeapExhausted {
        /// Number of values requested.
        used: u64,
        /// Number of values that the heap holds.
        size: u64,
    },
}

impl From<ocl::core::Error> for LaunchError {
    fn from(error: ocl::core::Error) -> Self {
        Self::from(ocl::Error::from(error))
    }
}

impl From<ocl::Error> for LaunchError {
    /// Keeps the status and the name of the OpenCL function that failed, without the formatting of the `ocl` crate.
    fn from(error: ocl::Error) -> Self {
        let message = error.to_string();
        let lines: Vec<_> = message
            .lines()
            .map(str::trim)
            .filter(|line| !line.is_empty() && !line.contains("####"))
            .collect();
        Self::OpenCl(lines.join(" "))
    }
}
