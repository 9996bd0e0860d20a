//! Buffers, which OpenCL does not allow to be empty.

use super::Queue;
use ocl::{Buffer, MemFlags, OclPrm};

/// A buffer the kernels only read, holding `values`.
pub fn upload<T: OclPrm>(queue: &Queue, values: &[T]) -> ocl::Result<Buffer<T>> {
    let placeholder = [T::default()];
    let values = if values.is_empty() { &placeholder[..] } else { values };
    Buffer::builder()
        .queue(queue.commands.clone())
        .flags(MemFlags::READ_ONLY)
        .len(values.len())
        .copy_host_slice(values)
        .build()
}

/// A buffer of `len` values that kernels read and write.
pub fn allocate<T: OclPrm>(queue: &Queue, len: usize) -> ocl::Result<Buffer<T>> {
    Buffer::builder().queue(queue.commands.clone()).flags(MemFlags::READ_WRITE).len(len.max(1)).build()
}
