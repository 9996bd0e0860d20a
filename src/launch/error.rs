//! What a device or its driver refuses.

use thiserror::Error;

/// A launch the device or its driver refused, or whose result it did not vouch for.
#[derive(Debug, Error)]
pub enum LaunchError {
    /// What OpenCL said.
    #[error("{0}")]
    OpenCl(String),
    /// The built kernel holds fewer work-items than the local size has.
    #[error("the built kernel {kernel}: {items} work-items of the local size > {most} that it can hold")]
    WorkGroup {
        /// Its name.
        kernel: String,
        /// Work-items it can hold.
        most: usize,
        /// Work-items of the local size.
        items: usize,
    },
    /// Nothing fits a parameter that the manifest names: a mistake in the program.
    #[error("the kernel {kernel} has no argument for its parameter {parameter}")]
    Argument {
        /// Its name.
        kernel: &'static str,
        /// The parameter, with its type.
        parameter: String,
    },
    /// The program's family has no such kernel: a mistake in the program.
    #[error("the kernels of {family} have none for {role}")]
    Kernel {
        /// The family.
        family: &'static str,
        /// What it is for.
        role: String,
    },
    /// The scene's tree could not be made.
    #[error("{0}")]
    Tree(String),
    /// The in-kernel allocator asked for more than the pool holds.
    #[error("the in-kernel heap ran out: {used} of {size} values were asked for")]
    HeapExhausted {
        /// Values taken.
        used: u64,
        /// Values there are.
        size: u64,
    },
}

impl From<ocl::core::Error> for LaunchError {
    fn from(error: ocl::core::Error) -> Self {
        Self::from(ocl::Error::from(error))
    }
}

impl From<ocl::Error> for LaunchError {
    /// Keeps the status and the function, and drops `ocl`'s decoration.
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
