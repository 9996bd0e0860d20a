//! Buffers, which OpenCL does not allow to be empty.

use super::Queue;
use ocl::{Buffer, MapFlags, MemFlags, MemMap, OclPrm};
use std::ops::Range;

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

/// A buffer of `len` values the kernels only read, which `fill` writes: in place where the device shares the host's
/// memory, since touching memory for the first time costs more than what is written into it.
pub fn upload_with<T: OclPrm>(
    queue: &Queue,
    len: usize,
    fill: impl FnOnce(&mut [T]),
) -> ocl::Result<Buffer<T>> {
    if len == 0 || !queue.shares_memory {
        let mut values = vec![T::default(); len];
        fill(&mut values);
        return upload(queue, &values);
    }
    let commands = queue.commands.clone();
    let buffer = Buffer::builder().queue(commands).flags(MemFlags::READ_ONLY).len(len).build()?;
    let mut mapped = map(&buffer, MapFlags::new().write_invalidate_region())?;
    fill(&mut mapped);
    mapped.unmap().enq()?;
    Ok(buffer)
}

/// What `work` makes of some of a buffer's values: read in place where the device shares the host's memory.
pub fn read_with<T: OclPrm, R>(
    queue: &Queue,
    buffer: &Buffer<T>,
    values: Range<usize>,
    work: impl FnOnce(&[T]) -> R,
) -> ocl::Result<R> {
    if values.is_empty() {
        return Ok(work(&[]));
    }
    if !queue.shares_memory {
        let mut copy = vec![T::default(); values.len()];
        buffer.cmd().read(&mut copy[..]).offset(values.start).enq()?;
        return Ok(work(&copy));
    }
    let mut mapped = map(buffer, MapFlags::new().read())?;
    let result = work(&mapped[values]);
    mapped.unmap().enq()?;
    Ok(result)
}

fn map<T: OclPrm>(buffer: &Buffer<T>, flags: MapFlags) -> ocl::Result<MemMap<T>> {
    // SAFETY: the queue is in order and the call waits, so no command writes the buffer while it is mapped; it is
    // unmapped before anything else is enqueued.
    unsafe { buffer.map().flags(flags).enq() }
}

/// A buffer of `len` values that kernels read and write.
pub fn allocate<T: OclPrm>(queue: &Queue, len: usize) -> ocl::Result<Buffer<T>> {
    Buffer::builder().queue(queue.commands.clone()).flags(MemFlags::READ_WRITE).len(len.max(1)).build()
}
